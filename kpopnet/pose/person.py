"""The joints of one person, frame after frame: a network's, fitted to the depth, the mean of both, smoothed.

What each step is worth is measured in docs/results.md.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Estimator
from kpopnet.pose.smoothing import smoothed
from kpopnet.skeleton import MIRROR
from kpopnet.tracker.fit.confidence import REFINED_WEIGHTS, probability
from kpopnet.tracker.fit.refine import RunningFit


class Mode(NamedTuple):
    """What is done with each frame.

    Attributes:
        mirrored: the network also sees the frame in a mirror, and its two answers are averaged.
        smoothed: joints of a whole recording are smoothed over time, with a look at the frames that follow.
    """

    mirrored: bool
    smoothed: bool


MODES = {"realtime": Mode(mirrored=False, smoothed=False), "best": Mode(mirrored=True, smoothed=True)}


def check_mode(name: str) -> None:
    """Raises InputError unless `name` is one of MODES."""
    if name not in MODES:
        raise InputError(f"mode={name}: expected one of {', '.join(MODES)}")


class PersonPoser:
    """Estimates one person's joints in successive frames; a frame's joints depend on it and on those before it."""

    def __init__(self, network: Estimator, mode: Mode) -> None:
        self.network, self.mode = network, mode
        self._fit = RunningFit()

    def update(self, depth_m: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """The joints of the next frame.

        Args:
            depth_m: (H, W) float32 metres of this person, 0 elsewhere.
            camera: the camera of these pixels.

        Returns:
            (15, 3) float32 joints in metres, NaN where missing, and (15,) float32 confidence.
        """
        detected_m, confidence = self._detect(depth_m, camera)
        fitted_m, evidence = self._fit.refine(detected_m, confidence, depth_m, camera)
        if np.isfinite(evidence).all():
            confidence = probability(evidence, REFINED_WEIGHTS).astype(np.float32)
        # The network's errors and the fit's are partly independent: the mean of both is better than either.
        return ((detected_m + fitted_m) / 2).astype(np.float32), confidence

    def _detect(self, depth_m: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        seen = self.network.estimate(depth_m[None], camera)
        if not self.mode.mirrored:
            return seen.joints_camera_m[0], seen.confidence[0]
        in_mirror = self.network.estimate(np.ascontiguousarray(depth_m[None, :, ::-1]), camera.mirrored())
        joints_m = in_mirror.joints_camera_m[0, MIRROR] * np.array([-1, 1, 1], np.float32)
        return (seen.joints_camera_m[0] + joints_m) / 2, (seen.confidence[0] + in_mirror.confidence[0, MIRROR]) / 2


class PersonEstimator:
    """Implements kpopnet.estimator.Estimator by a mode of MODES."""

    def __init__(self, network: Estimator, mode: str, fps: float = 30.0) -> None:
        """Wraps a network.

        Args:
            network: estimates joints in single frames.
            mode: a name of MODES.
            fps: frames per second of the recordings, for their smoothing.

        Raises:
            InputError: an unknown mode.
        """
        check_mode(mode)
        self.estimator, self.name, self.fps = network, mode, fps

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`."""
        depth_m = sequence_in_metres(depth_m, camera)
        poser, found = PersonPoser(self.estimator, MODES[self.name]), Estimate.missing(len(depth_m))
        for frame, image_m in enumerate(depth_m):
            found.joints_camera_m[frame], found.confidence[frame] = poser.update(image_m, camera)
        if not MODES[self.name].smoothed:
            return found
        return found._replace(joints_camera_m=smoothed(found.joints_camera_m, found.confidence, self.fps))
