"""The joints of one person, frame after frame: by the body tracker, or a network's, fitted to the depth, the mean of both; and
their smoothing over time.

What each step is worth is measured in docs/results.md.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kpopnet.camera import Camera, sequence_in_metres, subsampled
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Estimator
from kpopnet.human import Human
from kpopnet.skeleton import MIRROR
from kpopnet.tracker.body_estimate import BodyEstimate
from kpopnet.tracker.confidence import REFINED_WEIGHTS, probability
from kpopnet.tracker.refine import refine_frame
from kpopnet.tracker.tracker import Tracker


class Mode(NamedTuple):
    """What is done with each frame.

    Attributes:
        network: a network estimates the joints; else the body tracker.
        mirrored: the network also sees the frame in a mirror, and its two answers are averaged.
        smoothed: joints of a whole recording are smoothed over time, with a look at the frames that follow.
    """

    network: bool
    mirrored: bool
    smoothed: bool


MODES = {
    "realtime": Mode(network=True, mirrored=False, smoothed=False),
    "best": Mode(network=True, mirrored=True, smoothed=True),
    "tracker": Mode(network=False, mirrored=False, smoothed=False),
}


def check_mode(name: str) -> None:
    """Raises InputError unless `name` is one of MODES."""
    if name not in MODES:
        raise InputError(f"mode={name}: expected one of {', '.join(MODES)}")


class DetectedPerson:
    """One person's joints in successive frames by a network; a frame's joints depend on it and on those before it."""

    def __init__(self, camera: Camera, network: Estimator, mode: Mode) -> None:
        self.camera, self.network, self.mode = camera, network, mode
        self._body = BodyEstimate()

    def see(self, human: Human) -> tuple[np.ndarray, np.ndarray] | None:
        """(15, 3) joints and (15,) confidence of the extracted person in the next image; None where they are not known."""
        return self.update(human.depth_m, human.cropped(self.camera))

    def miss(self) -> None:
        """The next image does not show the person."""

    def update(self, depth_m: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """(15, 3) float32 joints in metres, NaN where missing, and (15,) float32 confidence in the next (H, W) image of this
        person, metres, 0 elsewhere.
        """
        detected_m, confidence = self._detect(depth_m, camera)
        fitted_m, evidence = refine_frame(self._body, Estimate(detected_m, confidence), depth_m, camera)
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


class TrackedPerson:
    """One person's joints in successive frames by the body tracker; methods as those of `DetectedPerson`."""

    def __init__(self, camera: Camera) -> None:
        self.camera, self._tracker = camera, Tracker(camera)

    def see(self, human: Human) -> tuple[np.ndarray, np.ndarray] | None:
        if not self._tracker.started and is_entering(human, self.camera):
            return None
        joints_m, confidence = self.update(human.whole(self.camera), self.camera)
        return (joints_m, confidence) if np.isfinite(joints_m).any() else None

    def miss(self) -> None:
        self._tracker.miss()

    def update(self, depth_m: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        joints_m, confidence = self._tracker.track(depth_m)
        return joints_m.astype(np.float32), confidence.astype(np.float32)


def is_entering(human: Human, camera: Camera) -> bool:
    """Whether the left or right border cuts a person: a start from half a body is a wrong one, which takes long to heal."""
    left, _, right, _ = human.box
    at_left, at_right = left == 0 and human.depth_m[:, 0].any(), right == camera.width and human.depth_m[:, -1].any()
    return bool(at_left or at_right)


class PersonEstimator:
    """Implements kpopnet.estimator.Estimator by a mode of MODES."""

    def __init__(self, network: Estimator, mode: str, fps: float = 30.0) -> None:
        """Wraps a network that estimates joints in single frames of recordings with `fps` frames per second.

        Raises:
            InputError: an unknown mode.
        """
        check_mode(mode)
        self.estimator, self.name, self.fps = network, mode, fps
        self.sees_future = MODES[mode].smoothed

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`."""
        depth_m, camera = subsampled(sequence_in_metres(depth_m, camera), camera)
        person, found = DetectedPerson(camera, self.estimator, MODES[self.name]), Estimate.missing(len(depth_m))
        for frame, image_m in enumerate(depth_m):
            found.joints_camera_m[frame], found.confidence[frame] = person.update(image_m, camera)
        if not MODES[self.name].smoothed:
            return found
        return found._replace(joints_camera_m=smoothed(found.joints_camera_m, found.confidence, self.fps))


SIGMA_S = 1 / 30
"""Standard deviation of the Gaussian in time. A movement to and fro, twice a second, loses 8 % of its amplitude by it."""

LEAST_WEIGHT = 0.05
"""Weight of a joint of which the estimator is not sure at all: where all around it is unsure too, it counts."""


def smoothed(joints_m: np.ndarray, confidence: np.ndarray, fps: float) -> np.ndarray:
    """(T, J, 3) joints, each averaged over the frames around it by a Gaussian times its (T, J) confidence in 0..1.

    Missing joints, NaN, stay missing; a joint after a gap does not know the one before it.
    """
    sigma = SIGMA_S * fps
    present = np.isfinite(joints_m).all(axis=-1)
    weights = np.where(present, np.maximum(confidence, LEAST_WEIGHT), 0.0)[..., None]
    values = np.where(present[..., None], joints_m, 0.0).astype(np.float64)
    out = np.full(joints_m.shape, np.nan, np.float32)
    for joint in range(joints_m.shape[1]):
        runs = np.flatnonzero(np.diff(present[:, joint], prepend=False, append=False)).reshape(-1, 2)
        for part in (slice(*run) for run in runs):
            weight, weighted = (
                gaussian_filter1d(one[part, joint], sigma, axis=0, mode="nearest") for one in (weights, values * weights)
            )
            out[part, joint] = weighted / weight
    return out
