"""Poses the teacher's body after fifteen joints: for dances that are known by their joints alone, and for the learner's replay.

Each bone is turned by the smallest rotation, after its parent, that gives it the direction of the joints at its ends; then
about itself, so that elbows and knees bend as hinges do. Collarbones follow the arms, and a foot near the floor is level. What
fifteen joints do not show (the twist of a straight limb, hands) stays as at rest.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.bvh import BvhFile, bvh_text
from kpopnet.dance.performance import MAX_GAP_S, TIME_TOLERANCE_S, Performance
from kpopnet.errors import InputError
from kpopnet.rotations import conjugate, continuous, multiply
from kpopnet.skeleton import Joint
from kpopnet.teacher.library import TeacherBody, without_gaps

TO_WORLD = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).T
"""Multiplies row vectors in a level camera's frame (x right, y down, z forward): x right, y forward, z up."""

_LIMBS = tuple(
    (side, upper, lower, [getattr(Joint, f"{side.upper()}_{name}") for name in joints], np.array(axis))
    for side, outwards in (("Left", 1.0), ("Right", -1.0))
    for upper, lower, joints, axis in (
        ("Arm", "ForeArm", ("SHOULDER", "ELBOW", "HAND"), (0.0, 0.0, -outwards)),
        ("UpLeg", "Leg", ("HIP", "KNEE", "FOOT"), (1.0, 0.0, 0.0)),
    )
)
"""Side, the two bones, the joints at their ends, and the axis in the T-pose about which the lower one bends: a forearm
forwards, a shin backwards."""

STRAIGHT, BENT = 0.2, 0.5
"""Sines of the bend up to which a limb is too straight to show its hinge, and from which on it shows it."""

COLLARBONE_FROM_RAD, COLLARBONE_LIFT, COLLARBONE_REACH = np.radians(40), 0.22, 0.12
"""From which angle on a collarbone follows an arm that is lifted, its share of that, and of the angle by which the arm reaches
forwards: as in `synth.motion.posture`."""

TURNED_OUT_RAD = np.radians(7)
"""How far straight legs turn outwards: as far as a standing person's feet."""

SPINE = {"LowerBack": 1 / 3, "Spine": 2 / 3, "Spine1": 1.0}
"""Share of the rotation from hips to chest that each bone of the spine has reached."""

TO_Y_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Multiplies row vectors: from z up and -y in front to y up and z in front."""

BVH_END_M = np.array([0, 0.08, 0])
"""Where a bone without children ends in BVH."""

MAX_S, LAST_IMAGE_S = 900.0, 1.0
"""Longest dance, seconds, and how much later the last image of a lesson may be."""

FLOOR_PERCENTILE = 10
"""Of the lower foot's height over a dance: where the floor is."""

LEVEL_M, LIFTED_M = 0.03, 0.18
"""A foot up to so high above where it stands is level, from so high on it hangs at the shin as at rest."""


def posed(joints_m: np.ndarray, body: TeacherBody) -> tuple[np.ndarray, np.ndarray]:
    """(T, B, 4) float32 rotations of a body's bones and (T, 3) float32 positions of its root for a dance, as in `Movement`.

    From (T, 15, 3) joints in metres in a camera's frame, NaN where missing; a gap is bridged in time. The body's own
    proportions stay; its root starts above the origin.
    """
    world_m = without_gaps(np.asarray(joints_m, np.float64)) @ TO_WORLD
    rotations = _world_rotations(world_m, body)
    quats = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(*rotations.shape[:2], 4)
    local = quats.copy()
    for bone, parent in enumerate(body.bone_parents):
        if parent >= 0:
            local[:, bone] = multiply(conjugate(quats[:, parent]), quats[:, bone])
    return continuous(local).astype(np.float32), _root_m(world_m, rotations, body).astype(np.float32)


class Movement(NamedTuple):
    """What a body does."""

    quats: np.ndarray  # (T, B, 4) rotations of the bones relative to their parents, w first
    hips_m: np.ndarray  # (T, 3) positions of the root, metres
    fps: float  # frames per second
    begin_s: float = 0.0  # time of the first frame in the dance, seconds

    def frame(self, time_s: float) -> int:
        """The frame nearest to a time of the dance."""
        return int(np.clip(round((time_s - self.begin_s) * self.fps), 0, len(self.quats) - 1))


def learners_movement(learner: Performance, fps: float, body: TeacherBody) -> Movement:
    """A learner's movement on the teacher's body, at a constant rate; raises as `at_rate`."""
    return Movement(*posed(at_rate(learner, fps), body), fps, float(learner.times_s[0]))


