"""Turns a clean sample into an estimator's input: sensor noise, then an imperfect segmentation of the person.

The person is composited into the empty room, and only the surroundings of the person's bounding box are measured. The
label of a pixel (person or room) moves with the sensor's lateral noise, so outlines are as noisy as the depth.
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from kpopnet.camera import MM_PER_METRE, Camera, check_images
from kpopnet.data.observation import Observation
from kpopnet.data.shards import Sample, ShardedSet
from kpopnet.errors import InputError, check_between
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.skeleton import Joint
from synth.samples.layers import Box, millimetres, silhouette_box, widened
from synth.sensor.kernel import erase_ellipses
from synth.sensor.model import SENSORS, SensorConfig, measure_labelled, spherical_hole

MARGIN_PX = 4
"""Margin around the person's bounding box that is measured too: one pixel for dilation, two empty ones for the ridge."""

HANDS = [Joint.RIGHT_HAND, Joint.LEFT_HAND]
LIMB_ENDS = [*HANDS, Joint.RIGHT_FOOT, Joint.LEFT_FOOT]
HAND_RADIUS_M = (0.08, 0.14)
HAND_DEPTH_M = 0.2
ATTACHED_RADIUS_M = (0.1, 0.3)
HAIR_STREAM, SENSOR_STREAM = 0x4A12, 0x5E45
"""Make what is drawn for a person's hair, and which sensor measures an image, independent of other draws."""

HAIRLINE_M, HAIR_REACH_M = (0.02, 0.07), (0.3, 0.17)
"""Range of the hairline's height above the head joint, along the axis from the neck; and how far from the joint hair reaches,
along that axis and across it."""

PERSON, ATTACHED = 1, 2  # labels of pixels; 0 is the room


@dataclass(frozen=True)
class ExtractionConfig:
    """Failures of the segmentation of the person. Probabilities are per image.

    Attributes:
        feet_cut_m: largest height, metres above the floor, below which the person is segmented as floor; each image draws
            its height uniformly between 0 and this value.
        erode: probability that the silhouette loses one pixel all around.
        dilate: probability that the silhouette gains one pixel all around, with the depth of the adjacent person pixel.
        attached: probability that a part of the room within 10-30 cm of the person is segmented as person: half of the
            time at the person's lowest pixel (floor), else at any pixel of the person (furniture).
        hand_missing: probability that one hand is missing from the silhouette.
        hair_missing: probability, by person and not by image, that hair returns no infrared light: the head above the face is
            missing in all of the person's images.
    """

    feet_cut_m: float = 0.08
    erode: float = 0.25
    dilate: float = 0.25
    attached: float = 0.02
    hand_missing: float = 0.03
    hair_missing: float = 0.1

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            check_between(f"extraction.{name}", value, 0, 10 if name == "feet_cut_m" else 1)
        # A silhouette is eroded or dilated, not both.
        check_between("extraction.erode + extraction.dilate", self.erode + self.dilate, 0, 1)


@dataclass(frozen=True)
class FreezeConfig:
    """How the samples of a frozen set are measured and segmented before they are stored."""

    sensor: SensorConfig
    extraction: ExtractionConfig
    ridge: RidgeConfig


Background = tuple[np.ndarray, np.ndarray]
"""The empty room behind a person, as it is rendered: (H, W) uint16 depth, millimetres, and its (4,) floor plane in the camera
frame, upward unit normal n and offset d in metres, n.x + d = 0."""


@dataclass(frozen=True)
class Observer:
    """A set of shards as observations with fresh noise in every epoch; implements kpopnet's `ObservationSource`.

    Observation (index, epoch) depends only on the seed, the sample and the configuration. Samples of frozen shards are
    returned as they are stored.
    """

    shards: ShardedSet
    sensor: SensorConfig
    extraction: ExtractionConfig
    seed: int
    other_sensors: dict[str, float] = field(default_factory=dict)  # probabilities that another one of SENSORS measures an image

    def __post_init__(self) -> None:
        shares = self.other_sensors
        if shares.keys() - SENSORS.keys() or min(shares.values(), default=0) < 0 or not sum(shares.values()) <= 1:
            raise InputError(f"other_sensors={shares}: expected probabilities of {', '.join(SENSORS)} whose sum is at most 1")

    def __len__(self) -> int:
        return len(self.shards)

    def observe(self, index: int, epoch: int) -> Observation:
        """See `kpopnet.data.observation.ObservationSource`. The depth is cropped to the person's surroundings."""
        sample = self.shards[index]
        if self.shards.kind == "frozen":
            return as_stored(sample, self.shards.camera)
        room = self.shards.room(index, sample.room)
        rng = np.random.default_rng([self.seed, epoch, index])
        return observe_sample(sample, room, self.shards.camera, self._sensor(index, epoch), self.extraction, rng)

    def _sensor(self, index: int, epoch: int) -> SensorConfig:
        drawn, below = np.random.default_rng([SENSOR_STREAM, self.seed, epoch, index]).random(), 0.0
        for name, probability in self.other_sensors.items():
            below += probability
            if drawn < below:
                return SENSORS[name]
        return self.sensor


