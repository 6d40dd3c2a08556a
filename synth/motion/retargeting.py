"""BVH files as users have them, put on the canonical skeleton.

Only rotations and the path of the hips are taken; bone lengths come from the body that later wears the motion.

What is wrong with the popular cgspeed conversion of the CMU recordings is put right:

- It lost every bone that branches: the thorax, and of each forearm the last third. Lengths do not matter here, but its
  "LeftHand" is that last third, and "LeftFingerBase" is the hand.
- Its first frame is no recording but the T-pose, which says how feet and neck rest. It is used so, and dropped.
- Subjects 60 and 61 were recorded at 60 frames a second and the files say 120: told by the file's name; `fps` overrides
  the rate of any other file.
"""

import itertools
import logging
import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.errors import InputError
from synth.motion.bvh import BvhFile, read_bvh
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

# Names of a side's limbs in the customs that are met: clavicle, upper arm, forearm, hand, thigh, shin, foot, toes.
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

# Hip to ankle of an adult in each unit that files are met in; the ranges do not overlap.
_LEG_RANGES = {
    "metres": 1.0,
    "inches": 0.0254,
    "centimetres": 0.01,
    "millimetres": 0.001,
    "CMU's 5.64 cm": 0.0254 / 0.45,
}
_LEG_LEAST_M, _LEG_MOST_M = 0.6, 1.15


def bvh_motion(path: Path, fps: float | None = None) -> Motion:
    """A BVH file as a motion of the canonical skeleton.

    Joints are found by name (MotionBuilder and CMU, Mixamo, LAFAN, SMPL, Poser, Biped, Unreal, Unity, Rigify), the
    spine and the neck by the chain between hips, arms and head. The T-pose is made from the file's rest offsets: upper
    arm, forearm and hand are turned onto +-X, thigh and shin onto -Y, each by the smallest rotation after the one
    before it in the limb. The floor is put under the body where it is lowest (3rd percentile over the frames).

    Args:
        path: The file.
        fps: Frames per second, for a file that states it wrongly; None trusts it (but for CMU's subjects 60 and 61).

    Raises:
        InputError: if the file is malformed, or a joint that cannot be done without is not found.
    """
    path = Path(path)
    bvh = read_bvh(path)
    found = _find_joints(bvh, path)
    rest = np.zeros((len(bvh.names), 3))
    for joint, parent in enumerate(bvh.parents):
        if parent >= 0:
            rest[joint] = rest[parent] + bvh.offsets[joint]
    to_canonical = _canonical_frame(rest, found, path)

    # World rotations away from the file's rest pose, seen in canonical axes.
    turned = np.empty_like(bvh.quats)
    for joint, parent in enumerate(bvh.parents):
        turned[:, joint] = bvh.quats[:, joint] if parent < 0 else multiply(turned[:, parent], bvh.quats[:, joint])
    turned = multiply(multiply(to_canonical, turned), conjugate(to_canonical))
    rest = rotate(to_canonical, rest)

    t_pose = turned[0] if _opens_with_t_pose(bvh, turned[0], rest, found) else None
    root = bvh.root
    if t_pose is not None:
        log.info("%s: the first frame is the T-pose, not a recording; left out", path.name)
        turned, root = turned[1:], root[1:]

    world = np.empty((len(turned), NUM_JOINTS, 4))
    for j, name in enumerate(JOINT_NAMES):
        if name in found:
            world[:, j] = multiply(turned[:, found[name]], conjugate(_alignment(name, found, rest, t_pose)))
        else:
            world[:, j] = world[:, PARENTS[j]]
    local = world.copy()
    local[:, 1:] = multiply(conjugate(world[:, PARENTS[1:NUM_JOINTS]]), world[:, 1:])

    leg = sum(
        np.linalg.norm(rest[found[f"Left{b}"]] - rest[found[f"Left{a}"]])
        for a, b in (("UpLeg", "Leg"), ("Leg", "Foot"))
    )
    metres = _unit(float(leg), path)
    root_m = rotate(to_canonical, root) * metres
    # Files have the floor where they like: the body is on it at its lowest, but for a glitch now and then.
    size = LEG_M / (float(leg) * metres)
    root_m[:, 1] -= np.percentile(height_above_floor(local, root_m * size), 3) / size
    rate = fps if fps is not None else _frame_rate(bvh.fps, path)
    return Motion(local.astype(np.float32), root_m.astype(np.float32), rate, f"bvh:{path.stem}", float(leg) * metres)


def _frame_rate(stated: float, path: Path) -> float:
    # CMU's own table has subjects 60 and 61 at 60 frames a second; cgspeed's files say 120.
    if re.match(r"^6[01]_\d+", path.stem) and stated > 100:
        log.info(
            "%s says %.0f frames a second but CMU recorded subjects 60 and 61 at 60: read as 60", path.name, stated
        )
        return 60.0
    return stated


