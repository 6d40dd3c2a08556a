"""The ways to start, in the order in which they are tried in a frame."""

from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.init.y_pose import InitialConfig, find_initial_pose
from kpopnet.ridge import RidgeConfig
from kpopnet.tracker.lengths import SIZE_DEVIATION
from kpopnet.tracker.start.upright import find_upright

WAYS = {
    "auto": ("y_pose", "detector", "standing", "sitting"),
    "y_pose": ("y_pose",),
    "standing": ("standing",),
    "label": (),
}
"""The ways that each setting of `start` allows. A detector is asked only where one is handed in."""

AWAITED = {
    "auto": "took the Y pose (facing the camera, arms stretched obliquely upwards), or stood or sat upright and whole in view",
    "y_pose": "took the Y pose (facing the camera, arms stretched obliquely upwards); with start=auto the tracker starts from "
    "anybody who stands or sits upright",
    "standing": "stood upright; with start=auto the tracker also starts from the Y pose and from people who sit",
    "label": "was given as a start; start=label needs the true joints of a frame, else set start=auto",
}
"""What the tracker waits for: "no person ..."."""

Y_POSE_DEVIATION, DETECTED_DEVIATION = 0.02, 0.03
"""Standard deviations of the size of a person measured in the Y pose or by a detector, as fractions. Found upright: as among
people."""

MIN_DETECTED = 0.5
"""A detector's pose is a start if its confidence is at least this in the mean over the joints."""


class FoundStart(NamedTuple):
    """A pose to track from.

    Attributes:
        joints_camera_m: (15, 3) joints in the camera frame in metres.
        model: the person's lengths, as far as this way to start knows them.
        size_deviation: standard deviation of the error of their common scale, as a fraction.
        way: y_pose, detector, standing or sitting.
    """

    joints_camera_m: np.ndarray
    model: HumanModel
    size_deviation: float
    way: str


def find_start(
    depth_m: np.ndarray, grid: DepthGrid, camera: Camera, start: str, ridge: RidgeConfig, detector: Estimator | None = None
) -> FoundStart | None:
    """A pose to start from in this frame, or None.

    Args:
        depth_m: (H, W) float32 metres of the person, 0 elsewhere.
        grid: the same image on the grid.
        camera: its camera.
        start: a key of `WAYS`.
        ridge: parameters of the ridge data, in which the Y pose is looked for.
        detector: a network, for instance.
    """
    ways = WAYS[start]
    if "y_pose" in ways and (initial := find_initial_pose(depth_m, camera, InitialConfig(ridge=ridge))) is not None:
        model = HumanModel.from_joints(initial.joints_camera_m).regularised()
        return FoundStart(initial.joints_camera_m, model, Y_POSE_DEVIATION, "y_pose")
    if "detector" in ways and detector is not None and (found := _detected(depth_m, camera, detector)) is not None:
        return found
    upright = find_upright(grid, tuple(way for way in ways if way in ("standing", "sitting")))
    return None if upright is None else FoundStart(upright.joints_camera_m, upright.model, SIZE_DEVIATION, upright.posture)


def _detected(depth_m: np.ndarray, camera: Camera, detector: Estimator) -> FoundStart | None:
    seen = detector.estimate(depth_m[None], camera)
    joints_m = seen.joints_camera_m[0].astype(np.float64)
    if not np.isfinite(joints_m).all() or seen.confidence[0].mean() < MIN_DETECTED:
        return None
    try:
        model = HumanModel.from_joints(joints_m).symmetric()
    except InputError:  # a length of zero
        return None
    return FoundStart(joints_m, model, DETECTED_DEVIATION, "detector")
