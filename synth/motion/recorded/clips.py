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
from collections.abc import Callable, Sequence
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

SPLIT_PERIOD = 8
"""Of as many BVH files, in the order of their names, one belongs to validation and one to test. Fewer files are used for all
splits, with a warning: a measurement on them uses motions of the training set."""

_CLIP = {
    "quat": ArraySchema("if", ("frames", NUM_JOINTS, 4)),
    "root": ArraySchema("f", ("frames", 3)),
    "offsets": ArraySchema("f", (NUM_POINTS, 3)),
    "fps": ArraySchema("fiu", ()),
    "bad": ArraySchema("b", ("frames",), required=False),
}

_PACK_SPLITS = {"train": "train", "validation": "val", "test": "test"}

Recording = tuple[Motion, np.ndarray]
"""A motion, and (T,) bool: its good frames."""


class Recordings:
    """Sequences that are loaded when they are first used, with a cache. Single poses are drawn uniformly over time."""

    def __init__(
        self, read: Callable[[int], Recording], categories: Sequence[str | None], seconds: Sequence[float] = ()
    ) -> None:
        """Reads every recording once if their lengths are not given.

        Args:
            read: number of a recording to its content.
            categories: of each recording, such as "dance"; None where it is unknown.
            seconds: length of each recording.
        """
        self._read, self._categories = read, categories
        self._loaded: dict[int, Recording] = {}
        motions = (self._recording(index)[0] for index in range(len(self)))
        self._ends = np.cumsum(seconds or [len(motion) / motion.fps for motion in motions])

    def __len__(self) -> int:
        return len(self._categories)

    def _recording(self, index: int) -> Recording:
        if index not in self._loaded:
            self._loaded[index] = self._read(index)
            while len(self._loaded) > 1 and sum(len(motion) for motion, _ in self._loaded.values()) > CACHED_FRAMES:
                self._loaded.pop(next(iter(self._loaded)))
        return self._loaded[index]

    def clip_indices(self, category: str) -> list[int]:
        """Numbers of the recordings of a category, and of those whose category is unknown."""
        return [number for number, known in enumerate(self._categories) if known in (None, category)]

    def motion(self, index: int) -> Motion:
        """The longest run of good frames of recording number `index`."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        motion, good = self._recording(index)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
        starts, stops = edges[::2], edges[1::2]
        longest = int((stops - starts).argmax())
        part = slice(starts[longest], stops[longest])
        return Motion(motion.quats[part], motion.root_m[part], motion.fps, motion.name, motion.leg_m)

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """A random good frame per generator, rotated to face +Z. A recording is drawn in proportion to its length."""
        quats = np.empty((len(generators), NUM_JOINTS, 4), np.float32)
        root_m = np.zeros((len(generators), 3), np.float32)
        leg_m = np.empty(len(generators), np.float32)
        names = []
        for n, generator in enumerate(generators):
            index = int(np.searchsorted(self._ends[:-1], generator.random() * self._ends[-1], side="right"))
            motion, good = self._recording(index)
            frames = np.flatnonzero(good)
            frame = frames[int(generator.random() * len(frames))]
            quats[n], root_m[n, 1], leg_m[n] = motion.quats[frame], motion.root_m[frame, 1], motion.leg_m
            names.append(f"{motion.name}@{frame / motion.fps:.1f}s")
        return Poses(facing_front(quats), root_m, leg_m, names)


def open_clips(path: str | Path, split: str, fps: float | None = None) -> Recordings:
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
        return _open_pack(folder, split)
    files = [folder] if folder.suffix.lower() == ".bvh" and folder.is_file() else sorted(folder.glob("*.bvh"))
    if files:
        return _open_bvh(folder, files, split, fps)
    found = "does not exist" if not folder.exists() else "holds neither an index.csv nor *.bvh files"
    raise InputError(
        f"motion.path={path} {found}; expected a motion pack, BVH files or a folder of them. motion=choreography needs no data"
    )


def _open_bvh(path: Path, files: list[Path], split: str, fps: float | None) -> Recordings:
    if len(files) < SPLIT_PERIOD:
        log.warning("%s: %d BVH files are too few to split; %s uses them all", path, len(files), split)
    else:
        kept = {"validation": [SPLIT_PERIOD - 2], "test": [SPLIT_PERIOD - 1]}.get(split, range(SPLIT_PERIOD - 2))
        files = [file for k, file in enumerate(files) if k % SPLIT_PERIOD in kept]

    def read(index: int) -> Recording:
        motion = bvh_motion(files[index], fps)
        return motion, np.ones(len(motion), bool)

    return Recordings(read, [None] * len(files))


def _open_pack(folder: Path, split: str) -> Recordings:
    index = folder / "index.csv"
    rows = _read_index(index)
    kept = [row for row in rows if row["split"] == _PACK_SPLITS[split]]
    if not kept:
        splits = sorted({row["split"] for row in rows})
        raise InputError(f"{index} lists no clip of split {_PACK_SPLITS[split]!r}, only of [{names_in(map(repr, splits))}]")

    def read(number: int) -> Recording:
        return _read_clip(folder / kept[number]["file"], f"clip:{kept[number]['clip_id']}")

    return Recordings(read, [row.get("category") for row in kept], [float(row["seconds"]) for row in kept])


def _read_index(path: Path) -> list[dict[str, str]]:
    """The rows of a motion pack's index: every file inside the pack, every duration a positive number."""
    try:
        reader = csv.DictReader(io.StringIO(read_text(path), newline=""))
        rows, names = list(reader), reader.fieldnames or []
    except csv.Error as error:
        raise InputError(f"{path}: not a table of comma-separated values ({error})") from error
    for column in ("clip_id", "file", "split", "seconds"):
        if column not in names:
            raise InputError(f"{path} has no column {column!r}; it has {names_in(map(str, names))}")
    for number, row in enumerate(rows, start=2):
        where, file = f"{path}, row {number}", PurePosixPath(row["file"] or "")
        expect(None not in row and all(isinstance(value, str) for value in row.values()), where, f"{len(names)} values")
        inside = not file.is_absolute() and ".." not in file.parts and len(row["file"]) <= 200 and "\0" not in row["file"]
        expect(inside, where, f"a file inside the pack, not {row['file'][:60]!r}")
        try:
            lasts = 0 < float(row["seconds"]) <= MAX_CLIP_S
        except ValueError:
            lasts = False
        expect(lasts, where, f"a duration of 0 to {MAX_CLIP_S:g} seconds, not {row['seconds'][:40]!r}")
    return rows


