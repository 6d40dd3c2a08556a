"""BVH recordings of any common naming of joints, upright and in metres: rotations of the bones, path of the hips, joints.

Three defects of the popular cgspeed conversion of the CMU recordings are corrected:

- It lost every bone that branches: the thorax, and the last third of each forearm. Its "LeftHand" is that last third of the
  forearm, and its "LeftFingerBase" is the hand.
- Its first frame is not recorded but the T-pose. It is dropped.
- Subjects 60 and 61 were recorded at 60 frames per second but the files state 120. These files are recognised by their name
  and CMU's unit of length; any other file is read at the rate that it states, unless `fps` overrides it.
"""

import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kpopnet.dance.joint_files.bones import find_joints, joint_positions_m, skeleton_points, with_torso, world_rotations
from kpopnet.dance.joint_files.bvh import BvhFile, read_bvh
from kpopnet.dance.joint_files.points import NamedPoints
from kpopnet.errors import InputError
from kpopnet.rotations import conjugate, multiply, of_matrix, rotate

log = logging.getLogger(__name__)

_DOWN = (0.0, -1.0, 0.0)

_CMU_M = 0.0254 / 0.45
_UNITS_M = {"metres": 1.0, "inches": 0.0254, "centimetres": 0.01, "millimetres": 0.001, "CMU's 5.64 cm": _CMU_M}
"""Metres per unit for the units that occur in files. The leg lengths of adults in these units do not overlap."""

_MIN_LEG_M, _MAX_LEG_M, _MEAN_LEG_M = 0.6, 1.15, 0.8529
"""Lengths of the legs of adults; the mean is that of synth's."""


@dataclass(frozen=True)
class BvhMotion:
    """A recording in axes of its rest pose: X the subject's left, Y up, Z the front."""

    found: dict[str, int]  # index in the file of each recognised joint, by MotionBuilder's name
    parents: list[int]  # index of each joint's parent, -1 for the root
    rest: np.ndarray  # (J, 3) positions of the joints in the rest pose, in the file's unit
    rotated: np.ndarray  # (T, J, 4) world rotations relative to the rest pose, w, x, y, z
    root_m: np.ndarray  # (T, 3) position of the root
    t_pose: np.ndarray | None  # (J, 4) world rotations of the T-pose that the file opened with, if it did
    fps: float
    leg_m: float  # length from hip through knee to ankle
    metres: float  # per unit of the file
    to_canonical: np.ndarray  # quaternion from the file's axes to these


def read_bvh_motion(path: Path, fps: float | None = None) -> BvhMotion:
    """Reads a BVH file, finds its joints, its unit and its axes; `fps` is the true rate of a file that states a wrong one."""
    bvh = read_bvh(path)
    found = find_joints(bvh.names, bvh.parents, path)
    # World rotations relative to the file's rest pose; then both in canonical axes.
    rest, rotated = np.zeros((len(bvh.names), 3)), world_rotations(bvh.quats, bvh.parents)
    root = _hips_path(bvh, rotated, found["Hips"])
    for joint, parent in enumerate(bvh.parents[1:], 1):
        rest[joint] = rest[parent] + bvh.offsets[joint]
    to_canonical = _canonical_frame(rest, found, path)
    rotated = multiply(multiply(to_canonical, rotated), conjugate(to_canonical))
    rest = rotate(to_canonical, rest)

    t_pose = rotated[0] if _opens_with_t_pose(bvh, root, rotated[0], rest, found) else None
    if t_pose is not None:
        log.info("%s: the first frame is the T-pose, not recorded; dropped", path.name)
        rotated, root = rotated[1:], root[1:]
    leg = sum(np.linalg.norm(rest[found[f"Left{b}"]] - rest[found[f"Left{a}"]]) for a, b in (("UpLeg", "Leg"), ("Leg", "Foot")))
    metres = _unit(float(leg), path)
    if fps is None and re.fullmatch(r"6[01]_\d\d", path.stem) and metres == _CMU_M and bvh.fps > 100:
        log.info("%s states %.0f frames a second but CMU recorded subjects 60 and 61 at 60: read as 60", path.name, bvh.fps)
        fps = 60.0
    rate = bvh.fps if fps is None else fps
    if not 1 <= rate <= 1000:
        raise InputError(f"{path}: states {rate:g} frames a second; give the true rate, fps, 1 to 1000")
    root_m = rotate(to_canonical, root) * metres
    return BvhMotion(found, bvh.parents, rest, rotated, root_m, t_pose, rate, float(leg) * metres, metres, to_canonical)


