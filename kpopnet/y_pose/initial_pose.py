"""The initial human model (section 2.3): the first joints and all lengths of a person in the Y pose.

    silhouette -> torso: rectangle, six parts -> head -> arms and legs -> depth inside the body -> tests of the Y pose

In the Y pose a person faces the camera, upright, the arms stretched obliquely upwards, the legs stretched and apart. In the
paper an operator marks the frame ("semi-automatic"). Here joints are estimated in any frame as if it showed the pose, and
the result is rejected unless it is a human body in that pose. A tracker waits for the first accepted frame.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.geometry.human_model import HumanModel
from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.y_pose.checks import NotYPose, require_explained, require_front, require_y_pose
from kpopnet.y_pose.depth import joints_inside, person_silhouette
from kpopnet.y_pose.image import (
    HEAD_RADIUS_M,
    TORSO_PARTS,
    Box,
    Limb,
    find_limb,
    head_candidates,
    mean_pixel,
    six_parts,
    torso_rectangle,
)

TORSO_HEIGHT_RANGE_M = (0.4, 0.95)
"""Accepted heights of the torso's rectangle in metres, from the shoulders to the crotch: 0.46 to 0.79 on simulated people."""

ARM_BOX_BOTTOM = 0.35
"""Lower edge of the arms' bounding boxes, in heights of the torso's rectangle from its top."""

HAND_RADIUS_M, FOOT_RADIUS_M = 0.18, 0.17
"""Radius in metres around a limb's tip within which ridge data are averaged for its end: the means are the palm, not the
fingertips, and the instep, not the toes. On simulated people (split train) hands lie 0.6 cm and feet 2.3 cm beyond the true
joints along the limb, at a mean distance of 2.2 and 2.5 cm; `tools/tracker_constants.py y_pose` prints that by radius. Feet lie
nearer with 0.2 m, but knees, looked for within half of it, farther."""

UPPER_ARM_FRACTION, UPPER_LEG_FRACTION = 0.465, 0.45
"""Position of the elbow from the shoulder (0) to the palm (1), and of the knee from the hip (0) to the instep (1): means of
simulated people (split train) that the same program prints; standard deviation 0.027."""

Item = TypeVar("Item")


@dataclass(frozen=True)
class InitialPose:
    """A person in the Y pose.

    Attributes:
        joints_camera_m: (15, 3) float64 metres in the camera frame.
        model: the lengths and angles of section 2.3.
        limbs: arms and legs by the joint at their end.
    """

    joints_camera_m: np.ndarray
    model: HumanModel
    limbs: dict[Joint, Limb]


def find_initial_pose(depth_m: np.ndarray, camera: Camera) -> InitialPose | None:
    """The initial pose if the frame shows a person in the Y pose, else None; arguments as in `initial_pose`."""
    try:
        return initial_pose(depth_m, camera)
    except NotYPose:
        return None


def initial_pose(depth_m: np.ndarray, camera: Camera) -> InitialPose:
    """Estimates the initial pose of a person in the Y pose.

    Args:
        depth_m: (H, W) floating-point metres of one person, 0 elsewhere; may be cropped around the person.
        camera: the camera of exactly these pixels.

    Raises:
        NotYPose: the frame does not show the pose; the message gives the reason.
        InputError: the depth is not one image of this camera.
    """
    depth_m = depth_in_metres(depth_m, camera, where="initial pose")
    if depth_m.ndim != 2:
        raise InputError(f"initial pose: expected one (H, W) depth image, found shape {depth_m.shape}")
    person_m, person = person_silhouette(depth_m, camera.fx)
    torso = torso_rectangle(person)
    torso_m = person_m[torso.pixels][person[torso.pixels]]
    if not len(torso_m):
        raise NotYPose("no person is visible")
    px_per_m = camera.fx / float(np.median(torso_m))
    if not TORSO_HEIGHT_RANGE_M[0] <= torso.height / px_per_m <= TORSO_HEIGHT_RANGE_M[1]:
        raise NotYPose(f"{torso.height / px_per_m:.2f} m from shoulders to crotch: legs closed, or not upright")
    ridge = ridge_data(person_m, RidgeConfig())
    uv = np.full((NUM_JOINTS, 2), np.nan)

    parts = six_parts(torso)
    for joint, part in TORSO_PARTS.items():
        uv[joint] = _require_visible(mean_pixel(person, parts[part]), joint)
    heads = head_candidates(ridge, torso, HEAD_RADIUS_M * px_per_m)
    uv[Joint.HEAD] = _require_visible(heads[0] if len(heads) else None, Joint.HEAD)
    limbs = {}
    for part in _limb_parts(torso, uv, person.shape):
        limb = find_limb(person, ridge, part.box, uv[part.root], part.end_m * px_per_m, part.upper_fraction)
        limbs[part.end] = limb = _require_visible(limb, part.end)
        if limb.tip.min() < 1 or (limb.tip > (camera.width - 2, camera.height - 2)).any():
            raise NotYPose(f"the {_label(part.end)} is at the image's edge and may extend beyond it")
        uv[part.middle], uv[part.end] = limb.middle, limb.end

    joints_camera_m = joints_inside(uv, person_m, camera)
    require_y_pose(joints_camera_m)
    require_explained(person, joints_camera_m, torso, camera)
    require_front(person_m, uv, (limbs[Joint.RIGHT_FOOT].tip, limbs[Joint.LEFT_FOOT].tip), camera)
    return InitialPose(joints_camera_m, HumanModel.from_joints(joints_camera_m), limbs)


class _LimbPart(NamedTuple):
    """Where a limb is searched.

    Attributes:
        box: its bounding box.
        root: shoulder or hip.
        middle: elbow or knee.
        end: hand or foot.
        end_m: radius in metres around the tip that is averaged for the end.
        upper_fraction: position of the middle from root (0) to end (1).
    """

    box: Box
    root: Joint
    middle: Joint
    end: Joint
    end_m: float
    upper_fraction: float


def _limb_parts(torso: Box, uv: np.ndarray, shape: tuple[int, int]) -> Iterator[_LimbPart]:
    """The limbs of a person who faces the camera: arms beside the shoulders, legs below the torso, right ones at smaller x."""
    height, width = shape
    bottom = torso.y0 + round(ARM_BOX_BOTTOM * torso.height)
    right_u, left_u = uv[Joint.RIGHT_SHOULDER, 0], uv[Joint.LEFT_SHOULDER, 0]
    for side, arm_x, leg_x in (
        ("RIGHT", (0, int(np.ceil(right_u))), (0, int(np.floor(torso.middle_u)) + 1)),
        ("LEFT", (int(np.floor(left_u)) + 1, width), (int(np.ceil(torso.middle_u)), width)),
    ):
        arm = (Joint[f"{side}_{name}"] for name in ("SHOULDER", "ELBOW", "HAND"))
        yield _LimbPart(Box(arm_x[0], 0, arm_x[1], bottom), *arm, HAND_RADIUS_M, UPPER_ARM_FRACTION)
        leg = (Joint[f"{side}_{name}"] for name in ("HIP", "KNEE", "FOOT"))
        yield _LimbPart(Box(leg_x[0], torso.y1, leg_x[1], height), *leg, FOOT_RADIUS_M, UPPER_LEG_FRACTION)


def _require_visible(item: Item | None, joint: Joint) -> Item:
    """The item, or NotYPose if it is None."""
    if item is None:
        raise NotYPose(f"the {_label(joint)} is not visible where the Y pose has it")
    return item


def _label(joint: Joint) -> str:
    """Name of a joint in words."""
    return joint.name.lower().replace("_", " ")
