"""Front or back: from either side a person in the Y pose has almost the same silhouette, but not the same relief."""

import numpy as np

from kpopnet.camera import Camera
from kpopnet.skeleton import Joint
from kpopnet.tracker.initial_depth import surface_m, surface_radius_px

ON_TRUNK = np.arange(-7, 13) / 10
"""Where depth is taken along the trunk: from the middle of the shoulders (0) to that of the hips (1), head included."""

ON_LEGS = np.arange(1, 11) / 10
"""Where it is taken along the legs: from hip (0) over knee (1/2) to the tip of the foot (1)."""

LEG_IN_TORSOS = 1.9

CONTRAST = (
    (-0.5, -0.2, -0.5),  # chin and throat, or nape
    (0.0, 0.2, 1.0),  # chest, or shoulder blades
    (2.1, 2.6, 1.0),  # shins, or calves
    (2.9, 2.9, -0.5),  # toes, or heels
)
"""From, to and weight of the parts of the profile in torsos below the shoulders. Nape and feet vary twice as much."""


def frontness(person_m: np.ndarray, uv: np.ndarray, tips: tuple[np.ndarray, np.ndarray], camera: Camera) -> float:
    """Above 0 if the person's front is seen, below if their back.

    From the depth along the body, head to toes, against a straight line through it: seen from the front, chin and toes
    are nearer than that, chest and shins farther; from behind, shoulder blades and calves are nearer, nape and heels
    farther. The contrast between them is given in torsos.

    Args:
        person_m: (H, W) depth.
        uv: (15, 2) joints in the image, right and left as if the person faced the camera.
        tips: u, v of the ends of the right and the left leg.
        camera: the camera.
    """
    shoulders = (uv[Joint.RIGHT_SHOULDER] + uv[Joint.LEFT_SHOULDER]) / 2
    hips = (uv[Joint.RIGHT_HIP] + uv[Joint.LEFT_HIP]) / 2
    radius_px = surface_radius_px(person_m, camera)
    trunk_m = [surface_m(person_m, shoulders + share * (hips - shoulders), radius_px) for share in ON_TRUNK]
    legs_m = []
    for hip, knee, tip in ((Joint.RIGHT_HIP, Joint.RIGHT_KNEE, tips[0]), (Joint.LEFT_HIP, Joint.LEFT_KNEE, tips[1])):
        way = np.stack([uv[hip], uv[knee], tip])
        points = np.stack([np.interp(ON_LEGS, (0, 0.5, 1), way[:, axis]) for axis in (0, 1)], axis=1)
        legs_m.append([surface_m(person_m, point, radius_px) for point in points])
    along = np.concatenate([ON_TRUNK, 1 + LEG_IN_TORSOS * ON_LEGS])
    profile_m = np.concatenate([trunk_m, np.mean(legs_m, axis=0)])
    relief_m = profile_m - np.polyval(np.polyfit(along, profile_m, 1), along)
    contrast_m = sum(weight * relief_m[(along >= start) & (along <= end)].mean() for start, end, weight in CONTRAST)
    torso_m = np.linalg.norm(hips - shoulders) * float(np.median(trunk_m)) / camera.fx
    return float(contrast_m / torso_m)
