"""The tracker as an estimator of joints in depth sequences."""

from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimators import Estimate, Start
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.model import HumanModel
from kpopnet.tracker.tracking import Tracker, TrackerConfig

STARTS = ("y_pose", "standing", "label")


@dataclass(frozen=True)
class TrackerEstimatorConfig(TrackerConfig):
    """The tracker's settings, and where it takes the person from.

    Attributes:
        start: y_pose (waits for the paper's start pose), standing (takes the first silhouette for an average person of
            its height, standing with hanging arms), or label (the benchmark's true joints in the first frame that has
            all of them).
        network: a checkpoint's folder: this network is asked in frames whose pose the tracker doubts; none by default, and
            none without the body.
        model: a file that `HumanModel.save` wrote, for a person who was seen before; else it comes from the start.
    """

    start: str = "y_pose"
    model: str | None = None
    network: str | None = None

    def __post_init__(self) -> None:
        if self.start not in STARTS:
            raise InputError(f"estimator.tracker.start={self.start}: expected one of {', '.join(STARTS)}")
        if self.network is not None and not self.body:
            raise InputError(f"network={self.network}: with body=false no network is ever asked; leave one of them away")


class TrackerEstimator:
    """Implements kpopnet.estimators.StartedEstimator. Each sequence is followed by itself, from its start."""

    name = "tracker"

    def __init__(self, config: TrackerEstimatorConfig = TrackerEstimatorConfig()) -> None:
        """Reads the model, if one is named.

        Raises:
            InputError: it cannot be read.
        """
        self.config = config
        self.model = None if config.model is None else HumanModel.load(config.model)
        self.detector = None if config.network is None else NetworkEstimator(config.network)
        self.starts_from_label = config.start == "label"

    def estimate(self, depth_m: np.ndarray, camera: Camera, start: Start | None = None) -> Estimate:
        """Joints of the one person in each frame.

        Args:
            depth_m: (T, H, W) of that person alone, 0 elsewhere; floating-point metres or uint16 millimetres.
            camera: the camera of these pixels.
            start: a known pose; frames before it have no joints.

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
        return Estimate(joints_m, confidence)
