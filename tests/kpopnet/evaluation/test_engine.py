"""The engine: rows in the order asked for, failures named, times without what is done only once."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.evaluation.engine import WARM_UP_FRAMES, Timed, device_of, run, stage
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.tracker.refine import FittedEstimator

CAMERA = Camera.centred(20.0, 4, 3)


def work(name: str) -> int:
    if name == "damaged":
        raise InputError("damaged.mat: not whole")
    with stage("tracker"), stage("frame 3"):
        return 12 // len(name)


def test_rows_come_in_order_and_what_fails_is_named_and_left_out(capfd):
    found, failed = run(work, ["four", "damaged", "", "ab"], 1, "a set")
    assert list(found.items()) == [("four", 3), ("ab", 6)]
    assert list(failed) == ["damaged", ""] and failed["damaged"] == "damaged.mat: not whole"
    assert failed[""].startswith("tracker: frame 3: ZeroDivisionError: ")
    assert "left out damaged: damaged.mat: not whole" in capfd.readouterr().err


def test_nothing_found_is_an_error_with_the_first_reason():
    with pytest.raises(InputError, match=r"a set: none of 2 gave figures; damaged: damaged\.mat: not whole"):
        run(work, ["damaged", ""], 1, "a set")


def test_the_first_frames_are_done_once_untimed():
    calls = []
    timed = Timed(lambda depth, camera, **more: calls.append((len(depth), more)) or len(depth))
    for frames in (40, 50):
        result, seconds = timed(np.zeros((frames, 3, 4)), CAMERA, start=1)
        assert result == frames and seconds >= 0
    assert calls == [(WARM_UP_FRAMES, {"start": 1}), (40, {"start": 1}), (50, {"start": 1})]


@pytest.mark.parametrize(("device", "clock"), [("cpu", time.process_time), ("cuda", time.perf_counter)])
def test_the_clock_is_that_of_what_the_network_works_on(device, clock):
    network = SimpleNamespace(backend=SimpleNamespace(device=torch.device(device)), estimate=len)
    assert Timed(len, device_of(FittedEstimator(network)))._clock is clock
    assert device_of(NetworkEstimator()) == "cpu"
