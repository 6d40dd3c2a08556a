"""Joints as BVH: a skeleton of constant bones in MotionBuilder's names, which animation programs read.

Directions of limbs and trunk are those of the joints; lengths of bones are their medians over the recording. How a limb turns
about its own axis is not known from joints: each bone is turned as little as possible from its parent. BVH knows no missing
joints: one that is missing is interpolated in time.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.rotations import conjugate, multiply, rotate
from kpopnet.skeleton import Joint

CM_PER_METRE = 100.0
LEFT, UP, DOWN = np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, -1.0, 0])
"""Directions in the axes of BVH files: x to the left of a person who faces z, y up."""

HAND_CM, TOE_CM, CROWN_CM = 8.0, 8.0, 12.0
"""Lengths of the bones beyond the last joints, which only draw hands, feet and head."""


class _Bone(NamedTuple):
    """A joint of the BVH file.

    Attributes:
        name: in the file.
        parent: its name, empty for the root.
        offset_cm: (3,) place in the parent's axes.
        world: (T, 4) rotations from the rest pose.
    """

    name: str
    parent: str
    offset_cm: np.ndarray
    world: np.ndarray


def as_bvh(performance: Performance) -> str:
    """The text of a BVH file: centimetres, y up, the camera's side in front.

    Raises:
        InputError: a joint of trunk or limbs is missing throughout, or hips or shoulders lie in one point.
    """
    points = _filled(performance) * [1, -1, -1] * CM_PER_METRE
    bones, root_cm = _skeleton({joint.name.lower(): points[:, joint] for joint in Joint})
    local = {bone.name: bone.world for bone in bones if not bone.parent}
    worlds = {bone.name: bone.world for bone in bones}
    local |= {bone.name: multiply(conjugate(worlds[bone.parent]), bone.world) for bone in bones if bone.parent}
    degrees = [Rotation.from_quat(local[bone.name], scalar_first=True).as_euler("ZXY", degrees=True) for bone in _walk(bones)]
    channels = np.concatenate([root_cm, *degrees], axis=1)
    times_s = performance.times_s
    interval_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 1 / 30
    even = _resampled(channels, times_s, interval_s)
    lines = ["HIERARCHY", *_hierarchy(bones, "", 0), "MOTION", f"Frames: {len(even)}", f"Frame Time: {interval_s:.8f}"]
    return "\n".join([*lines, *(" ".join(f"{one:.4f}" for one in row) for row in even.tolist())]) + "\n"


def _filled(performance: Performance) -> np.ndarray:
    """(T, 15, 3) joints in metres, those that are missing interpolated in time."""
    filled = performance.joints_m.copy()
    for joint in Joint:
        seen = performance.confidence[:, joint] > 0
        if not seen.any():
            raise InputError(f"{joint.name.lower()} is missing in every frame; BVH, unlike the other formats, needs it in some")
        for axis in range(3):
            filled[:, joint, axis] = np.interp(performance.times_s, performance.times_s[seen], filled[seen, joint, axis])
    return filled


def _skeleton(at: Mapping[str, np.ndarray]) -> tuple[list[_Bone], np.ndarray]:
    """The bones, parents before children, and (T, 3) places of the root, of (T, 3) points in centimetres by joint."""
    hips, chest = (at["left_hip"] + at["right_hip"]) / 2, (at["left_shoulder"] + at["right_shoulder"]) / 2
    pelvis = _facing(at["left_hip"] - at["right_hip"], chest - hips)
    thorax = _facing(at["left_shoulder"] - at["right_shoulder"], chest - hips)
    spine = _turned(pelvis, UP, chest - hips)
    # The neck's place in the thorax is constant, so that the head's direction from it is exact and its place nearly so.
    neck_cm = np.median(rotate(conjugate(thorax), at["neck"] - chest), axis=0)
    neck_at = chest + rotate(thorax, neck_cm)
    neck = _turned(thorax, UP, at["head"] - neck_at)
    bones = [
        _Bone("Hips", "", np.zeros(3), pelvis),
        _Bone("Spine", "Hips", np.zeros(3), spine),
        _Bone("Spine1", "Spine", UP * _length(chest - hips), thorax),
        _Bone("Neck", "Spine1", neck_cm, neck),
        _Bone("Head", "Neck", UP * _length(at["head"] - neck_at), neck),
    ]
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        low = side.lower()
        half_shoulders = _length(at["left_shoulder"] - at["right_shoulder"]) / 2
        half_hips = _length(at["left_hip"] - at["right_hip"]) / 2
        arm = [at[f"{low}_{part}"] for part in ("shoulder", "elbow", "hand")]
        leg = [at[f"{low}_{part}"] for part in ("hip", "knee", "foot")]
        outwards = sign * LEFT
        arm_names, leg_names = (f"{side}Arm", f"{side}ForeArm", f"{side}Hand"), (f"{side}UpLeg", f"{side}Leg", f"{side}Foot")
        bones += _limb(arm_names, "Spine1", outwards * half_shoulders, arm, outwards, thorax)
        bones += _limb(leg_names, "Hips", outwards * half_hips, leg, DOWN, pelvis)
    return bones, hips


def _limb(
    names: tuple[str, str, str],
    parent: str,
    offset_cm: np.ndarray,
    points: list[np.ndarray],
    rest: np.ndarray,
    base: np.ndarray,
) -> list[_Bone]:
    """The three bones of an arm or a leg.

    Args:
        names: of its joints in the file, the first at the trunk.
        parent: the bone that carries it.
        offset_cm: (3,) place of the first joint in the parent's axes.
        points: (T, 3) places of its joints in centimetres.
        rest: (3,) direction of the limb in the rest pose.
        base: (T, 4) world rotations of the parent.
    """
    first, second, third = points
    upper = _turned(base, rest, second - first)
    lower = _turned(upper, rest, third - second)
    return [
        _Bone(names[0], parent, offset_cm, upper),
        _Bone(names[1], names[0], rest * _length(second - first), lower),
        _Bone(names[2], names[1], rest * _length(third - second), lower),
    ]


def _length(vectors: np.ndarray) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=-1)))


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; where one is (nearly) zero, the last that is not."""
    lengths = np.linalg.norm(vectors, axis=-1)
    good = lengths > 1e-6
    if not good.any():
        raise InputError("hips or shoulders, or two joints of a limb, lie in one point in every frame: no skeleton for BVH")
    last = np.maximum.accumulate(np.where(good, np.arange(len(good)), -1))
    last = np.where(last < 0, np.argmax(good), last)
    return vectors[last] / lengths[last, None]


