"""Locks on output folders: one writer for each, or one for each range of the files in it.

A lock is a POSIX record lock on the hidden file `.lock` of the folder: the kernel releases it when the process ends, however it
ends, and a file system that several machines share passes it between them.
"""

import errno
import os
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from kpopnet.errors import InputError

try:
    import fcntl
except ImportError:  # Windows: no locks
    fcntl = None

LOCK_FILE = ".lock"
EVERYTHING = range(2**62)
"""The range that overlaps with every other."""

PATIENCE_S = 2.0
"""How long a lock is waited for: a killed process needs a moment to end, another one looks whether it is alone."""

WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)

_open: dict[Path, tuple[int, list[range]]] = {}
"""The locks of this process: descriptor of the lock file, and the ranges held. Closing any descriptor of the file would release
them all, hence one for each folder. The same process may take a lock several times."""


@contextmanager
def locked(folder: Path | str, numbers: range = EVERYTHING) -> Iterator[None]:
    """Keeps other processes from writing into a folder, which is made if it is missing.

    Args:
        folder: the output folder.
        numbers: of the files that this process writes, by default all files of the folder. Processes whose ranges do not
            overlap write into one folder at the same time.

    Raises:
        InputError: another process writes there.
        OSError: the folder cannot be made or written to.
    """
    if fcntl is None or not numbers:
        yield
        return
    place = _take(Path(folder), numbers)
    try:
        yield
    finally:
        _give_back(place, numbers)


@contextmanager
def alone(folder: Path) -> Iterator[bool]:
    """Whether no other process holds a lock on this folder; as long as this lasts, none can get one."""
    if fcntl is None:
        yield True
        return
    place = folder.resolve()
    descriptor, held = _open.get(place, (None, []))
    if descriptor is None:
        with ExitStack() as stack:
            try:
                stack.enter_context(locked(folder))
            except InputError:
                yield False
            else:
                yield True
        return
    free = _try_lock(descriptor, EVERYTHING)
    try:
        yield free
    finally:
        if free:
            _keep_only(descriptor, held)


def _take(folder: Path, numbers: range) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    place = folder.resolve()
    until = time.monotonic() + PATIENCE_S
    while True:
        first = place not in _open
        descriptor, held = _open.get(place) or (os.open(place / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o666), [])
        if _try_lock(descriptor, numbers) and _is_there(place, descriptor):
            held.append(numbers)
            _open[place] = descriptor, held
            return place
        if first:
            os.close(descriptor)
        if time.monotonic() > until:
            what = "" if numbers == EVERYTHING else f" some of its files {numbers.start} to {numbers.stop - 1}"
            raise InputError(
                f"{folder}: another process writes{what} there (it holds {LOCK_FILE}); wait until it has ended, or give "
                "another folder"
            )
        time.sleep(0.1)


def _try_lock(descriptor: int, numbers: range) -> bool:
    assert fcntl is not None
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, len(numbers), numbers.start)
    except OSError as error:
        if error.errno in WITHOUT_LOCKS:
            print("this file system has no locks: see to it yourself that one process writes into a folder", file=sys.stderr)
            return True
        if error.errno not in (errno.EACCES, errno.EAGAIN):
            raise
        return False
    return True


def _is_there(place: Path, descriptor: int) -> bool:
    """Whether the locked file is still the one in the folder: the last process that leaves removes it."""
    try:
        found = (place / LOCK_FILE).stat()
    except FileNotFoundError:
        return False
    return os.path.samestat(found, os.fstat(descriptor))


def _keep_only(descriptor: int, held: list[range]) -> None:
    """Unlocks what lies outside the ranges held."""
    assert fcntl is not None
    end = 0
    for numbers in sorted(held, key=lambda one: one.start):
        if numbers.start > end:
            fcntl.lockf(descriptor, fcntl.LOCK_UN, numbers.start - end, end)
        end = max(end, numbers.stop)
    if end < EVERYTHING.stop:
        fcntl.lockf(descriptor, fcntl.LOCK_UN, EVERYTHING.stop - end, end)


def _give_back(place: Path, numbers: range) -> None:
    descriptor, held = _open[place]
    held.remove(numbers)
    if held:
        _keep_only(descriptor, held)
        return
    del _open[place]
    try:
        if _try_lock(descriptor, EVERYTHING):
            (place / LOCK_FILE).unlink(missing_ok=True)
    except OSError:
        pass  # the folder is gone, or cannot be written to any more
    finally:
        os.close(descriptor)
