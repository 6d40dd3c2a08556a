"""Each language has every text with the same gaps, every text of the page and of the feedback is in it, and texts read well."""

import ast
import copy
import json
import pickle
import re
from functools import cache

import pytest
from programs import ROOT

from kpopnet.dance.dimensions.movement import FIGURES
from kpopnet.dance.dimensions.stage import DIMENSIONS
from kpopnet.dance.window import PARTS
from kpopnet.dance.words.moments import _WORDS as DIRECTIONS
from kpopnet.dance.words.moments import at, from_to, lateness, posture_text
from kpopnet.languages import LANGUAGES, Said, catalogue, in_language, keyed
from synth.dances.live import FAULTS, SKILLS

OTHERS = [one for one in LANGUAGES if one != "en"]
GAP = re.compile(r"\{\w+\}")
STRING = r'"(?:[^"\\]|\\.)*"'
LITERAL = re.compile(rf"{STRING}(?:\s*\+\s*{STRING})*")
SIDES, DANCERS = ("left", "right"), ("teacher", "learner")
COMPOSED = {
    *(f"skill|{one}" for one in SKILLS), *(f"fault|{one or 'none'}" for one in FAULTS),
    *(f"by {one}" for one in ("name", "difficulty", "tempo", "length")),
    *(f"a loop, {one}" for one in ("house", "bounce", "slow")),
    *PARTS, *(f"{side} {joint}" for side in SIDES for joint in ("elbow", "knee")),
    *(f"the {name} {how}" for name in DANCERS for how in ("mirrored", "swapped", "reflected")),
    "no person in the picture", *(f"{kind}s out of the picture" for kind in ("arm", "leg")),
    *(f"{side} {kind} out of the picture" for side in SIDES for kind in ("arm", "leg")),
    *DIMENSIONS, *(word for one in DIMENSIONS.values() for pair in one.words for word in pair), *FIGURES,
    *(word for _, *pair in DIRECTIONS.values() for word in pair), "a little late", "a little early",
    "source|webcam", "source|recording", "a RealSense camera", "an OAK camera",
    "the process that watches you has ended; start the dance again",
}  # fmt: skip
"""Texts that the code puts together, or gets from elsewhere, before it looks them up."""


def page_texts() -> str:
    """The sources of the dancer's pages: not those of the raters, and of a camera that is watched."""
    folder = ROOT / "kpopnet" / "teacher" / "page"
    return "\n".join(path.read_text() for path in sorted(folder.glob("*.js")) if path.stem not in ("rate", "watch"))


@cache
def python_texts() -> tuple[set[str], set[str]]:
    """Every literal text of kpopnet, f-strings left out, and those of them that are passed to `Said`."""
    texts, said = set[str](), set[str]()
    for path in (ROOT / "kpopnet").rglob("*.py"):
        for one in ast.walk(ast.parse(path.read_text())):
            if isinstance(one, ast.Constant) and isinstance(one.value, str):
                texts.add(one.value)
            if isinstance(one, ast.Call) and one.args and isinstance(one.func, ast.Name) and one.func.id == "Said":
                given = [one.args[0].body, one.args[0].orelse] if isinstance(one.args[0], ast.IfExp) else one.args[:1]
                said |= {text.value for text in given if isinstance(text, ast.Constant) and text.value}
    return texts, said


def in_script(source: str) -> set[str]:
    """The texts in quotation marks of a script, sums of them as one."""
    return {"".join(json.loads(part) for part in re.findall(STRING, one)) for one in LITERAL.findall(source)}


@pytest.mark.parametrize("language", OTHERS)
def test_a_language_has_every_text_with_the_same_gaps_and_no_other(language):
    texts, page, shell = catalogue(language), page_texts(), (ROOT / "kpopnet/teacher/page/index.html").read_text()
    marked = set(re.findall(r"data-say>([^<]+)<", shell))
    said = {
        one
        for call in re.findall(rf"\bsay\((?:[^(){{}}\"]*\? )?({LITERAL.pattern}(?: : {STRING})?)", page)
        for one in in_script(call)
    }
    assert len(said) > 150 and len(marked) > 8
    in_python, said_in_python = python_texts()
    assert (said | said_in_python | marked | COMPOSED) - texts.keys() == set()
    assert texts.keys() - in_script(page) - in_python - marked - COMPOSED == set()
    for english, text in texts.items():
        assert text and sorted(GAP.findall(text)) == sorted(GAP.findall(english)), english
        assert (english[0] == " ", english[-1] == " ") == (text[0] == " ", text[-1] == " "), english


