"""`eval_sim`, the stand-in for EVAL: simulated sequences of what the paper names, in EVAL's own bytes.

24 sequences of 288 to 488 frames at 30 fps: three people, a, b and c, who in eight sequences each show two dances,
crossed punches, kicks, turns, sitting on the floor, a handstand, and a mixture of it all; in furnished rooms, measured by
a Kinect v1. Each starts in the paper's Y pose.

Sequence k is a pure function of the configuration and k. Nobody and nothing in it was ever in a training set: see
`draw_stranger` and `_rng`.
"""

import dataclasses
import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from synth.body import ASSET, BodyConfig, Person, draw_stranger
from synth.film import Film, Shot, Studio, Take
from synth.motion import MotionConfig, build_motion
from synth.motion.features import START_S, show, start_pose
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, follow, resampled
from synth.room import ViewConfig, draw_room, draw_view
from synth.sensor import SENSORS, SensorConfig

GENERATOR = 1
"""Raised with every change after which the same configuration gives other sequences."""

SUBJECTS = ("a", "b", "c")
SEQUENCES = 24
FPS = 30.0
CAMERA = CAMERAS["eval"]
VIEW = ViewConfig(height_m=(0.7, 1.7), aim_m=(0.85, 1.15))
BODY = BodyConfig()
KINDS = ("dance", "crossed_punches", "kicks", "turns", "sitting", "handstand", "dance", "mixture")
"""What sequence k shows: KINDS[k % 8]. With three people taking turns, each of them shows every kind once."""

FACING_DEG = 5.0
"""Standard deviation of the heading at the start."""

OVERLAP_M = (0.06, 0.03)
"""A motion is refused if two parts of the body lie deeper in each other, by the capsules in them, than the first, or than
when the person only stands there, and the second besides. The forearms of broad people lie 6 cm deep in their thighs then,
clothes and all, and it does not show."""

JOLT_M_S2 = 50.0
"""What accelerates the hips more is no jump of a dancer but a fault of a recording."""

TRIES, ROOMS = 100, 8
"""Motions tried for a sequence, and rooms tried for each."""


@dataclass
class EvalSimConfig:
    """Which set.

    Attributes:
        name: of the benchmark.
        seed: other people, dances, rooms and noise.
        sequences: only the first so many, which are the same as in the whole; the first eight show one of each kind.
    """

    name: str = "eval_sim"
    seed: int = 0
    sequences: int = SEQUENCES

    def __post_init__(self) -> None:
        if not 0 <= self.seed < 2**32:
            raise InputError(f"benchmark.seed={self.seed} must lie in 0..{2**32 - 1}")
        if not 1 <= self.sequences <= SEQUENCES:
            raise InputError(f"benchmark.sequences={self.sequences}: the set has {SEQUENCES}; give a number from 1 on")


@dataclass(frozen=True)
class EvalSimSet:
    """The whole of what the sequences depend on.

    Attributes:
        benchmark: which set.
        motion: `choreography`, or `clips` for recordings of the pack's test subjects.
        renderer: cpu or gl; auto must be decided first.
        sensor: what measures.
        frames: least and greatest length of a sequence.
    """

    benchmark: EvalSimConfig = field(default_factory=EvalSimConfig)
    motion: MotionConfig = field(default_factory=lambda: MotionConfig(source="choreography"))
    renderer: str = "cpu"
    sensor: SensorConfig = SENSORS["kinect_v1"]
    frames: tuple[int, int] = (288, 488)

    def __post_init__(self) -> None:
        composed = MotionConfig(source="choreography")
        if self.motion.source != "clips" and self.motion != composed:
            raise InputError(
                f"motion: {self.motion.source} with settings of its own; a benchmark's motion is either composed "
                "(motion=choreography, whose dances only benchmark.seed changes) or recorded (motion=clips motion.path=...)"
            )

    def as_json(self) -> str:
        described = dataclasses.asdict(self)
        del described["benchmark"]["sequences"]
        body = hashlib.sha256(ASSET.read_bytes()).hexdigest()[:12]
        return json.dumps(described | {"generator": GENERATOR, "body_asset": body}, sort_keys=True)

    def kind(self, index: int) -> str:
        """What sequence `index` shows."""
        return "recorded" if self.motion.source == "clips" else KINDS[index % len(KINDS)]

    @property
    def hash(self) -> str:
        """Twelve hexadecimal digits that differ when any sequence might."""
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]


