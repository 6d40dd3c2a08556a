"""Configurations: their text for --help, and what a checkpoint says of its own, which is neither interpolated nor trusted."""

from dataclasses import asdict, dataclass, field

import pytest
import torch

from kpopnet.errors import InputError
from kpopnet.programs.train import NetworkTrainingConfig
from kpopnet.runtime import hydra_app
from kpopnet.runtime.hydra_app import as_text, resumed_config, settings, user_errors, with_comments


@pytest.fixture
def resume(monkeypatch):
    monkeypatch.setattr(hydra_app, "command_line_settings", list)
    return lambda saved: resumed_config(NetworkTrainingConfig(), saved, may_change=("workers",))


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


def test_an_error_of_a_data_worker_is_told_without_torchs_traceback(capsys):
    class Torn(torch.utils.data.Dataset):
        def __len__(self) -> int:
            return 1

        def __getitem__(self, index: int) -> int:
            raise InputError("shard_00000.h5: torn")

    loader = torch.utils.data.DataLoader(Torn(), num_workers=1, multiprocessing_context="fork")
    with pytest.raises(SystemExit):
        user_errors(lambda: next(iter(loader)))()
    assert capsys.readouterr().err == "error: shard_00000.h5: torn\n"


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


def test_comments_stand_behind_the_settings_that_they_describe():
    yaml = "seed: 0\ninner:\n  width: 1\n  name: a\nother: null\nlist:\n- width: 3\n"
    found = with_comments(yaml, settings(Outer)).splitlines()
    assert found[0] == "seed: 0  # of everything." and found[3] == '  name: a  # which one: "a" or "b".'
    assert found[4] == "other: null  # or nothing." and found[6] == "- width: 3"
    lines = as_text({"a": "word " * 30, "b.c": ""}).splitlines()
    assert len(lines) > 1 and lines[0].startswith("  a  ") and lines[-1] == "  b.c"
