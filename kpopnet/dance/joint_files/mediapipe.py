"""Points that MediaPipe's pose finds in pictures, as the fifteen joints of one person.

MediaPipe's world landmarks are metres about the middle of the hips, x right, y down, z forward, as large as its network takes
the person for. The same points in the picture then say where the person stands before a camera of a usual field of view, and a
network of ours (kpopnet.networks.lifting) where the joints are. Without them, as in many files, the world landmarks are taken
for seen from some metres away.
"""

import math
from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.joint_files.points import (
    MEDIAPIPE_NAMES,
    NamedPoints,
    checked_performance,
    checked_size,
    frame_times_s,
    named_joints,
    plain_name,
    upright,
)
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.networks.lifting import HIPS, Lifting, Sighting, sighting
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.weights import shipped

OF_PICTURE = (
    "points in shares of a picture's width and height, as of pose_landmarks; a score needs MediaPipe's pose_world_landmarks"
)

WEBCAM = "webcam"
"""Name of the noise of these joints."""

CAMERA = Camera.from_fov(60.0, 640, 480)
"""The picture that the page makes of any webcam's; webcams see 55 to 78 degrees across."""

DISTANCE_M = np.array([0.0, 0.0, 3.0])
"""From where a person is taken to be seen of whom a file says nothing but the world landmarks."""

SHAPES = (9 / 16, 3 / 4, 1.0, 4 / 3, 16 / 9)
"""Width by height of pictures, whose diagonal a camera is taken to see under one angle."""

REACH_M = 2.0
"""No point of a person is as far from the hips, along any axis."""

LEAST_SHARE, MOST_SHARES = 0.1, 0.98
"""Landmarks in a picture are shares of its width and height: hips lie above this, and this part of all in the picture or
nearly. The hips of world landmarks lie at 0."""

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


class Landmarks(NamedTuple):
    """The 33 points of a person in one picture, in the order of `MEDIAPIPE_NAMES`."""

    world_m: np.ndarray  # (33, 3) metres about the middle of the hips
    image_px: np.ndarray  # (33, 2) in the camera's picture
    visibility: np.ndarray  # (33,) in 0..1, 0 outside the picture

    def exchanged(self) -> "Landmarks":
        """The same points as of a person who looks the other way: left is right, and front is back."""
        return Landmarks(self.world_m[EXCHANGED] * [1, 1, -1], self.image_px[EXCHANGED], self.visibility[EXCHANGED])

    def distance_px(self, other: "Landmarks") -> float:
        """Mean distance in the picture between the joints of limbs, of which those count most that are seen in both."""
        weights = (self.visibility * other.visibility)[LIMBS]
        apart_px = np.linalg.norm((self.image_px - other.image_px)[LIMBS], axis=1)
        return float(weights @ apart_px / max(weights.sum(), 1e-9))


class PictureJoints:
    """The joints of one person in picture after picture."""

    def __init__(self) -> None:
        self._lifting = Lifting.load(shipped("lifting")[0])
        self.reset()

    def reset(self) -> None:
        """Forgets the person."""
        self._before: Landmarks | None = None
        self._before_s, self._exchanged = 0.0, 0.0  # seconds, and the chance that left and right were exchanged

    def __call__(self, person: Landmarks, camera: Camera, time_s: float | None = None) -> tuple[np.ndarray, np.ndarray] | None:
        """(15, 3) joints in metres before the camera and their (15,) confidence; None where they cannot be told."""
        if time_s is not None:
            person = self._on_their_sides(person, time_s)
        if (seen := seen_joints(person, camera)) is None:
            return None
        turned_m, chance = self._lifting(seen.sighting)
        joints_m = turned_m @ seen.to_ray
        place_m = place_of(joints_m, seen.image_px, seen.sighting.visibility, camera, LEAST_JOINTS)
        if place_m is None:
            return None
        # Whom the picture cuts is guessed as a whole, also the joints in it.
        visible = seen.sighting.visibility > 0
        return joints_m + place_m, chance * visible * np.mean(visible) ** 2

    def _on_their_sides(self, person: Landmarks, time_s: float) -> Landmarks:
        """The points of a picture, left and right exchanged where MediaPipe has probably exchanged them.

        It takes some people for ones who look the other way in single pictures, and back; no person turns as fast. How near the
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


def is_mediapipe(recorded: NamedPoints) -> bool:
    """Whether points are all of MediaPipe's, by their names in any spelling, and not otherwise said to be joints."""
    return not recorded.places and sorted(map(plain_name, recorded.names)) == sorted(map(plain_name, MEDIAPIPE_NAMES))