def observe_sample(
    sample: Sample,
    room: Background,
    camera: Camera,
    sensor: SensorConfig,
    extraction: ExtractionConfig,
    rng: np.random.Generator,
) -> Observation:
    """Measures and segments one clean sample, cropped to the person's surroundings; `rng` is the only source of randomness."""
    room_mm, floor = room
    check_images("sample and room", camera, sample.depth_mm, room_mm)
    # All random numbers but the sensor's are drawn at once, whether they are used or not.
    cut, outline, attached, missing, hand, size, kind, where = rng.random(8)
    attaches = attached < extraction.attached
    x0, y0, x1, y1 = _surroundings(sample, camera, attaches)
    cropped = camera.cropped(x0, y0, x1 - x0, y1 - y0)

    person_mm, room_mm = sample.depth_mm[y0:y1, x0:x1], room_mm[y0:y1, x0:x1]
    labels = ((person_mm > 0) & ((room_mm == 0) | (person_mm <= room_mm))).astype(np.uint8) * np.uint8(PERSON)
    scene_m = np.where(labels, person_mm, room_mm).astype(np.float32) / np.float32(MM_PER_METRE)
    if attaches:
        radius_m = ATTACHED_RADIUS_M[0] + size * (ATTACHED_RADIUS_M[1] - ATTACHED_RADIUS_M[0])
        _attach(scene_m, labels, cropped, radius_m, at_lowest=kind < 0.5, where=where)
    ends = sample.joints_camera_m[LIMB_ENDS]
    measured, seen = measure_labelled(scene_m, labels, cropped, sensor, rng, ends[np.isfinite(ends[:, 2])])

    grow = -1 if outline < extraction.erode else int(outline > 1 - extraction.dilate)
    # The height of a point x above the floor is up[:3].x + up[3], with the sign that puts the camera above the floor.
    up = np.asarray(floor, np.float32) * np.float32(1 if floor[3] >= 0 else -1)
    intrinsics = np.array([cropped.fx, cropped.fy, cropped.cx, cropped.cy], np.float32)
    depth_m = _segment(measured, seen, intrinsics, up, np.float32(cut * extraction.feet_cut_m), grow)
    if missing < extraction.hand_missing:
        centre = sample.joints_camera_m[HANDS[int(hand * 2)]]
        radius_m = HAND_RADIUS_M[0] + size * (HAND_RADIUS_M[1] - HAND_RADIUS_M[0])
        erase_ellipses(depth_m, spherical_hole(centre, radius_m, HAND_DEPTH_M, cropped).astype(np.float32))
    absorbed, hairline = np.random.default_rng([HAIR_STREAM, abs(sample.body)]).random(2)
    if absorbed < extraction.hair_missing:
        above_m = HAIRLINE_M[0] + hairline * (HAIRLINE_M[1] - HAIRLINE_M[0])
        _erase_hair(depth_m, intrinsics, sample.joints_camera_m[Joint.HEAD], sample.joints_camera_m[Joint.NECK], above_m)
    return Observation(depth_m, cropped, sample.joints_camera_m, sample.visible)


def _surroundings(sample: Sample, camera: Camera, with_attached: bool) -> Box:
    """x0, y0, x1, y1 of the person's box with its margin, within the image."""
    x0, y0, x1, y1 = sample.box
    if not (0 <= x0 <= x1 <= camera.width and 0 <= y0 <= y1 <= camera.height):
        raise InputError(f"sample: the box {sample.box} is not within {camera.width}x{camera.height} pixels")
    margin = MARGIN_PX
    if with_attached and x1 > x0:
        person_mm = sample.depth_mm[y0:y1, x0:x1]
        nearest_mm = person_mm.min(where=person_mm > 0, initial=np.iinfo(np.uint16).max)
        margin += int(ATTACHED_RADIUS_M[1] * camera.fx * MM_PER_METRE / nearest_mm)
    return widened(sample.box, margin, camera)


