"""`eval_sim`, the stand-in for EVAL: simulated sequences of the motions that the paper names.

24 sequences of 288 to 488 frames at 30 fps, each of another person. Every eight sequences show two dances, crossed punches,
kicks, turns, sitting on the floor, a handstand, and a mixture of all. The rooms are furnished; the sensor is a Kinect v1. Each
sequence starts in the paper's Y pose.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from kpopnet.camera import CAMERAS
from synth.motion.choreography.programmes import show
from synth.motion.skeleton import Motion
from synth.scene.room import ViewConfig
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated.sequences import Selection, StandIn


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
