"""The newest image of a camera, and the joints of the learner in it."""

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kpopnet.dance.parts import NOISE
from kpopnet.errors import InputError
from kpopnet.pose import PersonPose, PoseEstimator
from kpopnet.skeleton import Joint
from kpopnet.sources.source import CameraAwayError, LiveCamera
from kpopnet.teacher.library import TaughtDance
from kpopnet.teacher.live.lesson import DanceClock, Lesson

LOST_S = 3.0
"""How long the learner may be out of view before another person is taken for the learner."""

PEOPLE = 2
"""People whose joints are estimated: the learner, and one who walks by."""

CameraOpener = Callable[[Lesson, TaughtDance, DanceClock], LiveCamera]
"""Opens the source of depth that a lesson names. It is passed to other processes, so it must be a function of a module."""


class Image(NamedTuple):
    """One image: (H, W) metres, and when it was taken, in seconds of `time.monotonic`."""

    depth_m: np.ndarray
    taken: float


class NewestImage:
    """Reads a camera in a thread of its own and keeps the newest image: what is not fetched in time is dropped.

    Attributes:
        dropped: number of images that were not fetched.
        away: what to do about a camera that sends nothing just now, "" while images come.
        error: why reading ended, None while it goes on.
    """

    def __init__(self, camera: LiveCamera) -> None:
        self.dropped, self.away, self.error = 0, "", None
        self._camera, self._image, self._ended = camera, None, False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._read, daemon=True, name="camera")
        self._thread.start()

    def fetch(self, timeout_s: float) -> Image | None:
        """The newest image that was not fetched before; None if none comes in time."""
        with self._changed:
            self._changed.wait_for(lambda: self._image is not None or self._ended, timeout_s)
            image, self._image = self._image, None
            return image

    @property
    def ended(self) -> bool:
        return self._ended and self._image is None

    def close(self) -> None:
        self._ended = True
        self._thread.join(timeout=5)
        self._camera.close()

    def _read(self) -> None:
        try:
            while not self._ended:
                try:
                    read = self._camera.read()
                except CameraAwayError as error:
                    self.away = str(error)
                    continue
                if read is None:
                    break
                with self._changed:
                    self.dropped += self._image is not None
                    self._image, self.away = Image(*read), ""
                    self._changed.notify()
        except Exception as error:
            self.error = f"the camera stopped: {error}"
        with self._changed:
            self._ended = True
            self._changed.notify()


def load_estimator(checkpoint: str | None) -> PoseEstimator:
    """The estimator of a checkpoint: "tracker" for the tracker, None for the network that comes with the package.

    Without such a network the tracker estimates.

    Raises:
        InputError: the checkpoint cannot be loaded.
    """
    if checkpoint == "tracker":
        return PoseEstimator(None, "tracker", PEOPLE)
    try:
        return PoseEstimator.load(checkpoint, people=PEOPLE)
    except InputError:
        if checkpoint is not None:
            raise
        return PoseEstimator(None, "tracker", PEOPLE)


def noise_of(estimator: PoseEstimator) -> str:
    """The name in `NOISE` of an estimator's known errors, or none."""
    name = getattr(estimator, "name", getattr(estimator, "mode", ""))
    return name if name in NOISE else "none"


class Learner:
    """Chooses the learner among the people in view and stays with them: who walks by does not take over."""

    def __init__(self) -> None:
        self._identity: int | None = None
        self._seen = 0.0

    def choose(self, people: list[PersonPose], now: float) -> PersonPose | None:
        """The learner's pose among those of all people in one image, at `now` seconds; None if the learner is not there."""
        for person in people:
            if person.identity == self._identity:
                self._seen = now
                return person
        if not people or (self._identity is not None and now - self._seen < LOST_S):
            return None
        # Who dances stands in the middle.
        chosen = min(people, key=lambda person: abs(float(np.nan_to_num(person.joints_camera_m[Joint.TORSO, 0], nan=99.0))))
        self._identity, self._seen = chosen.identity, now
        return chosen
