"""The initial human model (section 2.3) as arrays for the kernels of Algorithm 2."""

from typing import NamedTuple

import numpy as np

from kpopnet.geometry.body import PARTS, RIGHT_RIBS, body_from_model
from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel
from kpopnet.skeleton import NUM_JOINTS, Joint

HEAD, TORSO = int(Joint.HEAD), int(Joint.TORSO)
RIGHT_SHOULDER, LEFT_SHOULDER = int(Joint.RIGHT_SHOULDER), int(Joint.LEFT_SHOULDER)
RIGHT_HIP, LEFT_HIP = int(Joint.RIGHT_HIP), int(Joint.LEFT_HIP)

TRUNK = (HEAD, RIGHT_SHOULDER, LEFT_SHOULDER, TORSO, RIGHT_HIP, LEFT_HIP)
"""The joints of the head-shoulder-torso structure, and the hips."""


class Structure(NamedTuple):
    """The lengths of one person.

    Attributes:
        distance_m: (15, 15) the model's distance between two joints in metres, 0 where it has none.
        head_to_shoulder_line_m: l_H⊥S.
        torso_to_hip_line_m: l_T⊥P.
        depth_m: (15,) how deep each joint lies under the surface along the viewing ray, metres.
    """

    distance_m: np.ndarray
    head_to_shoulder_line_m: float
    torso_to_hip_line_m: float
    depth_m: np.ndarray


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
    }
    for (a, b), length_m in lengths.items():
        distance_m[a, b] = distance_m[b, a] = length_m
    return Structure(
        distance_m,
        model.head_to_shoulder_line_m,
        model.torso_to_hip_line_m,
        joint_depth_m(body_from_model(model).radii_m),
    )


def joint_depth_m(radii_m: np.ndarray) -> np.ndarray:
    """(15,) the smallest radius of the parts that end at each joint, the ribs' for the torso, from (P, 2) radii in metres."""
    depth_m = np.full(NUM_JOINTS, np.inf)
    for ends, radii in zip(PARTS, radii_m, strict=True):
        for row, radius in zip(ends, radii, strict=True):
            joint = TORSO if row == RIGHT_RIBS else row
            if joint < NUM_JOINTS:
                depth_m[joint] = min(depth_m[joint], radius)
    return depth_m
