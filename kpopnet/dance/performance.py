"""An observed dance: joints over time and their confidence, and at other times.

Joints are resampled at given times, smoothed, and their short gaps closed, all by one robust local linear regression. At each
output time a straight line is fitted to every joint's samples, weighted by a Gaussian in time. It is then refitted with lower
weights for samples far from the first line (after LOWESS, Cleveland 1979). Frame rates may differ and frames may be missing. A
joint that jumps away for one or two frames hardly moves the line.
"""

import math
from collections.abc import Sequence
from numbers import Real

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS, Joint, bone_lengths

MAX_DURATION_S, MAX_TIME_S = 7200.0, 1e10
"""Longest dance, which bounds the memory of a comparison to a few hundred megabytes, and latest time on a clock: seconds since
1970 are less, milliseconds are not."""

ABSOLUTE_S = MAX_DURATION_S
"""Later times are of an absolute clock, as seconds since 1970 or since a machine was started, and not of a piece of music."""

MAX_COORDINATE = 1e6
"""A kilometre in millimetres: no dance is farther from the origin, in any unit."""

SMOOTHING_S = 0.08
"""Standard deviation of the Gaussian. Twice as much or half as much orders no more dances (docs/ledger.md, Dance score)."""

MAX_GAP_S = 0.25
"""Longer gaps in a joint's samples are not closed."""

KERNEL_RADIUS_S = max(3.0 * SMOOTHING_S, MAX_GAP_S)
"""Greatest distance in time of a sample with weight."""

OUTLIER_M = 0.15
"""A sample at this distance from the first line has half its weight in the second fit. The distance is far beyond noise and
beyond the deviation of a dance from a straight line."""

MAX_BONE_M = 5.0
"""No dancer's bones are longer, in the median; in centimetres they are 10 to 40, in millimetres hundreds."""

TRUNK = [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP]
DERIVED_M = 5e-4
"""A torso that is nowhere farther, along an axis, from the mean of the trunk's other joints was derived from them; files are
rounded to a tenth of a millimetre. Torsos of bodies are centimetres away."""

TIME_TOLERANCE_S = 1e-6
"""Allows for rounding of stored time stamps."""


class Performance:
    """A dance as joints over time.

    Attributes:
        joints_m: (T, 15, 3) float64 in the camera frame, NaN where a joint is missing.
        times_s: (T,) float64 seconds, strictly increasing, on the clock of the music: zero is the same instant of the music for
            the teacher and the learner. Those of an absolute clock: see `from_absolute_clocks`.
        confidence: (T, 15) float64 in 0..1; 0 where the joint is missing. A joint of a confidence below
            `kpopnet.dance.features.SEEN_CONFIDENCE` is partly unseen.
        estimator: name in `kpopnet.dance.noise.table.NOISE` of whose errors the joints have, none for true ones; with `SEEN` at
            its end, of that table, of a teacher as the estimator sees them.
    """

    def __init__(
        self, joints_m: ArrayLike, times_s: ArrayLike, confidence: ArrayLike | None = None, estimator: str = "none"
    ) -> None:
        """Checks and copies the arrays; see `mask_missing_joints`."""
        joints_m, times_s = poses(joints_m), numbers("times", times_s)
        if not isinstance(estimator, str):
            raise InputError(f"estimator={estimator!r:.80}: expected the name of one, or none")
        if not len(joints_m):
            raise InputError(f"joints of shape {joints_m.shape}: expected at least one frame")
        if times_s.shape != joints_m.shape[:1]:
            raise InputError(f"{len(joints_m)} frames with times of shape {times_s.shape}: expected one time a frame")
        valid = np.isfinite(times_s)
        valid[1:] &= ~(times_s[1:] <= times_s[:-1])
        if not valid.all():
            wrong = int(np.argmin(valid))
            raise InputError(f"frame {wrong} has time {times_s[wrong]}: times must be finite and increase from frame to frame")
        if times_s[-1] - times_s[0] > MAX_DURATION_S or np.abs(times_s[[0, -1]]).max() > MAX_TIME_S:
            raise InputError(
                f"times from {times_s[0]:g} to {times_s[-1]:g} s: expected a dance of at most {MAX_DURATION_S:g} s; "
                "are they seconds?"
            )
        self.times_s, self.estimator = times_s, estimator
        self.joints_m, self.confidence = mask_missing_joints(joints_m, confidence)
        lengths_m = bone_lengths(self.joints_m)
        known_m = lengths_m[np.isfinite(lengths_m)]
        if len(known_m) and (length_m := np.median(known_m)) > MAX_BONE_M:
            raise InputError(f"bones of {length_m:.3g} m in the median: expected metres; of millimetres give joints_m / 1000")

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def is_observed(self) -> bool:
        """Whether any joint of any frame is known, with a confidence above 0."""
        return bool(self.confidence.any())

    @property
    def torso_is_derived(self) -> bool:
        """Whether the torso is but the mean of shoulders and hips, as of files that name none: it shows no bend of the back."""
        off_m = np.abs(self.joints_m[:, Joint.TORSO] - self.joints_m[:, TRUNK].mean(axis=1))
        return bool(np.isfinite(off_m).any()) and not (off_m > DERIVED_M).any()

    @property
    def unseen_joints(self) -> list[Joint]:
        """The joints that are missing in every frame."""
        return [Joint(number) for number in np.flatnonzero(~self.confidence.any(axis=0))]


