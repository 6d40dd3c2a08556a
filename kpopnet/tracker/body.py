"""The body that is fitted to the depth: round cones around the joints, and the distances that hold these together.

Beyond the paper, whose model is a skeleton without flesh. A depth image shows skin, a skeleton lies under it: with the
thickness of every part known, each measured point says how far the part should move that it is nearest to. What counts is
the surface of all parts together, so that they must not overlap by much: limbs lie around lines between joints, the trunk
around lines between places of its own.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint
from kpopnet.tracker.model import LIMB_PARENTS, HumanModel

RIGHT_TOES, LEFT_TOES, RIGHT_FINGERS, LEFT_FINGERS = range(NUM_JOINTS, NUM_JOINTS + 4)
RIGHT_CHEST, LEFT_CHEST, RIGHT_RIBS, LEFT_RIBS, RIGHT_PELVIS, LEFT_PELVIS = range(NUM_JOINTS + 4, NUM_JOINTS + 10)
"""Rows after the joints, which kpopnet.tracker.cones.extend derives from them: the far ends of feet and hands, and places in
the trunk."""

PLACES_M = {
    RIGHT_CHEST: (Joint.RIGHT_SHOULDER, (-0.052, 0.035, -0.042)),
    RIGHT_RIBS: (Joint.TORSO, (0.049, -0.145, 0.016)),
    RIGHT_PELVIS: (Joint.RIGHT_HIP, (-0.080, -0.001, 0.030)),
}
"""The joint that a place in the trunk moves with, and the way there: to the torso's right, down and front."""

RADII_M = {
    (Joint.NECK, Joint.HEAD): (0.056, 0.108),
    (Joint.RIGHT_SHOULDER, Joint.NECK): (0.036, 0.034),
    (Joint.NECK, RIGHT_CHEST): (0.066, 0.077),
    (Joint.RIGHT_SHOULDER, RIGHT_CHEST): (0.048, 0.015),
    (RIGHT_CHEST, RIGHT_RIBS): (0.074, 0.107),
    (RIGHT_RIBS, RIGHT_PELVIS): (0.128, 0.120),
    (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW): (0.066, 0.045),
    (Joint.RIGHT_ELBOW, Joint.RIGHT_HAND): (0.044, 0.030),
    (Joint.RIGHT_HAND, RIGHT_FINGERS): (0.036, 0.060),
    (Joint.RIGHT_HIP, Joint.RIGHT_KNEE): (0.113, 0.077),
    (Joint.RIGHT_KNEE, Joint.RIGHT_FOOT): (0.064, 0.053),
    (Joint.RIGHT_FOOT, RIGHT_TOES): (0.068, 0.035),
}
"""Thickness at both ends of each part. These and the places are what `python -m kpopnet.tracker.flesh data/small/train` found
around the true joints of 300 simulated people in five poses each; left ones mirror the right ones."""

_MIRROR = np.array([*MIRROR, *(row + 1 - 2 * ((row - NUM_JOINTS) % 2) for row in range(NUM_JOINTS, LEFT_PELVIS + 1))])

PLACE_JOINTS = np.array([[joint, MIRROR[joint]] for joint, _ in PLACES_M.values()]).ravel()
"""(6,) the joint that each place moves with, right before left."""

OWNERS = np.array(
    [*range(NUM_JOINTS), Joint.RIGHT_FOOT, Joint.LEFT_FOOT, Joint.RIGHT_HAND, Joint.LEFT_HAND, *PLACE_JOINTS]
)
"""(25,) the joint that each row moves with."""

REFERENCE_SIZE_M = 2.07
"""`size_m` of the person that these are of; another's are larger or smaller as they are."""


def _both_sides() -> list[tuple[int, int, int]]:
    """Both ends of every part and which of RADII_M it is of."""
    parts = []
    for kind, part in enumerate(RADII_M):
        mirrored = tuple(_MIRROR[list(part)])
        parts += [(*end, kind) for end in ([part] if set(mirrored) == set(part) else [part, mirrored])]
    return parts


PARTS = np.array([ends for *ends, _ in _both_sides()])
KIND_OF_PART = np.array([kind for *_, kind in _both_sides()])
"""(P, 2) the rows at the two ends of each part, and (P,) which of RADII_M it is of: a part and its mirror image are of one."""

LIMBS = np.array(
    [
        (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW, Joint.RIGHT_HAND),
        (Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW, Joint.LEFT_HAND),
        (Joint.RIGHT_HIP, Joint.RIGHT_KNEE, Joint.RIGHT_FOOT),
        (Joint.LEFT_HIP, Joint.LEFT_KNEE, Joint.LEFT_FOOT),
    ]
)
"""(4, 3) root, middle and end of each limb."""

_BEYOND = (RIGHT_FINGERS, LEFT_FINGERS, RIGHT_TOES, LEFT_TOES)
LIMB_PARTS = np.array(
    [
        [np.flatnonzero((pair == PARTS).all(1))[0] for pair in ((root, middle), (middle, end), (end, beyond))]
        for (root, middle, end), beyond in zip(LIMBS, _BEYOND, strict=True)
    ]
)
"""(4, 3) the parts that make up each limb."""