def read_bvh_group(paths: Sequence[Path], fps: float | None = None) -> list[BvhMotion]:
    """Reads a file for each dancer of a group who was recorded together, all in one unit and in the same axes.

    A file whose legs fit no unit of length is in that of the others, and without any other in that of the first. Raises
    InputError for a file in another unit than the others, or whose rest pose stands or faces otherwise than the first's.
    """
    motions = [read_bvh_motion(path, fps) for path in paths]
    unit_from = next((k for k, motion in enumerate(motions) if motion.metres in _UNITS_M.values()), 0)
    metres = motions[unit_from].metres if motions else 1.0
    for path, motion in zip(paths, motions, strict=True):
        if motion.metres in _UNITS_M.values() and motion.metres != metres:
            raise InputError(f"{path}: in another unit than {paths[unit_from]}; dancers of a group share one frame")
        if motion.metres != metres:
            log.warning("%s: taken in the unit of %s instead", path.name, paths[unit_from].name)
        if not np.array_equal(motion.to_canonical, motions[0].to_canonical):
            raise InputError(
                f"{path}: its rest pose stands or faces otherwise than that of {paths[0]}; dancers of a group share one frame"
            )
    factors = [metres / motion.metres for motion in motions]
    return [
        replace(motion, metres=metres, root_m=factor * motion.root_m, leg_m=factor * motion.leg_m)
        for motion, factor in zip(motions, factors, strict=True)
    ]


def bvh_points(motion: BvhMotion) -> NamedPoints:
    """The joints of a recorded skeleton by the names of points, metres, y up."""
    found, rest, parents = with_torso(motion.found, motion.rest, motion.parents)
    positions_m = joint_positions_m(motion.rotated, motion.root_m, rest, parents, motion.metres)
    return skeleton_points(found, positions_m, fps=motion.fps)


def _unit(leg: float, path: Path) -> float:
    """Metres per unit of the file, from its leg length."""
    if leg < 1e-3:
        raise InputError(f"{path}: the rest offsets make a leg of {leg:g}; expected a person's in any unit of length")
    for unit, metres in _UNITS_M.items():
        if _MIN_LEG_M <= leg * metres <= _MAX_LEG_M:
            log.info("%s: a leg of %.4g is in %s", path.name, leg, unit)
            return metres
    log.warning("%s: a leg of %.4g fits no unit of length; scaled to the mean adult's %.2f m", path.name, leg, _MEAN_LEG_M)
    return _MEAN_LEG_M / leg


def _canonical_frame(rest: np.ndarray, found: dict[str, int], path: Path) -> np.ndarray:
    """Quaternion from the file's axes to X left, Y up, Z front: the nearest rotation by multiples of 90 degrees."""
    left = rest[found["LeftUpLeg"]] - rest[found["RightUpLeg"]]
    up = rest[found["Head"]] - rest[found["Hips"]]
    axes = np.zeros((3, 3))
    for row, direction in ((0, left), (1, up)):
        if np.linalg.norm(direction) == 0:
            raise InputError(f"{path}: the rest offsets between the hips, or from hips to head, are all zero")
        axis = int(np.abs(direction).argmax())
        axes[row, axis] = np.sign(direction[axis])
    if axes[0] @ axes[1] != 0:
        raise InputError(f"{path}: the rest pose does not stand upright: left is {left}, up is {up}")
    axes[2] = np.cross(axes[0], axes[1])
    return of_matrix(axes)


def _hips_path(bvh: BvhFile, rotated: np.ndarray, hips: int) -> np.ndarray:
    """(T, 3) position of the root where what moves the hips below it is the root's: rigs keep the path in any of these."""
    root, joint = bvh.root, hips
    while bvh.moved is not None and joint > 0:
        root = root + rotate(rotated[:, bvh.parents[joint]], bvh.moved[:, joint])
        joint = bvh.parents[joint]
    return root


def _opens_with_t_pose(bvh: BvhFile, root: np.ndarray, rotated: np.ndarray, rest: np.ndarray, found: dict[str, int]) -> bool:
    """Whether frame 0 is a T-pose before the recording: unrotated hips, straight limbs, the position of frame 1."""
    if len(root) < 2 or (root[0] != root[1]).any() or abs(rotated[found["Hips"], 0]) < 1 - 1e-9:
        return False
    for side, left in (("Left", 1.0), ("Right", -1.0)):
        for joint, end, axis in (("Arm", "ForeArm", (left, 0.0, 0.0)), ("UpLeg", "Leg", _DOWN), ("Leg", "Foot", _DOWN)):
            bone = rotate(rotated[found[side + joint]], rest[found[side + end]] - rest[found[side + joint]])
            if bone @ np.array(axis) < np.cos(np.deg2rad(12)) * np.linalg.norm(bone):
                return False
    return not np.array_equal(bvh.quats[0], bvh.quats[1])
