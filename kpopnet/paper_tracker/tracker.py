"""The paper's tracker: initial model from the Y pose (section 2.3), then Algorithm 2 frame by frame (section 2.4).

    depth of the person -> ridge data -> initial model on the surface, once
    depth of the person -> ridge data -> prediction, candidates, pruning, joints, in every frame

Nothing depends on wall-clock time: equal input gives equal output.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from kpopnet.camera import Camera, check_camera, check_metres, sequence_in_metres, subsampled
from kpopnet.errors import InputError, check_number, check_one_of, check_type
from kpopnet.estimator import Estimate, Start, complete_joints, track_sequence
from kpopnet.geometry.human_model import DISTANCES, HumanModel
from kpopnet.paper_tracker.algorithm2 import Frame, Plan, State, frame_of, track_frame
from kpopnet.paper_tracker.repairs import EPSILON_R, repaired
from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.skeleton import NUM_JOINTS, PAPER_JOINTS
from kpopnet.y_pose.initial_pose import find_initial_pose

LOST = ("predicted", "stays", "carried")
"""Values of `PaperTrackerConfig.lost`, in the order of `kpopnet.paper_tracker.algorithm2.LOST`."""

SURFACE_PIXELS = 9
"""A joint's depth on the surface is the median of this many pixels of the person nearest to it in the image."""

MIN_POINTS = 60
"""Smallest number of cells in which a person is seen: 0.024 square metres."""

AWAITED = {
    "y_pose": "took the Y pose (facing the camera, arms stretched obliquely upwards); start=label starts from true joints, and "
    "estimator=tracker from other poses",
    "label": "was given as a start; start=label needs the true joints of a frame",
}
"""What the tracker waits for: "no person ..."."""

CONFIDENCE_WEIGHTS = (-5.840, 1.495, 5.432)
"""Weights of `evidence_of`, fitted to the repaired tracker on simulated people whom no benchmark shows
(tools/fit_confidence.py). The calibration error there is 4.9 %; on `eval_sim`, seed 31, it is 6 %, and 9 % as printed."""


@dataclass(frozen=True)
class PaperTrackerConfig:
    """Settings of the paper's tracker.

    Attributes:
        candidates: ridge (raw depth only where ridge data are insufficient) or depth (raw depth only, the comparison of
            Fig. 10).
        r_m: search radius of a joint in metres, r_j of Eqs. (4) and (12).
        epsilon_m: tolerance of lengths in metres, epsilon_j of Eqs. (5) to (9).
        straightness: minimum ratio of straight to geodesic distance, epsilon_L of Eq. (9).
        epsilon_r: largest circle ratio of ridge data, Eq. (2).
        sufficient: least number of valid candidates of a joint (the paper gives none).
        lost: where a joint is for which raw depth is insufficient too (the paper does not say): stays (where it was), predicted
            (Eq. 3) or carried (with its parent).
        repaired: with what the paper's text leaves insufficient mended; epsilon_r, sufficient and lost are then those of
            kpopnet.paper_tracker.repairs.
        start: y_pose (waits for the paper's start pose) or label (the benchmark's true joints in the first frame that has all
            of them).
        model: path of a file that `HumanModel.save` wrote for this person; by default the model is measured at the start.
    """

    candidates: str = "ridge"
    r_m: float = 0.11
    epsilon_m: float = 0.05
    straightness: float = 0.7
    epsilon_r: float = 0.3
    sufficient: int = 1
    lost: str = "stays"
    repaired: bool = False
    start: str = "y_pose"
    model: str | None = None

    def __post_init__(self) -> None:
        for name, known in (("candidates", ("ridge", "depth")), ("lost", LOST), ("start", ("y_pose", "label"))):
            check_one_of(f"estimator.paper_tracker.{name}", getattr(self, name), known)
        for name in ("r_m", "epsilon_m", "straightness", "epsilon_r", "sufficient"):
            check_number(f"estimator.paper_tracker.{name}", getattr(self, name))
        lengths = 0 < self.r_m <= 2 and 0 < self.epsilon_m <= 1
        if not (lengths and 0 <= self.straightness < 1 and 0 < self.epsilon_r < 1 and self.sufficient > 0):
            raise InputError(
                "estimator.paper_tracker: expected r_m in 0..2 m, epsilon_m in 0..1 m, straightness and epsilon_r in 0..1 and "
                f"sufficient above 0, found {self.r_m}, {self.epsilon_m}, {self.straightness}, {self.epsilon_r} and "
                f"{self.sufficient}"
            )
        if self.repaired and (self.epsilon_r, self.sufficient, self.lost) != _PRINTED:
            raise InputError(
                "estimator.paper_tracker: repaired takes epsilon_r, sufficient and lost from kpopnet.paper_tracker.repairs; "
                "leave them out"
            )


_PRINTED = PaperTrackerConfig.epsilon_r, PaperTrackerConfig.sufficient, PaperTrackerConfig.lost


