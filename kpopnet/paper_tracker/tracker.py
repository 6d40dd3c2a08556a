"""The paper's tracker: initial model from the Y pose (section 2.3), then Algorithm 2 frame by frame (section 2.4).

    depth of the person -> ridge data -> initial model, once
    depth of the person -> ridge data -> prediction, candidates, pruning, joints, in every frame

Nothing depends on wall-clock time: equal input gives equal output.
"""

import numpy as np

from kpopnet.camera import Camera
from kpopnet.estimator import start_pose
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.confidence import evidence_of, probability
from kpopnet.paper_tracker.config import AS_PRINTED, PaperTrackerConfig
from kpopnet.paper_tracker.frame import frame_of
from kpopnet.paper_tracker.hierarchy import State, track_frame
from kpopnet.paper_tracker.init.y_pose import InitialConfig, find_initial_pose
from kpopnet.paper_tracker.structure import Structure, structure_of
from kpopnet.ridge import ridge_data
from kpopnet.skeleton import NUM_JOINTS

MIN_POINTS = 60
"""Smallest number of cells (`kpopnet.paper_tracker.frame`) in which somebody is seen: 0.024 square metres."""


class PaperTracker:
    """Tracks one person through consecutive frames. Without a given start pose it waits for the Y pose.

    Attributes:
        model: the person's lengths, None before the start unless given; `HumanModel.save` stores it for later recordings.
        structure: the model for the kernels; None before the start.
        state: the last pose, its velocity, and for how long each joint has been lost; None before the start.
        evidence: (15, 3) what the confidence of the last pose was computed from; None before the start.
    """

    def __init__(self, camera: Camera, config: PaperTrackerConfig = AS_PRINTED, model: HumanModel | None = None) -> None:
        """Prepares a tracker.

        Args:
            camera: the camera of the depth images.
            config: settings.
            model: the model of a known person, used instead of the one measured at the start.
        """
        self.camera = camera
        self.config = config
        self.model = model
        self.structure: Structure | None = None
        self.state: State | None = None
        self.evidence: np.ndarray | None = None

    @property
    def started(self) -> bool:
        """Whether there is a pose to track from."""
        return self.state is not None

    def start(self, joints_camera_m: np.ndarray) -> None:
        """Starts from a known pose. Measures the model in this pose unless there is one.

        Args:
            joints_camera_m: (15, 3) joints in the camera frame in metres.

        Raises:
            InputError: another shape, or joints are missing.
        """
        joints = start_pose(joints_camera_m, "paper tracker")
        self.model = self.model or HumanModel.from_joints(joints)
        self.structure = structure_of(self.model)
        self.state = State(joints, np.zeros_like(joints), np.zeros(NUM_JOINTS, np.int64))

    def track(self, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tracks the person in the next frame.

        Args:
            depth_m: (H, W) float32 metres of the person, 0 elsewhere.

        Returns:
            (15, 3) float64 joints in the camera frame in metres and (15,) confidence, the estimated probability of an error
            below 10 cm; NaN and 0 before the start and in frames without a visible person.
        """
        frame = frame_of(depth_m, ridge_data(depth_m, self.config.ridge), self.camera)
        if len(frame.raw_m) < MIN_POINTS or not (self.started or self._find_start(depth_m)):
            return np.full((NUM_JOINTS, 3), np.nan), np.zeros(NUM_JOINTS)
        self.state, support = track_frame(frame, self.state, self.structure, self.config.for_kernels)
        self.evidence = evidence_of(support)
        return self.state.joints.copy(), probability(self.evidence)

    def _find_start(self, depth_m: np.ndarray) -> bool:
        """Starts if the frame shows the Y pose; returns whether the tracker has started."""
        initial = find_initial_pose(depth_m, self.camera, InitialConfig(ridge=self.config.ridge))
        if initial is not None:
            self.start(initial.joints_camera_m)
        return self.started
