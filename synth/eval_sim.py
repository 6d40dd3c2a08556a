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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from synth.body import ASSET, BodyConfig, Person, draw_stranger
from synth.film import Film, Shot, Studio, Take
from synth.motion import MotionConfig, build_motion
from synth.motion.choreography import COUNTS, draw_style, filled, phrase
from synth.motion.handstand import handstand
from synth.motion.moves import Key, Move, arms, both_sides, concat, feet, mirror, together, turning
from synth.motion.poses import between, pick
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, follow, resampled
from synth.motion.stage import Style, perform
from synth.motion.vocabulary import LOWER, UPPER, WHOLE
from synth.room import ViewConfig, draw_room, draw_view
from synth.sensor import SENSORS, SensorConfig

GENERATOR = 1
"""Raised with every change after which the same configuration gives other sequences."""

SUBJECTS = ("a", "b", "c")
SEQUENCES = 24
FRAMES = (288, 488)
FPS = 30.0
CAMERA = CAMERAS["eval"]
VIEW = ViewConfig(height_m=(0.7, 1.7), aim_m=(0.8, 1.1))
BODY = BodyConfig()
FACING_DEG = 8.0
"""Standard deviation of the heading at the start."""

BPM = (80.0, 115.0)

Y_POSE_S = 0.7
_INTO_Y_S, _OUT_OF_Y_S = 2.0, 1.0

TRIES, ROOMS = 40, 4
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
        if self.seed < 0:
            raise InputError(f"benchmark.seed={self.seed} must be 0 or more")
        if not 1 <= self.sequences <= SEQUENCES:
            raise InputError(f"benchmark.sequences={self.sequences}: the set has {SEQUENCES}; give a number from 1 on")


@dataclass(frozen=True)
class EvalSimSet:
    """The whole of what the sequences depend on.

    Attributes:
        benchmark: which set.
        motion: `choreography`, or `clips` for recordings of the pack's test subjects.
        renderer: cpu or gl; auto must be decided first.
    """

    benchmark: EvalSimConfig = field(default_factory=EvalSimConfig)
    motion: MotionConfig = field(default_factory=lambda: MotionConfig(source="choreography"))
    renderer: str = "cpu"
    sensor: SensorConfig = SENSORS["kinect_v1"]

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

    @property
    def hash(self) -> str:
        """Twelve hexadecimal digits that differ when any sequence might."""
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]


def sequence_name(index: int) -> str:
    """As EVAL's files are called: the subjects take turns, so the first few sequences show them all."""
    return f"seq_{SUBJECTS[index % 3]}_{index // 3}"


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
        person = self.person(index % 3)
        for attempt in range(TRIES):
            rng = self._rng("sequence", index, attempt)
            motion = self._motion(rng, KINDS[index % len(KINDS)], int(rng.integers(FRAMES[0], FRAMES[1] + 1)))
            yaw_rad, curls_rad = np.radians(FACING_DEG) * rng.normal(), rng.uniform(0.0, 1.5, 2)
            played = self.studio.play(person, motion, yaw_rad, curls_rad)
            for _ in range(ROOMS):
                view, room = draw_view(rng, VIEW), draw_room(rng)
                taken = self.studio.place(rng, played, room, view)
                if taken is not None:
                    return taken
        raise InputError(
            f"{sequence_name(index)}: in {TRIES} tries no motion stayed in the picture and clear of walls and furniture; "
            "give recordings that stay within some 3 x 2 m, or motion=choreography"
        )

    def _motion(self, rng: np.random.Generator, kind: str, frames: int) -> Motion:
        motion = start_pose(rng)
        while len(motion) < frames:
            left_s = (frames - len(motion)) / FPS + 1
            motion = follow(motion, self._recorded(rng, left_s) if self._recordings else _composed(rng, kind, left_s))
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
            identity=SUBJECTS[index % 3],
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


# What is shown ------------------------------

_Y = arms("high_side")
_APART = feet((0.22, 0.0), (0.22, 0.0))


