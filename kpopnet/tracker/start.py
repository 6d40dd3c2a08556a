"""Where a tracker starts: from the Y pose, from a network's joints, or from a person who stands or sits upright.

The latter is beyond the paper, for recordings without the Y pose. A person of an adult's average proportions, who may have a
child's size, is put at the silhouette, standing and sitting, in several headings, and fitted to the depth. The pose that fits
best is the start, if it fits well enough; the lengths of the person are known only roughly then.
"""

from collections.abc import Iterator

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.geometry.body import LIMBS, body_from_model, planar_pose
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import Joint
from kpopnet.tracker.fit import fit, pose_cost
from kpopnet.tracker.limbs import refit_limbs
from kpopnet.y_pose.initial_pose import find_initial_pose

WAYS = {
    "auto": ("y_pose", "detector", "standing", "sitting"),
    "y_pose": ("y_pose",),
    "standing": ("standing",),
    "label": (),
}
"""The ways that each setting of `start` allows, in the order in which they are tried in a frame."""

AWAITED = {
    "auto": "took the Y pose (facing the camera, arms stretched obliquely upwards), or stood or sat upright and whole in view",
    "y_pose": "took the Y pose (facing the camera, arms stretched obliquely upwards); with start=auto the tracker starts from "
    "any person who stands or sits upright",
    "standing": "stood upright; with start=auto the tracker also starts from the Y pose and from people who sit",
    "label": "was given as a start; start=label needs the true joints of a frame, else set start=auto",
}
"""What the tracker waits for: "no person ..."."""

MIN_DETECTED = 0.5
"""A detector's pose is a start if its confidence is at least this in the mean over the joints."""

AVERAGE_MODEL = HumanModel(
    head_to_shoulder_line_m=0.233, shoulder_to_shoulder_m=0.358, head_to_torso_m=0.460,
    left_shoulder_to_torso_m=0.291, right_shoulder_to_torso_m=0.291, torso_to_hip_line_m=0.229,
    left_shoulder_to_left_hip_m=0.464, left_shoulder_to_right_hip_m=0.543,
    right_shoulder_to_left_hip_m=0.543, right_shoulder_to_right_hip_m=0.464,
    left_shoulder_angle_rad=0.667, right_shoulder_angle_rad=0.667,
    right_upper_arm_m=0.262, left_upper_arm_m=0.262, right_lower_arm_m=0.293, left_lower_arm_m=0.293,
    right_upper_leg_m=0.380, left_upper_leg_m=0.380, right_lower_leg_m=0.462, left_lower_leg_m=0.462,
    arms_raised=-0.962,
)  # fmt: skip
"""Means of 211 simulated adults (split train) who stand with hanging arms before a level camera."""

AVERAGE_HEIGHT_M = 1.671
"""Mean height of the same people's silhouettes, with hair and shoes, in metres, by all pixels.
`tools/tracker_constants.py standing` prints it and the model again."""

STANDING_HEIGHT_RANGE_M, SITTING_HEIGHT_RANGE_M = (1.05, 2.2), (0.9, 1.6)
"""Heights of silhouettes, in metres, at which a person is tried standing and sitting."""

SIZE_RANGE = (0.65, 1.15)
"""Sizes of people who stand and are tried, relative to the average adult: from children of six years on."""

TOP_M, MAX_TOP_WIDTH_M = 0.22, 0.5
"""The uppermost `TOP_M` metres are the head: silhouettes that are wider there than `MAX_TOP_WIDTH_M` have raised hands, which
would count as height. Of the same people the widest top has 0.43 m; of 259 in the Y pose 99 % have more than 0.58 m."""

HEAD_BELOW_TOP = 0.07
"""Distance of the head's centre from the highest point, as a fraction of the height; same people."""

TRUNK_BAND_M, JOINT_DEPTH_OFFSET_M = (0.25, 0.6), 0.1
"""Below the highest point by this many metres lies the trunk, whose median point gives the place; joints lie behind it by
`JOINT_DEPTH_OFFSET_M`."""

HEADINGS_RAD = tuple(np.radians((0, -50, 50)))

START_ITERATIONS, FINAL_ITERATIONS = 8, 6
SUBSAMPLE_POINTS = 200
"""Gauss-Newton iterations before and after the limbs are refitted, the former with about this number of points."""

MAX_COST_M2 = 1.2e-3
"""Largest cost of a start, square metres. Of simulated people (split train) found within 8 cm 99 % have at most 1.0e-3."""


FoundStart = tuple[np.ndarray, HumanModel]
"""(15, 3) joints to track from, in the camera frame in metres, and the person's lengths, as far as that start knows them."""


def find_start(
    depth_m: np.ndarray, grid: DepthGrid, camera: Camera, start: str, detector: Estimator | None = None
) -> FoundStart | None:
    """A pose to start from in an (H, W) float32 depth image of the person, metres, or None; `start` is a key of `WAYS`."""
    ways = WAYS[start]
    if "y_pose" in ways and (joints_m := find_initial_pose(depth_m, camera)) is not None:
        return joints_m, HumanModel.from_joints(joints_m).regularised()
    if "detector" in ways and detector is not None and (found := _detected(depth_m, camera, detector)) is not None:
        return found
    return find_upright(grid, ways)


