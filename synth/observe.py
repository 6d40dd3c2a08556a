"""From a clean sample to what an estimator gets to see: sensor noise, then the person cut out, not quite perfectly.

The person is put into the empty room and only their box is measured: what a pixel shows (person or room) travels with
the sensor's sideways noise, so outlines are as ragged as its depth.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.errors import InputError
from kpopnet.observation import Observation
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.shards import Sample, ShardedSet
from kpopnet.skeleton import Joint
from synth.holes import ball, erase_ellipses
from synth.sensor import SensorConfig, measure_labelled

MARGIN_PX = 4
"""Pixels around the person's box that are measured too: room for dilation, and two empty ones for the ridge."""

HANDS = [Joint.RIGHT_HAND, Joint.LEFT_HAND]
LIMB_ENDS = [*HANDS, Joint.RIGHT_FOOT, Joint.LEFT_FOOT]
HAND_M = (0.08, 0.14)
HAND_DEPTH_M = 0.2
ATTACHED_M = (0.1, 0.3)
PERSON, ATTACHED = 1, 2


@dataclass(frozen=True)
class ExtractionConfig:
    """How the step that finds the person in the depth image fails. Probabilities are per image.

    Attributes:
        feet_cut_m: everything lower above the floor is taken for floor; each image draws its height from 0 up to this.
        erode: probability that the outline loses one pixel all around.
        dilate: probability that it gains one pixel, with the depth of the person beside it.
        attached: probability that a piece of the room within 10-30 cm of the person is taken for part of the person,
            half of the time at their lowest point (floor), else anywhere on their outline (furniture).
        hand_missing: probability that one hand is not found.
    """

    feet_cut_m: float = 0.08
    erode: float = 0.25
    dilate: float = 0.25
    attached: float = 0.02
    hand_missing: float = 0.03

    def __post_init__(self) -> None:
        if not 0 <= self.feet_cut_m < math.inf:
            raise InputError(f"extraction.feet_cut_m must be a length from 0 on in metres, not {self.feet_cut_m}")
        for name in ("erode", "dilate", "attached", "hand_missing"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"extraction.{name} is a probability between 0 and 1, not {getattr(self, name)}")
        if self.erode + self.dilate > 1:
            raise InputError(
                f"extraction.erode + extraction.dilate must be at most 1, not {self.erode + self.dilate}: "
                "an outline shrinks or grows, never both"
            )


PERFECT = ExtractionConfig(feet_cut_m=0, erode=0, dilate=0, attached=0, hand_missing=0)


class Room(NamedTuple):
    """The empty room behind a person.

    Attributes:
        depth_mm: (H, W) uint16.
        floor: (4,) unit normal n, pointing up, and d with n.x + d = 0 on the floor, camera frame, metres.
    """

    depth_mm: np.ndarray
    floor: np.ndarray


class Observer:
    """A set of shards as observations, noise and all made anew in every epoch: kpopnet's `ObservationSource`.

    Observation (index, epoch) depends on the seed, the sample and the configuration, and on nothing else. Frozen
    shards are handed out as they are stored.
    """

    def __init__(
        self,
        shards: ShardedSet,
        sensor: SensorConfig,
        extraction: ExtractionConfig,
        ridge: RidgeConfig | None,
        seed: int,
    ) -> None:
        """Opens nothing yet.

        Args:
            shards: clean or frozen samples.
            sensor: the camera to imitate.
            extraction: the failures to imitate.
            ridge: makes a ridge image beside every depth image; None for none.
            seed: of the noise, any number from 0 on.
        """
        self.shards, self.sensor, self.extraction, self.ridge, self.seed = shards, sensor, extraction, ridge, seed

    def __len__(self) -> int:
        return len(self.shards)

    def observe(self, index: int, epoch: int) -> Observation:
        """See `kpopnet.observation.ObservationSource`; the depth is the part of the picture around the person."""
        sample = self.shards[index]
        if self.shards.kind == "frozen":
            return as_stored(sample, self.shards.camera, with_ridge=self.ridge is not None)
        room = Room(*self.shards.room(index, sample.room))
        rng = np.random.default_rng([self.seed, epoch, index])
        return observe_sample(sample, room, self.shards.camera, self.sensor, self.extraction, self.ridge, rng)


