"""What a checkpoint says of its configuration is data: it is neither interpolated nor trusted."""

from dataclasses import asdict

import pytest
import torch
from damaged_files import HOSTILE_JSON

from kpopnet.errors import InputError
from kpopnet.programs.train import NetworkTrainingConfig
from kpopnet.runtime import hydra_app
from kpopnet.runtime.hydra_app import resumed_config, user_errors
from kpopnet.runtime.input_files import parse_json


@pytest.fixture
def resume(monkeypatch):
    monkeypatch.setattr(hydra_app, "command_line_settings", list)
    return lambda saved: resumed_config(NetworkTrainingConfig(), saved, may_change=("workers",))


def test_the_saved_configuration_is_taken_up_again(resume):
    saved = asdict(NetworkTrainingConfig(seed=5))
    saved["data"]["train"] = "a folder"
    assert asdict(resume(saved)) == saved


@pytest.mark.parametrize("place", [("data", "train"), ("data", "validation"), ("device",), ("seed",), ("training", "resume")])
@pytest.mark.parametrize("text", ["${oc.env:SECRET}", "x${oc.env:SECRET,none}", "\\${oc.env:SECRET}", "${seed}", "???"])
def test_an_interpolation_is_refused_and_not_resolved(resume, monkeypatch, place, text):
    monkeypatch.setenv("SECRET", "hunter2")
    saved = asdict(NetworkTrainingConfig())
    holder = saved if len(place) == 1 else saved[place[0]]
    holder[place[-1]] = text
    with pytest.raises(InputError, match="nothing is interpolated") as refusal:
        resume(saved)
    assert "hunter2" not in str(refusal.value)


def test_other_values_are_refused_in_one_line(resume):
    for hostile in HOSTILE_JSON:
        try:
            value = parse_json(hostile, "meta.json")
        except InputError:
            continue
        for place in (("data",), ("training",), ("seed",), ("model", "widths"), ("model", "crop_px"), ("sensor", "name")):
            saved = asdict(NetworkTrainingConfig())
            holder = saved if len(place) == 1 else saved[place[0]]
            holder[place[-1]] = value
            try:
                resume(saved)
            except InputError as error:
                assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.parametrize("saved", ["a: ${oc.env:HOME}", [], None, 3])
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
