"""Confidence of joints that were fitted to the depth: the probability that a joint is within 10 cm of the truth.

A logistic regression of how well the body explains the points around the joint and on the whole person. A tracker that lost
its person fits badly everywhere, which the points around one joint may not show. tools/fit_confidence.py fitted the weights to
simulated people whom no benchmark shows. On simulated depth they give probabilities; where a data set defines a joint elsewhere
than the simulated people do, the confidence cannot know it.
"""

import numpy as np

from kpopnet.geometry.body import PARTS, ROW_TO_JOINT, Body
from kpopnet.geometry.cones import body_segments, nearest_parts
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.skeleton import NUM_JOINTS

TRACKED_WEIGHTS, REFINED_WEIGHTS = (-4.976, 3.095, 5.509), (1.564, 0.726, 1.984, -0.319)
"""Weights of `tracked_evidence` and of `refined_evidence`."""

FULL_SUPPORT_POINTS = 4
"""From this number of points on the parts that end at a joint, the number no longer limits its score."""

HALF_SCORE_M, MAX_RESIDUAL_M = 0.06, 0.12
"""The mean residual that halves the score, and the largest residual; larger ones count as this, metres."""

LEAST_PROBABILITY = 1e-4
"""Limits the logit of a given confidence."""


def probability(evidence: np.ndarray, weights: tuple[float, ...]) -> np.ndarray:
    """(...,) probability of being within 10 cm of the truth, from (..., K) evidence and its K weights."""
    return 1 / (1 + np.exp(-(evidence @ np.asarray(weights))))


def tracked_evidence(score: np.ndarray) -> np.ndarray:
    """(15, 3) evidence of a tracked pose with (15,) `fit_score`: 1, the joint's score, the mean score of all joints."""
    return np.stack([np.ones_like(score), score, np.full_like(score, score.mean())], axis=-1)


def refined_evidence(detected: np.ndarray, score: np.ndarray, moved_m: np.ndarray) -> np.ndarray:
    """(15, 4) evidence of a detected pose that was refined by fitting the body: 1, the logit of the detector's (15,)
    confidence, the (15,) `fit_score` of the refined pose, the (15,) distances between refined and detected joints, centimetres.
    """
    chance = np.clip(detected, LEAST_PROBABILITY, 1 - LEAST_PROBABILITY).astype(np.float64)
    return np.stack([np.ones_like(score), np.log(chance / (1 - chance)), score, 100 * moved_m], axis=-1)


def fit_score(joints_m: np.ndarray, grid: DepthGrid, body: Body) -> np.ndarray:
    """(15,) in 0..1: how well the points around each joint lie on the body's surface; 0 without any points.

    Each point counts for the nearer end of its part.
    """
    part, off_m, along = nearest_parts(body_segments(joints_m, body), grid.points_m, 1)
    joint = ROW_TO_JOINT[PARTS[part, (along >= 0.5).astype(int)]]
    points = np.bincount(joint, minlength=NUM_JOINTS)
    off_m = np.minimum(np.abs(off_m.astype(np.float64)), MAX_RESIDUAL_M)
    residual_m = np.bincount(joint, off_m, NUM_JOINTS) / np.maximum(points, 1)
    return np.minimum(points / FULL_SUPPORT_POINTS, 1) / (1 + (residual_m / HALF_SCORE_M) ** 2)