def observe_sample(
    sample: Sample,
    room: Room,
    camera: Camera,
    sensor: SensorConfig,
    extraction: ExtractionConfig,
    ridge: RidgeConfig | None,
    rng: np.random.Generator,
) -> Observation:
    """One clean sample as sensor and extraction deliver it, cropped to the person's surroundings.

    Args:
        sample: a clean sample.
        room: what stands behind the person.
        camera: the sample's.
        sensor: noise.
        extraction: failures of the cut-out.
        ridge: with a ridge image, by these parameters; None for without.
        rng: the only source of chance.
    """
    # All of chance that is not the sensor's, drawn at once, used or not.
    cut, outline, attached, missing, hand, size, kind, where = rng.random(8)
    attaches = attached < extraction.attached
    x0, y0, x1, y1 = sample.box
    margin = MARGIN_PX
    if attaches and x1 > x0:
        nearest_m = sample.depth_mm[y0:y1, x0:x1].max(initial=1) / MM_PER_METRE
        margin += int(ATTACHED_M[1] * camera.fx / nearest_m)
    x0, y0 = max(x0 - margin, 0), max(y0 - margin, 0)
    x1, y1 = min(x1 + margin, camera.width), min(y1 + margin, camera.height)
    cropped = camera.cropped(x0, y0, x1 - x0, y1 - y0)

    person_mm = sample.depth_mm[y0:y1, x0:x1]
    scene_m, labels = _compose(person_mm, room.depth_mm[y0:y1, x0:x1])
    if attaches:
        radius_m = ATTACHED_M[0] + size * (ATTACHED_M[1] - ATTACHED_M[0])
        _attach(scene_m, labels, cropped, radius_m, at_lowest=kind < 0.5, where=where)
    ends = sample.joints_camera_m[LIMB_ENDS]
    measured, seen = measure_labelled(scene_m, labels, cropped, sensor, rng, ends[np.isfinite(ends[:, 2])])

    grow = -1 if outline < extraction.erode else int(outline > 1 - extraction.dilate)
    # Height above the floor is up[:3].x + up[3]; the camera is above it.
    up = np.asarray(room.floor, np.float32) * np.float32(1 if room.floor[3] >= 0 else -1)
    intrinsics = np.array([cropped.fx, cropped.fy, cropped.cx, cropped.cy], np.float32)
    depth_m = _cut_out(measured, seen, intrinsics, up, np.float32(cut * extraction.feet_cut_m), grow)
    if missing < extraction.hand_missing:
        centre = sample.joints_camera_m[HANDS[int(hand * 2)]]
        radius_m = HAND_M[0] + size * (HAND_M[1] - HAND_M[0])
        erase_ellipses(depth_m, ball(centre, radius_m, HAND_DEPTH_M, cropped).astype(np.float32))
    return Observation(
        depth_m,
        cropped,
        sample.joints_camera_m,
        sample.visible,
        None if ridge is None else ridge_probability(depth_m, ridge),
    )


