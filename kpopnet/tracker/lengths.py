"""The lengths and thickness of a tracked person, estimated over the frames so far.

Beyond the paper, which measures the lengths once, in the Y pose. A start from any other pose knows them badly, and a wrong
length displaces joints in every frame. Here the body is fitted to a frame a second time with weak lengths. It gives way by a
part of their error, which tells the error. The estimate combines the medians of what the last frames show with a prior of
people: the segments of one person are long or short together.
"""

from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.geometry.body import LIMBS, Body, body_from_model
from kpopnet.geometry.cones import torso_frame
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import MIRROR, Joint
from kpopnet.tracker.fit.confidence import fit_score
from kpopnet.tracker.fit.solver import fit
from kpopnet.tracker.fit.thickness import fit_thickness


class Segment(NamedTuple):
    """A part of the body whose length is estimated, the same on both sides.

    Attributes:
        fields: the lengths of `HumanModel` that scale with it.
        pairs: the pairs of joints between which it is measured; their mirror images are measured too.
        deviation: standard deviation of its length among people of one size, as a fraction.
        gain: how much of an error of the assumed length the fit with weak lengths shows, as a fraction.
        offset: what it shows without an error, as a fraction.
        noise: standard deviation of the median of what it shows over a sequence, as a fraction.
    """

    fields: tuple[str, ...]
    pairs: tuple[tuple[Joint, Joint], ...]
    deviation: float
    gain: float
    offset: float
    noise: float


_TRUNK_FIELDS = (
    *("head_to_torso_m", "left_shoulder_to_torso_m", "right_shoulder_to_torso_m", "torso_to_hip_line_m"),
    *("left_shoulder_to_left_hip_m", "left_shoulder_to_right_hip_m"),
    *("right_shoulder_to_left_hip_m", "right_shoulder_to_right_hip_m"),
)
SEGMENTS = (
    Segment(("head_to_shoulder_line_m",), ((Joint.NECK, Joint.HEAD),), 0.06, 0.87, 0.038, 0.070),
    Segment(("shoulder_to_shoulder_m",), ((Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER),), 0.07, 0.28, 0.003, 0.025),
    Segment(_TRUNK_FIELDS, ((Joint.NECK, Joint.TORSO), (Joint.TORSO, Joint.RIGHT_HIP)), 0.04, 0.37, -0.018, 0.026),
    Segment(("right_upper_arm_m", "left_upper_arm_m"), ((Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW),), 0.07, 0.16, 0.005, 0.015),
    Segment(("right_lower_arm_m", "left_lower_arm_m"), ((Joint.RIGHT_ELBOW, Joint.RIGHT_HAND),), 0.06, 0.18, 0.001, 0.013),
    Segment(("right_upper_leg_m", "left_upper_leg_m"), ((Joint.RIGHT_HIP, Joint.RIGHT_KNEE),), 0.08, 0.21, -0.003, 0.014),
    Segment(("right_lower_leg_m", "left_lower_leg_m"), ((Joint.RIGHT_KNEE, Joint.RIGHT_FOOT),), 0.05, 0.54, 0.023, 0.029),
)
"""Deviations of 252 simulated adults (split train), whose sizes differ by `SIZE_DEVIATION`; the rest of 16 simulated films of
people whom no benchmark shows, on cells of 4 pixels, with wrong lengths drawn from these deviations (docs/ledger.md)."""

SIZE_DEVIATION = 0.072

_GAIN, _OFFSET, _NOISE = np.array([(segment.gain, segment.offset, segment.noise) for segment in SEGMENTS]).T

FREE_STIFFNESS, FREE_ITERATIONS = 0.003, 3
"""Factor of the weight of lengths in the fit that measures them, and its iterations."""

MAX_ERROR = 0.25
"""Limit of the logarithm of an error that one frame shows."""

FEW_FRAMES = 3
"""The variance of a median of n frames is that of a sequence times 1 + `FEW_FRAMES` / n: frames resemble one another."""

MEASURED_EVERY, REMEMBERED = 2, 50
"""Every second frame is measured; the estimate rests on the last 50 measured frames."""

ESTIMATED_EVERY, THICKNESS_EVERY = 5, 3
"""Measured frames from one estimate of the lengths, or of the thickness, to the next."""

MAX_ALONG_RAY = 0.7
"""A segment is measured where the cosine between it and the line of sight is smaller: of one that points at the camera, one end
is hidden."""

BEGINNING = 3
"""Times that the frame of the start is measured, each time with the lengths found before."""

MIN_SCORE = 0.5
"""A segment is measured where the `fit_score` of both its joints is at least this."""


