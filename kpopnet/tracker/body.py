"""The body that is fitted to the depth: round cones between the joints, and the distances that hold them together.

Beyond the paper, whose model is a skeleton without flesh. A depth image shows skin, a skeleton lies under it: with the
thickness of every part known, each measured point says how far the nearest part should move.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint
from kpopnet.tracker.model import LIMB_PARENTS, HumanModel

_RADII_M = {
    (Joint.NECK, Joint.HEAD): (0.046, 0.126),
    (Joint.NECK, Joint.TORSO): (0.183, 0.183),
    (Joint.RIGHT_SHOULDER, Joint.NECK): (0.087, 0.103),
    (Joint.TORSO, Joint.RIGHT_HIP): (0.148, 0.121),
    (Joint.RIGHT_SHOULDER, Joint.TORSO): (0.096, 0.241),
    (Joint.RIGHT_HIP, Joint.LEFT_HIP): (0.176, 0.176),
    (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW): (0.061, 0.061),
    (Joint.RIGHT_ELBOW, Joint.RIGHT_HAND): (0.031, 0.056),
    (Joint.RIGHT_HIP, Joint.RIGHT_KNEE): (0.163, 0.074),
    (Joint.RIGHT_KNEE, Joint.RIGHT_FOOT): (0.050, 0.060),
}
"""Thickness at both ends of each part, and of its mirror image: the least-squares fit of the parts to the visible
points of 8 simulated dancers (bodies drawn as for training) around their true joints; 1.5 cm is the mean residual."""

REFERENCE_SIZE_M = 2.07
"""`size_m` of the mean of those dancers; radii are scaled with it."""


def _both_sides() -> list[tuple[int, int, float, float]]:
    parts = []
    for (a, b), (radius_a, radius_b) in _RADII_M.items():
        parts.append((int(a), int(b), radius_a, radius_b))
        mirrored = int(MIRROR[a]), int(MIRROR[b])
        if set(mirrored) != {int(a), int(b)}:
            parts.append((*mirrored, radius_a, radius_b))
    return parts


PARTS = np.array([part[:2] for part in _both_sides()])
"""(P, 2) the joints at the two ends of each part."""

MIRRORED_PARTS = sorted(
    {tuple(sorted({k, *np.flatnonzero((MIRROR[part] == PARTS).all(1)).tolist()})) for k, part in enumerate(PARTS)}
)
"""The numbers of each part and its mirror image together."""

LIMBS = np.array(
    [
        (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW, Joint.RIGHT_HAND),
        (Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW, Joint.LEFT_HAND),
        (Joint.RIGHT_HIP, Joint.RIGHT_KNEE, Joint.RIGHT_FOOT),
        (Joint.LEFT_HIP, Joint.LEFT_KNEE, Joint.LEFT_FOOT),
    ]
)
"""(4, 3) root, middle and end of each limb."""

LIMB_PARTS = np.array(
    [[np.flatnonzero(((a, b) == PARTS).all(1))[0] for a, b in ((root, middle), (middle, end))] for root, middle, end in LIMBS]
)
"""(4, 2) the parts that make up each limb."""

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
    (Joint.RIGHT_KNEE, Joint.RIGHT_FOOT): 1.0,
}
"""How much of a wrong distance is put right at once: all of a bone's, little of what a bending spine changes."""

TORSO_JOINTS = (
    Joint.HEAD, Joint.NECK, Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.TORSO, Joint.RIGHT_HIP, Joint.LEFT_HIP,
)  # fmt: skip
MOBILITY = np.where(np.isin(np.arange(NUM_JOINTS), TORSO_JOINTS), 0.25, 1.0)
"""(15,) how readily a joint gives way: a limb follows the torso, and hardly pulls it along."""

NECK_SHARE = 0.39
"""Where the neck lies between the shoulders' middle and the head."""


class Body(NamedTuple):
    """One person's body as arrays for the kernels.

    Attributes:
        radii_m: (P, 2) of the parts.
        pairs: (C, 2) joints whose distance is kept.
        stiffness: (C,) in 0..1.
        lengths_m: (C,) the distances.
        limbs_m: (4, 2) lengths of upper and lower part of each limb.
    """

    radii_m: np.ndarray
    pairs: np.ndarray
    stiffness: np.ndarray
    lengths_m: np.ndarray
    limbs_m: np.ndarray


def body_of(model: HumanModel) -> Body:
    """The body of a person of these lengths."""
    figure = plane_figure(model)
    pairs: dict[tuple[int, int], float] = {}
    for (a, b), stiffness in _STIFFNESS.items():
        pairs[tuple(sorted((int(a), int(b))))] = stiffness
        pairs[tuple(sorted((int(MIRROR[a]), int(MIRROR[b]))))] = stiffness
    ends = np.array(list(pairs))
    limb = model.limb_m
    limbs_m = np.array([[limb[Joint(middle)], limb[Joint(end)]] for _, middle, end in LIMBS])
    radii = np.array([part[2:] for part in _both_sides()]) * (size_m(model) / REFERENCE_SIZE_M)
    lengths = np.linalg.norm(figure[ends[:, 0]] - figure[ends[:, 1]], axis=1)
    return Body(radii, ends, np.array(list(pairs.values())), lengths, limbs_m)


def size_m(model: HumanModel) -> float:
    """A person's size in one number: an arm, a leg and the head-shoulder-torso structure, left and right averaged."""
    limbs = sum(model.limb_m.values()) / 2
    sides = (model.left_shoulder_to_left_hip_m + model.right_shoulder_to_right_hip_m) / 2
    return limbs + sides + model.head_to_shoulder_line_m


def plane_figure(model: HumanModel) -> np.ndarray:
    """(15, 3) a person of these lengths spread out in the plane z = 0, facing the camera, y down, limbs straight down.

    The structure's lengths overdetermine the plane figure; what is left over is shared between left and right.
    """
    half = model.shoulder_to_shoulder_m / 2
    figure = np.zeros((NUM_JOINTS, 3))
    figure[Joint.RIGHT_SHOULDER, 0], figure[Joint.LEFT_SHOULDER, 0] = -half, half
    figure[Joint.HEAD, 1] = -model.head_to_shoulder_line_m
    figure[Joint.NECK] = NECK_SHARE * figure[Joint.HEAD]
    to_torso = (model.left_shoulder_to_torso_m + model.right_shoulder_to_torso_m) / 2
    figure[Joint.TORSO, 1] = np.sqrt(max(to_torso**2 - half**2, 0.0))
    same = (model.left_shoulder_to_left_hip_m + model.right_shoulder_to_right_hip_m) / 2
    crossed = (model.left_shoulder_to_right_hip_m + model.right_shoulder_to_left_hip_m) / 2
    # A hip at distance `same` from its own shoulder and `crossed` from the other one.
    out = (crossed**2 - same**2) / (4 * half) if half > 0 else 0.0
    down = np.sqrt(max(same**2 - (half - out) ** 2, 0.0))
    figure[Joint.RIGHT_HIP], figure[Joint.LEFT_HIP] = (-out, down, 0), (out, down, 0)
    limb = model.limb_m
    for child, parent in LIMB_PARENTS.items():
        figure[child] = figure[parent] + (0, limb[child], 0)
    return figure
