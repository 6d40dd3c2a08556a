"""`kpop_sim`, the stand-in for the paper's K-Pop set: dances, each with a teacher and four learners in front of a Kinect 2.

The teacher's motion is given as true joints, as from motion capture. Each learner is another person with a level from `best` to
`worst`. A model of skill (`synth.dances.skill`), or with `benchmark.faults=mixed` a second, independent family of faults
(`synth.dances.faults`), turns the teacher's motion into the learner's; with `benchmark.faults=ends` the learners are the ends
of the scale (`synth.dances.ends`). Position and heading differ per learner, the room is empty, and the measured depth is
segmented: only the person is kept. The labels are the levels.

Learner k of dance d is a pure function of the configuration, d and k. No training set contains the benchmark's people and
dances; `split=train` gives other dances by other people, for calibration.
"""

from dataclasses import asdict, dataclass, field
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from numba import njit

from kpopnet.camera import CAMERAS
from kpopnet.datasets.dances.writer import PackedDepth
from kpopnet.errors import InputError, check_between
from synth.body.shape import BodyConfig, Person, draw_person, draw_unseen_person
from synth.dances.ends import ENDS, end_motion
from synth.dances.faults import draw_profile, with_faults
from synth.dances.skill import LEVELS, Mistake, SkillConfig, draw_strengths, learn
from synth.motion import SPLITS, build_motion
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import Motion
from synth.motion.splice import resampled
from synth.samples.layers import silhouette_box
from synth.samples.observe import MARGIN_PX
from synth.scene.room import ViewConfig
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated.configuration import SimulatedSet, is_faulty, random_excerpt
from synth.simulated.film import LEVEL_VIEW, Studio, Take, measure_frame

MAX_NEIGHBOUR_STEP_M = 0.1
"""Neighbouring pixels are connected if their depths differ by less."""

DANCES = 100
SEED = 2018
"""Of the benchmark; nothing that was scored before it was fixed has this seed."""

SPACING = {"skill": 0.5, "mixed": 0.4, "ends": 0.0}
"""Spacing of the levels by the family of faults, see `synth.dances.skill.SkillConfig`: on other dances, of the split train, the
baseline of commit cb88187 (the feature of [17] with the plain norm) then orders 86 of 100 dances, as in the paper. The ends of
the scale have none."""

FPS = 30.0
CAMERA = CAMERAS["kinect_2"]
VIEW = ViewConfig(height_m=(0.8, 1.4), aim_m=(0.9, 1.1), roll_deg=1.0)
BODY = BodyConfig()
HEADING_STD_DEG = 5.0
"""Standard deviation of a learner's heading relative to the camera, as in `eval_sim`."""

MAX_TRAVEL_M = 1.0
"""Dances whose horizontal range, along either axis, is larger are rejected: they do not fit in front of one camera."""

DANCE_TRIES, PERSON_TRIES, ROOM_TRIES = 100, 8, 16
"""Dances tried for each of the set, people tried for each learner (a tall one may not fit into the image), and rooms tried for
each person."""


@dataclass
class KpopSimConfig:
    """Identity and size of the set.

    Attributes:
        name: name of the benchmark.
        seed: another seed gives other dances, people and errors.
        dances: number of dances to make; they are the first ones of the whole set.
        split: test is the benchmark; train and validation contain other dances by other people, for calibration.
        faults: family of the learners' faults: skill for the model of skill; mixed for a second, independent family, in which
            a better level has less of every fault (synth/dances/faults.py); ends for a perfect learner, another dance, random
            waving and standing still, whose scores and not whose order mean something (synth/dances/ends.py).
    """

    name: str = "kpop_sim"
    seed: int = SEED
    dances: int = DANCES
    split: str = "test"
    faults: str = "skill"

    def __post_init__(self) -> None:
        check_between("benchmark.seed", self.seed, 0, 2**32 - 1)
        check_between("benchmark.dances", self.dances, 1, DANCES)
        for name, known in (("split", SPLITS), ("faults", SPACING)):
            if getattr(self, name) not in known:
                raise InputError(f"benchmark.{name}={getattr(self, name)} is not one of {', '.join(known)}")


