"""What a learner does differently throughout a window (constant error, in the words of motor skills), told apart from an
estimator's errors.

An estimator's errors change from pose to pose, often within a window; an arm that is held too low stays low. So the mean of the
differences between learner and teacher over the window shows a fault that single frames do not show.
Directions are averaged, not angles: those of a limb's two segments about the torso (`kpopnet.dance.features`), as unit vectors,
which have no jump and no pole; and the torso's three angles. Movements that are too small are a steady difference too: the mean
of unit vectors is the longer the less they move.

How long this mean is for perfect dancing, by segment and confidence, was learnt on simulated dances (`noise.json`,
`tools/measure_noise.py`). What exceeds it is the learner's.
"""

import numpy as np

from kpopnet.dance.features import FEATURES, LIMB_ANGLES, TORSO_ANGLES
from kpopnet.dance.window import PARTS, part_of_angles

FEATURE = "dance22_turn"
MOST_EXPECTED_RAD = 0.14
"""A segment of which perfect dancing would show a larger mean difference, root mean square, is not judged (docs/ledger.md)."""

LEAST_SHARE = 0.5
"""Nor is one that is known in a smaller share of the frames."""

_NAMES = FEATURES[FEATURE].names
INCLINATION = np.array([_NAMES.index(name) for name in LIMB_ANGLES if name.endswith("inclination")])
AZIMUTH = INCLINATION + 1
"""(S - 1,) columns of the angles of each limb's segment."""

_TORSO = [_NAMES.index(name) for name in TORSO_ANGLES]

SEGMENTS = (*(_NAMES[number].rpartition("_")[0] for number in INCLINATION), "torso")
"""Names of the S segments: right_elbow is the right upper arm, right_hand the right forearm, and so on."""

PART_OF_SEGMENT = np.array([*part_of_angles(FEATURE)[INCLINATION], PARTS.index("torso")])
"""(S,) number in `PARTS` of each segment's part."""


def segment_vectors(angles_rad: np.ndarray) -> np.ndarray:
    """(T, S, 3) unit directions of the limbs' segments, and the torso's angles in radians, of (T, D) angles."""
    inclination, azimuth = angles_rad[:, INCLINATION], angles_rad[:, AZIMUTH]
    sine = np.sin(inclination)
    limbs = np.stack([np.cos(inclination), sine * np.cos(azimuth), sine * np.sin(azimuth)], axis=2)
    return np.concatenate([limbs, angles_rad[:, None, _TORSO]], axis=1)


def steady_squared(difference: np.ndarray) -> np.ndarray:
    """(S,) squared length, radians^2, of the mean of (T, S, 3) differences by segment; NaN where it is not to be judged."""
    known = np.isfinite(difference.sum(axis=2))
    count = known.sum(axis=0)
    mean = np.where(known[..., None], difference, 0.0).sum(axis=0) / np.maximum(count, 1)[:, None]
    return np.where(count >= max(LEAST_SHARE * len(known), 1), (mean**2).sum(axis=1), np.nan)


def steady_similarity(squared: np.ndarray, expected: np.ndarray, beta: float) -> np.ndarray:
    """(P,) similarity in 0..1 that steady differences leave to each part, at most.

    From `steady_squared` and the (S,) mean squares of perfect dancing, radians^2, and the scorer's `beta`, radians.
    """
    judged = np.isfinite(squared) & (expected <= MOST_EXPECTED_RAD**2)
    excess = np.where(judged, np.maximum(np.nan_to_num(squared) - expected, 0.0), 0.0)
    return np.exp(-np.bincount(PART_OF_SEGMENT, excess, len(PARTS)) / beta**2)
