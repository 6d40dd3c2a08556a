"""Converts recorded 3D points of other joint sets to the fifteen joints: any that have ours among them, and ImperialDance's.

The torso is the mean of shoulders and hips, as in the paper (section 2.3). The unit (metres, centimetres or millimetres) and
the vertical axis (y or z, up or down) are inferred from the dancer's trunk. The whole sequence is rotated about the vertical
axis so that the dancer faces the camera on average over the first twentieth of the frames.
"""

import numpy as np

from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS, Joint

CAMERA_DISTANCE_M, CAMERA_HEIGHT_M = 2.5, 1.0
"""Position of the virtual level camera of motion-capture joints: distance to the dancer's start, and height above the floor."""

_SIDES = ("right", "left")
_LIMBS = ("SHOULDER", "ELBOW", "HAND", "HIP", "KNEE", "FOOT")
NECK_FRACTION_TO_EARS = 0.37
"""Position of the neck on the line from the middle of the shoulders (0) to the middle of the ears (1), on synth's mean adult;
the trackers' neck fractions end at the head joint."""

IMPERIAL_POINTS = (
    "RShin", "RToe", "RThigh", "LThigh", "LFoot", "RShoulder", "LHand", "RHand", "LFArm", "LShoulder", "RFoot", "Neck",
    "LShin", "Chest", "Head", "LToe", "Ab", "RUArm", "LUArm", "Hip", "RFArm",
)  # fmt: skip
"""Names of ImperialDance's points in their order."""

_IMPERIAL_LIMBS = ("UArm", "FArm", "Hand", "Thigh", "Shin", "Foot")
IMPERIAL = {
    f"{side.upper()}_{limb}": IMPERIAL_POINTS.index(side[0].upper() + name)
    for limb, name in zip(_LIMBS, _IMPERIAL_LIMBS, strict=True)
    for side in _SIDES
}
"""Joint name to the index of its point. A point carries the name of the segment that begins at it."""

MAX_COORDINATE = 1e6
"""A kilometre in millimetres: no dance is farther from the origin."""

_UNITS_M = (1.0, 0.01, 0.001)
_TRUNK_RANGE_M = (0.25, 0.9)
_SHOULDERS, _HIPS = [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER], [Joint.RIGHT_HIP, Joint.LEFT_HIP]


def from_points(points: np.ndarray, limbs: dict[str, int], head: np.ndarray, neck: np.ndarray, source: str) -> np.ndarray:
    """Converts recorded points to fifteen joints in the frame of a level camera that the dancer faces at first.

    Args:
        points: (T, P, 3) in metres, centimetres or millimetres, y or z up, NaN where missing.
        limbs: joint name to the index of its point.
        head: (T, 3) middle of the head.
        neck: (T, 3) neck.
        source: name of the recording, for messages.

    Returns:
        (T, 15, 3) float32 metres; x right, y down, z forward.

    Raises:
        InputError: see `before_level_camera_m`.
    """
    joints = np.full((len(points), NUM_JOINTS, 3), np.nan)
    for name, number in limbs.items():
        joints[:, Joint[name]] = points[:, number]
    joints[:, Joint.HEAD], joints[:, Joint.NECK] = head, neck
    return before_level_camera_m(joints, source)


def before_level_camera_m(joints: np.ndarray, source: str) -> np.ndarray:
    """Transforms joints to the frame of a level camera that the dancer faces at first; the torso becomes the paper's.

    Args:
        joints: (T, 15, 3) in metres, centimetres or millimetres, in a right-handed frame whose y or z points up or down; NaN
            where missing.
        source: name of the recording, for messages.

    Returns:
        (T, 15, 3) float32 metres; x right, y down, z forward.

    Raises:
        InputError: No frame has a whole trunk, its length is not a person's in any of the units, or it is not upright; or a
            coordinate is farther from 0 than MAX_COORDINATE.
    """
    largest = np.max(np.abs(joints), initial=0, where=np.isfinite(joints))
    if not largest <= MAX_COORDINATE:
        raise InputError(f"{source}: a coordinate of {largest:g}; expected at most {MAX_COORDINATE:g} millimetres")
    joints = np.where(np.isfinite(joints), joints, np.nan).astype(np.float64)
    joints[:, Joint.TORSO] = joints[:, _SHOULDERS + _HIPS].mean(axis=1)
    trunk = trunks(joints)
    valid = np.isfinite(trunk.sum(axis=1))
    if not valid.any():
        raise InputError(f"{source}: no frame has both shoulders and both hips")
    joints *= unit_m(trunk[valid], source)
    joints = joints @ _to_y_up(trunk[valid], source).T
    return _facing_camera(joints, joints[:, _HIPS].mean(axis=1), valid).astype(np.float32)


