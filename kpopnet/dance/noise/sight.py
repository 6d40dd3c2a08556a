"""How a learner's limbs differ from a teacher's, and what of it a single picture shows.

A network that lifts the joints of a picture knows the directions of limbs well across the line of sight, and badly along it: by
webcam errors are 1 to 3 degrees in the median across, and 5 to 20 along (docs/ledger.md). So of the difference of two
directions only what lies across the line of sight is compared. What lies along it is taken to be as large, as it is in the
mean of faults in all directions: scores through a picture then compare with those on true joints.

A forearm is compared after it has been turned as the upper arm differs from the teacher's, a lower leg likewise, for the
feature measures it about the upper limb. It is turned by what is seen of that difference alone: the unseen part is mostly an
error, which would show in a forearm that points to the camera.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.dance.dtw import PathDistances, distances_on_path
from kpopnet.dance.features import Features, limb_directions, limb_frames
from kpopnet.dance.noise.steady import AZIMUTH, INCLINATION, PART_OF_SEGMENT, segment_vectors
from kpopnet.skeleton import Joint

POINTS_AT_CAMERA = 0.03
"""Squared sine of the angle to the line of sight below which a limb points at the camera (10 degrees): then no direction across
the limb is better known than another."""

CENTRED_M = 0.5
"""Of a person this near the origin the joints are centred, in the axes of the camera, and the line of sight is its z axis."""


class SeenDifference(NamedTuple):
    """What a picture shows of differences of limbs, learner minus teacher, in the torso's frame; upper limbs come first."""

    difference: np.ndarray  # (T, K, 2, 4, 3) radians long, across `middle`
    # (T, K, 2, 4, 1) makes the squares, in the mean over faults in all directions, those of the whole differences
    factor: np.ndarray
    middle: np.ndarray  # (T, K, 2, 4, 3) unit directions halfway between learner and teacher

    @property
    def angles_rad(self) -> np.ndarray:
        """(T, K, 2, 4, 2) what is seen of the differences in inclination and azimuth, radians."""
        upper = np.broadcast_to([1.0, 0.0, 0.0], self.middle[:, :, 0].shape)  # the axis of an upper limb's angles is u
        around = np.cross(np.stack([upper, self.middle[:, :, 0]], axis=2), self.middle)
        sine = np.maximum(np.linalg.norm(around, axis=-1, keepdims=True), 1e-9)
        inclination = (np.cross(around / sine, self.middle) * self.difference).sum(axis=-1)
        azimuth = (around / sine**2 * self.difference).sum(axis=-1)
        return np.clip(np.stack([inclination, azimuth], axis=-1), -np.pi, np.pi)


def path_distances(
    path: np.ndarray, learner: Features, teacher: Features, offset: int, parts: np.ndarray, sees_depth: bool
) -> PathDistances:
    """`kpopnet.dance.dtw.distances_on_path`; unless the estimator sees depth, the differences of limbs are what is seen.

    The learner's joints are in the camera frame then.
    """
    on_path = distances_on_path(path, learner, teacher, offset, parts)
    if sees_depth:
        return on_path
    matched = offset + path.sum(axis=1)
    rows = np.clip(matched[:, None] + [-1, 0, 1], 0, len(teacher.joints_m) - 1)
    begin = rows.min()
    taught = limb_directions(teacher.joints_m[begin : rows.max() + 1])[rows - begin]
    seen = seen_difference(learner.joints_m[path[:, 0]], taught)
    squares = (np.square(seen.factor * seen.difference)).sum(axis=-1)  # (L, 3, 2, 4)
    squares = np.where(np.isfinite(squares), squares, squares[:, 1:2])  # as of angles that the neighbour lacks
    squared, signed, limbs = on_path.squared.copy(), on_path.signed.copy(), PART_OF_SEGMENT[:4]
    squared[:, :, limbs] = np.nansum(squares, axis=2) * on_path.taught[:, None, limbs]
    for columns, angles_rad in zip((INCLINATION, AZIMUTH), np.moveaxis(seen.angles_rad[:, 1], -1, 0), strict=True):
        signed[:, columns] = np.where(np.isfinite(signed[:, columns]), angles_rad.reshape(len(signed), -1), np.nan)
    return on_path._replace(squared=squared, signed=signed)


def segment_differences(learner: Features, teacher: Features, sees_depth: bool) -> np.ndarray:
    """(T, S, 3) differences, learner minus teacher, of `segment_vectors` of features of as many frames, NaN where missing.

    Unless the estimator sees depth those of limbs are what is seen, radians; the learner's joints are in the camera frame then.
    """
    difference = segment_vectors(learner.angles_rad) - segment_vectors(teacher.angles_rad)
    if not sees_depth:
        seen, limbs = seen_difference(learner.joints_m, limb_directions(teacher.joints_m)[:, None]), difference[:, :-1]
        limbs[...] = np.where(np.isfinite(limbs), (seen.factor * seen.difference).reshape(limbs.shape), np.nan)
    return difference


def seen_difference(learner_m: np.ndarray, taught: np.ndarray) -> SeenDifference:
    """Of (T, 15, 3) joints of the learner in the camera frame, and for each K times (4, 6) `limb_directions` of the teacher."""
    rays = (limb_frames(learner_m) @ _lines_of_sight(learner_m)[:, None, :, None])[:, None, :, :, 0]
    danced = limb_directions(learner_m)[:, None]
    upper_middle, whole = _halfway(danced[..., :3], taught[..., :3])
    upper, upper_factor = _seen(whole, upper_middle, rays)
    middle, whole = _halfway(danced[..., 3:], taught[..., 3:])
    lower, factor = _seen(whole - np.cross(np.cross(upper_middle, upper), middle), middle, rays)
    pairs = (upper, lower), (upper_factor, factor), (upper_middle, middle)
    return SeenDifference(*(np.stack(pair, axis=2) for pair in pairs))


def _lines_of_sight(joints_m: np.ndarray) -> np.ndarray:
    """(T, 3) unit directions from the camera to the torso of (T, 15, 3) joints."""
    torso_m = joints_m[:, Joint.TORSO]
    distance_m = np.linalg.norm(torso_m, axis=1, keepdims=True)
    return np.where(distance_m < CENTRED_M, (0.0, 0.0, 1.0), torso_m / np.maximum(distance_m, CENTRED_M))


def _halfway(danced: np.ndarray, taught: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(..., 3) unit directions halfway between two, 0 where these are opposite, and the differences across them, radians."""
    both, difference = danced + taught, danced - taught
    half = np.linalg.norm(difference, axis=-1, keepdims=True) / 2
    middle = both / np.maximum(np.linalg.norm(both, axis=-1, keepdims=True), 1e-9)
    return middle, difference * (np.arcsin(np.minimum(half, 1)) / np.maximum(half, 1e-9))


def _seen(difference: np.ndarray, middle: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(..., 3) differences across directions without what lies along the rays, and the (..., 1) factors that make up for it."""
    along = rays - (rays * middle).sum(axis=-1, keepdims=True) * middle
    squared = (along**2).sum(axis=-1, keepdims=True)
    unseen = squared / (squared + POINTS_AT_CAMERA)
    lost = along * (along * difference).sum(axis=-1, keepdims=True) / (squared + POINTS_AT_CAMERA)
    return difference - lost, np.sqrt(2 / (2 - unseen))
