"""Configurations: their text for --help, and what a checkpoint says of its own, which is neither interpolated nor trusted."""

from dataclasses import asdict, dataclass, field

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import ConfigCompositionException

from kpopnet.errors import InputError
from kpopnet.programs.train import NetworkTrainingConfig
from kpopnet.runtime import hydra_app
from kpopnet.runtime.hydra_app import as_text, readable, register_schemas, resumed_config, settings, with_comments


@pytest.fixture
def resume(monkeypatch):
    monkeypatch.setattr(hydra_app, "command_line_settings", list)
    return lambda saved: resumed_config(NetworkTrainingConfig(), saved, may_change=("workers",))


@pytest.mark.parametrize(
    ("given", "read"),
    [
        ("out=춤/data", "춤/data"),
        ("out=a (1)/it's", "a (1)/it's"),
        ("out=a b/c", "a b/c"),
        (r"out=C:\Users\Ann Lee\data", r"C:\Users\Ann Lee\data"),
        ("out=C:\\춤\\", "C:\\춤\\"),
        (r"out=C:\춤\'a'", r"C:\춤\'a'"),
        (r"out=\\nas\share\set", r"\\nas\share\set"),
        ("out='a,b'", "a,b"),
        ("out=[a,b]", ["a", "b"]),
        ("out=7", 7),
    ],
)
def test_a_path_needs_no_quotes(given, read):
    assert OverridesParser.create().parse_override(readable(given)).value() == read


@pytest.mark.parametrize("given", ["--cfg", "out=[a", "out='a", "~out", "out="])
def test_other_words_stay_as_they_are(given):
    assert readable(given) == given


@pytest.mark.parametrize("text", ["x${oc.env:SECRET,none}", "\\${oc.env:SECRET}", "???"])
def test_an_interpolation_is_refused_and_not_resolved(resume, monkeypatch, text):
    monkeypatch.setenv("SECRET", "hunter2")
    saved = asdict(NetworkTrainingConfig())
    saved["data"]["train"] = text
    with pytest.raises(InputError, match="nothing is interpolated") as refusal:
        resume(saved)
    assert "hunter2" not in str(refusal.value)


def test_settings_that_this_version_does_not_have_are_named_and_ignored(resume, capsys):
    saved = asdict(NetworkTrainingConfig(seed=5))
    saved["data"]["train"] = "a folder"
    old = saved | {"training": saved["training"] | {"warmup": 0.07}, "colour": {"hue": 1}}
    assert asdict(resume(old)) == saved
    assert "training.warmup=0.07, colour={'hue': 1}" in capsys.readouterr().err


@pytest.mark.parametrize("change", [{"seed": "x"}, {"seed": -1}, {"training": 3}, {"model": {"widths": "wide"}}])
def test_other_values_are_refused_in_one_line(resume, change):
    for saved in (asdict(NetworkTrainingConfig()) | change, "a: ${oc.env:HOME}"):
        with pytest.raises(InputError) as refusal:
            resume(saved)
        assert "\n" not in str(refusal.value)


def test_a_group_that_a_program_does_not_have_is_no_setting():
    refused = ConfigCompositionException(
        "Could not override 'sensor'.\nNo match in the defaults list.\nTo append to your default list use +sensor=kinect_2"
    )
    told = hydra_app._unknown_setting(refused, ["benchmark.seed", "sensors"])
    assert str(told) == "sensor: there is no such setting; did you mean sensors? --help lists them"
    assert hydra_app._unknown_setting(ConfigCompositionException("Could not override 'sensor'."), []) is None


@dataclass
class Inner:
    """Inside.

    Attributes:
        width, height: of an image, in pixels; the
            second line belongs here too.
    """

    width: int = 1
    height: int = 2
    silent: int = 0


@dataclass
class Outer(Inner):
    """Outside.

    Attributes:
        inner: what is inside.
        name: which one: "a" or "b".

    A paragraph after the section is no setting: none.
    """

    inner: Inner | None = field(default_factory=Inner)
    name: str = "a"


def test_comments_stand_behind_the_settings_that_they_describe():
    found = with_comments("width: 0\ninner:\n  height: 1\n  silent: 0\nname: a\nlist:\n- width: 3\n", settings(Outer))
    about = "of an image, in pixels; the second line belongs here too."
    assert found.splitlines() == [
        f"width: 0  # {about}", "inner:  # what is inside.", f"  height: 1  # {about}", "  silent: 0",
        'name: a  # which one: "a" or "b".', "list:", "- width: 3",
    ]  # fmt: skip
    lines = as_text({"a": "word " * 30, "b.c": ""}).splitlines()
    assert len(lines) > 1 and lines[0].startswith("  a  ") and lines[-1] == "  b.c"


@dataclass
class Other:
    """Beside.

    Attributes:
        width: of a wall.
        depth: of a hole.
    """

    width: int = 1
    depth: int = 2


def test_help_describes_the_settings_of_the_schema_that_is_chosen(monkeypatch):
    """Settings of several schemas that have one name mean different things."""
    for name in ("_group_help", "_group_texts"):
        monkeypatch.setattr(hydra_app, name, {})
    register_schemas("kinds", {"inner": Inner, "other": Other}, place="place")
    texts = {given: hydra_app._texts_of_help(Outer, given) for given in ((), ("place=inner",), ("place=other",))}
    widths = [one["place.width"] for one in texts.values()]
    assert widths == ["of a wall.", settings(Inner)["width"], "of a wall."]
    assert [set(one) >= {"place.height", "name"} for one in texts.values()] == [True, True, False]
    assert ["place.depth" in one for one in texts.values()] == [True, False, True]
