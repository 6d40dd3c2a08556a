"""Tests whether joints that were estimated under the assumption of a Y pose belong to a person in that pose."""

from typing import NamedTuple

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.skeleton import BONES, JOINT_NAMES, Joint
from kpopnet.y_pose.depth import front_score
from kpopnet.y_pose.image import Box

TORSO_RANGE_M = (0.36, 0.72)
HEAD_HEIGHT_RANGE, MAX_HEAD_OFFSET, ARM_RANGE, LEG_RANGE = (0.2, 0.65), 0.2, (0.65, 1.5), (1.15, 2.15)
"""Ranges of body lengths. The torso from the middle of the hips to that of the shoulders, in metres. In torso lengths: the
head's distance above and beside the middle of the shoulders, an arm, a leg. From estimates on simulated people (split train)
in the Y pose, errors included, widened by a tenth."""

MAX_SIDE_RATIO = 1.28
"""Largest ratio of right to left arm and of right to left leg, and of the inverse: above it a hand or foot was not visible."""

MAX_UNEXPLAINED_FRACTION = 0.06
"""Largest fraction of the silhouette outside the skeleton drawn with the thickness of a body."""

THICKNESS_M = {Joint.HEAD: 0.26} | dict.fromkeys((Joint.RIGHT_KNEE, Joint.LEFT_KNEE, Joint.RIGHT_HIP, Joint.LEFT_HIP), 0.21)
LIMB_THICKNESS_M, SHOULDER_THICKNESS_M = 0.17, 0.39
"""Line thickness of the drawn skeleton in metres: by the joint at the end of the bone, for other bones, and for the bones from
neck and torso to shoulders and hips."""

LIMB_PARTS = {"arm": ("shoulder", "elbow", "hand"), "leg": ("hip", "knee", "foot")}
LIMB_RANGES = {"arm": ARM_RANGE, "leg": LEG_RANGE}

MIN_FRONT_SCORE = 0.12
"""Minimum `front_score`. Of simulated people (split train) who passed all other tests, 95 % of 269 seen from the front are
above it (mean 0.22); 297 seen from behind have a mean of -0.05 and reach 0.09, since a tail of hair over the nape looks like a
chin. The limit leaves room above them: at 0.1 one person of the tests, from behind with such a tail, passed. Of 216 frames of 2
real people facing a Kinect (UTD-MHAD) 87 % are above 0.04."""


ARM_ELEVATION_DEG, BEND_DEG, FORWARD_DEG = (15.0, 78.0), 38.0, 33.0
LEG_SPREAD_DEG, TURNED_DEG, TILT_DEG = (6.0, 70.0), 32.0, 45.0
"""Limits of the Y pose in degrees, for estimated joints: a few degrees wider than for true ones. The arms' angle above
horizontal, within the body's plane; the largest bend of elbows and knees; the largest angle of arms and legs out of the body's
plane; the angle between the legs; the largest heading away from the camera; the largest angle between the trunk and the image's
vertical, to which the camera's tilt adds."""


class NotYPose(Exception):  # noqa: N818 - not an error: most frames show another pose
    """The frame does not show the Y pose; the message tells the person what to correct."""


class BodyAxes(NamedTuple):
    """A body's axes as unit vectors, and the length of its torso.

    Attributes:
        up: (3,) from the hips to the shoulders.
        left: (3,) to the person's left, orthogonal to up.
        front: (3,) to the person's front.
        torso_m: from the middle of the hips to that of the shoulders, metres.
    """

    up: np.ndarray
    left: np.ndarray
    front: np.ndarray
    torso_m: float


