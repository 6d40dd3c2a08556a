"""The human model (section 2.3): lengths and angles of one person, constant while the person is tracked."""

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from kpopnet.errors import check_between
from kpopnet.estimator import complete_joints
from kpopnet.runtime.input_files import as_path, read_json, settings_from
from kpopnet.skeleton import PAPER_JOINTS, Joint

DISTANCES = {
    "shoulder_to_shoulder_m": (Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER),
    "head_to_torso_m": (Joint.HEAD, Joint.TORSO),
    "left_shoulder_to_torso_m": (Joint.LEFT_SHOULDER, Joint.TORSO),
    "right_shoulder_to_torso_m": (Joint.RIGHT_SHOULDER, Joint.TORSO),
    "left_shoulder_to_left_hip_m": (Joint.LEFT_SHOULDER, Joint.LEFT_HIP),
    "left_shoulder_to_right_hip_m": (Joint.LEFT_SHOULDER, Joint.RIGHT_HIP),
    "right_shoulder_to_left_hip_m": (Joint.RIGHT_SHOULDER, Joint.LEFT_HIP),
    "right_shoulder_to_right_hip_m": (Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP),
    "right_upper_arm_m": (Joint.RIGHT_ELBOW, Joint.RIGHT_SHOULDER),
    "left_upper_arm_m": (Joint.LEFT_ELBOW, Joint.LEFT_SHOULDER),
    "right_lower_arm_m": (Joint.RIGHT_HAND, Joint.RIGHT_ELBOW),
    "left_lower_arm_m": (Joint.LEFT_HAND, Joint.LEFT_ELBOW),
    "right_upper_leg_m": (Joint.RIGHT_KNEE, Joint.RIGHT_HIP),
    "left_upper_leg_m": (Joint.LEFT_KNEE, Joint.LEFT_HIP),
    "right_lower_leg_m": (Joint.RIGHT_FOOT, Joint.RIGHT_KNEE),
    "left_lower_leg_m": (Joint.LEFT_FOOT, Joint.LEFT_KNEE),
}
"""The model's distances between two joints."""

LIMB_FIELDS = tuple(name for name in DISTANCES if name.endswith(("arm_m", "leg_m")))
LIMB_PARENTS = dict(DISTANCES[name] for name in LIMB_FIELDS)
"""The limb joints J_k of Eq. (9) and their parents J_p, parents first."""

Y_POSE_ARMS_RAISED = 0.7
"""Cosine between the upper arms and the up direction in the Y pose, arms stretched obliquely upwards."""


@dataclass(frozen=True)
class HumanModel:
    """The ten lengths and two angles of the head-shoulder-torso structure, and the eight lengths of the limbs.

    The paper's notation is in brackets. Assumption: the paper does not define the vertex of the two angles; here it is the
    torso's centre, the one point that head and shoulders share in the structure.
    """

    head_to_shoulder_line_m: float  # from the head perpendicular to the line through the shoulders [l_H⊥S]
    shoulder_to_shoulder_m: float  # from the left to the right shoulder [l_LS,RS]
    head_to_torso_m: float  # from the head to the torso's centre [l_H,T]
    left_shoulder_to_torso_m: float  # from the left shoulder to the torso's centre [l_LS,T]
    right_shoulder_to_torso_m: float  # from the right shoulder to the torso's centre [l_RS,T]
    torso_to_hip_line_m: float  # from the torso's centre perpendicular to the line through the hips [l_T⊥P]
    left_shoulder_to_left_hip_m: float  # from the left shoulder to the left hip [l_LS,LP]
    left_shoulder_to_right_hip_m: float  # from the left shoulder to the right hip [l_LS,RP]
    right_shoulder_to_left_hip_m: float  # from the right shoulder to the left hip [l_RS,LP]
    right_shoulder_to_right_hip_m: float  # from the right shoulder to the right hip [l_RS,RP]
    left_shoulder_angle_rad: float  # between head and left shoulder at the torso's centre, radians [θ_LS]
    right_shoulder_angle_rad: float  # between head and right shoulder at the torso's centre, radians [θ_RS]
    # from each limb joint to its parent, in the order of `LIMB_PARENTS` [l_RUA ...]
    right_upper_arm_m: float
    left_upper_arm_m: float
    right_lower_arm_m: float
    left_lower_arm_m: float
    right_upper_leg_m: float
    left_upper_leg_m: float
    right_lower_leg_m: float
    left_lower_leg_m: float
    # mean cosine between the upper arms and the up direction in the pose in which the lengths were measured. Shoulders rise
    # with the arms, by about 5 cm from hanging arms to the Y pose. Not in the paper.
    arms_raised: float = Y_POSE_ARMS_RAISED

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            check_between(f"human model: {name}", value, -1 if name == "arms_raised" else 0, np.pi)

    @property
    def limb_m(self) -> dict[Joint, float]:
        """l_k of Eq. (9): the length in metres from each limb joint to its parent, in the order of `LIMB_PARENTS`."""
        return {DISTANCES[name][0]: getattr(self, name) for name in LIMB_FIELDS}

    @classmethod
    def from_joints(cls, joints_m: np.ndarray) -> "HumanModel":
        """Measures the model of a person with known (15, 3) joints, metres; the neck is not used.

        Raises InputError for another shape, or if one of the fourteen joints is missing.
        """
        joints = complete_joints(joints_m, "human model", PAPER_JOINTS)
        head, torso = joints[Joint.HEAD], joints[Joint.TORSO]
        left, right = joints[Joint.LEFT_SHOULDER], joints[Joint.RIGHT_SHOULDER]
        return cls(
            **{name: float(np.linalg.norm(joints[a] - joints[b])) for name, (a, b) in DISTANCES.items()},
            head_to_shoulder_line_m=_distance_to_line(head, left, right),
            torso_to_hip_line_m=_distance_to_line(torso, joints[Joint.LEFT_HIP], joints[Joint.RIGHT_HIP]),
            left_shoulder_angle_rad=_angle(head - torso, left - torso),
            right_shoulder_angle_rad=_angle(head - torso, right - torso),
            arms_raised=_arms_raised(joints),
        )

    def scaled(self, size: float) -> "HumanModel":
        """The model of a person of the same proportions, this many times as large."""
        return replace(self, **{name: size * length for name, length in asdict(self).items() if name.endswith("_m")})

    def regularised(self) -> "HumanModel":
        """The model with lengths equal on both sides and drawn to the mean proportions of people of the same size.

        The Y pose gives joints under flesh and clothes to 2 or 3 cm. Lengths of people of one size vary by less. Beyond the
        paper.
        """
        measured = self._side_means()
        size_m = sum(measured.values())
        return self._with(
            {names: own * measured[names] + of_size * size_m for names, (own, of_size) in _REGULARISATION.items()}
        )

    def symmetric(self) -> "HumanModel":
        """The model with lengths equal on both sides, the mean of both."""
        return self._with(self._side_means())

    def _side_means(self) -> dict[tuple[str, ...], float]:
        return {names: sum(getattr(self, name) for name in names) / len(names) for names in _REGULARISATION}

    def _with(self, lengths_m: dict[tuple[str, ...], float]) -> "HumanModel":
        return replace(self, **{name: length_m for names, length_m in lengths_m.items() for name in names})

    def save(self, path: Path | str) -> None:
        """Writes the model as JSON, to be loaded for the same person later."""
        as_path(path).write_text(json.dumps(asdict(self), indent=2) + "\n")

    @classmethod
    def load(cls, path: Path | str) -> "HumanModel":
        """Reads a file that `save` wrote. Raises InputError where it is missing or damaged."""
        return settings_from(cls, read_json(as_path(path)), str(path))


