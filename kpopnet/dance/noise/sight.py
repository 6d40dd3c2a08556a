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
from kpopnet.dance.features import DISTAL, MIDDLE, MIN_BONE_M, PROXIMAL, Features
from kpopnet.dance.noise.steady import AZIMUTH, INCLINATION, PART_OF_SEGMENT, segment_vectors
from kpopnet.skeleton import Joint

POINTS_AT_CAMERA = 0.03
"""Squared sine of the angle to the line of sight below which a limb points at the camera (10 degrees): then no direction across
the limb is better known than another."""

LEAST_SINE = 1e-9
TORSO = np.int64(Joint.TORSO)  # of a plain number numba would make a type of its own

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
            danced_frame, taught_frame = _torso_frame(danced, limb), _torso_frame(taught, limb)
            ray = _in(danced_frame, _sight(danced))
            axis, turn = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            for lower in range(2):
                middle, whole = _halfway(
                    _in(danced_frame, _direction(danced, limb, lower)), _in(taught_frame, _direction(taught, limb, lower))
                )
                along = _plus(ray, middle, -_dot(ray, middle))
                squared = _dot(along, along)
                whole = _plus(whole, _cross(turn, middle), -1.0)
                seen = _plus(whole, along, -_dot(along, whole) / (squared + POINTS_AT_CAMERA))
                for row in range(3):
                    difference[pair, lower, limb, row] = seen[row]
                factor[pair, lower, limb] = math.sqrt(2 / (2 - squared / (squared + POINTS_AT_CAMERA)))
                around = _cross(axis, middle)
                sine = max(math.sqrt(_dot(around, around)), LEAST_SINE)
                angles_rad[pair, lower, limb, 0] = _dot(_cross(around, middle), seen) / sine
                angles_rad[pair, lower, limb, 1] = max(min(_dot(around, seen) / sine**2, math.pi), -math.pi)
                axis, turn = middle, _cross(middle, seen)  # of the lower limb
    return SeenDifferences(difference, factor, angles_rad)


@njit(cache=True)
def _torso_frame(joints_m, limb):
    """The axes u, r, t of the torso's plane of a limb, as of `kpopnet.dance.features`."""
    torso_m, first = _at(joints_m, TORSO), limb // 2 * 2
    right_m, left_m = _at(joints_m, PROXIMAL[first]), _at(joints_m, PROXIMAL[first + 1])
    down = _plus(torso_m, _plus(right_m, left_m, 1.0), -0.5)
    r = _unit(_plus(left_m, right_m, -1.0))
    t = _unit(_cross(down, r) if limb < 2 else _cross(r, down))
    return _cross(r, t), r, t


@njit(cache=True)
def _direction(joints_m, limb, lower):
    """The unit direction of an upper or lower limb; NaN where the bone is too short to have one."""
    begin, end = (MIDDLE[limb], DISTAL[limb]) if lower else (PROXIMAL[limb], MIDDLE[limb])
    return _unit(_plus(_at(joints_m, end), _at(joints_m, begin), -1.0))


@njit(cache=True)
def _sight(joints_m):
    """The unit direction from the camera to the torso."""
    torso_m = _at(joints_m, TORSO)
    return (0.0, 0.0, 1.0) if _dot(torso_m, torso_m) < CENTRED_M**2 else _unit(torso_m)


@njit(cache=True)
def _halfway(danced, taught):
    """The unit direction halfway between two, 0 where they are opposite, and their difference across it, radians."""
    both, chord = _plus(danced, taught, 1.0), _plus(danced, taught, -1.0)
    half = math.sqrt(_dot(chord, chord)) / 2
    angle = math.asin(min(half, 1.0)) / max(half, LEAST_SINE)
    return _times(both, 1 / max(math.sqrt(_dot(both, both)), LEAST_SINE)), _times(chord, angle)


@njit(cache=True)
def _unit(a):
    length = math.sqrt(_dot(a, a))
    return _times(a, 1 / length if length >= MIN_BONE_M else np.nan)


@njit(cache=True)
def _in(frame, a):
    return _dot(frame[0], a), _dot(frame[1], a), _dot(frame[2], a)


@njit(cache=True)
def _at(joints_m, joint):
    return joints_m[joint, 0], joints_m[joint, 1], joints_m[joint, 2]


@njit(cache=True)
def _plus(a, b, factor):
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@njit(cache=True)
def _times(a, factor):
    return a[0] * factor, a[1] * factor, a[2] * factor


@njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