@dataclass(frozen=True)
class KpopSimSet(SimulatedSet):
    """Every setting that the dances depend on.

    Attributes:
        skill: differences between the levels, by default at the spacing of the family of faults; mixed uses the spacing alone.
        seconds: least and greatest length of a dance, seconds.
    """

    counted: ClassVar[str] = "dances"
    benchmark: KpopSimConfig = field(default_factory=KpopSimConfig)
    sensor: SensorConfig = SENSORS["kinect_2"]
    skill: SkillConfig | None = None
    seconds: tuple[float, float] = (15.0, 18.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.skill is None:
            object.__setattr__(self, "skill", SkillConfig(SPACING[self.benchmark.faults]))

    @property
    def levels(self) -> tuple[str, ...]:
        """The names of the levels, the best first."""
        return ENDS if self.benchmark.faults == "ends" else LEVELS


def dance_name(index: int) -> str:
    """The name of a dance, which is also its folder's."""
    return f"dance_{index:03d}"


LEARNERS = tuple("abcd")


@dataclass(frozen=True)
class LearnerTake:
    """The plan of a learner's recording.

    Attributes:
        level: index into the levels of the family of faults, see `KpopSimSet.levels`.
        strengths: strength of each kind of error by its name.
        mistakes: the wrong moves of the model of skill.
        take: the motion on the learner's body, in a room.
        yaw_rad: heading in which the motion was played at the origin, radians.
    """

    level: int
    strengths: dict[str, float]
    mistakes: list[Mistake]
    take: Take
    yaw_rad: float


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

    def _seed(self, kind: str, *numbers: int) -> tuple[int, ...]:
        """The seed of a part of a dance. Only this benchmark's seeds start with its name."""
        benchmark = self.config.benchmark
        kinds = ("dance", "teacher", "learner", "skill", "place", "noise", "order", "profile", "faults")
        return *b"kpop_sim", benchmark.seed, SPLITS.index(benchmark.split), kinds.index(kind), *numbers

    def _rng(self, kind: str, *numbers: int) -> np.random.Generator:
        return np.random.default_rng(self._seed(kind, *numbers))

    def _person(self, rng: np.random.Generator) -> Person:
        """Draws a person; for the split test, one who is in no training set."""
        split = self.config.benchmark.split
        return draw_unseen_person(rng, BODY) if split == "test" else draw_person(rng, BODY, split)

    def levels(self, index: int) -> list[int]:
        """The level of each of LEARNERS in dance `index`. Levels are permuted, so a name does not reveal the level."""
        return self._rng("order", index).permutation(len(LEVELS)).tolist()

    def _teacher_motion(self, index: int) -> Motion:
        """The teacher's motion; raises InputError if no recording is a dance that is long and stays within MAX_TRAVEL_M."""
        for attempt in range(DANCE_TRIES):
            rng = self._rng("dance", index, attempt)
            seconds = rng.uniform(*self.config.seconds)
            recorded = self.config.motion.source == "clips"
            motion = self._recorded(rng, seconds) if recorded else dance(0, int(rng.integers(2**63)), seconds, FPS)
            offset_m = (motion.root_m - motion.root_m[0])[:, [0, 2]]
            long_enough = len(motion) >= self.config.seconds[0] * FPS - 1
            if long_enough and np.ptp(offset_m, axis=0).max() < MAX_TRAVEL_M and not is_faulty(motion):
                return motion
        raise InputError(
            f"{dance_name(index)}: none of {DANCE_TRIES} recordings drawn lasts {self.config.seconds[0]:g} s, stays within "
            f"{MAX_TRAVEL_M} m and has no jumps; give other recordings, or take motion=choreography"
        )

    def _recorded(self, rng: np.random.Generator, seconds: float) -> Motion:
        dances = self._recordings.clip_indices("dance")
        if not dances:
            raise InputError(f"motion.path={self.config.motion.path}: no clip of category dance in its split")
        return random_excerpt(rng, resampled(self._recordings.motion(int(rng.choice(dances))), FPS), round(seconds * FPS))

    def teacher_joints_m(self, index: int) -> np.ndarray:
        """(T, 15, 3) float32 joints of the teacher of dance `index`, metres, in the frame of a level camera that they face."""
        return self.level_camera_joints_m(self._person(self._rng("teacher", index)), self.teacher_motion(index))

    def level_camera_joints_m(self, person: Person, motion: Motion) -> np.ndarray:
        """(T, 15, 3) float32 joints, metres, in the frame of a level camera that a person who performs a motion faces."""
        played = self.studio.play(person, motion, 0.0, np.zeros(2))
        return LEVEL_VIEW.to_camera(self.studio.joints_world_m(person, played.local, played.hips_m)).astype(np.float32)

    def skill(self, index: int, learner: int) -> tuple[int, dict[str, float], Motion, list[Mistake]]:
        """Level, strengths, motion and mistakes of a learner, without the body and the camera."""
        level, teacher = self.levels(index)[learner], self.teacher_motion(index)
        if self.config.benchmark.faults == "ends":
            end, rng = ENDS[level], self._rng("faults", index, learner)
            return level, {}, end_motion(end, teacher, self.teacher_motion(index + DANCES), rng), []
        if self.config.benchmark.faults == "mixed":
            severity = self.config.skill.severity(level)
            severities = {name: severity * share for name, share in draw_profile(self._rng("profile", index)).items()}
            return level, severities, with_faults(teacher, severities, self._rng("faults", index, learner)), []
        rng = self._rng("skill", index, learner)
        strengths = draw_strengths(rng, level, self.config.skill)
        motion, mistakes = learn(teacher, strengths, rng)
        return level, asdict(strengths), motion, mistakes

    def take(self, index: int, learner: int) -> LearnerTake:
        """Draws the skill, person, room and view; raises InputError if the whole dance is visible from no position."""
        level, strengths, motion, mistakes = self.skill(index, learner)
        for attempt in range(PERSON_TRIES):
            person = self._person(self._rng("learner", index, learner, attempt))
            rng = self._rng("place", index, learner, attempt)
            yaw_rad, curls_rad = np.radians(HEADING_STD_DEG) * rng.normal(), rng.uniform(0.0, 1.5, 2)
            played = self.studio.play(person, motion, yaw_rad, curls_rad)
            if (take := self.studio.place_in_rooms(rng, played, VIEW, ROOM_TRIES, furnished=False)) is not None:
                return LearnerTake(level, strengths, mistakes, take, yaw_rad)
        raise InputError(f"{dance_name(index)}, learner {LEARNERS[learner]}: the dance does not fit into the image")

    def record(self, index: int, learner: int, take: Take, on_frame=lambda: None) -> tuple[PackedDepth, np.ndarray]:
        """A learner's recording, rendered, measured and segmented, and (T, 15, 3) float32 true joints, metres.

        Only the person's box and a margin are measured. `on_frame` is called after each frame.
        """
        packed, joints, noise = PackedDepth(CAMERA), [], FilmNoise(self._seed("noise", index, learner))
        for clean in self.studio.render(take, range(len(take.played))):
            x0, y0, x1, y1 = silhouette_box(clean.person_m)
            x0, y0 = max(x0 - MARGIN_PX, 0), max(y0 - MARGIN_PX, 0)
            x1, y1 = min(x1 + MARGIN_PX, CAMERA.width), min(y1 + MARGIN_PX, CAMERA.height)
            depth_m, person = measure_frame(clean, (x0, y0, x1, y1), CAMERA, self.config.sensor, noise)
            packed.add(connected(np.where(person, depth_m, np.float32(0))), x0, y0)
            joints.append(clean.joints_camera_m)
            on_frame()
        return packed, np.array(joints)


@njit(cache=True)
def connected(depth_m):
    """Sets isolated pixels of (h, w) depth to 0: at depth edges the sensor measures some between person and wall.

    A pixel is kept if the depths of at least two of its eight neighbours differ from its own by less than
    MAX_NEIGHBOUR_STEP_M. This replaces the extraction of people from whole scenes, which is based on connectivity, too.
    """
    height, width = depth_m.shape
    kept = np.zeros_like(depth_m)
    for y in range(height):
        for x in range(width):
            if depth_m[y, x] == 0:
                continue
            num_connected = 0
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    if depth_m[v, u] > 0 and abs(depth_m[v, u] - depth_m[y, x]) < MAX_NEIGHBOUR_STEP_M:
                        num_connected += 1
            if num_connected > 2:  # the count includes the pixel itself
                kept[y, x] = depth_m[y, x]
    return kept
