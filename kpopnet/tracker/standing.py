"""A start without a start pose: an average person, of the silhouette's height, who stands with hanging arms.

Beyond the paper, for recordings in which nobody takes the Y pose. The lengths are those of the average, scaled: less
true than a model from the Y pose.
"""

from dataclasses import asdict

import numpy as np

from kpopnet.skeleton import Joint
from kpopnet.tracker.body import plane_figure
from kpopnet.tracker.cells import Cells
from kpopnet.tracker.model import HumanModel

AVERAGE = HumanModel(
    head_to_shoulder_line_m=0.234, shoulder_to_shoulder_m=0.351, head_to_torso_m=0.462,
    left_shoulder_to_torso_m=0.289, right_shoulder_to_torso_m=0.289, torso_to_hip_line_m=0.229,
    left_shoulder_to_left_hip_m=0.464, left_shoulder_to_right_hip_m=0.542,
    right_shoulder_to_left_hip_m=0.542, right_shoulder_to_right_hip_m=0.464,
    left_shoulder_angle_rad=0.657, right_shoulder_angle_rad=0.657,
    right_upper_arm_m=0.258, left_upper_arm_m=0.258, right_lower_arm_m=0.247, left_lower_arm_m=0.247,
    right_upper_leg_m=0.378, left_upper_leg_m=0.378, right_lower_leg_m=0.465, left_lower_leg_m=0.465,
    arms_raised=-0.73,
)  # fmt: skip
"""Means of 300 simulated adults, drawn as for training, whose height is on average `AVERAGE_HEIGHT_M`."""

AVERAGE_HEIGHT_M = 1.715
HEIGHTS_M = (1.2, 2.2)
LEAST_HEIGHT_TO_WIDTH = 1.8
HEAD_UNDER_CROWN = 0.07
"""The head's centre lies so much of the height below the highest point."""

DEPTH_INSIDE_M = 0.12
"""The joints of a standing person lie about so far behind the middle of what is seen of them."""


def standing_pose(cells: Cells) -> tuple[np.ndarray, HumanModel] | None:
    """(15, 3) joints in the camera frame and the model of somebody who stands upright and faces the camera.

    None if the silhouette is not that of a standing person: too low, too high or too wide.
    """
    points = cells.points_m
    if not len(points):
        return None
    left, right = np.percentile(points[:, 0], (1, 99))
    top, bottom = points[:, 1].min(), points[:, 1].max()
    height_m = bottom - top
    if not HEIGHTS_M[0] <= height_m <= HEIGHTS_M[1] or height_m < LEAST_HEIGHT_TO_WIDTH * (right - left):
        return None
    scale = height_m / AVERAGE_HEIGHT_M
    model = HumanModel(**{name: v * scale if name.endswith("_m") else v for name, v in asdict(AVERAGE).items()})
    figure = plane_figure(model)
    middle = np.median(points, axis=0)
    figure += middle[0], top + HEAD_UNDER_CROWN * height_m - figure[Joint.HEAD, 1], middle[2] + DEPTH_INSIDE_M
    return figure, model
