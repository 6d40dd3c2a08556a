"""Analytic depth images of rooms and people for tests of human extraction; the ground truth is known by construction."""

from functools import cache

import numpy as np
from capsule_people import standing as standing_joints
from factories import draw_person, draw_room

from kpopnet.camera import Camera
from kpopnet.skeleton import Joint

CAMERA = Camera.centred(140.0, 160, 120)
LOWERED_M = 0.02  # lowers the standing body onto the floor


def room(*boxes: tuple[int, int, int, int, float]) -> np.ndarray:
    """(H, W) float32 metres: a floor, a wall, and the front faces of boxes (x0, y0, x1, y1 in pixels, depth in metres)."""
    depth = draw_room(CAMERA)
    for x0, y0, x1, y1, z in boxes:
        part = depth[y0:y1, x0:x1]
        np.minimum(part, np.float32(z), out=part)
    return depth


@cache
def standing(z_m: float = 2.8, arms_deg: float = -60.0, turned: bool = False) -> np.ndarray:
    """(H, W) float32 metres: a person at the image centre; arms at an angle above the horizontal, sideways or forwards."""
    body, arm = standing_joints(), np.array([np.cos(np.radians(arms_deg)), -np.sin(np.radians(arms_deg))])
    for side, sign in (("RIGHT", -1), ("LEFT", 1)):
        shoulder = body[Joint[f"{side}_SHOULDER"]]
        direction = np.array([0, arm[1], -arm[0]]) if turned else np.array([sign * arm[0], arm[1], 0])
        body[Joint[f"{side}_ELBOW"]] = shoulder + 0.28 * direction
        body[Joint[f"{side}_HAND"]] = shoulder + 0.54 * direction
    return draw_person((body + np.array([0, LOWERED_M, z_m])).astype(np.float32), CAMERA)


def shifted(person: np.ndarray, shift_px: int) -> np.ndarray:
    """The person shifted to the right by shift_px pixels; pixels that leave the image are dropped."""
    moved = np.zeros_like(person)
    if shift_px >= 0:
        moved[:, shift_px:] = person[:, : max(person.shape[1] - shift_px, 0)]
    else:
        moved[:, :shift_px] = person[:, -shift_px:]
    return moved


def compose(empty: np.ndarray, *people: np.ndarray) -> np.ndarray:
    """The nearest depth of the empty room and the people, per pixel."""
    depth = np.where(empty > 0, empty, np.inf)
    for person in people:
        depth = np.where((person > 0) & (person < depth), person, depth)
    return np.where(np.isfinite(depth), depth, 0).astype(np.float32)


def noisy(depth: np.ndarray, seed: int) -> np.ndarray:
    """Adds noise similar to a Kinect v1's: blocks of 3x3 pixels, growing with z^2, disparity steps, a few dropouts."""
    rng = np.random.default_rng(seed)
    grain = np.kron(rng.standard_normal((-(-depth.shape[0] // 3), -(-depth.shape[1] // 3))), np.ones((3, 3)))
    z = depth + 0.002 * depth**2 * grain[: depth.shape[0], : depth.shape[1]]
    with np.errstate(divide="ignore"):
        z = 345 / np.rint(345 / np.where(depth > 0, z, np.inf))
    return np.where((depth > 0) & (rng.random(depth.shape) > 0.001), z, 0).astype(np.float32)


def iou(found: np.ndarray, true: np.ndarray) -> float:
    """Intersection over union of two masks."""
    return float((found & true).sum() / max((found | true).sum(), 1))
