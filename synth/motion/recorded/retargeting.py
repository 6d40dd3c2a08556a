"""Retargets BVH files to the canonical skeleton.

Only the rotations and the path of the hips are used. Bone lengths come from the body that performs the motion.

Three defects of the popular cgspeed conversion of the CMU recordings are corrected:

- It lost every bone that branches: the thorax, and the last third of each forearm. Bone lengths do not matter here, but
  its "LeftHand" is that last third of the forearm, and its "LeftFingerBase" is the hand.
- Its first frame is not recorded but the T-pose. It defines the rest orientation of feet and neck, and is then dropped.
- Subjects 60 and 61 were recorded at 60 frames per second but the files state 120. These files are recognised by name;
  `fps` overrides the rate of any other file.
"""

import itertools
import logging
import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.errors import InputError
from synth.motion.recorded.bvh import BvhFile, read_bvh
from synth.motion.skeleton import (
    JOINT_NAMES,
    LEG_M,
    NUM_JOINTS,
    PARENTS,
    Motion,
    conjugate,
    height_above_floor,
    multiply,
    rotate,
)

log = logging.getLogger(__name__)

# Names of the joints of one side in common naming conventions: clavicle, upper arm, forearm, hand, thigh, shin, foot, toes.
# Compared without case, separators and namespace; {} is left or right, or its first letter.
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
)
_LIMB = ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase")
_OPTIONAL = ("Shoulder", "ToeBase")
_HIPS = ("hips", "hip", "pelvis", "root")

# Metres per unit for the units that occur in files. The leg lengths of adults in these units do not overlap.
_UNITS_M = {
    "metres": 1.0,
    "inches": 0.0254,
    "centimetres": 0.01,
    "millimetres": 0.001,
    "CMU's 5.64 cm": 0.0254 / 0.45,
}
_MIN_LEG_M, _MAX_LEG_M = 0.6, 1.15


def bvh_motion(path: Path, fps: float | None = None) -> Motion:
    """Reads a BVH file as a motion of the canonical skeleton.

    Joints are found by name (MotionBuilder and CMU, Mixamo, LAFAN, SMPL, Poser, Biped, Unreal, Unity, Rigify), the spine
    and the neck by the chain between hips, arms and head. The T-pose is computed from the file's rest offsets: upper arm,
    forearm and hand are rotated onto +-X, thigh and shin onto -Y, each by the smallest rotation after that of the previous
    bone of the limb. The floor is at the 3rd percentile, over the frames, of the height of the body's lowest point.

    Args:
        path: the file.
        fps: frames per second of a file that states a wrong rate; None trusts the file (except for CMU's subjects 60 and
            61).

    Returns:
        The motion; its root and leg length are in metres of the recorded person.

    Raises:
        InputError: the file is malformed, or a required joint is not found.
    """
    path = Path(path)
    bvh = read_bvh(path)
    found = _find_joints(bvh, path)
    rest = np.zeros((len(bvh.names), 3))
    for joint, parent in enumerate(bvh.parents):
        if parent >= 0:
            rest[joint] = rest[parent] + bvh.offsets[joint]
    to_canonical = _canonical_frame(rest, found, path)

    # World rotations relative to the file's rest pose, in canonical axes.
    rotated = np.empty_like(bvh.quats)
    for joint, parent in enumerate(bvh.parents):
        rotated[:, joint] = bvh.quats[:, joint] if parent < 0 else multiply(rotated[:, parent], bvh.quats[:, joint])
    rotated = multiply(multiply(to_canonical, rotated), conjugate(to_canonical))
    rest = rotate(to_canonical, rest)

    t_pose = rotated[0] if _opens_with_t_pose(bvh, rotated[0], rest, found) else None
    root = bvh.root
    if t_pose is not None:
        log.info("%s: the first frame is the T-pose, not recorded; dropped", path.name)
        rotated, root = rotated[1:], root[1:]

    world = np.empty((len(rotated), NUM_JOINTS, 4))
    for j, name in enumerate(JOINT_NAMES):
        if name in found:
            world[:, j] = multiply(rotated[:, found[name]], conjugate(_alignment(name, found, rest, t_pose)))
        else:
            world[:, j] = world[:, PARENTS[j]]
    local = world.copy()
    local[:, 1:] = multiply(conjugate(world[:, PARENTS[1:NUM_JOINTS]]), world[:, 1:])

    leg = sum(np.linalg.norm(rest[found[f"Left{b}"]] - rest[found[f"Left{a}"]]) for a, b in (("UpLeg", "Leg"), ("Leg", "Foot")))
    metres = _unit(float(leg), path)
    root_m = rotate(to_canonical, root) * metres
    # The height of the floor differs between files. The lowest frames touch the floor; the percentile ignores outliers.
    size = LEG_M / (float(leg) * metres)
    root_m[:, 1] -= np.percentile(height_above_floor(local, root_m * size), 3) / size
    rate = fps if fps is not None else _frame_rate(bvh.fps, path)
    if not 1 <= rate <= 1000:
        raise InputError(f"{path}: states {rate:g} frames a second; give the true rate with motion.fps, 1 to 1000")
    return Motion(local.astype(np.float32), root_m.astype(np.float32), rate, f"bvh:{path.stem}", float(leg) * metres)


