"""The initial human model (section 2.3): the first joints and all lengths of a person who holds the Y pose.

    silhouette -> torso: rectangle, six parts -> head -> arms and legs -> into the body -> is that a Y pose?

Who holds it faces the camera, upright, the arms stretched obliquely upwards, the legs stretched and apart. In the paper
somebody says when that is so ("semi-automatic"). Here the frames tell: joints are looked for in any frame as if it showed
the pose, and what was found is refused unless it is a human body in that pose. A tracker waits for a frame that passes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.initial_check import NotYPose, YPose, require_explained, require_front, require_y_pose
from kpopnet.tracker.initial_depth import joints_inside, whole_person
from kpopnet.tracker.initial_limbs import Limb, find_limb
from kpopnet.tracker.initial_torso import (
    HEAD_RADIUS_M,
    TORSO_PARTS,
    Box,
    head_candidates,
    mean_pixel,
    six_parts,
    torso_rectangle,
)
from kpopnet.tracker.model import HumanModel

RECTANGLE_M = (0.4, 0.95)
"""Heights that a torso's rectangle may have, from the shoulders to the crotch: 0.46 to 0.79 on simulated people."""

ARM_BOX_BOTTOM = 0.35
"""Arms are looked for above this share of the torso's rectangle."""

HAND_M, FOOT_M = 0.21, 0.14
"""How far from a limb's tip the ridge data count for its end: their means are the palm, not the fingertips, and the instep,
not the toes."""

UPPER_ARM_SHARE, UPPER_LEG_SHARE = 0.51, 0.45
"""Where elbow and knee lie on the way from the shoulder to the palm and from the hip to the instep: the means of simulated
people (split train), who differ by 0.026 (standard deviation)."""


@dataclass(frozen=True)
class InitialConfig:
    """Settings.

    Attributes:
        y_pose: what counts as the Y pose.
        ridge: what counts as ridge data.
    """

    y_pose: YPose = field(default_factory=YPose)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)


DEFAULT = InitialConfig()

Thing = TypeVar("Thing")


@dataclass(frozen=True)
class InitialPose:
    """A person in the Y pose.

    Attributes:
        joints_camera_m: (15, 3) float64 metres.
        model: the lengths and angles of section 2.3.
        limbs: arms and legs by the joint at their end.
    """

    joints_camera_m: np.ndarray
    model: HumanModel
    limbs: dict[Joint, Limb]


def find_initial_pose(depth_m: np.ndarray, camera: Camera, config: InitialConfig = DEFAULT) -> InitialPose | None:
    """The initial pose if the frame shows somebody in the Y pose, else None; arguments as in `initial_pose`."""
    try:
        return initial_pose(depth_m, camera, config)
    except NotYPose:
        return None


def initial_pose(depth_m: np.ndarray, camera: Camera, config: InitialConfig = DEFAULT) -> InitialPose:
    """The initial pose of somebody in the Y pose.

    Args:
        depth_m: (H, W) floating-point metres of one person, 0 elsewhere. May be only the part of a picture around them.
        camera: the camera of exactly these pixels.
        config: what counts as the pose.

    Raises:
        NotYPose: the frame does not show it; the message says why.
        InputError: the depth is not one image of this camera.
    """
    depth_m = depth_in_metres(depth_m, camera, where="initial pose")
    if depth_m.ndim != 2:
        raise InputError(f"initial pose: expected one (H, W) depth image, found shape {depth_m.shape}")
    person_m, person = whole_person(depth_m, camera.fx)
    torso = torso_rectangle(person)
    torso_m = person_m[torso.pixels][person[torso.pixels]]
    if not len(torso_m):
        raise NotYPose("nobody is seen")
    px_per_m = camera.fx / float(np.median(torso_m))
    if not RECTANGLE_M[0] <= torso.height / px_per_m <= RECTANGLE_M[1]:
        raise NotYPose(f"from shoulders to crotch it is {torso.height / px_per_m:.2f} m: legs closed, or not upright")
    ridge = ridge_data(person_m, config.ridge)
    uv = np.full((NUM_JOINTS, 2), np.nan)

    parts = six_parts(torso)
    for joint, part in TORSO_PARTS.items():
        uv[joint] = _found(mean_pixel(person, parts[part]), joint)
    heads = head_candidates(ridge, torso, HEAD_RADIUS_M * px_per_m)
    uv[Joint.HEAD] = _found(heads[0] if len(heads) else None, Joint.HEAD)
    limbs = {}
    for part in _limb_parts(torso, uv, person.shape):
        limb = find_limb(person, ridge, part.box, uv[part.root], part.end_m * px_per_m, part.upper_share)
        limbs[part.end] = limb = _found(limb, part.end)
        if limb.tip.min() < 1 or (limb.tip > (camera.width - 2, camera.height - 2)).any():
            raise NotYPose(f"the {_words(part.end)} is at the picture's edge and may go on beyond it")
        uv[part.middle], uv[part.end] = limb.middle, limb.end

    joints_camera_m = joints_inside(uv, person_m, camera)
    require_y_pose(joints_camera_m, config.y_pose)
    require_explained(person, joints_camera_m, torso, camera)
    require_front(person_m, uv, (limbs[Joint.RIGHT_FOOT].tip, limbs[Joint.LEFT_FOOT].tip), camera)
    return InitialPose(joints_camera_m, HumanModel.from_joints(joints_camera_m), limbs)


class _LimbPart(NamedTuple):
    """Where a limb is looked for: its bounding box, its joints, how long its end and upper half are."""

    box: Box
    root: Joint
    middle: Joint
    end: Joint
    end_m: float
    upper_share: float


def _limb_parts(torso: Box, uv: np.ndarray, shape: tuple[int, int]) -> Iterator[_LimbPart]:
    """Arms beside the shoulders, legs below the torso, of somebody who faces the camera: the right ones at smaller x."""
    height, width = shape
    bottom = torso.y0 + round(ARM_BOX_BOTTOM * torso.height)
    right_u, left_u = uv[Joint.RIGHT_SHOULDER, 0], uv[Joint.LEFT_SHOULDER, 0]
    for side, arm_x, leg_x in (
        ("RIGHT", (0, int(np.ceil(right_u))), (0, int(np.floor(torso.middle_u)) + 1)),
        ("LEFT", (int(np.floor(left_u)) + 1, width), (int(np.ceil(torso.middle_u)), width)),
    ):
        arm = (Joint[f"{side}_{name}"] for name in ("SHOULDER", "ELBOW", "HAND"))
        yield _LimbPart(Box(arm_x[0], 0, arm_x[1], bottom), *arm, HAND_M, UPPER_ARM_SHARE)
        leg = (Joint[f"{side}_{name}"] for name in ("HIP", "KNEE", "FOOT"))
        yield _LimbPart(Box(leg_x[0], torso.y1, leg_x[1], height), *leg, FOOT_M, UPPER_LEG_SHARE)


def _found(thing: Thing | None, joint: Joint) -> Thing:
    if thing is None:
        raise NotYPose(f"the {_words(joint)} is not seen where the Y pose has it")
    return thing


def _words(joint: Joint) -> str:
    return joint.name.lower().replace("_", " ")
