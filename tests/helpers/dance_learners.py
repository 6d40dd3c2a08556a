"""Learners with one fault each, made of a teacher's joints without the model of skill: what a dance teacher knows by sight.

Joints are (T, 15, 3) in metres in a level camera's frame: x right, y down, z away. Faults turn bones about the joint that they
begin at, so that the lengths of bones stay.
"""

from functools import cache
from itertools import pairwise

import numpy as np
from dance_people import FPS, joints_of
from real_data import REAL
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from kpopnet.skeleton import Joint
from synth.motion.recorded import open_clips
from synth.motion.splice import resampled

DOWN = np.array([0.0, 1.0, 0.0])
ARMS = {"left": (Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW, Joint.LEFT_HAND)} | {
    "right": (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW, Joint.RIGHT_HAND)
}
LEGS = {"left": (Joint.LEFT_HIP, Joint.LEFT_KNEE, Joint.LEFT_FOOT)} | {
    "right": (Joint.RIGHT_HIP, Joint.RIGHT_KNEE, Joint.RIGHT_FOOT)
}
UPPER = [Joint.HEAD, Joint.NECK, *ARMS["left"], *ARMS["right"]]
BONES = (
    (Joint.TORSO, Joint.NECK), (Joint.NECK, Joint.HEAD),
    *((Joint.TORSO, limb[0]) for limb in (*ARMS.values(), *LEGS.values())),
    *(pair for limb in (*ARMS.values(), *LEGS.values()) for pair in pairwise(limb)),
)  # fmt: skip
"""(beginning, end) of every bone; a bone stands after the one that ends where it begins."""

CLIPS = REAL.parent / "motion"


def unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def rotated(vectors, axes, angles_rad):
    """(T, 3) vectors turned about (T, 3) unit axes by (T,) angles."""
    return Rotation.from_rotvec(axes * angles_rad[:, None]).apply(np.array(vectors))


def turned_about(joints_m, centre, moved, axes, angles_rad):
    """Joints of which the `moved` ones turn about the joint `centre`, by (T,) angles about (T, 3) axes."""
    result = joints_m.copy()
    for joint in moved:
        result[:, joint] = joints_m[:, centre] + rotated(joints_m[:, joint] - joints_m[:, centre], axes, angles_rad)
    return result


def arm_lowered(joints_m, side, degrees):
    """An arm turned at the shoulder towards hanging; negative degrees raise it away from hanging. Never beyond hanging."""
    shoulder, elbow, hand = ARMS[side]
    upper = unit(joints_m[:, elbow] - joints_m[:, shoulder])
    left = np.arccos(np.clip(upper @ DOWN, -1, 1))
    angle = np.clip(np.radians(degrees), left - np.pi, left)
    return turned_about(joints_m, shoulder, (elbow, hand), unit(np.cross(upper, DOWN)), angle)


def arms_lowered(joints_m, degrees):
    return arm_lowered(arm_lowered(joints_m, "left", degrees), "right", degrees)


def elbow_bent(joints_m, side, degrees):
    """A forearm turned at the elbow towards the upper arm by at most 150 degrees of bend; negative degrees straighten it."""
    shoulder, elbow, hand = ARMS[side]
    upper, fore = unit(joints_m[:, elbow] - joints_m[:, shoulder]), unit(joints_m[:, hand] - joints_m[:, elbow])
    bend = np.arccos(np.clip((upper * fore).sum(axis=1), -1, 1))
    angle = np.clip(np.radians(degrees), -bend, np.maximum(np.radians(150) - bend, 0))
    axis = np.cross(upper, fore)
    axis = np.where(np.linalg.norm(axis, axis=1, keepdims=True) < 0.05, np.cross(upper, across(joints_m)), axis)
    return turned_about(joints_m, elbow, (hand,), unit(axis), angle)


def elbows_bent(joints_m, degrees):
    return elbow_bent(elbow_bent(joints_m, "left", degrees), "right", degrees)


