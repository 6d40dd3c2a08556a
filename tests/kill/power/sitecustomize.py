"""Loses power: Python loads this module in every process of a program that the harness kills (`tests.kill.disk`).

Below the folder `POWER_FOLDER` it counts the operations that change files: opening to write, rename, remove, link, mkdir,
rmdir, truncate (Python's audit events), and fsync. Before the operation of number `POWER_CUT` it kills all processes of the
program at once. At each fsync it notes, in the folder `POWER_SHADOW`, what a disk without power would keep:

    names.json    every name below the folder, with its inode, or where its link points
    synced/INODE  the content that a file had at its last fsync
    inodes/INODE  a second name of that file, so that no other file gets its number
    count         a byte for each operation so far
"""

import fcntl
import itertools
import json
import os
import shutil
import signal
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager

CHANGES = {
    "os.rename": (1, 3), "os.link": (1, 3), "os.symlink": (1, 2), "os.remove": (0, 1), "os.rmdir": (0, 1), "os.mkdir": (0, 2),
    "os.truncate": (0, None), "open": (0, None),
}  # fmt: skip
"""Audit events of operations that change files: which argument is the path, and which the folder it is relative to."""

FILE, FOLDER, LINK = "file", "folder", "link"

_numbers = itertools.count()


def listing(folder: str) -> dict[str, tuple[str, int | str]]:
    """The names below a folder: FILE and its inode, FOLDER, or LINK and where it points."""
    found: dict[str, tuple[str, int | str]] = {}
    for place, folders, files in os.walk(folder):
        for name in [*folders, *files]:
            path = os.path.join(place, name)
            try:
                status = os.lstat(path)
                kind = FOLDER if stat.S_ISDIR(status.st_mode) else LINK if stat.S_ISLNK(status.st_mode) else FILE
                found[os.path.relpath(path, folder)] = (kind, os.readlink(path) if kind == LINK else status.st_ino)
            except FileNotFoundError:  # another process has removed it
                pass
    return found


def note_content(path: str, shadow: str) -> None:
    """Notes the content of a file, which is on the disk now."""
    inode = os.stat(path).st_ino
    part = f"{shadow}/part.{os.getpid()}.{next(_numbers)}"
    shutil.copyfile(path, part)
    os.replace(part, f"{shadow}/synced/{inode}")
    if not os.path.exists(f"{shadow}/inodes/{inode}"):
        try:
            os.link(path, f"{shadow}/inodes/{inode}", follow_symlinks=True)
        except FileNotFoundError:  # it has no name any more
            os.remove(f"{shadow}/synced/{inode}")


def note_names(folder: str, shadow: str) -> None:
    """Notes all names below the folder, which are on the disk now: journals keep the order of what happens to names."""
    part = f"{shadow}/part.{os.getpid()}.{next(_numbers)}"
    with open(part, "w") as file:
        json.dump(listing(folder), file)
    os.replace(part, f"{shadow}/names.json")


@contextmanager
def alone(shadow: str) -> Iterator[None]:
    """One process at a time."""
    descriptor = os.open(f"{shadow}/lock", os.O_RDWR | os.O_CREAT)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def watch(folder: str, shadow: str, cut: int) -> None:
    """Counts, and loses power before operation `cut`, if it is one."""

    def is_below(path: object, place: object = -1) -> bool:
        if not isinstance(path, str | bytes | os.PathLike):
            return False
        whole = os.fsdecode(path)
        if isinstance(place, int) and place >= 0:
            whole = os.path.join(os.readlink(f"/proc/self/fd/{place}"), whole)
        return os.path.abspath(whole).startswith(folder + os.sep) or os.path.abspath(whole) == folder

    def step() -> None:
        with open(f"{shadow}/count", "ab", buffering=0) as file:
            file.write(b".")
            if file.tell() == cut:
                os.killpg(0, signal.SIGKILL)

    def heard(event: str, args: tuple) -> None:
        if event not in CHANGES:
            return
        if event == "open" and not (isinstance(args[2], int) and args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)):
            return
        path, place = CHANGES[event]
        if is_below(args[path], -1 if place is None else args[place]):
            step()

    def synced(descriptor: int, real=os.fsync) -> None:
        path = os.readlink(f"/proc/self/fd/{descriptor if isinstance(descriptor, int) else descriptor.fileno()}")
        if not is_below(path):
            return real(descriptor)
        step()
        real(descriptor)
        with alone(shadow):
            if os.path.isfile(path):
                note_content(path, shadow)
            note_names(folder, shadow)
        return None

    os.fsync = os.fdatasync = synced
    sys.addaudithook(heard)


if "POWER_FOLDER" in os.environ:
    watch(os.environ["POWER_FOLDER"], os.environ["POWER_SHADOW"], int(os.environ["POWER_CUT"]))