def as_performance(dance: Performance | np.ndarray, fps: float | None, whose: str) -> Performance:
    """A dance that may be given as (T, 15, 3) joints in metres in the camera frame, whose first frame is at time 0."""
    if isinstance(dance, Performance | str) or not hasattr(dance, "__len__"):
        return checked_dance(dance, f"the {whose}'s dance")
    if not isinstance(fps, Real) or not 0 < fps <= 1000:
        raise InputError(f"the {whose}'s dance is an array without times and fps={fps!r}; give its frames per second, fps=30")
    try:
        return check_rate(Performance(dance, np.arange(len(dance)) / fps))
    except InputError as error:
        raise InputError(f"the {whose}'s dance: {error}") from error


def checked_dance(dance: object, which: str) -> Performance:
    """The dance; raises InputError, for `which` one, as `check_rate`, and for anything but a performance."""
    performance = check_dance(dance, which)
    try:
        return check_rate(performance)
    except InputError as error:
        raise InputError(f"{which}: {error}") from error


def check_dance(dance: object, which: str) -> Performance:
    """The dance; raises InputError, for `which` one, for anything but a performance."""
    if not isinstance(dance, Performance):
        made = "Performance(joints_m, times_s) or read_performance(path)"
        raise InputError(f"{which}: expected a Performance, as {made} makes, got {type(dance).__name__}")
    return dance


def from_absolute_clocks(dances: Sequence[Performance]) -> list[Performance]:
    """The dances; times of an absolute clock, beyond ABSOLUTE_S, count from the dance's first frame.

    Those of a dance that was recorded together with the first one count from the first one's: they share its clock.
    """
    if not isinstance(dances, list | tuple):
        raise InputError(f"dances: expected a list of them, got {dances!r:.80}")
    for one in dances:
        check_dance(one, "a dance")
    found = []
    for one in dances:
        first = dances[0]
        together = one.times_s[0] < first.times_s[-1] and first.times_s[0] < one.times_s[-1]
        start_s = (first if together else one).times_s[0]
        times_s = one.times_s - (start_s if start_s > ABSOLUTE_S else 0.0)
        found.append(Performance(one.joints_m, times_s, one.confidence, one.estimator))
    return found


