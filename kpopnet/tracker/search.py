"""The stages for a pose that fits badly: a detector is queried, and the pose is rotated, bent and mirrored."""

from dataclasses import dataclass

import numpy as np

from kpopnet.geometry.cones import torso_frame
from kpopnet.skeleton import MIRROR
from kpopnet.tracker.fit.objective import pose_cost
from kpopnet.tracker.fit.refine import DETECTION_PRIOR_WEIGHT
from kpopnet.tracker.fit.rotations import rotate_about_shoulders, rotate_about_spine
from kpopnet.tracker.fit.solver import fit
from kpopnet.tracker.fitting import Fitted, Fitting
from kpopnet.tracker.prediction import State

_FLIP_ITERATIONS = 6

SMALL_TURNS_RAD = np.radians((-30, 30, -60, 60))
LARGE_TURNS_RAD, BOWS_RAD = np.radians((-90, 90, 135, -135, 180)), np.radians((-40, 40))
"""Rotations about the torso's long axis, and about the shoulder line."""


@dataclass(frozen=True)
class DoubtConfig:
    """Settings of when a pose is doubted, from the baseline: what good poses of this person cost.

    Attributes:
        baseline_m2: the baseline at the start, square metres.
        baseline_rate: weight of a frame in its exponential moving average, to which frames below `search_ratio` contribute.
        detector_ratio: a detector is queried above this many times the baseline.
        search_ratio: other poses are tried above this many times the baseline.
    """

    baseline_m2: float = 4e-4
    baseline_rate: float = 0.02
    detector_ratio: float = 1.0
    search_ratio: float = 1.5


@dataclass(frozen=True)
class SearchConfig:
    """Settings of the search around a doubted pose.

    Attributes:
        every: frames from one search to the next, while the pose stays in doubt; 0 for no search.
        accept_small: turns by up to 60 degrees are accepted below this fraction of the current cost.
        accept_large: all others below this one: front and back look alike.
        accept_detected: a detected pose, which does not know the cost, is accepted below this many times the current cost.
        flip_every: frames from one comparison with the mirrored body to the next; 0 for none.
        flip_upright: smallest cosine between the torso and the camera's vertical in which the two are compared: in a handstand
            head and knees are held differently.
        flip_clip: a comparison's log ratio of the costs counts at most this much.
        flip_threshold: cumulative sum of these (Page 1954) above which the pose is mirrored. Of 7,330 good poses of training
            dances, 99 % have a log cost at least 0.05 below that of the mirrored body, and 99.9 % at most 0.12 above.
    """

    every: int = 20
    accept_small: float = 0.9
    accept_large: float = 0.8
    accept_detected: float = 1.5
    flip_every: int = 5
    flip_upright: float = 0.5
    flip_clip: float = 0.2
    flip_threshold: float = 0.3


def take_detected(detected_m: np.ndarray, fitted: Fitted, fitting: Fitting, config: SearchConfig) -> Fitted | None:
    """The detected (15, 3) pose, fitted; None if it costs too much more than the tracked one."""
    joints_m = fit(detected_m, fitting.grid, fitting.body, fitting.config.final_iterations, prior_weight=DETECTION_PRIOR_WEIGHT)
    cost_m2 = pose_cost(joints_m, fitting.grid, fitting.body)
    if cost_m2 < config.accept_detected * pose_cost(fitted.joints_m, fitting.grid, fitting.body):
        return Fitted(joints_m, cost_m2)
    return None


def search(fitted: Fitted, limit_m2: float, fitting: Fitting, config: SearchConfig) -> Fitted:
    """The pose, or one that is turned, bent or mirrored and costs less. Small turns are tried first, others if it still costs
    more than the limit.
    """
    for proposals, accepted in ((_small_turns, config.accept_small), (_large_turns, config.accept_large)):
        if fitted.cost_m2 > limit_m2:
            other = fitting.best(proposals(fitted.joints_m))
            fitted = other if other.cost_m2 < accepted * fitted.cost_m2 else fitted
    return fitted


def _small_turns(joints_m: np.ndarray) -> list[np.ndarray]:
    return [rotate_about_spine(joints_m, angle) for angle in SMALL_TURNS_RAD]


def _large_turns(joints_m: np.ndarray) -> list[np.ndarray]:
    turned = [rotate_about_spine(joints_m, angle) for angle in LARGE_TURNS_RAD]
    return [joints_m[MIRROR], *turned, *(rotate_about_shoulders(joints_m, angle) for angle in BOWS_RAD)]


def flipped(fitted: Fitted, state: State, fitting: Fitting, config: SearchConfig) -> Fitted | None:
    """The mirrored pose if its cost has been lower in several comparisons, else None.

    The evidence is a cumulative sum of log cost ratios and belongs to the tracked pose: after another one is accepted, it
    restarts at 0.
    """
    state.frames += 1
    if not config.flip_every or state.frames % config.flip_every:
        return None
    if torso_frame(fitted.joints_m)[1, 1] < config.flip_upright:
        return None
    mirrored_m = fit(fitted.joints_m[MIRROR], fitting.grid, fitting.body, _FLIP_ITERATIONS)
    cost_m2 = pose_cost(mirrored_m, fitting.grid, fitting.body)
    gain = np.log(pose_cost(fitted.joints_m, fitting.grid, fitting.body) / cost_m2)
    state.flip_evidence = max(state.flip_evidence + min(gain, config.flip_clip), 0.0)
    if state.flip_evidence <= config.flip_threshold:
        return None
    state.flip_evidence = 0.0
    return Fitted(mirrored_m, cost_m2)
