"""Retargets BVH files to the canonical skeleton.

Only the rotations and the path of the hips are used. Bone lengths come from the body that performs the motion.

`kpopnet.dance.joint_files.bvh_motion` reads the files and corrects what conversions lost. Where a file opens with the T-pose,
that frame defines the rest orientation of feet and neck.
"""

import itertools
from pathlib import Path

import numpy as np

from kpopnet.dance.joint_files.bvh_motion import read_bvh_motion
from kpopnet.rotations import conjugate, multiply, rotate
from synth.motion.skeleton import JOINT_NAMES, LEG_M, NUM_JOINTS, PARENTS, Motion, height_above_floor


def bvh_motion(path: Path, fps: float | None = None) -> Motion:
    """Reads a BVH file as a motion of the canonical skeleton.

    The T-pose is computed from the file's rest offsets: upper arm, forearm and hand are rotated onto +-X, thigh and shin onto
    -Y, each by the smallest rotation after that of the previous bone of the limb. The floor is at the 3rd percentile, over the
    frames, of the height of the body's lowest point.

    Args:
        path: the file.
        fps: frames per second of a file that states a wrong rate; None trusts the file (except for CMU's subjects 60 and
            61).

    Raises:
        InputError: the file is malformed, or a required joint is not found.
    """
    recorded = read_bvh_motion(Path(path), fps)
    found, rest, rotated = recorded.found, recorded.rest, recorded.rotated
    world = np.empty((len(rotated), NUM_JOINTS, 4))
    for j, name in enumerate(JOINT_NAMES):
        if name in found:
            world[:, j] = multiply(rotated[:, found[name]], conjugate(_alignment(name, found, rest, recorded.t_pose)))
        else:
            world[:, j] = world[:, PARENTS[j]]
    local = world.copy()
    local[:, 1:] = multiply(conjugate(world[:, PARENTS[1:NUM_JOINTS]]), world[:, 1:])

    root_m = recorded.root_m.copy()
    # The height of the floor differs between files. The lowest frames touch the floor; the percentile ignores outliers.
    size = LEG_M / recorded.leg_m
    root_m[:, 1] -= np.percentile(height_above_floor(local, root_m * size), 3) / size
    name = f"bvh:{Path(path).stem}"
    return Motion(local.astype(np.float32), root_m.astype(np.float32), recorded.fps, name, recorded.leg_m)


def _alignment(name: str, found: dict[str, int], rest: np.ndarray, t_pose: np.ndarray | None) -> np.ndarray:
    """The rotation of a bone from the file's rest pose to the T-pose.

    The hand continues the forearm. Feet, toes and the trunk take their rotations of the T-pose in the file's first frame
    (world rotations (J, 4)), if there is one; otherwise they keep their rest orientation.
    """
    rotation = np.array([1.0, 0.0, 0.0, 0.0])
    side = "Left" if name.startswith("Left") else "Right"
    part = name.removeprefix(side)
    if part in ("Arm", "ForeArm", "Hand"):
        limb, target = ("Arm", "ForeArm", "Hand"), np.array([1.0 if side == "Left" else -1.0, 0.0, 0.0])
    elif part in ("UpLeg", "Leg"):
        limb, target = ("UpLeg", "Leg", "Foot"), np.array([0.0, -1.0, 0.0])
    else:
        return rotation if t_pose is None else t_pose[found[name]]
    for bone, end in itertools.pairwise(limb):
        direction = rotate(rotation, rest[found[side + end]] - rest[found[side + bone]])
        rotation = multiply(_smallest_rotation(direction, target), rotation)
        if bone == part:
            break
    return rotation


def _smallest_rotation(direction: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The smallest rotation that aligns a direction with a unit vector; the identity for a direction of length 0."""
    length = np.linalg.norm(direction)
    if length < 1e-9:
        return np.array([1.0, 0, 0, 0])
    unit = direction / length
    rotation = np.concatenate([[1.0 + unit @ target], np.cross(unit, target)])
    size = np.linalg.norm(rotation)
    # Opposite to the target any perpendicular axis is valid; the front axis keeps the direction of elbows and knees.
    return rotation / size if size > 1e-6 else np.array([0.0, 0, 0, 1.0])
