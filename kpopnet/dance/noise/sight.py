"""How a learner's limbs differ from a teacher's, and what of it a single picture shows.

A network that lifts the joints of a picture knows the directions of limbs well across the line of sight, and badly along it: by
webcam errors are 1 to 3 degrees in the median across, and 5 to 20 along (docs/ledger.md). So of the difference of two
directions only what lies across the line of sight is compared. What lies along it is taken to be as large, as it is in the
mean of faults in all directions: scores through a picture then compare with those on true joints.

A forearm is compared after it has been turned as the upper arm differs from the teacher's, a lower leg likewise, for the
feature measures it about the upper limb. It is turned by what is seen of that difference alone: the unseen part is mostly an
error, which would show in a forearm that points to the camera.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.dance.dtw import PathDistances, distances_on_path
from kpopnet.dance.features import TORSO, Features, limb_in, torso_frame
from kpopnet.dance.noise.steady import AZIMUTH, INCLINATION, PART_OF_SEGMENT, segment_vectors
from kpopnet.dance.vectors import at, cross, dot, in_frame, norm, plus, times, unit

POINTS_AT_CAMERA = 0.03
"""Squared sine of the angle to the line of sight below which a limb points at the camera (10 degrees): then no direction across
the limb is better known than another."""

LEAST_SINE = 1e-9
CENTRED_M = 0.5
"""Of a person this near the origin the joints are centred, in the axes of the camera, and the line of sight is its z axis."""


class SeenDifferences(NamedTuple):
    """What a picture shows of differences of limbs, learner minus teacher, in the torso's frame; upper limbs come first.

    Limbs are in the order of `kpopnet.dance.features.limb_directions`.
    """

    difference: np.ndarray  # (L, 2, 4, 3) radians long, across the direction halfway between learner and teacher
    # (L, 2, 4) makes the squares, in the mean over faults in all directions, those of the whole differences
    factor: np.ndarray
    angles_rad: np.ndarray  # (L, 2, 4, 2) what is seen of the differences in inclination and azimuth, radians

    @property
    def scaled(self) -> np.ndarray:
        """(L, 2, 4, 3) the differences times the factor."""
        return self.difference * self.factor[..., None]


def path_distances(
    path: np.ndarray, learner: Features, teacher: Features, offset: int, parts: np.ndarray, sees_depth: bool
) -> PathDistances:
    """`kpopnet.dance.dtw.distances_on_path`; unless the estimator sees depth, the differences of limbs are what is seen.

    The learner's joints are in the camera frame then.
    """
    on_path = distances_on_path(path, learner, teacher, offset, parts)
    if sees_depth:
        return on_path
    squared, signed, limbs = on_path.squared.copy(), on_path.signed.copy(), PART_OF_SEGMENT[:4]
    frames, rows, last = path[:, 0].copy(), offset + path.sum(axis=1), len(teacher.joints_m) - 1
    seen = [
        seen_differences(learner.joints_m, frames, teacher.joints_m, np.clip(rows + shift, 0, last)) for shift in (-1, 0, 1)
    ]
    squares = [(one.scaled**2).sum(axis=-1) for one in seen]  # (L, 2, 4)
    for shift, one in enumerate(squares):
        # The matched frame stands for a neighbour that lacks the limb.
        known = np.where(np.isfinite(one), one, squares[1])
        squared[:, shift, limbs] = np.nansum(known, axis=1) * on_path.taught[:, limbs]
    for columns, angles_rad in zip((INCLINATION, AZIMUTH), np.moveaxis(seen[1].angles_rad, -1, 0), strict=True):
        signed[:, columns] = np.where(np.isfinite(signed[:, columns]), angles_rad.reshape(len(signed), -1), np.nan)
    return on_path._replace(squared=squared, signed=signed)


def segment_differences(learner: Features, teacher: Features, sees_depth: bool) -> np.ndarray:
    """(T, S, 3) differences, learner minus teacher, of `segment_vectors` of features of as many frames, NaN where missing.

    Unless the estimator sees depth those of limbs are what is seen, radians; the learner's joints are in the camera frame then.
    """
    difference = segment_vectors(learner.angles_rad) - segment_vectors(teacher.angles_rad)
    if not sees_depth:
        limbs, rows = difference[:, :-1], np.arange(len(difference))
        seen = seen_differences(learner.joints_m, rows, teacher.joints_m, rows)
        limbs[...] = np.where(np.isfinite(limbs), seen.scaled.reshape(limbs.shape), np.nan)
    return difference


@njit(cache=True)
def seen_differences(learner_m, learner_rows, teacher_m, teacher_rows):
    """The `SeenDifferences` of L pairs of frames, given by their rows, NaN where a joint is missing.

    Takes (T, 15, 3) joints of the learner in the camera frame and (M, 15, 3) ones of the teacher in any frame, metres.
    """
    pairs = len(learner_rows)
    difference, factor = np.empty((pairs, 2, 4, 3)), np.empty((pairs, 2, 4))
    angles_rad = np.empty((pairs, 2, 4, 2))
    for pair in range(pairs):
        danced, taught = learner_m[learner_rows[pair]], teacher_m[teacher_rows[pair]]
        for limb in range(4):
            frame = torso_frame(danced, limb)
            danced_limb, taught_limb = limb_in(frame, danced, limb), limb_in(torso_frame(taught, limb), taught, limb)
            ray = in_frame(frame, _sight(danced))
            axis, turn = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            for lower in range(2):
                middle, whole = _halfway(danced_limb[lower], taught_limb[lower])
                along = plus(ray, middle, -dot(ray, middle))
                squared = dot(along, along)
                whole = plus(whole, cross(turn, middle), -1.0)
                seen = plus(whole, along, -dot(along, whole) / (squared + POINTS_AT_CAMERA))
                for row in range(3):
                    difference[pair, lower, limb, row] = seen[row]
                factor[pair, lower, limb] = math.sqrt(2 / (2 - squared / (squared + POINTS_AT_CAMERA)))
                around = cross(axis, middle)
                sine = max(norm(around), LEAST_SINE)
                angles_rad[pair, lower, limb, 0] = dot(cross(around, middle), seen) / sine
                angles_rad[pair, lower, limb, 1] = max(min(dot(around, seen) / sine**2, math.pi), -math.pi)
                axis, turn = middle, cross(middle, seen)  # of the lower limb
    return SeenDifferences(difference, factor, angles_rad)


@njit(cache=True)
def _sight(joints_m):
    """The unit direction from the camera to the torso."""
    torso_m = at(joints_m, TORSO)
    return (0.0, 0.0, 1.0) if dot(torso_m, torso_m) < CENTRED_M**2 else unit(torso_m, CENTRED_M)


@njit(cache=True)
def _halfway(danced, taught):
    """The unit direction halfway between two, 0 where they are opposite, and their difference across it, radians."""
    both, chord = plus(danced, taught, 1.0), plus(danced, taught, -1.0)
    half = norm(chord) / 2
    angle = math.asin(min(half, 1.0)) / max(half, LEAST_SINE)
    return times(both, 1 / max(norm(both), LEAST_SINE)), times(chord, angle)
