"""A picture of how the initial model was found, after the paper's Fig. 4: for the README, and to see why it went wrong."""

import cv2
import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.drawing import ESTIMATED, depth_picture, draw_skeleton, enlarged, person_view, sheet, with_captions
from kpopnet.skeleton import Joint
from kpopnet.tracker.initial import InitialPose
from kpopnet.tracker.initial_depth import whole_person
from kpopnet.tracker.initial_limbs import Limb
from kpopnet.tracker.initial_torso import TORSO_PARTS, Box, mean_pixel

PERSON_PX, LIMB_PX = 640, 234
RIDGE, BOX, MANY = (235, 130, 50), (110, 200, 255), (255, 225, 90)
UPPER, LOWER, FOUND = (255, 80, 80), (90, 150, 255), (90, 240, 130)


def draw_initial(depth_m: np.ndarray, camera: Camera, pose: InitialPose) -> np.ndarray:
    """All stages of section 2.3: torso and head, ridge data, skeleton; lines and joints of every arm and leg.

    Args:
        depth_m: (H, W) metres, as given to `initial_pose`.
        camera: its camera.
        pose: what was found.

    Returns:
        (H', W', 3) uint8 RGB.
    """
    person_m, _ = whole_person(depth_in_metres(depth_m, camera, where="initial pose"), camera.fx)
    arms = _limb_tiles(person_m, camera, pose, Joint.RIGHT_HAND) + _limb_tiles(person_m, camera, pose, Joint.LEFT_HAND)
    legs = _limb_tiles(person_m, camera, pose, Joint.RIGHT_FOOT) + _limb_tiles(person_m, camera, pose, Joint.LEFT_FOOT)
    stages = [_torso_tile(person_m, camera, pose), _ridge_tile(person_m, camera, pose), _skeleton_tile(person_m, camera, pose)]
    return sheet([("", stages), ("Right arm, left arm", arms), ("Right leg, left leg", legs)])


class _Canvas:
    """The square part of an image around what is measured in it, enlarged; takes points in the image's pixels."""

    def __init__(self, depth_m: np.ndarray, camera: Camera, side_px: int, ridge: np.ndarray | None = None) -> None:
        view, self.camera = person_view(depth_m, camera)
        self.corner = np.array([camera.cx - self.camera.cx, camera.cy - self.camera.cy])
        self.scale = side_px / len(view)
        self.picture = depth_picture(view)
        if ridge is not None:
            v, u = np.nonzero(ridge & (depth_m > 0))
            x, y = (np.stack([u, v], axis=1) - self.corner.astype(int)).T
            self.picture[y, x] = RIDGE
        self.picture = enlarged(self.picture, side_px)

    def _at(self, uv: np.ndarray) -> tuple[int, int]:
        x, y = np.rint((np.asarray(uv) - self.corner + 0.5) * self.scale - 0.5).astype(int)
        return int(x), int(y)

    def dot(self, uv: np.ndarray, colour: tuple[int, int, int], radius_px: int = 5) -> None:
        cv2.circle(self.picture, self._at(uv), radius_px, colour, -1, cv2.LINE_AA)

    def box(self, box: Box, colour: tuple[int, int, int], width_px: int = 1) -> None:
        corners = self._at((box.x0 - 0.5, box.y0 - 0.5)), self._at((box.x1 - 0.5, box.y1 - 0.5))
        cv2.rectangle(self.picture, *corners, colour, width_px)

    def line(self, line: np.ndarray, limb: Limb, colour: tuple[int, int, int], width_px: int = 1) -> None:
        normal = np.array([np.cos(line[0]), np.sin(line[0])])
        foot = limb.origin + line[1] * normal
        reach = 2 * np.linalg.norm(limb.end - limb.origin) * np.array([-normal[1], normal[0]])
        cv2.line(self.picture, self._at(foot - reach), self._at(foot + reach), colour, width_px, cv2.LINE_AA)

    def titled(self, caption: str) -> np.ndarray:
        return with_captions(self.picture, (caption,))


def _torso_tile(person_m: np.ndarray, camera: Camera, pose: InitialPose) -> np.ndarray:
    canvas = _Canvas(person_m, camera, PERSON_PX)
    for part in pose.parts:
        canvas.box(part, BOX)
    canvas.box(pose.torso, MANY, 2)
    for part in TORSO_PARTS.values():
        canvas.dot(mean_pixel(person_m > 0, pose.parts[part]), FOUND)
    for candidate in pose.head_candidates[1:]:
        canvas.dot(candidate, MANY, 3)
    canvas.dot(pose.head_candidates[0], FOUND)
    return canvas.titled("torso rectangle, six parts, shoulders, hips; head, and where else mean shift ended (yellow)")


def _ridge_tile(person_m: np.ndarray, camera: Camera, pose: InitialPose) -> np.ndarray:
    canvas = _Canvas(person_m, camera, PERSON_PX, pose.stages.ridge)
    for limb in pose.limbs.values():
        canvas.box(limb.box, BOX)
    return canvas.titled("ridge data, bounding boxes of arms and legs")


def _skeleton_tile(person_m: np.ndarray, camera: Camera, pose: InitialPose) -> np.ndarray:
    canvas = _Canvas(person_m, camera, PERSON_PX)
    draw_skeleton(canvas.picture, pose.joints_camera_m, canvas.camera, ESTIMATED)
    return canvas.titled("initial pose")


def _limb_tiles(person_m: np.ndarray, camera: Camera, pose: InitialPose, end: Joint) -> list[np.ndarray]:
    limb = pose.limbs[end]
    middle_name, end_name = ("elbow", "hand") if end in (Joint.RIGHT_HAND, Joint.LEFT_HAND) else ("knee", "foot")
    limb_m = np.zeros_like(person_m)
    limb_m[limb.box.pixels] = person_m[limb.box.pixels]
    ridge, hough, dominant, joints = (_Canvas(limb_m, camera, LIMB_PX, pose.stages.ridge) for _ in range(4))
    for line in limb.lines:
        hough.line(line, limb, MANY)
    for canvas in (dominant, joints):
        canvas.line(limb.dominant[0], limb, UPPER, 2)
        canvas.line(limb.dominant[1], limb, LOWER, 2)
    dominant.dot(limb.middle, FOUND)
    joints.dot(limb.middle, FOUND)
    joints.dot(limb.end, FOUND)
    how = "crossing" if limb.crossed else "straight"
    captions = "ridge data", "Hough lines", f"dominant lines, {middle_name}: {how}", end_name
    return [canvas.titled(caption) for canvas, caption in zip((ridge, hough, dominant, joints), captions, strict=True)]
