"""What the depth of a person in the Y pose tells: one closed silhouette, joints inside the body, front or back.

The silhouettes of a person in the Y pose are almost the same from front and back; the depth profiles differ.
"""

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

TRUNK_SAMPLES = np.arange(-7, 13) / 10
"""Positions of depth samples along the trunk: from the middle of the shoulders (0) to that of the hips (1), head included."""

LEG_SAMPLES = np.arange(1, 11) / 10
"""Positions of depth samples along the legs: from hip (0) over knee (1/2) to the tip of the foot (1)."""

LEG_TORSO_RATIO = 1.9
"""Length of a leg in torso lengths."""

PROFILE_BANDS = (
    (-0.5, -0.2, -0.5),  # chin and throat, or nape
    (0.0, 0.2, 1.0),  # chest, or shoulder blades
    (2.1, 2.6, 1.0),  # shins, or calves
    (2.9, 2.9, -0.5),  # toes, or heels
)
"""Start, end (torso lengths below the shoulders) and weight of bands of the profile. Nape and feet vary twice as much."""


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


def front_score(person_m: np.ndarray, uv: np.ndarray, tips: tuple[np.ndarray, np.ndarray], camera: Camera) -> float:
    """Scores which side of the person is seen: positive for the front, negative for the back.

    The depth along the body from head to toes is compared with a straight line fitted to it. From the front, chin and toes are
    nearer than the line, chest and shins farther. From behind, shoulder blades and calves are nearer, nape and heels farther.
    The score is their weighted contrast in torso lengths.

    Args:
        person_m: (H, W) depth in metres.
        uv: (15, 2) joints in pixels, right and left as if the person faced the camera.
        tips: u, v of the ends of the right and the left leg in pixels.
        camera: the camera of these pixels.
    """
    shoulders = (uv[Joint.RIGHT_SHOULDER] + uv[Joint.LEFT_SHOULDER]) / 2
    hips = (uv[Joint.RIGHT_HIP] + uv[Joint.LEFT_HIP]) / 2
    radius_px = surface_radius_px(person_m, camera)
    trunk_m = [surface_m(person_m, shoulders + fraction * (hips - shoulders), radius_px) for fraction in TRUNK_SAMPLES]
    legs_m = []
    for hip, knee, tip in ((Joint.RIGHT_HIP, Joint.RIGHT_KNEE, tips[0]), (Joint.LEFT_HIP, Joint.LEFT_KNEE, tips[1])):
        polyline = np.stack([uv[hip], uv[knee], tip])
        points = np.stack([np.interp(LEG_SAMPLES, (0, 0.5, 1), polyline[:, axis]) for axis in (0, 1)], axis=1)
        legs_m.append([surface_m(person_m, point, radius_px) for point in points])
    position = np.concatenate([TRUNK_SAMPLES, 1 + LEG_TORSO_RATIO * LEG_SAMPLES])
    profile_m = np.concatenate([trunk_m, np.mean(legs_m, axis=0)])
    relief_m = profile_m - np.polyval(np.polyfit(position, profile_m, 1), position)
    contrast_m = sum(weight * relief_m[(position >= start) & (position <= end)].mean() for start, end, weight in PROFILE_BANDS)
    torso_m = np.linalg.norm(hips - shoulders) * float(np.median(trunk_m)) / camera.fx
    return float(contrast_m / torso_m)
