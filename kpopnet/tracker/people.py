"""Several people in raw depth of a camera that does not move: one body tracker for each person that the extraction finds.

from kpopnet.camera import Camera
from kpopnet.tracker.people import track_people

for person in track_people(depth, Camera.from_fov(58, 320, 240)):       # (T, H, W) of a whole room
    person.identity, person.joints_camera_m, person.confidence          # (T, 15, 3) metres, NaN where they were not seen
"""

import logging
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import check_between
from kpopnet.estimator import Estimate
from kpopnet.extraction import Human, HumanExtractor
from kpopnet.tracker.tracker import Tracker, TrackerConfig

log = logging.getLogger(__name__)

DEFAULT_CONFIG = TrackerConfig(lengths=True)
"""Whoever enters is first seen in part, or as one with another: lengths of such a start have to heal."""

MAX_PEOPLE = 16
MAX_REMEMBERED = 64
"""People whose lengths are remembered; beyond it, those out of view are forgotten."""


class TrackedPerson(NamedTuple):
    """One person in one image, or in the T images of a recording.

    Attributes:
        identity: the same number for the same person in all images.
        joints_camera_m: (15, 3) or (T, 15, 3) float32 joints, camera frame, metres; NaN where missing.
        confidence: (15,) or (T, 15) float32 estimated probability that the joint is within 10 cm of the truth, 0 where missing.
    """

    identity: int
    joints_camera_m: np.ndarray
    confidence: np.ndarray


class PeopleTracker:
    """Finds and tracks people, online: each image once, in order."""

    def __init__(self, camera: Camera, config: TrackerConfig = DEFAULT_CONFIG, people: int = MAX_PEOPLE) -> None:
        """Prepares a tracker.

        Args:
            camera: the camera of all images.
            config: settings of every person's tracker.
            people: largest number of people to track.

        Raises:
            InputError: fewer than one person, or more than MAX_PEOPLE.
        """
        check_between("people", people, 1, MAX_PEOPLE)
        self.camera, self.config, self.people = camera, config, people
        self._extractor = HumanExtractor(camera, expect_person=True)
        self._trackers: dict[int, Tracker] = {}

    def update(self, depth: np.ndarray) -> list[TrackedPerson]:
        """The people in the next image whose pose is known, in the order in which they were first found.

        Args:
            depth: (H, W) depth of the whole scene, 0 where nothing was measured; uint16 millimetres or float metres.

        Raises:
            InputError: depth of another type or size.
        """
        humans = {
            human.identity: human for human in self._extractor.extract(depth_in_metres(depth, self.camera))[: self.people]
        }
        for identity, tracker in self._trackers.items():
            if identity not in humans:
                tracker.miss()
        if len(self._trackers) > MAX_REMEMBERED:
            self._trackers = {identity: one for identity, one in self._trackers.items() if identity in humans}
        found = []
        for identity, human in humans.items():
            tracker = self._trackers.setdefault(identity, Tracker(self.camera, self.config))
            if not tracker.started and is_entering(human, self.camera):
                continue
            joints_m, confidence = tracker.track(human.whole(self.camera))
            if np.isfinite(joints_m).any():
                found.append(TrackedPerson(identity, joints_m.astype(np.float32), confidence.astype(np.float32)))
        return found


def is_entering(human: Human, camera: Camera) -> bool:
    """Whether the left or right border cuts a person: a start from half a body is a wrong one, which takes long to heal."""
    left, _, right, _ = human.box
    at_left, at_right = left == 0 and human.depth_m[:, 0].any(), right == camera.width and human.depth_m[:, -1].any()
    return bool(at_left or at_right)


def track_people(
    depth: np.ndarray | Iterable[np.ndarray],
    camera: Camera,
    config: TrackerConfig = DEFAULT_CONFIG,
    people: int = MAX_PEOPLE,
) -> list[TrackedPerson]:
    """Tracks the people of a recording.

    Args:
        depth: (T, H, W) depth of a whole scene, or its (H, W) images one after another; uint16 millimetres or float metres, 0
            where nothing was measured.
        camera: its camera, which does not move.
        config: settings of every person's tracker.
        people: largest number of people to track at a time.

    Returns:
        Everybody found, in the order in which they were first found. Where nobody is found, none, with a warning.

    Raises:
        InputError: depth of another type or size, or a number of people out of range.
    """
    tracker = PeopleTracker(camera, config, people)
    frames = [tracker.update(image) for image in depth]
    recorded: dict[int, Estimate] = {}
    for frame, seen in enumerate(frames):
        for one in seen:
            joints_m, confidence = recorded.setdefault(one.identity, Estimate.missing(len(frames)))
            joints_m[frame], confidence[frame] = one.joints_camera_m, one.confidence
    if not recorded:
        log.warning(
            "nobody was tracked in %d images: people are found when they move, or stand in view in the first", len(frames)
        )
    return [TrackedPerson(identity, *estimate) for identity, estimate in sorted(recorded.items())]