def trunks(joints: np.ndarray) -> np.ndarray:
    """(T, 3) vectors from the middle of the hips to the middle of the shoulders of (T, 15, 3) joints."""
    return joints[:, _SHOULDERS].mean(axis=1) - joints[:, _HIPS].mean(axis=1)


def unit_m(trunk: np.ndarray, source: str) -> float:
    """The unit in metres of (T, 3) vectors from the hips to the shoulders.

    Raises:
        InputError: their median length is not a person's in any of the units.
    """
    length = float(np.median(np.linalg.norm(trunk, axis=1)))
    unit = next((unit for unit in _UNITS_M if _TRUNK_RANGE_M[0] < unit * length < _TRUNK_RANGE_M[1]), None)
    if unit is None:
        raise InputError(
            f"{source}: hips and shoulders are {length:g} apart, which is not a person's trunk in metres, centimetres or "
            "millimetres"
        )
    return unit


_TO_Y_UP = {
    (1, True): np.diag([1.0, 1.0, 1.0]),
    (1, False): np.diag([1.0, -1.0, -1.0]),
    (2, True): np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    (2, False): np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Rotations to y up from the axis that is vertical, 1 for y and 2 for z, and whether it points up."""


def _to_y_up(trunk: np.ndarray, source: str) -> np.ndarray:
    """(3, 3) rotation after which y points up, from (T, 3) vectors from the hips to the shoulders."""
    mean = trunk.mean(axis=0)
    axis = 1 + int(abs(mean[2]) > abs(mean[1]))
    if abs(mean[axis]) < 0.5 * np.median(np.linalg.norm(trunk, axis=1)):
        raise InputError(f"{source}: neither y nor z points up or down along the dancer's trunk")
    return _TO_Y_UP[axis, bool(mean[axis] > 0)]


def _facing_camera(joints_m: np.ndarray, hips_m: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Transforms joints to the frame of the virtual camera.

    Args:
        joints_m: (T, 15, 3) metres, y up.
        hips_m: (T, 3) middle of the hips, metres, y up.
        valid: (T,) bool, frames with a whole trunk.

    Returns:
        (T, 15, 3) metres in the camera frame.
    """
    across = joints_m[:, Joint.LEFT_HIP] - joints_m[:, Joint.RIGHT_HIP]
    first = np.flatnonzero(valid)[: max(len(valid) // 20, 1)]
    side = across[first].mean(axis=0)
    origin = np.array([*hips_m[first[0], [0]], np.nanmin(joints_m[..., 1]), *hips_m[first[0], [2]]])
    # The left hip has to be on the camera's right: the camera's x axis is along `side`, y down, z away from the camera.
    angle = np.arctan2(side[2], side[0])
    cos, sin = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(joints_m - origin, -1, 0)
    return np.stack([cos * x + sin * z, CAMERA_HEIGHT_M - y, CAMERA_DISTANCE_M - (cos * z - sin * x)], axis=-1)


def imperial_joints_m(points: np.ndarray, source: str) -> np.ndarray:
    """(T, 15, 3) float32 joints in metres from (T, 21, 3) points of ImperialDance; see `from_points`."""
    head, neck = (points[:, IMPERIAL_POINTS.index(name)] for name in ("Head", "Neck"))
    return from_points(points, IMPERIAL, head, neck, source)