def start_pose(rng: np.random.Generator) -> Motion:
    """The paper's Y pose held for Y_POSE_S, then the way to standing: arms obliquely up, legs apart, facing the front."""
    keys = ((_INTO_Y_S, _APART, _Y), (Y_POSE_S, _APART, _Y), (_OUT_OF_Y_S, {}, arms("hang")))
    move = Move(tuple(Key(beats, lower) for beats, lower, _ in keys), tuple(Key(beats, upper) for beats, _, upper in keys))
    style = Style(bounce_m=0.0, lag_s=0.0, unsteadiness_deg=0.5, phases=tuple(rng.random(5)))
    first, last = (round(seconds * FPS) for seconds in (_INTO_Y_S, _INTO_Y_S + Y_POSE_S + _OUT_OF_Y_S))
    # At 60 beats a minute a beat is a second.
    return cut(perform(move, 60.0, last, FPS, "y_pose", style), first, last)


_GROOVES = tuple(LOWER[name] for name in ("bounce", "side_steps", "march", "twist_hips", "taps_out"))


def _crossed_punches(rng: np.random.Generator) -> Move:
    punches = [UPPER[name] for name in ("crossed_punches", "cross_and_open", "punches_front", "fold_arms")]
    one, other = pick(rng, punches[:2]), pick(rng, punches)
    return together(pick(rng, _GROOVES), concat(filled(one, COUNTS / 2), filled(other, COUNTS / 2)))


def _kicks(rng: np.random.Generator) -> Move:
    if rng.random() < 0.3:
        return pick(rng, (WHOLE["kick_and_punch"], WHOLE["fan_kick"]))
    legs = LOWER[pick(rng, ("front_kicks", "high_kicks", "side_kicks", "knee_lifts"))]
    return together(legs, pick(rng, (UPPER["guard_bob"], UPPER["hanging"], both_sides(UPPER["punches_front"]))))


def _turns(rng: np.random.Generator) -> Move:
    upper = UPPER[pick(rng, ("hanging", "windmill", "frame_slide", "point_front", "swim"))]
    if rng.random() < 0.4:
        return turning(together(filled(pick(rng, _GROOVES), COUNTS), filled(upper, COUNTS)), pick(rng, (-360.0, 360.0)))
    legs = filled(LOWER[pick(rng, ("step_turn", "pivot_half_turns", "spin"))], COUNTS / 2)
    return together(legs, filled(upper, COUNTS / 2))


def _sitting(rng: np.random.Generator) -> Move:
    move = WHOLE["sit_and_rise" if rng.random() < 0.75 else "both_knees"]
    return concat(move, filled(together(LOWER["bounce"], UPPER["hanging"]), -move.beats % COUNTS))


_FEATURES: dict[str, Callable[[np.random.Generator], Move]] = {
    "crossed_punches": _crossed_punches,
    "kicks": _kicks,
    "turns": _turns,
    "sitting": _sitting,
}

KINDS = ("dance", "crossed_punches", "kicks", "turns", "sitting", "handstand", "dance", "mixture")
"""What sequence k shows: KINDS[k % 8]. With three people taking turns, each of them shows every kind once."""


def _composed(rng: np.random.Generator, kind: str, seconds: float) -> Motion:
    """A dance with the features of its kind in it, at least so many seconds long."""
    if kind == "handstand":
        first_s, upside_down_s = between(rng, 1.5, 3.0), between(rng, 5.5, 7.5)
        opening = follow(_composed(rng, "dance", first_s), handstand(rng, upside_down_s, FPS))
        rest_s = seconds - len(opening) / FPS
        return follow(opening, _composed(rng, "dance", rest_s)) if rest_s > 0 else opening
    bpm, style, amplitude = between(rng, *BPM), draw_style(rng), between(rng, 0.8, 1.1)
    parts: list[Move] = []
    while sum(part.beats for part in parts) < seconds * bpm / 60:
        # A feature, then a phrase of dance between it and the next.
        name = pick(rng, tuple(_FEATURES)) if kind == "mixture" else kind
        feature = _FEATURES[name](rng) if name in _FEATURES and len(parts) % 3 != 2 else phrase(rng, amplitude)
        parts.append(mirror(feature) if rng.random() < 0.5 else feature)
    frames = round(sum(part.beats for part in parts) * 60 / bpm * FPS) + 1
    return perform(concat(*parts), bpm, frames, FPS, kind, style)