def knee_moved(joints_m, side, degrees):
    """A leg turned forwards at the hip."""
    hip, knee, foot = LEGS[side]
    return turned_about(joints_m, hip, (knee, foot), -across(joints_m), np.full(len(joints_m), np.radians(degrees)))


def across(joints_m):
    """(T, 3) unit direction from the right shoulder to the left."""
    return unit(joints_m[:, Joint.LEFT_SHOULDER] - joints_m[:, Joint.RIGHT_SHOULDER])


def hunched(joints_m, degrees):
    """The upper body bent forwards above the middle of the torso."""
    return turned_about(joints_m, Joint.TORSO, UPPER, across(joints_m), np.full(len(joints_m), np.radians(degrees)))


def heading_rad(joints_m):
    """(T,) continuous heading of the hips about the vertical."""
    side = joints_m[:, Joint.LEFT_HIP] - joints_m[:, Joint.RIGHT_HIP]
    return np.unwrap(np.arctan2(side[:, 2], side[:, 0]))


def headed(joints_m, angles_rad):
    """Joints turned about the vertical through the torso by (T,) angles; positive adds to `heading_rad`."""
    return turned_about(joints_m, Joint.TORSO, list(Joint), np.broadcast_to(-DOWN, joints_m[:, 0].shape), angles_rad)


def never_turning(joints_m):
    heading = heading_rad(joints_m)
    return headed(joints_m, heading[0] - heading)


def smaller(joints_m, amplitude):
    """Every bone's direction between its mean over the dance (0) and the teacher's (1), relative to the hips' heading."""
    heading = heading_rad(joints_m)
    level_m = headed(joints_m, -heading)
    result = level_m.copy()
    for begin, end in BONES:
        bone_m = level_m[:, end] - level_m[:, begin]
        mean = unit(unit(bone_m).mean(axis=0))
        axis = np.cross(np.broadcast_to(mean, bone_m.shape), bone_m)
        angle = np.arccos(np.clip(unit(bone_m) @ mean, -1, 1))
        length = np.linalg.norm(bone_m, axis=1, keepdims=True)
        result[:, end] = result[:, begin] + length * rotated(np.broadcast_to(mean, bone_m.shape), unit(axis), amplitude * angle)
    return headed(result, heading)


def mean_pose(joints_m):
    """Standing in the mean pose of the dance."""
    pose = smaller(never_turning(joints_m), 0.0)[:1]
    return np.repeat(pose - pose[:, [Joint.TORSO]] + joints_m[:1, [Joint.TORSO]], len(joints_m), axis=0)


def standing(joints_m):
    return np.repeat(joints_m[:1], len(joints_m), axis=0)


def hanging(joints_m, limbs):
    """Limbs that hang, or stand, straight down."""
    result = joints_m.copy()
    for begin, middle, end in limbs:
        upper, lower = (
            np.linalg.norm(joints_m[:, b] - joints_m[:, a], axis=1)[:, None] for a, b in ((begin, middle), (middle, end))
        )
        result[:, middle] = result[:, begin] + upper * DOWN
        result[:, end] = result[:, middle] + lower * DOWN
    return result


def legs_only(joints_m):
    return hanging(joints_m, ARMS.values())


def arms_only(joints_m):
    return hanging(joints_m, LEGS.values())


def waving(joints_m, seed=0):
    """Standing, with arms that wave at random."""
    rng, result = np.random.default_rng(seed), hanging(standing(joints_m), (*ARMS.values(), *LEGS.values()))
    seconds = np.arange(len(joints_m))[:, None] / FPS
    for shoulder, elbow, hand in ARMS.values():
        for begin, end in ((shoulder, elbow), (elbow, hand)):
            waves = sum(np.sin(2 * np.pi * (rng.uniform(0.3, 1.2, 3) * seconds + rng.random(3))) for _ in range(2))
            length = np.linalg.norm(joints_m[:, end] - joints_m[:, begin], axis=1, keepdims=True)
            result[:, end] = result[:, begin] + length * unit(waves + np.array([0, 0.3, -0.3]))
    return result


