"""A webcam as a learner's eye: points that MediaPipe found in the browser, as the fifteen joints of one person.

MediaPipe's world landmarks are metres about the middle of the hips, x right, y down, z forward, as large as its network takes
the person for. The same points in the picture then say where the person stands before a webcam of a usual field of view, and a
network of ours (kpopnet.networks.lifting) where the joints are.
"""

import math
import queue
import time
from typing import Any, NamedTuple

import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.joint_files.points import MEDIAPIPE_NAMES, NamedPoints, checked_performance, named_joints
from kpopnet.dance.joint_files.tables import numbers_in
from kpopnet.dance.performance import Performance
from kpopnet.networks.lifting import Lifting, Sighting, sighting
from kpopnet.pose import PersonPose
from kpopnet.runtime.input_files import check_fields, expect
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.sources.source import CameraAwayError
from kpopnet.weights import shipped_lifting

WEBCAM = "webcam"
DESCRIPTION = "the webcam of this browser"

CAMERA = Camera.from_fov(60.0, 640, 480)
"""The picture that the page makes of any webcam's; webcams see 55 to 78 degrees across."""

SILENCE_S = 4.0
"""A webcam from which nothing comes for this time is away: on a busy machine without graphics card a page needs seconds."""

LEAST_POINTS, LEAST_JOINTS = 8, 4
"""Of MediaPipe's points and of our joints, those within the picture from which the person's place follows."""

SIDES = {"left": "right", "right": "left"}
EXCHANGED = [MEDIAPIPE_NAMES.index("_".join(SIDES.get(word, word) for word in name.split("_"))) for name in MEDIAPIPE_NAMES]
"""Of each of MediaPipe's points the one on the person's other side."""

LIMBS = [
    number
    for number, name in enumerate(MEDIAPIPE_NAMES)
    if name.endswith(("shoulder", "elbow", "wrist", "hip", "knee", "ankle"))
]

UNSURE, BELIEVED = 0.02, 6.0
"""Least chance that left and right changed, or did not, between two pictures; and the rate, 1/s, at which the odds that they
are exchanged fall."""

FIRST = 0.75
"""The odds of a first picture: if the second one contradicts it, that one is believed."""

FORGOTTEN_S = 0.5
"""Pictures that lie further apart say nothing about each other's sides."""