def test_no_korean_particle_depends_on_what_fills_a_gap():
    """은/는, 이/가 and others are chosen by the last sound of the word before, which a gap does not have."""
    particles = "은|는|이|가|을|를|과|와|로|으로|이?나|이?랑|이에요|예요|이?라|이?라고|이?고|이?며|이?면|이?야|이?든"
    depends = re.compile(rf"\}}[)'\"]*(?:{particles})(?![가-힣])")
    assert depends.search("{name}은 (이미)") and depends.search("({name})을")
    assert [text for text in catalogue("ko").values() if depends.search(text)] == []


def test_left_and_right_are_the_same_in_each_language():
    sides = {"en": r"(\bleft\b)|\bright\b", "ko": "(왼)|오른", "de": "(?i)(link)|recht"}
    right = {"Parts of the body: orange is wrong, blue is right", "right nearly throughout: {parts}"}  # not wrong
    for english in catalogue("ko").keys() - right:
        told = [bool(side) for side in re.findall(sides["en"], english)]
        for one in OTHERS if told else ():
            assert [bool(side) for side in re.findall(sides[one], catalogue(one)[english])] == told, (one, english)


def test_dancers_are_addressed_in_one_way():
    """In German as du, in Korean politely but not formally."""
    formal = {"de": r"\b(?:Sie|Ihnen|Ihre?[nmrs]?)\b", "ko": "니다|시오(?![가-힣])"}
    assert [text for one, how in formal.items() for text in catalogue(one).values() if re.search(how, text)] == []


def test_numbers_are_written_as_the_language_writes_them():
    """Percent signs stand apart in German, and not in Korean; German decimals have a comma."""
    strange = {"de": r"[\d}]%|\d\.\d", "ko": r"[\d}] %"}
    addresses = re.compile(r"https?://\S+")
    texts = {one: [addresses.sub("", text) for text in catalogue(one).values()] for one in strange}
    assert [text for one, how in strange.items() for text in texts[one] if re.search(how, text)] == []


def test_feedback_is_said_in_each_language():
    fault = Said("{what} {when}", what=posture_text("left arm", "left elbow", -24.6, "too bent"), when=at([1, 5, 72]))
    assert [in_language(fault, one) for one in LANGUAGES] == [
        "left elbow 25° too bent at 0:01, 0:05 and 1:12",
        "0:01, 0:05, 1:12에 왼쪽 팔꿈치 25° 너무 굽힘",
        "linker Ellbogen 25° zu stark gebeugt bei 0:01, 0:05 und 1:12",
    ]
    assert [in_language(lateness(-0.24, None), one) for one in LANGUAGES] == ["0.2 s early", "0.2초 빠름", "0,2 s zu früh"]
    assert in_language(lateness(0.25, 0.5), "de") == "einen halben Schlag zu spät"
    other = Said("{what} {when}", what=Said("danced what belongs at {time}", time="0:12"), when=from_to(4, 8))
    assert in_language(other, "ko") == "0:04~0:08 다른 부분(0:12)의 안무를 춤"  # which of the times is which
    small = Said("{what}, {percent}% of the teacher's", what=Said("movements too small"), percent="59")
    text = in_language(Said("{what} {when}", what=small, when=Said("throughout")), "de")
    assert text == "Bewegungen zu klein, 59 % des Coachs (durchgehend)"
    assert in_language("no person seen", "ko") == "사람이 안 보여요" and in_language("take.2.npz", "de") == "take.2.npz"


def test_a_text_remains_what_it_is_elsewhere():
    fault = Said("{part} {direction}", part=Said("left arm"), direction=Said("too low"))
    for copied in (pickle.loads(pickle.dumps(fault)), copy.deepcopy(fault)):
        assert copied == "left arm too low" and in_language(copied, "de") == "linker Arm zu tief"
    assert json.dumps({"text": fault}) == '{"text": "left arm too low"}'
    told = keyed({"texts": [fault, "left arm"], "total": 3.5})
    assert told == {
        "texts": [{"say": "{part} {direction}", "part": {"say": "left arm"}, "direction": {"say": "too low"}}, "left arm"],
        "total": 3.5,
    }
