"""The tracker as an estimator of joints in depth sequences."""

import logging
from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Estimator, Start
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.tracker import Tracker, TrackerConfig

log = logging.getLogger(__name__)

REPORTED_FRAMES = 40
"""A sequence of fewer frames may well lack a start; evaluations warm up with 30."""

STARTS = ("y_pose", "standing", "label")


@dataclass(frozen=True)
class TrackerEstimatorConfig(TrackerConfig):
    """Settings of the tracker and of its initialisation.

    Attributes:
        start: y_pose (waits for the paper's start pose), standing (takes the first upright silhouette for an average person of
            its height with hanging arms), or label (the benchmark's true joints in the first frame that has all of them).
        model: path of a file that `HumanModel.save` wrote for this person; by default the model is measured at the start.
        network: path of a checkpoint's folder; this network is queried in frames where the pose cost is high. None by default;
            not with body=false.
    """

    start: str = "y_pose"
    model: str | None = None
    network: str | None = None

    def __post_init__(self) -> None:
        if self.start not in STARTS:
            raise InputError(f"estimator.tracker.start={self.start}: expected one of {', '.join(STARTS)}")
        if self.network is not None and not self.body:
            raise InputError(f"network={self.network}: with body=false no network is queried; remove one of them")


class TrackerEstimator:
    """Implements kpopnet.estimator.StartedEstimator. Each sequence is tracked independently, from its own start.

    The confidence is the estimated probability that the joint is within 10 cm of the truth (kpopnet.tracker.fit.confidence).
    """

    name = "tracker"

    def __init__(self, config: TrackerEstimatorConfig = TrackerEstimatorConfig(), detector: Estimator | None = None) -> None:
        """Loads the human model if the settings name one.

        Args:
            config: settings.
            detector: is queried in frames where the pose cost is high; `NetworkEstimator(config.network)` if a network is set.

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
        tracker = Tracker(camera, self.config, self.model, self.detector, standing=self.config.start == "standing")
        joints_m = np.full((len(depth_m), NUM_JOINTS, 3), np.nan, np.float32)
        confidence = np.zeros((len(depth_m), NUM_JOINTS), np.float32)
        first = 0
        if start is not None:
            first = start.frame
            tracker.start(start.joints_camera_m)
        for frame in range(first, len(depth_m)):
            joints_m[frame], confidence[frame] = tracker.track(depth_m[frame])
        if not tracker.started and len(depth_m) >= REPORTED_FRAMES:
            log.warning("tracker: %s", _why_not_started(depth_m, self.config.start))
        return Estimate(joints_m, confidence)


_AWAITED = {
    "y_pose": "took the Y pose (facing the camera, arms stretched obliquely upwards); with start=standing the tracker starts "
    "from anybody who stands upright",
    "standing": "stood upright facing the camera with hanging arms; with start=y_pose the tracker waits for the Y pose instead",
    "label": "was given as a start; start=label needs the true joints of a frame, else set start=y_pose or start=standing",
}


def _why_not_started(depth_m: np.ndarray, start: str) -> str:
    """Why all joints of a sequence are missing, and which setting to change."""
    shown = int(depth_m.any(axis=(1, 2)).sum())
    if not shown:
        return f"all joints are missing: none of {len(depth_m)} frames has a measured pixel; was a person extracted?"
    return f"all joints are missing: in {shown} of {len(depth_m)} frames with measured pixels no person {_AWAITED[start]}"