class RunningLengths:
    """Estimates the lengths of one person; a frame's estimate depends on it and on those before it.

    Attributes:
        model: the lengths estimated so far.
        body: the body with these lengths and the thickness estimated so far.
    """

    def __init__(self, model: HumanModel, size_deviation: float | None) -> None:
        """Starts from lengths that are only approximately known.

        Args:
            model: the lengths expected before any frame.
            size_deviation: standard deviation of the error of their common scale, as a fraction; None where the lengths are
                known, and only the thickness is estimated.
        """
        self.model, self._expected = model, model
        self.body = self._bare = body_from_model(model)
        self._prior_information = None if size_deviation is None else _information(size_deviation)
        self._pairs, self._segment = _measured_pairs(self.body)
        self._scale = np.zeros(len(SEGMENTS))  # logarithms, relative to the expected lengths
        self._measured: deque[np.ndarray] = deque(maxlen=REMEMBERED)
        self._corrections_m: deque[np.ndarray] = deque(maxlen=REMEMBERED // THICKNESS_EVERY)
        self._frames = self._measurements = 0

    def update(self, joints_m: np.ndarray, grid: DepthGrid, stride: int) -> None:
        """Measures a frame, unless it is one of those that are passed over.

        Args:
            joints_m: (15, 3) the fitted pose in metres.
            grid: the depth image.
            stride: only every `stride`th point is used.
        """
        self._frames += 1
        if self._frames % MEASURED_EVERY == 0:
            self.measure(joints_m, grid, stride)

    def begin(self, joints_m: np.ndarray, grid: DepthGrid, stride: int) -> None:
        """Measures the frame of the start; arguments as in `update`."""
        for _ in range(BEGINNING):
            self._measured.clear()
            self.measure(joints_m, grid, stride)
            self.estimate()

    def measure(self, joints_m: np.ndarray, grid: DepthGrid, stride: int) -> None:
        """Measures a frame, and estimates anew where it is time to; arguments as in `update`."""
        if self._prior_information is not None:
            self._measured.append(self._scale + self._measured_scale(joints_m, grid, stride))
        if self._measurements % THICKNESS_EVERY == 0:
            self._corrections_m.append(fit_thickness(self._bare, joints_m, grid).radii_m - self._bare.radii_m)
        self._measurements += 1
        if self._measurements % ESTIMATED_EVERY == 0:
            self.estimate()

    def _measured_scale(self, joints_m: np.ndarray, grid: DepthGrid, stride: int) -> np.ndarray:
        """(7,) logarithm of each segment's length over the body's, as a fit with weak lengths shows it; NaN if none does."""
        free = self.body._replace(stiffness=self.body.stiffness * FREE_STIFFNESS)
        free_m = fit(joints_m, grid, free, FREE_ITERATIONS, stride)
        supported = fit_score(free_m, grid, self.body) >= MIN_SCORE
        ratios = _log_ratios(free_m, self.body, self._pairs)
        used = supported[self.body.pairs[self._pairs]].all(axis=1) & np.isfinite(ratios)
        shown = np.array([_mean(ratios[used & (self._segment == k)]) for k in range(len(SEGMENTS))])
        return np.clip((shown - _OFFSET) / _GAIN, -MAX_ERROR, MAX_ERROR)

    def estimate(self) -> None:
        """Estimates lengths and thickness from the frames remembered."""
        if self._prior_information is not None:
            self._estimate_lengths()
        self._bare = body_from_model(self.model)
        radii_m = self._bare.radii_m + np.median(self._corrections_m, axis=0)
        self.body = self._bare._replace(radii_m=np.maximum(radii_m, self._bare.radii_m / 2))

    def _estimate_lengths(self) -> None:
        """The mean of the posterior of a Gaussian prior and the medians of the measured frames."""
        measured = np.array(self._measured)
        known = np.isfinite(measured)
        count = known.sum(axis=0)
        medians = np.zeros(len(SEGMENTS))
        medians[count > 0] = np.nanmedian(measured[:, count > 0], axis=0)
        information = np.where(count > 0, (_GAIN / _NOISE) ** 2 / (1 + FEW_FRAMES / np.maximum(count, 1)), 0.0)
        self._scale = np.linalg.solve(self._prior_information + np.diag(information), information * medians)
        lengths_m = {
            name: getattr(self._expected, name) * np.exp(scale)
            for segment, scale in zip(SEGMENTS, self._scale.tolist(), strict=True)
            for name in segment.fields
        }
        self.model = replace(self._expected, **lengths_m)


def _information(size_deviation: float) -> np.ndarray:
    """(7, 7) inverse covariance of the logarithms of the lengths."""
    return np.linalg.inv(size_deviation**2 + np.diag([segment.deviation**2 for segment in SEGMENTS]))


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else np.nan


def _measured_pairs(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """(M,) the rows of `body.pairs` that are measured, and (M,) the segment of each."""
    segment_of = {}
    for number, segment in enumerate(SEGMENTS):
        for pair in segment.pairs:
            for ends in (pair, MIRROR[list(pair)]):
                segment_of[tuple(sorted(int(end) for end in ends))] = number
    rows = [row for row, pair in enumerate(body.pairs.tolist()) if tuple(pair) in segment_of]
    return np.array(rows), np.array([segment_of[tuple(body.pairs[row].tolist())] for row in rows])


@njit(cache=True)
def _log_ratios(joints, body, rows):
    """(M,) logarithm of the distance between the joints of each of these pairs over the body's, in this elevation of the arms.

    NaN where the joints lie behind one another.
    """
    up = -torso_frame(joints)[1]
    cosine = np.zeros(2)
    for arm in range(2):
        offset = joints[LIMBS[arm, 1]] - joints[LIMBS[arm, 0]]
        cosine[arm] = (offset * up).sum() / (np.sqrt((offset * offset).sum()) + 1e-9)
    ratios = np.empty(len(rows))
    for m in range(len(rows)):
        row = rows[m]
        offset = joints[body.pairs[row, 1]] - joints[body.pairs[row, 0]]
        expected = body.lengths_m[row]
        if body.elevating_arm[row] >= 0:
            c = cosine[body.elevating_arm[row]]
            expected += body.elevation_gain_m[row, 0] * c + body.elevation_gain_m[row, 1] * c * c
        length = np.sqrt((offset * offset).sum()) + 1e-9
        ray = joints[body.pairs[row, 0]] + offset / 2
        along = abs((offset * ray).sum()) / (length * np.sqrt((ray * ray).sum()) + 1e-9)
        ratios[m] = np.log(length / max(expected, 1e-3)) if along < MAX_ALONG_RAY else np.nan
    return ratios
