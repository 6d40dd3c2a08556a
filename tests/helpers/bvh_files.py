"""Motions as BVH files."""

import numpy as np
from scipy.spatial.transform import Rotation

from synth.motion.skeleton import (
    JOINT_NAMES,
    NUM_JOINTS,
    NUM_POINTS,
    PARENTS,
    POINT_NAMES,
    REST_OFFSETS_M,
    forward_kinematics,
)  # fmt: skip


def write_bvh(path, motion, *, order="ZYX", unit=0.01, rest=None, axes=None, rename=lambda name: name, fps=None):
    """Writes a motion as a BVH file.

    `rest` rotates bones from the T-pose to the file's rest pose (joint name to Rotation of that bone). `axes` rotates the
    canonical axes to the file's.
    """
    turn_of = {j: (rest or {}).get(JOINT_NAMES[j], Rotation.identity()) for j in range(NUM_JOINTS)}
    axes = axes or Rotation.identity()
    _, world = forward_kinematics(motion.quats, motion.root_m)
    # World rotation relative to the file's rest pose: first to the T-pose, then by the motion.
    turned = [axes * Rotation.from_quat(world[:, j], scalar_first=True) * turn_of[j].inv() * axes.inv() for j in turn_of]
    lines = ["HIERARCHY"]
    order_of_joints = []

    def block(j, indent):
        pad = "  " * indent
        parent = PARENTS[j]
        offset = axes.apply((turn_of[parent] if parent >= 0 else Rotation.identity()).apply(REST_OFFSETS_M[j])) / unit
        if j < NUM_JOINTS:
            order_of_joints.append(j)
            lines.append(f"{pad}{'ROOT' if parent < 0 else 'JOINT'} {rename(POINT_NAMES[j])}")
        else:
            lines.append(f"{pad}End Site")
        lines.append(f"{pad}{{")
        lines.append(f"{pad}  OFFSET " + " ".join(f"{x:.6f}" for x in offset))
        if j < NUM_JOINTS:
            rotation = " ".join(f"{axis}rotation" for axis in order)
            position = "Xposition Yposition Zposition " if parent < 0 else ""
            lines.append(f"{pad}  CHANNELS {6 if parent < 0 else 3} {position}{rotation}")
            for child in range(NUM_POINTS):
                if PARENTS[child] == j:
                    block(child, indent + 1)
        lines.append(f"{pad}}}")

    block(0, 0)
    lines += ["MOTION", f"Frames: {len(motion)}", f"Frame Time: {1 / (fps or motion.fps):.7f}"]
    columns = [axes.apply(motion.root_m) / unit]
    for j in order_of_joints:
        local = turned[j] if PARENTS[j] < 0 else turned[PARENTS[j]].inv() * turned[j]
        columns.append(local.as_euler(order, degrees=True))
    lines += [" ".join(f"{x:.7f}" for x in row) for row in np.hstack(columns)]
    path.write_text("\n".join(lines) + "\n")
    return path
