"""Dynamic time warping of a learner's window into a teacher's dance (section 3.2).

Both are features at the same even frames of one clock. Learner's frame i is expected to be the teacher's frame of the same
time; it is compared with those up to `band` frames before and after. So distances are kept as (frames, 2 * band + 1): column
k of row i belongs to the teacher's frame i + k - band. A row is made once, when its frame comes, and serves every window
that the frame is in: the online form is the offline form with one new row a frame.

The match is open at both ends: it may begin and end anywhere in the band, as the text has it ("finds the corresponding
teacher's dance sequence"). It begins where the path traced back from its best end begins. Dances repeat themselves and stand
still, and a window alone often fits in several places; which is meant is told by the delay at which a longer stretch fits
(`steady_delay`), towards which `best_match` is pulled. Two sets of steps are offered:

- `slope`: the learner is at most twice as fast or as slow as the teacher (slope constraint P = 1 of Sakoe and Chiba 1978),
  and each of the learner's frames counts once whatever the match's length, so that a long match does not cost more than a
  short one.
- `free`: the paper's three steps, each cell counted fully. A learner who stands still may then match a single frame.

Algorithm 3 as printed is `algorithm_3`.
"""

import math

import numpy as np
from numba import njit

from kpopnet.dance.features import Features

STEPS = ("slope", "free")

_ANY_ORDER = {"reassoc", "nsz"}
"""Lets a sum's terms be added side by side: `frame_distance` is five times as fast in functions compiled so."""

_START, _BOTH, _LEARNER, _TEACHER = 0, 1, 2, 3


def banded_distances(learner: Features, teacher: Features, first: int, band: int, outlier_rad: float) -> np.ndarray:
    """Distances of each of a learner's frames to the teacher's around the same time.

    Args:
        learner: (T, D) features; row 0 belongs to the teacher's frame `first`.
        teacher: (M, D) features.
        first: may be negative or beyond the teacher's end.
        band: frames.
        outlier_rad: see `frame_distance`.

    Returns:
        (T, 2 * band + 1) float64: what `frame_distance` gives, infinite where the teacher has no such frame. Where too little
        is known of either, the greatest distance possible, which attracts no path and is the same for the learner's whole row.
    """
    return _banded_distances(learner, teacher, first, band, outlier_rad)


@njit(cache=True, fastmath=_ANY_ORDER)
def _banded_distances(learner, teacher, first, band, outlier):
    frames, angles = learner.angles_rad.shape
    taught = len(teacher.angles_rad)
    everything = np.ones(angles)
    # That of angles that all are half a turn apart.
    greatest = math.sqrt(angles) * math.pi
    if outlier < np.inf:
        greatest = math.sqrt(angles * math.log1p((math.pi / outlier) ** 2)) * outlier
    distances = np.full((frames, 2 * band + 1), np.inf)
    for i in range(frames):
        for k in range(max(band - first - i, 0), min(taught + band - first - i, 2 * band + 1)):
            distance = frame_distance(learner, i, teacher, first + i + k - band, everything, outlier)
            distances[i, k] = greatest if math.isnan(distance) else distance
    return distances


@njit(cache=True, inline="always")
def frame_distance(learner, i, teacher, j, columns, outlier):
    """The norm of Eq. (14) between a learner's frame i and a teacher's j, over the columns that have a 1 and not a 0; radians.

    Differences are wrapped to -pi..pi, and their squares weighted by both frames' weights. Squares far beyond that of
    `outlier` count by their logarithm (Cauchy's function): a limb that is lost, or in quite another move, shall not outweigh
    all others. With an infinite one it is the plain norm. Missing angles are taken to differ as much as the others do on
    average, unsure ones in part, and columns that are left out likewise, so that the norms of parts and of the whole compare.
    NaN if more than half of the angles are missing, or nobody is sure of them at all.
    """
    total, product, known, there_are, asked = 0.0, 1.0, 0.0, 0.0, 0.0
    inverse = 1 / (outlier * outlier)
    for c in range(len(columns)):
        difference = abs(learner.angles_rad[i, c] - teacher.angles_rad[j, c])
        difference = min(difference, abs(difference - 2 * math.pi))
        there = difference == difference  # not NaN
        sure = columns[c] * learner.sure[i, c] * teacher.sure[j, c]
        squared = sure * learner.weights[i, c] * teacher.weights[j, c] * difference * difference if there else 0.0
        total += squared
        product *= 1 + squared * inverse  # the sum of logarithms is the logarithm of this
        known += sure if there else 0.0
        there_are += columns[c] if there and sure > 0 else 0.0
        asked += columns[c]
    if known == 0 or 2 * there_are < asked:
        return np.nan
    if outlier < np.inf:
        total = outlier * outlier * math.log(product)
    return math.sqrt(total * len(columns) / known)


@njit(cache=True)
def steady_delay(distances, pull):
    """The column at which a stretch of frames matches best if the delay stays the same throughout.

    Args:
        distances: (n, 2 * band + 1) as of `banded_distances`; infinite ones do not count.
        pull: radians that every frame away from the expected time costs: decides where nothing else does.
    """
    n, columns = distances.shape
    band = columns // 2
    best, least = band, np.inf
    for k in range(columns):
        total, count = 0.0, 0
        for i in range(n):
            if distances[i, k] < np.inf:
                total += distances[i, k]
                count += 1
        if 2 * count >= n:
            mean = total / count + pull * abs(k - band)
            if mean < least:
                best, least = k, mean
    return best