class PaperTracker:
    """Tracks one person through consecutive frames. Without a given start pose it waits for the Y pose.

    Attributes:
        model: the person's lengths, None before the start unless given; `HumanModel.save` stores it for later recordings.
        state: the last pose, its velocity, and for how long each joint has been lost; None before the start.
        evidence: (15, 3) what the confidence of the last pose was computed from; None before the start.
    """

    def __init__(
        self, camera: Camera, config: PaperTrackerConfig = PaperTrackerConfig(), model: HumanModel | None = None
    ) -> None:
        """Prepares a tracker; the model of a known person is used instead of the one measured at the start.

        Raises InputError for no camera, or other settings.
        """
        check_camera(camera)
        check_type("config", config, PaperTrackerConfig)
        self.camera, self.config, self.model, self._known, self._inside = camera, config, model, model, False
        self.state: State | None = None
        self.evidence: np.ndarray | None = None

    @property
    def started(self) -> bool:
        """Whether there is a pose to track from."""
        return self.state is not None

    def start(self, joints_camera_m: np.ndarray) -> None:
        """Starts from a known pose, (15, 3) joints in the camera frame in metres; measures the model unless there is one.

        As printed, the next image's depth then moves the joints to the surface. Raises InputError for another shape, or if
        joints are missing.
        """
        self._start(complete_joints(joints_camera_m, "paper tracker"))
        self._inside = not self.config.repaired

    def _start(self, joints: np.ndarray) -> None:
        self.model = self._known or HumanModel.from_joints(joints)
        self.state = State(joints, np.zeros_like(joints), np.zeros(NUM_JOINTS, np.int64))

    def track(self, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(15, 3) float64 joints in the camera frame in metres, and (15,) confidence, the estimated probability of an error
        below 10 cm, in the next (H, W) float32 depth image of the person, metres, 0 elsewhere; NaN and 0 before the start and
        in frames without a visible person.
        """
        frame = self.frame(depth_m)
        if len(frame.cells_m) < MIN_POINTS or not (self.started or self._find_start(depth_m)):
            return np.full((NUM_JOINTS, 3), np.nan), np.zeros(NUM_JOINTS)
        if self._inside:
            self._start(on_surface(self.state.joints, depth_m, self.camera))
            self._inside = False
        self.state, support = track_frame(frame, self.state, self.plan())
        self.evidence = evidence_of(support)
        return self.state.joints.copy(), expit(self.evidence @ np.array(CONFIDENCE_WEIGHTS))

    def frame(self, depth_m: np.ndarray) -> Frame:
        """The points of an (H, W) image in metres that Algorithm 2 chooses from; raises InputError as `check_metres`."""
        check_metres("paper tracker", self.camera, depth_m)
        epsilon_r = EPSILON_R if self.config.repaired else self.config.epsilon_r
        return frame_of(depth_m, ridge_data(depth_m, RidgeConfig(epsilon_r)), self.camera, sampled=self.config.repaired)

    def plan(self) -> Plan:
        """What Algorithm 2 goes by in the next frame."""
        config, model, distance_m = self.config, self.model, np.zeros((NUM_JOINTS, NUM_JOINTS))
        for name, (a, b) in DISTANCES.items():
            distance_m[a, b] = distance_m[b, a] = getattr(model, name)
        printed = Plan(
            predicted=self.state.joints + self.state.velocity,  # Eq. (3)
            radius_m=np.full(NUM_JOINTS, config.r_m),
            on_ridge=np.full(NUM_JOINTS, config.candidates == "ridge"),
            distance_m=distance_m,
            head_to_shoulder_line_m=model.head_to_shoulder_line_m,
            torso_to_hip_line_m=model.torso_to_hip_line_m,
            depth_m=np.zeros(NUM_JOINTS),  # joints lie on the surface
            epsilon_m=config.epsilon_m,
            straightness=config.straightness,
            sufficient=config.sufficient,
            lost=LOST.index(config.lost),
        )
        return repaired(printed, self.state, model) if config.repaired else printed

    def _find_start(self, depth_m: np.ndarray) -> bool:
        """Starts if the frame shows the Y pose, unless it waits for a label; returns whether the tracker has started."""
        if self.config.start == "label":
            return False
        joints_m = find_initial_pose(depth_m, self.camera)
        if joints_m is not None:
            self.start(joints_m)
        return self.started


def on_surface(joints_m: np.ndarray, depth_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(15, 3) joints moved along their viewing rays to the surface that an (H, W) depth image of the person shows there.

    The paper's joints are means of pixels. A joint before the surface stays where it is.
    """
    v, u = depth_m.nonzero()
    at = camera.project(joints_m)[:, :2]
    nearest = ((u - at[:, :1]) ** 2 + (v - at[:, 1:]) ** 2).argsort(axis=1)[:, :SURFACE_PIXELS]
    surface_m = np.median(depth_m[v[nearest], u[nearest]], axis=1)
    return joints_m * np.minimum(surface_m / joints_m[:, 2], 1)[:, None]


class PaperTrackerEstimator:
    """Implements kpopnet.estimator.StartedEstimator. Each sequence is tracked independently, from its own start."""

    name = "paper_tracker"

    def __init__(self, config: PaperTrackerConfig = PaperTrackerConfig()) -> None:
        """Loads the human model if the settings name one. Raises InputError if the model cannot be read."""
        check_type("config", config, PaperTrackerConfig)
        self.config = config
        self.model = None if config.model is None else HumanModel.load(config.model)
        self.starts_from_label = config.start == "label"

    def estimate(self, depth_m: np.ndarray, camera: Camera, start: Start | None = None) -> Estimate:
        """See `kpopnet.estimator.StartedEstimator`."""
        depth_m, camera = subsampled(sequence_in_metres(depth_m, camera), camera)
        tracker = PaperTracker(camera, self.config, self.model)
        return track_sequence(tracker, depth_m, start, AWAITED[self.config.start])


def evidence_of(support: np.ndarray) -> np.ndarray:
    """(15, 3) evidence of a joint's confidence from (15,) numbers of valid candidates.

    It is 1, whether the joint has any, and the share of the fourteen that have. Algorithm 2 has no measure of fit: a joint with
    candidates may lie on another limb, and the confidence cannot know it.
    """
    found = (support > 0).astype(np.float64)
    return np.stack([np.ones_like(found), found, np.full_like(found, found[list(PAPER_JOINTS)].mean())], axis=-1)
