"""BVH recordings of any common naming of joints, upright and in metres: rotations of the bones, path of the hips, joints.

Three defects of the popular cgspeed conversion of the CMU recordings are corrected:

- It lost every bone that branches: the thorax, and the last third of each forearm. Its "LeftHand" is that last third of the
  forearm, and its "LeftFingerBase" is the hand.
- Its first frame is not recorded but the T-pose. It is dropped.
- Subjects 60 and 61 were recorded at 60 frames per second but the files state 120. These files are recognised by name;
  `fps` overrides the rate of any other file.
"""

import logging
import re
import unicodedata
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.bvh import BvhFile, read_bvh
from kpopnet.dance.joint_files.points import NamedPoints
from kpopnet.errors import InputError
from kpopnet.rotations import conjugate, multiply, rotate

log = logging.getLogger(__name__)

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

_HIPS, _DOWN = ("hips", "hip", "pelvis", "center", "root"), (0.0, -1.0, 0.0)

_UNITS_M = {"metres": 1.0, "inches": 0.0254, "centimetres": 0.01, "millimetres": 0.001, "CMU's 5.64 cm": 0.0254 / 0.45}
"""Metres per unit for the units that occur in files. The leg lengths of adults in these units do not overlap."""

_MIN_LEG_M, _MAX_LEG_M, _MEAN_LEG_M = 0.6, 1.15, 0.8529
"""Lengths of the legs of adults; the mean is that of synth's."""


@dataclass(frozen=True)
class BvhMotion:
    """A recording in axes of its rest pose: X the subject's left, Y up, Z the front.

    Attributes:
        found: index in the file of each recognised joint, by MotionBuilder's name.
        parents: index of each joint's parent, -1 for the root.
        rest: (J, 3) positions of the joints in the rest pose, in the file's unit.
        rotated: (T, J, 4) world rotations relative to the rest pose, w, x, y, z.
        root_m: (T, 3) position of the root.
        t_pose: (J, 4) world rotations of the T-pose that the file opened with, if it did.
        leg_m: length from hip through knee to ankle.
        metres: per unit of the file.
    """

    found: dict[str, int]
    parents: list[int]
    rest: np.ndarray
    rotated: np.ndarray
    root_m: np.ndarray
    t_pose: np.ndarray | None
    fps: float
    leg_m: float
    metres: float


def read_bvh_motion(path: Path, fps: float | None = None) -> BvhMotion:
    """Reads a BVH file, finds its joints, its unit and its axes; `fps` is the true rate of a file that states a wrong one."""
    bvh = read_bvh(path)
    found = _find_joints(bvh, path)
    # World rotations relative to the file's rest pose; then both in canonical axes.
    rest, rotated = np.zeros((len(bvh.names), 3)), bvh.quats.copy()
    for joint, parent in enumerate(bvh.parents[1:], 1):
        rest[joint] = rest[parent] + bvh.offsets[joint]
        rotated[:, joint] = multiply(rotated[:, parent], bvh.quats[:, joint])
    to_canonical = _canonical_frame(rest, found, path)
    rotated = multiply(multiply(to_canonical, rotated), conjugate(to_canonical))
    rest = rotate(to_canonical, rest)

    t_pose = rotated[0] if _opens_with_t_pose(bvh, rotated[0], rest, found) else None
    root = bvh.root
    if t_pose is not None:
        log.info("%s: the first frame is the T-pose, not recorded; dropped", path.name)
        rotated, root = rotated[1:], root[1:]
    leg = sum(np.linalg.norm(rest[found[f"Left{b}"]] - rest[found[f"Left{a}"]]) for a, b in (("UpLeg", "Leg"), ("Leg", "Foot")))
    metres = _unit(float(leg), path)
    if fps is None and re.match(r"^6[01]_\d+", path.stem) and bvh.fps > 100:
        log.info("%s states %.0f frames a second but CMU recorded subjects 60 and 61 at 60: read as 60", path.name, bvh.fps)
        fps = 60.0
    rate = bvh.fps if fps is None else fps
    if not 1 <= rate <= 1000:
        raise InputError(f"{path}: states {rate:g} frames a second; give the true rate, fps, 1 to 1000")
    root_m = rotate(to_canonical, root) * metres
    return BvhMotion(found, bvh.parents, rest, rotated, root_m, t_pose, rate, float(leg) * metres, metres)


_POINTS = {
    **{f"{side}{point}": f"{side}{joint}" for side in ("Left", "Right") for point, joint in (
        ("Shoulder", "Arm"), ("Elbow", "ForeArm"), ("Wrist", "Hand"), ("Hip", "UpLeg"), ("Knee", "Leg"), ("Ankle", "Foot"),
        ("Foot", "ToeBase"),
    )},
    "Head": "Head", "Neck": "Neck",
}  # fmt: skip
"""Our names of points to MotionBuilder's names of the joints that lie there. A clavicle, "Shoulder", begins at the neck."""


