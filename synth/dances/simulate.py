"""`kpop_sim`, the stand-in for the paper's K-Pop set: dances, each with a teacher and four learners in front of a Kinect 2.

The teacher's motion is given as true joints, as from motion capture. Each learner is another person with a level from `best` to
`worst`. A model of skill (`synth.dances.skill`), or with `benchmark.faults=mixed` a second, independent family of faults
(`synth.dances.faults`), turns the teacher's motion into the learner's; with `benchmark.faults=ends` the learners are the ends
of the scale. Position and heading differ per learner, the room is empty, and the measured depth is
segmented: only the person is kept. The labels are the levels.

Learner k of dance d is a pure function of the settings, d and k. No training set contains the benchmark's people and
dances; `split=train` gives other dances by other people, for calibration.
"""

import itertools
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.dance_set import LABELS, TEACHER, KpopSet
from kpopnet.datasets.dances.writer import PackedDepth, write_labels, write_learner, write_teacher
from kpopnet.errors import InputError, check_between, check_one_of
from kpopnet.viz.drawing import TRUE, person_tile, sheet
from synth.body.shape import BodyConfig, Person, draw_person
from synth.dances.faults import ENDS, draw_profile, end_motion, with_faults
from synth.dances.skill import LEVELS, Mistake, SkillConfig, draw_strengths, learn
from synth.motion import SPLITS
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, resampled, turned_to_front
from synth.samples.layers import silhouette_box, widened
from synth.samples.observe import MARGIN_PX
from synth.scene.room import ViewConfig
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated.film import PERSON, Studio, Take, measure_surfaces, nearest_surfaces
from synth.simulated.generator import SetGenerator, is_faulty
from synth.simulated.sequences import HEADING_STD_DEG

MAX_NEIGHBOUR_STEP_M = 0.1  # neighbouring pixels are connected if their depths differ by less
DANCES = 100
SEED = 2018  # of the benchmark; nothing that was scored before it was fixed has this seed

SPACING = {"skill": 0.5, "mixed": 0.4, "ends": 0.0}
"""Spacing of the levels by the family of faults, see `synth.dances.skill.SkillConfig`: on other dances, of the split train, the
baseline of commit cb88187 (the feature of [17] with the plain norm) then orders 86 of 100 dances, as in the paper. The ends of
the scale have none."""

FPS = 30.0
CAMERA = CAMERAS["kinect_2"]
VIEW = ViewConfig(height_m=(0.8, 1.4), aim_m=(0.9, 1.1), roll_deg=1.0)
BODY = BodyConfig()

MAX_TRAVEL_M = 1.0
"""Dances whose horizontal range, along either axis, is larger are rejected: they do not fit in front of one camera. Recorded
ones are looked at before they are turned to the camera, so that the same are taken either way."""

EXCERPT_STEP_S = 0.5  # where an excerpt of a recording is rejected, the next one tried begins as much later

SHEET_DANCES, TILES, TILE_PX = 3, 8, 160

DANCE_TRIES, PERSON_TRIES, ROOM_TRIES = 100, 8, 16
"""Dances tried for each of the set, people tried for each learner (a tall one may not fit into the image), and rooms tried for
each person."""


@dataclass
class KpopSimConfig:
    """Identity and size of the set.

    Attributes:
        name: name of the benchmark.
        seed: another seed gives other dances, people and errors.
        dances: greatest number of dances to make; they are the first ones of the whole set. Recordings (motion=clips) may have
            fewer excerpts.
        split: test is the benchmark; train and validation contain other dances by other people, for calibration.
        faults: family of the learners' faults: skill for the model of skill; mixed for a second, independent family, in which
            a better level has less of every fault (synth/dances/faults.py); ends for a perfect learner, another dance, random
            waving and standing still, whose scores and not whose order mean something.
        facing: whom recorded dances (motion=clips) face in the mean: camera; or recording, what they faced when they were
            recorded, which leaves most dancers in profile. Composed dances face the camera.
    """

    name: str = "kpop_sim"
    seed: int = SEED
    dances: int = DANCES
    split: str = "test"
    faults: str = "skill"
    facing: str = "camera"

    def __post_init__(self) -> None:
        check_between("benchmark.seed", self.seed, 0, 2**32 - 1)
        check_between("benchmark.dances", self.dances, 1, DANCES)
        for name, known in (("split", SPLITS), ("faults", SPACING), ("facing", ("camera", "recording"))):
            check_one_of(f"benchmark.{name}", getattr(self, name), known)


