"""What the frames of a matched window have in common, by kernels and by their plain twins, on anything that can be missing."""

import warnings

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.dance.dtw import PathDistances
from kpopnet.dance.parts import _least_of_parts, _similarities
from kpopnet.dance.window import PARTS, WINDOW_FRAMES, window_score

PART_OF_ANGLE = np.array([0, 0, 1, 2, 3, 4, 4, 5])


def random_pairs(rng):
    """A path through a window whose frames are matched once or twice, and `PathDistances` of it, much of them missing."""
    repeated = rng.integers(1, 3, WINDOW_FRAMES)
    rows = np.repeat(np.arange(WINDOW_FRAMES), repeated)
    path = np.stack([rows, 40 + np.repeat(np.cumsum(2 - repeated), repeated)], axis=1)
    pairs, parts, angles = len(path), len(PARTS), len(PART_OF_ANGLE)
    taught = (rng.random((pairs, parts)) < rng.choice([0, 0.7, 1], parts)).astype(float)
    seen = taught * np.minimum(rng.random((pairs, parts)) * rng.choice([0, 1, 2], parts), 1)
    signed = np.where(rng.random((pairs, angles)) < 0.2, np.nan, rng.normal(size=(pairs, angles)))
    weights = np.where(np.isnan(signed), 0.0, rng.random((pairs, angles)))
    squared = taught[:, None] * rng.exponential(0.2, (pairs, 3, parts))
    return path, PathDistances(squared, taught, taught, seen, seen, signed, weights)


def mean_of_known(values, axis=0):
    with warnings.catch_warnings(action="ignore"):  # nothing is known
        return np.nanmean(values, axis=axis)


def test_the_least_confidence_of_a_part_is_that_of_its_angles():
    confidence = np.random.default_rng(0).random((50, len(PART_OF_ANGLE)))
    twin = [confidence[:, part == PART_OF_ANGLE].min(axis=1) for part in range(len(PARTS))]
    np.testing.assert_array_equal(_least_of_parts(confidence, PART_OF_ANGLE), np.transpose(twin))


@settings(deadline=None)  # the first compiles
@given(st.integers(0, 2**32 - 1))
def test_similarities_and_errors_are_those_of_their_plain_twins(seed):
    rng = np.random.default_rng(seed)
    path, on_path = random_pairs(rng)
    left, turning, beta = rng.uniform(0.2, 1, len(PARTS)), rng.choice([0.0, 0.7], len(path)), 0.4

    def of_body(parts):
        return mean_of_known(parts, axis=1) * (1 - turning * (1 - np.nan_to_num(parts[:, PARTS.index("turning")])) / 2)

    at = np.linspace(-0.5, 0.5, 2001)  # the parabola through what was measured at -1, 0 and 1 frame, tried everywhere
    curves = np.array([np.ones_like(at), at, at**2]).T @ np.linalg.inv([[1, -1, 1], [1, 0, 0], [1, 1, 1]])
    places = curves @ on_path.squared.sum(axis=2).T
    curved = np.array([1, -2, 1]) @ on_path.squared.sum(axis=2).T > 1e-12
    best = np.where(curved, places.argmin(axis=0), 1000)
    squared = np.maximum((curves[best, :, None] * on_path.squared).sum(axis=1), 0)
    taught = on_path.taught > 0
    parts = np.where(taught, on_path.seen * np.exp(-squared / beta**2), np.nan)
    kept = np.where(taught, 1 - on_path.seen * (1 - left), np.nan)
    shown = np.where(taught.any(axis=1), (on_path.seen > 0).any(axis=1), np.nan)
    expected = mean_of_known(of_body(kept))
    parts = parts / mean_of_known(kept)
    twin = of_body(parts), shown, parts, at[best].mean(), expected
    found = _similarities(on_path, left, turning, beta)
    for one, other in zip(found, twin, strict=True):
        np.testing.assert_allclose(one, other, atol=2e-3)  # the twin tries steps of a two thousandth

    body, shown, parts, _, expected = found
    score = window_score(np.column_stack([body, shown, parts]), on_path, path, PART_OF_ANGLE, 15, 0.1, 90.0, expected)
    frames = [np.flatnonzero(path.sum(axis=1) == frame) for frame in np.unique(path.sum(axis=1))]
    known = [mean_of_known(parts[rows]) for rows in frames]
    np.testing.assert_allclose(score.parts, 100 * mean_of_known(known), atol=1e-9)
    is_compared = mean_of_known([mean_of_known(shown[rows]) for rows in frames])
    if is_compared >= 0.5:
        assert score.timing == 90
        posture = mean_of_known([mean_of_known(body[rows]) for rows in frames])
        np.testing.assert_allclose(score.posture, 100 * posture, atol=1e-9)
    else:
        assert np.isnan(score.timing) and (score.posture == 0 or np.isnan(is_compared))
    middle = abs(path[:, 0] - (WINDOW_FRAMES - 1) / 2) <= 7.5
    weights = (on_path.weights * on_path.seen[:, PART_OF_ANGLE])[middle]
    errors = np.nansum(weights * on_path.signed[middle], axis=0)
    np.testing.assert_allclose(score.error_weight, weights.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(score.error_rad * weights.sum(axis=0), np.where(weights.any(axis=0), errors, np.nan), atol=1e-9)
