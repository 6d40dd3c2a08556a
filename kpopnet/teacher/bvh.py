"""A dance of the teacher's body as BVH, which animation programs read."""

import numpy as np

from kpopnet.dance.joint_files.bvh import BvhFile, bvh_text
from kpopnet.teacher.library import TeacherBody

_TO_Y_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Multiplies row vectors: from z up and -y in front to y up and z in front."""

END_M = np.array([0, 0.08, 0])
"""Where a bone without children ends."""


def as_bvh(body: TeacherBody, quats: np.ndarray, hips_m: np.ndarray, fps: float) -> str:
    """The text of a BVH file, in metres, y up.

    Args:
        body: the skeleton.
        quats: (T, B, 4) rotations of the bones relative to their parents, w first.
        hips_m: (T, 3) positions of the root.
        fps: frames per second.
    """
    offsets_m = np.zeros((len(body.bone_names), 3))
    for bone, parent in enumerate(body.bone_parents.tolist()):
        if parent >= 0:
            offsets_m[bone] = body.t_pose[parent] @ (body.heads_m[bone] - body.heads_m[parent]) @ _TO_Y_UP
    turned = quats[..., (0, 1, 3, 2)] * (1, 1, 1, -1)  # (x, y, z) -> (x, z, -y)
    names, parents = [str(name) for name in body.bone_names], body.bone_parents.tolist()
    return bvh_text(BvhFile(names, parents, offsets_m, turned, hips_m @ _TO_Y_UP, fps), [END_M] * len(names))
