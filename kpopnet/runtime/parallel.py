"""The process pool: work on many items, with the same results whatever the number of processes."""

import errno
import multiprocessing
import os
import pickle
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

import cv2

from kpopnet.errors import InputError
from kpopnet.runtime.compilation import announce_compilation
from kpopnet.runtime.cpu import ONE_THREAD, bounded_processes, keep_freed_memory

POLL_S = 0.2
"""How often the parent process looks at what the workers have counted."""


class WorkerDiedError(InputError):
    """A worker process ended by itself: killed, or out of memory."""


def in_processes(
    work: Callable[..., Any], items: list, processes: int, on_progress: Callable[[int], object] | None = None
) -> Iterator[tuple[int, Any]]:
    """Yields (index, work(items[index])) in the order in which the items are finished.

    Every process holds a copy of `work`, which must be picklable and may keep state from item to item, and computes on one
    thread. With one process, or one item, this process does the work. Worker processes end when this process ends, however it
    ends. With `on_progress`, `work` gets a second argument, a function that it calls after each unit of work; `on_progress` is
    called in this process with the number of units done since its last call. Raises WorkerDiedError if a worker process ended
    by itself; what `work` raises goes through.
    """
    processes = min(bounded_processes(processes), len(items))
    if processes <= 1:
        count = (lambda: on_progress(1),) if on_progress else ()
        with _one_thread():
            yield from ((index, work(item, *count)) for index, item in enumerate(items))
        return
    with _environment(ONE_THREAD):
        # Spawned, not forked: a forked child would inherit threads, locks and GL state half-way through.
        context = multiprocessing.get_context("spawn")
        others = set(multiprocessing.active_children())
        try:
            counter = context.Value("q", 0) if on_progress else None
            pool = ProcessPoolExecutor(processes, context, initializer=_start_worker, initargs=(pickle.dumps(work), counter))
        except OSError as error:  # a container or a chroot without shared memory
            if error.errno == errno.EMFILE:
                raise
            why = f"processes cannot be started ({error}); they share memory, on Linux in /dev/shm"
            raise InputError(f"{why}: let it be written, or use one process (processes=1)") from error
        reported = 0
        try:
            waiting = {pool.submit(_work_on, item): index for index, item in enumerate(items)}
            while waiting:
                finished, _ = wait(waiting, POLL_S if on_progress else None, FIRST_COMPLETED)
                if on_progress and counter and (done := counter.value) > reported:
                    on_progress(done - reported)
                    reported = done
                for future in finished:
                    yield waiting.pop(future), future.result()
        except BrokenProcessPool as error:
            raise WorkerDiedError(
                f"one of {processes} processes died (out of memory, or killed); processes=1 needs the least memory"
            ) from error
        except KeyboardInterrupt:
            # They would finish what they do, and begin what was queued. Files appear whole or not at all.
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


_work: Callable[..., Any] | None = None
_counter: Any = None


def _start_worker(pickled_work: bytes, counter: Any) -> None:
    global _work, _counter
    end_with_parent()
    if multiprocessing.current_process().name.endswith("-1"):
        announce_compilation()
    keep_freed_memory()
    _set_threads(1, 1)
    _work, _counter = pickle.loads(pickled_work), counter


def _work_on(item: Any) -> Any:
    assert _work is not None  # set by _start_worker
    return _work(item) if _counter is None else _work(item, _count)


def _count() -> None:
    with _counter.get_lock():
        _counter.value += 1


def end_with_parent() -> None:
    """Ends this worker process as soon as its parent process has ended; without it, a worker would wait for ever."""
    if parent := multiprocessing.parent_process():
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()


def _set_threads(of_torch: int, of_opencv: int) -> None:
    if torch := sys.modules.get("torch"):  # where nothing has loaded torch, nothing computes with it
        torch.set_num_threads(of_torch)
    cv2.setNumThreads(of_opencv)


@contextmanager
def _one_thread() -> Iterator[None]:
    torch = sys.modules.get("torch")
    before = torch.get_num_threads() if torch else 1, cv2.getNumThreads()
    _set_threads(1, 1)
    try:
        yield
    finally:
        _set_threads(*before)


@contextmanager
def _environment(variables: dict[str, str]) -> Iterator[None]:
    """What processes started inside inherit."""
    before = {name: os.environ[name] for name in variables if name in os.environ}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables.keys() - before.keys():
            del os.environ[name]
        os.environ.update(before)
