"""What is expected of the next frame, from the last ones."""

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.skeleton import NUM_JOINTS


@dataclass(frozen=True)
class PredictionConfig:
    """Settings of what is expected of the next frame.

    Attributes:
        damping: expected pose = last pose + this x last step.
        max_step_m: each coordinate of the last step is clipped to this many metres per frame.
        relocation_m: if the centroid of the points moved farther than this between two frames, in metres, the last pose is
            translated with it, as when a person leaves and comes back elsewhere.
        dropout_ratio: a visible area below this fraction of the last accepted frame's is a dropout of the sensor: the pose is
            held.
        dropout_decay: the accepted area shrinks by this factor in every held frame, so that the pose is not held forever.
    """

    damping: float = 0.5
    max_step_m: float = 0.15
    relocation_m: float = 0.3
    dropout_ratio: float = 0.7
    dropout_decay: float = 0.9


@dataclass
class State:
    """What a tracker carries from frame to frame.

    Attributes:
        joints_m: (15, 3) the last pose in the camera frame.
        velocity_m: (15, 3) the joints' last step, metres per frame.
        baseline_cost_m2: what a good pose of this person costs, square metres.
        centroid_m: (3,) of the last frame's points, None before the first.
        visible_px: visible area of the last accepted frame.
        frames: number of frames since the start that passed without another pose from a detector or the search.
        searched: frames since the last search; infinite before the first.
        hopeless: number of frames in a row in which the pose explained the depth badly.
        flip_evidence: evidence that the pose is flipped (`kpopnet.tracker.search`).
    """

    joints_m: np.ndarray
    baseline_cost_m2: float
    velocity_m: np.ndarray = field(default_factory=lambda: np.zeros((NUM_JOINTS, 3)))
    centroid_m: np.ndarray | None = None
    visible_px: float = 0.0
    frames: int = 0
    hopeless: int = 0
    searched: float = np.inf
    flip_evidence: float = 0.0


def dropped_out(state: State, grid: DepthGrid, config: PredictionConfig) -> bool:
    """Whether so much less is visible than in the last frame that the sensor must have failed; the pose is then at rest."""
    visible_px = len(grid.points_m) * grid.intrinsics[4] ** 2
    if visible_px < config.dropout_ratio * state.visible_px:
        state.visible_px *= config.dropout_decay
        state.velocity_m = np.zeros_like(state.velocity_m)
        return True
    state.visible_px = visible_px
    return False


def predict(state: State, grid: DepthGrid, config: PredictionConfig) -> np.ndarray:
    """(15, 3) the pose expected in this frame. Moves the last pose with the points if they jumped."""
    centroid_m = grid.points_m.mean(axis=0)
    if state.centroid_m is not None and np.linalg.norm(centroid_m - state.centroid_m) > config.relocation_m:
        state.joints_m = state.joints_m + (centroid_m - state.centroid_m)
    state.centroid_m = centroid_m
    return state.joints_m + config.damping * np.clip(state.velocity_m, -config.max_step_m, config.max_step_m)


@njit(cache=True)
def mean_squared_step(joints_m, expected_m, max_step_m):
    """Mean squared distance of (15, 3) joints to the expected ones, each distance clipped to `max_step_m` metres."""
    total = 0.0
    for j in range(len(joints_m)):
        squared = 0.0
        for c in range(3):
            squared += (joints_m[j, c] - expected_m[j, c]) ** 2
        total += min(squared, max_step_m**2)
    return total / len(joints_m)
