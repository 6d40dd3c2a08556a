"""The stage that fits the body: the best of several start poses, with limbs laid anew where that lowers the cost."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kpopnet.errors import check_between
from kpopnet.geometry.body import Body
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.tracker.fit.limbs import refit_limbs
from kpopnet.tracker.fit.objective import pose_cost
from kpopnet.tracker.fit.solver import fit
from kpopnet.tracker.prediction import mean_squared_step


@dataclass(frozen=True)
class FittingConfig:
    """Settings of the fit to each frame.

    Attributes:
        points: approximate number of points with which poses are compared; the final fit uses all points.
        proposal_iterations: Gauss-Newton iterations from every start pose.
        refine_iterations: further ones from the best.
        final_iterations: those with all points, after the limbs.
        limbs: lay limbs anew where that lowers the cost.
        motion_weight: weight of the mean squared distance between joints and expected joints.
        max_motion_m: each of these distances is clipped to this many metres.
    """

    points: int = 200
    proposal_iterations: int = 2
    refine_iterations: int = 3
    final_iterations: int = 4
    limbs: bool = True
    motion_weight: float = 0.01
    max_motion_m: float = 0.25

    def __post_init__(self) -> None:
        check_between("fitting.points", self.points, 1, 1_000_000)


def stride_of(grid: DepthGrid, config: FittingConfig) -> int:
    """Every how many points about `config.points` are."""
    return max(1, len(grid.points_m) // config.points)


class Fitted(NamedTuple):
    """A pose that was fitted to a frame.

    Attributes:
        joints_m: (15, 3).
        cost_m2: its cost, with that of its motion where the pose follows the last one, square metres.
    """

    joints_m: np.ndarray
    cost_m2: float


class Fitting(NamedTuple):
    """Fits the body to one frame.

    Attributes:
        grid: the depth image.
        body: the person's body.
        previous_m: (15, 3) the pose of the last frame.
        expected_m: (15, 3) the pose expected in this frame.
        config: settings.
    """

    grid: DepthGrid
    body: Body
    previous_m: np.ndarray
    expected_m: np.ndarray
    config: FittingConfig

    def best(self, starts: list[np.ndarray]) -> Fitted:
        """The pose fitted from the best of (15, 3) start poses."""
        config, stride = self.config, stride_of(self.grid, self.config)
        proposals = [fit(start, self.grid, self.body, config.proposal_iterations, stride) for start in starts]
        joints_m = min(proposals, key=lambda joints_m: self._cost_m2(joints_m, stride))
        joints_m = fit(joints_m, self.grid, self.body, config.refine_iterations, stride)
        if config.limbs:
            joints_m, _ = refit_limbs(joints_m, self.previous_m, self.grid, self.body, stride)
        joints_m = fit(joints_m, self.grid, self.body, config.final_iterations)
        return Fitted(joints_m, self._cost_m2(joints_m, 1))

    def _cost_m2(self, joints_m: np.ndarray, stride: int) -> float:
        motion_m2 = mean_squared_step(joints_m, self.expected_m, self.config.max_motion_m)
        return pose_cost(joints_m, self.grid, self.body, stride) + self.config.motion_weight * motion_m2