def other_build(joints_m):
    """Longer arms, shorter legs, broader shoulders."""
    factors = {joint: 1.2 for limb in ARMS.values() for joint in limb[1:]} | {
        joint: 0.85 for limb in LEGS.values() for joint in limb[1:]
    }
    result = joints_m.copy()
    broader = 0.15 * (joints_m[:, Joint.LEFT_SHOULDER] - joints_m[:, Joint.RIGHT_SHOULDER]) / 2
    for begin, end in BONES:
        result[:, end] = result[:, begin] + factors.get(end, 1.0) * (joints_m[:, end] - joints_m[:, begin])
        result[:, end] += {Joint.LEFT_SHOULDER: broader, Joint.RIGHT_SHOULDER: -broader}.get(end, 0.0)
    return result


def held(joints_m, begin_s, end_s):
    """Standing still for some seconds."""
    result, first = joints_m.copy(), round(begin_s * FPS)
    result[first : round(end_s * FPS)] = joints_m[first]
    return result


def hidden(joints_m, begin_s, end_s, joints=None):
    """Some joints, by default all, not seen for some seconds."""
    result = joints_m.copy()
    result[round(begin_s * FPS) : round(end_s * FPS), slice(None) if joints is None else joints] = np.nan
    return result


@cache
def clip_joints_m(split: str, name: str, seconds: float = 20.0) -> np.ndarray:
    """(T, 15, 3) joints of the first seconds of a recorded dance at FPS, turned to face the camera at first."""
    clips = open_clips(CLIPS, split)
    motions = (clips.motion(number) for number in clips.clip_indices("dance"))
    motion = resampled(next(motion for motion in motions if motion.name == f"clip:{name}"), FPS)
    joints_m = joints_of(motion)[: round(seconds * FPS)]
    joints_m = headed(joints_m, np.full(len(joints_m), -heading_rad(joints_m)[0]))
    joints_m.setflags(write=False)
    return joints_m


def good(joints_m, seed, degrees=4.0, delay_s=0.03):
    """A good dancer: every bone wanders by `degrees` and the time by `delay_s` (standard deviations), over about 2 s."""
    rng, frames = np.random.default_rng(seed), len(joints_m)

    def wandering(*shape):
        noise = gaussian_filter1d(rng.normal(size=(frames, *shape)), FPS, axis=0, mode="wrap")
        return noise / noise.std()

    result = joints_m.copy()
    for begin, end in BONES:
        bone_m, turn = joints_m[:, end] - joints_m[:, begin], np.radians(degrees) / np.sqrt(2) * wandering(3)
        result[:, end] = result[:, begin] + Rotation.from_rotvec(turn).apply(bone_m)
    times = np.clip(np.arange(frames) - delay_s * FPS * wandering(), 0, frames - 1)
    before = np.minimum(times.astype(int), frames - 2)
    share = (times - before)[:, None, None]
    return (1 - share) * result[before] + share * result[before + 1]


def softened(joints_m, seconds):
    """Smoothed over a standard deviation of time, with movements as large as before: no accents."""
    smooth_m = gaussian_filter1d(joints_m, seconds * FPS, axis=0, mode="nearest")
    result = joints_m.copy()
    for begin, end in BONES:
        smooth, taught = (unit(one[:, end] - one[:, begin]) for one in (smooth_m, joints_m))
        mean, length = smooth.mean(axis=0), np.linalg.norm(joints_m[:, end] - joints_m[:, begin], axis=1, keepdims=True)
        size = np.sqrt(taught.var(axis=0).sum() / max(smooth.var(axis=0).sum(), 1e-12))
        result[:, end] = result[:, begin] + length * unit(mean + size * (smooth - mean))
    return result