def _frame_rate(stated: float, path: Path) -> float:
    """The true frame rate. CMU's table lists subjects 60 and 61 at 60 frames per second; cgspeed's files state 120."""
    if re.match(r"^6[01]_\d+", path.stem) and stated > 100:
        log.info("%s states %.0f frames a second but CMU recorded subjects 60 and 61 at 60: read as 60", path.name, stated)
        return 60.0
    return stated


def _unit(leg: float, path: Path) -> float:
    """Metres per unit of the file, from its leg length."""
    if leg < 1e-3:
        raise InputError(f"{path}: the rest offsets make a leg of {leg:g}; expected a person's in any unit of length")
    for unit, metres in _UNITS_M.items():
        if _MIN_LEG_M <= leg * metres <= _MAX_LEG_M:
            log.info("%s: a leg of %.4g is in %s", path.name, leg, unit)
            return metres
    log.warning("%s: a leg of %.4g fits no unit of length; scaled to the mean adult's %.2f m", path.name, leg, LEG_M)
    return LEG_M / leg


def _plain(name: str) -> str:
    """A joint name without case, separators, namespace and the prefixes of Biped and Mixamo."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"^bip\d*|^mixamorig\d*", "", name.rsplit(":", maxsplit=1)[-1].lower().strip()))


def _find_joints(bvh: BvhFile, path: Path) -> dict[str, int]:
    """Index in the file of each canonical joint, by canonical name.

    Raises:
        InputError: a required joint is not found.
    """
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
    needed = [side + part for side in ("Left", "Right") for part in _LIMB if part not in _OPTIONAL]
    missing = [name for name in needed if name not in found]
    if "head" not in by_name:
        missing.append("Head")
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


_LIMB_AXES = {  # joint and next joint of the limb: direction of the bone in the T-pose
    ("LeftArm", "LeftForeArm"): (1.0, 0.0, 0.0),
    ("RightArm", "RightForeArm"): (-1.0, 0.0, 0.0),
    ("LeftUpLeg", "LeftLeg"): (0.0, -1.0, 0.0),
    ("RightUpLeg", "RightLeg"): (0.0, -1.0, 0.0),
    ("LeftLeg", "LeftFoot"): (0.0, -1.0, 0.0),
    ("RightLeg", "RightFoot"): (0.0, -1.0, 0.0),
}


def _opens_with_t_pose(bvh: BvhFile, rotated: np.ndarray, rest: np.ndarray, found: dict[str, int]) -> bool:
    """Whether frame 0 is a T-pose before the recording: unrotated hips, straight limbs, the position of frame 1."""
    if len(bvh.root) < 2 or (bvh.root[0] != bvh.root[1]).any() or abs(rotated[found["Hips"], 0]) < 1 - 1e-9:
        return False
    for (joint, end), axis in _LIMB_AXES.items():
        bone = rotate(rotated[found[joint]], rest[found[end]] - rest[found[joint]])
        if bone @ np.array(axis) < np.cos(np.deg2rad(12)) * np.linalg.norm(bone):
            return False
    return not np.array_equal(bvh.quats[0], bvh.quats[1])


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
