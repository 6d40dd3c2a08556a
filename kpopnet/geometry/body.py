"""The body that is fitted to the depth: round cones around the joints, and the distances between joints.

Beyond the paper, whose model is a skeleton without thickness. A depth image measures the skin, the skeleton lies below it.
With known thickness of every part, each measured point gives the displacement of its nearest part. The surface is that of
the union of all parts, so the parts must overlap little: limb cones lie around lines between joints, trunk cones around
lines between trunk points of their own.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel
from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint

RIGHT_TOES, LEFT_TOES, RIGHT_FINGERS, LEFT_FINGERS = range(NUM_JOINTS, NUM_JOINTS + 4)
RIGHT_CHEST, LEFT_CHEST, RIGHT_RIBS, LEFT_RIBS, RIGHT_PELVIS, LEFT_PELVIS = range(NUM_JOINTS + 4, NUM_JOINTS + 10)
"""Rows after the joints, derived from them by `kpopnet.geometry.cones.extend_joints`: toes, fingers and trunk points."""

TRUNK_OFFSETS_M = {
    RIGHT_CHEST: (Joint.RIGHT_SHOULDER, (-0.057, 0.046, -0.044)),
    RIGHT_RIBS: (Joint.TORSO, (0.047, -0.127, 0.012)),
    RIGHT_PELVIS: (Joint.RIGHT_HIP, (-0.068, -0.001, 0.030)),
}
"""The joint that each trunk point moves with, and its offset from that in metres: to the torso's right, down and front."""

RADII_M = {
    (Joint.NECK, Joint.HEAD): (0.043, 0.111),
    (Joint.RIGHT_SHOULDER, Joint.NECK): (0.015, 0.025),
    (Joint.NECK, RIGHT_CHEST): (0.067, 0.085),
    (Joint.RIGHT_SHOULDER, RIGHT_CHEST): (0.034, 0.017),
    (RIGHT_CHEST, RIGHT_RIBS): (0.082, 0.119),
    (RIGHT_RIBS, RIGHT_PELVIS): (0.139, 0.137),
    (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW): (0.074, 0.057),
    (Joint.RIGHT_ELBOW, Joint.RIGHT_HAND): (0.058, 0.038),
    (Joint.RIGHT_HAND, RIGHT_FINGERS): (0.040, 0.046),
    (Joint.RIGHT_HIP, Joint.RIGHT_KNEE): (0.119, 0.085),
    (Joint.RIGHT_KNEE, Joint.RIGHT_FOOT): (0.069, 0.068),
    (Joint.RIGHT_FOOT, RIGHT_TOES): (0.078, 0.046),
}
"""Radii in metres at both ends of each part. `tools/body_shape.py` fitted these and the trunk points to the
true joints of 300 simulated people (split train), dressed but without bags, in five poses each; its docstring has the commands.
The left parts mirror the right ones."""

_MIRROR = np.array([*MIRROR, *(NUM_JOINTS + ((row - NUM_JOINTS) ^ 1) for row in range(NUM_JOINTS, LEFT_PELVIS + 1))])

TRUNK_POINT_JOINTS = np.array([[joint, MIRROR[joint]] for joint, _ in TRUNK_OFFSETS_M.values()]).ravel()
"""(6,) the joint that each trunk point moves with, right before left."""

ROW_TO_JOINT = np.array(
    [*range(NUM_JOINTS), Joint.RIGHT_FOOT, Joint.LEFT_FOOT, Joint.RIGHT_HAND, Joint.LEFT_HAND, *TRUNK_POINT_JOINTS]
)
"""(25,) the joint that each row moves with."""

REFERENCE_SIZE_M = 2.09
"""`size_m` of the person with the radii and trunk offsets above. Those of other people scale with their `size_m`."""


_MIRRORED_PARTS = [
    (*rows, kind) for kind, part in enumerate(RADII_M) for rows in dict.fromkeys((part, tuple(_MIRROR[list(part)].tolist())))
]
PARTS = np.array([ends for *ends, _ in _MIRRORED_PARTS])
PART_KIND = np.array([kind for *_, kind in _MIRRORED_PARTS])
"""`PARTS`: (P, 2) the rows at both ends of each part. `PART_KIND`: (P,) its index in RADII_M, that of its mirror image too."""