def require_y_pose(joints_camera_m: np.ndarray) -> None:
    """Tests (15, 3) joints of a person who appears to face the camera.

    Raises:
        NotYPose: an angle outside the limits, or a length outside the range of human bodies.
    """
    joints = joints_camera_m
    axes = body_axes(joints)
    _require("torso, metres", axes.torso_m, *TORSO_RANGE_M)
    shoulders = (joints[Joint.RIGHT_SHOULDER] + joints[Joint.LEFT_SHOULDER]) / 2
    head = (joints[Joint.HEAD] - shoulders) / axes.torso_m
    _require("head above the shoulders, in torsos", head @ axes.up, *HEAD_HEIGHT_RANGE)
    _require("head beside the torso, in torsos", head @ axes.left, -MAX_HEAD_OFFSET, MAX_HEAD_OFFSET)
    _require("tilt, degrees", _angle_deg(axes.up, np.array([0, -1, 0])), 0, TILT_DEG)
    _require("heading, degrees", _heading_deg(axes, joints[Joint.TORSO]), -TURNED_DEG, TURNED_DEG)
    spread_deg, lengths = 0.0, {}
    for side, outwards in (("right", -axes.left), ("left", axes.left)):
        for name, parts in LIMB_PARTS.items():
            root, middle, end = (joints[JOINT_NAMES.index(f"{side}_{part}")] for part in parts)
            limb = end - root
            forward_deg = 90 - _angle_deg(limb, axes.front)
            _require(f"{side} {name} forward, degrees", forward_deg, -FORWARD_DEG, FORWARD_DEG)
            _require(f"bend of the {side} {parts[1]}, degrees", _angle_deg(middle - root, end - middle), 0, BEND_DEG)
            raised_deg = np.degrees(np.arctan2(limb @ axes.up, limb @ outwards))
            if name == "arm":
                _require(f"{side} arm above level, degrees", raised_deg, *ARM_ELEVATION_DEG)
            else:
                spread_deg += 90 + raised_deg
            lengths[side, name] = np.linalg.norm(middle - root) + np.linalg.norm(end - middle)
            _require(f"{side} {name}, in torsos", lengths[side, name] / axes.torso_m, *LIMB_RANGES[name])
    _require("angle between the legs, degrees", spread_deg, *LEG_SPREAD_DEG)
    for name in ("arm", "leg"):
        _require(
            f"right {name}, in left {name}s", lengths["right", name] / lengths["left", name], 1 / MAX_SIDE_RATIO, MAX_SIDE_RATIO
        )


def body_axes(joints_camera_m: np.ndarray) -> BodyAxes:
    """The axes of a body from the shoulders and hips of (15, 3) joints."""
    right = joints_camera_m[[Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP]]
    left = joints_camera_m[[Joint.LEFT_SHOULDER, Joint.LEFT_HIP]]
    shoulders, hips = (right + left) / 2
    torso_m = float(np.linalg.norm(shoulders - hips))
    up = _unit(shoulders - hips)
    across = (left - right).mean(axis=0)
    across = _unit(across - (across @ up) * up)
    return BodyAxes(up, across, np.cross(across, up), torso_m)


def _heading_deg(axes: BodyAxes, torso_camera_m: np.ndarray) -> float:
    """Rotation about the vertical away from facing the camera, degrees, positive to the person's left."""
    heading = np.arctan2(axes.front[0], -axes.front[2]) - np.arctan2(-torso_camera_m[0], torso_camera_m[2])
    return float(np.degrees((heading + np.pi) % (2 * np.pi) - np.pi))


def _angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two (3,) vectors, degrees."""
    return float(np.degrees(np.arccos(np.clip(_unit(a) @ _unit(b), -1, 1))))


def _unit(vector: np.ndarray) -> np.ndarray:
    """The vector normalised to length 1; a zero vector stays zero."""
    return vector / max(np.linalg.norm(vector), 1e-9)


def _require(what: str, value: float, low: float, high: float) -> None:
    """Raises NotYPose unless low <= value <= high."""
    if not low <= value <= high:
        raise NotYPose(f"{what}: {value:.3g}, expected {low:.3g} to {high:.3g}")


def require_explained(person: np.ndarray, joints_camera_m: np.ndarray, torso: Box, camera: Camera) -> None:
    """Tests that the (H, W) bool silhouette is that of the skeleton.

    Raises:
        NotYPose: too large a fraction lies outside the drawn skeleton: bent limbs, a chair, a second person.
    """
    body = np.zeros(person.shape, np.uint8)
    body[torso.pixels] = 1
    far_px = 10 * max(person.shape)  # limit of the line ends: cv2 fails with much larger coordinates
    uv = np.clip(camera.project(joints_camera_m)[:, :2], -far_px, far_px)
    px_per_m = camera.fx / joints_camera_m[Joint.TORSO, 2]
    for parent, child in BONES:
        at_shoulders = parent in (Joint.NECK, Joint.TORSO) and child != Joint.HEAD
        thickness_m = SHOULDER_THICKNESS_M if at_shoulders else THICKNESS_M.get(child, LIMB_THICKNESS_M)
        ends = (tuple(np.rint(uv[joint]).astype(int).tolist()) for joint in (parent, child))
        cv2.line(body, *ends, 1, max(1, min(round(thickness_m * px_per_m), far_px)))
    fraction = np.count_nonzero(person & (body == 0)) / np.count_nonzero(person)
    _require("silhouette outside the skeleton, fraction", fraction, 0, MAX_UNEXPLAINED_FRACTION)


def require_front(person_m: np.ndarray, uv: np.ndarray, tips: tuple[np.ndarray, np.ndarray], camera: Camera) -> None:
    """Tests that the person is seen from the front; arguments as in `front_score`.

    Raises:
        NotYPose: the back is seen, or the depth is ambiguous.
    """
    if front_score(person_m, uv, tips, camera) < MIN_FRONT_SCORE:
        raise NotYPose("the person shows the back, or front and back cannot be distinguished")
