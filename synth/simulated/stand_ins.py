"""`eval_sim` and `smmc10_sim`, the stand-ins for EVAL and SMMC-10: simulated sequences of one person in a furnished room.

Every sequence shows another person and begins in the paper's Y pose.

`eval_sim`: 24 sequences of 288 to 488 frames at 30 fps before a Kinect v1. Every eight show two dances, crossed punches, kicks,
turns, sitting on the floor, a handstand, and a mixture of all: the motions that the paper names.

`smmc10_sim`: 28 sequences of 100 to 400 frames at 25 fps before a SwissRanger, 144 x 176 pixels in portrait orientation, of
increasing difficulty. In the first only the arms move, slowly. Then people step, cross their arms in front of the body, swing
as with a racket, kick and turn, faster and faster. The last mix fast kicks, swings and full turns. Assumptions: our sources do
not describe the background of the real set, so the stand-in uses the harder case. The ground truth is markers on the skin,
tracked by a motion-capture system around the person (`synth.body.markers`).
"""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.skeleton import Joint
from synth.body.markers import MARKERS
from synth.motion.choreography.programmes import START_S, drill, show, start_pose
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, follow
from synth.scene.room import DANCE_HALL, ViewConfig
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated.film import Studio, Take
from synth.simulated.generator import is_faulty
from synth.simulated.sequences import HEADING_STD_DEG, People, Selection, SequenceGenerator, penetrates_itself

ROOM_TRIES = 8  # rooms tried for each motion


class StandIn(SequenceGenerator):
    """Makes sequences of one person each; holds one compiled scene."""

    tries = 100
    nothing_fits = (
        "motions stays inside the image and clear of walls and furniture without faults; give recordings that stay within "
        "about 3 x 2 m, or take motion=choreography"
    )
    marker_names = tuple(MARKERS)

    @abstractmethod
    def compose(self, rng: np.random.Generator, index: int, seconds: float) -> Motion:
        """Composes the motion of sequence `index` after its start pose, at least the given number of seconds long."""

    @cached_property
    def studio(self) -> Studio:
        return Studio(self.camera, self.renderer)

    def draw(self, rng: np.random.Generator, index: int, frames: int, people: People) -> Take | None:
        motion = self._motion(rng, index, frames)
        if is_faulty(motion):
            return None
        yaw_rad, curls_rad = np.radians(HEADING_STD_DEG) * rng.normal(), rng.uniform(0.0, 1.5, 2)
        played = self.studio.play(people(0), motion, yaw_rad, curls_rad)
        if penetrates_itself(played, round(START_S * self.fps)):
            return None
        return self.studio.place_in_rooms(rng, played, self.view, ROOM_TRIES, DANCE_HALL)

    def _motion(self, rng: np.random.Generator, index: int, frames: int) -> Motion:
        motion, recorded = start_pose(rng, self.fps), self.motion.source == "clips"
        while len(motion) < frames:
            left_s = (frames - len(motion)) / self.fps + 1
            if recorded:
                part = self.excerpt(rng, int(rng.integers(len(self.recordings))), self.fps, int(left_s * self.fps))
            else:
                part = self.compose(rng, index, left_s)
            motion = follow(motion, part)
        return cut(motion, 0, frames)

    def shots(self, index: int, take: Take, frames: range) -> Iterator[dict[str, np.ndarray]]:
        for shot in self.studio.shots(take, self.sensor, self.noise(index), frames):
            joints_m, markers_m = self.truth_m(shot["joints_camera_m"], shot["markers_m"]), shot["markers_m"]
            yield {"depth": shot["depth_m"], "joints_m": joints_m[None], "markers_m": markers_m[None]}

    def truth_m(self, joints_m: np.ndarray, markers_m: np.ndarray) -> np.ndarray:
        """(15, 3) float32 metres: what the set gives as true joints, NaN where they are unknown.

        The (M, 3) markers are NaN where they are not tracked.
        """
        return joints_m


@dataclass
class EvalSimConfig(Selection):
    """Identity and size of the set. Its first eight sequences show one of each kind."""

    name: str = "eval_sim"
    sequences: int = 24