NO_DEPTH_M = np.zeros((CAMERA.height // 160, CAMERA.width // 160), np.float32)
"""What a page is sent for the picture, which it has itself."""


class Landmarks(NamedTuple):
    """The 33 points of a person in one picture, in the order of `MEDIAPIPE_NAMES`."""

    world_m: np.ndarray  # (33, 3) metres about the middle of the hips
    image_px: np.ndarray  # (33, 2) in the picture of `CAMERA`
    visibility: np.ndarray  # (33,) in 0..1, 0 outside the picture

    def exchanged(self) -> "Landmarks":
        """The same points as of a person who looks the other way: left is right, and front is back."""
        return Landmarks(self.world_m[EXCHANGED] * [1, 1, -1], self.image_px[EXCHANGED], self.visibility[EXCHANGED])

    def distance_px(self, other: "Landmarks") -> float:
        """Mean distance in the picture between the joints of limbs, of which those count most that are seen in both."""
        weights = (self.visibility * other.visibility)[LIMBS]
        apart_px = np.linalg.norm((self.image_px - other.image_px)[LIMBS], axis=1)
        return float(weights @ apart_px / max(weights.sum(), 1e-9))


class Seen(NamedTuple):
    """What the page saw in one picture: a person or no person, and when it was taken, seconds of `time.monotonic`."""

    person: Landmarks | None
    taken: float


def read_seen(message: Any) -> Seen:
    """Reads a message of `page/webcam.js` that arrives now; raises InputError for any other."""
    where = "the webcam's points"
    check_fields(where, message, {"points": list, "age_ms": float})
    expect(0 <= message["age_ms"] < 60_000, where, "age_ms of 0 to 60000")
    taken = time.monotonic() - message["age_ms"] / 1000
    if not message["points"]:
        return Seen(None, taken)
    expect(len(message["points"]) == len(MEDIAPIPE_NAMES), where, f"{len(MEDIAPIPE_NAMES)} points")
    points = np.array([numbers_in(point, (6,), where) for point in message["points"]])
    expect(bool((np.abs(points) < 100).all()), where, "numbers below 100")
    image_px = points[:, 3:5] * [CAMERA.width, CAMERA.height] - 0.5
    return Seen(Landmarks(points[:, :3], image_px, np.clip(points[:, 5], 0, 1)), taken)


class WebcamCamera:
    """The webcam as the lesson sees it: a `LiveCamera` whose images are `Landmarks` or None."""

    camera = CAMERA

    def __init__(self) -> None:
        self._seen: queue.SimpleQueue[Seen] = queue.SimpleQueue()
        self.keep = self._seen.put  # takes what the page saw

    def read(self) -> Seen:
        """See `LiveCamera.read`."""
        try:
            return self._seen.get(timeout=SILENCE_S)
        except queue.Empty:
            raise CameraAwayError("waiting for the webcam: allow it in the browser, and keep this page in view") from None

    def close(self) -> None:
        pass


class WebcamEstimator:
    """The joints of the person whom a webcam sees; stands in for a `PoseEstimator`."""

    name = WEBCAM

    def __init__(self) -> None:
        self._lifting = Lifting.load(shipped_lifting())
        self.reset()

    def reset(self) -> None:
        """Forgets the person."""
        self._before: Landmarks | None = None
        self._before_s, self._exchanged = 0.0, 0.0  # seconds, and the chance that left and right were exchanged

    def update(self, person: Landmarks | None, camera: Camera, time_s: float | None = None) -> list[PersonPose]:
        """The person with joints (15, 3) in metres before the camera, or none; see `PoseEstimator.update`."""
        if person is not None and time_s is not None:
            person = self._on_their_sides(person, time_s)
        if person is None or (seen := seen_joints(person, camera)) is None:
            return []
        turned_m, chance = self._lifting(seen.sighting)
        joints_m = turned_m @ seen.to_ray
        place_m = place_of(joints_m, seen.image_px, seen.sighting.visibility, camera, LEAST_JOINTS)
        if place_m is None:
            return []
        # Whom the picture cuts is guessed as a whole, also the joints in it.
        visible = seen.sighting.visibility > 0
        confidence = chance * visible * np.mean(visible) ** 2
        return [PersonPose(1, (joints_m + place_m).astype(np.float32), confidence.astype(np.float32))]

    def _on_their_sides(self, person: Landmarks, time_s: float) -> Landmarks:
        """The points of a picture, left and right exchanged where MediaPipe has probably exchanged them.

        It takes some people for ones who look the other way in single pictures, and back; nobody turns as fast. How near the
        points are to those of the picture before says whether left and right changed between the two, the rate BELIEVED that
        MediaPipe is mostly right.
        """
        exchanged, before, since_s = person.exchanged(), self._before, time_s - self._before_s
        odds = FIRST
        if before is not None and 0 < since_s < FORGOTTEN_S:
            nearness = before.distance_px(person) / max(before.distance_px(exchanged), 1e-9)
            switched = np.clip(nearness**4 / (1 + nearness**4), UNSURE, 1 - UNSURE)
            chance = self._exchanged * (1 - switched) + (1 - self._exchanged) * switched
            odds = chance / (1 - chance) * math.exp(-BELIEVED * since_s)
        self._exchanged, self._before, self._before_s = odds / (1 + odds), person, time_s
        return exchanged if odds > 1 else person


def recorded(message: Any) -> Performance:
    """A dance that the page recorded: of each picture its points, and its time in seconds; raises InputError for any other.

    The message is {"frames": [{"time_s": 0.1, "points": [...]}]}, with the points of `pointsOf` in page/webcam.js.
    """
    where = "the webcam's recording"
    check_fields(where, message, {"frames": list[dict]})
    estimator, joints_m, confidence, times_s = WebcamEstimator(), [], [], []
    for frame in message["frames"]:
        check_fields(where, frame, {"time_s": float, "points": list})
        people = estimator.update(read_seen({"points": frame["points"], "age_ms": 0.0}).person, CAMERA, frame["time_s"])
        joints_m.append(people[0].joints_camera_m if people else np.full((NUM_JOINTS, 3), np.nan))
        confidence.append(people[0].confidence if people else np.zeros(NUM_JOINTS))
        times_s.append(frame["time_s"])
    expect(bool(times_s), where, "pictures, found none")
    return checked_performance(np.array(joints_m), np.array(times_s, float), np.array(confidence), where)


class SeenJoints(NamedTuple):
    """The fifteen joints of a picture's points."""

    sighting: Sighting
    to_ray: np.ndarray  # (3, 3) rotation from the camera's frame to the sighting's
    image_px: np.ndarray  # (15, 2) in the picture


def seen_joints(person: Landmarks, camera: Camera) -> SeenJoints | None:
    """The joints of a picture's points, as far away as MediaPipe's metres say; None where that cannot be told."""
    place_m = place_of(person.world_m, person.image_px, person.visibility, camera, LEAST_POINTS)
    if place_m is None:
        return None
    image_px = np.column_stack([person.image_px, np.zeros(len(person.image_px))])
    points = NamedPoints(MEDIAPIPE_NAMES, np.stack([person.world_m, image_px]), confidence=np.tile(person.visibility, (2, 1)))
    (world_m, joints_px), (visibility, _) = named_joints(points, WEBCAM)
    rays = (joints_px[:, :2] - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    return SeenJoints(*sighting(world_m, rays, visibility, float(np.linalg.norm(place_m))), joints_px[:, :2])


def place_of(
    points_m: np.ndarray, image_px: np.ndarray, visibility: np.ndarray, camera: Camera, least: int
) -> np.ndarray | None:
    """(3,) metres from the camera to the origin of (P, 3) points in its axes; None where fewer than `least` tell it.

    Linear least squares, weighted by visibility: (x + X) = u (z + Z) and (y + Y) = v (z + Z) for each point at (u, v) of the
    image at 1 m.
    """
    if np.count_nonzero(visibility) < least:
        return None
    (x, y, z), (u, v) = points_m.T, ((image_px - [camera.cx, camera.cy]) / [camera.fx, camera.fy]).T
    one, zero = np.ones_like(u), np.zeros_like(u)
    rows = np.concatenate([np.column_stack([one, zero, -u]), np.column_stack([zero, one, -v])])
    weights = np.tile(np.sqrt(visibility), 2)
    place_m, *_ = np.linalg.lstsq(rows * weights[:, None], np.concatenate([u * z - x, v * z - y]) * weights, rcond=None)
    return place_m if place_m[2] + z.min() > 0 else None
