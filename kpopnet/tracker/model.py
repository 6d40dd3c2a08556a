"""The human model (section 2.3): lengths and angles of one person, which never change while they are tracked."""

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS, PAPER_JOINTS, Joint

LIMB_PARENTS = {
    Joint.RIGHT_ELBOW: Joint.RIGHT_SHOULDER,
    Joint.LEFT_ELBOW: Joint.LEFT_SHOULDER,
    Joint.RIGHT_HAND: Joint.RIGHT_ELBOW,
    Joint.LEFT_HAND: Joint.LEFT_ELBOW,
    Joint.RIGHT_KNEE: Joint.RIGHT_HIP,
    Joint.LEFT_KNEE: Joint.LEFT_HIP,
    Joint.RIGHT_FOOT: Joint.RIGHT_KNEE,
    Joint.LEFT_FOOT: Joint.LEFT_KNEE,
}
"""The limb joints J_k of Eq. (9) and their parents J_p, parents first."""

Y_POSE_RAISED = 0.7
"""Arms stretched obliquely upwards."""


@dataclass(frozen=True)
class HumanModel:
    """The head-shoulder-torso structure's ten lengths and two angles, and the eight lengths of the limbs.

    The paper's notation in brackets; all lengths in metres. It does not say at which point the two angles are measured:
    here it is the torso's centre, the one point that head and shoulders share in the structure.

    Attributes:
        head_to_shoulder_line_m: from the head perpendicular to the line through the shoulders [l_H⊥S].
        shoulder_to_shoulder_m: [l_LS,RS].
        head_to_torso_m: [l_H,T].
        left_shoulder_to_torso_m: [l_LS,T].
        right_shoulder_to_torso_m: [l_RS,T].
        torso_to_hip_line_m: from the torso's centre perpendicular to the line through the hips [l_T⊥P].
        left_shoulder_to_left_hip_m: [l_LS,LP].
        left_shoulder_to_right_hip_m: [l_LS,RP].
        right_shoulder_to_left_hip_m: [l_RS,LP].
        right_shoulder_to_right_hip_m: [l_RS,RP].
        left_shoulder_angle_rad: between head and left shoulder, seen from the torso's centre [θ_LS].
        right_shoulder_angle_rad: [θ_RS].
        right_upper_arm_m, ...: a limb joint's distance to its parent [l_RUA, ...].
        arms_raised: the cosine between the upper arms and upwards, in the pose that the lengths were taken from: shoulders
            rise with the arms, by some 5 cm from hanging arms to the Y pose. Not in the paper.
    """

    head_to_shoulder_line_m: float
    shoulder_to_shoulder_m: float
    head_to_torso_m: float
    left_shoulder_to_torso_m: float
    right_shoulder_to_torso_m: float
    torso_to_hip_line_m: float
    left_shoulder_to_left_hip_m: float
    left_shoulder_to_right_hip_m: float
    right_shoulder_to_left_hip_m: float
    right_shoulder_to_right_hip_m: float
    left_shoulder_angle_rad: float
    right_shoulder_angle_rad: float
    right_upper_arm_m: float
    left_upper_arm_m: float
    right_lower_arm_m: float
    left_lower_arm_m: float
    right_upper_leg_m: float
    left_upper_leg_m: float
    right_lower_leg_m: float
    left_lower_leg_m: float
    arms_raised: float = Y_POSE_RAISED

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            least, expected = (-1, "a cosine") if name == "arms_raised" else (0, "metres or radians from 0 to pi")
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value < np.pi:
                raise InputError(f"human model: {name}={value}: expected {expected}")

    @property
    def limb_m(self) -> dict[Joint, float]:
        """l_k of Eq. (9): the length from each limb joint to its parent, in the order of `LIMB_PARENTS`."""
        return dict(zip(LIMB_PARENTS, (getattr(self, name) for name in LIMB_FIELDS), strict=True))

    @classmethod
    def from_joints(cls, joints_m: np.ndarray) -> "HumanModel":
        """The model of a person whose joints are known, for instance those of a benchmark's first frame.

        Args:
            joints_m: (15, 3) in the order of `Joint`; the neck is not looked at.

        Raises:
            InputError: another shape, or one of the fourteen joints is missing.
        """
        joints = np.asarray(joints_m, np.float64)
        if joints.shape != (NUM_JOINTS, 3):
            raise InputError(f"human model: expected ({NUM_JOINTS}, 3) joints, found {joints.shape}")
        missing = [JOINT_NAMES[joint] for joint in PAPER_JOINTS if not np.isfinite(joints[joint]).all()]
        if missing:
            raise InputError(f"human model: the joints to take it from lack {', '.join(missing)}")
        head, torso = joints[Joint.HEAD], joints[Joint.TORSO]
        left_shoulder, right_shoulder = joints[Joint.LEFT_SHOULDER], joints[Joint.RIGHT_SHOULDER]
        left_hip, right_hip = joints[Joint.LEFT_HIP], joints[Joint.RIGHT_HIP]
        limbs = [_distance(joints[child], joints[parent]) for child, parent in LIMB_PARENTS.items()]
        return cls(
            distance_to_line(head, left_shoulder, right_shoulder),
            _distance(left_shoulder, right_shoulder),
            _distance(head, torso),
            _distance(left_shoulder, torso),
            _distance(right_shoulder, torso),
            distance_to_line(torso, left_hip, right_hip),
            _distance(left_shoulder, left_hip),
            _distance(left_shoulder, right_hip),
            _distance(right_shoulder, left_hip),
            _distance(right_shoulder, right_hip),
            _angle(head - torso, left_shoulder - torso),
            _angle(head - torso, right_shoulder - torso),
            *limbs,
            arms_raised=_arms_raised(joints),
        )

    def likely(self) -> "HumanModel":
        """The lengths that somebody measured so most likely has: alike on both sides, and more as people of the size have them.

        The Y pose tells joints under flesh and clothes to 2 or 3 cm, while people of one size differ by less than that. Beyond
        the paper.
        """
        measured = {names: sum(getattr(self, name) for name in names) / len(names) for names in _LIKELY}
        size_m = sum(measured.values())
        lengths = {names: own * measured[names] + of_size * size_m for names, (own, of_size) in _LIKELY.items()}
        return replace(self, **{name: length for names, length in lengths.items() for name in names})

    def save(self, path: Path | str) -> None:
        """Writes it as JSON, for a person who will come back."""
        Path(path).write_text(json.dumps(asdict(self), indent=2) + "\n")

    @classmethod
    def load(cls, path: Path | str) -> "HumanModel":
        """Reads what `save` wrote.

        Raises:
            InputError: not there, not JSON, or not this model's lengths.
        """
        try:
            values = json.loads(Path(path).read_text())
        except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
            raise InputError(f"{path}: no human model can be read from it ({error})") from error
        expected = {field.name for field in fields(cls)}
        if not isinstance(values, dict) or set(values) != expected:
            odd = sorted(expected.symmetric_difference(values)) if isinstance(values, dict) else [type(values).__name__]
            raise InputError(f"{path}: not a human model; missing or unknown: {', '.join(odd)}")
        return cls(**values)


