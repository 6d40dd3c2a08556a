"""The initial human model (section 2.3) as arrays for the kernels of Algorithm 2."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.geometry.body import PARTS, RIGHT_RIBS, body_from_model
from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel
from kpopnet.skeleton import NUM_JOINTS, Joint

HEAD, TORSO = int(Joint.HEAD), int(Joint.TORSO)
RIGHT_SHOULDER, LEFT_SHOULDER = int(Joint.RIGHT_SHOULDER), int(Joint.LEFT_SHOULDER)
RIGHT_HIP, LEFT_HIP = int(Joint.RIGHT_HIP), int(Joint.LEFT_HIP)

TRUNK = (HEAD, RIGHT_SHOULDER, LEFT_SHOULDER, TORSO, RIGHT_HIP, LEFT_HIP)
"""The joints of the head-shoulder-torso structure, and the hips."""

UPPER_ARMS = np.array([[Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW], [Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW]])
"""(2, 2) shoulder and elbow, right arm before left."""


class Structure(NamedTuple):
    """The lengths of one person.

    Attributes:
        distance_m: (15, 15) the model's distance between two joints in metres, 0 where it has none.
        head_to_shoulder_line_m: l_H⊥S.
        torso_to_hip_line_m: l_T⊥P.
        depth_m: (15,) how deep each joint lies under the surface along the viewing ray, metres.
        arms_raised: cosine between upper arms and up in the pose in which the lengths were measured.
        rising: (C, 2) pairs of joints whose distance changes as an arm is raised.
        rising_arm: (C,) that arm, 0 right or 1 left.
        rise_m: (C, 2) linear and quadratic change of the distance by that arm's cosine, metres.
    """

    distance_m: np.ndarray
    head_to_shoulder_line_m: float
    torso_to_hip_line_m: float
    depth_m: np.ndarray
    arms_raised: float
    rising: np.ndarray
    rising_arm: np.ndarray
    rise_m: np.ndarray


def structure_of(model: HumanModel) -> Structure:
    """The structure of a person with these lengths; its joints lie as deep as an average body of that size is thick."""
    distance_m = np.zeros((NUM_JOINTS, NUM_JOINTS))
    lengths = {(int(joint), int(LIMB_PARENTS[joint])): length_m for joint, length_m in model.limb_m.items()} | {
        (HEAD, TORSO): model.head_to_torso_m,
        (RIGHT_SHOULDER, LEFT_SHOULDER): model.shoulder_to_shoulder_m,
        (RIGHT_SHOULDER, TORSO): model.right_shoulder_to_torso_m,
        (LEFT_SHOULDER, TORSO): model.left_shoulder_to_torso_m,
        (RIGHT_SHOULDER, RIGHT_HIP): model.right_shoulder_to_right_hip_m,
        (RIGHT_SHOULDER, LEFT_HIP): model.right_shoulder_to_left_hip_m,
        (LEFT_SHOULDER, RIGHT_HIP): model.left_shoulder_to_right_hip_m,
        (LEFT_SHOULDER, LEFT_HIP): model.left_shoulder_to_left_hip_m,
        (HEAD, RIGHT_SHOULDER): _opposite_side(
            model.head_to_torso_m, model.right_shoulder_to_torso_m, model.right_shoulder_angle_rad
        ),
        (HEAD, LEFT_SHOULDER): _opposite_side(
            model.head_to_torso_m, model.left_shoulder_to_torso_m, model.left_shoulder_angle_rad
        ),
    }
    for (a, b), length_m in lengths.items():
        distance_m[a, b] = distance_m[b, a] = length_m
    body = body_from_model(model)
    rises = body.elevating_arm >= 0
    return Structure(
        distance_m,
        model.head_to_shoulder_line_m,
        model.torso_to_hip_line_m,
        joint_depth_m(body.radii_m),
        model.arms_raised,
        body.pairs[rises],
        body.elevating_arm[rises],
        body.elevation_gain_m[rises],
    )


def _opposite_side(a_m: float, b_m: float, angle_rad: float) -> float:
    """The third side of a triangle, opposite to the angle between two sides: what the model's two angles are good for."""
    return math.sqrt(a_m**2 + b_m**2 - 2 * a_m * b_m * math.cos(angle_rad))


def joint_depth_m(radii_m: np.ndarray) -> np.ndarray:
    """(15,) the smallest radius of the parts that end at each joint, the ribs' for the torso, from (P, 2) radii in metres."""
    depth_m = np.full(NUM_JOINTS, np.inf)
    for ends, radii in zip(PARTS, radii_m, strict=True):
        for row, radius in zip(ends, radii, strict=True):
            joint = TORSO if row == RIGHT_RIBS else row
            if joint < NUM_JOINTS:
                depth_m[joint] = min(depth_m[joint], radius)
    return depth_m


@njit(cache=True)
def with_arms_as_in(structure, joints):
    """The structure with its shoulders as high as the arms of (15, 3) joints are raised.

    The distances of the shoulders to torso and hips change as those of simulated dancers (kpopnet.geometry.body); what the line
    of the shoulders goes up it comes nearer to the head.
    """
    up = joints[RIGHT_SHOULDER] + joints[LEFT_SHOULDER] - joints[RIGHT_HIP] - joints[LEFT_HIP]
    distance_m, rise = structure.distance_m.copy(), np.zeros(2)
    for c in range(len(structure.rising)):
        shoulder, elbow = UPPER_ARMS[structure.rising_arm[c]]
        arm = joints[elbow] - joints[shoulder]
        cosine = (arm @ up) / math.sqrt((arm @ arm) * (up @ up) + 1e-12)
        change = structure.rise_m[c, 0] * (cosine - structure.arms_raised)
        change += structure.rise_m[c, 1] * (cosine**2 - structure.arms_raised**2)
        a, b = structure.rising[c]
        if distance_m[a, b] > 0:
            distance_m[a, b] += change
            distance_m[b, a] += change
        if TORSO in (a, b):
            rise[structure.rising_arm[c]] = change
    line_m = structure.head_to_shoulder_line_m
    for shoulder in (RIGHT_SHOULDER, LEFT_SHOULDER):
        nearer_m = line_m - rise[shoulder - RIGHT_SHOULDER]
        squared = distance_m[HEAD, shoulder] ** 2 - line_m**2 + nearer_m**2
        distance_m[HEAD, shoulder] = distance_m[shoulder, HEAD] = math.sqrt(max(squared, 0.0))
    return Structure(
        distance_m,
        line_m - rise.mean(),
        structure.torso_to_hip_line_m,
        structure.depth_m,
        structure.arms_raised,
        structure.rising,
        structure.rising_arm,
        structure.rise_m,
    )
