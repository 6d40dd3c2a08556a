"""The protocol of all pose estimators: a depth sequence and a camera in, joints and confidence out."""

import logging
from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS, Joint

log = logging.getLogger(__name__)

FRAME_S = 1 / 30
"""From one image to the next, seconds, where their times are unknown."""

LATEST_S = 1e12
"""Times beyond this, 30,000 years, are those of no clock in seconds."""

REPORTED_FRAMES = 40
"""From this number of frames without joints on, a warning says so: evaluations warm up with 30."""


ROOM_FRACTION, ROOM_M2 = 0.6, 3.0
"""A frame shows more than one person if more than this fraction of its pixels is measured, and these pixels cover more than
this area seen from the front: a person's, with wide clothes and arms stretched out, is below 1.5 m2."""

WHOLE_ROOM = (
    "%s: the depth shows a whole room, where one person and 0 elsewhere is expected: the joints will be wrong; extract the "
    "person first (kpopnet.pose.extraction.extract_person), or leave out --segmented of kpopnet predict"
)


class Estimate(NamedTuple):
    """Joints of one person over a sequence."""

    joints_camera_m: np.ndarray  # (T, 15, 3) float32, NaN where a joint is missing
    confidence: np.ndarray  # (T, 15) float32 in 0..1, 0 where a joint is missing

    @classmethod
    def missing(cls, frames: int) -> "Estimate":
        """An estimate with all joints missing, to be filled in for the frames that show a person."""
        return cls(np.full((frames, NUM_JOINTS, 3), np.nan, np.float32), np.zeros((frames, NUM_JOINTS), np.float32))


class Estimator(Protocol):
    """Estimates the joints of one person from segmented depth (0 outside the person); `name` is for folders and tables.

    One whose joints depend on later images has `sees_future`, true, which reports tell.
    """

    name: str

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """Estimates the joints of the person in each frame; NaN with confidence 0 in frames with an empty silhouette.

        `depth_m` is (T, H, W) segmented depth, 0 outside the person, in floating-point metres or uint16 millimetres; InputError
        if it has another type or shape.
        """
        ...


@runtime_checkable
class Judge(Estimator, Protocol):
    """An estimator that can tell whether depth shows a person at all."""

    def judge(
        self, images: Sequence[tuple[np.ndarray, Camera]], second_pass_confidence: float = 1.0
    ) -> tuple[Estimate, np.ndarray | None]:
        """What `estimate` answers of T images, (H, W) float32 metres each, 0 outside its person, and their cameras.

        Also a (T,) logit, whose sigmoid is the probability that an image shows a person, -inf of an empty silhouette; None if
        it was not made to judge, or all silhouettes are empty. People with a mean confidence above `second_pass_confidence`
        may get one pass of a network where others get two.
        """
        ...


def check_estimator(name: str, given: object) -> None:
    """Raises InputError for what is no estimator, such as None, a class or the name of one."""
    if isinstance(given, type) or not callable(getattr(given, "estimate", None)):
        raise InputError(f"{name}: expected an estimator, such as NetworkEstimator(), got {given!r:.80}")


def base_estimator(estimator: Estimator) -> Estimator:
    """The wrapped estimator if this one refines the joints of another, else the estimator itself."""
    return getattr(estimator, "estimator", estimator)


def complete_joints(joints_m: ArrayLike, where: str, needed: Iterable[Joint] = Joint) -> np.ndarray:
    """A (15, 3) float64 copy of a pose in metres. Raises InputError, at `where`: another shape, or a missing joint."""
    try:
        joints_m = np.array(joints_m, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{where}: expected ({NUM_JOINTS}, 3) joints, found {joints_m!r:.80}") from None
    if joints_m.shape != (NUM_JOINTS, 3):
        raise InputError(f"{where}: expected ({NUM_JOINTS}, 3) joints, found {joints_m.shape}")
    if missing := [JOINT_NAMES[joint] for joint in needed if not np.isfinite(joints_m[joint]).all()]:
        raise InputError(f"{where}: expected a pose with all joints; missing joints: {', '.join(missing)}")
    return joints_m


class Start(NamedTuple):
    """A known pose from which tracking starts: the (15, 3) joints of a frame, camera frame, metres."""

    frame: int
    joints_camera_m: np.ndarray


class FrameTracker(Protocol):
    """Follows one person image after image."""

    def start(self, joints_camera_m: np.ndarray) -> None:
        """Takes the (15, 3) joints of the next image, in metres, as the start."""
        ...

    def track(self, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(15, 3) joints in metres, NaN where missing, and (15,) confidence in the next (H, W) image, in metres."""
        ...


def track_sequence(tracker: FrameTracker, depth_m: np.ndarray, start: Start | None, awaited: str) -> Estimate:
    """The joints that a tracker finds in (T, H, W) images in metres; none before the frame of a given start.

    Warns where many frames have no joints; `awaited` says what no person did in them that starts the tracker.
    """
    found, first = Estimate.missing(len(depth_m)), 0
    if start is not None:
        if not isinstance(start, Start) or not isinstance(start.frame, Integral) or start.frame < 0:
            raise InputError(f"start: expected a kpopnet.estimator.Start, with a frame from 0 on, got {start!r:.80}")
        first = start.frame
        tracker.start(start.joints_camera_m)
    for frame in range(first, len(depth_m)):
        found.joints_camera_m[frame], found.confidence[frame] = tracker.track(depth_m[frame])
    missing_m = depth_m[first:][np.isnan(found.joints_camera_m[first:]).all(axis=(1, 2))]
    if len(missing_m) >= REPORTED_FRAMES:
        shown = int(missing_m.any(axis=(1, 2)).sum())
        why = (
            f"in {shown} of them, which show something, no person {awaited}"
            if shown
            else "they are empty; was a person extracted?"
        )
        log.warning("no joints in %d of %d frames: %s", len(missing_m), len(depth_m), why)
    return found


def first_label(joints_camera_m: np.ndarray) -> Start:
    """The first of (T, 15, 3) ground-truth poses with all joints; raises InputError if there is none, or for another shape."""
    if np.shape(joints_camera_m)[1:] != (NUM_JOINTS, 3):
        raise InputError(f"labels of shape {np.shape(joints_camera_m)}: expected (frames, {NUM_JOINTS}, 3)")
    complete = np.flatnonzero(np.isfinite(joints_camera_m).all(axis=(1, 2)))
    if not len(complete):
        raise InputError("start=label needs a frame with all fifteen joints, and there is none; use start=auto")
    return Start(int(complete[0]), joints_camera_m[complete[0]])


@runtime_checkable
class StartedEstimator(Estimator, Protocol):
    """An estimator that tracks, and can start from a given pose.

    If `starts_from_label`, it must be given a ground-truth pose; the evaluation passes one, does not score the estimator in
    that frame, and reports both.
    """

    starts_from_label: bool

    def estimate(self, depth_m: np.ndarray, camera: Camera, start: Start | None = None) -> Estimate:
        """Frames before a given start have no joints. Raises InputError for a start with missing joints, too."""
        ...


def starts_from_label(estimator: Estimator) -> bool:
    """Whether the estimator must be given a ground-truth pose."""
    return isinstance(estimator, StartedEstimator) and estimator.starts_from_label


def shows_a_room(depth_m: np.ndarray, camera: Camera) -> bool:
    """Whether (H, W) depth in metres shows much more than one person."""
    if np.count_nonzero(depth_m) <= ROOM_FRACTION * depth_m.size:
        return False
    area_m2 = float(np.square(depth_m, dtype=np.float64).sum()) / (camera.fx * camera.fy)
    return area_m2 > ROOM_M2