_LIKELY = {
    ("head_to_shoulder_line_m",): (0.182, 0.035),
    ("shoulder_to_shoulder_m",): (0.0, 0.084),
    ("head_to_torso_m",): (0.124, 0.098),
    ("left_shoulder_to_torso_m", "right_shoulder_to_torso_m"): (0.0, 0.081),
    ("torso_to_hip_line_m",): (0.0, 0.056),
    ("left_shoulder_to_left_hip_m", "right_shoulder_to_right_hip_m"): (0.0, 0.127),
    ("left_shoulder_to_right_hip_m", "right_shoulder_to_left_hip_m"): (0.0, 0.144),
    ("right_upper_arm_m", "left_upper_arm_m"): (0.286, 0.045),
    ("right_lower_arm_m", "left_lower_arm_m"): (0.419, 0.036),
    ("right_upper_leg_m", "left_upper_leg_m"): (0.471, 0.051),
    ("right_lower_leg_m", "left_lower_leg_m"): (0.290, 0.077),
}
"""Of lengths in the Y pose the share of the length as measured, the mean of both sides, and of the sum of all eleven. Least
squares, without negative shares, over the initial models of 148 simulated people in the Y pose, none of a benchmark's."""

LIMB_FIELDS = tuple(field.name for field in fields(HumanModel) if field.name.endswith(("arm_m", "leg_m")))


def _arms_raised(joints: np.ndarray) -> float:
    """The mean cosine between both upper arms and the way up from the hips to the shoulders; 0 for what has no length."""
    shoulders = joints[[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]]
    up = shoulders.mean(axis=0) - joints[[Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=0)
    arms = joints[[Joint.RIGHT_ELBOW, Joint.LEFT_ELBOW]] - shoulders
    lengths = np.linalg.norm(arms, axis=1) * np.linalg.norm(up)
    return float(np.mean(np.divide(arms @ up, lengths, out=np.zeros(2), where=lengths > 0)))


def distance_to_line(point: np.ndarray, on_line: np.ndarray, also_on_line: np.ndarray) -> float:
    """The perpendicular from a (3,) point to the line through two others; their distance if those two are one."""
    direction = also_on_line - on_line
    length = np.linalg.norm(direction)
    if length == 0:
        return _distance(point, on_line)
    return float(np.linalg.norm(np.cross(direction, point - on_line)) / length)


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b))


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Between two vectors, radians in 0..pi; 0 if one has no length."""
    lengths = np.linalg.norm(a) * np.linalg.norm(b)
    return float(np.arccos(np.clip(a @ b / lengths, -1, 1))) if lengths > 0 else 0.0
