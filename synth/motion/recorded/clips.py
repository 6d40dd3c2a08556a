"""Recorded motion: a folder of clips in the motion pack's format, or the user's own BVH files.

A motion pack is a folder with `index.csv` (one row per clip: clip_id, file, split, seconds, ...) and `clips/*.npz` with

    quat     int16 (T, 23, 4), local rotations w, x, y, z times 32767, relative to the T-pose
    root     float32 (T, 3), Hips in metres
    offsets  float32 (28, 3), rest offsets in metres
    fps      frames per second
    bad      bool (T,), frames in which the solver failed

The split is that of the index, in which no subject is in two of train, val and test. Bad frames are never returned.
"""

import csv
import io
import logging
import re
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, check_budget, expect, names_in, read_npz, read_text
from synth.motion.recorded.retargeting import bvh_motion
from synth.motion.skeleton import INDEX, NUM_JOINTS, NUM_POINTS, Motion, Poses, facing_front

log = logging.getLogger(__name__)

CACHED_FRAMES = 500_000
"""Largest number of frames of recordings kept in memory, about 200 MB; recordings that are dropped are read again."""

MAX_CLIP_S, MAX_ROOT_M = 1e5, 1e4

_COLUMNS = ("clip_id", "file", "split", "seconds")
_SECONDS = re.compile(r"[0-9]{1,9}(\.[0-9]{0,20})?([eE][-+]?[0-9]{1,3})?|\.[0-9]{1,20}")
_CLIP = {
    "quat": ArraySchema("if", ("frames", NUM_JOINTS, 4)),
    "root": ArraySchema("f", ("frames", 3)),
    "offsets": ArraySchema("f", (NUM_POINTS, 3)),
    "fps": ArraySchema("fiu", ()),
    "bad": ArraySchema("b", ("frames",), required=False),
}

_PACK_SPLITS = {"train": "train", "validation": "val", "test": "test"}


