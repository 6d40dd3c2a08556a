"""Files that are there whole or not at all."""

import itertools
import json
import os
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import h5py

MAX_NAME_BYTES = 255
_NUMBERS = itertools.count()


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A name beside `path`, hidden and ending with .tmp, to write to: what lies there replaces `path` in the end.

    Where the writing fails nothing is left of it; a process that is killed leaves the hidden file. Several machines may
    write into one folder. Raises OSError: a full or read-only disk, a missing folder, a name that is too long.
    """
    part = path.with_name(hidden_name(path.name))
    with naming(path, part):
        try:
            yield part
            sync(part)
            part.replace(path)
            sync(path.parent)
        finally:
            part.unlink(missing_ok=True)


def write_whole(path: Path, content: str | bytes) -> None:
    """Writes text in UTF-8, or bytes, whole or not at all."""
    with atomic_path(path) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def write_json(path: Path, content: Any, allow_nan: bool = True) -> None:
    """Writes JSON whole or not at all; its folder is made if it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(content, indent=1, allow_nan=allow_nan) + "\n")


def write_npz(path: Path, **arrays: Any) -> None:
    """Writes arrays by name into a compressed npz file, whole or not at all."""
    with atomic_path(path) as part, part.open("wb") as file:
        np.savez_compressed(file, **arrays)


def remove_unfinished(folder: Path, pattern: str | None = None) -> None:
    """Removes hidden files that killed processes left: those of a pattern, to which no process writes just now, and whatever
    else processes of this machine left in the folder that have ended, where /proc tells.
    """
    unfinished = set(folder.glob(pattern) if pattern else ())
    if Path("/proc/self").exists():
        of_this_machine = re.compile(rf"\..*\.{re.escape(socket.gethostname())}\.(\d+)-\d+\.tmp")
        for path in folder.glob(".*.tmp"):
            if (found := of_this_machine.fullmatch(path.name)) and not Path("/proc", found[1]).exists():
                unfinished.add(path)
    for path in unfinished:
        path.unlink(missing_ok=True)


def claim(path: Path) -> bool:
    """Makes an empty file, and whether this call made it: the file system gives a name to one writer alone."""
    try:
        path.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def sync(path: Path) -> None:
    """Waits until a file's content, or the names in a folder, are on the disk."""
    if os.name == "nt" and path.is_dir():  # Windows opens no folder, and syncs what may be written alone
        return
    descriptor = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def naming(path: Path, part: Path | None = None) -> Iterator[None]:
    """Gives this file's name to errors of the file system that name no file, as those of a full disk, or its hidden `part`."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename not in (None, part and str(part)):
            raise
        raise OSError(error.errno, error.strerror or "", str(path)) from error


def hidden_name(name: str) -> str:
    """A temporary name for a file, another one each time, of at most 255 bytes if the file's own name has no more."""
    end = f".{socket.gethostname()}.{os.getpid()}-{next(_NUMBERS)}.tmp"
    while len(os.fsencode(f".{name}{end}")) > MAX_NAME_BYTES:
        name = name[:-1]  # by letters: half a one is no name for macOS and Windows
    return f".{name}{end}"


@contextmanager
def atomic_hdf5(path: Path) -> Iterator["h5py.File"]:
    """An HDF5 file in memory, which replaces `path` in the end.

    A file on the disk that HDF5 cannot close, because the disk is full, lets the process crash when it ends.
    """
    import h5py

    with h5py.File(path.name, "w", driver="core", backing_store=False) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    write_whole(path, image)