def freeze(
    sample: Sample,
    room: Room,
    camera: Camera,
    sensor: SensorConfig,
    extraction: ExtractionConfig,
    ridge: RidgeConfig,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """The images of a frozen shard: `observe_sample`, put back into the whole picture.

    Returns:
        (H, W) uint16 depth in millimetres and (H, W) uint8 ridge probability times 255.
    """
    seen = observe_sample(sample, room, camera, sensor, extraction, ridge, rng)
    x0, y0 = round(camera.cx - seen.camera.cx), round(camera.cy - seen.camera.cy)
    part = slice(y0, y0 + seen.camera.height), slice(x0, x0 + seen.camera.width)
    depth_mm = np.zeros((camera.height, camera.width), np.uint16)
    depth_mm[part] = np.rint(seen.depth_m * MM_PER_METRE)
    ridge_255 = np.zeros((camera.height, camera.width), np.uint8)
    ridge_255[part] = np.rint(seen.ridge * 255)
    return depth_mm, ridge_255


def as_stored(sample: Sample, camera: Camera, with_ridge: bool) -> Observation:
    """A frozen sample, cropped to what was measured."""
    rows, columns = sample.depth_mm.any(axis=1).nonzero()[0], sample.depth_mm.any(axis=0).nonzero()[0]
    y0, y1 = (max(rows[0] - MARGIN_PX, 0), min(rows[-1] + 1 + MARGIN_PX, camera.height)) if len(rows) else (0, 1)
    x0, x1 = (max(columns[0] - MARGIN_PX, 0), min(columns[-1] + 1 + MARGIN_PX, camera.width)) if len(rows) else (0, 1)
    part = slice(y0, y1), slice(x0, x1)
    return Observation(
        sample.depth_mm[part].astype(np.float32) / np.float32(MM_PER_METRE),
        camera.cropped(int(x0), int(y0), int(x1 - x0), int(y1 - y0)),
        sample.joints_camera_m,
        sample.visible,
        sample.ridge[part].astype(np.float32) / np.float32(255) if with_ridge and sample.ridge is not None else None,
    )


@njit(cache=True)
def _compose(person_mm, room_mm):
    """The scene in metres, nearer things first, and a label on the person's pixels."""
    height, width = person_mm.shape
    scene = np.empty((height, width), np.float32)
    labels = np.zeros((height, width), np.uint8)
    per_metre = np.float32(MM_PER_METRE)
    for y in range(height):
        for x in range(width):
            z = person_mm[y, x]
            behind = room_mm[y, x]
            if z > 0 and (behind == 0 or z <= behind):
                labels[y, x] = PERSON
                behind = z
            scene[y, x] = np.float32(behind) / per_metre
    return scene, labels


def _attach(
    scene_m: np.ndarray, labels: np.ndarray, camera: Camera, radius_m: float, at_lowest: bool, where: float
) -> None:
    """Labels the room within radius_m of one of the person's pixels, if there is any: changes labels in place."""
    rows, columns = labels.nonzero()
    if not len(rows):
        return
    chosen = -1 if at_lowest else int(where * len(rows))
    points = camera.points(scene_m)
    away = np.linalg.norm(points - points[rows[chosen], columns[chosen]], axis=-1)
    labels[(away < radius_m) & (labels == 0) & (scene_m > 0)] = ATTACHED


@njit(cache=True)
def _cut_out(measured, seen, intrinsics, up, lowest_m, grow):
    """(h, w) float32: what was measured on the person at least lowest_m above the floor, shrunk or grown by a pixel."""
    height, width = measured.shape
    fx, fy, cx, cy = intrinsics
    cut_out = np.zeros((height, width), np.float32)
    for y in range(height):
        for x in range(width):
            if seen[y, x]:
                z = measured[y, x]
                ray_up = up[0] * (x - cx) / fx + up[1] * (y - cy) / fy + up[2]
                if z * ray_up + up[3] >= lowest_m:
                    cut_out[y, x] = z
    if grow == 0:
        return cut_out
    resized = cut_out.copy()
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            here = cut_out[y, x]
            up_z, down_z, left_z, right_z = cut_out[y - 1, x], cut_out[y + 1, x], cut_out[y, x - 1], cut_out[y, x + 1]
            if grow < 0 and here > 0 and min(up_z, down_z, left_z, right_z) == 0:
                resized[y, x] = 0
            elif grow > 0 and here == 0:
                resized[y, x] = max(up_z, down_z, left_z, right_z)
    return resized
