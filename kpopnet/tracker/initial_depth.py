"""From depth as it comes to one whole silhouette, and from points on its surface to joints inside the body."""

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.skeleton import NUM_JOINTS, Joint

HOLE_M = 0.06
"""Holes in the person up to this wide are gaps in the measurement and are filled; larger ones are between limbs."""

RANGE_M = (0.1, 20.0)
"""What is nearer or farther is no person that any depth camera measures."""

INWARDS = {joint: 1.0 for joint in Joint} | {Joint.HEAD: 0.85, Joint.RIGHT_HIP: 1.17, Joint.LEFT_HIP: 1.17}
"""How far behind the surface a joint lies along its ray, in half widths of the body around it. Limbs are about round, and
so are shoulders under raised arms: on simulated people (split train) 0.93 to 1.1, taken as 1. The head's widest circle is
that of the hair; the pelvis is deeper than the hips' distance from the crotch."""

SURFACE_M = 0.02
"""Depth and half width are taken from this far around a joint."""

NECK_SHARE, TORSO_SHARE = 0.21, 0.446
"""Where the neck lies on the way from the middle of the shoulders, which are raised with the arms, to the head."""


def whole_person(depth_m: np.ndarray, focal_px: float) -> tuple[np.ndarray, np.ndarray]:
    """The largest connected part of what was measured, its small holes filled.

    Args:
        depth_m: (H, W) float32.
        focal_px: focal length.

    Returns:
        (H, W) float32 depth, 0 elsewhere, and (H, W) bool where it is not 0.
    """
    measured = (depth_m > RANGE_M[0]) & (depth_m < RANGE_M[1])
    _, labels, stats, _ = cv2.connectedComponentsWithStats(measured.astype(np.uint8), connectivity=8)
    if len(stats) == 1:
        return np.zeros_like(depth_m), measured
    person = labels == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])
    person_m = np.where(person, depth_m, np.float32(0))
    hole_px = HOLE_M * focal_px / float(np.median(depth_m[person]))
    # With a rim around it, all that is beside the person is one part.
    outside = np.pad(~person, 1, constant_values=True).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(outside, connectivity=4)
    is_hole = stats[:, cv2.CC_STAT_AREA] <= hole_px**2
    is_hole[[0, labels[0, 0]]] = False  # the person, and what is beside them
    holes = is_hole[labels][1:-1, 1:-1]
    if holes.any():
        around = (2 * int(np.ceil(hole_px)) + 1,) * 2
        total_m = cv2.boxFilter(person_m, -1, around, normalize=False, borderType=cv2.BORDER_CONSTANT)
        count = cv2.boxFilter(person.astype(np.float32), -1, around, normalize=False, borderType=cv2.BORDER_CONSTANT)
        person_m[holes] = total_m[holes] / np.maximum(count[holes], 1)
    return person_m, person_m > 0


def surface_radius_px(person_m: np.ndarray, camera: Camera) -> int:
    """`SURFACE_M` in pixels, at the person's distance."""
    return max(1, round(SURFACE_M * camera.fx / float(np.median(person_m[person_m > 0]))))


def surface_m(person_m: np.ndarray, uv: np.ndarray, radius_px: int) -> float:
    """Depth of the person around a point (2,), or of the person's pixel next to it; there must be one."""
    near = person_m[window(uv, radius_px)]
    near = near[near > 0]
    if len(near):
        return float(np.median(near))
    v, u = np.nonzero(person_m)
    nearest = np.argmin((u - uv[0]) ** 2 + (v - uv[1]) ** 2)
    return float(person_m[v[nearest], u[nearest]])


def joints_inside(uv: np.ndarray, person_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(15, 3) joints in metres of points on the surface, pushed into the body by half its thickness there.

    Body parts are about as deep as they are wide, and half their width in pixels is the distance to the silhouette's edge.
    That is the ridge's D_T without the edges within the body: nothing covers anything in the Y pose, and a noisy sensor's
    depth has such edges everywhere.

    Args:
        uv: (15, 2) pixels; torso and neck are not looked at but follow from the others.
        person_m: (H, W) depth of the person, 0 elsewhere.
        camera: the camera.
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
        joints[joint] = point * (1 + INWARDS[joint] * half_width_m / np.linalg.norm(point))
    shoulders = joints[[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]].mean(axis=0)
    hips = joints[[Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=0)
    joints[Joint.TORSO] = hips + TORSO_SHARE * (shoulders - hips)
    joints[Joint.NECK] = shoulders + NECK_SHARE * (joints[Joint.HEAD] - shoulders)
    return joints


def window(uv: np.ndarray, radius_px: int) -> tuple[slice, slice]:
    """The pixels of a square around a point."""
    u, v = np.rint(uv).astype(int)
    return slice(max(v - radius_px, 0), max(v + radius_px + 1, 0)), slice(max(u - radius_px, 0), max(u + radius_px + 1, 0))
