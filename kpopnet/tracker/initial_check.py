"""Whether joints that were found as if somebody held the Y pose are those of a person who does."""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.skeleton import BONES, JOINT_NAMES, Joint
from kpopnet.tracker.initial_facing import frontness
from kpopnet.tracker.initial_torso import Box

TORSO_M = (0.36, 0.72)
HEAD_SHARE, HEAD_ASIDE, ARM_SHARE, LEG_SHARE = (0.2, 0.65), 0.2, (0.65, 1.5), (1.15, 2.15)
"""Lengths that bodies have: the torso from the middle of the hips to that of the shoulders, and in torsos the head's
distance above and beside the middle of the shoulders, an arm, a leg. As simulated people (split train) in the Y pose
showed them, errors of the estimate included, and a tenth beyond."""

ALIKE = 1.28
"""Right and left arm, right and left leg differ at most by this factor: otherwise a hand or foot was not seen."""

UNEXPLAINED = 0.06
"""Largest share of the silhouette that may lie beside the skeleton as thick as bodies are."""

THICKNESS_M = {Joint.HEAD: 0.26} | dict.fromkeys((Joint.RIGHT_KNEE, Joint.LEFT_KNEE, Joint.RIGHT_HIP, Joint.LEFT_HIP), 0.21)
LIMB_THICKNESS_M, SHOULDER_THICKNESS_M = 0.17, 0.39

LIMB_PARTS = {"arm": ("shoulder", "elbow", "hand"), "leg": ("hip", "knee", "foot")}
LIMB_SHARES = {"arm": ARM_SHARE, "leg": LEG_SHARE}

FRONTNESS = 0.04
"""Least `frontness`. Of simulated people (split train) who passed all else, 99.1 % of 435 seen from the front are beyond it,
their mean is 0.23, and none of 507 seen from behind, whose mean is -0.11; of 216 frames of 2 real people who stand facing a
Kinect (UTD-MHAD) 87 %."""


class NotYPose(Exception):  # noqa: N818 - no error: most frames show another pose
    """Why a frame does not show the Y pose, in words for the person who tries to hold it."""


@dataclass(frozen=True)
class YPose:
    """What counts as the Y pose, by the joints as they were estimated: a few degrees more than what is meant.

    Attributes:
        arm_elevation_deg: arms above level, within the body's own plane.
        bend_deg: largest bend of elbows and knees.
        forward_deg: how far arms and legs may point out of the body's plane.
        leg_spread_deg: angle between the legs.
        turned_deg: largest heading away from the camera.
        tilt_deg: largest angle of the trunk against the image's vertical; that of the camera adds to it.
    """

    arm_elevation_deg: tuple[float, float] = (15.0, 78.0)
    bend_deg: float = 38.0
    forward_deg: float = 33.0
    leg_spread_deg: tuple[float, float] = (6.0, 70.0)
    turned_deg: float = 32.0
    tilt_deg: float = 45.0

    def __post_init__(self) -> None:
        for name in ("arm_elevation_deg", "leg_spread_deg"):
            low, high = getattr(self, name)
            if not -90 <= low < high <= 180:
                raise InputError(f"y_pose.{name}=[{low},{high}] must be an increasing range of degrees")
        for name in ("bend_deg", "forward_deg", "turned_deg", "tilt_deg"):
            if not 0 < getattr(self, name) <= 180:
                raise InputError(f"y_pose.{name}={getattr(self, name)} must lie between 0 and 180 degrees")


class Frame(NamedTuple):
    """A body's own axes as unit vectors, and the length of its torso."""

    up: np.ndarray
    left: np.ndarray
    front: np.ndarray
    torso_m: float


