"""Recorded motion: a folder of clips in the motion pack's format, or the user's own BVH files.

The pack is a folder with `index.csv` (one row a clip: clip_id, file, split, seconds, ...) and `clips/*.npz` with

    quat     int16 (T, 23, 4), local rotations w, x, y, z times 32767, relative to the T-pose
    root     float32 (T, 3), Hips in metres
    offsets  float32 (28, 3), rest offsets in metres
    fps      frames per second
    bad      bool (T,), frames that the solver got wrong

The split is the index's own and keeps the subjects of train, val and test apart. Bad frames are never handed out.
"""

import csv
import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError
from synth.motion.retargeting import bvh_motion
from synth.motion.skeleton import INDEX, NUM_JOINTS, Motion, Poses, facing_front

log = logging.getLogger(__name__)

FRAMES_KEPT = 500_000
"""So many frames of recordings stay in memory, some 200 MB; what is dropped is read again."""

_PACK_SPLITS = {"train": "train", "validation": "val", "test": "test"}


class _Recordings:
    """Sequences loaded when first needed, some kept; stills are drawn evenly over time."""

    def __init__(self, seconds: Sequence[float]) -> None:
        self._ends = np.cumsum(seconds)
        self._loaded: dict[int, tuple[Motion, np.ndarray]] = {}

    def __len__(self) -> int:
        return len(self._ends)

    def _read(self, index: int) -> tuple[Motion, np.ndarray]:
        """The motion and (T,) which frames are good."""
        raise NotImplementedError

    def _recording(self, index: int) -> tuple[Motion, np.ndarray]:
        if index not in self._loaded:
            self._loaded[index] = self._read(index)
            while len(self._loaded) > 1 and sum(len(motion) for motion, _ in self._loaded.values()) > FRAMES_KEPT:
                self._loaded.pop(next(iter(self._loaded)))
        return self._loaded[index]

    def numbers(self, category: str) -> list[int]:
        """The clips of a category, such as "dance"; all of them where nobody says what they are."""
        return list(range(len(self)))

    def motion(self, index: int) -> Motion:
        """Clip number `index`: its longest stretch without a bad frame."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        motion, good = self._recording(index)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
        starts, stops = edges[::2], edges[1::2]
        longest = int((stops - starts).argmax())
        part = slice(starts[longest], stops[longest])
        return Motion(motion.quats[part], motion.root_m[part], motion.fps, motion.name, motion.leg_m)

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """A good frame of some clip for each generator, turned to face +Z; every second is alike likely."""
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
        self._folder = Path(folder)
        index = self._folder / "index.csv"
        with index.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        for column in ("clip_id", "file", "split", "seconds"):
            if rows and column not in rows[0]:
                raise InputError(f"{index} has no column {column!r}; it has {', '.join(rows[0])}")
        self._rows = [row for row in rows if row["split"] == _PACK_SPLITS[split]]
        if not self._rows:
            splits = sorted({row["split"] for row in rows})
            raise InputError(f"{index} lists no clip of split {_PACK_SPLITS[split]!r}, only of {splits}")
        super().__init__([float(row["seconds"]) for row in self._rows])

    def numbers(self, category: str) -> list[int]:
        return [number for number, row in enumerate(self._rows) if row.get("category", category) == category]

    def _read(self, index: int) -> tuple[Motion, np.ndarray]:
        row = self._rows[index]
        path = self._folder / row["file"]
        if not path.is_file():
            raise InputError(f"{path} is missing, though {self._folder / 'index.csv'} lists it")
        with np.load(path) as clip:
            absent = {"quat", "root", "offsets", "fps"} - set(clip)
            if absent:
                raise InputError(f"{path} has no array {', '.join(sorted(absent))}; is it a clip of the motion pack?")
            stored, root_m, offsets_m, fps = clip["quat"], clip["root"], clip["offsets"], float(clip["fps"])
            good = ~clip["bad"] if "bad" in clip else np.ones(len(stored), bool)
        if stored.shape != (len(root_m), NUM_JOINTS, 4) or not good.any():
            raise InputError(
                f"{path}: quat is {stored.shape} with {int(good.sum())} good frames; expected (T, 23, 4) with some"
            )
        quats = stored.astype(np.float32)
        quats /= np.linalg.norm(quats, axis=-1, keepdims=True)
        leg_m = float(np.linalg.norm(offsets_m[[INDEX["LeftLeg"], INDEX["LeftFoot"]]], axis=1).sum())
        return Motion(quats, root_m.astype(np.float32), fps, f"clip:{row['clip_id']}", leg_m), good


class BvhClips(_Recordings):
    """One BVH file or a folder of them; all are read through once, so that a faulty one is found at the start.

    Of every EIGHT files, by name, one is kept for validation and one for test. Fewer files serve all splits alike, and a
    warning says so: what is measured on them is then measured on known motions.
    """

    EIGHT = 8

    def __init__(self, path: Path, split: str, fps: float | None) -> None:
        files = [path] if path.is_file() else sorted(path.glob("*.bvh"))
        if len(files) < self.EIGHT:
            log.warning("%s: %d BVH files are too few to split; %s uses them all", path, len(files), split)
        else:
            kept = {"validation": [self.EIGHT - 2], "test": [self.EIGHT - 1]}.get(split, range(self.EIGHT - 2))
            files = [file for k, file in enumerate(files) if k % self.EIGHT in kept]
        self._files, self._fps = files, fps
        super().__init__([0.0] * len(files))
        motions = (self._recording(index)[0] for index in range(len(files)))
        self._ends = np.cumsum([len(motion) / motion.fps for motion in motions])

    def _read(self, index: int) -> tuple[Motion, np.ndarray]:
        motion = bvh_motion(self._files[index], self._fps)
        return motion, np.ones(len(motion), bool)


def open_clips(path: str, split: str, fps: float | None) -> Clips | BvhClips:
    """The recordings at a path: a motion pack, a folder of BVH files or one BVH file.

    Raises:
        InputError: if there are none.
    """
    place = Path(path)
    if (place / "index.csv").is_file():
        return Clips(place, split)
    if place.suffix.lower() == ".bvh" and place.is_file():
        return BvhClips(place, split, fps)
    if place.is_dir() and any(place.glob("*.bvh")):
        return BvhClips(place, split, fps)
    found = "does not exist" if not place.exists() else "holds neither an index.csv nor *.bvh files"
    raise InputError(
        f"motion.path={path} {found}; expected a motion pack, BVH files or a folder of them. motion=choreography needs no data"
    )
