"""Anatomical joint angles, their limits, and the joint rotations that they define.

Poses and dances are defined by these angles instead of quaternions. Each angle has an anatomical meaning and its own
limits. The limits form a box, so every interpolation between two permitted postures is permitted too.

Angles are in DEGREES, the one exception to radians in the project, because people write and read them. A posture is a row
of angles in the order of `CHANNELS`. All zeros is standing upright with the arms straight down; `STANDING` is relaxed.

Trunk: `bend` forward, `side` to the left and `twist` to the left of the waist, the chest and the head. `hips_pitch`
(forward), `hips_roll` (to the left) and `hips_yaw` (to the left) rotate the whole body.

Arm (`left_...`, `right_...`): `raise` is the elevation of the upper arm, from hanging (0) through horizontal (90) to up
(180). `plane` is the azimuth of its vertical plane: 0 to the side, 90 to the front, above 90 across the body, -90 to the
back. Both are relative to the chest. `twist` rotates the upper arm about its own axis, positive outwards: with the arm
horizontal to the side and the elbow bent, 0 points the forearm to the front and 90 up. `elbow` flexes, `pronate` rotates
the palm inwards and backwards, `wrist` flexes towards the palm, `shrug` raises the collarbone in addition to its share of
the arm's elevation.

Leg: `flex` raises the thigh to the front, `abduct` to the side, `rotate` turns the knee outwards, `knee` flexes, `point`
points the foot downwards, `invert` turns the sole inwards, `toes` bends the toes upwards.
"""

import numpy as np

from kpopnet.rotations import about, conjugate, multiply
from synth.motion.skeleton import INDEX, NUM_JOINTS

_TRUNK = {
    "hips_pitch": (-200, 200), "hips_roll": (-200, 200), "hips_yaw": (-200, 200),
    "waist_bend": (-25, 55), "waist_side": (-22, 22), "waist_twist": (-20, 20),
    "chest_bend": (-18, 30), "chest_side": (-18, 18), "chest_twist": (-25, 25),
    "head_bend": (-50, 50), "head_side": (-35, 35), "head_twist": (-75, 75),
}  # fmt: skip
_ARM = {
    "raise": (0, 178), "plane": (-90, 135), "twist": (-80, 100), "elbow": (0, 148), "pronate": (-85, 85),
    "wrist": (-70, 70), "shrug": (-8, 22),
}  # fmt: skip
_LEG = {
    "flex": (-28, 128), "abduct": (-25, 70), "rotate": (-40, 62), "knee": (0, 150), "point": (-28, 52),
    "invert": (-22, 30), "toes": (-20, 55),
}  # fmt: skip

LIMITS_DEG = _TRUNK | {
    f"{side}_{name}": limits for limb in (_ARM, _LEG) for side in ("left", "right") for name, limits in limb.items()
}
"""Channel to (smallest, largest) angle: ranges of motion from physiotherapy textbooks, widened for dancers."""

CHANNELS = {name: i for i, name in enumerate(LIMITS_DEG)}
_LOWEST, _HIGHEST = np.array(list(LIMITS_DEG.values()), np.float64).T
_ARM_COLUMNS = np.array([[CHANNELS[f"{side}_{name}"] for name in _ARM] for side in ("left", "right")])
LEG_ANGLES = tuple(_LEG)
LEG_COLUMNS = np.array([[CHANNELS[f"{side}_{name}"] for name in _LEG] for side in ("left", "right")])
_RAISE, _PLANE = _ARM_COLUMNS[:, 0], _ARM_COLUMNS[:, 1]

STANDING = np.zeros(len(CHANNELS))
STANDING[_RAISE] = 8.0
STANDING[[CHANNELS["left_elbow"], CHANNELS["right_elbow"]]] = 12.0
STANDING.flags.writeable = False

# The fraction of the waist's, chest's or head's rotation that each vertebral joint takes.
_VERTEBRAL_FRACTIONS = {
    "LowerBack": ("waist", 0.5), "Spine": ("waist", 0.5), "Spine1": ("chest", 1.0),
    "Neck": ("head", 0.3), "Neck1": ("head", 0.3), "Head": ("head", 0.4),
}  # fmt: skip

# The collarbone takes about a quarter of the arm's elevation beyond 40 degrees, and a part of its reach across (Inman).
_CLAVICLE_FROM_DEG, _CLAVICLE_LIFT, _CLAVICLE_REACH = 40.0, 0.22, 0.12