@dataclass(frozen=True)
class EvalSim(StandIn):
    generator: ClassVar[int] = 5
    benchmark: EvalSimConfig = field(default_factory=EvalSimConfig)
    sensor: SensorConfig = SENSORS["kinect_v1"]
    frames: tuple[int, int] = (288, 488)

    about = "SIMULATED people in rooms, the stand-in for EVAL; this is not EVAL itself."
    names = "seq_{:02d}"
    camera, fps = CAMERAS["eval"], 30.0
    view = ViewConfig(height_m=(0.7, 1.7), aim_m=(0.85, 1.15))
    kinds = ("dance", "crossed_punches", "kicks", "turns", "sitting", "handstand", "dance", "mixture")

    def compose(self, rng: np.random.Generator, index: int, seconds: float) -> Motion:
        return show(rng, self.kind(index), seconds, self.fps)


KINDS: tuple[tuple[str, ...], ...] = (
    *[("arms",)] * 6,
    *[("steps",)] * 6,
    *[("crossed_punches",)] * 4,
    *[("swings",)] * 4,
    *[("kicks",)] * 3,
    *[("turns",)] * 2,
    *[("kicks", "swings", "turns")] * 3,
)
"""The kinds of motion in sequence k of `smmc10_sim`."""

MIN_BPM, MAX_BPM, BPM_HALF_RANGE = 70.0, 140.0, 8.0
"""Tempo of its first and of its last sequence, beats per minute. The tempo of a sequence is drawn within BPM_HALF_RANGE of the
linear interpolation between them."""

_OF_BOTH_SIDES = {
    "SHOULDER": ("SHO",), "ELBOW": ("ELB",), "HAND": ("WRI",), "HIP": ("ASI", "PSI"), "KNEE": ("KNE",), "FOOT": ("ANK",),
}  # fmt: skip
JOINT_MARKERS = {
    Joint.HEAD: ("LFHD", "RFHD", "LBHD", "RBHD"),
    Joint.NECK: ("C7", "CLAV"),
    # One hip's marker is in front and the other's behind: their mean with the shoulders' is the middle of shoulders and hips.
    Joint.TORSO: ("LSHO", "RSHO", "LASI", "RPSI"),
    **{
        Joint[f"{side}_{joint}"]: tuple(f"{side[0]}{marker}" for marker in markers)
        for side in ("RIGHT", "LEFT")
        for joint, markers in _OF_BOTH_SIDES.items()
    },
}
"""Joint to the markers whose mean stands for it."""


@dataclass
class Smmc10SimConfig(Selection):
    """Identity and size of the set. Its sequences become more difficult, so the first few are the easiest."""

    name: str = "smmc10_sim"
    sequences: int = len(KINDS)


@dataclass(frozen=True)
class Smmc10Sim(StandIn):
    benchmark: Smmc10SimConfig = field(default_factory=Smmc10SimConfig)
    sensor: SensorConfig = SENSORS["swissranger"]
    frames: tuple[int, int] = (100, 400)

    about = (
        "SIMULATED people in rooms, the stand-in for SMMC-10; this is not SMMC-10 itself. The true positions are markers on "
        "the skin, as in the real set. Read the error after subtracting the constant offset of each joint beside the raw error."
    )
    names, truth = "sim_{1:02d}", "simulated markers"
    camera, fps = CAMERAS["smmc10"], 25.0
    view = ViewConfig(height_m=(0.8, 1.5), aim_m=(0.9, 1.1))
    kinds = tuple(map(", ".join, KINDS))

    def compose(self, rng: np.random.Generator, index: int, seconds: float) -> Motion:
        tempo = MIN_BPM + (MAX_BPM - MIN_BPM) * index / (len(KINDS) - 1)
        return drill(rng, KINDS[index], (tempo - BPM_HALF_RANGE, tempo + BPM_HALF_RANGE), seconds, self.fps)

    def truth_m(self, joints_m: np.ndarray, markers_m: np.ndarray) -> np.ndarray:
        """The mean of each joint's markers; NaN where one of them is not tracked."""
        by_name = dict(zip(MARKERS, markers_m, strict=True))
        return np.stack([np.mean([by_name[name] for name in JOINT_MARKERS[joint]], axis=0) for joint in Joint])