def _read_clip(path: Path, name: str) -> Recording:
    if not path.is_file():
        raise InputError(f"{path} is missing, though its pack's index.csv lists it")
    clip = read_npz(path, _CLIP)
    stored, root_m, offsets_m, fps = clip["quat"], clip["root"], clip["offsets"], float(clip["fps"])
    check_budget(path, 16 * stored.size, "its rotations")
    good = ~clip["bad"] if "bad" in clip else np.ones(len(stored), bool)
    leg_m = float(np.linalg.norm(offsets_m[[INDEX["LeftLeg"], INDEX["LeftFoot"]]].astype(float), axis=1).sum())
    usable = stored.any(axis=-1).all(axis=-1) & (np.abs(root_m) < MAX_ROOT_M).all(axis=-1)
    expect(good.any(), str(path), "some good frames")
    expect(bool(usable[good].all()), str(path), f"rotations other than 0, and hips within {MAX_ROOT_M:g} m, in good frames")
    rates = f"1 to 1000 frames a second and a leg of 0.1 to 3 m, not {fps:g}, {leg_m:g}"
    expect(1 <= fps <= 1000 and 0.1 < leg_m < 3, str(path), rates)
    quats = stored.astype(np.float32)
    norm = np.linalg.norm(quats, axis=-1, keepdims=True)
    quats /= np.where(norm == 0, 1, norm)  # 0 in bad frames
    return Motion(quats, root_m.astype(np.float32), fps, name, leg_m), good
