"""The joints of one person, frame after frame: by the body tracker; or a network's and those fitted to the depth, which
another network weighs over time.

What each step is worth is measured in docs/results.md.
"""

import math
from collections.abc import Sequence
from functools import cache
from itertools import repeat
from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres, subsampled
from kpopnet.errors import check_between, check_one_of
from kpopnet.estimator import Estimate, Estimator, Judge, check_estimator
from kpopnet.human import Human, Look
from kpopnet.networks.over_time import ANOTHER_AFTER_S, Live, Measured, OverTime, whole
from kpopnet.tracker.body_estimate import BodyEstimate
from kpopnet.tracker.confidence import REFINED_WEIGHTS, probability
from kpopnet.tracker.refine import refine_frame
from kpopnet.tracker.tracker import Tracker
from kpopnet.weights import shipped

MODES = ("realtime", "best", "tracker")
"""The body tracker estimates the joints, or a network. In `best` a `Judge` makes two passes over each frame, in `realtime`
where its confidence is low (`SECOND_PASS_CONFIDENCE`) or it sees a child; and `best` reads later frames of a recording too."""

SECOND_PASS_CONFIDENCE = 0.9
"""In `realtime` people with at most this confidence, in the mean over the joints, get a second pass of the network: 8 of 100
adults who are alone, 56 of 100 in full rooms, SIMULATED."""


class Pose(NamedTuple):
    """One person in one image."""

    joints_camera_m: np.ndarray  # (15, 3) float32 joints, metres, NaN where missing
    confidence: np.ndarray  # (15,) float32, 0 where missing
    measured: Measured | None = None  # what the network over time was given; None where it was not asked

    @property
    def network(self) -> Estimate | None:
        """What the network alone sees in the image; None as `measured`."""
        return None if self.measured is None else Estimate(self.measured.detected_m, self.measured.detected)


@cache
def _over_time(sees_future: bool) -> OverTime:
    return OverTime.load(shipped("over_time")[sees_future])


def detected(network: Estimator, mode: str, images: Sequence[tuple[np.ndarray, Camera]]) -> list[Look]:
    """What a network sees in (H, W) images of one person each, in metres, 0 elsewhere, and their cameras."""
    if isinstance(network, Judge):
        (joints_m, confidence), logits = network.judge(images, SECOND_PASS_CONFIDENCE if mode == "realtime" else 1.0)
        # A silhouette that is too small to be looked at is not judged.
        judged = [None] * len(images) if logits is None else [None if one == -math.inf else one for one in logits.tolist()]
        return [Look(*one) for one in zip(joints_m, confidence, judged, strict=True)]
    single = (network.estimate(depth_m[None], camera) for depth_m, camera in images)
    return [Look(one.joints_camera_m[0], one.confidence[0], None) for one in single]


class DetectedPerson:
    """One person's joints in successive frames by a network; a frame's joints depend on it and on those before it."""

    def __init__(self, camera: Camera, network: Estimator, mode: str) -> None:
        self.camera, self.network, self.mode = camera, network, mode
        self._body, self._live, self._seen_s = BodyEstimate(), Live(_over_time(sees_future=False)), math.inf

    def see(self, human: Human, time_s: float) -> Pose | None:
        """The pose of the extracted person in the next image, taken at `time_s`; None where it is not known."""
        pose = self.update(human.depth_m, human.cropped(self.camera), time_s, human.look)
        return pose if np.isfinite(pose.joints_camera_m).any() else None

    def miss(self, time_s: float) -> None:
        """The next image, taken at `time_s`, does not show the person."""

    def update(self, depth_m: np.ndarray, camera: Camera, time_s: float, look: Look | None = None) -> Pose:
        """The pose in the next (H, W) image of this person, in metres, 0 elsewhere, taken at `time_s` seconds of any clock.

        `look` is what the network saw in it, where it was asked already.
        """
        detected_m, confidence, _ = look or detected(self.network, self.mode, [(depth_m, camera)])[0]
        if np.isfinite(detected_m).all():
            if not 0 <= time_s - self._seen_s <= ANOTHER_AFTER_S:  # it may be another person
                self._body = BodyEstimate()
            self._seen_s = time_s
        fitted_m, evidence = refine_frame(self._body, Estimate(detected_m, confidence), depth_m, camera)
        if not np.isfinite(detected_m).all():
            return Pose(detected_m.astype(np.float32), confidence)
        fitted = probability(evidence, REFINED_WEIGHTS) if np.isfinite(evidence).all() else confidence
        measured = Measured(detected_m, fitted_m, confidence, fitted)
        return Pose(*self._live.update(measured, time_s), measured)


class TrackedPerson:
    """One person's joints in successive frames by the body tracker; methods as those of `DetectedPerson`."""

    def __init__(self, camera: Camera) -> None:
        self.camera, self._tracker = camera, Tracker(camera)

    def see(self, human: Human, time_s: float) -> Pose | None:
        if not self._tracker.started and is_entering(human, self.camera):
            return None
        pose = self.update(human.whole(self.camera), self.camera, time_s)
        return pose if np.isfinite(pose.joints_camera_m).any() else None

    def miss(self, time_s: float) -> None:
        self._tracker.miss(time_s)

    def update(self, depth_m: np.ndarray, camera: Camera, time_s: float) -> Pose:
        joints_m, confidence = self._tracker.track(depth_m, time_s)
        return Pose(joints_m.astype(np.float32), confidence.astype(np.float32))


def is_entering(human: Human, camera: Camera) -> bool:
    """Whether the left or right border cuts a person: a start from half a body is a wrong one, which takes long to heal."""
    left, _, right, _ = human.box
    at_left, at_right = left == 0 and human.depth_m[:, 0].any(), right == camera.width and human.depth_m[:, -1].any()
    return bool(at_left or at_right)


class PersonEstimator:
    """Implements kpopnet.estimator.Estimator by a mode of MODES.

    Attributes:
        fps: frames per second of the next recording.
    """

    def __init__(self, network: Estimator, mode: str, fps: float = 30.0) -> None:
        """Wraps a network that estimates joints in single frames."""
        check_one_of("mode", mode, MODES)
        check_estimator("network", network)
        check_between("fps", fps, 1, 1000)
        self.estimator, self.name, self.fps = network, mode, fps
        self.sees_future = mode == "best"

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`."""
        depth_m, camera = subsampled(sequence_in_metres(depth_m, camera), camera)
        person, times_s = DetectedPerson(camera, self.estimator, self.name), np.arange(len(depth_m)) / self.fps
        return joined([person.update(*frame) for frame in zip(depth_m, repeat(camera), times_s)], times_s, self.sees_future)


def joined(poses: Sequence[Pose | None], times_s: np.ndarray, sees_future: bool) -> Estimate:
    """One person's joints over T images, taken at (T,) times in seconds; with a look at the future where that is wanted."""
    found = Estimate.missing(len(poses))
    for frame, pose in enumerate(poses):
        if pose is not None:
            found.joints_camera_m[frame], found.confidence[frame] = pose.joints_camera_m, pose.confidence
    measured = {} if not sees_future else {k: pose.measured for k, pose in enumerate(poses) if pose and pose.measured}
    if measured:
        frames = list(measured)
        seen = Measured(*map(np.stack, zip(*measured.values(), strict=True)))
        found.joints_camera_m[frames], found.confidence[frames] = whole(_over_time(True), seen, times_s[frames])
    return found