def angles(**deviations: float) -> np.ndarray:
    """A posture (channels,): standing, with the given channels changed, degrees."""
    posture = STANDING.copy()
    for name, value in deviations.items():
        posture[CHANNELS[name]] = value
    return posture


def limited(postures: np.ndarray) -> np.ndarray:
    """Clips postures (N, channels) to the limits, including the limit of the arm behind the body."""
    postures = np.clip(postures, _LOWEST, _HIGHEST)
    # Straight backwards an arm rises to 60 degrees; the limit grows linearly towards the side plane.
    highest = 60.0 + (178.0 - 60.0) / 80.0 * (postures[:, _PLANE] + 90.0)
    postures[:, _RAISE] = np.minimum(postures[:, _RAISE], np.maximum(highest, 60.0))
    return postures


def rotations(postures: np.ndarray) -> np.ndarray:
    """Local rotations (N, 23, 4) float32 of postures (N, channels) in degrees, clipped to the limits first.

    All arithmetic is elementwise, so the bits of a posture do not depend on the batch.
    """
    postures = limited(np.ascontiguousarray(postures, np.float64))
    radians = np.deg2rad(postures)
    quats = np.zeros((len(postures), NUM_JOINTS, 4))
    quats[..., 0] = 1.0

    quats[:, INDEX["Hips"]] = yaw_pitch_roll(*(radians[:, CHANNELS[f"hips_{a}"]] for a in ("yaw", "pitch", "roll")))
    for joint, (part, fraction) in _VERTEBRAL_FRACTIONS.items():
        angles_rad = (radians[:, CHANNELS[f"{part}_{a}"]] * fraction for a in ("twist", "bend", "side"))
        quats[:, INDEX[joint]] = yaw_pitch_roll(*angles_rad)

    # Both sides are computed as left limbs; the right one is then mirrored.
    other_side = np.array([[1.0, 1, 1, 1], [1, 1, -1, -1]])
    for joint, side_quats in (_arms(radians[:, _ARM_COLUMNS]) | _legs(radians[:, LEG_COLUMNS])).items():
        both = side_quats * other_side
        quats[:, INDEX["Left" + joint]], quats[:, INDEX["Right" + joint]] = both[:, 0], both[:, 1]
    return quats.astype(np.float32)


def yaw_pitch_roll(yaw: np.ndarray, pitch: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Rotations (..., 4): roll to the left, then pitch forward, then yaw to the left, by angles in radians."""
    return multiply(multiply(about(1, yaw), about(0, pitch)), about(2, -roll))


def _arms(arm: np.ndarray) -> dict[str, np.ndarray]:
    """Rotations of the arm's joints, (N, 2, 4) each, from angles (N, 2, 7) in radians."""
    lift, plane, twist, elbow, pronate, wrist, shrug = np.moveaxis(arm, -1, 0)
    # The unit vector along the left upper arm in the frame of the chest.
    x, y, z = np.sin(lift) * np.cos(plane), -np.cos(lift), np.sin(lift) * np.sin(plane)
    elevation = shrug + _CLAVICLE_LIFT * np.maximum(lift - np.deg2rad(_CLAVICLE_FROM_DEG), 0.0)
    reach = _CLAVICLE_REACH * np.maximum(z, 0.0) * np.maximum(plane, 0.0)
    clavicle = multiply(about(2, elevation), about(1, -reach))

    # The smallest rotation from the T-pose (1, 0, 0) to the direction. It is undefined only at (-1, 0, 0), outside the limits.
    swing = np.stack([1.0 + x, np.zeros_like(x), -z, y], axis=-1)
    swing = swing / np.sqrt((swing * swing).sum(axis=-1, keepdims=True))
    half_pronate = about(0, pronate / 2)
    return {
        "Shoulder": clavicle,
        "Arm": multiply(conjugate(clavicle), multiply(swing, about(0, -twist))),
        "ForeArm": multiply(about(1, -elbow), half_pronate),
        "Hand": multiply(half_pronate, about(2, -wrist)),
    }


def _legs(leg: np.ndarray) -> dict[str, np.ndarray]:
    """Rotations of the leg's joints, (N, 2, 4) each, from angles (N, 2, 7) in radians."""
    flex, abduct, rotate, knee, point, invert, toes = np.moveaxis(leg, -1, 0)
    return {
        "UpLeg": multiply(multiply(about(0, -flex), about(2, abduct)), about(1, rotate)),
        "Leg": about(0, knee),
        "Foot": multiply(about(0, point), about(2, -invert)),
        "ToeBase": about(0, -toes),
    }
