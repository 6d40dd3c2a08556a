"""Writes a dance of the teacher's body as BVH, which animation programs read."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.teacher.library import TeacherBody

_TO_Y_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Multiplies row vectors: from z up and -y in front to y up and z in front."""

END_M = 0.08
"""Length of the end of a bone without children."""


def as_bvh(body: TeacherBody, quats: np.ndarray, hips_m: np.ndarray, fps: float) -> str:
    """The text of a BVH file, in metres, y up.

    Args:
        body: the skeleton.
        quats: (T, B, 4) rotations of the bones relative to their parents, w first.
        hips_m: (T, 3) positions of the root.
        fps: frames per second.
    """
    order = list(_depth_first(body, 0))
    lines = ["HIERARCHY", *_bone(body, 0, ""), "MOTION", f"Frames: {len(quats)}", f"Frame Time: {1 / fps:.6f}"]
    turned = quats[..., (0, 1, 3, 2)] * (1, 1, 1, -1)  # (x, y, z) -> (x, z, -y)
    rotations = Rotation.from_quat(turned[:, order].reshape(-1, 4), scalar_first=True)
    angles_deg = rotations.as_euler("ZXY", degrees=True).reshape(len(quats), -1)
    motion = np.concatenate([hips_m @ _TO_Y_UP, angles_deg], axis=1)
    return "\n".join([*lines, *(" ".join(f"{value:.4f}" for value in frame) for frame in motion)]) + "\n"


def _children(body: TeacherBody, bone: int) -> list[int]:
    return np.flatnonzero(body.bone_parents == bone).tolist()


def _depth_first(body: TeacherBody, bone: int) -> Iterator[int]:
    yield bone
    for child in _children(body, bone):
        yield from _depth_first(body, child)


def _bone(body: TeacherBody, bone: int, indent: str) -> list[str]:
    """The lines of a bone and of all below it."""
    parent, deeper = int(body.bone_parents[bone]), indent + "  "
    kind, offset_m = "ROOT", np.zeros(3)
    if parent >= 0:
        kind = "JOINT"
        offset_m = body.t_pose[parent] @ (body.heads_m[bone] - body.heads_m[parent]) @ _TO_Y_UP
    position = "6 Xposition Yposition Zposition" if parent < 0 else "3"
    lines = [
        f"{indent}{kind} {body.bone_names[bone]}",
        f"{indent}{{",
        f"{deeper}OFFSET {' '.join(f'{value:.5f}' for value in offset_m)}",
        f"{deeper}CHANNELS {position} Zrotation Xrotation Yrotation",
    ]
    children = _children(body, bone)
    for child in children:
        lines += _bone(body, child, deeper)
    if not children:
        lines += [f"{deeper}End Site", f"{deeper}{{", f"{deeper}  OFFSET 0 {END_M} 0", f"{deeper}}}"]
    return [*lines, f"{indent}}}"]