class _Recordings:
    """Sequences that are loaded when they are first used, with a cache. Single poses are drawn uniformly over time."""

    def __init__(self, seconds: Sequence[float]) -> None:
        self._ends = np.cumsum(seconds)
        self._loaded: dict[int, tuple[Motion, np.ndarray]] = {}

    def __len__(self) -> int:
        return len(self._ends)

    def _read(self, index: int) -> tuple[Motion, np.ndarray]:
        """The motion and (T,) bool: the good frames."""
        raise NotImplementedError

    def _recording(self, index: int) -> tuple[Motion, np.ndarray]:
        """The result of `_read`, cached."""
        if index not in self._loaded:
            self._loaded[index] = self._read(index)
            while len(self._loaded) > 1 and sum(len(motion) for motion, _ in self._loaded.values()) > CACHED_FRAMES:
                self._loaded.pop(next(iter(self._loaded)))
        return self._loaded[index]

    def clip_indices(self, category: str) -> list[int]:
        """Indices of the clips of a category, such as "dance"; of all clips if their categories are unknown."""
        return list(range(len(self)))

    def motion(self, index: int) -> Motion:
        """The longest run of good frames of clip number `index`."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        motion, good = self._recording(index)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
        starts, stops = edges[::2], edges[1::2]
        longest = int((stops - starts).argmax())
        part = slice(starts[longest], stops[longest])
        return Motion(motion.quats[part], motion.root_m[part], motion.fps, motion.name, motion.leg_m)

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """A random good frame per generator, rotated to face +Z. A clip is drawn in proportion to its length."""
        quats = np.empty((len(generators), NUM_JOINTS, 4), np.float32)
        root_m = np.zeros((len(generators), 3), np.float32)
        leg_m = np.empty(len(generators), np.float32)
        names = []
        for n, generator in enumerate(generators):
            clip = int(np.searchsorted(self._ends[:-1], generator.random() * self._ends[-1], side="right"))
            motion, good = self._recording(clip)
            frames = np.flatnonzero(good)
            frame = frames[int(generator.random() * len(frames))]
            quats[n], root_m[n, 1], leg_m[n] = motion.quats[frame], motion.root_m[frame, 1], motion.leg_m
            names.append(f"{motion.name}@{frame / motion.fps:.1f}s")
        return Poses(facing_front(quats), root_m, leg_m, names)


class Clips(_Recordings):
    """The clips of one split of a motion pack."""

    def __init__(self, folder: Path, split: str) -> None:
        """Reads the index.

        Raises:
            InputError: the index is damaged (`_read_index`), or has no clip of the split.
        """
        self._folder = Path(folder)
        index = self._folder / "index.csv"
        rows = _read_index(index)
        self._rows = [row for row in rows if row["split"] == _PACK_SPLITS[split]]
        if not self._rows:
            splits = sorted({row["split"] for row in rows})
            raise InputError(f"{index} lists no clip of split {_PACK_SPLITS[split]!r}, only of [{names_in(map(repr, splits))}]")
        super().__init__([float(row["seconds"]) for row in self._rows])

    def clip_indices(self, category: str) -> list[int]:
        return [number for number, row in enumerate(self._rows) if row.get("category", category) == category]

    def _read(self, index: int) -> tuple[Motion, np.ndarray]:
        row = self._rows[index]
        path = self._folder / row["file"]
        if not path.is_file():
            raise InputError(f"{path} is missing, though {self._folder / 'index.csv'} lists it")
        clip = read_npz(path, _CLIP)
        stored, root_m, offsets_m, fps = clip["quat"], clip["root"], clip["offsets"], float(clip["fps"])
        check_budget(path, 16 * stored.size, "its rotations")
        good = ~clip["bad"] if "bad" in clip else np.ones(len(stored), bool)
        leg_m = float(np.linalg.norm(offsets_m[[INDEX["LeftLeg"], INDEX["LeftFoot"]]].astype(float), axis=1).sum())
        usable = stored.any(axis=-1).all(axis=-1) & (np.abs(root_m) < MAX_ROOT_M).all(axis=-1)
        expect(good.any(), str(path), "some good frames")
        expect(bool(usable[good].all()), str(path), f"rotations other than 0, and hips within {MAX_ROOT_M:g} m, in good frames")
        expect(
            1 <= fps <= 1000 and 0.1 < leg_m < 3,
            str(path),
            f"1 to 1000 frames a second and a leg of 0.1 to 3 m, not {fps:g}, {leg_m:g}",
        )
        quats = stored.astype(np.float32)
        norm = np.linalg.norm(quats, axis=-1, keepdims=True)
        quats /= np.where(norm == 0, 1, norm)  # 0 in bad frames
        return Motion(quats, root_m.astype(np.float32), fps, f"clip:{row['clip_id']}", leg_m), good


def _read_index(path: Path) -> list[dict[str, str]]:
    """The rows of a motion pack's index, checked.

    Raises:
        InputError: the index cannot be read, lacks a column, or a row has a file outside the pack or no duration.
    """
    try:
        reader = csv.DictReader(io.StringIO(read_text(path), newline=""))
        rows, names = list(reader), reader.fieldnames or []
    except csv.Error as error:
        raise InputError(f"{path}: not a table of comma-separated values ({error})") from error
    for column in _COLUMNS:
        if column not in names:
            raise InputError(f"{path} has no column {column!r}; it has {names_in(map(str, names))}")
    for number, row in enumerate(rows, start=2):
        where = f"{path}, row {number}"
        expect(None not in row and all(isinstance(value, str) for value in row.values()), where, f"{len(names)} values")
        file, seconds = PurePosixPath(row["file"]), row["seconds"]
        inside = not file.is_absolute() and ".." not in file.parts and len(row["file"]) <= 200 and "\0" not in row["file"]
        expect(inside, where, f"a file inside the pack, not {row['file'][:60]!r}")
        expect(bool(_SECONDS.fullmatch(seconds)) and 0 < float(seconds) <= MAX_CLIP_S, where,
               f"a duration of 0 to {MAX_CLIP_S:g} seconds, not {seconds[:40]!r}")  # fmt: skip
    return rows


class BvhClips(_Recordings):
    """One BVH file or a folder of BVH files. All are read once at the start, so that a faulty file is found early.

    Of every SPLIT_PERIOD files, in the order of their names, one belongs to validation and one to test. Fewer files are
    used for all splits, with a warning: a measurement on them uses motions of the training set.
    """

    SPLIT_PERIOD = 8

    def __init__(self, path: Path, split: str, fps: float | None) -> None:
        """Reads the files of the split.

        Args:
            path: a BVH file or a folder of BVH files.
            split: train, validation or test.
            fps: the true frame rate of files that state a wrong one; None trusts the files.

        Raises:
            InputError: a file is malformed.
        """
        files = [path] if path.is_file() else sorted(path.glob("*.bvh"))
        if len(files) < self.SPLIT_PERIOD:
            log.warning("%s: %d BVH files are too few to split; %s uses them all", path, len(files), split)
        else:
            period = self.SPLIT_PERIOD
            kept = {"validation": [period - 2], "test": [period - 1]}.get(split, range(period - 2))
            files = [file for k, file in enumerate(files) if k % period in kept]
        self._files, self._fps = files, fps
        super().__init__([0.0] * len(files))
        motions = (self._recording(index)[0] for index in range(len(files)))
        self._ends = np.cumsum([len(motion) / motion.fps for motion in motions])

    def _read(self, index: int) -> tuple[Motion, np.ndarray]:
        motion = bvh_motion(self._files[index], self._fps)
        return motion, np.ones(len(motion), bool)


def open_clips(path: str, split: str, fps: float | None) -> Clips | BvhClips:
    """Opens the recordings at a path: a motion pack, a folder of BVH files or one BVH file.

    Args:
        path: the folder or file.
        split: train, validation or test.
        fps: the true frame rate of BVH files that state a wrong one; None trusts the files.

    Raises:
        InputError: the path holds no recordings, or a recording is malformed.
    """
    folder = Path(path)
    if (folder / "index.csv").is_file():
        return Clips(folder, split)
    if folder.suffix.lower() == ".bvh" and folder.is_file():
        return BvhClips(folder, split, fps)
    if folder.is_dir() and any(folder.glob("*.bvh")):
        return BvhClips(folder, split, fps)
    found = "does not exist" if not folder.exists() else "holds neither an index.csv nor *.bvh files"
    raise InputError(
        f"motion.path={path} {found}; expected a motion pack, BVH files or a folder of them. motion=choreography needs no data"
    )
