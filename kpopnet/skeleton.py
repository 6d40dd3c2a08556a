"""The skeleton of fifteen joints used throughout the project."""

from enum import IntEnum

import numpy as np


class Joint(IntEnum):
    """Fifteen joints in the order of ITOP (Haque et al. 2016). Right is the person's right."""

    HEAD = 0
    NECK = 1
    RIGHT_SHOULDER = 2
    LEFT_SHOULDER = 3
    RIGHT_ELBOW = 4
    LEFT_ELBOW = 5
    RIGHT_HAND = 6
    LEFT_HAND = 7
    TORSO = 8
    RIGHT_HIP = 9
    LEFT_HIP = 10
    RIGHT_KNEE = 11
    LEFT_KNEE = 12
    RIGHT_FOOT = 13
    LEFT_FOOT = 14


NUM_JOINTS = len(Joint)

JOINT_NAMES = tuple(joint.name.lower() for joint in Joint)

PAPER_JOINTS = tuple(joint for joint in Joint if joint != Joint.NECK)
"""The paper's fourteen joints (section 2.3): all except the neck, which only the dance feature of its reference [17] uses."""

BONES = (
    (Joint.NECK, Joint.HEAD),
    (Joint.TORSO, Joint.NECK),
    (Joint.NECK, Joint.RIGHT_SHOULDER),
    (Joint.NECK, Joint.LEFT_SHOULDER),
    (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW),
    (Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW),
    (Joint.RIGHT_ELBOW, Joint.RIGHT_HAND),
    (Joint.LEFT_ELBOW, Joint.LEFT_HAND),
    (Joint.TORSO, Joint.RIGHT_HIP),
    (Joint.TORSO, Joint.LEFT_HIP),
    (Joint.RIGHT_HIP, Joint.RIGHT_KNEE),
    (Joint.LEFT_HIP, Joint.LEFT_KNEE),
    (Joint.RIGHT_KNEE, Joint.RIGHT_FOOT),
    (Joint.LEFT_KNEE, Joint.LEFT_FOOT),
)
"""(parent, child) pairs of the skeleton, in an order with parents before their children."""

BONE_PARENTS, BONE_CHILDREN = np.array(BONES).T

JOINT_GROUPS = {
    "head": (Joint.HEAD,),
    "neck": (Joint.NECK,),
    "shoulders": (Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER),
    "elbows": (Joint.RIGHT_ELBOW, Joint.LEFT_ELBOW),
    "hands": (Joint.RIGHT_HAND, Joint.LEFT_HAND),
    "torso": (Joint.TORSO,),
    "hips": (Joint.RIGHT_HIP, Joint.LEFT_HIP),
    "knees": (Joint.RIGHT_KNEE, Joint.LEFT_KNEE),
    "feet": (Joint.RIGHT_FOOT, Joint.LEFT_FOOT),
}
"""Left and right joints grouped, as papers on pose estimation from depth report them."""


_OTHER_SIDE = {"RIGHT": "LEFT", "LEFT": "RIGHT"}

MIRROR = np.array([Joint["_".join(_OTHER_SIDE.get(word, word) for word in joint.name.split("_"))] for joint in Joint])
"""(15,) index of each joint's left-right counterpart: `joints[..., MIRROR, :]` swaps left and right."""


def bone_lengths(joints: np.ndarray) -> np.ndarray:
    """The (..., 14) lengths of the bones of (..., 15, 3) joints, in their unit; NaN where an end is missing."""
    return np.linalg.norm(joints[..., BONE_PARENTS, :] - joints[..., BONE_CHILDREN, :], axis=-1)
