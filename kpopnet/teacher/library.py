"""The body of the virtual teacher, and the dances: one .npz file each.

The body is a skin on bones; a dance is what its bones do, and the fifteen joints with which a learner is compared. The world
has z up; a body in its T-pose faces -y with its left hand at +x, and the rotation of a bone is relative to the T-pose.
"""

import hashlib
import itertools
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from kpopnet.dance.noise.table import SEEN, SEEN_PEOPLE
from kpopnet.dance.performance import Performance, off_by, without_gaps
from kpopnet.dance.scoring import check_free, check_weights
from kpopnet.dance.words.moments import phrase_length_s
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.networks import PASSES, WEIGHTS
from kpopnet.runtime.atomic_write import claim, write_npz
from kpopnet.runtime.input_files import (
    ArraySchema,
    can_be_printed,
    check_names,
    expect,
    parse_json,
    plain_name,
    read_npz,
    settings_from,
)
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.weights import SHA256

DANCES, TRIES, SEEN_TEACHERS = "dances", "tries", "seen"
IDENTITY = re.compile("[a-z0-9][a-z0-9_-]{0,63}")
MOVE_COUNTS = 4
QUAT_SCALE = 32767
MAX_PLACE_M = 1000.0
MOST_DANCERS = 32
PREVIEW_FPS, PREVIEW_S = 10, 4.0


@dataclass(frozen=True, eq=False)
class TeacherBody:
    """A body of B bones, N vertices and F faces at rest."""

    bone_names: np.ndarray  # (B,) names of the bones, parents first
    bone_parents: np.ndarray  # (B,) int parent of each bone, -1 for the root
    heads_m: np.ndarray  # (B, 3) proximal end of each bone, metres
    t_pose: np.ndarray  # (B, 3, 3) rotation of each bone from the rest pose to the T-pose
    joints_m: np.ndarray  # (15, 3) joints, metres
    vertices_m: np.ndarray  # (N, 3) vertices, metres
    faces: np.ndarray  # (F, 3) int triangles, counter-clockwise seen from outside
    weight_bones: np.ndarray  # (N, 4) int bones of the skinning weights
    weights: np.ndarray  # (N, 4) skinning weights; rows sum to 1

    def bone(self, name: str) -> int:
        return self.bone_names.tolist().index(name)

    @property
    def offsets_m(self) -> np.ndarray:
        """(B, 3) from the parent's proximal end to each bone's, in the T-pose, metres; 0 for the root."""
        offsets_m = np.zeros((len(self.bone_names), 3))
        for bone, parent in enumerate(self.bone_parents.tolist()):
            if parent >= 0:
                offsets_m[bone] = self.t_pose[parent] @ (self.heads_m[bone] - self.heads_m[parent]).astype(np.float64)
        return offsets_m


def checked_title(name: str) -> str:
    """A dance's title as it is shown; raises InputError for what cannot be printed."""
    check_names("title", [name])
    expect(can_be_printed(name := plain_name(name)), f"title {name}", "letters that can be printed")
    return name


@dataclass(frozen=True)
class About:
    """What the menu shows of a dance."""

    name: str  # its title
    seconds: float  # length
    bpm: float  # tempo, beats per minute; the first beat is at time 0
    difficulty: int  # 1 to 5, by how fast the limbs move
    own: bool = False  # whether the user added it
    free_s: list[list[float]] = field(default_factory=list)  # begins and ends of what is left free, as of `score_dance`
    weights: dict[str, float] = field(default_factory=dict)  # of the total, as of `DanceScore.total`

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", checked_title(self.name))
        expect(all(len(one) == 2 for one in self.free_s), "free_s", "a begin and an end of each")
        check_free(self.free_s)
        check_weights(self.weights)

    @property
    def beat_s(self) -> float:
        return 60 / self.bpm

    @property
    def phrase_s(self) -> float:
        return phrase_length_s(self.beat_s)