def sequence_name(index: int) -> str:
    """As EVAL's files are called: the subjects take turns, so the first few sequences show them all."""
    return f"seq_{SUBJECTS[index % len(SUBJECTS)]}_{index // len(SUBJECTS)}"


class EvalSim:
    """Makes the sequences; holds one compiled scene."""

    def __init__(self, config: EvalSimSet) -> None:
        self.config = config
        self._recordings = build_motion(config.motion, "test") if config.motion.source == "clips" else None

    @cached_property
    def studio(self) -> Studio:
        return Studio(CAMERA, self.config.renderer)

    def _rng(self, kind: str, *numbers: int) -> np.random.Generator:
        """Chance for a person, a sequence or a frame's noise: its seed starts with the benchmark's name, as no other does."""
        numbers = (self.config.benchmark.seed, ("person", "sequence", "noise").index(kind), *numbers)
        return np.random.default_rng([*b"eval_sim", *numbers])

    def person(self, subject: int) -> Person:
        return draw_stranger(self._rng("person", subject), BODY)

    def take(self, index: int) -> Take:
        """Sequence `index`, planned: who does what, and where.

        Raises:
            InputError: no motion of the source stays within a room and the picture.
        """
        person = self.person(index % len(SUBJECTS))
        for attempt in range(TRIES):
            rng = self._rng("sequence", index, attempt)
            motion = self._motion(rng, self.config.kind(index), int(rng.integers(*self.config.frames, endpoint=True)))
            if np.linalg.norm(np.diff(motion.root_m, n=2, axis=0), axis=1).max() * FPS**2 > JOLT_M_S2:
                continue
            yaw_rad, curls_rad = np.radians(FACING_DEG) * rng.normal(), rng.uniform(0.0, 1.5, 2)
            played = self.studio.play(person, motion, yaw_rad, curls_rad)
            standing_m = played.overlap_m[: round(START_S * FPS)].max()
            if played.overlap_m.max() > max(standing_m, OVERLAP_M[0]) + OVERLAP_M[1]:
                continue
            for _ in range(ROOMS):
                view, room = draw_view(rng, VIEW), draw_room(rng)
                if (take := self.studio.place(rng, played, room, view)) is not None:
                    return take
        raise InputError(
            f"{sequence_name(index)}: none of {TRIES} motions drawn stays in the picture and clear of walls and furniture "
            "without faults; give recordings that stay within some 3 x 2 m, or take motion=choreography"
        )

    def _motion(self, rng: np.random.Generator, kind: str, frames: int) -> Motion:
        motion = start_pose(rng, FPS)
        while len(motion) < frames:
            left_s = (frames - len(motion)) / FPS + 1
            motion = follow(motion, self._recorded(rng, left_s) if self._recordings else show(rng, kind, left_s, FPS))
        return cut(motion, 0, frames)

    def _recorded(self, rng: np.random.Generator, seconds: float) -> Motion:
        """A stretch of a recording, of at most so many seconds."""
        motion = resampled(self._recordings.motion(int(rng.integers(len(self._recordings)))), FPS)
        start = int(rng.integers(max(len(motion) - int(seconds * FPS), 0) + 1))
        return cut(motion, start, start + int(seconds * FPS))

    def shots(self, index: int, take: Take, frames: range) -> Iterator[Shot]:
        return self.studio.shots(take, self.config.sensor, lambda frame: self._rng("noise", index, frame), frames)

    def film(self, index: int, frames: int | None = None) -> Film:
        """Sequence `index` in memory, or its first frames: the same as in the file.

        Raises:
            InputError: see `take`.
        """
        take = self.take(index)
        count = len(take.played) if frames is None else min(frames, len(take.played))
        shots = list(self.shots(index, take, range(count)))
        return Film(
            name=sequence_name(index),
            identity=SUBJECTS[index % len(SUBJECTS)],
            fps=FPS,
            camera=CAMERA,
            depth_m=np.stack([shot.depth_m for shot in shots]),
            person=np.stack([shot.person for shot in shots]),
            joints_camera_m=np.stack([shot.joints_camera_m for shot in shots]),
            markers_camera_m=np.stack([shot.markers_camera_m for shot in shots]),
            yaw_rad=np.array([shot.yaw_rad for shot in shots], np.float32),
            floor=take.view.floor().astype(np.float32),
            motion=take.played.motion.name,
        )
