"""Recorded motion: a folder of clips in the motion pack's format, or the user's own BVH files.

Of BVH files only the rotations and the path of the hips are used. Bone lengths come from the body that performs the motion. A
motion pack is a folder with `index.csv` (one row per clip: clip_id, file, split, seconds, ...) and `clips/*.npz` with

    quat     int16 (T, 23, 4), local rotations w, x, y, z times 32767, relative to the T-pose
    root     float32 (T, 3), Hips in metres
    offsets  float32 (28, 3), rest offsets in metres
    fps      frames per second
    bad      bool (T,), frames in which the solver failed

The split is that of the index, in which no subject is in two of train, val and test. Bad frames are never returned.
"""

import csv
import hashlib
import io
import itertools
import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath

import numpy as np

from kpopnet.dance.joint_files.bvh_motion import read_bvh_motion
from kpopnet.errors import InputError
from kpopnet.rotations import conjugate, multiply, rotate
from kpopnet.runtime.input_files import ArraySchema, check_budget, expect, names_in, read_npz, read_text
from synth.motion.skeleton import (
    INDEX,
    JOINT_NAMES,
    NUM_JOINTS,
    NUM_POINTS,
    PARENTS,
    Motion,
    Poses,
    height_above_floor,
    still,
)
from synth.motion.splice import cut

log = logging.getLogger(__name__)

CACHED_FRAMES = 500_000
"""Largest number of frames of recordings kept in memory, about 200 MB; recordings that are dropped are read again."""

MAX_CLIP_S, MAX_ROOT_M = 1e5, 1e4

SPLIT_PERIOD = 8
"""Of as many BVH files one belongs to validation and one to test, on average, and at least one: each by its own name, so that
one that is added to dozens moves no other. Fewer files are used for all splits, with a warning: a measurement on them uses
motions of the training set."""

_CLIP = {
    "quat": ArraySchema("if", ("frames", NUM_JOINTS, 4)),
    "root": ArraySchema("f", ("frames", 3)),
    "offsets": ArraySchema("f", (NUM_POINTS, 3)),
    "fps": ArraySchema("fiu", ()),
    "bad": ArraySchema("b", ("frames",), required=False),
}

_PACK_SPLITS = {"train": "train", "validation": "val", "test": "test"}
Recording = tuple[Motion, np.ndarray]  # a motion, and (T,) bool: its good frames