LIMBS = np.array(
    [
        (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW, Joint.RIGHT_HAND),
        (Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW, Joint.LEFT_HAND),
        (Joint.RIGHT_HIP, Joint.RIGHT_KNEE, Joint.RIGHT_FOOT),
        (Joint.LEFT_HIP, Joint.LEFT_KNEE, Joint.LEFT_FOOT),
    ]
)
"""(4, 3) root, middle and end joint of each limb: right arm, left arm, right leg, left leg."""

LIMB_PARTS = np.array(
    [
        [np.flatnonzero((pair == PARTS).all(1))[0] for pair in ((root, middle), (middle, end), (end, beyond))]
        for (root, middle, end), beyond in zip(LIMBS, (RIGHT_FINGERS, LEFT_FINGERS, RIGHT_TOES, LEFT_TOES), strict=True)
    ]
)
"""(4, 3) the parts of each limb: upper, lower, and hand or foot."""

_TRUNK = [k for k in range(len(PARTS)) if k not in LIMB_PARTS]
COLLISION_PAIRS = np.array(
    [
        (own, k)
        for limb, (root, middle, _) in enumerate(LIMBS)
        for own in [LIMB_PARTS[limb, 1]]
        for k in [*_TRUNK, *(LIMB_PARTS[5 - limb, :2] if limb >= 2 else ())]
        if root not in PARTS[k]
    ]
)
"""(B, 2) the lower part of a limb, and a part that it must not penetrate: head and trunk, and for a leg the other leg."""

LIMB_COLLISIONS = np.array([np.flatnonzero(COLLISION_PAIRS[:, 0] == lower)[[0, -1]] + (0, 1) for lower in LIMB_PARTS[:, 1]])
"""(4, 2) first (inclusive) and last (exclusive) index of each limb's rows in COLLISION_PAIRS."""

_STIFFNESS = {
    (Joint.NECK, Joint.HEAD): 0.8,
    (Joint.NECK, Joint.RIGHT_SHOULDER): 0.8,
    (Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER): 0.5,
    (Joint.NECK, Joint.TORSO): 0.5,
    (Joint.RIGHT_SHOULDER, Joint.TORSO): 0.4,
    (Joint.HEAD, Joint.TORSO): 0.2,
    (Joint.TORSO, Joint.RIGHT_HIP): 0.7,
    (Joint.RIGHT_HIP, Joint.LEFT_HIP): 1.0,
    (Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP): 0.1,
    (Joint.RIGHT_SHOULDER, Joint.LEFT_HIP): 0.1,
    (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW): 1.0,
    (Joint.RIGHT_ELBOW, Joint.RIGHT_HAND): 1.0,
    (Joint.RIGHT_HIP, Joint.RIGHT_KNEE): 1.0,
    (Joint.RIGHT_KNEE, Joint.RIGHT_FOOT): 0.3,
}
"""Relative weight of a length error, 0..1: 1 for bones, low where the spine bends. Set by hand, not fitted."""

_ELEVATION_COEFFICIENTS = {
    (Joint.NECK, Joint.RIGHT_SHOULDER): (-0.026, -0.010),
    (Joint.RIGHT_SHOULDER, Joint.TORSO): (0.049, 0.014),
    (Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP): (0.070, 0.033),
    (Joint.RIGHT_SHOULDER, Joint.LEFT_HIP): (0.051, 0.022),
}
"""Shoulders rise with the arms. These distances, and their mirror images, change by a linear and a quadratic coefficient of
the cosine between upper arm and up direction, in fractions of the distance from the hips to the neck. Least squares over 8
simulated dancers."""


def neck_fraction(arms_raised: float) -> float:
    """Position of the neck from the middle of the shoulders (0) to the head (1), by the same cosine; same dancers."""
    return 0.347 - 0.146 * arms_raised - 0.095 * arms_raised**2


NECK_FRACTION = neck_fraction(-1.0)
"""`neck_fraction` with hanging arms."""


class Body(NamedTuple):
    """One person's body as arrays for the numba kernels."""

    radii_m: np.ndarray  # (P, 2) radii at both ends of the parts, metres
    pairs: np.ndarray  # (C, 2) joints with a constrained distance
    stiffness: np.ndarray  # (C,) relative weight of each distance, 0..1
    lengths_m: np.ndarray  # (C,) the distances with horizontal upper arms, metres
    elevating_arm: np.ndarray  # (C,) the arm, 0 right or 1 left, whose elevation changes the distance, or -1
    # (C, 2) linear and quadratic change of the distance in metres, by the cosine between upper arm and up
    elevation_gain_m: np.ndarray
    limbs_m: np.ndarray  # (4, 2) lengths of the upper and lower part of each limb, metres
    # (6, 3) offset of each trunk point from its joint in metres: to the torso's right, down and front
    trunk_offsets_m: np.ndarray