_TRUNK = [k for k in range(len(PARTS)) if k not in LIMB_PARTS]
BARRED = np.array(
    [
        (own, k)
        for limb, (root, middle, _) in enumerate(LIMBS)
        for own in [LIMB_PARTS[limb, 1]]
        for k in [*_TRUNK, *(LIMB_PARTS[5 - limb, :2] if limb >= 2 else ())]
        if root not in PARTS[k]
    ]
)
"""(B, 2) the lower part of a limb, and a part that it cannot lie in: head and trunk, and for a leg the other leg."""

BARRED_OF = np.array([np.flatnonzero(BARRED[:, 0] == lower)[[0, -1]] + (0, 1) for lower in LIMB_PARTS[:, 1]])
"""(4, 2) each limb's first pair there, and its last but one."""

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
"""How much a wrong distance counts: all of a bone's, little of what a bending spine changes."""

TORSO_JOINTS = (
    Joint.HEAD, Joint.NECK, Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.TORSO, Joint.RIGHT_HIP, Joint.LEFT_HIP,
)  # fmt: skip

_CARRIED = {
    (Joint.NECK, Joint.RIGHT_SHOULDER): (-0.026, -0.010),
    (Joint.RIGHT_SHOULDER, Joint.TORSO): (0.049, 0.014),
    (Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP): (0.070, 0.033),
    (Joint.RIGHT_SHOULDER, Joint.LEFT_HIP): (0.051, 0.022),
}
"""Shoulders rise with the arms: how these distances, and their mirror images, grow with the cosine between upper arm and
upwards and with its square, as shares of the way from the hips to the neck. Least squares over 8 simulated dancers."""

_NECK_SHARES = (0.347, -0.146, -0.095)
"""Where the neck lies between the shoulders' middle and the head, by powers of the same cosine, in the same dancers."""


def neck_share(arms_raised: float) -> float:
    return _NECK_SHARES[0] + _NECK_SHARES[1] * arms_raised + _NECK_SHARES[2] * arms_raised**2


NECK_SHARE = neck_share(-1.0)
"""With hanging arms."""


class Body(NamedTuple):
    """One person's body as arrays for the kernels.

    Attributes:
        radii_m: (P, 2) of the parts.
        pairs: (C, 2) joints whose distance is kept.
        stiffness: (C,) in 0..1.
        lengths_m: (C,) the distances, with level upper arms.
        carried: (C,) the arm, 0 right or 1 left, that carries one of the two joints up with it, or -1.
        rise_m: (C, 2) by what such a distance grows with the cosine between upper arm and upwards, and with its square.
        limbs_m: (4, 2) lengths of upper and lower part of each limb.
        places_m: (6, 3) the way from its joint to each place in the trunk: to the torso's right, down and front.
    """

    radii_m: np.ndarray
    pairs: np.ndarray
    stiffness: np.ndarray
    lengths_m: np.ndarray
    carried: np.ndarray
    rise_m: np.ndarray
    limbs_m: np.ndarray
    places_m: np.ndarray


def body_of(model: HumanModel) -> Body:
    """The body of a person of these lengths."""
    figure = plane_figure(model)
    height_m = np.linalg.norm(figure[Joint.NECK] - (figure[Joint.RIGHT_HIP] + figure[Joint.LEFT_HIP]) / 2)
    pairs: dict[tuple[int, int], float] = {}
    carried: dict[tuple[int, int], tuple[int, tuple[float, float]]] = {}
    for ends, stiffness in _STIFFNESS.items():
        for arm, (a, b) in enumerate((ends, MIRROR[list(ends)])):
            pair = tuple(sorted((int(a), int(b))))
            pairs[pair] = stiffness
            if ends in _CARRIED:
                carried[pair] = arm, _CARRIED[ends]
    ends = np.array(list(pairs))
    arms = np.array([carried[pair][0] if pair in carried else -1 for pair in pairs])
    rise_m = np.array([carried[pair][1] if pair in carried else (0.0, 0.0) for pair in pairs]) * height_m
    lengths = np.linalg.norm(figure[ends[:, 0]] - figure[ends[:, 1]], axis=1)
    lengths -= rise_m @ (model.arms_raised, model.arms_raised**2)
    limb = model.limb_m
    limbs_m = np.array([[limb[Joint(middle)], limb[Joint(end)]] for _, middle, end in LIMBS])
    scale = size_m(model) / REFERENCE_SIZE_M
    radii = np.array(list(RADII_M.values()))[KIND_OF_PART] * scale
    places_m = np.array([np.multiply(way, side) for _, way in PLACES_M.values() for side in ((1, 1, 1), (-1, 1, 1))]) * scale
    return Body(radii, ends, np.array(list(pairs.values())), lengths, arms, rise_m, limbs_m, places_m)


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
    figure[Joint.NECK] = neck_share(model.arms_raised) * figure[Joint.HEAD]
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
