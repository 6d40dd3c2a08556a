"""The pose estimator: people are found in raw depth, followed, and their joints estimated."""

import logging
from collections import Counter
from collections.abc import Iterable
from itertools import islice
from numbers import Integral
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kpopnet.camera import Camera, check_camera, image_in_metres, subsampled, tells_unit
from kpopnet.errors import InputError, check_between, check_one_of
from kpopnet.estimator import FRAME_S, LATEST_S, Estimate, Estimator, check_estimator
from kpopnet.human import Looker
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.pose.extraction import DEFAULT_EXTRACTION, Extractor, build_extractor, extraction_name
from kpopnet.pose.person import MODES, DetectedPerson, Pose, TrackedPerson, detected, joined
from kpopnet.sources.source import DepthSource, TimedDepth

log = logging.getLogger(__name__)

MAX_PEOPLE = 16
MAX_REMEMBERED = 64
"""People whose lengths are remembered; beyond it, people out of view are forgotten and measured again when they return."""


class PersonPose(NamedTuple):
    """One person in one image, or in the T images of a recording."""

    identity: int  # the same number for the same person in all images
    joints_camera_m: np.ndarray  # (15, 3) or (T, 15, 3) float32 joints, camera frame, metres; NaN where missing
    # (15,) or (T, 15) float32 estimated probability that the joint is within 10 cm of the truth, 0 where missing
    confidence: np.ndarray
    # of `update` by a network: what it alone says of this image in this mode, (15, 3) and (15,), before the fit and without
    # what was seen before
    network: Estimate | None = None


