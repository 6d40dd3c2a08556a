"""Initialisation without a start pose: an average person of the silhouette's height, standing with hanging arms.

Beyond the paper, for recordings without the Y pose. The lengths are average lengths scaled to the height: less accurate
than a model measured in the Y pose.
"""

from dataclasses import asdict

import numpy as np

from kpopnet.geometry.body import planar_pose
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import Joint

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

AVERAGE_HEIGHT_M = 1.661
"""Mean height of the same people's silhouettes on the grid, with hair and shoes, in metres. Every fourth pixel is one of the
grid's: about 3 cm of top and bottom are lost. `tools/tracker_constants.py standing` prints it and the model again."""

HEIGHT_RANGE_M = (1.2, 2.2)
MIN_HEIGHT_TO_WIDTH = 1.8
"""Silhouettes outside this range of heights in metres, or with a smaller ratio of height to width, are not accepted."""
TOP, MAX_TOP_WIDTH = 0.13, 0.3
"""The silhouette's uppermost `TOP` is the head: silhouettes that are wider there have raised hands. Both in heights of the
silhouette. Of the same people the widest top has 0.26; of 259 in the Y pose 99 % have more than 0.35."""

HEAD_BELOW_TOP = 0.07
"""Distance of the head's centre from the highest point, as a fraction of the height; same people."""

JOINT_DEPTH_OFFSET_M = 0.08
"""Depth of a standing person's joints behind the median visible point, in metres; same people."""


def standing_pose(grid: DepthGrid) -> tuple[np.ndarray, HumanModel] | None:
    """(15, 3) joints in the camera frame in metres and the model of a person who stands upright and faces the camera.

    None if the silhouette is not that of a person standing so: too low, too high, too wide, or with raised hands.
    """
    points = grid.points_m
    if not len(points):
        return None
    left, right = np.percentile(points[:, 0], (1, 99))
    top, bottom = points[:, 1].min(), points[:, 1].max()
    height_m = bottom - top
    if not HEIGHT_RANGE_M[0] <= height_m <= HEIGHT_RANGE_M[1] or height_m < MIN_HEIGHT_TO_WIDTH * (right - left):
        return None
    if np.ptp(points[points[:, 1] < top + TOP * height_m, 0]) > MAX_TOP_WIDTH * height_m:
        return None
    scale = height_m / AVERAGE_HEIGHT_M
    model = HumanModel(
        **{name: value * scale if name.endswith("_m") else value for name, value in asdict(AVERAGE_MODEL).items()}
    )
    pose = planar_pose(model)
    centre = np.median(points, axis=0)
    pose += centre[0], top + HEAD_BELOW_TOP * height_m - pose[Joint.HEAD, 1], centre[2] + JOINT_DEPTH_OFFSET_M
    return pose, model
