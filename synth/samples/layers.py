"""Composes the stored image of a person from what is drawn: the person, the room, what they hold, what stands around them.

The stored depth shows the person alone. Pixels that something else hides are 0; what the person holds counts as the person;
of a seat or another person, the parts nearest to the person may be segmented as the person.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.skeleton import Joint

_OFFSETS_M = {
    "HEAD": 0.16, "NECK": 0.16, "TORSO": 0.22, "SHOULDER": 0.15, "HIP": 0.20,
    "KNEE": 0.12, "ELBOW": 0.09, "HAND": 0.08, "FOOT": 0.12,
}  # fmt: skip
SURFACE_OFFSET_M = np.array([_OFFSETS_M[joint.name.rpartition("_")[2]] for joint in Joint])
"""(15,) largest distance along z by which the measured surface may lie in front of a joint that counts as visible. A nearer
surface belongs to another body part. Read off dressed people seen from all sides."""

Box = tuple[int, int, int, int]


class Around(NamedTuple):
    """What else is drawn than person and room; (H, W) float32 depth in metres, 0 where there is none."""

    held_m: np.ndarray | None = None  # what the person holds, or None
    others_m: tuple[np.ndarray, ...] = ()  # seats and other people
    # distance, metres, from the person within which the others are segmented as the person, for each of them
    attached_m: tuple[float, ...] = ()

    @property
    def is_empty(self) -> bool:
        return self.held_m is None and not self.others_m


class Composed(NamedTuple):
    depth_mm: np.ndarray  # (H, W) uint16 depth of what is segmented as the person, millimetres
    own_mm: np.ndarray  # (H, W) uint16 depth of the visible person alone
    box: Box  # x0, y0, x1, y1 of the pixels of depth_mm


def compose(person_m: np.ndarray, room_mm: np.ndarray, around: Around, camera: Camera) -> Composed:
    """Composes the stored image from (H, W) depth of the person in metres and of the empty room in millimetres."""
    if around.is_empty:
        own_mm = _visible_mm(person_m, room_mm)
        return Composed(own_mm, own_mm, silhouette_box(own_mm))
    others_mm = [millimetres(other_m) for other_m in around.others_m]
    hiding_mm = room_mm
    for other_mm in others_mm:
        hiding_mm = _nearest(hiding_mm, other_mm)
    held_mm = np.zeros_like(room_mm) if around.held_m is None else millimetres(around.held_m)
    own_mm = _visible_mm(person_m, _nearest(hiding_mm, held_mm))
    in_front = (held_mm > 0) & ((hiding_mm == 0) | (held_mm <= hiding_mm))
    depth_mm = np.where(in_front & (own_mm == 0) & ((person_m == 0) | (held_mm <= millimetres(person_m))), held_mm, own_mm)
    for other_mm, reach_m in zip(others_mm, around.attached_m, strict=True):
        if reach_m > 0:
            seen_mm = np.where((other_mm == hiding_mm) & (depth_mm == 0), other_mm, np.uint16(0))
            depth_mm = depth_mm + _near_person(seen_mm, own_mm, np.array([camera.fx, camera.fy]), 1000 * reach_m)
    return Composed(depth_mm, own_mm, silhouette_box(depth_mm))


def hidden_fraction(person_m: np.ndarray, other_m: np.ndarray, room_mm: np.ndarray) -> float:
    """Fraction of the person's pixels, as far as the room does not hide them, that another person hides."""
    seen = (person_m > 0) & ((room_mm == 0) | (millimetres(person_m) <= room_mm))
    hidden = seen & (other_m > 0) & (other_m < person_m)
    return np.count_nonzero(hidden) / max(np.count_nonzero(seen), 1)


def millimetres(depth_m: np.ndarray) -> np.ndarray:
    """Depth in metres as uint16 millimetres."""
    return np.rint(depth_m * np.float32(MM_PER_METRE)).astype(np.uint16)


def silhouette_box(depth_mm: np.ndarray) -> Box:
    """Bounding box x0, y0, x1, y1 of the non-zero pixels, the last two exclusive; all 0 for an empty image."""
    rows, columns = np.flatnonzero(depth_mm.any(1)), np.flatnonzero(depth_mm.any(0))
    if not len(rows):
        return 0, 0, 0, 0
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def widened(box: Box, margin_px: int, camera: Camera) -> Box:
    """A box with a margin around it, within the image."""
    x0, y0, x1, y1 = box
    return max(x0 - margin_px, 0), max(y0 - margin_px, 0), min(x1 + margin_px, camera.width), min(y1 + margin_px, camera.height)


def _nearest(one_mm: np.ndarray, other_mm: np.ndarray) -> np.ndarray:
    """The nearer of two depth images, in which 0 is nothing."""
    return np.where((one_mm == 0) | ((other_mm > 0) & (other_mm < one_mm)), other_mm, one_mm)


def _visible_mm(person_m: np.ndarray, room_mm: np.ndarray) -> np.ndarray:
    """(H, W) uint16 depth of the person in millimetres, 0 where something nearer hides them."""
    person_mm = millimetres(person_m)
    return np.where((room_mm > 0) & (room_mm < person_mm), np.uint16(0), person_mm)


@njit(cache=True)
def _near_person(other_mm, person_mm, focal_px, reach_mm):
    """The pixels of other_mm within a distance of any pixel of the person, the others 0.

    The distance is along the depth or across the image at the other's depth, whichever is larger, to every second pixel of
    the person: nothing here depends on a precise one.
    """
    height, width = other_mm.shape
    near = np.zeros_like(other_mm)
    for y in range(height):
        for x in range(width):
            z = np.float64(other_mm[y, x])
            if z == 0:
                continue
            reach_x, reach_y = int(reach_mm * focal_px[0] / z), int(reach_mm * focal_px[1] / z)
            for row in range(max(y - reach_y, 0), min(y + reach_y + 1, height), 2):
                for column in range(max(x - reach_x, 0), min(x + reach_x + 1, width), 2):
                    if person_mm[row, column] > 0 and abs(np.float64(person_mm[row, column]) - z) <= reach_mm:
                        near[y, x] = other_mm[y, x]
                        break
                if near[y, x] > 0:
                    break
    return near


def at_joints(image: np.ndarray, joints_camera_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(N,) values of an (H, W) image at the pixels of (N, 3) joints in metres, 0 where they are not inside the image."""
    u, v, z = camera.project(joints_camera_m).T
    inside = (z > 0) & (np.abs(u - (camera.width - 1) / 2) < camera.width / 2)
    inside &= np.abs(v - (camera.height - 1) / 2) < camera.height / 2
    row, column = (np.where(inside, np.rint(w), 0).astype(int) for w in (v, u))
    return np.where(inside, image[row, column], 0)


def visible_joints(joints_camera_m: np.ndarray, own_mm: np.ndarray, camera: Camera) -> np.ndarray:
    """(15,) bool: whether a joint projects onto the visible person and the surface there belongs to its body part."""
    seen_mm = at_joints(own_mm, joints_camera_m, camera)
    return (seen_mm > 0) & (seen_mm / MM_PER_METRE > joints_camera_m[:, 2] - SURFACE_OFFSET_M)
