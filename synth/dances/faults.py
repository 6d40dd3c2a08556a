"""Learners without the model of skill: a second family of faults, one function for each, and the ends of the scale.

A fault is a function of a motion, a severity and a generator. Severity 0 leaves the motion as it is, 1 is a learner in the
middle, and the fault grows with it. A dance draws a profile, how much of each fault its learners have; the learner of the
better level has less of every one of them. So the order of the learners is known by construction, without a judgement of which
fault is worse.

To add a fault, write its function and enter it in `FAULTS`.

The ends of the scale are a learner who dances exactly as the teacher, and three who do not dance the dance at all. They tell
what a score means, through a sensor and an estimator too; the order of those who do not dance means nothing.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kpopnet.rotations import continuous, multiply, normalised, towards, turns
from synth.motion.posture import CHANNELS, STANDING, rotations
from synth.motion.skeleton import INDEX, LEG_M, NUM_JOINTS, PARENTS, Motion, on_floor_m
from synth.motion.splice import as_high_as, at_times

Fault = Callable[[Motion, float, np.random.Generator], Motion]

PROFILE_SPREAD = 0.35
PROFILE_RANGE = (0.5, 2.0)
"""Standard deviation of the logarithm of a fault's factor in a dance's profile, and the range of the factor."""

LOW_PASS_S, KEPT_AMPLITUDE, WARP_S, ANCHOR_S = 0.10, 0.80, 0.13, 2.0
REPLACED_PER_MINUTE, REPLACED_S, RAMP_S = 4.0, 1.6, 0.3
NOISE_DEG, NOISE_CORRELATION_S, LAG_S, HABIT_DEG = 6.0, 0.5, 0.09, 14.0
"""Sizes at severity 1: of a learner whom a teacher would send back to practise, before any scorer had been tried."""

HABITS = ("Spine1", "Head", "LeftArm", "RightArm", "LeftForeArm", "RightForeArm", "LeftUpLeg", "RightUpLeg")


def low_pass(motion: Motion, severity: float, rng: np.random.Generator) -> Motion:
    """Accents are washed out: every joint's rotation and the path are smoothed over time."""
    if severity == 0:
        return motion
    frames = LOW_PASS_S * severity * motion.fps
    quats = gaussian_filter1d(continuous(motion.quats), frames, axis=0, mode="nearest")
    return _changed(motion, quats, gaussian_filter1d(motion.root_m.astype(np.float64), frames, axis=0, mode="nearest"))


def amplitude(motion: Motion, severity: float, rng: np.random.Generator) -> Motion:
    """Movements are smaller: every joint but the hips is drawn to its mean rotation over the dance, the path to its middle."""
    kept = KEPT_AMPLITUDE**severity
    quats = continuous(motion.quats)
    quats[:, 1:] = quats[:, 1:].mean(axis=0) * (1 - kept) + quats[:, 1:] * kept
    root_m = motion.root_m.astype(np.float64)
    return _changed(motion, quats, root_m.mean(axis=0) * (1 - kept) + root_m * kept)


def time_warp(motion: Motion, severity: float, rng: np.random.Generator) -> Motion:
    """Now ahead of the music, now behind: by another time at each anchor, and between the anchors in proportion."""
    seconds = np.arange(len(motion)) / motion.fps
    anchors_s = np.arange(-1, seconds[-1] + 2 * ANCHOR_S, ANCHOR_S)
    offsets_s = WARP_S * severity * rng.standard_normal(len(anchors_s))
    return _at(motion, seconds + np.interp(seconds, anchors_s, offsets_s))


def replaced_moves(motion: Motion, severity: float, rng: np.random.Generator) -> Motion:
    """Some moves are others of the same dance; hips and path go on as they should. The time that they take grows evenly."""
    seconds = np.arange(len(motion)) / motion.fps
    quats = continuous(motion.quats)
    moves = REPLACED_PER_MINUTE * severity * seconds[-1] / 60
    length_s = REPLACED_S * moves / max(np.ceil(moves), 1)
    for _ in range(int(np.ceil(moves))):
        start_s, other_s = rng.uniform(0, max(seconds[-1] - length_s, 0.1), 2)
        other = at_times(motion, np.clip(seconds - start_s + other_s, 0, seconds[-1]), motion.fps).quats.astype(np.float64)
        weight = np.clip(np.minimum(seconds - start_s, start_s + length_s - seconds) / RAMP_S, 0, 1)[:, None, None]
        quats[:, 1:] = towards(quats, other, weight)[:, 1:]
    return _changed(motion, quats, motion.root_m)


