"""Figures of a film of joints that need no label: how well the joints agree with each other over time, and with the depth.

Labels of real depth have errors of their own, which are not known. What stands here is necessary, not sufficient: a pose that
never moves has the steadiest bones. It is therefore to be read beside the errors, and surface distance beside steadiness.
"""

import numpy as np

from kpopnet.camera import Camera
from kpopnet.evaluation.acceptance.figures import ENDS
from kpopnet.geometry.cones import body_segments, nearest_parts
from kpopnet.geometry.depth_grid import MIN_POINTS, build_depth_grid
from kpopnet.skeleton import NUM_JOINTS, bone_lengths
from kpopnet.tracker.body_estimate import BodyEstimate
from kpopnet.tracker.confidence import MAX_RESIDUAL_M

OTHERS = [joint for joint in range(NUM_JOINTS) if joint not in ENDS]

REST_S, REST_M = 0.4, 0.02
"""A joint rests in a span of this time if the means of its two halves lie within this distance."""

SPIKE_M_S2 = 150.0
"""15 g: of the true joints of 186 simulated films (tools/over_time_films.py) 0.01 % exceed it; a jump away and back does."""

FIGURES = {
    "bone_spread_cm": ("spread of a bone's length over time", "cm"),
    "jitter_core_mm": ("jitter at rest, trunk, head and inner joints", "mm"),
    "jitter_ends_mm": ("jitter at rest, hands and feet", "mm"),
    "spikes": ("accelerations above 15 g", "%"),
    "surface_cm": ("from the person's points to the posed body's surface", "cm"),
}
"""Name and unit: mean standard deviation; roots of mean squares about a straight movement; share; mean, each at most 12 cm."""

SQUARED = ("jitter_core_mm", "jitter_ends_mm")


def label_free(joints_m: np.ndarray, depth_m: np.ndarray, camera: Camera, fps: float) -> np.ndarray:
    """(5, 2) sum and count of each of FIGURES in a film: of squares for SQUARED.

    The (T, 15, 3) joints are in the camera frame, metres, NaN where missing; the (T, H, W) float32 depth is that of the person
    in metres, 0 elsewhere.
    """
    joints_m = joints_m.astype(np.float64)
    lengths_cm = 100 * bone_lengths(joints_m)
    spread_cm = np.array([one[np.isfinite(one)].std() for one in lengths_cm.T if np.isfinite(one).sum() > 1])
    jitter_mm2 = _jitter_mm2(joints_m, round(REST_S * fps))
    spikes = np.linalg.norm(np.diff(joints_m, 2, axis=0), axis=-1) * fps**2
    parts = (
        spread_cm,
        jitter_mm2[:, OTHERS],
        jitter_mm2[:, ENDS],
        np.where(np.isfinite(spikes), spikes > SPIKE_M_S2, np.nan),
        _surface_cm(joints_m, depth_m, camera),
    )
    return np.array([(np.nansum(part), np.isfinite(part).sum()) for part in parts])


def pooled(films: list[np.ndarray]) -> dict[str, float]:
    """FIGURES over several films, from what `label_free` says of each; NaN where there is nothing to measure."""
    total, count = np.sum(films, axis=0).T
    means = np.divide(total, count, out=np.full(len(FIGURES), np.nan), where=count > 0)
    return {name: float(np.sqrt(mean) if name in SQUARED else mean) for name, mean in zip(FIGURES, means, strict=True)}


def _jitter_mm2(joints_m: np.ndarray, frames: int) -> np.ndarray:
    """(N, 15) variance about a straight movement in each span, NaN where the joint does not rest in it."""
    half = max(frames // 2, 2)
    spans = [joints_m[start : start + 2 * half] for start in range(0, len(joints_m) - 2 * half + 1, half)]
    if not spans:
        return np.zeros((0, NUM_JOINTS))
    spans_m, times = np.stack(spans), np.arange(2 * half) - half + 0.5
    centred_m = spans_m - spans_m.mean(axis=1, keepdims=True)
    slope_m = np.einsum("t,ntjc->njc", times, centred_m) / (times**2).sum()
    left_m = centred_m - times[:, None, None] * slope_m[:, None]
    moved_m = np.linalg.norm(spans_m[:, half:].mean(axis=1) - spans_m[:, :half].mean(axis=1), axis=-1)
    # Mean and slope are two fitted values in each axis.
    variance_mm2 = 1e6 * (left_m**2).sum(axis=(1, 3)) / (2 * half - 2)
    return np.where(moved_m < REST_M, variance_mm2, np.nan)


def _surface_cm(joints_m: np.ndarray, depth_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(T,) mean distance of the person's points to the body that these joints pose, NaN where it is not known."""
    person, distance_cm = BodyEstimate(), np.full(len(joints_m), np.nan)
    for frame, pose_m in enumerate(joints_m):
        if not np.isfinite(pose_m).all():
            continue
        grid = build_depth_grid(depth_m[frame], camera)
        if len(grid.points_m) < MIN_POINTS or (body := person.update(pose_m, grid)) is None:
            continue
        _, apart_m, _ = nearest_parts(body_segments(pose_m, body), grid.points_m, 1)
        distance_cm[frame] = 100 * np.minimum(np.abs(apart_m), MAX_RESIDUAL_M).mean()
    return distance_cm
