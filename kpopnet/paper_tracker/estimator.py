"""The paper's tracker as an estimator of joints in depth sequences."""

import logging
from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Start, track_sequence
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig

log = logging.getLogger(__name__)

REPORTED_FRAMES = 40
"""A sequence of fewer frames may well lack the Y pose; evaluations warm up with 30."""

STARTS = ("y_pose", "label")


@dataclass(frozen=True)
class PaperTrackerEstimatorConfig(PaperTrackerConfig):
    """Settings of the paper's tracker and of its start.

    Attributes:
        start: y_pose (waits for the paper's start pose) or label (the benchmark's true joints in the first frame that has all
            of them).
        model: path of a file that `HumanModel.save` wrote for this person; by default the model is measured at the start.
    """

    start: str = "y_pose"
    model: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start not in STARTS:
            raise InputError(f"paper_tracker: start={self.start}: expected one of {', '.join(STARTS)}")


class PaperTrackerEstimator:
    """Implements kpopnet.estimator.StartedEstimator. Each sequence is tracked independently, from its own start."""

    name = "paper_tracker"

    def __init__(self, config: PaperTrackerEstimatorConfig = PaperTrackerEstimatorConfig()) -> None:
        """Loads the human model if the settings name one.

        Raises:
            InputError: the model cannot be read.
        """
        self.config = config
        self.model = None if config.model is None else HumanModel.load(config.model)
        self.starts_from_label = config.start == "label"

    def estimate(self, depth_m: np.ndarray, camera: Camera, start: Start | None = None) -> Estimate:
        """Estimates the joints of the one person in each frame.

        Args:
            depth_m: (T, H, W) depth that shows only the person, 0 elsewhere; floating-point metres or uint16 millimetres.
            camera: the camera of these pixels.
            start: a known pose and its frame; frames before it have no joints.

        Raises:
            InputError: depth of another type or shape; a start with missing joints.
        """
        depth_m = sequence_in_metres(depth_m, camera)
        tracker = PaperTracker(camera, self.config, self.model)
        found = track_sequence(tracker, depth_m, start)
        if not tracker.started and len(depth_m) >= REPORTED_FRAMES:
            log.warning(
                "paper tracker: all joints are missing: in %d frames nobody took the Y pose (facing the camera, arms stretched "
                "obliquely upwards); start=label starts from true joints, and estimator=tracker from other poses",
                len(depth_m),
            )
        return found
