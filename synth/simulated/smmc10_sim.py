"""`smmc10_sim`, the stand-in for SMMC-10: simulated sequences of increasing difficulty.

28 sequences of 100 to 400 frames at 25 fps, 144 x 176 pixels in portrait orientation, each of another person.
In the first sequences only the arms move, slowly. Then people step, cross their arms in front of the body, swing as with a
racket, kick and turn, faster and faster. The last sequences mix fast kicks, swings and full turns. The rooms are furnished; the
sensor is a SwissRanger. Assumptions: our sources do not describe the background of the real set, so the stand-in uses the
harder case. Each sequence starts in the paper's Y pose. The ground truth is markers on the skin, tracked by a motion-capture
system around the person (`synth.body.markers`).
"""

from dataclasses import dataclass, field

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.skeleton import Joint
from synth.body.markers import MARKERS
from synth.motion.choreography.programmes import drill
from synth.motion.skeleton import Motion
from synth.scene.room import ViewConfig
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated.film import Film
from synth.simulated.sequences import Selection, StandIn

KINDS: tuple[tuple[str, ...], ...] = (
    *[("arms",)] * 6,
    *[("steps",)] * 6,
    *[("crossed_punches",)] * 4,
    *[("swings",)] * 4,
    *[("kicks",)] * 3,
    *[("turns",)] * 2,
    *[("kicks", "swings", "turns")] * 3,
)
"""The kinds of motion in sequence k."""

MIN_BPM, MAX_BPM, BPM_HALF_RANGE = 70.0, 140.0, 8.0
"""Tempo of the first and of the last sequence, beats per minute. The tempo of a sequence is drawn within BPM_HALF_RANGE of the
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
    truth = "simulated markers"
    camera, fps = CAMERAS["smmc10"], 25.0
    view = ViewConfig(height_m=(0.8, 1.5), aim_m=(0.9, 1.1))
    kinds = tuple(map(", ".join, KINDS))

    @classmethod
    def sequence_name(cls, index: int) -> str:
        return f"sim_{index + 1:02d}"

    def compose(self, rng: np.random.Generator, index: int, seconds: float) -> Motion:
        tempo = MIN_BPM + (MAX_BPM - MIN_BPM) * index / (len(KINDS) - 1)
        return drill(rng, KINDS[index], (tempo - BPM_HALF_RANGE, tempo + BPM_HALF_RANGE), seconds, self.fps)

    def truth_m(self, film: Film, markers_m: np.ndarray) -> np.ndarray:
        """(T, 15, 3) float32 metres: the mean of each joint's markers; NaN where one of them is not tracked."""
        by_name = dict(zip(MARKERS, markers_m.swapaxes(0, 1), strict=True))
        return np.stack([np.mean([by_name[name] for name in JOINT_MARKERS[joint]], axis=0) for joint in Joint], axis=1)
