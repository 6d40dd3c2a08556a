"""What the paper's text leaves insufficient, mended: the repaired tracker's `Plan` of a frame from the printed one.

The gains are those of all repairs over all but this one, in joints within 10 cm in simulated slow motion: 22 % with the repair
of the points alone, 84 % with all repairs. docs/trackers.md has the reasons at length and more figures.
"""

import math

import numpy as np

from kpopnet.geometry.body import PARTS, RIGHT_RIBS, Body, body_from_model
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.algorithm2 import (
    CARRIED,
    HEAD,
    LEFT_HIP,
    LEFT_SHOULDER,
    RIGHT_HIP,
    RIGHT_SHOULDER,
    TORSO,
    TRUNK,
    Plan,
    State,
)
from kpopnet.skeleton import NUM_JOINTS, Joint

NEAR_TRUNK = np.isin(np.arange(NUM_JOINTS), [*TRUNK, Joint.RIGHT_ELBOW, Joint.LEFT_ELBOW])
"""(15,) the joints whose candidates are taken from raw depth."""

LOST_FRAMES, WIDER = 5, 2.0
"""Joints lost for more than `LOST_FRAMES` frames are looked for `WIDER` times as far."""

EPSILON_R = 0.55
"""Largest circle ratio of ridge data, Eq. (2). With the paper's 0.3 almost no pixel is left (`kpopnet.ridge`)."""

SUFFICIENT = 3
"""Least number of valid candidates."""


def repaired(printed: Plan, state: State, model: HumanModel) -> Plan:
    """The plan with every repair, after `state`, for the person of the model; raw depth is sampled once per cell."""
    body = body_from_model(model)
    distance_m, head_to_shoulder_line_m = _lengths_in(state.joints, printed.distance_m, model, body)
    return printed._replace(
        # No velocity in Eq. (3), which feeds the noise of every joint back undamped: 10 points.
        predicted=state.joints.copy(),
        # Nothing in slow motion, at 30 fps 2 points.
        radius_m=printed.radius_m * np.where(state.lost > LOST_FRAMES, WIDER, 1.0),
        # Shoulders, hips and elbows have no ridge data of their own, and stray ones suffice: 11 points.
        on_ridge=printed.on_ridge & ~NEAR_TRUNK,
        distance_m=distance_m,
        head_to_shoulder_line_m=head_to_shoulder_line_m,
        # Joints lie inside the body, candidates on its surface: each is moved along its ray before any distance is measured.
        depth_m=joint_depth_m(body.radii_m),
        sufficient=SUFFICIENT,
        # A joint without candidates moves with its parent, the trunk's joints with the head.
        lost=CARRIED,
    )


def joint_depth_m(radii_m: np.ndarray) -> np.ndarray:
    """(15,) the smallest radius of the parts that end at each joint, the ribs' for the torso, from (P, 2) radii in metres."""
    depth_m, joints = np.full(NUM_JOINTS, np.inf), np.where(PARTS == RIGHT_RIBS, TORSO, PARTS)
    is_joint = joints < NUM_JOINTS
    np.minimum.at(depth_m, joints[is_joint], radii_m[is_joint])
    return depth_m


def _lengths_in(joints_m: np.ndarray, printed_m: np.ndarray, model: HumanModel, body: Body) -> tuple[np.ndarray, float]:
    """(15, 15) distances and l_H⊥S of a person in the pose of (15, 3) joints, from the (15, 15) distances as printed.

    The distances from head to shoulders are added, by the model's angles, which no equation uses: 31 points. Without them both
    shoulders may slide along their line in Eq. (6). And shoulders are as high as the arms are raised: 4 points. Arms lift the
    shoulders by 5 cm in the Y pose. The distances of the shoulders to torso and hips change as those of simulated dancers
    (kpopnet.geometry.body); what the line of the shoulders goes up it comes nearer to the head.
    """
    up = joints_m[RIGHT_SHOULDER] + joints_m[LEFT_SHOULDER] - joints_m[RIGHT_HIP] - joints_m[LEFT_HIP]
    distance_m, rise_m = printed_m.copy(), np.zeros(2)
    for (a, b), arm, gain_m in zip(body.pairs, body.elevating_arm, body.elevation_gain_m, strict=True):
        if arm < 0:
            continue
        upper_arm = joints_m[Joint.RIGHT_ELBOW + arm] - joints_m[RIGHT_SHOULDER + arm]
        cosine = (upper_arm @ up) / math.sqrt((upper_arm @ upper_arm) * (up @ up) + 1e-12)
        change_m = gain_m[0] * (cosine - model.arms_raised) + gain_m[1] * (cosine**2 - model.arms_raised**2)
        if distance_m[a, b] > 0:
            distance_m[a, b] += change_m
            distance_m[b, a] += change_m
        if TORSO in (a, b):
            rise_m[arm] = change_m
    line_m, a_m = model.head_to_shoulder_line_m, model.head_to_torso_m
    for arm, b_m, angle_rad in (
        (0, model.right_shoulder_to_torso_m, model.right_shoulder_angle_rad),
        (1, model.left_shoulder_to_torso_m, model.left_shoulder_angle_rad),
    ):
        to_head_m = math.sqrt(a_m**2 + b_m**2 - 2 * a_m * b_m * math.cos(angle_rad))
        squared = to_head_m**2 - line_m**2 + (line_m - rise_m[arm]) ** 2
        shoulder = RIGHT_SHOULDER + arm
        distance_m[HEAD, shoulder] = distance_m[shoulder, HEAD] = math.sqrt(max(squared, 0.0))
    return distance_m, line_m - rise_m.mean()
