"""The process pool."""

import math
import multiprocessing.synchronize
import os
import time
from functools import partial

import cv2
import pytest

from kpopnet.errors import InputError
from kpopnet.runtime.parallel import POLL_S, in_processes


def test_every_item_is_done_once_and_what_the_work_raises_goes_through():
    assert dict(in_processes(partial(pow, 2), list(range(6)), 1)) == {k: 2**k for k in range(6)}
    with pytest.raises(ValueError, match=r"nonnegative|math domain error"):
        list(in_processes(math.sqrt, [1.0, -1.0, 4.0], 2))


def test_a_process_that_dies_is_told_of_in_a_line():
    with pytest.raises(InputError, match=r"one of 2 processes died .* processes=1"):
        list(in_processes(os._exit, [3, 3], 2))


def test_where_processes_can_share_no_memory_it_says_so(monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(multiprocessing.synchronize._multiprocessing, "SemLock", refuse)  # as without /dev/shm
    with pytest.raises(InputError, match=r"processes cannot be started .*/dev/shm: let it be written, or use one process"):
        list(in_processes(math.sqrt, [1.0, 4.0], 2))


def test_here_the_work_has_one_thread_and_leaves_the_others_as_they_were():
    import torch  # not with this module, which other processes import for their work

    before = torch.get_num_threads(), cv2.getNumThreads()
    seen = [count for _, count in in_processes(lambda _: (torch.get_num_threads(), cv2.getNumThreads()), [0, 1], 1)]
    assert seen == [(1, 1), (1, 1)] and (torch.get_num_threads(), cv2.getNumThreads()) == before


def variable(name: str, count) -> str | None:
    """A variable of the environment, in two units of work."""
    count()
    time.sleep(2 * POLL_S)
    count()
    return os.getenv(name)


def test_other_processes_have_one_thread_and_tell_how_far_they_are_and_this_environment_stays():
    before, done = dict(os.environ), []
    counts = dict(in_processes(variable, ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"], 2, done.append))
    assert counts == {0: "1", 1: "1"} and dict(os.environ) == before
    assert sum(done) == 4


def asleep(seconds: float, count) -> None:
    count()
    time.sleep(seconds)


def test_an_interrupt_ends_the_processes_whatever_they_do():
    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        list(in_processes(asleep, [300, 300, 300], 2, interrupted))
    assert time.monotonic() - began < 100  # less than one of them sleeps
