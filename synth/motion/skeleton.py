"""The canonical skeleton "kd23", its kinematics, and the types `Motion` and `Poses` that motion sources return.

The skeleton has 23 rotating joints and 5 end points, with MotionBuilder's and CMU's names. Axes: X is the subject's left,
Y up, Z the subject's front; right-handed, metres, the floor at y = 0. In the rest pose, the T-pose, every joint frame is
aligned with the world, the arms lie along +-X and the legs along -Y. A joint's quaternion (w, x, y, z) is relative to its
parent. The product down the chain is therefore the joint's world rotation relative to the T-pose, for any rig.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from kpopnet.rotations import conjugate, multiply

# name, parent, rest offset from the parent in millimetres
_POINTS = (
    ("Hips", None, (0, 0, 0)),
    ("LowerBack", "Hips", (0, 0, 0)),
    ("Spine", "LowerBack", (0, 119.8, -10.2)),
    ("Spine1", "Spine", (0, 120.2, -2.4)),
    ("Neck", "Spine1", (0, 120.8, 0)),
    ("Neck1", "Neck", (0, 94.9, -18.6)),
    ("Head", "Neck1", (0, 95.4, -5.7)),
    ("LeftShoulder", "Spine1", (0, 120.8, 0)),
    ("LeftArm", "LeftShoulder", (188.6, 62.2, -8.3)),
    ("LeftForeArm", "LeftArm", (303.4, 0, 0)),
    ("LeftHand", "LeftForeArm", (282.7, 0, 0)),
    ("RightShoulder", "Spine1", (0, 120.8, 0)),
    ("RightArm", "RightShoulder", (-188.6, 62.2, -8.3)),
    ("RightForeArm", "RightArm", (-303.4, 0, 0)),
    ("RightHand", "RightForeArm", (-282.7, 0, 0)),
    ("LeftUpLeg", "Hips", (93.9, -102.6, 43.1)),
    ("LeftLeg", "LeftUpLeg", (0, -413.8, 0)),
    ("LeftFoot", "LeftLeg", (0, -439.1, 0)),
    ("LeftToeBase", "LeftFoot", (0, -30.8, 120.4)),
    ("RightUpLeg", "Hips", (-93.9, -102.6, 43.1)),
    ("RightLeg", "RightUpLeg", (0, -413.8, 0)),
    ("RightFoot", "RightLeg", (0, -439.1, 0)),
    ("RightToeBase", "RightFoot", (0, -30.8, 120.4)),
    ("Head_end", "Head", (0, 96.6, 21.8)),
    ("LeftHand_end", "LeftHand", (70.9, 0, 0)),
    ("RightHand_end", "RightHand", (-70.9, 0, 0)),
    ("LeftToe_end", "LeftToeBase", (0, 0, 62.3)),
    ("RightToe_end", "RightToeBase", (0, 0, 62.3)),
)

POINT_NAMES = tuple(name for name, _, _ in _POINTS)
INDEX = {name: i for i, name in enumerate(POINT_NAMES)}
NUM_POINTS = len(POINT_NAMES)
NUM_JOINTS = 23
JOINT_NAMES = POINT_NAMES[:NUM_JOINTS]

PARENTS = np.array([-1 if parent is None else INDEX[parent] for _, parent, _ in _POINTS])
"""(28,) parent of each point; parents come first, and every parent is one of the 23 joints."""

REST_OFFSETS_M = np.array([offset for _, _, offset in _POINTS]) / 1000.0
"""(28, 3) offset from the parent in the T-pose of a mean adult, 1.70 m tall (the symmetrised mean of 11 people)."""

LEG_M = float(np.linalg.norm(REST_OFFSETS_M[INDEX["LeftLeg"]]) + np.linalg.norm(REST_OFFSETS_M[INDEX["LeftFoot"]]))
"""Length from hip through knee to ankle of the mean adult."""

_CLEARANCES_M = {
    "Hips": 0.10, "LowerBack": 0.10, "Spine": 0.10, "Spine1": 0.10, "Neck": 0.07, "Neck1": 0.07, "Head": 0.09,
    "Shoulder": 0.08, "Arm": 0.06, "ForeArm": 0.04, "Hand": 0.03, "UpLeg": 0.09, "Leg": 0.06, "Foot": 0.07,
    "ToeBase": 0.035, "Head_end": 0.05, "Hand_end": 0.02, "Toe_end": 0.02,
}  # fmt: skip
"""Set by hand: about half the thickness of an adult's body at the point, the height of the ankle for the foot."""

CLEARANCE_M = np.array([_CLEARANCES_M[name.removeprefix("Left").removeprefix("Right")] for name in POINT_NAMES])
"""(28,) height of each point above the floor when the body's surface around it touches the floor, metres."""


_OTHER = {"Left": "Right", "Right": "Left"}
MIRROR = np.array([INDEX[re.sub("Left|Right", lambda side: _OTHER[side[0]], name)] for name in POINT_NAMES])
"""(28,) index of each point's counterpart on the other side of the body."""


@dataclass(frozen=True)
class Motion:
    quats: np.ndarray  # (T, 23, 4) float32, local rotations w, x, y, z relative to the T-pose
    root_m: np.ndarray  # (T, 3) float32, position of Hips, metres
    fps: float  # frames per second
    name: str  # source of the motion; stored with every sample
    # leg length, hip through knee to ankle, of the skeleton that `root_m` belongs to, metres; for another body the root is
    # scaled by the ratio of the leg lengths
    leg_m: float

    def __len__(self) -> int:
        return len(self.quats)