def _facing(left: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(T, 4) rotations whose x axis points to the left exactly, and whose y axis is as near to `up` as that allows."""
    x = _unit(left)
    z = _unit(np.cross(x, up))
    axes = np.stack([x, np.cross(z, x), z], axis=-1)
    return Rotation.from_matrix(axes).as_quat(scalar_first=True)


def _turned(base: np.ndarray, rest: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(T, 4) world rotations that take `rest` to a direction, turned as little as possible from those of the parent."""
    start, end = rotate(base, np.broadcast_to(rest, direction.shape)), _unit(direction)
    cosine = np.einsum("ti,ti->t", start, end)
    swing = np.concatenate([1 + cosine[:, None], np.cross(start, end)], axis=1)
    opposite = cosine < -1 + 1e-9
    if opposite.any():  # half a turn about any axis across the limb
        across = np.cross(start[opposite], np.where(np.abs(start[opposite, :1]) < 0.9, LEFT, UP))
        swing[opposite] = np.concatenate([np.zeros((len(across), 1)), across], axis=1)
    return multiply(swing / np.linalg.norm(swing, axis=1, keepdims=True), base)


def _resampled(channels: np.ndarray, times_s: np.ndarray, interval_s: float) -> np.ndarray:
    """The frames nearest to even times: BVH knows one interval only."""
    even_s = times_s[0] + interval_s * np.arange(round((times_s[-1] - times_s[0]) / interval_s) + 1)
    return channels[np.rint(np.interp(even_s, times_s, np.arange(len(times_s)))).astype(int)]


def _children(bones: list[_Bone], name: str) -> list[_Bone]:
    return [bone for bone in bones if bone.parent == name]


def _walk(bones: list[_Bone], name: str = "") -> list[_Bone]:
    """The bones in the order of the file: each followed by all below it."""
    return [one for bone in _children(bones, name) for one in (bone, *_walk(bones, bone.name))]


def _hierarchy(bones: list[_Bone], parent: str, depth: int) -> list[str]:
    """The lines that describe the bones below one."""
    lines = []
    indent = "  " * depth
    for bone in _children(bones, parent):
        place = "Xposition Yposition Zposition " if not parent else ""
        lines += [
            f"{indent}{'JOINT' if parent else 'ROOT'} {bone.name}",
            indent + "{",
            f"{indent}  OFFSET {_numbers(bone.offset_cm)}",
            f"{indent}  CHANNELS {6 if not parent else 3} {place}Zrotation Xrotation Yrotation",
        ]
        below = _hierarchy(bones, bone.name, depth + 1)
        end = [f"{indent}  End Site", indent + "  {", f"{indent}    OFFSET {_numbers(_end_cm(bone))}", indent + "  }"]
        lines += [*(below or end), indent + "}"]
    return lines


def _end_cm(bone: _Bone) -> np.ndarray:
    """Where a bone without children ends."""
    if bone.name == "Head":
        return CROWN_CM * UP
    return (HAND_CM if bone.name.endswith("Hand") else TOE_CM) * bone.offset_cm / max(np.linalg.norm(bone.offset_cm), 1e-6)


def _numbers(vector: np.ndarray) -> str:
    return " ".join(f"{one:.4f}" for one in vector)
