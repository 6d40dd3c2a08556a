"""Configurations: their text for --help, and what a checkpoint says of its own, which is neither interpolated nor trusted."""

from dataclasses import asdict, dataclass, field

import pytest
import torch

from kpopnet.errors import InputError
from kpopnet.programs.train import NetworkTrainingConfig
from kpopnet.runtime import hydra_app
from kpopnet.runtime.hydra_app import as_text, described_fields, resumed_config, settings, user_errors, with_comments


@pytest.fixture
def resume(monkeypatch):
    monkeypatch.setattr(hydra_app, "command_line_settings", list)
    return lambda saved: resumed_config(NetworkTrainingConfig(), saved, may_change=("workers",))


def test_the_saved_configuration_is_taken_up_again(resume):
    saved = asdict(NetworkTrainingConfig(seed=5))
    saved["data"]["train"] = "a folder"
    assert asdict(resume(saved)) == saved


@pytest.mark.parametrize("place", [("data", "train"), ("device",)])
@pytest.mark.parametrize("text", ["x${oc.env:SECRET,none}", "\\${oc.env:SECRET}", "???"])
def test_an_interpolation_is_refused_and_not_resolved(resume, monkeypatch, place, text):
    monkeypatch.setenv("SECRET", "hunter2")
    saved = asdict(NetworkTrainingConfig())
    holder = saved if len(place) == 1 else saved[place[0]]
    holder[place[-1]] = text
    with pytest.raises(InputError, match="nothing is interpolated") as refusal:
        resume(saved)
    assert "hunter2" not in str(refusal.value)


def test_settings_that_this_version_does_not_have_are_named_and_ignored(resume, capsys):
    saved = asdict(NetworkTrainingConfig(seed=5))
    saved["training"]["warmup"] = 0.07
    saved["colour"] = {"hue": 1}
    assert resume(saved).seed == 5
    assert "training.warmup=0.07, colour={'hue': 1}" in capsys.readouterr().err


@pytest.mark.parametrize(("place", "value"), [("seed", "x"), ("seed", -1), ("training", 3), ("model", {"widths": "wide"})])
def test_other_values_are_refused_in_one_line(resume, place, value):
    with pytest.raises(InputError) as refusal:
        resume(asdict(NetworkTrainingConfig()) | {place: value})
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("saved", ["a: ${oc.env:HOME}", None])
def test_a_configuration_that_is_no_object_is_refused(resume, saved):
    with pytest.raises(InputError, match="expected settings by name"):
        resume(saved)


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


def test_a_job_of_an_array_that_was_killed_is_one_line(capsys):
    utils = pytest.importorskip("submitit.core.utils")

    @user_errors
    def launch() -> None:
        raise utils.UncompletedJobError("Job 17 with path 17_result.pkl\nhas not produced any output (state: INTERRUPTED)")

    with pytest.raises(SystemExit) as ended:
        launch()
    assert ended.value.code == 1
    line = "error: Job 17 with path 17_result.pkl did not finish; what is finished stays: run the same command again\n"
    assert capsys.readouterr().err == line


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
