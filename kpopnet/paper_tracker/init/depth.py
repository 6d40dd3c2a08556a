"""From measured depth to one closed silhouette, and from points on its surface to joints inside the body."""

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.skeleton import NUM_JOINTS, Joint

MAX_HOLE_M = 0.06
"""Holes in the person up to this width in metres are gaps in the measurement and are filled; larger ones lie between limbs."""

DEPTH_RANGE_M = (0.1, 20.0)
"""Depth values outside this range in metres are not used: no depth camera measures people there."""

DEPTH_FACTORS = dict.fromkeys(Joint, 1.0) | {Joint.HEAD: 0.85, Joint.RIGHT_HIP: 1.17, Joint.LEFT_HIP: 1.17}
"""Distance of a joint behind the surface along its ray, relative to the body's half width there. Limbs are approximately
round, and so are shoulders under raised arms: 0.93 to 1.1 on simulated people (split train), rounded to 1. The head's
widest circle is that of the hair. The pelvis is deeper than the hips' distance from the crotch."""

SURFACE_RADIUS_M = 0.02
"""Depth and half width are measured in a window of this half size around a joint, in metres."""

RAISED_NECK_FRACTION, TORSO_FRACTION = 0.21, 0.446
"""`RAISED_NECK_FRACTION`: position of the neck from the middle of the shoulders (0), raised with the arms, to the head (1).
`TORSO_FRACTION`: position of the torso's centre from the middle of the hips (0) to that of the shoulders (1)."""


def person_silhouette(depth_m: np.ndarray, focal_px: float) -> tuple[np.ndarray, np.ndarray]:
    """The largest connected component of the measured pixels, with small holes filled.

    Args:
        depth_m: (H, W) float32 metres.
        focal_px: focal length in pixels.

    Returns:
        (H, W) float32 depth, 0 elsewhere, and (H, W) bool where it is not 0.
    """
    measured = (depth_m > DEPTH_RANGE_M[0]) & (depth_m < DEPTH_RANGE_M[1])
    _, labels, stats, _ = cv2.connectedComponentsWithStats(measured.astype(np.uint8), connectivity=8)
    if len(stats) == 1:
        return np.zeros_like(depth_m), measured
    person = labels == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])
    person_m = np.where(person, depth_m, np.float32(0))
    hole_px = MAX_HOLE_M * focal_px / float(np.median(depth_m[person]))
    # With a border added, the background outside the person is one component.
    background = np.pad(~person, 1, constant_values=True).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(background, connectivity=4)
    is_hole = stats[:, cv2.CC_STAT_AREA] <= hole_px**2
    is_hole[[0, labels[0, 0]]] = False  # the person and the background
    holes = is_hole[labels][1:-1, 1:-1]
    if holes.any():
        kernel_px = (2 * int(np.ceil(hole_px)) + 1,) * 2
        total_m = cv2.boxFilter(person_m, -1, kernel_px, normalize=False, borderType=cv2.BORDER_CONSTANT)
        count = cv2.boxFilter(person.astype(np.float32), -1, kernel_px, normalize=False, borderType=cv2.BORDER_CONSTANT)
        person_m[holes] = total_m[holes] / np.maximum(count[holes], 1)
    return person_m, person_m > 0


def surface_radius_px(person_m: np.ndarray, camera: Camera) -> int:
    """`SURFACE_RADIUS_M` in pixels, at the person's median depth."""
    return max(1, round(SURFACE_RADIUS_M * camera.fx / float(np.median(person_m[person_m > 0]))))


def surface_m(person_m: np.ndarray, uv: np.ndarray, radius_px: int) -> float:
    """Median depth of the person around a point (2,), or the depth of the nearest person pixel; there must be one."""
    window_m = person_m[window(uv, radius_px)]
    window_m = window_m[window_m > 0]
    if len(window_m):
        return float(np.median(window_m))
    v, u = np.nonzero(person_m)
    nearest = np.argmin((u - uv[0]) ** 2 + (v - uv[1]) ** 2)
    return float(person_m[v[nearest], u[nearest]])


def joints_inside(uv: np.ndarray, person_m: np.ndarray, camera: Camera) -> np.ndarray:
    """Moves points on the surface into the body by half its thickness there.

    Assumptions: body parts are as deep as they are wide, and half the width in pixels is the distance to the silhouette's edge.
    That is the ridge's D_T without the edges within the body: in the Y pose nothing occludes the body, and noisy depth has such
    edges everywhere.

    Args:
        uv: (15, 2) pixels; torso and neck are ignored and computed from the others.
        person_m: (H, W) depth of the person in metres, 0 elsewhere.
        camera: the camera of these pixels.

    Returns:
        (15, 3) joints in the camera frame in metres.
    """
    distance_px = cv2.distanceTransform((person_m > 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    joints = np.full((NUM_JOINTS, 3), np.nan)
    radius_px = surface_radius_px(person_m, camera)
    for joint in Joint:
        if joint in (Joint.TORSO, Joint.NECK):
            continue
        z = surface_m(person_m, uv[joint], radius_px)
        half_width_m = distance_px[window(uv[joint], radius_px)].max(initial=0) * z / camera.fx
        point = camera.back_project(np.array([*uv[joint], z]))
        joints[joint] = point * (1 + DEPTH_FACTORS[joint] * half_width_m / np.linalg.norm(point))
    shoulders = joints[[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]].mean(axis=0)
    hips = joints[[Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=0)
    joints[Joint.TORSO] = hips + TORSO_FRACTION * (shoulders - hips)
    joints[Joint.NECK] = shoulders + RAISED_NECK_FRACTION * (joints[Joint.HEAD] - shoulders)
    return joints


def window(uv: np.ndarray, radius_px: int) -> tuple[slice, slice]:
    """Slices of the pixels of a square around a point."""
    u, v = np.rint(uv).astype(int)
    return slice(max(v - radius_px, 0), max(v + radius_px + 1, 0)), slice(max(u - radius_px, 0), max(u + radius_px + 1, 0))