@njit(cache=True)
def best_match(distances, slope, pull, expected):
    """Open-begin, open-end matching of a window.

    Args:
        distances: (n, 2 * band + 1) as of `banded_distances`, n >= 1.
        slope: True for the steps `slope`, False for `free`.
        pull: radians that begin and end each cost for every frame that they lie away from where they are expected, times
            n / 2: among matches that are as good the nearest is taken. 0 is none.
        expected: the column where they are expected.

    Returns:
        (L, 2) int64 path from begin to end: rows and columns of `distances`. Empty if the teacher has nothing there.
    """
    n, columns = distances.shape
    away = pull * n / 2 * np.abs(np.arange(columns) - expected)
    cost, step = _arrivals(distances, slope, away)
    end = np.argmin(cost[n - 1] + away)
    return _path_to(end, step, slope) if cost[n - 1, end] < np.inf else np.empty((0, 2), np.int64)


@njit(cache=True)
def _arrivals(distances, slope, away):
    """The least cost of a match up to each cell, where beginning costs `away`, and the step by which it gets there."""
    n, columns = distances.shape
    cost = np.full((n, columns), np.inf)
    step = np.zeros((n, columns), np.int8)
    cost[0] = distances[0] + away
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
def _path_to(end, step, slope):
    """(L, 2) the way to the last row's column `end`, from its beginning."""
    n, columns = step.shape
    path = np.empty((2 * (n + columns), 2), np.int64)
    i, k, length = n - 1, end, 0
    while True:
        path[length] = i, k
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
        if slope:  # a step of one is always followed by one of both
            path[length] = i, k
            length += 1
            i -= 1
    return path[:length][::-1].copy()


@njit(cache=True, fastmath=_ANY_ORDER)
def posture_on_path(path, learner, teacher, first, band, parts, outlier, beta):
    """Eq. (14) along a path, for some parts of the body.

    Args:
        path: (L, 2) as of `best_match`.
        learner: (n, D) features of the window.
        teacher: (M, D) features of the teacher's dance.
        first: the teacher's frame that belongs to the window's first.
        band: frames.
        parts: (P, D) 1 for the columns of each part, 0 for others.
        outlier: see `frame_distance`.
        beta: radians.

    Returns:
        (P,) posture similarity in 0..1 and (P,) share of the matched teacher's frames that could be compared. The learner's
        frames matched to one of the teacher's share its place in the mean. NaN where nothing could be compared.
    """
    num_parts = len(parts)
    posture, compared = np.zeros(num_parts), np.zeros(num_parts)
    begin, end = path[0].sum(), path[-1].sum()  # i + k, the teacher's frame but for a constant
    for p in range(num_parts):
        at = 0
        for frame in range(begin, end + 1):
            similarity, pairs = 0.0, 0
            while at < len(path) and path[at, 0] + path[at, 1] == frame:
                i = path[at, 0]
                j = first + frame - band
                distance = frame_distance(learner, i, teacher, j, parts[p], outlier)
                if not math.isnan(distance):
                    similarity += math.exp(-distance / beta)
                    pairs += 1
                at += 1
            if pairs:
                posture[p] += similarity / pairs
                compared[p] += 1
        posture[p] = posture[p] / compared[p] if compared[p] else np.nan
        compared[p] /= end - begin + 1
    return posture, compared


def algorithm_3(
    learner: Features, teacher: Features, alpha: float, beta: float, tau_frames: float, outlier_rad: float = math.inf
) -> tuple[float, float, float]:
    """Algorithm 3 as it is printed: S_t, S_p and T_t of n of a learner's frames and m of the teacher's.

    What is wrong with it: DTW[0, j] is infinite but for j = 0, so the path starts at the teacher's first frame and
    argmin_j DTW[1, j] is always 1, against the text that looks for a subsequence. DTW[n + 1, j] does not exist; DTW[n, j]
    is read. T_t is half a length, not the middle time of Eq. (13): who dances at the right speed but late is on time. S_p is
    the exponential of a mean, Eq. (14) the mean of exponentials, and divides by half the length.
    """
    n, m = len(learner.angles_rad), len(teacher.angles_rad)
    distances = np.full((n + 1, m + 1), np.inf)
    whole = banded_distances(learner, teacher, 0, max(n, m), outlier_rad)
    for i in range(1, n + 1):
        distances[i, 1:] = whole[i - 1, max(n, m) - i + 1 : max(n, m) - i + 1 + m]
    warped = _printed_dtw(distances)
    start = int(np.argmin(warped[1, 1:])) + 1
    end = int(np.argmin(warped[n, 1:])) + 1
    half_length = (end - start + 1) / 2
    timing = 1 - min(1.0, math.exp((abs(half_length - n / 2) - tau_frames) / (alpha * tau_frames)))
    return timing, math.exp(-warped[n, end] / (beta * half_length)), half_length


@njit(cache=True)
def _printed_dtw(distances):
    n, m = distances.shape[0] - 1, distances.shape[1] - 1
    warped = np.full((n + 1, m + 1), np.inf)
    warped[0, 0] = 0
    for i in range(1, n + 1):
        for j in range(1, m + 1):
            warped[i, j] = distances[i, j] + min(warped[i - 1, j], warped[i, j - 1], warped[i - 1, j - 1])
    return warped