def with_derived_torso(joints_m: np.ndarray, confidence: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(..., 15, 3) joints with the mean of shoulders and hips as the torso, and their (..., 15) confidence."""
    joints_m, confidence = joints_m.copy(), confidence.copy()
    joints_m[..., Joint.TORSO, :] = joints_m[..., TRUNK, :].mean(axis=-2)
    confidence[..., Joint.TORSO] = confidence[..., TRUNK].min(axis=-1)
    return joints_m, confidence


def off_by(dance: Performance, errors_m: np.ndarray, estimator: str) -> Performance:
    """A dance whose joints are off by (T, 15, 3) errors of an estimator, metres; a torso that was derived is derived anew."""
    joints_m, confidence = dance.joints_m + errors_m, dance.confidence
    if dance.torso_is_derived:
        joints_m, confidence = with_derived_torso(joints_m, confidence)
    return Performance(joints_m, dance.times_s, confidence, estimator)


def check_rate(dance: Performance) -> Performance:
    """Raises InputError for a dance whose frames are farther apart than gaps may be: hardly a joint could be resampled."""
    interval_s = float(np.median(np.diff(dance.times_s))) if len(dance) > 1 else 0.0
    if interval_s > MAX_GAP_S + TIME_TOLERANCE_S:
        raise InputError(f"frames are {interval_s:.3g} s apart, in the median; expected at most {MAX_GAP_S:g} s")
    return dance


def without_gaps(joints_m: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
    """(T, 15, 3) joints; a missing one lies between its last and its next known position, by (T,) times `at` or else by the
    number of the frame; one never seen at the torso.
    """
    filled, at = joints_m.copy(), np.arange(len(joints_m)) if at is None else at
    known = np.isfinite(joints_m.sum(axis=2))
    for joint in np.flatnonzero(known.any(axis=0)):
        for axis in range(3):
            filled[:, joint, axis] = np.interp(at, at[known[:, joint]], joints_m[known[:, joint], joint, axis])
    filled[:, ~known.any(axis=0)] = np.nan_to_num(filled[:, [Joint.TORSO]])
    return filled


def numbers(what: str, given: ArrayLike) -> np.ndarray:
    """A float64 copy of an array. Raises InputError for what is none, and for a masked array, whose mask a copy would lose."""
    if isinstance(given, np.ma.MaskedArray):
        raise InputError(f"{what}: a masked array; give NaN where something is missing, as .filled(np.nan) does")
    try:
        return np.array(given, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what}: expected an array of numbers ({error})") from error


def poses(joints_m: ArrayLike) -> np.ndarray:
    """A (T, 15, 3) float64 copy of joints. Raises InputError for another shape, and as `numbers`."""
    copy_m = numbers("joints", joints_m)
    if copy_m.ndim != 3 or copy_m.shape[1:] != (NUM_JOINTS, 3):
        raise InputError(f"joints of shape {copy_m.shape}: expected (frames, {NUM_JOINTS}, 3)")
    return copy_m


def confidences(given: ArrayLike | None, shape: tuple[int, ...]) -> np.ndarray:
    """A float64 copy of confidences of a shape, 1 everywhere by default. Raises InputError for another, and outside 0..1."""
    values = np.ones(shape) if given is None else numbers("confidence", given)
    if values.shape != shape:
        raise InputError(f"confidence of shape {values.shape}: expected one number a joint, {shape}")
    if not ((values >= 0) & (values <= 1)).all():
        raise InputError(f"confidence from {values.min()} to {values.max()}: expected numbers from 0 to 1")
    return values


def mask_missing_joints(joints_m: np.ndarray, confidence: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    """(..., 15, 3) joints with missing ones NaN, and (..., 15) float64 confidence in 0..1 with missing ones 0.

    A joint with a coordinate that is not finite, or of confidence 0, is missing; None is a confidence of 1 everywhere. Raises
    InputError for other confidence, and for coordinates with which no sum would be finite.
    """
    values = confidences(confidence, joints_m.shape[:-1])
    missing = np.logical_not(np.isfinite(joints_m).all(axis=-1)) | (values == 0)
    if (largest := np.abs(joints_m[~missing]).max(initial=0)) > MAX_COORDINATE:
        raise InputError(f"a coordinate of {largest:g}: expected at most {MAX_COORDINATE:g} metres")
    return np.where(missing[..., None], np.nan, joints_m), np.where(missing, 0.0, values)


def resampled(
    joints_m: np.ndarray, confidence: np.ndarray, times_s: np.ndarray, at_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The (T, 15, 3) joints, NaN where missing, and their (T, 15) confidence at (G,) increasing times, all in seconds.

    Joints are NaN before a joint's first sample, after its last, and in gaps longer than MAX_GAP_S. Confidence is the mean
    weighted by the Gaussian, 0 where no sample lies within KERNEL_RADIUS_S.
    """
    arrays = (np.ascontiguousarray(one, np.float64) for one in (joints_m, confidence, times_s, at_s))
    return _resampled(*arrays)


@njit(cache=True)
def _resampled(joints, confidence, times, at):
    num_joints = joints.shape[1]
    joints_at, confidence_at = np.full((len(at), num_joints, 3), np.nan), np.zeros((len(at), num_joints))
    first = stop = 0  # samples within the kernel's radius
    for g in range(len(at)):
        while first < len(times) and times[first] < at[g] - KERNEL_RADIUS_S:
            first += 1
        stop = max(first, stop)
        while stop < len(times) and times[stop] <= at[g] + KERNEL_RADIUS_S:
            stop += 1
        offsets, weights, total = times[first:stop] - at[g], np.empty(stop - first), 0.0
        for i in range(stop - first):
            weights[i] = math.exp(-0.5 * (offsets[i] / SMOOTHING_S) ** 2)
            total += weights[i]
            for j in range(num_joints):  # element by element: numba compiles a copy of a row for a second
                confidence_at[g, j] += weights[i] * confidence[first + i, j]
        for j in range(num_joints):
            if total > 0:
                confidence_at[g, j] /= total
            before, after = np.inf, np.inf
            for i, offset in enumerate(offsets):
                if not math.isnan(joints[first + i, j, 0]):
                    if offset <= TIME_TOLERANCE_S:
                        before = min(before, abs(offset))
                    if offset >= -TIME_TOLERANCE_S:
                        after = min(after, abs(offset))
            if before + after <= MAX_GAP_S + TIME_TOLERANCE_S:
                _fit_line(joints[first:stop, j], offsets, weights, joints_at[g, j])
    return joints_at, confidence_at


@njit(cache=True)
def _fit_line(points, offsets, weights, value):
    """Writes the value at offset 0 of the robust regression line into `value`: (n, 3) points at (n,) offsets in seconds, with
    (n,) weights.
    """
    slope = np.zeros(3)
    for robust in range(2):
        s0, s1, s2 = 0.0, 0.0, 0.0
        sum_x, sum_xt = np.zeros(3), np.zeros(3)
        for i in range(len(points)):
            if math.isnan(points[i, 0]):
                continue
            weight = weights[i]
            if robust:
                squared_m2 = 0.0
                for c in range(3):
                    squared_m2 += (points[i, c] - value[c] - slope[c] * offsets[i]) ** 2
                weight /= 1 + squared_m2 / OUTLIER_M**2
            s0 += weight
            s1 += weight * offsets[i]
            s2 += weight * offsets[i] ** 2
            for c in range(3):
                sum_x[c] += weight * points[i, c]
                sum_xt[c] += weight * offsets[i] * points[i, c]
        determinant = s0 * s2 - s1 * s1
        for c in range(3):
            if determinant > 1e-9 * s0 * s0:
                slope[c] = (s0 * sum_xt[c] - s1 * sum_x[c]) / determinant
                value[c] = (s2 * sum_x[c] - s1 * sum_xt[c]) / determinant
            else:
                slope[c] = 0.0
                value[c] = sum_x[c] / s0
