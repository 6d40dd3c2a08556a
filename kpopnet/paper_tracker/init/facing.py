"""Front or back: the silhouettes of a person in the Y pose are almost the same from both sides, the depth profiles differ."""

import numpy as np

from kpopnet.camera import Camera
from kpopnet.paper_tracker.init.depth import surface_m, surface_radius_px
from kpopnet.skeleton import Joint

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
