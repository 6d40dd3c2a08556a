"""Dances and the body of the virtual teacher (`kpopnet teach`): the embedded choreography, performed by one body.

Dance i is a pure function of i. They are other dances than those of the benchmarks.
"""

from dataclasses import dataclass

import numpy as np

from kpopnet.camera import CAMERAS
from synth.body.teacher import teacher_person
from synth.dances.simulate import is_danceable
from synth.motion.choreography.composer import dance, tempo_bpm
from synth.motion.skeleton import Motion
from synth.simulated.film import Studio

DANCES = 100
FPS = 30.0
SEED = 20181  # first seed of the collection; a dance that leaves the stage is replaced by that of the next seed
SECONDS = (20.0, 36.0)
CURLS_RAD = np.array([0.3, 0.3])

_KINDS = ("Neon", "Midnight", "Sugar", "Silver", "Electric", "Velvet", "Summer", "Paper", "Golden", "Cosmic")
_NOUNS = ("Step", "Parade", "Heart", "Rush", "Signal", "Mirror", "Wave", "Crown", "Drive", "Garden")


@dataclass(frozen=True, eq=False)
class PlayedDance:
    name: str
    bpm: float  # beats per minute; the first beat is at time 0
    fps: float
    joints_m: np.ndarray  # (T, 15, 3) float32 metres, in the frame of a level camera that the teacher faces
    quats: np.ndarray  # (T, B, 4) rotations of the bones relative to their parents and the T-pose
    hips_m: np.ndarray  # (T, 3) position of the hips in the world, metres, the floor at z = 0


def dance_title(index: int) -> str:
    """The title of dance `index`; no two of the first hundred are equal."""
    return f"{_KINDS[index % len(_KINDS)]} {_NOUNS[(index // len(_KINDS) + index) % len(_NOUNS)]}"


def composed(index: int) -> tuple[Motion, float]:
    """The motion of dance `index` and its beats per minute: whole phrases, that fit in front of a camera (`is_danceable`)."""
    seed = SEED
    while True:
        bpm = tempo_bpm(index, seed)
        phrase_s = 8 * 60 / bpm
        phrases = np.random.default_rng([SEED, index]).integers(*np.ceil(np.array(SECONDS) / phrase_s))
        motion = dance(index, seed, float(phrases * phrase_s), FPS)
        if is_danceable(motion):
            return motion, bpm
        seed += 1


class Teacher:
    """Plays dances on the teacher's body; holds one compiled scene."""

    def __init__(self) -> None:
        self._studio, self._person = Studio(CAMERAS["kinect_v1"], "cpu"), teacher_person()

    def dance(self, index: int) -> PlayedDance:
        motion, bpm = composed(index)
        played = self._studio.play(self._person, motion, 0.0, CURLS_RAD)
        return PlayedDance(dance_title(index), bpm, FPS, self._studio.level_joints_m(played), played.local, played.hips_m)
