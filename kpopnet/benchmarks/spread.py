"""Work on many items, spread over processes: the same results whatever their number."""

import multiprocessing
import os
import pickle
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

import cv2
import torch

from kpopnet.errors import InputError

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def spread(work: Callable[[Any], Any], items: list, processes: int) -> Iterator[tuple[int, Any]]:
    """Yields (index, work(items[index])) in the order in which they are finished.

    Every process has a copy of `work`, to which it may hold on from item to item, and one thread. With one process, or
    one item, the work is done here.

    Args:
        work: can be pickled, if there are several processes.
        items: what to call it with.
        processes: how many.

    Raises:
        InputError: a process died. What `work` raises goes through.
    """
    processes = min(processes, len(items))
    if processes <= 1:
        with _one_thread():
            yield from ((index, work(item)) for index, item in enumerate(items))
        return
    with _environment(ONE_THREAD):
        # Spawned, not forked: a forked child would inherit threads half-way through.
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(processes, context, initializer=_start, initargs=(pickle.dumps(work),))
        try:
            futures = {pool.submit(_work_on, item): index for index, item in enumerate(items)}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool as error:
            raise InputError(
                f"one of {processes} processes died (out of memory, or killed); processes=1 needs the least memory"
            ) from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


_work: Callable[[Any], Any] | None = None


def _start(pickled_work: bytes) -> None:
    global _work
    threading.Thread(target=_end_with_parent, daemon=True).start()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    _work = pickle.loads(pickled_work)


def _end_with_parent() -> None:
    """A worker whose parent was killed would finish the queue and then wait for ever."""
    multiprocessing.parent_process().join()
    os._exit(1)


def _work_on(item: Any) -> Any:
    return _work(item)


@contextmanager
def _one_thread() -> Iterator[None]:
    threads = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads[0])
        cv2.setNumThreads(threads[1])


@contextmanager
def _environment(variables: dict[str, str]) -> Iterator[None]:
    """What processes started inside inherit."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value
