"""Settings described on the command line by the docstrings of the dataclasses that hold them."""

from dataclasses import dataclass, field

from kpopnet.runtime.hydra_app import as_text, described_fields, settings, with_comments


@dataclass
class Base:
    """A base.

    Attributes:
        seed: of everything.
    """

    seed: int = 0


@dataclass
class Inner:
    """Inside.

    Attributes:
        width, height: of an image, in pixels; the
            second line belongs here too.
        name: which one: "a" or "b".
    """

    width: int = 1
    height: int = 2
    name: str = "a"
    silent: int = 0


@dataclass
class Outer(Base):
    """Outside.

    Attributes:
        inner: what is inside.
        other: or nothing.

    A paragraph after the section is no setting: none.
    """

    inner: Inner = field(default_factory=Inner)
    other: Inner | None = None


def test_every_field_gets_the_text_of_its_class_or_base():
    assert described_fields(Outer) == {"seed": "of everything.", "inner": "what is inside.", "other": "or nothing."}
    size = "of an image, in pixels; the second line belongs here too."
    assert described_fields(Inner) == {"width": size, "height": size, "name": 'which one: "a" or "b".'}


def test_settings_are_named_with_dots_through_nested_and_optional_dataclasses():
    found = settings(Outer)
    assert found["inner.name"] == 'which one: "a" or "b".' and found["other.width"].startswith("of an image")
    assert found["inner.silent"] == "" and set(found) >= {"seed", "inner", "inner.height", "other.name"}


def test_help_holds_every_name_and_wraps_long_texts(monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    lines = as_text({"a": "word " * 30, "b.c": ""}).splitlines()
    assert len(lines) > 3 and max(map(len, lines)) <= 60
    assert lines[0].startswith("  a ") and lines[-1] == "  b.c"


def test_comments_stand_behind_the_settings_that_they_describe():
    yaml = "seed: 0\ninner:\n  width: 1\n  name: a\nother: null\nlist:\n- width: 3\n"
    found = with_comments(yaml, settings(Outer)).splitlines()
    assert found[0] == "seed: 0  # of everything." and found[3] == '  name: a  # which one: "a" or "b".'
    assert found[4] == "other: null  # or nothing." and found[6] == "- width: 3"
