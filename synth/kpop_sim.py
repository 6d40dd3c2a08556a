"""`kpop_sim`, the stand-in for the paper's K-Pop set: dances, each with a teacher and four learners before a Kinect 2.

The teacher's motion is true joints, as motion capture would give them. Each learner is a person of their own, of a level
from `best` to `worst`, who dances the same through a model of skill (`synth.skill`), at a place and with a heading of
their own in an empty room; only the person is kept of what the sensor measures, for the set is about dancing. The labels
are the levels.

Learner k of dance d is a pure function of the configuration, d and k. The benchmark's people and dances were in no
training set; `split=train` gives others, to calibrate on.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from numba import njit

from kpopnet.benchmarks.kpop_writing import PackedDepth
from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from synth.body import BodyConfig, Person, draw_person, draw_stranger
from synth.film import Played, Studio, Take
from synth.motion import SPLITS, build_motion
from synth.motion.choreography import dance
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, resampled
from synth.observe import LIMB_ENDS, MARGIN_PX
from synth.room import Room, View, ViewConfig, draw_room, draw_view
from synth.sample import silhouette_box
from synth.sensor import SENSORS, SensorConfig, measure_labelled
from synth.simulated_set import SimulatedSet, is_faulty
from synth.skill import LEVELS, Mistake, SkillConfig, Strengths, draw_strengths, learn

CONNECTED_M = 0.1

DANCES = 100
FPS = 30.0
CAMERA = CAMERAS["kinect_2"]
VIEW = ViewConfig(height_m=(0.8, 1.4), aim_m=(0.9, 1.1), roll_deg=1.0)
BODY = BodyConfig()
TEACHER_M = (2.5, 1.0)
"""How far before the imagined, level camera of the teacher's joints the dance begins, and how high that camera is."""

HEADING_DEG = 5.0
"""Standard deviation of how far a learner is turned away from the camera, as in `eval_sim`."""

ROOM_BOXES = 4
"""Floor and three walls, without furniture."""

TRAVEL_M = 1.0
"""A dance that leads farther away, to any side, is no dance for one camera."""

TRIES, PEOPLE, ROOMS = 100, 8, 16
"""Dances tried for each of the set, people for each learner (a tall one may not fit into the picture), rooms for each."""


@dataclass
class KpopSimConfig:
    """Which set.

    Attributes:
        name: of the benchmark.
        seed: other dances, people and faults.
        dances: only the first so many, which are the same as in the whole.
        split: test is the benchmark; train and validation are other dances by other people, to calibrate on.
    """

    name: str = "kpop_sim"
    seed: int = 0
    dances: int = DANCES
    split: str = "test"

    def __post_init__(self) -> None:
        if not 0 <= self.seed < 2**32:
            raise InputError(f"benchmark.seed={self.seed} must lie in 0..{2**32 - 1}")
        if not 1 <= self.dances <= DANCES:
            raise InputError(f"benchmark.dances={self.dances}: the set has {DANCES}; give a number from 1 on")
        if self.split not in SPLITS:
            raise InputError(f"benchmark.split={self.split} is not one of {', '.join(SPLITS)}")


@dataclass(frozen=True)
class KpopSimSet(SimulatedSet):
    """The whole of what the dances depend on.

    Attributes:
        skill: how the levels differ.
        seconds: least and greatest length of a dance.
    """

    counted: ClassVar[str] = "dances"
    benchmark: KpopSimConfig = field(default_factory=KpopSimConfig)
    sensor: SensorConfig = SENSORS["kinect_2"]
    skill: SkillConfig = field(default_factory=SkillConfig)
    seconds: tuple[float, float] = (15.0, 18.0)


def dance_name(index: int) -> str:
    return f"dance_{index:03d}"


LEARNERS = tuple("abcd")


@dataclass(frozen=True)
class LearnerTake:
    """A learner, planned: who, how well, what and where; `yaw_rad` is how far they were turned, at the origin."""

    level: int
    strengths: Strengths
    mistakes: list[Mistake]
    take: Take
    yaw_rad: float


@dataclass(frozen=True)
class LearnerShot:
    """One frame: (h, w) float32 metres of the person alone, whose first pixel is (x0, y0), and (15, 3) true joints."""

    depth_m: np.ndarray
    x0: int
    y0: int
    joints_camera_m: np.ndarray