@dataclass(frozen=True)
class Poses:
    """Independent single poses, each facing +Z at x = z = 0."""

    quats: np.ndarray  # (N, 23, 4) float32, local rotations w, x, y, z relative to the T-pose
    root_m: np.ndarray  # (N, 3) float32, position of Hips, metres
    leg_m: np.ndarray  # (N,) float32, leg length of the skeleton that each root belongs to, metres
    names: list[str]  # names of the N sources

    def __len__(self) -> int:
        return len(self.quats)

    @classmethod
    def joined(cls, parts: Sequence["Poses"]) -> "Poses":
        """The poses of all parts in order."""
        quats, root_m, leg_m = (np.concatenate([getattr(one, name) for one in parts]) for name in ("quats", "root_m", "leg_m"))
        return cls(quats, root_m, leg_m, [name for one in parts for name in one.names])


@njit(cache=True)
def _forward_kinematics(quats, root_m, offsets_m, parents, rotated, points):
    for n in range(len(quats)):
        for j in range(len(offsets_m)):
            p = parents[j]
            if p < 0:
                for axis in range(4):  # element by element: numba compiles a copy of a row for a second
                    rotated[n, j, axis] = quats[n, j, axis]
                for axis in range(3):
                    points[n, j, axis] = root_m[n, axis]
                continue
            w, x, y, z = rotated[n, p]
            vx, vy, vz = offsets_m[j]
            tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
            points[n, j, 0] = points[n, p, 0] + vx + w * tx + y * tz - z * ty
            points[n, j, 1] = points[n, p, 1] + vy + w * ty + z * tx - x * tz
            points[n, j, 2] = points[n, p, 2] + vz + w * tz + x * ty - y * tx
            if j < quats.shape[1]:
                a, b, c, d = quats[n, j]
                rotated[n, j, 0] = w * a - x * b - y * c - z * d
                rotated[n, j, 1] = w * b + x * a + y * d - z * c
                rotated[n, j, 2] = w * c - x * d + y * a + z * b
                rotated[n, j, 3] = w * d + x * c - y * b + z * a


def forward_kinematics(quats: np.ndarray, root_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 28, 3) float64 positions of the points in metres and (N, 23, 4) float64 world rotations of the joints.

    Of the mean skeleton, from local rotations (N, 23, 4) and positions of Hips (N, 3), metres.
    """
    quats = np.ascontiguousarray(quats, np.float64)
    rotated = np.empty_like(quats)
    points = np.empty((len(quats), NUM_POINTS, 3))
    root_m = np.ascontiguousarray(root_m, np.float64)
    _forward_kinematics(quats, root_m, np.ascontiguousarray(REST_OFFSETS_M, np.float64), PARENTS, rotated, points)
    return points, rotated


def height_above_floor(quats: np.ndarray, root_m: np.ndarray, leg_m: float | np.ndarray = LEG_M) -> np.ndarray:
    """(N,) height above the floor, metres, of the lowest surface point of the mean skeleton, scaled to legs of `leg_m`.

    Negative below the floor. `leg_m`, one or (N,), is that of the skeleton whose Hips are at (N, 3) `root_m`.
    """
    size = np.broadcast_to(np.asarray(leg_m, np.float64) / LEG_M, len(quats))
    points, _ = forward_kinematics(quats, root_m / size[:, None])
    return size * (points[..., 1] - CLEARANCE_M).min(axis=1)


def on_floor_m(quats: np.ndarray) -> np.ndarray:
    """(N, 3) float32 positions of Hips above the origin with which poses (N, 23, 4) touch the floor, metres."""
    root_m = np.zeros((len(quats), 3), np.float32)
    root_m[:, 1] = -height_above_floor(quats, root_m)
    return root_m


def mirrored(quats: np.ndarray) -> np.ndarray:
    """Rotations (..., 23, 4) of the mirrored pose, left and right swapped. The x of a root changes its sign."""
    return quats[..., MIRROR[:NUM_JOINTS], :] * np.array([1, 1, -1, -1], quats.dtype)


def facing_front(quats: np.ndarray) -> np.ndarray:
    """Rotations (N, 23, 4) with the heading of Hips, its rotation about the vertical, removed.

    An upside-down pose whose w and y of Hips vanish has no defined heading and is returned unchanged.
    """
    heading = quats[:, 0].astype(np.float64)
    heading[:, [1, 3]] = 0
    size = np.sqrt(heading[:, 0] ** 2 + heading[:, 2] ** 2)
    heading = np.where(size[:, None] > 1e-3, heading / np.maximum(size, 1e-3)[:, None], [1.0, 0.0, 0.0, 0.0])
    facing = quats.copy()
    facing[:, 0] = multiply(conjugate(heading), quats[:, 0])
    return facing


def still(motion: Motion, frame: int) -> Poses:
    """A frame of a motion as a single pose."""
    root_m = np.array([(0, motion.root_m[frame, 1], 0)], np.float32)
    name = f"{motion.name}@{frame / motion.fps:.1f}s"
    return Poses(facing_front(motion.quats[frame][None]), root_m, np.array([motion.leg_m], np.float32), [name])