def at_rate(performance: Performance, fps: float, begin_s: float | None = None, end_s: float | None = None) -> np.ndarray:
    """(T, 15, 3) float32 joints of a performance at a constant rate: those of the nearest frames.

    They are NaN within gaps between frames that are longer than those that a score closes (MAX_GAP_S).

    From its first frame on to its last, unless other times within it are given, in seconds. Raises InputError if it lasts more
    than MAX_S, and LAST_IMAGE_S.
    """
    begin_s = performance.times_s[0] if begin_s is None else begin_s
    end_s = performance.times_s[-1] if end_s is None else end_s
    if not end_s - begin_s <= MAX_S + LAST_IMAGE_S:
        raise InputError(f"a recording of {end_s - begin_s:.1f} s; a dance lasts at most {MAX_S:g} s")
    times_s = np.arange(begin_s, max(end_s, begin_s + 0.5 / fps), 1 / fps)  # one frame at least
    after = np.clip(np.searchsorted(performance.times_s, times_s), 1, len(performance) - 1)
    since_s, until_s = times_s - performance.times_s[after - 1], performance.times_s[after] - times_s
    joints_m = performance.joints_m[after - (since_s < until_s)].astype(np.float32)
    joints_m[(since_s + until_s > MAX_GAP_S + TIME_TOLERANCE_S) & (np.minimum(since_s, until_s) > 0.5 / fps)] = np.nan
    return joints_m


