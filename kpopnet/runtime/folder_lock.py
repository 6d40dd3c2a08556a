"""Locks on output folders: one writer for each.

A lock is a lock of the operating system on the hidden file `.lock` of the folder: it ends with the process, however that ends,
and a file system that several machines share passes it between them.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from kpopnet.errors import InputError

LOCK_FILE = ".lock"
PATIENCE_S = 2.0
"""How long a lock is waited for: a killed process needs a moment to end."""


@contextmanager
def locked(folder: Path | str, name: str = LOCK_FILE) -> Iterator[None]:
    """Keeps other processes from writing into a folder, which is made if it is missing, or raises InputError.

    A process may take a lock twice. Processes that write different files of one folder take locks of different names.
    """
    Path(folder).mkdir(parents=True, exist_ok=True)
    lock = FileLock(Path(folder).resolve() / name, timeout=PATIENCE_S, thread_local=False, is_singleton=True)
    try:
        lock.acquire()
    except Timeout:
        raise InputError(
            f"{folder}: another process writes there (it holds {name}); wait until it has ended, or give another folder"
        ) from None
    try:
        yield
    finally:
        if lock.lock_counter == 1:  # while it is held: a process that waits for the removed file opens the next one
            with suppress(PermissionError):  # Windows removes no open file; there filelock removes it once it is released
                Path(lock.lock_file).unlink(missing_ok=True)
        lock.release()
