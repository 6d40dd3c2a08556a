"""What an estimator did with the images of the script (`kpopnet.datasets.check_script`), and who was in view."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import h5py
import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.datasets.simulated import FORMAT, read_sequence
from kpopnet.errors import InputError
from kpopnet.evaluation.people.metrics import sight

WIDTH_PX = 160
"""Images are kept at most so wide."""

NEARER_M = 0.15
"""What is so much nearer than the empty room is a person or a thing in it."""

IN_VIEW_M2, EMPTY_M2 = 0.2, 0.02
"""A person is in view whose surface that the camera sees is at least the first; less than the second, no person. An adult's
is 0.3 to 0.7 m2."""


class Kept(NamedTuple):
    """A depth image as it is kept: (h, w) uint16 millimetres and the camera of these pixels."""

    depth_mm: np.ndarray
    camera: Camera

    @classmethod
    def of(cls, depth_m: np.ndarray, camera: Camera) -> "Kept":
        """Every k-th pixel of (H, W) metres; what is too far for 16 bits becomes 0, not measured."""
        k = -(-camera.width // WIDTH_PX)
        small_mm = np.rint(depth_m[::k, ::k] * np.float32(MM_PER_METRE))
        small_mm[small_mm > np.iinfo(np.uint16).max] = 0
        height, width = small_mm.shape
        return cls(
            small_mm.astype(np.uint16), Camera(camera.fx / k, camera.fy / k, camera.cx / k, camera.cy / k, width, height)
        )


class Truth(NamedTuple):
    """What is known of the person in the T images of a simulated film."""

    kind: str  # of the film
    joints_m: np.ndarray  # (T, 15, 3) true joints in the camera frame, metres
    in_view: np.ndarray  # (T,) bool, whether at least half of the person shows
    empty: np.ndarray  # (T,) bool, whether nothing of the person shows


@dataclass(frozen=True)
class Watched:
    """One run of the script, of the T images that the estimator was given."""

    name: str  # of the recording or camera
    kind: str  # of the runs that are put together in a sheet
    # (T,) when each image was taken, in seconds of the script; negative where the empty room was watched longer
    times_s: np.ndarray
    delays_s: np.ndarray  # (T,) from then until its joints were there; NaN where images were not fed in real time
    processor_s: np.ndarray  # (T,) processor time that the process took for each answer, on all of its threads
    received: int  # number of images that the camera sent, those that were dropped among them
    joints_m: np.ndarray  # (T, 15, 3) joints of the main person in the camera frame, metres, NaN where missing
    people_m: list[list[np.ndarray]]  # by number of the image, the (15, 3) joints of all people found
    in_view: np.ndarray  # (T,) bool, whether a person is in view
    empty: np.ndarray  # (T,) bool, whether certainly no person is
    images: dict[int, Kept]  # those images by number that the sheet shows
    truth_m: np.ndarray | None = None  # (T, 15, 3) true joints, None where they are not known


def surfaces_m2(images: list[Kept], empty: np.ndarray) -> np.ndarray:
    """(T,) surface before the empty room in each image, square metres; (T,) bool `empty` says which show it: at least one.

    NaN where nothing was measured, as by a covered lens. The empty room is the median of its measured depths. Lines as thin as
    a pixel, the flicker of edges, do not count.
    """
    rooms_m = np.stack([image.depth_mm for image, is_empty in zip(images, empty, strict=True) if is_empty]) / MM_PER_METRE
    rooms_m[rooms_m == 0] = np.nan
    unknown = np.isnan(rooms_m).all(axis=0)
    rooms_m[:, unknown] = np.inf
    room_m, areas = np.nanmedian(rooms_m, axis=0), []
    for image in images:
        depth_m = image.depth_mm / MM_PER_METRE
        nearer = ((depth_m > 0) & (depth_m < room_m - NEARER_M)).astype(np.uint8)
        solid = cv2.morphologyEx(nearer, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
        area_m2 = float((depth_m[solid] ** 2).sum() / (image.camera.fx * image.camera.fy))
        areas.append(area_m2 if image.depth_mm.any() else np.nan)
    return np.array(areas)


def stored_truth(path: Path) -> Truth | None:
    """The truth in a simulated film; None for any other file, and a damaged one, whose damage the reader of depth reports."""
    if path.suffix.lower() not in (".h5", ".hdf5"):
        return None
    try:
        with h5py.File(path, "r", locking=False) as file:
            if file.attrs.get("format") != FORMAT:
                return None
    except OSError:
        return None
    stored = read_sequence(path, ())
    if len(stored.people) != 1 or stored.seen_px is None or stored.whole_px is None:
        raise InputError(
            f"{path}: expected a film of one person with seen_px and whole_px, as `python -m synth benchmark=check_sim` makes"
        )
    in_view, _ = sight(stored)
    return Truth(stored.kind, stored.joints_m[:, 0], in_view[:, 0], stored.seen_px[:, 0] == 0)
