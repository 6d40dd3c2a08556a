"""Motions of the SMPL family of body models (AMASS and others), on the mean adult of this project.

A pose is a rotation for each joint, and SMPL's, SMPL-H's and SMPL-X's first 22 joints are the same. The models themselves, and
with them the lengths of a person's bones (`betas`, `gender`), may not be redistributed: MEAN_ADULT_M takes their place. SMPL's
rest pose is taken for an exact T-pose.
"""

from collections.abc import Mapping

import numpy as np

from kpopnet.dance.joint_files.bones import MEAN_ADULT_M, joint_positions_m, skeleton_points, with_torso, world_rotations
from kpopnet.dance.joint_files.points import NamedPoints
from kpopnet.rotations import turns
from kpopnet.runtime.input_files import ArraySchema, expect

SCHEMA = {
    "poses": ArraySchema("f", ("frames", None), False),
    "trans": ArraySchema("f", ("frames", 3), False),
    "mocap_framerate": ArraySchema("fiu", (), False),
    "mocap_frame_rate": ArraySchema("fiu", (), False),
}
"""(T, W) axis-angle rotations, radians; (T, 3) position of the root, metres, z up; frames per second, by AMASS's two names."""

_WIDTHS = (66, 72, 156, 165)
"""Numbers of a pose: 22 joints, those of SMPL, of SMPL-H and of SMPL-X."""

_JOINTS = (
    "Hips", "LeftUpLeg", "RightUpLeg", "LowerBack", "LeftLeg", "RightLeg", "Spine", "LeftFoot", "RightFoot", "Spine1",
    "LeftToeBase", "RightToeBase", "Neck", "LeftShoulder", "RightShoulder", "Head", "LeftArm", "RightArm", "LeftForeArm",
    "RightForeArm", "LeftHand", "RightHand",
)  # fmt: skip
"""SMPL's joints in their order, by MotionBuilder's names."""

_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)


def smpl_points(found: Mapping[str, np.ndarray], source: str) -> NamedPoints:
    """The joints of a motion of SCHEMA's arrays, metres; `source` names the file in messages."""
    poses, frames = found["poses"].astype(np.float64), len(found["poses"])
    width = poses.shape[1]
    expect(width in _WIDTHS, source, f"poses of {', '.join(map(str, _WIDTHS))} numbers, found {width}")
    expect(frames > 0 and bool((np.abs(poses) < 1e3).all()), source, "poses, in radians")
    quats = turns(poses[:, :66].reshape(frames, 22, 3))
    root_m = found.get("trans", np.zeros((frames, 3)))
    joints = {name: number for number, name in enumerate(_JOINTS)}
    joints, rest_m, parents = with_torso(joints, np.array([MEAN_ADULT_M[name] for name in _JOINTS]), _PARENTS)
    positions_m = joint_positions_m(world_rotations(quats, _PARENTS), root_m, rest_m, parents)
    if "trans" not in found:  # the place is unknown: joints about the middle of the hips, as in other such files
        positions_m -= positions_m[:, 1:3].mean(axis=1, keepdims=True)
    rate = found.get("mocap_framerate", found.get("mocap_frame_rate"))
    return skeleton_points(joints, positions_m, fps=None if rate is None else float(rate))