def require_y_pose(joints_camera_m: np.ndarray, limits: YPose) -> None:
    """Checks (15, 3) joints of somebody who seems to face the camera.

    Raises:
        NotYPose: angles beyond the limits, or lengths that no body has.
    """
    joints = joints_camera_m
    frame = body_frame(joints)
    _require("torso, metres", frame.torso_m, *TORSO_M)
    shoulders = (joints[Joint.RIGHT_SHOULDER] + joints[Joint.LEFT_SHOULDER]) / 2
    head = (joints[Joint.HEAD] - shoulders) / frame.torso_m
    _require("head above the shoulders, in torsos", head @ frame.up, *HEAD_SHARE)
    _require("head beside the torso, in torsos", head @ frame.left, -HEAD_ASIDE, HEAD_ASIDE)
    _require("tilt, degrees", _angle_deg(frame.up, np.array([0, -1, 0])), 0, limits.tilt_deg)
    _require("heading, degrees", _heading_deg(frame, joints[Joint.TORSO]), -limits.turned_deg, limits.turned_deg)
    spread_deg, lengths = 0.0, {}
    for side, outwards in (("right", -frame.left), ("left", frame.left)):
        for name, parts in LIMB_PARTS.items():
            root, middle, end = (joints[JOINT_NAMES.index(f"{side}_{part}")] for part in parts)
            limb = end - root
            forward_deg = 90 - _angle_deg(limb, frame.front)
            _require(f"{side} {name} forward, degrees", forward_deg, -limits.forward_deg, limits.forward_deg)
            _require(f"bend of the {side} {parts[1]}, degrees", _angle_deg(middle - root, end - middle), 0, limits.bend_deg)
            raised_deg = np.degrees(np.arctan2(limb @ frame.up, limb @ outwards))
            if name == "arm":
                _require(f"{side} arm above level, degrees", raised_deg, *limits.arm_elevation_deg)
            else:
                spread_deg += 90 + raised_deg
            lengths[side, name] = np.linalg.norm(middle - root) + np.linalg.norm(end - middle)
            _require(f"{side} {name}, in torsos", lengths[side, name] / frame.torso_m, *LIMB_SHARES[name])
    _require("angle between the legs, degrees", spread_deg, *limits.leg_spread_deg)
    for name in ("arm", "leg"):
        _require(f"right {name}, in left {name}s", lengths["right", name] / lengths["left", name], 1 / ALIKE, ALIKE)


def body_frame(joints_camera_m: np.ndarray) -> Frame:
    """The axes of a body by its shoulders and hips, of (15, 3) joints."""
    right = joints_camera_m[[Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP]]
    left = joints_camera_m[[Joint.LEFT_SHOULDER, Joint.LEFT_HIP]]
    shoulders, hips = (right + left) / 2
    torso_m = float(np.linalg.norm(shoulders - hips))
    up = _unit(shoulders - hips)
    across = (left - right).mean(axis=0)
    across = _unit(across - (across @ up) * up)
    return Frame(up, across, np.cross(across, up), torso_m)


def _heading_deg(frame: Frame, torso_camera_m: np.ndarray) -> float:
    """How far the body is turned about the vertical away from facing the camera, to its left positive."""
    turned = np.arctan2(frame.front[0], -frame.front[2]) - np.arctan2(-torso_camera_m[0], torso_camera_m[2])
    return float(np.degrees((turned + np.pi) % (2 * np.pi) - np.pi))


def _angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(_unit(a) @ _unit(b), -1, 1))))


def _unit(vector: np.ndarray) -> np.ndarray:
    """The vector at length 1; a vector of no length stays so."""
    return vector / max(np.linalg.norm(vector), 1e-9)


def _require(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise NotYPose(f"{what}: {value:.3g}, expected {low:.3g} to {high:.3g}")


def require_explained(person: np.ndarray, joints_camera_m: np.ndarray, torso: Box, camera: Camera) -> None:
    """Checks that the (H, W) bool silhouette is that of the skeleton.

    Raises:
        NotYPose: more than a little of it lies elsewhere: bent limbs, a chair, a second person.
    """
    body = np.zeros(person.shape, np.uint8)
    body[torso.pixels] = 1
    far_px = 10 * max(person.shape)  # where a line may end; cv2 fails at much more
    uv = np.clip(camera.project(joints_camera_m)[:, :2], -far_px, far_px)
    px_per_m = camera.fx / joints_camera_m[Joint.TORSO, 2]
    for parent, child in BONES:
        at_shoulders = parent in (Joint.NECK, Joint.TORSO) and child != Joint.HEAD
        thickness_m = SHOULDER_THICKNESS_M if at_shoulders else THICKNESS_M.get(child, LIMB_THICKNESS_M)
        ends = (tuple(np.rint(uv[joint]).astype(int).tolist()) for joint in (parent, child))
        cv2.line(body, *ends, 1, max(1, min(round(thickness_m * px_per_m), far_px)))
    share = np.count_nonzero(person & (body == 0)) / np.count_nonzero(person)
    _require("silhouette beside the skeleton, share", share, 0, UNEXPLAINED)


def require_front(person_m: np.ndarray, uv: np.ndarray, tips: tuple[np.ndarray, np.ndarray], camera: Camera) -> None:
    """Checks that the person's front is seen; arguments as in `frontness`.

    Raises:
        NotYPose: it is the back, or one cannot tell.
    """
    if frontness(person_m, uv, tips, camera) < FRONTNESS:
        raise NotYPose("not the front is seen but the back, or one cannot tell")