@dataclass(frozen=True, eq=False)
class TaughtDance:
    """A dance of T frames by the teacher's body."""

    about: About  # for the menu
    fps: float  # frames per second
    # (T, 15, 3) float32 joints in the frame of a level camera that the teacher faces, metres; NaN where missing
    joints_m: np.ndarray
    quats: np.ndarray  # (T, B, 4) float32 rotations of the bones relative to their parents, w first
    hips_m: np.ndarray  # (T, 3) float32 position of the root bone, metres; the floor at z = 0
    others: tuple["TaughtDance", ...] = ()  # the rest of a group, from its own left to its right
    seen: Performance | None = None  # as the estimator of lessons by depth camera sees the teacher, where that is known

    @property
    def dancers(self) -> tuple["TaughtDance", ...]:
        """All of a group, from its own left to its right at the start, as it faces the camera."""
        return (self, *self.others)

    def without_seen(self) -> "TaughtDance":
        """The dance for another estimator than the package's."""
        return replace(self, seen=None, others=tuple(one.without_seen() for one in self.others))

    @property
    def start_m(self) -> np.ndarray:
        """(3,) where the middle of the hips is known first, metres, in the frame of the camera."""
        hips_m = self.joints_m[:, [Joint.LEFT_HIP, Joint.RIGHT_HIP]].mean(axis=1)
        return hips_m[np.isfinite(hips_m).all(axis=1).argmax()]

    @property
    def performance(self) -> Performance:
        return Performance(self.joints_m, np.arange(len(self.joints_m)) / self.fps)


def taught_dance(
    name: str, fps: float, bpm: float, joints_m: np.ndarray, quats: np.ndarray, hips_m: np.ndarray, own: bool = False
) -> TaughtDance:
    """A dance with what the menu shows of it; arguments as in `TaughtDance` and `About`."""
    about = About(name, len(joints_m) / fps, bpm, difficulty(joints_m, fps), own)
    return TaughtDance(about, fps, joints_m, quats, hips_m)


SPEEDS_M_S = (0.73, 0.82, 0.88, 1.01)
"""Bounds between the five difficulties, a fifth of the composed dances each: mean speed of hands and feet relative to the
torso, metres per second."""


def difficulty(joints_m: np.ndarray, fps: float) -> int:
    """1 to 5 for (T, 15, 3) joints in metres: how fast hands and feet move."""
    ends = [Joint.LEFT_HAND, Joint.RIGHT_HAND, Joint.LEFT_FOOT, Joint.RIGHT_FOOT]
    relative_m = joints_m[:, ends] - joints_m[:, [Joint.TORSO]]
    speed_m_s = np.linalg.norm(np.diff(relative_m, axis=0), axis=-1) * fps
    known = speed_m_s[np.isfinite(speed_m_s)]
    return 1 + int(np.searchsorted(SPEEDS_M_S, known.mean())) if len(known) else 1


_MOVED = {"joints_m": ("f", ("T", NUM_JOINTS, 3)), "quats": ("i", ("T", "B", 4)), "hips_m": ("f", ("T", 3))}
"""The arrays of a dancer: kinds of numbers, and shapes."""

_DANCE_SCHEMAS = {
    "about": ArraySchema("U", ()),
    "fps": ArraySchema("f", ()),
    **{name: ArraySchema(kind, shape) for name, (kind, shape) in _MOVED.items()},
    **{f"others_{name}": ArraySchema(kind, ("D", *shape), False) for name, (kind, shape) in _MOVED.items()},
}


_SEEN_SCHEMA = {"errors_m": ArraySchema("f", ("D", "T", NUM_JOINTS, 3)), "of": ArraySchema("U", ())}

SHOWN_BY, SEEN_AS = "realtime", "network"
"""Whose errors those of lessons by depth camera are, in mode best without later images; and whose joints are graded beside a
teacher as they are seen: its network's alone, which err more like each other than those that the fit has moved to each person's
own depth (docs/learning_the_score.md)."""


