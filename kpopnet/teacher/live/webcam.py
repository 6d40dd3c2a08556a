"""A webcam as a learner's eye: points that MediaPipe found in the browser, as the fifteen joints of one person
(kpopnet.dance.joint_files.mediapipe).
"""

import queue
import time
from typing import Any, NamedTuple

import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.joint_files.mediapipe import CAMERA, WEBCAM, Landmarks, PictureJoints
from kpopnet.dance.joint_files.points import MEDIAPIPE_NAMES
from kpopnet.dance.joint_files.tables import numbers_in
from kpopnet.pose import PersonPose
from kpopnet.runtime.input_files import check_fields, expect
from kpopnet.sources.source import CameraAwayError, LiveCamera

DESCRIPTION = "the webcam of this browser"

SILENCE_S = 4.0
"""A webcam from which nothing comes for this time is away: on a busy machine without graphics card a page needs seconds."""

NO_DEPTH_M = np.zeros((CAMERA.height // 160, CAMERA.width // 160), np.float32)
"""What a page is sent for the picture, which it has itself."""


class SeenPicture(NamedTuple):
    """What the page saw in one picture: a person or no person, and when it was taken, seconds of `time.monotonic`."""

    person: Landmarks | None
    taken: float


def read_seen(message: Any) -> SeenPicture:
    """Reads a message of `page/webcam.js` that arrives now; raises InputError for any other."""
    where = "the webcam's points"
    check_fields(where, message, {"points": list, "age_ms": float})
    expect(0 <= message["age_ms"] < 60_000, where, "age_ms of 0 to 60000")
    taken = time.monotonic() - message["age_ms"] / 1000
    if not message["points"]:
        return SeenPicture(None, taken)
    expect(len(message["points"]) == len(MEDIAPIPE_NAMES), where, f"{len(MEDIAPIPE_NAMES)} points")
    points = np.array([numbers_in(point, (6,), where) for point in message["points"]])
    expect(bool((np.abs(points) < 100).all()), where, "numbers below 100")
    image_px = points[:, 3:5] * [CAMERA.width, CAMERA.height] - 0.5
    return SeenPicture(Landmarks(points[:, :3], image_px, np.clip(points[:, 5], 0, 1)), taken)


class WebcamCamera(LiveCamera):
    """The webcam as the lesson sees it: its images are `Landmarks` or None."""

    camera = CAMERA

    def __init__(self) -> None:
        self._seen: queue.SimpleQueue[SeenPicture] = queue.SimpleQueue()
        self.keep = self._seen.put  # takes what the page saw

    def read(self) -> SeenPicture:
        """See `LiveCamera.read`."""
        try:
            return self._seen.get(timeout=SILENCE_S)
        except queue.Empty:
            raise CameraAwayError("waiting for the webcam: allow it in the browser, and keep this page in view") from None


class WebcamEstimator:
    """The joints of the person whom a webcam sees; stands in for a `PoseEstimator`."""

    name = WEBCAM

    def __init__(self) -> None:
        self._joints_of = PictureJoints()

    def reset(self) -> None:
        """Forgets the person."""
        self._joints_of.reset()

    def update(self, person: Landmarks | None, camera: Camera, time_s: float | None = None) -> list[PersonPose]:
        """The person with joints (15, 3) in metres before the camera, or none; see `PoseEstimator.update`."""
        found = None if person is None else self._joints_of(person, camera, time_s)
        return [] if found is None else [PersonPose(1, *(one.astype(np.float32) for one in found))]