def _detected(depth_m: np.ndarray, camera: Camera, detector: Estimator) -> FoundStart | None:
    seen = detector.estimate(depth_m[None], camera)
    joints_m = seen.joints_camera_m[0].astype(np.float64)
    if not np.isfinite(joints_m).all() or seen.confidence[0].mean() < MIN_DETECTED:
        return None
    try:
        return joints_m, HumanModel.from_joints(joints_m).symmetric()
    except InputError:  # a length of zero
        return None


def find_upright(grid: DepthGrid, postures: tuple[str, ...] = ("standing", "sitting")) -> FoundStart | None:
    """The person in the image in the heading, and of the postures, that fit best; None if none fits well enough."""
    height_m, top_width_m, place_m = _silhouette(grid)
    if top_width_m > MAX_TOP_WIDTH_M:
        return None
    stride = max(1, len(grid.points_m) // SUBSAMPLE_POINTS)
    best, least_m2 = None, MAX_COST_M2
    for model, pose_m in _people(height_m, postures):
        body = body_from_model(model)
        for heading in HEADINGS_RAD:
            joints_m = fit(pose_m @ _about_vertical(heading) + place_m, grid, body, START_ITERATIONS, stride)
            joints_m, _ = refit_limbs(joints_m, joints_m, grid, body, stride)
            joints_m = fit(joints_m, grid, body, FINAL_ITERATIONS)
            if (cost_m2 := pose_cost(joints_m, grid, body, 1)) < least_m2:
                best, least_m2 = (joints_m, model), cost_m2
    return best


def _people(height_m: float, postures: tuple[str, ...]) -> Iterator[tuple[HumanModel, np.ndarray]]:
    """Lengths and (15, 3) pose of the people who could have a silhouette of this height, in each of the postures.

    They face the camera; the origin is their highest point above the hips.
    """
    poses = []
    if "standing" in postures and STANDING_HEIGHT_RANGE_M[0] <= height_m <= STANDING_HEIGHT_RANGE_M[1]:
        model = AVERAGE_MODEL.scaled(float(np.clip(height_m / AVERAGE_HEIGHT_M, *SIZE_RANGE)))
        poses.append((model, planar_pose(model)))
    if "sitting" in postures and SITTING_HEIGHT_RANGE_M[0] <= height_m <= SITTING_HEIGHT_RANGE_M[1]:
        poses.append((AVERAGE_MODEL, sitting_pose(AVERAGE_MODEL)))
    for model, pose in poses:
        yield model, pose + np.array((0, HEAD_BELOW_TOP * AVERAGE_HEIGHT_M - pose[Joint.HEAD, 1], 0))


def sitting_pose(model: HumanModel) -> np.ndarray:
    """(15, 3) metres: a person who sits facing the camera, hands on the thighs, the middle of the shoulders at the origin."""
    pose, limb_m = planar_pose(model), model.limb_m
    arms, legs = ((0, 0.95, -0.31), (0, 0.45, -0.89)), ((0, 0.1, -0.995), (0, 1, 0))
    for (root, middle, end), (upper, lower) in zip(LIMBS, (arms, arms, legs, legs), strict=True):
        pose[middle] = pose[root] + np.multiply(upper, limb_m[middle])
        pose[end] = pose[middle] + np.multiply(lower, limb_m[end])
    return pose


def _silhouette(grid: DepthGrid) -> tuple[float, float, np.ndarray]:
    """Height of the silhouette and width of its uppermost `TOP_M`, metres, and (3,) x and z of the trunk's joints and y of the
    highest pixel, camera frame, metres. By all pixels: cells would lose some of top and bottom.
    """
    fx, fy, cx, cy = grid.intrinsics[:4]
    v, u = np.nonzero(grid.depth_m > 0)
    z = grid.depth_m[v, u]
    x, y = (u - cx) * z / fx, (v - cy) * z / fy
    top, bottom = np.percentile(y, (0.1, 99.9))
    trunk = (y > top + TRUNK_BAND_M[0]) & (y < top + TRUNK_BAND_M[1])
    where = trunk if trunk.any() else np.ones(len(y), bool)
    place_m = np.array((np.median(x[where]), top, np.median(z[where]) + JOINT_DEPTH_OFFSET_M))
    return float(bottom - top), float(np.ptp(x[y < top + TOP_M])), place_m


def _about_vertical(angle_rad: float) -> np.ndarray:
    """(3, 3) rotation of row vectors about the camera's vertical, by an angle to the person's left."""
    return np.array([[np.cos(angle_rad), 0, np.sin(angle_rad)], [0, 1, 0], [-np.sin(angle_rad), 0, np.cos(angle_rad)]])
