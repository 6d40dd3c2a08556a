"""Why joints are missed: every joint that is not within 10 cm, by the first cause that fits.

The causes are tried in a fixed order, so a hidden joint that the estimator also takes for the other side's counts as hidden. A
cause shows what would help: several frames for what is hidden or momentary, sides and fronts told apart, better depth.
"""

import numpy as np

from kpopnet.evaluation.poses.metrics import WITHIN_M, PoseResults
from kpopnet.skeleton import MIRROR

NEIGHBOURS = 7
"""A miss is momentary if the joint is found within this many frames before and after: a quarter of a second at 30 a second."""

FILM_STEP_M = 0.1
"""In a film joints move less than this from frame to frame, in the median; stills differ by several times as much."""

ALONG_RAY = 0.8
"""Share of an error that lies along the viewing ray for the joint to count as found at the wrong depth."""


def missed_by_cause(results: PoseResults) -> dict[str, float | None]:
    """Fraction of all labelled joints that are missed, by cause; frames that the estimator was given do not count.

    Hidden is None where the set does not say which joints are: those missed there have another cause.
    """
    errors_m = results.errors_m()
    labelled = ~np.isnan(errors_m)
    missed = labelled & ~(errors_m < WITHIN_M)
    truth_m, estimate_m = results.truth_m.astype(np.float64), results.estimate_m.astype(np.float64)
    ray = truth_m / np.linalg.norm(truth_m, axis=-1, keepdims=True)
    along_m = np.abs(((estimate_m - truth_m) * ray).sum(axis=-1))
    other_side_m = np.linalg.norm(estimate_m - truth_m[:, MIRROR], axis=-1)
    says_what_is_hidden = bool((~results.visible & np.isfinite(results.truth_m).all(axis=-1)).any())
    causes = {
        "absent": np.isinf(errors_m),
        "hidden": ~results.visible & says_what_is_hidden,
        "other side": (np.arange(len(MIRROR)) != MIRROR) & (other_side_m < WITHIN_M),
        "momentary": _found_around(errors_m < WITHIN_M, results),
        "wrong depth": along_m > ALONG_RAY * errors_m,
        "elsewhere": np.ones_like(missed),
    }
    fractions, left = dict[str, float | None](), missed
    for name, fits in causes.items():
        fractions[name] = float((left & fits).sum() / max(labelled.sum(), 1))
        left = left & ~fits
    return fractions if says_what_is_hidden else fractions | {"hidden": None}


def _found_around(found: np.ndarray, results: PoseResults) -> np.ndarray:
    """(N, 15) whether a joint is found within NEIGHBOURS frames before and within NEIGHBOURS frames after, in films."""
    around = np.zeros_like(found)
    for name in results.sequence_names:
        rows = np.flatnonzero(results.sequence == name)
        steps_m = np.linalg.norm(np.diff(results.truth_m[rows], axis=0), axis=-1)
        if not np.isfinite(steps_m).any() or np.nanmedian(steps_m) > FILM_STEP_M:
            continue
        padded = np.pad(found[rows], ((NEIGHBOURS, NEIGHBOURS), (0, 0)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS, axis=0).any(axis=-1)
        around[rows] = windows[: len(rows)] & windows[NEIGHBOURS + 1 :]
    return around
