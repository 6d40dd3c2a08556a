"""The tracker as an estimator of joints in depth sequences."""

import logging
from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres, subsampled
from kpopnet.errors import InputError, check_one_of, check_type
from kpopnet.estimator import WHOLE_ROOM, Estimate, Estimator, Start, check_estimator, shows_a_room, track_sequence
from kpopnet.geometry.human_model import HumanModel
from kpopnet.tracker.start import AWAITED, WAYS
from kpopnet.tracker.tracker import Tracker

log = logging.getLogger(__name__)


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
        check_one_of("estimator.tracker.start", self.start, WAYS)


class TrackerEstimator:
    """Implements kpopnet.estimator.StartedEstimator. Each sequence is tracked independently, from its own start.

    The confidence is the estimated probability that the joint is within 10 cm of the truth (kpopnet.tracker.confidence).
    """

    name = "tracker"

    def __init__(self, config: TrackerEstimatorConfig = TrackerEstimatorConfig(), detector: Estimator | None = None) -> None:
        """Loads the human model if the settings name one; if they name a network, `detector` is a NetworkEstimator of it.

        Raises InputError: the model cannot be read, or a network is set without a detector.
        """
        check_type("config", config, TrackerEstimatorConfig)
        if detector is not None:
            check_estimator("detector", detector)
        if config.network is not None and detector is None:
            raise InputError(f"network={config.network}: give detector=NetworkEstimator({config.network!r}) with it")
        self.config = config
        self.model = None if config.model is None else HumanModel.load(config.model)
        self.detector = detector
        self.starts_from_label = config.start == "label"

    def estimate(self, depth_m: np.ndarray, camera: Camera, start: Start | None = None) -> Estimate:
        """See `kpopnet.estimator.StartedEstimator`."""
        depth_m, camera = subsampled(sequence_in_metres(depth_m, camera), camera)
        if len(depth_m) and shows_a_room(depth_m[len(depth_m) // 2], camera):
            log.warning(WHOLE_ROOM, self.name)
        tracker = Tracker(camera, self.config.start, self.model, self.detector)
        return track_sequence(tracker, depth_m, start, AWAITED[self.config.start])