def body_from_model(model: HumanModel) -> Body:
    """The body of a person with these lengths."""
    pose = planar_pose(model)
    height_m = np.linalg.norm(pose[Joint.NECK] - (pose[Joint.RIGHT_HIP] + pose[Joint.LEFT_HIP]) / 2)
    pairs: dict[tuple[int, int], tuple] = {}  # ends to stiffness, elevating arm, elevation coefficients
    for ends, stiffness in _STIFFNESS.items():
        for side, (a, b) in enumerate((ends, MIRROR[list(ends)])):
            arm, coefficients = (side, _ELEVATION_COEFFICIENTS[ends]) if ends in _ELEVATION_COEFFICIENTS else (-1, (0.0, 0.0))
            pairs[min(a, b), max(a, b)] = stiffness, arm, coefficients
    ends, (stiffness, arms, coefficients) = np.array(list(pairs), int), map(np.array, zip(*pairs.values(), strict=True))
    elevation_gain_m = coefficients * height_m
    lengths = np.linalg.norm(pose[ends[:, 0]] - pose[ends[:, 1]], axis=1)
    lengths -= elevation_gain_m @ (model.arms_raised, model.arms_raised**2)
    limbs_m = np.array([[model.limb_m[Joint(joint)] for joint in limb] for limb in LIMBS[:, 1:]])
    scale = size_m(model) / REFERENCE_SIZE_M
    radii = np.array(list(RADII_M.values()))[PART_KIND] * scale
    offsets = [np.multiply(offset, (sign, 1, 1)) for _, offset in TRUNK_OFFSETS_M.values() for sign in (1, -1)]
    return Body(radii, ends, stiffness, lengths, arms, elevation_gain_m, limbs_m, np.array(offsets) * scale)


def size_m(model: HumanModel) -> float:
    """Size of a person in metres: arm, leg and head-shoulder-torso structure added up, left and right averaged."""
    limbs = sum(model.limb_m.values()) / 2
    sides = (model.left_shoulder_to_left_hip_m + model.right_shoulder_to_right_hip_m) / 2
    return limbs + sides + model.head_to_shoulder_line_m


def planar_pose(model: HumanModel) -> np.ndarray:
    """(15, 3) metres: a person with these lengths in the plane z = 0, facing the camera, y down, limbs straight down.

    The structure's lengths overdetermine a planar pose; the residual is distributed equally to left and right.
    """
    half_width = model.shoulder_to_shoulder_m / 2
    pose = np.zeros((NUM_JOINTS, 3))
    pose[Joint.RIGHT_SHOULDER, 0], pose[Joint.LEFT_SHOULDER, 0] = -half_width, half_width
    pose[Joint.HEAD, 1] = -model.head_to_shoulder_line_m
    pose[Joint.NECK] = neck_fraction(model.arms_raised) * pose[Joint.HEAD]
    to_torso = (model.left_shoulder_to_torso_m + model.right_shoulder_to_torso_m) / 2
    pose[Joint.TORSO, 1] = np.sqrt(max(to_torso**2 - half_width**2, 0.0))
    same_side = (model.left_shoulder_to_left_hip_m + model.right_shoulder_to_right_hip_m) / 2
    cross_side = (model.left_shoulder_to_right_hip_m + model.right_shoulder_to_left_hip_m) / 2
    # A hip lies at `same_side` from the shoulder of its own side and at `cross_side` from the other shoulder.
    lateral = (cross_side**2 - same_side**2) / (4 * half_width) if half_width > 0 else 0.0
    down = np.sqrt(max(same_side**2 - (half_width - lateral) ** 2, 0.0))
    pose[Joint.RIGHT_HIP], pose[Joint.LEFT_HIP] = (-lateral, down, 0), (lateral, down, 0)
    limb = model.limb_m
    for child, parent in LIMB_PARENTS.items():
        pose[child] = pose[parent] + (0, limb[child], 0)
    return pose