def lifted(recorded: NamedPoints, fps: float | None, source: str) -> Performance:
    """The dance of MediaPipe's world landmarks, in the axes of their camera: before it where the file says where they are in
    the picture, else about the middle of the hips.

    `fps` is the true rate of a file with none or a wrong one. Raises InputError as `named_performances`, and for landmarks in
    the picture.
    """
    joints, _ = named_joints(recorded, source)
    if _are_of_picture(joints[np.isfinite(joints).all(axis=(1, 2)), :, :2]):
        raise InputError(f"{source}: {OF_PICTURE}")
    unit, to_y_up = upright(joints, source)
    names = [plain_name(name) for name in recorded.names]
    order = [names.index(plain_name(name)) for name in MEDIAPIPE_NAMES]
    points = np.where(np.isfinite(recorded.points[:, order]), recorded.points[:, order], np.nan)
    about_hips = checked_size(points, source) - joints[:, HIPS].mean(axis=1, keepdims=True)
    points_m = about_hips * unit @ to_y_up * [1.0, -1.0, -1.0]
    confidence = np.ones(points_m.shape[:2]) if recorded.confidence is None else recorded.confidence[:, order]
    within = (np.abs(points_m) < REACH_M).all(axis=2)  # not where one is missing
    if recorded.image is not None:
        within &= ((recorded.image[:, order] >= 0) & (recorded.image[:, order] <= 1)).all(axis=2)
    visibility = np.where(within, np.clip(np.nan_to_num(confidence), 0, 1), 0.0)
    points_m = np.where(visibility[..., None] > 0, points_m, 0.0)
    if recorded.image is None:
        camera, image_px = CAMERA, CAMERA.project(points_m + DISTANCE_M)[..., :2]
    else:
        shares = np.where(visibility[..., None] > 0, recorded.image[:, order], 0.0)
        camera = picture_camera(points_m, shares, visibility)
        image_px = shares * [camera.width, camera.height] - 0.5
    times_s = frame_times_s(len(joints), recorded.times_s, recorded.fps, fps, source)
    joints_m, confidence = np.full((len(joints), NUM_JOINTS, 3), np.nan), np.zeros((len(joints), NUM_JOINTS))
    joints_of = PictureJoints()
    for frame in np.flatnonzero(visibility.any(axis=1)):
        person = Landmarks(points_m[frame], image_px[frame], visibility[frame])
        if (found := joints_of(person, camera, float(times_s[frame]))) is not None:
            place_m = found[0][HIPS].mean(axis=0) if recorded.image is None else 0.0
            joints_m[frame], confidence[frame] = found[0] - place_m, found[1]
    return checked_performance(joints_m, times_s, confidence, source, WEBCAM)


def picture_camera(points_m: np.ndarray, shares: np.ndarray, visibility: np.ndarray) -> Camera:
    """A camera of a usual field of view, of pictures of that of SHAPES in which people look as wide as they are.

    Takes (T, 33, 3) points about the hips, metres, (T, 33, 2) shares of the pictures' width and height, and (T, 33) visibility.
    """
    weights = (visibility / np.maximum(visibility.sum(axis=1, keepdims=True), 1e-9))[..., None]
    world, picture = (one - (weights * one).sum(axis=1, keepdims=True) for one in (points_m[..., :2], shares))
    across, down = (weights * world * picture).sum(axis=1).T / np.maximum((weights * world**2).sum(axis=1), 1e-9).T
    seen = (across > 0) & (down > 0)
    ratio = float(np.median(down[seen] / across[seen])) if seen.any() else CAMERA.width / CAMERA.height
    shape = min(SHAPES, key=lambda one: abs(math.log(one / ratio)))
    diagonal_px = math.hypot(CAMERA.width, CAMERA.height)
    height = diagonal_px / math.hypot(shape, 1.0)
    return Camera.centred(CAMERA.fx, round(shape * height), round(height))


def _are_of_picture(joints: np.ndarray) -> bool:
    """Whether (T, 15, 2) joints are shares of a picture's width and height."""
    if not len(joints):
        return False
    hips = np.median(joints[:, HIPS].mean(axis=1), axis=0)
    return bool(hips.min() > LEAST_SHARE and np.mean((joints > -0.1) & (joints < 1.1)) > MOST_SHARES)


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
