"""The tracker as an estimator of joints in depth sequences."""

import logging
from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Estimator, Start, track_sequence
from kpopnet.geometry.human_model import HumanModel
from kpopnet.tracker.start import AWAITED, WAYS
from kpopnet.tracker.tracker import Tracker

log = logging.getLogger(__name__)

REPORTED_FRAMES = 40
"""As many frames without joints are reported. A sequence of fewer may well lack a start; evaluations warm up with 30."""


@dataclass(frozen=True)
class TrackerEstimatorConfig:
    """Settings of the tracker.

    Attributes:
        start: auto (the Y pose, else a network's joints where `network` names one, else any person who stands or sits
            upright), y_pose (waits for the paper's start pose), standing (any person who stands upright), or label (the
            benchmark's true joints in the first frame that has all of them).
        model: path of a file that `HumanModel.save` wrote for this person; by default the model is measured at the start.
        network: path of a checkpoint's folder; this network is queried at the start (start=auto) and in frames where the pose
            cost is high. None by default.
    """

    start: str = "auto"
    model: str | None = None
    network: str | None = None

    def __post_init__(self) -> None:
        if self.start not in WAYS:
            raise InputError(f"estimator.tracker.start={self.start}: expected one of {', '.join(WAYS)}")


class TrackerEstimator:
    """Implements kpopnet.estimator.StartedEstimator. Each sequence is tracked independently, from its own start.

    The confidence is the estimated probability that the joint is within 10 cm of the truth (kpopnet.tracker.confidence).
    """

    name = "tracker"

    def __init__(self, config: TrackerEstimatorConfig = TrackerEstimatorConfig(), detector: Estimator | None = None) -> None:
        """Loads the human model if the settings name one.

        Args:
            config: settings.
            detector: is queried at the start and where the pose cost is high; `NetworkEstimator(config.network)` if a network
                is set.

        Raises:
            InputError: the model cannot be read, or a network is set without a detector.
        """
        if config.network is not None and detector is None:
            raise InputError(f"network={config.network}: give detector=NetworkEstimator({config.network!r}) with it")
        self.config = config
        self.model = None if config.model is None else HumanModel.load(config.model)
        self.detector = detector
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
        tracker = Tracker(camera, self.config.start, self.model, self.detector)
        found = track_sequence(tracker, depth_m, start)
        tracked = np.arange(len(depth_m)) >= (start.frame if start else 0)
        missing = np.isnan(found.joints_camera_m).all(axis=(1, 2)) & tracked
        if missing.sum() >= REPORTED_FRAMES:
            log.warning("tracker: %s", _why_missing(depth_m[missing], len(depth_m), self.config.start))
        return found


def _why_missing(missing_m: np.ndarray, frames: int, start: str) -> str:
    """Why all joints are missing in these images of a sequence, and which setting to change."""
    shown = int(missing_m.any(axis=(1, 2)).sum())
    which = "all joints are missing" if len(missing_m) == frames else f"no joints in {len(missing_m)} of {frames} frames"
    if not shown:
        return f"{which}: none of {len(missing_m)} frames has a measured pixel; was a person extracted?"
    return f"{which}: in {shown} of {len(missing_m)} frames with measured pixels no person {AWAITED[start]}"