_REGULARISATION = {
    ("head_to_shoulder_line_m",): (0.087, 0.039),
    ("shoulder_to_shoulder_m",): (0.000, 0.085),
    ("head_to_torso_m",): (0.072, 0.104),
    ("left_shoulder_to_torso_m", "right_shoulder_to_torso_m"): (0.000, 0.081),
    ("torso_to_hip_line_m",): (0.000, 0.056),
    ("left_shoulder_to_left_hip_m", "right_shoulder_to_right_hip_m"): (0.000, 0.126),
    ("left_shoulder_to_right_hip_m", "right_shoulder_to_left_hip_m"): (0.000, 0.143),
    ("right_upper_arm_m", "left_upper_arm_m"): (0.310, 0.043),
    ("right_lower_arm_m", "left_lower_arm_m"): (0.403, 0.041),
    ("right_upper_leg_m", "left_upper_leg_m"): (0.610, 0.034),
    ("right_lower_leg_m", "left_lower_leg_m"): (0.373, 0.069),
}
"""Regularised length = first coefficient x measured length (mean of both sides) + second coefficient x sum of all eleven
measured lengths, in the Y pose. Non-negative least squares over the initial models of 215 simulated people in the Y pose
(split train); `tools/tracker_constants.py y_pose` prints them again."""


def _arms_raised(joints: np.ndarray) -> float:
    """Mean cosine between both upper arms and the direction from the hips to the shoulders; 0 where a length is zero."""
    shoulders = joints[[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]]
    up = shoulders.mean(axis=0) - joints[[Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=0)
    arms = joints[[Joint.RIGHT_ELBOW, Joint.LEFT_ELBOW]] - shoulders
    lengths = np.linalg.norm(arms, axis=1) * np.linalg.norm(up)
    cosines = np.divide(arms @ up, lengths, out=np.zeros(2), where=lengths > 0)
    return float(np.clip(cosines, -1, 1).mean())  # rounding may exceed them


def _distance_to_line(point: np.ndarray, line_a: np.ndarray, line_b: np.ndarray) -> float:
    """Distance in metres of a (3,) point from the line through two others; its distance to line_a if the two are equal."""
    direction = line_b - line_a
    length = np.linalg.norm(direction)
    if length == 0:
        return float(np.linalg.norm(point - line_a))
    return float(np.linalg.norm(np.cross(direction, point - line_a)) / length)


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two (3,) vectors, radians in 0..pi; 0 if one has length zero."""
    lengths = np.linalg.norm(a) * np.linalg.norm(b)
    return float(np.arccos(np.clip(a @ b / lengths, -1, 1))) if lengths > 0 else 0.0