def freeze(
    sample: Sample, room: Background, camera: Camera, look: FreezeConfig, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The result of `observe_sample`, pasted into the full image, (H, W) uint16 depth in millimetres, and its ridge, (H, W)
    uint8 probability times 255.
    """
    seen = observe_sample(sample, room, camera, look.sensor, look.extraction, rng)
    x0, y0 = round(camera.cx - seen.camera.cx), round(camera.cy - seen.camera.cy)
    part = slice(y0, y0 + seen.camera.height), slice(x0, x0 + seen.camera.width)
    depth_mm = np.zeros((camera.height, camera.width), np.uint16)
    depth_mm[part] = millimetres(seen.depth_m)
    ridge_255 = np.zeros((camera.height, camera.width), np.uint8)
    ridge_255[part] = np.rint(ridge_probability(seen.depth_m, look.ridge) * 255)
    return depth_mm, ridge_255


def as_stored(sample: Sample, camera: Camera) -> Observation:
    """A frozen sample as an observation, cropped to its non-zero pixels plus a margin."""
    check_images("sample", camera, sample.depth_mm)
    box = silhouette_box(sample.depth_mm)
    x0, y0, x1, y1 = widened(box, MARGIN_PX, camera) if any(box) else (0, 0, 1, 1)
    return Observation(
        sample.depth_mm[y0:y1, x0:x1].astype(np.float32) / np.float32(MM_PER_METRE),
        camera.cropped(x0, y0, x1 - x0, y1 - y0),
        sample.joints_camera_m,
        sample.visible,
    )


def _attach(scene_m: np.ndarray, labels: np.ndarray, camera: Camera, radius_m: float, at_lowest: bool, where: float) -> None:
    """Labels the room within radius_m of one pixel of the person as ATTACHED, in place. No effect without a person."""
    rows, columns = labels.nonzero()
    if not len(rows):
        return
    chosen = -1 if at_lowest else int(where * len(rows))
    points = camera.points(scene_m)
    away = np.linalg.norm(points - points[rows[chosen], columns[chosen]], axis=-1)
    labels[(away < radius_m) & (labels == 0) & (scene_m > 0)] = ATTACHED


def _erase_hair(depth_m: np.ndarray, intrinsics: np.ndarray, head_m: np.ndarray, neck_m: np.ndarray, above_m: float) -> None:
    """Sets (h, w) depth to 0, in place, where it lies more than above_m beyond the head joint, seen from the neck."""
    (along_reach_m, across_reach_m), (fx, fy, cx, cy) = HAIR_REACH_M, intrinsics
    y, x = np.indices(depth_m.shape)
    axis = head_m - neck_m
    axis = axis / np.sqrt((axis * axis).sum())
    off_x, off_y, off_z = (x - cx) * depth_m / fx - head_m[0], (y - cy) * depth_m / fy - head_m[1], depth_m - head_m[2]
    along = off_x * axis[0] + off_y * axis[1] + off_z * axis[2]
    across = off_x * off_x + off_y * off_y + off_z * off_z - along * along
    # A missing joint is NaN: no comparison holds, and nothing is erased.
    hair = (np.abs(off_z) < along_reach_m) & (above_m < along) & (along < along_reach_m)
    depth_m[hair & (across < across_reach_m * across_reach_m)] = 0


@njit(cache=True)
def _segment(measured, seen, intrinsics, up, lowest_m, grow):
    """(h, w) float32 depth of the labelled pixels at least lowest_m above the floor, eroded or dilated by one pixel."""
    height, width = measured.shape
    fx, fy, cx, cy = intrinsics
    segmented = np.zeros((height, width), np.float32)
    for y in range(height):
        for x in range(width):
            if seen[y, x]:
                z = measured[y, x]
                ray_up = up[0] * (x - cx) / fx + up[1] * (y - cy) / fy + up[2]
                if z * ray_up + up[3] >= lowest_m:
                    segmented[y, x] = z
    if grow == 0:
        return segmented
    resized = segmented.copy()
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            here = segmented[y, x]
            up_z, down_z, left_z, right_z = segmented[y - 1, x], segmented[y + 1, x], segmented[y, x - 1], segmented[y, x + 1]
            if grow < 0 and here > 0 and min(up_z, down_z, left_z, right_z) == 0:
                resized[y, x] = 0
            elif grow > 0 and here == 0:
                resized[y, x] = max(up_z, down_z, left_z, right_z)
    return resized
