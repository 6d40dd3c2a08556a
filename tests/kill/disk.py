"""The disk under a program: what is left of its folder when the power fails.

The model is that of journaling file systems (ext4, XFS, btrfs), in their worst legal state:

- Bytes that were written and not synced (fsync) are lost: the file is empty, or zeros, or ends half-way; one that was synced
  before has what it had then, or that and zeros.
- What happens to names (create, rename, remove, link) happens in its order: after the failure the folder is as it was at the
  failure, or as at the last fsync of any file or folder in it.

`power/sitecustomize.py` watches the program. Files are synced by Python's `os.fsync`; what libraries sync by themselves counts
as lost, so the model is at worst too strict.
"""

import json
import os
import random
import shutil
from pathlib import Path

from tests.kill.power.sitecustomize import FILE, FOLDER, listing, note_content, note_names

POWER = Path(__file__).with_name("power")


class Disk:
    """The disk under one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.shadow = folder, folder.with_name(f"{folder.name}.shadow")

    def begin(self, cut: int = 0) -> dict[str, str]:
        """Takes all that the folder holds for synced; the environment of a program that loses power before operation `cut`."""
        shutil.rmtree(self.shadow, ignore_errors=True)
        for part in ("synced", "inodes"):
            (self.shadow / part).mkdir(parents=True)
        for path in self.folder.rglob("*"):
            if path.is_file() and not path.is_symlink():
                note_content(str(path), str(self.shadow))
        note_names(str(self.folder), str(self.shadow))
        watched = {"POWER_FOLDER": str(self.folder), "POWER_SHADOW": str(self.shadow), "POWER_CUT": str(cut)}
        return watched | {"PYTHONPATH": os.pathsep.join(filter(None, (str(POWER), os.environ.get("PYTHONPATH"))))}

    @property
    def operations(self) -> int:
        """How many operations the program has done since `begin`."""
        count = self.shadow / "count"
        return count.stat().st_size if count.exists() else 0

    def fail(self, rng: random.Random) -> None:
        """Replaces the folder, in which no process works any more, by what is left of it."""
        now = listing(str(self.folder))
        names = now if rng.random() < 0.5 else json.loads((self.shadow / "names.json").read_text())
        kept = {}
        for name, (kind, inode) in sorted(names.items()):
            if kind == FILE:
                present = now.get(name, (kind, None))[1] == inode
                kept[name] = self._left_of((self.folder / name).read_bytes() if present else b"", inode, rng)
        shutil.rmtree(self.folder, ignore_errors=True)
        if names:
            self.folder.mkdir()
        for name, (kind, target) in sorted(names.items()):  # a folder comes before what is in it
            if kind == FILE:
                (self.folder / name).write_bytes(kept[name])
            elif kind == FOLDER:
                (self.folder / name).mkdir()
            else:
                (self.folder / name).symlink_to(target)

    def _left_of(self, written: bytes, inode: int, rng: random.Random) -> bytes:
        synced = self.shadow / "synced" / str(inode)
        before = synced.read_bytes() if synced.exists() else b""
        if synced.exists() and written in (before, b""):
            return before
        if before and written.startswith(before):
            return rng.choice((before, before + bytes(len(written) - len(before))))
        return rng.choice((b"", bytes(len(written)), written[: len(written) // 2]))