def _world_rotations(joints_m: np.ndarray, body: TeacherBody) -> np.ndarray:
    """(T, B, 3, 3) rotation of each bone from the T-pose."""

    def between(begin: int, end: int) -> np.ndarray:
        return joints_m[:, end] - joints_m[:, begin]

    hips, chest = (
        _frame(*ends(joints_m)) @ _frame(*ends(body.joints_m[None].astype(np.float64)))[0].T for ends in (_pelvis, _chest)
    )
    bones: dict[str, np.ndarray] = {"Hips": hips}
    for name, share in SPINE.items():
        blended = (1 - share) * hips + share * chest
        bones[name] = _frame(blended[..., 0], blended[..., 2])
    head = _swing(chest, _rest_direction(body, "Neck", Joint.NECK, Joint.HEAD), between(Joint.NECK, Joint.HEAD))
    bones |= {"Neck": chest, "Neck1": head, "Head": head}
    for side, upper, lower, (begin, middle, end), hinge in _LIMBS:
        directions = between(begin, middle), between(middle, end)
        turned = _swing(
            bones["Spine1" if upper == "Arm" else "Hips"], _rest_direction(body, side + upper, begin, middle), directions[0]
        )
        if upper == "UpLeg":
            turned = turned @ Rotation.from_euler("z", TURNED_OUT_RAD * (1 if side == "Left" else -1)).as_matrix()
        else:
            bones[f"{side}Shoulder"] = bones["Spine1"] @ _collarbone(
                bones["Spine1"], directions[0], 1 if side == "Left" else -1
            )
        bones[side + upper] = _hinged(turned, hinge, *directions)
        bones[side + lower] = _swing(bones[side + upper], _rest_direction(body, side + lower, middle, end), directions[1])
    feet_m = joints_m[:, [Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 2]
    above_m = feet_m - np.percentile(feet_m.min(axis=1), FLOOR_PERCENTILE)
    for side, lifted in zip(("Left", "Right"), np.clip((above_m - LEVEL_M) / (LIFTED_M - LEVEL_M), 0, 1).T, strict=True):
        shin = bones[f"{side}Leg"]
        bones[f"{side}Foot"] = _frame(shin[..., 0], np.array([0, 0, 1]) + lifted[:, None] * (shin[..., 2] - [0, 0, 1]))
    rotations = np.empty((len(joints_m), len(body.bone_names), 3, 3))
    for number, name in enumerate(body.bone_names.tolist()):
        rotations[:, number] = bones[name] if name in bones else rotations[:, body.bone_parents[number]]
    return rotations


def _pelvis(joints_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 3) directions to the left and up, of (T, 15, 3) joints."""
    left, right = joints_m[:, Joint.LEFT_HIP], joints_m[:, Joint.RIGHT_HIP]
    return left - right, joints_m[:, Joint.TORSO] - (left + right) / 2


def _chest(joints_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same of the chest."""
    return (
        joints_m[:, Joint.LEFT_SHOULDER] - joints_m[:, Joint.RIGHT_SHOULDER],
        joints_m[:, Joint.NECK] - joints_m[:, Joint.TORSO],
    )


def _rest_direction(body: TeacherBody, bone: str, begin: int, end: int) -> np.ndarray:
    """(3,) direction from one joint to another in the T-pose, both moved by one bone."""
    return body.t_pose[body.bone(bone)] @ (body.joints_m[end] - body.joints_m[begin]).astype(np.float64)


def _frame(left: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rotation whose third column is `up`, and whose first is as near to `left` as it can be."""
    z = _unit(up, (0.0, 0.0, 1.0))
    x = _unit(left - (left * z).sum(axis=1, keepdims=True) * z, (1.0, 0.0, 0.0))
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _unit(vectors: np.ndarray, otherwise: tuple[float, float, float]) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-6, vectors / np.maximum(length, 1e-6), otherwise)


def _swing(parent: np.ndarray, rest: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rotations after (T, 3, 3) parents that turn a (3,) rest direction to (T, 3) wanted ones, the shortest way."""
    before = _unit(parent @ rest, (0.0, 0.0, 1.0))
    after = _unit(wanted, (0.0, 0.0, 1.0))
    cross, cosine = np.cross(before, after), (before * after).sum(axis=1)
    skew = np.zeros((len(parent), 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -cross[:, 2], cross[:, 1], -cross[:, 0]
    skew -= skew.transpose(0, 2, 1)
    turn = np.eye(3) + skew + skew @ skew / np.maximum(1 + cosine, 1e-3)[:, None, None]
    left, _, right = np.linalg.svd(turn @ parent)  # orthonormal again
    return left @ right


def _collarbone(chest: np.ndarray, arm: np.ndarray, outwards: int) -> np.ndarray:
    """(T, 3, 3) rotations of a collarbone after the chest: it follows an arm that is lifted or reaches forwards."""
    left, back, up = np.moveaxis(_unit((chest.transpose(0, 2, 1) @ arm[..., None])[..., 0], (0.0, 0.0, -1.0)), -1, 0)
    aside, front = outwards * left, np.maximum(-back, 0)
    raised = COLLARBONE_LIFT * np.maximum(np.arccos(np.clip(-up, -1, 1)) - COLLARBONE_FROM_RAD, 0)
    reached = COLLARBONE_REACH * front * np.maximum(np.arctan2(front, aside), 0)
    return Rotation.from_euler("zy", -outwards * np.stack([reached, raised], axis=1)).as_matrix()


def _hinged(rotations: np.ndarray, axis: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rotations of upper bones, turned about themselves: a (3,) axis of the T-pose comes to the hinge about which the
    lower ones are bent, the nearer the more they are. (T, 3) directions of both.
    """
    along = _unit(upper, (0.0, 0.0, 1.0))
    wanted = np.cross(along, _unit(lower, (0.0, 0.0, 1.0)))
    weight = np.clip((np.linalg.norm(wanted, axis=1) - STRAIGHT) / (BENT - STRAIGHT), 0, 1)
    present = rotations @ axis
    angle = np.arctan2((np.cross(present, wanted) * along).sum(axis=1), (present * wanted).sum(axis=1))
    return Rotation.from_rotvec(along * (weight * angle)[:, None]).as_matrix() @ rotations


def forward(rotations: np.ndarray, body: TeacherBody) -> np.ndarray:
    """(T, B, 3) heads of the bones for (T, B, 3, 3) rotations from the T-pose, with the root at the origin; metres."""
    heads_m, offsets_m = np.zeros((len(rotations), len(body.bone_names), 3)), body.offsets_m
    for bone, parent in enumerate(body.bone_parents):
        if parent >= 0:
            heads_m[:, bone] = heads_m[:, parent] + rotations[:, parent] @ offsets_m[bone]
    return heads_m


def _root_m(joints_m: np.ndarray, rotations: np.ndarray, body: TeacherBody) -> np.ndarray:
    """(T, 3) positions of the root: over the floor as the dancer's hips, the lower foot on it except in jumps."""
    toes = [body.bone("LeftToeBase"), body.bone("RightToeBase")]
    sole_m = float(body.heads_m[toes, 2].min() - body.vertices_m[:, 2].min())
    lower_m = forward(rotations, body)[:, toes, 2].min(axis=1)
    feet_m = joints_m[:, [Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 2].min(axis=1)
    jump_m = np.maximum(feet_m - np.percentile(feet_m, FLOOR_PERCENTILE), 0)
    jump_m = np.where(jump_m > 0.06, jump_m, 0.0)
    middle_m = (joints_m[:, Joint.LEFT_HIP] + joints_m[:, Joint.RIGHT_HIP]) / 2
    root_m = middle_m - middle_m[0]
    root_m[:, 2] = sole_m - lower_m + jump_m
    return root_m


def as_bvh(body: TeacherBody, quats: np.ndarray, hips_m: np.ndarray, fps: float) -> str:
    """The text of a BVH file of a movement, in metres, y up, which animation programs read; arguments as in `Movement`."""
    turned = quats[..., (0, 1, 3, 2)] * (1, 1, 1, -1)  # (x, y, z) -> (x, z, -y)
    names, parents = [str(name) for name in body.bone_names], body.bone_parents.tolist()
    written = BvhFile(names, parents, body.offsets_m @ TO_Y_UP, turned, hips_m @ TO_Y_UP, fps)
    return bvh_text(written, [BVH_END_M] * len(names))