class PoseEstimator:
    """Estimates the joints of people in depth images, of one camera in one thread: others have an estimator of their own."""

    def __init__(
        self, network: Estimator | None, mode: str = "realtime", people: int = 1, extraction: Any = DEFAULT_EXTRACTION
    ) -> None:
        """Makes an estimator around a network; `load` is the short way.

        Args:
            network: estimates the joints of one person in single frames; None where the mode needs none.
            mode: realtime; best: a `NetworkEstimator` makes two passes over each frame, and `estimate` reads later ones; or
                tracker: the body tracker, without a network.
            people: largest number of people to follow.
            extraction: settings of what finds the people, of a type in `kpopnet.pose.extraction.EXTRACTIONS`.

        Raises:
            InputError: an unknown mode, no network for it, or fewer than one person or more than MAX_PEOPLE.
        """
        self.network, self.mode, self.people, self.extraction = network, mode, people, extraction
        check_one_of("mode", mode, MODES)
        if mode != "tracker":
            check_estimator("network", network)
        extraction_name(extraction)
        if not isinstance(people, Integral):
            raise InputError(f"people: expected a whole number, got {people!r}")
        check_between("people", people, 1, MAX_PEOPLE)
        self.reset()

    @classmethod
    def load(
        cls,
        checkpoint: Path | str | None = None,
        mode: str = "realtime",
        people: int = 1,
        device: str = "cpu",
        extraction: Any = DEFAULT_EXTRACTION,
    ) -> "PoseEstimator":
        """Loads a network, where the mode needs one: a checkpoint's folder or an exported network, by default the one that
        comes with the package, on the device cpu or cuda. Raises InputError: it cannot be loaded, or a setting is wrong.
        """
        check_one_of("mode", mode, MODES)
        if mode == "tracker" and checkpoint is not None:
            raise InputError(f"checkpoint {checkpoint}: the mode tracker uses no network; leave the checkpoint or the mode out")
        network = NetworkEstimator(checkpoint, device=device) if mode != "tracker" else None
        return cls(network, mode, people, extraction)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy, as for another process, has the settings and the network, and begins with another recording."""
        return PoseEstimator, (self.network, self.mode, self.people, self.extraction)

    def reset(self) -> None:
        """Forgets the room and the people: the next image is the first of another recording."""
        self._extractor: Extractor | None = None
        self._people: dict[int, DetectedPerson | TrackedPerson] = {}
        self._time_s = 0.0
        self._unit_of: Camera | None = None

    def update(self, depth: np.ndarray, camera: Camera, time_s: float | None = None) -> list[PersonPose]:
        """The people in the next image, online: each image once, in order.

        Args:
            depth: (H, W) depth of the whole scene, 0 where nothing was measured; uint16 millimetres or float metres.
            camera: its camera, the same for all images; with another one the estimator starts again.
            time_s: when the image was taken, in seconds of any clock: people may move farther in a longer time. None: a
                thirtieth of a second after the image before.

        Returns:
            The visible people, at most `people`, in the order in which they were first found.

        Raises:
            InputError: depth of another type or size; floats that look like millimetres; a time that is no finite number.
        """
        if time_s is not None:
            check_between("time_s", time_s, -LATEST_S, LATEST_S)
        found = self._found(depth, camera, self.people, time_s)
        return [PersonPose(identity, pose.joints_camera_m, pose.confidence, pose.network) for identity, pose in found.items()]

    def estimate(
        self, depth: np.ndarray | Iterable[np.ndarray | TimedDepth], camera: Camera, fps: float = 30.0, segmented: bool = False
    ) -> list[PersonPose]:
        """The people in a recording, or in one image.

        Args:
            depth: (T, H, W) depth of a whole scene, or its (H, W) images one after another, with their times or without, or a
                `DepthSource`, whose images have their times; or a single image, whose person must stand in view. uint16
                millimetres or float metres, 0 where nothing was measured.
            camera: its camera.
            fps: frames per second of images without times.
            segmented: the depth shows one person, and 0 elsewhere: no person has to be found.

        Returns:
            At most `people` of the people found, those seen in most images first; an empty list, with a warning, where
            there are none.

        Raises:
            InputError: as `update`; or fps is not positive.
        """
        check_between("fps", fps, 1, 1000)
        check_camera(camera)
        if isinstance(depth, np.ndarray) and depth.ndim == 2:
            depth = depth[None]
        if not isinstance(depth, Iterable) or isinstance(depth, str) or (isinstance(depth, np.ndarray) and not depth.ndim):
            opened = "; kpopnet.sources.open_depth opens a recording" if isinstance(depth, str | Path) else ""
            raise InputError(f"depth: expected an array or images one after another, got {type(depth).__name__}{opened}")
        if isinstance(depth, DepthSource):
            depth = depth.timed()  # its own times, which the images alone do not have
        frames: list[dict[int, Pose]] = []
        times_s: list[float] = []
        self.reset()
        try:
            for one in depth:
                time_s, image = one if isinstance(one, TimedDepth) else (len(frames) / fps, one)
                check_between("time_s", time_s, -LATEST_S, LATEST_S)
                times_s.append(time_s)
                frames.append(
                    self._segmented(image, camera, time_s) if segmented else self._found(image, camera, MAX_PEOPLE, time_s)
                )
        finally:
            self.reset()  # also where an image is refused: the next one is of another recording
        seen = Counter(identity for people in frames for identity in people)
        if not seen:
            log.warning(
                "no person was found in %d image(s): does it show at least half of a person, within about 7 m, and are the "
                "camera's intrinsics right? %s%s",
                len(frames),
                _how_far(image_in_metres(image, camera, unit_known=True)) if frames else "There is no image.",
                "" if segmented else " For depth that shows nothing but one person: segmented=True, or --segmented",
            )
        chosen = sorted(seen, key=lambda identity: (-seen[identity], identity))[: self.people]
        return [
            PersonPose(identity, *joined([people.get(identity) for people in frames], np.array(times_s), self.mode == "best"))
            for identity in chosen
        ]

    def _found(self, depth: np.ndarray, camera: Camera, most: int, time_s: float | None) -> dict[int, Pose]:
        given, (depth_m, camera) = camera, self._needed_image(depth, camera)
        if self._extractor is None or camera != self._extractor.camera:
            self.reset()
            self._extractor = build_extractor(camera, self.extraction, self._looker(camera))
        self._learn_unit(depth_m, given)
        self._time_s = self._time_s + FRAME_S if time_s is None else time_s
        found = self._extractor.extract(depth_m, self._time_s)
        humans = {human.identity: human for human in islice(found, most)}
        for identity, person in self._people.items():
            if identity not in humans:
                person.miss(self._time_s)
        if len(self._people) > MAX_REMEMBERED:
            self._people = {identity: person for identity, person in self._people.items() if identity in humans}
        poses = {identity: self._person(identity, camera).see(human, self._time_s) for identity, human in humans.items()}
        return {identity: pose for identity, pose in poses.items() if pose is not None}

    def _needed_image(self, depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera]:
        check_camera(camera)
        return subsampled(image_in_metres(depth, camera, unit_known=camera == self._unit_of), camera)

    def _learn_unit(self, depth_m: np.ndarray, camera: Camera) -> None:
        """From here on the unit of this camera's depth is known, if the image tells it."""
        if self._unit_of is None and tells_unit(depth_m):
            self._unit_of = camera

    def _looker(self, camera: Camera) -> Looker | None:
        """Looks at whom the finder finds, by the network: what it sees is used again for their joints."""
        mode, network = self.mode, self.network
        if mode == "tracker" or network is None:
            return None
        return lambda humans: detected(network, mode, [(human.depth_m, human.cropped(camera)) for human in humans])

    def _segmented(self, image: np.ndarray, camera: Camera, time_s: float) -> dict[int, Pose]:
        given, (depth_m, camera) = camera, self._needed_image(image, camera)
        self._learn_unit(depth_m, given)
        pose = self._person(0, camera).update(depth_m, camera, time_s)
        return {0: pose} if np.isfinite(pose.joints_camera_m).any() else {}

    def _person(self, identity: int, camera: Camera) -> DetectedPerson | TrackedPerson:
        if identity not in self._people:
            tracked = self.mode == "tracker"
            self._people[identity] = TrackedPerson(camera) if tracked else DetectedPerson(camera, self.network, self.mode)
        return self._people[identity]


def _how_far(depth_m: np.ndarray) -> str:
    """What tells depth in another unit from a room without people."""
    if not depth_m.any():
        return "The last image measures nothing."
    return f"The last image is {np.median(depth_m[depth_m > 0]):.2f} m away in the median: is its unit right?"