def joint_noise(motion: Motion, severity: float, rng: np.random.Generator) -> Motion:
    """Joints wander about where they should be; an Ornstein-Uhlenbeck process, half of it common to a joint and its parent.

    The hips, which have none, wander by the square root of 2 more.
    """
    keep = np.exp(-1 / (NOISE_CORRELATION_S * motion.fps))
    wander = rng.standard_normal((len(motion), NUM_JOINTS, 3))
    wander[0] /= np.sqrt(1 - keep**2)
    for frame in range(1, len(wander)):
        wander[frame] += keep * wander[frame - 1]
    own = np.sqrt(1 - keep**2) * wander
    parents = np.maximum(PARENTS[:NUM_JOINTS], 0)
    return _turned(motion, np.radians(NOISE_DEG * severity) / np.sqrt(3) * (own + own[:, parents]) / np.sqrt(2))


def lag(motion: Motion, severity: float, rng: np.random.Generator) -> Motion:
    """Everything comes late."""
    return _at(motion, np.arange(len(motion)) / motion.fps - LAG_S * severity)


def habit(motion: Motion, severity: float, rng: np.random.Generator) -> Motion:
    """Two joints are always turned the same way, such as an elbow that hangs."""
    rotation = np.zeros((len(motion), NUM_JOINTS, 3))
    for joint in rng.choice(HABITS, 2, replace=False):
        axis = rng.standard_normal(3)
        rotation[:, INDEX[joint]] = np.radians(HABIT_DEG * severity) * axis / np.linalg.norm(axis)
    return _turned(motion, rotation)


FAULTS: dict[str, Fault] = {
    one.__name__: one for one in (time_warp, lag, replaced_moves, low_pass, amplitude, habit, joint_noise)
}
"""In the order in which they are put on a motion."""


def draw_profile(rng: np.random.Generator) -> dict[str, float]:
    """How much of each fault the learners of a dance have, about 1."""
    return {name: float(np.clip(np.exp(PROFILE_SPREAD * rng.standard_normal()), *PROFILE_RANGE)) for name in FAULTS}


def with_faults(teacher: Motion, severities: dict[str, float], rng: np.random.Generator) -> Motion:
    """The teacher's motion with faults of the named severities; feet may slide.

    It is as high above the floor as the teacher is when the learner is there: who is late jumps late.
    """
    motion = in_time = teacher
    for name, fault in FAULTS.items():
        motion = fault(motion, severities.get(name, 0.0), rng)
        if fault in (time_warp, lag):
            in_time = motion
    return _changed(motion, motion.quats, as_high_as(in_time, motion.quats, motion.root_m))


def _at(motion: Motion, source_s: np.ndarray) -> Motion:
    """What the motion shows at other times, which never run backwards."""
    last_s = (len(motion) - 1) / motion.fps
    return at_times(motion, np.maximum.accumulate(np.clip(source_s, 0, last_s)), motion.fps)


def _turned(motion: Motion, rotation_rad: np.ndarray) -> Motion:
    """The motion with each joint turned by a (T, 23, 3) rotation vector in its own frame."""
    return _changed(motion, multiply(motion.quats.astype(np.float64), turns(rotation_rad)), motion.root_m)


def _changed(motion: Motion, quats: np.ndarray, root_m: np.ndarray) -> Motion:
    """The motion with other (T, 23, 4) rotations, which are normalised, and another (T, 3) path."""
    return replace(motion, quats=normalised(quats).astype(np.float32), root_m=np.asarray(root_m, np.float32))


# --- The ends of the scale --------------------------------------------------------------------------------------------------

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
    """The motion of a person who stays in place in (T, C) postures, with the frame rate of another motion."""
    quats = rotations(postures)
    return Motion(quats, on_floor_m(quats), like.fps, name, LEG_M)
