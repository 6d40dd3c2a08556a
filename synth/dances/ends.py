"""The ends of the scale: a learner who dances exactly as the teacher, and three who do not dance the dance at all.

They tell what a score means, through a sensor and an estimator too; the order of those who do not dance means nothing.
"""

import numpy as np

from synth.motion.posture import CHANNELS, STANDING, rotations
from synth.motion.skeleton import Motion, on_floor_m
from synth.motion.splice import at_times

ENDS = ("perfect", "another dance", "waving", "standing still")

WAVED_DEG = {"raise": (15.0, 140.0), "plane": (-20.0, 90.0), "twist": (-40.0, 60.0), "elbow": (5.0, 110.0)}
WAVES, WAVE_HZ = 2, (0.3, 1.2)
"""Range of each angle of a waving arm, and the number and frequencies of the sine waves that it is the sum of."""


def end_motion(end: str, teacher: Motion, other: Motion, rng: np.random.Generator) -> Motion:
    """The motion of one of ENDS, as long as the teacher's; `other` is another dance, held at its end if it is shorter."""
    if end == "perfect":
        return teacher
    seconds = np.arange(len(teacher)) / teacher.fps
    if end == "another dance":
        return at_times(other, np.minimum(seconds, (len(other) - 1) / other.fps), teacher.fps)
    postures = np.repeat(STANDING[None], len(seconds), axis=0)
    if end == "waving":
        for side in ("left", "right"):
            for angle, (lowest, highest) in WAVED_DEG.items():
                hz, phase = rng.uniform(*WAVE_HZ, WAVES), rng.random(WAVES)
                wave = np.sin(2 * np.pi * (seconds[:, None] * hz + phase)).mean(axis=1)
                postures[:, CHANNELS[f"{side}_{angle}"]] = lowest + (highest - lowest) * (wave + 1) / 2
    return on_the_floor(postures, teacher, end)


def on_the_floor(postures: np.ndarray, like: Motion, name: str) -> Motion:
    """The motion of a person who stays in place in (T, C) postures, with the frame rate and the legs of another motion."""
    quats = rotations(postures)
    return Motion(quats, on_floor_m(quats), like.fps, name, like.leg_m)