def _digest(dancers: Sequence[TaughtDance]) -> str:
    """Of the dancers' joints, of the network that sees them and its number of passes, for everybody, and of who dances them."""
    joints = b"".join(one.joints_m.tobytes() for one in dancers)
    seen = f"{SEEN_AS} {SHA256['joints'][WEIGHTS]} {PASSES} everybody {SEEN_PEOPLE}"
    return hashlib.sha256(seen.encode() + joints).hexdigest()


class Library:
    """The folder of the dances, and the body that dances them."""

    def __init__(self, folder: Path, body: TeacherBody) -> None:
        self.folder, self.body = Path(folder), body
        self._abouts: dict[str, tuple[int, About]] = {}

    def identities(self) -> list[str]:
        """The dances' names of files, in order."""
        paths = sorted((self.folder / DANCES).glob("*.npz"))
        return [path.stem for path in paths if IDENTITY.fullmatch(path.stem)]

    def path(self, identity: str) -> Path:
        """The file of a dance; what is no plain name never becomes a path. Raises InputError if there is none."""
        path = self.folder / DANCES / f"{identity}.npz"
        if not IDENTITY.fullmatch(identity) or not path.is_file():
            raise InputError(Said("there is no dance {name}", name=repr(identity[:64])))
        return path

    def about(self, identity: str) -> About:
        """What the menu shows of a dance."""
        path = self.path(identity)
        changed = path.stat().st_mtime_ns
        if self._abouts.get(identity, (0,))[0] != changed:
            stored = read_npz(path, {"about": _DANCE_SCHEMAS["about"]})
            self._abouts[identity] = changed, _about(stored["about"], path)
        return self._abouts[identity][1]

    def dance(self, identity: str) -> TaughtDance:
        """Reads a dance. Raises InputError if it is missing or damaged."""
        path = self.path(identity)
        stored = read_npz(path, _DANCE_SCHEMAS)
        about, fps = _about(stored["about"], path), float(stored["fps"])
        joints_m, quats, hips_m = ([stored[name], *stored.get(f"others_{name}", ())] for name in _MOVED)
        whole = len(hips_m[0]) > 0 and 1 <= fps <= 1000 and len(joints_m) == len(quats) == len(hips_m)
        expect(whole, str(path), "frames, 1 to 1000 of them a second, and joints_m, quats and hips_m of each dancer")
        expect(all((np.abs(one) < MAX_PLACE_M).all() for one in hips_m), f"{path}: hips_m", "finite numbers of metres")
        expect(not any((np.abs(one) >= MAX_PLACE_M).any() for one in joints_m), f"{path}: joints_m", "metres, or NaN")
        quats = (one.astype(np.float32) / QUAT_SCALE for one in quats)
        first, *others = (TaughtDance(about, fps, *one) for one in zip(joints_m, quats, hips_m, strict=True))
        first, *others = self._with_seen(identity, [first, *others])
        return replace(first, others=tuple(others))

    def _with_seen(self, identity: str, dancers: list[TaughtDance]) -> list[TaughtDance]:
        """The dancers as `write_seen` wrote them; as they are where nothing is written, or of another dance or network."""
        path = self.folder / SEEN_TEACHERS / f"{identity}.npz"
        if not path.is_file():
            return dancers
        try:
            stored = read_npz(path, _SEEN_SCHEMA)
        except InputError as error:
            raise InputError(f"{error}; delete it, and kpopnet teach see makes it again") from error
        if str(stored["of"]) != _digest(dancers):
            return dancers
        expect(len(stored["errors_m"]) == len(dancers), f"{path}: errors_m", f"{len(dancers)} dancers")
        expect(stored["errors_m"].shape[1:] == dancers[0].joints_m.shape, f"{path}: errors_m", "a row for each frame")
        return [
            replace(one, seen=off_by(one.performance, off_m.astype(np.float64), f"{SEEN_AS}{SEEN}"))
            for one, off_m in zip(dancers, stored["errors_m"], strict=True)
        ]

    def write_seen(self, identity: str, dance: TaughtDance, errors_m: list[np.ndarray]) -> None:
        """Writes by how much the estimator SEEN_AS is off of each dancer of a dance, (T, 15, 3) metres."""
        (self.folder / SEEN_TEACHERS).mkdir(parents=True, exist_ok=True)
        write_npz(
            self.folder / SEEN_TEACHERS / f"{identity}.npz",
            errors_m=np.stack(errors_m).astype(np.float16),
            of=np.array(_digest(dance.dancers)),
        )

    def add(self, dance: TaughtDance) -> str:
        """Writes a dance of the user's own, and returns its identity."""
        folder = self.folder / DANCES
        folder.mkdir(parents=True, exist_ok=True)
        for number in itertools.count(1):
            path, taken = folder / f"own_{number:03d}.npz", folder / f".own_{number:03d}"  # which a killed process leaves
            # Tries of a dance that was removed stay its own.
            if path.exists() or (self.folder / TRIES / path.stem).exists() or not claim(taken):
                continue
            try:
                if not path.exists():  # another writer may have been done in between
                    self.write(path.stem, dance)
                    return path.stem
            finally:
                taken.unlink()
        raise AssertionError("there is always another number")

    def write(self, identity: str, dance: TaughtDance) -> None:
        """Writes a dance; one of that name is replaced."""
        (self.folder / DANCES).mkdir(parents=True, exist_ok=True)
        arrays = {"about": np.array(json.dumps(asdict(dance.about), ensure_ascii=False)), "fps": np.float64(dance.fps)}
        for name, as_stored in zip(_MOVED, (np.float32, stored_quats, np.float32), strict=True):
            moved = as_stored(np.stack([getattr(one, name) for one in dance.dancers]))
            arrays |= {name: moved[0], f"others_{name}": moved[1:]}
        write_npz(self.folder / DANCES / f"{identity}.npz", **arrays)


