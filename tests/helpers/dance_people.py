"""Joints of composed dances, without a body, and transformations of them."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.dance.online import OnlineScore, OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.skeleton import MIRROR, Joint
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import INDEX, Motion, forward_kinematics

FPS = 30.0
JOINT_POINTS = {
    Joint.HEAD: ("Head", "Head_end"), Joint.NECK: ("Neck",), Joint.TORSO: ("Spine",),
    Joint.RIGHT_SHOULDER: ("RightArm",), Joint.RIGHT_ELBOW: ("RightForeArm",), Joint.RIGHT_HAND: ("RightHand", "RightHand_end"),
    Joint.LEFT_SHOULDER: ("LeftArm",), Joint.LEFT_ELBOW: ("LeftForeArm",), Joint.LEFT_HAND: ("LeftHand", "LeftHand_end"),
    Joint.RIGHT_HIP: ("RightUpLeg",), Joint.RIGHT_KNEE: ("RightLeg",), Joint.RIGHT_FOOT: ("RightFoot",),
    Joint.LEFT_HIP: ("LeftUpLeg",), Joint.LEFT_KNEE: ("LeftLeg",), Joint.LEFT_FOOT: ("LeftFoot",),
}  # fmt: skip


@cache
def dance_joints_m(index: int, seconds: float = 12.0, fps: float = FPS) -> np.ndarray:
    """(T, 15, 3) joints of a dance in metres, facing a level camera at 3 m."""
    joints_m = joints_of(dance(index, 41, seconds, fps))
    joints_m.setflags(write=False)
    return joints_m


def joints_of(motion: Motion) -> np.ndarray:
    """(T, 15, 3) joints of a motion in metres, before a level camera at 3 m."""
    points_m, _ = forward_kinematics(motion.quats, motion.root_m)
    joints_m = np.stack([points_m[:, [INDEX[name] for name in JOINT_POINTS[joint]]].mean(axis=1) for joint in Joint], axis=1)
    return joints_m * [1, -1, -1] + [0, 1, 3]  # x left, y up, z to the camera becomes x right, y down, z away


def performed(joints_m: np.ndarray, delay_s: float = 0.0, fps: float = FPS) -> Performance:
    """A performance of (T, 15, 3) joints at a frame rate, delayed by a number of seconds."""
    return Performance(joints_m, np.arange(len(joints_m)) / fps + delay_s)


def followed(online: OnlineScorer, learner: Performance) -> OnlineScore | None:
    """Gives an online scorer every frame of a learner's dance; what it says at the last one."""
    for joints_m, time_s, confidence in zip(learner.joints_m, learner.times_s, learner.confidence, strict=True):
        latest = online.update(joints_m, float(time_s), confidence)
    return latest


def mirrored(joints_m: np.ndarray) -> np.ndarray:
    """The mirror image of (T, 15, 3) joints: left and right are swapped, also in the order of joints."""
    return joints_m[:, MIRROR] * [-1, 1, 1]


def noisy(joints_m: np.ndarray, deviation_m: float, seed: int = 0) -> np.ndarray:
    """(T, 15, 3) joints with noise that is correlated over about 0.1 s, with a standard deviation in metres over all axes."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=joints_m.shape)
    for frame in range(1, len(noise)):
        noise[frame] = 0.7 * noise[frame - 1] + np.sqrt(1 - 0.7**2) * noise[frame]
    return joints_m + deviation_m / np.sqrt(3) * noise


def turned(joints_m: np.ndarray, axis: np.ndarray, angle_rad: float | np.ndarray) -> np.ndarray:
    """(T, 15, 3) joints turned about an axis through the camera, or, with (T,) angles, through the torso of each frame."""
    centre_m = joints_m[:, [Joint.TORSO]] if np.ndim(angle_rad) else np.zeros(3)
    angles_rad = np.broadcast_to(angle_rad, len(joints_m))[:, None]
    matrices = Rotation.from_rotvec(angles_rad * np.asarray(axis, float) / np.linalg.norm(axis)).as_matrix()
    return centre_m + (joints_m - centre_m) @ matrices.swapaxes(1, 2)