def _unit(leg: float, path: Path) -> float:
    for unit, metres in _LEG_RANGES.items():
        if _LEG_LEAST_M <= leg * metres <= _LEG_MOST_M:
            log.info("%s: a leg of %.4g reads as %s", path.name, leg, unit)
            return metres
    log.warning("%s: a leg of %.4g fits no unit of length; taken for the mean adult's %.2f m", path.name, leg, LEG_M)
    return LEG_M / leg


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", re.sub(r"^bip\d*|^mixamorig\d*", "", name.split(":")[-1].lower().strip()))


def _find_joints(bvh: BvhFile, path: Path) -> dict[str, int]:
    """Canonical name to the index of the joint in the file."""
    by_name: dict[str, int] = {}
    for i, name in enumerate(bvh.names):
        by_name.setdefault(_plain(name), i)

    def limbs(custom: str) -> dict[str, int]:
        names = {}
        for side in ("Left", "Right"):
            for part, pattern in zip(_LIMB, custom.split(), strict=True):
                for word in (side.lower(), side[0].lower()):
                    if (joint := by_name.get(pattern.format(word))) is not None:
                        names.setdefault(side + part, joint)
        return names

    found = max((limbs(custom) for custom in _LIMB_NAMES), key=len)
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
            f"all joints: {', '.join(bvh.names)}. "
            "Rename the joints as MotionBuilder or Mixamo name them"
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
            f"{path}: no spine joint between {bvh.names[hips]} and the arms; all joints: {', '.join(bvh.names)}"
        )
    spine = trunk[trunk.index(hips) + 1 :]
    neck = to_head[to_head.index(spine[-1]) + 1 : -1]
    # The last vertebral joint carries the arms, the first one stands on the hips; the middle one lies between.
    found |= {"LowerBack": spine[0], "Spine": spine[(len(spine) - 1) // 2], "Spine1": spine[-1], "Head": to_head[-1]}
    if neck:
        found |= {"Neck": neck[0], "Neck1": neck[-1]}
    return found


def _canonical_frame(rest: np.ndarray, found: dict[str, int], path: Path) -> np.ndarray:
    """Quaternion from the file's axes to X left, Y up, Z front: the nearest turn by right angles."""
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


_LIMB_AXES = {  # joint and the one after it: where the bone points in the T-pose
    ("LeftArm", "LeftForeArm"): (1.0, 0.0, 0.0),
    ("RightArm", "RightForeArm"): (-1.0, 0.0, 0.0),
    ("LeftUpLeg", "LeftLeg"): (0.0, -1.0, 0.0),
    ("RightUpLeg", "RightLeg"): (0.0, -1.0, 0.0),
    ("LeftLeg", "LeftFoot"): (0.0, -1.0, 0.0),
    ("RightLeg", "RightFoot"): (0.0, -1.0, 0.0),
}


def _opens_with_t_pose(bvh: BvhFile, turned: np.ndarray, rest: np.ndarray, found: dict[str, int]) -> bool:
    """Whether frame 0 is a T-pose put before the recording: hips unturned, limbs straight, where frame 1 is."""
    if len(bvh.root) < 2 or (bvh.root[0] != bvh.root[1]).any() or abs(turned[found["Hips"], 0]) < 1 - 1e-9:
        return False
    for (joint, end), axis in _LIMB_AXES.items():
        bone = rotate(turned[found[joint]], rest[found[end]] - rest[found[joint]])
        if bone @ np.array(axis) < np.cos(np.deg2rad(12)) * np.linalg.norm(bone):
            return False
    return not np.array_equal(bvh.quats[0], bvh.quats[1])


def _alignment(name: str, found: dict[str, int], rest: np.ndarray, t_pose: np.ndarray | None) -> np.ndarray:
    """The rotation that brings a bone from the file's rest pose to the T-pose.

    The hand goes on as the forearm. Feet, toes and the trunk are as in the T-pose that the file opens with, if it has
    one (world rotations (J, 4)); else they stay as they rest.
    """
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    side = "Left" if name.startswith("Left") else "Right"
    part = name.removeprefix(side)
    if part in ("Arm", "ForeArm", "Hand"):
        limb, target = ("Arm", "ForeArm", "Hand"), np.array([1.0 if side == "Left" else -1.0, 0.0, 0.0])
    elif part in ("UpLeg", "Leg"):
        limb, target = ("UpLeg", "Leg", "Foot"), np.array([0.0, -1.0, 0.0])
    else:
        return turn if t_pose is None else t_pose[found[name]]
    for bone, end in itertools.pairwise(limb):
        direction = rotate(turn, rest[found[side + end]] - rest[found[side + bone]])
        turn = multiply(_smallest_turn(direction, target), turn)
        if bone == part:
            break
    return turn


def _smallest_turn(direction: np.ndarray, target: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(direction)
    if length < 1e-9:
        return np.array([1.0, 0, 0, 0])
    unit = direction / length
    turn = np.concatenate([[1.0 + unit @ target], np.cross(unit, target)])
    size = np.linalg.norm(turn)
    # Straight against the target any axis across serves; the front keeps elbows and knees bending the right way.
    return turn / size if size > 1e-6 else np.array([0.0, 0, 0, 1.0])
