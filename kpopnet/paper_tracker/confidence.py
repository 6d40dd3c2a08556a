"""Confidence of joints of Algorithm 2: the probability that a joint is within 10 cm of the truth.

A logistic regression of whether the joint has valid candidates in this frame, and of how many of the fourteen have. Its weights
were fitted to the repaired tracker on simulated people whom no benchmark shows (tools/fit_confidence.py).
Algorithm 2 has no measure of fit: a joint with candidates may lie on another limb, and the confidence cannot know it.
"""

import numpy as np
from scipy.special import expit

from kpopnet.skeleton import PAPER_JOINTS

WEIGHTS = (-6.460, 1.765, 5.822)
"""Weights of `evidence_of`. The calibration error there is 4.9 %, and 5.0 % of the tracker as printed."""


def evidence_of(support: np.ndarray) -> np.ndarray:
    """(15, 3) from (15,) numbers of valid candidates: 1, whether the joint has any, the share of the fourteen that have."""
    found = (support > 0).astype(np.float64)
    return np.stack([np.ones_like(found), found, np.full_like(found, found[list(PAPER_JOINTS)].mean())], axis=-1)


def probability(evidence: np.ndarray) -> np.ndarray:
    """(...,) probability of being within 10 cm of the truth, from (..., 3) evidence."""
    return expit(evidence @ np.array(WEIGHTS))