class Recordings:
    """Sequences that are loaded when they are first used, with a cache. Single poses are drawn uniformly over time."""

    def __init__(
        self, read: Callable[[int], Recording], categories: Sequence[str | None], seconds: Sequence[float] = ()
    ) -> None:
        """Keeps a function from a recording's number to its content, their categories, such as "dance", and their lengths.

        Reads every recording once if their lengths are not given.
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
        motion, good = self._recording(index)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
        starts, stops = edges[::2], edges[1::2]
        longest = int((stops - starts).argmax())
        return cut(motion, starts[longest], stops[longest])

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """A random good frame per generator. A recording is drawn in proportion to its length."""
        drawn = []
        for generator in generators:
            index = int(np.searchsorted(self._ends[:-1], generator.random() * self._ends[-1], side="right"))
            motion, good = self._recording(index)
            frames = np.flatnonzero(good)
            drawn.append(still(motion, frames[int(generator.random() * len(frames))]))
        return Poses.joined(drawn)


def open_clips(path: str | Path, split: str, fps: float | None = None) -> Recordings:
    """Opens the recordings of a split at a path: a motion pack, a folder of BVH files or one BVH file.

    `fps` is the true frame rate of BVH files that state a wrong one. Raises InputError if there are no recordings, or damaged
    ones.
    """
    folder = Path(path)
    if (folder / "index.csv").is_file():
        if fps is not None:
            raise InputError(f"motion.fps={fps:g}: the rate of BVH files; {path} is a motion pack, which states its own")
        return _open_pack(folder, split)
    if not (files := _bvh_files(folder)):
        found = "does not exist" if not folder.exists() else "holds neither an index.csv nor *.bvh files"
        raise InputError(
            f"motion.path={path} {found}; expected a motion pack, BVH files or a folder of them. "
            "motion=choreography needs no data"
        )
    if len(files) < SPLIT_PERIOD:
        log.warning("%s: %d BVH files are too few to split; %s uses them all", folder, len(files), split)
    else:
        log.warning("%s: split by file; takes of one dancer may be in several splits. A motion pack is split by dancer", folder)
        files = _split(files, split)

    def read(index: int) -> Recording:
        motion = bvh_motion(files[index], fps)
        return motion, np.ones(len(motion), bool)

    return Recordings(read, [None] * len(files))


def _bvh_files(path: Path) -> list[Path]:
    files = [path] if path.is_file() else sorted(path.glob("*"))
    return [file for file in files if file.suffix.lower() == ".bvh" and file.is_file()]


def bvh_digest(path: str | Path) -> str | None:
    """Twelve hexadecimal digits that identify the BVH files at a path by their names and sizes; None for a motion pack."""
    if (Path(path) / "index.csv").is_file():
        return None
    listed = [f"{file.name}/{file.stat().st_size}" for file in _bvh_files(Path(path))]
    return hashlib.sha256(os.fsencode("\n".join(listed))).hexdigest()[:12] if listed else None


def _split(files: list[Path], split: str) -> list[Path]:
    """Those of at least SPLIT_PERIOD BVH files that belong to a split, in the order of their names."""
    draws = {file: int.from_bytes(hashlib.sha256(os.fsencode(file.stem)).digest()) % 2**32 / 2**32 for file in files}
    places = sorted(files, key=lambda file: draws[file], reverse=True)
    tests, validations = (
        max(1, sum(high - 1 <= SPLIT_PERIOD * draw < high for draw in draws.values()))
        for high in (SPLIT_PERIOD, SPLIT_PERIOD - 1)
    )
    first, last = {"test": (0, tests), "validation": (tests, tests + validations)}.get(split, (tests + validations, None))
    return sorted(places[first:last])


def bvh_motion(path: Path, fps: float | None = None) -> Motion:
    """Reads a BVH file as a motion of the canonical skeleton; `fps` as in `read_bvh_motion`.

    The T-pose is computed from the file's rest offsets: upper arm, forearm and hand are rotated onto +-X, thigh and shin onto
    -Y, each by the smallest rotation after that of the previous bone of the limb. The floor is at the 3rd percentile, over the
    frames, of the height of the body's lowest point.
    """
    recorded = read_bvh_motion(path, fps)
    found, rest, rotated = recorded.found, recorded.rest, recorded.rotated
    world = np.empty((len(rotated), NUM_JOINTS, 4))
    for j, name in enumerate(JOINT_NAMES):
        if name in found:
            world[:, j] = multiply(rotated[:, found[name]], conjugate(_alignment(name, found, rest, recorded.t_pose)))
        else:
            world[:, j] = world[:, PARENTS[j]]
    local = world.copy()
    local[:, 1:] = multiply(conjugate(world[:, PARENTS[1:NUM_JOINTS]]), world[:, 1:])

    root_m = recorded.root_m.copy()
    # The height of the floor differs between files. The lowest frames touch the floor; the percentile ignores outliers.
    root_m[:, 1] -= np.percentile(height_above_floor(local, root_m, recorded.leg_m), 3)
    return Motion(local.astype(np.float32), root_m.astype(np.float32), recorded.fps, f"bvh:{path.stem}", recorded.leg_m)


def _alignment(name: str, found: dict[str, int], rest: np.ndarray, t_pose: np.ndarray | None) -> np.ndarray:
    """The rotation of a bone from the file's rest pose to the T-pose.

    The hand continues the forearm. Feet, toes and the trunk take their rotations of the T-pose in the file's first frame
    (world rotations (J, 4)), if there is one; otherwise they keep their rest orientation.
    """
    rotation = np.array([1.0, 0.0, 0.0, 0.0])
    side = "Left" if name.startswith("Left") else "Right"
    part = name.removeprefix(side)
    if part in ("Arm", "ForeArm", "Hand"):
        limb, target = ("Arm", "ForeArm", "Hand"), np.array([1.0 if side == "Left" else -1.0, 0.0, 0.0])
    elif part in ("UpLeg", "Leg"):
        limb, target = ("UpLeg", "Leg", "Foot"), np.array([0.0, -1.0, 0.0])
    else:
        return rotation if t_pose is None else t_pose[found[name]]
    for bone, end in itertools.pairwise(limb):
        direction = rotate(rotation, rest[found[side + end]] - rest[found[side + bone]])
        rotation = multiply(_smallest_rotation(direction, target), rotation)
        if bone == part:
            break
    return rotation


def _smallest_rotation(direction: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The smallest rotation that aligns a direction with a unit vector; the identity for a direction of length 0."""
    length = np.linalg.norm(direction)
    if length < 1e-9:
        return np.array([1.0, 0, 0, 0])
    unit = direction / length
    rotation = np.concatenate([[1.0 + unit @ target], np.cross(unit, target)])
    size = np.linalg.norm(rotation)
    # Opposite to the target any perpendicular axis is valid; the front axis keeps the direction of elbows and knees.
    return rotation / size if size > 1e-6 else np.array([0.0, 0, 0, 1.0])


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
    columns = {"clip_id", "file", "split", "seconds"}
    expect(columns <= set(names), str(path), f"columns {', '.join(sorted(columns))}, not {names_in(map(str, names))}")
    for number, row in enumerate(rows, start=2):
        where, file = f"{path}, row {number}", PurePosixPath(row["file"] or "")
        expect(None not in row and None not in row.values(), where, f"{len(names)} values")
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
    quats = stored.astype(np.float32)
    norm = np.linalg.norm(quats, axis=-1, keepdims=True)
    usable = (np.isfinite(norm) & (norm > 0)).all(axis=(1, 2)) & (np.abs(root_m) < MAX_ROOT_M).all(axis=-1)
    expect(good.any(), str(path), "some good frames")
    whole = f"finite rotations other than 0, and hips within {MAX_ROOT_M:g} m, in good frames"
    expect(bool(usable[good].all()), str(path), whole)
    rates = f"1 to 1000 frames a second and a leg of 0.1 to 3 m, not {fps:g}, {leg_m:g}"
    expect(1 <= fps <= 1000 and 0.1 < leg_m < 3, str(path), rates)
    quats /= np.where(norm == 0, 1, norm)  # 0 in bad frames
    return Motion(quats, root_m.astype(np.float32), fps, name, leg_m), good
