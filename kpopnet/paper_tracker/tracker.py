"""The paper's tracker: initial model from the Y pose (section 2.3), then Algorithm 2 frame by frame (section 2.4).

    depth of the person -> ridge data -> initial model, once
    depth of the person -> ridge data -> prediction, candidates, pruning, joints, in every frame

Nothing depends on wall-clock time: equal input gives equal output.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Start, start_pose, track_sequence
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.algorithm2 import Frame, Plan, State, Structure, frame_of, structure_of, track_frame
from kpopnet.paper_tracker.repairs import repaired
from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.skeleton import NUM_JOINTS, PAPER_JOINTS
from kpopnet.y_pose.initial_pose import find_initial_pose

MIN_POINTS = 60
"""Smallest number of cells in which a person is seen: 0.024 square metres."""

AWAITED = {
    "y_pose": "took the Y pose (facing the camera, arms stretched obliquely upwards); start=label starts from true joints, and "
    "estimator=tracker from other poses",
    "label": "was given as a start; start=label needs the true joints of a frame",
}
"""What the tracker waits for: "no person ..."."""

CONFIDENCE_WEIGHTS = (-6.460, 1.765, 5.822)
"""Weights of `evidence_of`, fitted to the repaired tracker on simulated people whom no benchmark shows
(tools/fit_confidence.py). The calibration error there is 4.9 %, and 5.0 % of the tracker as printed."""


@dataclass(frozen=True)
class PaperTrackerConfig:
    """Settings of the paper's tracker.

    Attributes:
        candidates: ridge (raw depth only where ridge data are insufficient) or depth (raw depth only, the comparison of
            Fig. 10).
        r_m: search radius of a joint in metres, r_j of Eqs. (4) and (12).
        epsilon_m: tolerance of lengths in metres, epsilon_j of Eqs. (5) to (9).
        straightness: minimum ratio of straight to geodesic distance, epsilon_L of Eq. (9).
        repaired: with what the paper's text leaves insufficient mended (kpopnet.paper_tracker.repairs).
        start: y_pose (waits for the paper's start pose) or label (the benchmark's true joints in the first frame that has all
            of them).
        model: path of a file that `HumanModel.save` wrote for this person; by default the model is measured at the start.
    """

    candidates: str = "ridge"
    r_m: float = 0.11
    epsilon_m: float = 0.05
    straightness: float = 0.7
    repaired: bool = False
    start: str = "y_pose"
    model: str | None = None

    def __post_init__(self) -> None:
        if self.candidates not in ("ridge", "depth"):
            raise InputError(f"paper_tracker: candidates={self.candidates}: expected ridge or depth")
        if self.start not in ("y_pose", "label"):
            raise InputError(f"paper_tracker: start={self.start}: expected one of y_pose, label")
        if not (0 < self.r_m <= 2 and 0 < self.epsilon_m <= 1 and 0 <= self.straightness < 1):
            raise InputError(
                "paper_tracker: expected r_m in 0..2 m, epsilon_m in 0..1 m and straightness in 0..1, found "
                f"{self.r_m}, {self.epsilon_m} and {self.straightness}"
            )


class PaperTracker:
    """Tracks one person through consecutive frames. Without a given start pose it waits for the Y pose.

    Attributes:
        model: the person's lengths, None before the start unless given; `HumanModel.save` stores it for later recordings.
        structure: the model for the kernels; None before the start.
        state: the last pose, its velocity, and for how long each joint has been lost; None before the start.
        evidence: (15, 3) what the confidence of the last pose was computed from; None before the start.
    """

    def __init__(
        self, camera: Camera, config: PaperTrackerConfig = PaperTrackerConfig(), model: HumanModel | None = None
    ) -> None:
        """Prepares a tracker; the model of a known person is used instead of the one measured at the start."""
        self.camera, self.config, self.model = camera, config, model
        self.structure: Structure | None = None
        self.state: State | None = None
        self.evidence: np.ndarray | None = None

    @property
    def started(self) -> bool:
        """Whether there is a pose to track from."""
        return self.state is not None

    def start(self, joints_camera_m: np.ndarray) -> None:
        """Starts from a known pose, (15, 3) joints in the camera frame in metres; measures the model unless there is one.

        Raises:
            InputError: another shape, or joints are missing.
        """
        joints = start_pose(joints_camera_m, "paper tracker")
        self.model = self.model or HumanModel.from_joints(joints)
        self.structure = structure_of(self.model)
        self.state = State(joints, np.zeros_like(joints), np.zeros(NUM_JOINTS, np.int64))

    def track(self, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tracks the person in the next (H, W) float32 depth image, metres, 0 where the person is not.

        Returns:
            (15, 3) float64 joints in the camera frame in metres and (15,) confidence, the estimated probability of an error
            below 10 cm; NaN and 0 before the start and in frames without a visible person.
        """
        frame = self.frame(depth_m)
        if len(frame.raw_m) < MIN_POINTS or not (self.started or self._find_start(depth_m)):
            return np.full((NUM_JOINTS, 3), np.nan), np.zeros(NUM_JOINTS)
        self.state, support = track_frame(frame, self.state, self.plan())
        self.evidence = evidence_of(support)
        return self.state.joints.copy(), expit(self.evidence @ np.array(CONFIDENCE_WEIGHTS))

    def frame(self, depth_m: np.ndarray) -> Frame:
        """The points of an (H, W) image in metres that Algorithm 2 chooses from."""
        return frame_of(depth_m, ridge_data(depth_m, RidgeConfig()), self.camera)

    def plan(self) -> Plan:
        """What Algorithm 2 goes by in the next frame."""
        config = self.config
        printed = Plan(
            predicted=self.state.joints + self.state.velocity,  # Eq. (3)
            radius_m=np.full(NUM_JOINTS, config.r_m),
            on_ridge=np.full(NUM_JOINTS, config.candidates == "ridge"),
            structure=self.structure,
            epsilon_m=config.epsilon_m,
            straightness=config.straightness,
        )
        return repaired(printed, self.state, self.model) if config.repaired else printed

    def _find_start(self, depth_m: np.ndarray) -> bool:
        """Starts if the frame shows the Y pose; returns whether the tracker has started."""
        initial = find_initial_pose(depth_m, self.camera)
        if initial is not None:
            self.start(initial.joints_camera_m)
        return self.started


class PaperTrackerEstimator:
    """Implements kpopnet.estimator.StartedEstimator. Each sequence is tracked independently, from its own start."""

    name = "paper_tracker"

    def __init__(self, config: PaperTrackerConfig = PaperTrackerConfig()) -> None:
        """Loads the human model if the settings name one.

        Raises:
            InputError: the model cannot be read.
        """
        self.config = config
        self.model = None if config.model is None else HumanModel.load(config.model)
        self.starts_from_label = config.start == "label"

    def estimate(self, depth_m: np.ndarray, camera: Camera, start: Start | None = None) -> Estimate:
        """See `kpopnet.estimator.StartedEstimator`."""
        tracker = PaperTracker(camera, self.config, self.model)
        return track_sequence(tracker, sequence_in_metres(depth_m, camera), start, AWAITED[self.config.start])


def evidence_of(support: np.ndarray) -> np.ndarray:
    """(15, 3) evidence of a joint's confidence from (15,) numbers of valid candidates.

    It is 1, whether the joint has any, and the share of the fourteen that have. Algorithm 2 has no measure of fit: a joint with
    candidates may lie on another limb, and the confidence cannot know it.
    """
    found = (support > 0).astype(np.float64)
    return np.stack([np.ones_like(found), found, np.full_like(found, found[list(PAPER_JOINTS)].mean())], axis=-1)
