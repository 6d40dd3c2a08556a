"""Dynamic time warping of a learner's window into a teacher's dance (section 3.2).

Both dances are features at the same uniformly spaced times. The learner's frame i is compared with the teacher's frames up to
`band` frames before and after the one of the same time. So distances are an array (frames, 2 * band + 1): column k of row i
belongs to the teacher's frame i + k - band. A row is computed once, when its frame arrives, and every window that contains the
frame uses it: online and offline computation are the same.

The match is open at both ends: it may begin and end anywhere in the band, in agreement with the paper's text ("finds the
corresponding teacher's dance sequence"). Its begin is found by backtracking from its best end. Dances contain repetitions
and pauses, and a single window often fits in several places. The ambiguity is resolved by the constant delay at which a
longer stretch of frames fits best (`constant_delay`): `best_match` penalises distance from it. There are two step patterns:

- `slope`: the learner is at most twice as fast or as slow as the teacher (slope constraint P = 1 of Sakoe and Chiba 1978).
  Each of the learner's frames counts once whatever the length of the match, so a long match does not cost more than a short
  one.
- `free`: the paper's three steps; each cell counts fully. A learner who stands still may then match a single frame.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.dance.features import SEEN_CONFIDENCE

_REASSOCIATE = {"reassoc", "nsz"}
"""Fast-math flags that allow sums to be vectorised: `frame_distance` is five times as fast in functions compiled with them."""

_START, _BOTH, _LEARNER, _TEACHER = 0, 1, 2, 3  # which of the two advances in the step that leads to a cell


@njit(cache=True, fastmath=_REASSOCIATE)
def banded_distances(learner, teacher, first, band, outlier):
    """(T, 2 * band + 1) values of `frame_distance`, radians, between the learner's frames and the teacher's within the band.

    They are infinite where the teacher has no such frame. Where too many angles of a pair are missing, the entry is the least
    of the row, so that a teacher's frame that lacks joints neither attracts a path nor repels it; where the learner's frame is
    the missing one, the whole row is the greatest possible distance.

    Takes (T, D) and (M, D) `Features`, the teacher's frame of the learner's `first` one, which may lie beyond both ends, half
    the width of the band in frames, and the `outlier` of `frame_distance` in radians.
    """
    frames, angles = learner.angles_rad.shape
    teacher_frames = len(teacher.angles_rad)
    # The distance if every angle differs by pi.
    greatest = math.sqrt(angles) * math.pi
    if outlier < np.inf:
        greatest = math.sqrt(angles * math.log1p((math.pi / outlier) ** 2)) * outlier
    distances = np.full((frames, 2 * band + 1), np.inf)
    for i in range(frames):
        for k in range(max(band - first - i, 0), min(teacher_frames + band - first - i, 2 * band + 1)):
            distances[i, k] = frame_distance(learner, i, teacher, first + i + k - band, outlier)
        least = greatest
        for k in range(2 * band + 1):
            if distances[i, k] < least:  # false for NaN
                least = distances[i, k]
        for k in range(2 * band + 1):
            if math.isnan(distances[i, k]):
                distances[i, k] = least
    return distances


@njit(cache=True, inline="always")
def frame_distance(learner, i, teacher, j, outlier):
    """The norm of Eq. (14), in radians, between a learner's frame i and a teacher's frame j.

    Differences are wrapped to -pi..pi, and their squares are weighted by the weights of both frames. Squares far beyond that of
    `outlier` count by their logarithm (Cauchy loss), so that a limb whose estimate is lost, or which does another move, does
    not outweigh all others. With an infinite `outlier` this is a weighted norm. Missing angles are assumed to differ as much as
    the others on average; the result is NaN if more than half are missing.
    """
    total, product, num_present = 0.0, 1.0, 0.0
    inverse = 1 / (outlier * outlier)
    angles = learner.angles_rad.shape[1]
    for c in range(angles):
        difference = abs(learner.angles_rad[i, c] - teacher.angles_rad[j, c])
        difference = min(difference, abs(difference - 2 * math.pi))
        present = difference == difference  # not NaN
        squared = learner.weights[i, c] * teacher.weights[j, c] * difference * difference if present else 0.0
        total += squared
        product *= 1 + squared * inverse  # the sum of logarithms is the logarithm of this
        num_present += 1.0 if present else 0.0
    if 2 * num_present < angles or num_present == 0:
        return np.nan
    if outlier < np.inf:
        total = outlier * outlier * math.log(product)
    return math.sqrt(total * angles / num_present)


@njit(cache=True)
def constant_delay(distances, penalty):
    """The column of the least mean distance plus `penalty` (radians) per frame of delay, where a stretch of frames fits best.

    Of each row counts what exceeds its least, so that a frame which fits nothing, or is not compared, speaks for no column:
    infinite entries of the (n, 2 * band + 1) `banded_distances` are ignored, and the first frames have them where the delay is
    great. The result is `band`, no delay, if fewer than n / 2 entries of every column are finite.
    """
    n, columns = distances.shape
    band = columns // 2
    best, least_cost = band, np.inf
    least = np.full(n, np.inf)
    for i in range(n):
        for k in range(columns):
            least[i] = min(least[i], distances[i, k])
    for k in range(columns):
        total, count = 0.0, 0
        for i in range(n):
            if distances[i, k] < np.inf:
                total += distances[i, k] - least[i]
                count += 1
        if 2 * count >= n:
            cost = total / count + penalty * abs(k - band)
            if cost < least_cost:
                best, least_cost = k, cost
    return best


def best_match(distances: np.ndarray, slope: bool, penalty: float, expected: int) -> np.ndarray:
    """Open-begin, open-end matching of a window: (L, 2) rows and columns of `distances`; empty without finite distances.

    Takes (n, 2 * band + 1) `banded_distances`, n >= 1, radians; whether the step pattern is `slope`, not `free`; a penalty,
    radians per frame; and the column of the expected delay. The begin and the end of the match each cost penalty * n / 2 per
    frame of distance from that column, so that of equally good matches the nearest is chosen.
    """
    n, columns = distances.shape
    endpoint_cost = penalty * n / 2 * np.abs(np.arange(columns) - expected)
    cost, step = _accumulated_cost(distances, slope, endpoint_cost)
    end = np.argmin(cost[n - 1] + endpoint_cost)
    return _backtrack(end, step, slope) if cost[n - 1, end] < np.inf else np.empty((0, 2), np.int64)


@njit(cache=True)
def _accumulated_cost(distances, slope, begin_cost):
    """(n, 2 * band + 1) least cost, radians, of a match that ends in each cell, and int8 the step that leads to the cell.

    `begin_cost` (2 * band + 1,) is that of beginning in each column, radians; for others see `best_match`.
    """
    n, columns = distances.shape
    cost = np.full((n, columns), np.inf)
    step = np.zeros((n, columns), np.int8)
    for k in range(columns):  # numba compiles the sum of two rows for two seconds
        cost[0, k] = distances[0, k] + begin_cost[k]
    for i in range(n):
        for k in range(columns):
            here = distances[i, k]
            if here == np.inf:
                continue
            best, by = cost[i, k], _START
            if i > 0:
                best, by = cost[i - 1, k] + here, _BOTH
            learner, teacher = np.inf, np.inf
            if slope:
                if i > 1 and k + 1 < columns:
                    learner = cost[i - 2, k + 1] + distances[i - 1, k + 1] + here
                if i > 0 and k > 0:
                    teacher = cost[i - 1, k - 1] + (distances[i, k - 1] + here) / 2
            else:
                if i > 0 and k + 1 < columns:
                    learner = cost[i - 1, k + 1] + here
                if k > 0:
                    teacher = cost[i, k - 1] + here
            if learner < best:
                best, by = learner, _LEARNER
            if teacher < best:
                best, by = teacher, _TEACHER
            cost[i, k], step[i, k] = best, by
    return cost, step


@njit(cache=True)
def _backtrack(end, step, slope):
    """(L, 2) the path from its begin to column `end` of the last row."""
    n, columns = step.shape
    path = np.empty((2 * (n + columns), 2), np.int64)
    i, k, length = n - 1, end, 0
    while True:
        path[length, 0], path[length, 1] = i, k
        length += 1
        by = step[i, k]
        if by == _START:
            break
        if by == _BOTH:
            i -= 1
            continue
        if by == _LEARNER:
            i, k = i - 1, k + 1
        else:
            k -= 1
        if slope:  # a step in which one of the two advances is always preceded by a step in which both do
            path[length, 0], path[length, 1] = i, k
            length += 1
            i -= 1
    return path[:length][::-1].copy()


class PathDistances(NamedTuple):
    """What each of the L pairs of frames of a path has in common; P parts of the body."""

    # (L, 3, P) sums of the weighted squared differences of a part's angles, radians^2: of the learner's frame to the teacher's
    # frame before the matched one, to the matched one, and to the one after. Missing angles are left out.
    squared: np.ndarray
    present: np.ndarray  # (L, P) number of the part's angles that could be compared
    taught: np.ndarray  # (L, P) 1 where the teacher's frame shows at least one of the part's angles, else 0
    # (L, P) least `Features.confidence` of the learner's angles of the part that the teacher shows; 0 where there are none
    confidence: np.ndarray
    seen: np.ndarray  # (L, P) in 0..1: 1 from SEEN_CONFIDENCE on, below it in proportion
    signed: np.ndarray  # (L, D) differences, learner minus teacher, -pi..pi, radians; NaN where missing
    weights: np.ndarray  # (L, D) product of both frames' weights; 0 where missing


@njit(cache=True)
def distances_on_path(path, learner, teacher, offset, parts):
    """The `PathDistances` of a (L, 2) path of `best_match`, of the window's (n, D) `Features` and the teacher's (M, D).

    The teacher's frame of row i and column k is offset + i + k. `parts` (D,) is the number of each angle's part, from 0 on
    without gaps.
    """
    pairs, angles, num_parts = len(path), len(parts), parts.max() + 1
    squared = np.zeros((pairs, 3, num_parts))
    present, taught = np.zeros((pairs, num_parts)), np.zeros((pairs, num_parts))
    confidence = np.full((pairs, num_parts), np.inf)
    signed, weights = np.full((pairs, angles), np.nan), np.zeros((pairs, angles))
    last = len(teacher.angles_rad) - 1
    for pair in range(pairs):
        i = path[pair, 0]
        middle = offset + i + path[pair, 1]
        for c in range(angles):
            p = parts[c]
            if math.isnan(teacher.angles_rad[middle, c]):
                continue
            taught[pair, p] = 1
            confidence[pair, p] = min(confidence[pair, p], learner.confidence[i, c])
            if math.isnan(learner.angles_rad[i, c]):
                continue
            present[pair, p] += 1
            for shift in range(3):
                # At the ends of the dance, and where the neighbour lacks the angle, the matched frame stands for it.
                j = min(max(middle + shift - 1, 0), last)
                if math.isnan(teacher.angles_rad[j, c]):
                    j = middle
                difference = learner.angles_rad[i, c] - teacher.angles_rad[j, c]
                difference -= 2 * math.pi * math.floor(difference / (2 * math.pi) + 0.5)
                weight = learner.weights[i, c] * teacher.weights[j, c]
                squared[pair, shift, p] += weight * difference * difference
                if shift == 1:
                    signed[pair, c], weights[pair, c] = difference, weight
        for p in range(num_parts):
            if confidence[pair, p] == np.inf:
                confidence[pair, p] = 0
    seen = np.minimum(confidence / SEEN_CONFIDENCE, 1.0)
    return PathDistances(squared, present, taught, confidence, seen, signed, weights)
