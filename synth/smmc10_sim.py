"""`smmc10_sim`, the stand-in for SMMC-10: simulated sequences that grow more difficult, in SMMC-10's own bytes.

28 sequences of 100 to 400 frames at 25 fps, 144 x 176 upright: four people, sim01 to sim04, take turns. At first only their
arms move, slowly; then they step, cross their arms before the body, swing as with a racket, kick and turn, ever faster; the
last ones mix fast kicks, swings and whole turns. In furnished rooms, measured by a SwissRanger: what the real set shows
behind its people our sources do not say, so the stand-in takes the harder case. Each starts in the paper's Y pose. The truth
is markers on the skin that a motion-capture system around the person follows (`synth.markers`).
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from kpopnet.camera import CAMERAS
from synth.motion.features import drill
from synth.motion.skeleton import Motion
from synth.room import ViewConfig
from synth.sensor import SENSORS, SensorConfig
from synth.stand_in import StandIn, StandInSet, Which

SUBJECTS = ("sim01", "sim02", "sim03", "sim04")
FPS = 25.0
CAMERA = CAMERAS["smmc10"]

KINDS: tuple[tuple[str, ...], ...] = (
    *[("arms",)] * 6,
    *[("steps",)] * 6,
    *[("crossed_punches",)] * 4,
    *[("swings",)] * 4,
    *[("kicks",)] * 3,
    *[("turns",)] * 2,
    *[("kicks", "swings", "turns")] * 3,
)
"""What sequence k shows."""

SEQUENCES = len(KINDS)
SLOWEST_BPM, FASTEST_BPM, SPREAD_BPM = 70.0, 140.0, 8.0
"""Tempo of the first sequence and of the last; a sequence's own lies so far about its place between them."""


@dataclass
class Smmc10SimConfig(Which):
    """Which set; its sequences grow more difficult, so the first few are the easiest."""

    whole: ClassVar[int] = SEQUENCES
    name: str = "smmc10_sim"
    sequences: int = SEQUENCES


@dataclass(frozen=True)
class Smmc10SimSet(StandInSet):
    """The whole of what the sequences depend on."""

    benchmark: Smmc10SimConfig = field(default_factory=Smmc10SimConfig)
    sensor: SensorConfig = SENSORS["swissranger"]
    frames: tuple[int, int] = (100, 400)

    def composed_kind(self, index: int) -> str:
        return ", ".join(KINDS[index])


class Smmc10Sim(StandIn):
    """Makes the sequences."""

    camera = CAMERA
    fps = FPS
    view = ViewConfig(height_m=(0.8, 1.5), aim_m=(0.9, 1.1))
    subjects = SUBJECTS

    @classmethod
    def sequence_name(cls, index: int) -> str:
        return f"{SUBJECTS[index % len(SUBJECTS)]}_{index + 1}"

    def show(self, rng: np.random.Generator, index: int, seconds: float) -> Motion:
        tempo = SLOWEST_BPM + (FASTEST_BPM - SLOWEST_BPM) * index / (SEQUENCES - 1)
        return drill(rng, KINDS[index], (tempo - SPREAD_BPM, tempo + SPREAD_BPM), seconds, FPS)