LEARNERS = tuple("abcd")


def dance_name(index: int) -> str:
    """The name of a dance, which is also its folder's."""
    return f"dance_{index:03d}"


@dataclass(frozen=True)
class LearnerMotion:
    """What a learner dances, without the body and the camera."""

    level: int  # index into the levels of the family of faults, see `KpopSim.level_names`
    strengths: dict[str, float]  # strength of each kind of error by its name
    motion: Motion
    mistakes: list[Mistake]  # the wrong moves of the model of skill


@dataclass(frozen=True)
class KpopSim(SetGenerator):
    """Makes the dances; holds one compiled scene. Labels are written last: a dance that has labels is finished."""

    part, finished_files, unfinished_files = "dance", f"*/{LABELS}", "dance_*/.*.tmp"
    generator: ClassVar[int] = 5
    camera = CAMERA
    seeded = ("dance", "teacher", "learner", "skill", "place", "noise", "order", "profile", "faults")

    benchmark: KpopSimConfig = field(default_factory=KpopSimConfig)
    sensor: SensorConfig = SENSORS["kinect_2"]
    # differences between the levels, by default at the spacing of the family of faults; mixed uses the spacing alone
    skill: SkillConfig | None = None
    # least and greatest length of a dance, seconds; recorded ones have the least, so that more of them fit into a recording
    seconds: tuple[float, float] = (15.0, 18.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.skill is None:
            object.__setattr__(self, "skill", SkillConfig(SPACING[self.benchmark.faults]))

    @property
    def version(self) -> int:
        # From 6 on no two excerpts of recordings overlap; composed sets are the same.
        return 6 if self.motion.source == "clips" else self.generator

    @property
    def size(self) -> int:
        return min(super().size, len(self.excerpts)) if self.motion.source == "clips" else super().size

    @property
    def level_names(self) -> tuple[str, ...]:
        """The best first."""
        return ENDS if self.benchmark.faults == "ends" else LEVELS

    @cached_property
    def studio(self) -> Studio:
        return Studio(CAMERA, self.renderer)

    @cached_property
    def teacher_motion(self) -> Callable[[int], Motion]:
        """The motion of the teacher of a dance, by the dance's number; as `_teacher_motion`."""
        return lru_cache(maxsize=4)(self._teacher_motion)

    def _person(self, rng: np.random.Generator) -> Person:
        """Draws a person; in the split test, one of the benchmarks' people."""
        split = self.benchmark.split
        return draw_person(rng, BODY, "benchmark" if split == "test" else split)

    def levels(self, index: int) -> list[int]:
        """The level of each of LEARNERS in dance `index`. Levels are permuted, so a name does not reveal the level."""
        return self._rng("order", index).permutation(len(LEVELS)).tolist()

    def _teacher_motion(self, index: int) -> Motion:
        """The teacher's motion. Raises InputError if the recordings have fewer excerpts than `index` + 1."""
        if self.motion.source == "clips":
            return self._recorded(index)
        for attempt in range(DANCE_TRIES):
            rng = self._rng("dance", index, attempt)
            seconds = rng.uniform(*self.seconds)
            motion = dance(0, int(rng.integers(2**63)), seconds, FPS)
            if is_danceable(motion):
                return motion
        raise InputError(f"{dance_name(index)}: none of {DANCE_TRIES} dances composed stays within {MAX_TRAVEL_M} m")

    def _recorded(self, index: int) -> Motion:
        if index >= len(self.excerpts):
            found = f"its recordings have {len(self.excerpts)} excerpts that can be danced, none for {dance_name(index)}"
            raise InputError(f"motion.path={self.motion.path}: {found}")
        clip, start = self.excerpts[index]
        motion = cut(self._resampled(clip), start, start + self._excerpt_frames)
        return turned_to_front(motion) if self.benchmark.facing == "camera" else motion

    @cached_property
    def excerpts(self) -> list[tuple[int, int]]:
        """The recording and first frame of each recorded dance, in random order: no two have a frame in common.

        In each recording the earliest excerpt that can be danced is taken, then the earliest one after it, and so on. Raises
        InputError if there is none.
        """
        found, frames = [], self._excerpt_frames
        for clip in self.recordings.clip_indices("dance"):
            motion, start = self._resampled(clip), 0
            while start + frames <= len(motion):
                if is_danceable(cut(motion, start, start + frames)):
                    found.append((clip, start))
                    start += frames
                else:
                    start += round(EXCERPT_STEP_S * FPS)
        if not found:
            raise InputError(
                f"motion.path={self.motion.path}: no recording of category dance in its split has {self.seconds[0]:g} s that "
                f"stay within {MAX_TRAVEL_M} m and have no jumps; give other recordings, or take motion=choreography"
            )
        return [found[number] for number in self._rng("dance").permutation(len(found))]

    @property
    def _excerpt_frames(self) -> int:
        return round(self.seconds[0] * FPS)

    def _resampled(self, clip: int) -> Motion:
        return resampled(self.recordings.motion(clip), FPS)

    def teacher_joints_m(self, index: int) -> np.ndarray:
        """(T, 15, 3) float32 joints of the teacher of dance `index`, metres, in the frame of a level camera that they face."""
        person = self._person(self._rng("teacher", index))
        return self.studio.level_joints_m(self.studio.play(person, self.teacher_motion(index), 0.0, np.zeros(2)))

    def learner(self, index: int, learner: int) -> LearnerMotion:
        level, teacher = self.levels(index)[learner], self.teacher_motion(index)
        if self.benchmark.faults == "ends":
            rng, another = self._rng("faults", index, learner), self.teacher_motion(self._another(index))
            return LearnerMotion(level, {}, end_motion(ENDS[level], teacher, another, rng), [])
        if self.benchmark.faults == "mixed":
            severity = self.skill.severity(level)
            severities = {name: severity * share for name, share in draw_profile(self._rng("profile", index)).items()}
            return LearnerMotion(level, severities, with_faults(teacher, severities, self._rng("faults", index, learner)), [])
        rng = self._rng("skill", index, learner)
        strengths = draw_strengths(rng, level, self.skill)
        return LearnerMotion(level, asdict(strengths), *learn(teacher, strengths, rng))

    def _another(self, index: int) -> int:
        """The number of another dance than `index`: a composed one that is not in the set, or the next excerpt."""
        if self.motion.source != "clips":
            return index + DANCES
        if len(self.excerpts) == 1:
            raise InputError(f"motion.path={self.motion.path}: benchmark.faults=ends needs two dances, its recordings have one")
        return (index + 1) % len(self.excerpts)

    def take(self, index: int, learner: int, motion: Motion) -> Take:
        """Draws the person, room and view; raises InputError if the whole dance is visible from no position."""
        for attempt in range(PERSON_TRIES):
            person = self._person(self._rng("learner", index, learner, attempt))
            rng = self._rng("place", index, learner, attempt)
            yaw_rad, curls_rad = np.radians(HEADING_STD_DEG) * rng.normal(), rng.uniform(0.0, 1.5, 2)
            played = self.studio.play(person, motion, yaw_rad, curls_rad)
            if (take := self.studio.place_in_rooms(rng, played, VIEW, ROOM_TRIES, furniture=())) is not None:
                return take
        raise InputError(f"{dance_name(index)}, learner {LEARNERS[learner]}: the dance does not fit into the image")

    def record(self, index: int, learner: int, take: Take, on_frame=lambda: None) -> tuple[PackedDepth, np.ndarray]:
        """A learner's recording, rendered, measured and segmented, and (T, 15, 3) float32 true joints, metres.

        Nothing farther from the person than a margin is measured. `on_frame` is called after each frame.
        """
        packed, joints, noise = PackedDepth(CAMERA), [], FilmNoise(self._seed("noise", index, learner))
        for clean in self.studio.render(take, range(len(take.played))):
            x0, y0, x1, y1 = widened(silhouette_box(clean.person_m), MARGIN_PX, CAMERA)
            near = slice(y0, y1), slice(x0, x1)
            surfaces_m, labels = nearest_surfaces(clean.room_m, [clean.person_m])
            measured = np.zeros_like(labels)
            measured[near] = labels[near]
            depth_m, seen = measure_surfaces(
                (surfaces_m, measured), clean.number, clean.joints_camera_m, CAMERA, self.sensor, noise
            )
            packed.add(connected(np.where(seen == PERSON, depth_m, np.float32(0))[near]), x0, y0)
            joints.append(clean.joints_camera_m)
            on_frame()
        return packed, np.array(joints)

    def manifest_entries(self) -> dict:
        benchmark = self.benchmark
        about = (
            f"SIMULATED teachers, learners and labels; not the paper's K-Pop set, and no real person: seed {benchmark.seed}, "
            f"split {benchmark.split}, faults {benchmark.faults}, configuration {self.hash}."
        )
        entries = {"name": benchmark.name, "about": about, "split": benchmark.split, "fps": FPS, "levels": self.level_names}
        return entries | {"ordered": benchmark.faults != "ends", "independent": self.motion.source != "clips"}

    def frames_per_part(self) -> float:
        return sum(self.seconds) / 2 * FPS * len(LEARNERS)

    def path(self, folder: Path, index: int) -> Path:
        return folder / dance_name(index) / LABELS

    def make(self, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
        """Makes the missing files of dance `index` and calls `on_frame` after each frame of a learner."""
        place = folder / dance_name(index)
        if not (place / TEACHER).exists():
            joints_m = self.teacher_joints_m(index)
            about = {"motion": self.teacher_motion(index).name}
            write_teacher(place, Performance(joints_m, np.arange(len(joints_m)) / FPS), about)
        for number, name in enumerate(LEARNERS):
            if (place / f"{name}.h5").exists():
                continue
            learner = self.learner(index, number)
            packed, joints_m = self.record(index, number, self.take(index, number, learner.motion), on_frame)
            about = {
                "level": self.level_names[learner.level],
                "strengths": learner.strengths,
                "mistakes": [asdict(mistake) for mistake in learner.mistakes],
            }
            write_learner(place, name, np.arange(len(joints_m)) / FPS, joints_m, packed, about)
        write_labels(place, [LEARNERS[number] for number in np.argsort(self.levels(index))])

    def contact_sheet(self, folder: Path, manifest: dict) -> np.ndarray:
        """RGB image of the first SHEET_DANCES dances: a row for the teacher and each learner, columns at equal times."""
        dances, rows = KpopSet(folder), []
        nothing_m = np.zeros((CAMERA.height, CAMERA.width), np.float32)
        for name in dances.names[:SHEET_DANCES]:
            dance = dances.dance(name)
            taught_m = dance.teacher().joints_m
            chosen = np.linspace(0, len(taught_m) - 1, TILES + 2).astype(int)[1:-1].tolist()
            tiles = [person_tile(nothing_m, CAMERA, ((taught_m[frame], TRUE),), TILE_PX, ("",)) for frame in chosen]
            rows.append((f"{name}, teacher", tiles))
            for learner in dance.learners:
                clip, joints_m = learner.depth(), learner.joints().joints_m
                tiles = [
                    person_tile(
                        clip.depth_m[frame], clip.camera, ((joints_m[frame], TRUE),), TILE_PX, (f"{frame / FPS:.1f} s",)
                    )
                    for frame in chosen
                ]
                strengths = "".join(f", {kind} {value:.2f}" for kind, value in learner.about["strengths"].items())
                rows.append((f"{name}, learner {learner.name}: {learner.about['level']}{strengths}", tiles))
        return sheet(rows, (TRUE,), f"{manifest['about']} Depth of the person alone, true joints")


def is_danceable(motion: Motion) -> bool:
    """Whether a motion stays within MAX_TRAVEL_M and is not faulty."""
    travel_m = np.ptp((motion.root_m - motion.root_m[0])[:, [0, 2]], axis=0).max()
    return bool(travel_m < MAX_TRAVEL_M) and not is_faulty(motion)


def connected(depth_m: np.ndarray) -> np.ndarray:
    """(h, w) depth without isolated pixels: at depth edges the sensor measures some between person and wall.

    A pixel is kept if the depths of at least two of its eight neighbours differ from its own by less than
    MAX_NEIGHBOUR_STEP_M. This replaces the extraction of people from whole scenes, which is based on connectivity, too.
    """
    height, width = depth_m.shape
    padded = np.pad(depth_m, 1)
    num_connected = np.zeros(depth_m.shape, int)  # the pixel itself, too
    for v, u in itertools.product(range(3), range(3)):
        other_m = padded[v : v + height, u : u + width]
        num_connected += (other_m > 0) & (np.abs(other_m - depth_m) < MAX_NEIGHBOUR_STEP_M)
    return np.where((depth_m > 0) & (num_connected > 2), depth_m, np.float32(0))