def bvh_points(motion: BvhMotion) -> NamedPoints:
    """The joints of a recorded skeleton by the names of points, metres, y up."""
    names = [name for name, joint in _POINTS.items() if joint in motion.found]
    columns = [motion.found[_POINTS[name]] for name in names]
    return NamedPoints(names, bvh_points_m(motion)[:, columns], fps=motion.fps)


def bvh_points_m(motion: BvhMotion) -> np.ndarray:
    """(T, J, 3) positions in metres of all joints of the recorded skeleton, by forward kinematics."""
    points_m = np.repeat(motion.root_m[:, None], len(motion.parents), axis=1)
    for joint, parent in enumerate(motion.parents[1:], 1):
        offset_m = motion.metres * (motion.rest[joint] - motion.rest[parent])
        points_m[:, joint] = points_m[:, parent] + rotate(motion.rotated[:, parent], offset_m)
    return points_m


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


def _plain(name: str) -> str:
    """A joint name in English, without case, separators, namespace and the prefixes of Biped, Mixamo and VRoid."""
    name = unicodedata.normalize("NFKC", name)
    if match := re.fullmatch(f"(左|右)?({'|'.join(_JAPANESE)})", name.strip()):
        return _JAPANESE[match[2]] + {"左": "left", "右": "right", None: ""}[match[1]]
    return re.sub(
        r"[^a-z0-9]", "", re.sub(r"^j_bip_(c_)?|^bip\d*|^mixamorig\d*", "", name.rsplit(":", maxsplit=1)[-1].lower().strip())
    )


def _find_joints(bvh: BvhFile, path: Path) -> dict[str, int]:
    """Index in the file of each joint: limbs by name, spine and neck by the chain between hips, arms and head."""
    by_name: dict[str, int] = {}
    for i, name in enumerate(bvh.names):
        by_name.setdefault(_plain(name), i)

    def limbs(convention: str) -> dict[str, int]:
        names = {}
        for side in ("Left", "Right"):
            for part, pattern in zip(_LIMB, convention.split(), strict=True):
                for word in (side.lower(), side[0].lower()):
                    if (joint := by_name.get(pattern.format(word))) is not None:
                        names.setdefault(side + part, joint)
        return names

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
            f"Recognised: {', '.join(f'{name} = {bvh.names[i]}' for name, i in found.items())}; "
            f"all joints: {', '.join(bvh.names[:100])}. "
            "Rename the joints to MotionBuilder's or Mixamo's names"
        )

    def chain(joint: int) -> list[int]:
        up = [joint]
        while bvh.parents[up[-1]] >= 0:
            up.append(bvh.parents[up[-1]])
        return up[::-1]

    to_left, to_right, to_head = (chain(i) for i in (found["LeftArm"], found["RightArm"], by_name["head"]))
    trunk = [i for i in to_left if i in to_right and i in to_head]
    if hips not in trunk or len(trunk) == trunk.index(hips) + 1:
        raise InputError(
            f"{path}: no spine joint between {bvh.names[hips]} and the arms; all joints: {', '.join(bvh.names[:100])}"
        )
    spine = trunk[trunk.index(hips) + 1 :]
    neck = to_head[to_head.index(spine[-1]) + 1 : -1]
    # The first vertebral joint is above the hips, the last one carries the arms; Spine is the middle one.
    found |= {"LowerBack": spine[0], "Spine": spine[(len(spine) - 1) // 2], "Spine1": spine[-1], "Head": to_head[-1]}
    if neck:
        found |= {"Neck": neck[0], "Neck1": neck[-1]}
    return found


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
    return Rotation.from_matrix(axes).as_quat(scalar_first=True)


def _opens_with_t_pose(bvh: BvhFile, rotated: np.ndarray, rest: np.ndarray, found: dict[str, int]) -> bool:
    """Whether frame 0 is a T-pose before the recording: unrotated hips, straight limbs, the position of frame 1."""
    if len(bvh.root) < 2 or (bvh.root[0] != bvh.root[1]).any() or abs(rotated[found["Hips"], 0]) < 1 - 1e-9:
        return False
    for side, left in (("Left", 1.0), ("Right", -1.0)):
        for joint, end, axis in (("Arm", "ForeArm", (left, 0.0, 0.0)), ("UpLeg", "Leg", _DOWN), ("Leg", "Foot", _DOWN)):
            bone = rotate(rotated[found[side + joint]], rest[found[side + end]] - rest[found[side + joint]])
            if bone @ np.array(axis) < np.cos(np.deg2rad(12)) * np.linalg.norm(bone):
                return False
    return not np.array_equal(bvh.quats[0], bvh.quats[1])