class KpopSim:
    """Makes the dances; holds one compiled scene."""

    def __init__(self, config: KpopSimSet) -> None:
        self.config = config
        self.teacher_motion = lru_cache(maxsize=4)(self._teacher_motion)

    @cached_property
    def studio(self) -> Studio:
        return Studio(CAMERA, self.config.renderer)

    @cached_property
    def _recordings(self):
        return build_motion(self.config.motion, self.config.benchmark.split)

    def _rng(self, kind: str, *numbers: int) -> np.random.Generator:
        """Chance for a part of a dance: its seed starts with the benchmark's name, as no other does."""
        benchmark = self.config.benchmark
        kinds = ("dance", "teacher", "learner", "skill", "place", "noise", "order")
        numbers = (benchmark.seed, SPLITS.index(benchmark.split), kinds.index(kind), *numbers)
        return np.random.default_rng([*b"kpop_sim", *numbers])

    def _person(self, rng: np.random.Generator) -> Person:
        """Of the benchmark, somebody whom no training set knows."""
        split = self.config.benchmark.split
        return draw_stranger(rng, BODY) if split == "test" else draw_person(rng, BODY, split)

    def levels(self, index: int) -> list[int]:
        """The level of each of LEARNERS in dance `index`: a name says nothing."""
        return self._rng("order", index).permutation(len(LEVELS)).tolist()

    def _teacher_motion(self, index: int) -> Motion:
        """What is danced in dance `index`.

        Raises:
            InputError: the recordings have no dance that stays in one place.
        """
        for attempt in range(TRIES):
            rng = self._rng("dance", index, attempt)
            seconds = rng.uniform(*self.config.seconds)
            motion = self._recorded(rng, seconds) if self.config.motion.source == "clips" else _composed(rng, seconds)
            away_m = (motion.root_m - motion.root_m[0])[:, [0, 2]]
            long_enough = len(motion) >= self.config.seconds[0] * FPS - 1
            if long_enough and np.ptp(away_m, axis=0).max() < TRAVEL_M and not is_faulty(motion):
                return motion
        raise InputError(
            f"{dance_name(index)}: none of {TRIES} recordings drawn lasts {self.config.seconds[0]:g} s, stays within "
            f"{TRAVEL_M} m and has no jumps; give other recordings, or take motion=choreography"
        )

    def _recorded(self, rng: np.random.Generator, seconds: float) -> Motion:
        dances = self._recordings.numbers("dance")
        if not dances:
            raise InputError(f"motion.path={self.config.motion.path}: no clip of category dance in its split")
        motion = resampled(self._recordings.motion(int(rng.choice(dances))), FPS)
        start = int(rng.integers(max(len(motion) - round(seconds * FPS), 0) + 1))
        return cut(motion, start, start + round(seconds * FPS))

    def teacher_joints_m(self, index: int) -> np.ndarray:
        """(T, 15, 3) float32 of dance `index`, before a level camera which the teacher faces."""
        return self.before_level_camera_m(self._person(self._rng("teacher", index)), self.teacher_motion(index))

    def before_level_camera_m(self, person: Person, motion: Motion) -> np.ndarray:
        """(T, 15, 3) float32 joints of somebody who does the motion, facing a level camera at TEACHER_M."""
        played = self.studio.play(person, motion, 0.0, np.zeros(2))
        level = View(np.array([0, -TEACHER_M[0], TEACHER_M[1]]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
        return self.joints_camera_m(played, np.zeros(3), level)

    def joints_camera_m(self, played: Played, place_m: np.ndarray, view: View) -> np.ndarray:
        """(T, 15, 3) float32 true joints of whoever dances there."""
        scene = self.studio.scene
        scene.dress(scene.fit(played.person))
        joints = []
        for local, hips_m in zip(played.local, played.hips_m, strict=True):
            scene.pose(local, hips_m + place_m)
            joints.append(scene.joints_world_m())
        return view.to_camera(np.array(joints)).astype(np.float32)

    def skill(self, index: int, learner: int) -> tuple[int, Strengths, Motion, list[Mistake]]:
        """Level, strengths, motion and mistakes of a learner: all but the body and the camera."""
        level = self.levels(index)[learner]
        rng = self._rng("skill", index, learner)
        strengths = draw_strengths(rng, level, self.config.skill)
        motion, mistakes = learn(self.teacher_motion(index), strengths, rng)
        return level, strengths, motion, mistakes

    def take(self, index: int, learner: int) -> LearnerTake:
        """A learner, planned.

        Raises:
            InputError: no place was found from where the whole dance is seen.
        """
        level, strengths, motion, mistakes = self.skill(index, learner)
        for attempt in range(PEOPLE):
            person = self._person(self._rng("learner", index, learner, attempt))
            rng = self._rng("place", index, learner, attempt)
            yaw_rad, curls_rad = np.radians(HEADING_DEG) * rng.normal(), rng.uniform(0.0, 1.5, 2)
            played = self.studio.play(person, motion, yaw_rad, curls_rad)
            for _ in range(ROOMS):
                view, room = draw_view(rng, VIEW), _emptied(draw_room(rng))
                if (take := self.studio.place(rng, played, room, view)) is not None:
                    return LearnerTake(level, strengths, mistakes, take, yaw_rad)
        raise InputError(f"{dance_name(index)}, learner {LEARNERS[learner]}: the dance does not fit into the picture")

    def shots(self, index: int, learner: int, take: Take) -> Iterator[LearnerShot]:
        """What the sensor makes of the learner, frame by frame; only their surroundings are measured."""
        studio, scene = self.studio, self.studio.scene
        scene.dress(scene.fit(take.played.person))
        scene.look(take.view)
        scene.furnish(take.room)
        room_m = studio.renderer.room_m()
        for frame, (local, hips_m) in enumerate(zip(take.played.local, take.played.hips_m, strict=True)):
            scene.pose(local, hips_m + take.place_m)
            person_m = studio.renderer.person_m()
            x0, y0, x1, y1 = silhouette_box(person_m)
            x0, y0 = max(x0 - MARGIN_PX, 0), max(y0 - MARGIN_PX, 0)
            x1, y1 = min(x1 + MARGIN_PX, CAMERA.width), min(y1 + MARGIN_PX, CAMERA.height)
            part = slice(y0, y1), slice(x0, x1)
            behind_m, before_m = room_m[part], person_m[part]
            is_person = (before_m > 0) & ((behind_m == 0) | (before_m <= behind_m))
            joints_m = take.view.to_camera(scene.joints_world_m()).astype(np.float32)
            depth_m, seen = measure_labelled(
                np.where(is_person, before_m, behind_m),
                is_person.astype(np.uint8) + np.uint8(1),
                CAMERA.cropped(x0, y0, x1 - x0, y1 - y0),
                self.config.sensor,
                self._rng("noise", index, learner, frame),
                joints_m[LIMB_ENDS],
            )
            yield LearnerShot(connected(np.where(seen == 2, depth_m, np.float32(0))), x0, y0, joints_m)

    def record(self, index: int, learner: int, take: Take, on_frame=lambda: None) -> tuple[PackedDepth, np.ndarray]:
        """The recording of a learner, and (T, 15, 3) true joints."""
        packed, joints = PackedDepth(CAMERA), []
        for shot in self.shots(index, learner, take):
            packed.add(shot.depth_m, shot.x0, shot.y0)
            joints.append(shot.joints_camera_m)
            on_frame()
        return packed, np.array(joints)


@njit(cache=True)
def connected(depth_m):
    """(h, w) without the pixels that hang on nothing: at outlines the sensor puts some half-way to the wall.

    A pixel stays if two of its eight neighbours lie within CONNECTED_M; the step that finds people in whole scenes, which
    this stands for, goes by connection too.
    """
    height, width = depth_m.shape
    kept = np.zeros_like(depth_m)
    for y in range(height):
        for x in range(width):
            if depth_m[y, x] == 0:
                continue
            near = 0
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    if depth_m[v, u] > 0 and abs(depth_m[v, u] - depth_m[y, x]) < CONNECTED_M:
                        near += 1
            if near > 2:  # itself among them
                kept[y, x] = depth_m[y, x]
    return kept


def _composed(rng: np.random.Generator, seconds: float) -> Motion:
    return dance(0, int(rng.integers(2**63)), seconds, FPS)


def _emptied(room: Room) -> Room:
    return Room(room.centres_m[:ROOM_BOXES], room.halves_m[:ROOM_BOXES], room.yaws_rad[:ROOM_BOXES])
