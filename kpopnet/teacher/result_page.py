"""What the pages of results draw, packed; and the page of `kpopnet score`: one file that needs no network and no server."""

import base64
import html
import json
import re
from importlib.resources import files

from kpopnet.dance.performance import Performance
from kpopnet.dance.words.moments import PHRASE_S
from kpopnet.languages import in_language, keyed
from kpopnet.teacher.library import TeacherBody, stored_quats
from kpopnet.teacher.posing import MAX_S, Movement, learners_movement
from kpopnet.viz.view_page import packed

FPS = 30.0
MODULES = {"three": "teacher/page/vendor/three.js", "ko": "languages/ko.mjs", "de": "languages/de.mjs"} | {
    name: f"teacher/page/{name}.js" for name in ("memory", "words", "tools", "flat", "body", "practice", "result", "score")
}
"""The modules of the page by their names in it."""

_IMPORT = re.compile(r'from "[./]*(?:vendor/|languages/)?(\w+)\.m?js"')


def packed_body(body: TeacherBody) -> dict:
    """The body, as JSON."""
    return {
        "names": body.bone_names.tolist(),
        "parents": body.bone_parents.tolist(),
        "heads_m": body.heads_m.round(5).tolist(),
        "t_pose": body.t_pose.round(6).tolist(),
        "vertices_m": packed(body.vertices_m.astype("<f4")),
        "faces": packed(body.faces.astype("<u2")),
        "weight_bones": packed(body.weight_bones.astype("u1")),
        "weights": packed(body.weights.astype("<f4")),
    }


def packed_movement(moved: Movement) -> dict:
    """A movement, as JSON."""
    quats, hips_m = packed(stored_quats(moved.quats).astype("<i2")), packed(moved.hips_m.astype("<f4"))
    return {"fps": moved.fps, "begin_s": moved.begin_s, "quats": quats, "hips_m": hips_m}


def result_page(
    title: str,
    body: TeacherBody,
    dances: tuple[Performance, Performance],
    result: dict,
    notes: list[str],
    phrase_s: float = PHRASE_S,
    language: str = "en",
) -> str:
    """A result, of `kpopnet.teacher.live.words.score_result`, as the teacher's page shows it, with notes, in one of
    `kpopnet.languages.LANGUAGES`. `dances` are the teacher's and the learner's, of which MAX_S are replayed, from the learner's
    begin on where the dance is longer; `phrase_s` is the length of the result's phrases.
    """
    title = in_language(title, language)
    from_s, to_s = float(dances[0].times_s[0]), float(dances[0].times_s[-1])
    replayed_s = max(from_s, min(float(dances[1].times_s[0]), to_s - MAX_S))
    teacher, learner = (_replayed(one, replayed_s, body) for one in dances)
    found = {"name": title, "from_s": from_s, "to_s": to_s, **result, "hints": notes + result["hints"]}
    dance = {"seconds": to_s - from_s, "phrase_s": phrase_s, "first_s": result["phrases"][0]["start_s"], **teacher}
    given = json.dumps({"found": keyed(found), "dance": dance, "movement": learner, "body": packed_body(body)}, allow_nan=False)
    root = files("kpopnet")
    sources = {name: _IMPORT.sub(r'from "\1"', (root / path).read_text(encoding="utf-8")) for name, path in MODULES.items()}
    modules = {name: base64.b64encode(text.encode()).decode() for name, text in sources.items()}
    parts = {
        "title": html.escape(title),
        "language": language,
        "noscript": in_language("This page needs JavaScript; score.json beside it holds the same numbers and words.", language),
        "style": (root / "teacher/page/style.css").read_text(encoding="utf-8"),
        "modules": json.dumps({"imports": {name: f"data:text/javascript;base64,{text}" for name, text in modules.items()}}),
        "given": given.replace("<", "\\u003c"),
    }
    shell = (root / "teacher/page/score.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], shell)


def _replayed(dance: Performance, from_s: float, body: TeacherBody) -> dict:
    """The movement of a dance on the teacher's body, as JSON."""
    kept = (dance.times_s >= from_s) & (dance.times_s <= from_s + MAX_S)
    shown = Performance(dance.joints_m[kept], dance.times_s[kept], dance.confidence[kept])
    return packed_movement(learners_movement(shown, FPS, body))
