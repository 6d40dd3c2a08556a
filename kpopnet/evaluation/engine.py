"""One engine for all benchmarks: work on named sequences or dances in processes, in which what fails is left out and named."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

import numpy as np
from tqdm import tqdm

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.estimator import base_estimator
from kpopnet.runtime.parallel import in_processes

log = logging.getLogger(__name__)

Row = TypeVar("Row")

WARM_UP_FRAMES = 30


def _guarded(work: Callable[[str], Row], name: str) -> tuple[Row | None, str | None]:
    """What the work gives for a name, or why it is left out, in one line."""
    try:
        return work(name), None
    except Exception as error:
        text = str(error)
        if not isinstance(error, InputError):
            log.exception("%s failed", name)
            text = f"{type(error).__name__}: {error}"
        return None, ": ".join([*reversed(getattr(error, "__notes__", [])), text])


@contextmanager
def stage(label: str) -> Iterator[None]:
    """Puts a label, such as the estimator's name, before the reason of a failure inside."""
    try:
        yield
    except Exception as error:
        error.add_note(label)
        raise


def run(work: Callable[[str], Row], names: list[str], processes: int, where: str) -> tuple[dict[str, Row], dict[str, str]]:
    """Calls the work with every name, in processes of one thread each; the results do not depend on their number.

    The work, which is pickled, reads the sequence or dance of a name, runs every estimator on it and returns what the metrics
    are computed from. `where` is the benchmark, for the progress bar and messages. The results are what it gave for each name,
    and why the others are left out, both in the order given. Raises InputError if every item failed, or a process died.
    """
    outcomes = {}
    with tqdm(total=len(names), desc=where) as bar:
        for index, (row, reason) in in_processes(partial(_guarded, work), names, processes):
            outcomes[index] = row, reason
            if reason is not None:
                bar.write(f"left out {names[index]}: {reason}", file=sys.stderr)
            bar.update()
    in_order = [(name, *outcomes[index]) for index, name in enumerate(names)]
    failed = {name: reason for name, _, reason in in_order if reason is not None}
    if len(failed) == len(names):
        raise InputError(f"{where}: none of {len(names)} gave figures; {names[0]}: {failed[names[0]]}")
    return {name: row for name, row, reason in in_order if reason is None}, failed


def device_of(estimator: Any) -> str:
    """What an estimator's network works on: cpu or cuda."""
    base = base_estimator(estimator)
    return str(getattr(getattr(base, "backend", base), "device", "cpu"))


class Timed:
    """Calls with depth, camera and more, timed without compilation and caches: the first frames of the first are done twice.

    Times are of the processor, which other work on the machine does not lengthen, or of the wall clock on a GPU.
    """

    def __init__(self, call: Callable[..., Any], device: str = "cpu") -> None:
        """`device` is what the call works on: cpu or cuda."""
        self._call, self._warm, on_gpu = call, False, device != "cpu"
        self._clock = time.perf_counter if on_gpu else time.process_time

    def __call__(self, depth: np.ndarray, camera: Camera, **more: Any) -> tuple[Any, float]:
        """The result of the call, and its time in seconds."""
        if not self._warm:
            self._call(depth[:WARM_UP_FRAMES], camera, **more)
            self._warm = True
        start = self._clock()
        return self._call(depth, camera, **more), self._clock() - start