def stored_quats(quats: np.ndarray) -> np.ndarray:
    """Unit quaternions as int16, 32767 for 1: 0.002 degrees."""
    return np.round(quats * QUAT_SCALE).astype(np.int16)


def preview_cm(dance: TaughtDance) -> list[list[int]]:
    """The first seconds of a dance for a thumbnail: by frame the x (right) and y (up) of the fifteen joints, centimetres."""
    stride = max(round(dance.fps / PREVIEW_FPS), 1)
    joints_m = without_gaps(dance.joints_m)[: round(PREVIEW_S * dance.fps) : stride, :, :2]
    return _flat_cm(joints_m - joints_m.mean(axis=(0, 1)))


def moves_cm(dance: TaughtDance) -> list[dict]:
    """For each move of four counts its pose that differs most from the dance's mean pose: at_s, seconds of the dance, and
    points_cm, the joints as in `preview_cm`.
    """
    joints_m = without_gaps(dance.joints_m)
    relative_m = joints_m - joints_m.mean(axis=1, keepdims=True)
    unlike_m = np.linalg.norm(relative_m - relative_m.mean(axis=0), axis=-1).sum(axis=1)
    bounds = np.arange(0, len(unlike_m), MOVE_COUNTS * 60 / dance.about.bpm * dance.fps).round().astype(int).tolist()
    frames = [
        begin + int(unlike_m[begin:end].argmax()) for begin, end in itertools.pairwise([*bounds, len(unlike_m)]) if begin < end
    ]
    return [{"at_s": frame / dance.fps, "points_cm": _flat_cm(relative_m[[frame], :, :2])[0]} for frame in frames]


def _flat_cm(centred_m: np.ndarray) -> list[list[int]]:
    """(T, 15, 2) metres, y down, as centimetres, y up, by frame."""
    return np.round(centred_m * [100, -100]).astype(int).reshape(len(centred_m), -1).tolist()


def _about(text: np.ndarray, path: Path) -> About:
    about = settings_from(About, parse_json(str(text), f"{path}: about"), f"{path}: about")
    expect(0 < about.seconds <= 7200 and 20 <= about.bpm <= 400, f"{path}: about", "a length and a tempo of a dance")
    return about
