"""The statistics that are compared, and their values for one source."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from tqdm import tqdm

from kpopnet.skeleton import JOINT_GROUPS, Joint
from synth.realism import shapes
from synth.realism.selection import is_standing
from synth.realism.shapes import Frame
from synth.realism.sources import Source

FEET_TOGETHER_CM = 20.0


@dataclass(frozen=True)
class Statistic:
    """One line of the table.

    Attributes:
        name: what is measured.
        unit: of the values; "" for ratios.
        values: (source) to (N,) values, none where the source cannot tell.
        is_share: the values are 0 or 1, and their mean is compared.
    """

    name: str
    unit: str
    values: Callable[[Source], np.ndarray]
    is_share: bool = False


def of_frames(measure: Callable[[Frame], float], source: Source) -> np.ndarray:
    """A measure of all random frames, without NaN."""
    return _measured(measure, source.frames)


def of_upright(measure: Callable[[Frame], float], source: Source) -> np.ndarray:
    """A measure of the frames of upright people, without NaN."""
    return _measured(measure, source.upright)


def _measured(measure: Callable[[Frame], float], frames: list[Frame]) -> np.ndarray:
    values = np.array([measure(frame) for frame in frames], float)
    return values[np.isfinite(values)]


def foot_distances_cm(source: Source) -> np.ndarray:
    """Distances of the labelled feet of standing people, centimetres."""
    joints_m = source.skeletons_m[is_standing(source.skeletons_m)]
    return 100 * np.linalg.norm(joints_m[:, Joint.RIGHT_FOOT] - joints_m[:, Joint.LEFT_FOOT], axis=-1)


def feet_together(source: Source) -> np.ndarray:
    """1 where the feet of a standing person are closer than FEET_TOGETHER_CM, else 0."""
    return (foot_distances_cm(source) < FEET_TOGETHER_CM).astype(float)


def noise_variances(source: Source) -> np.ndarray:
    return np.array([noise.variance_steps2 for noise in source.noise])


def noise_correlations(source: Source) -> np.ndarray:
    return np.array([noise.correlation for noise in source.noise])


STATISTICS = (
    Statistic("distance of the person", "m", partial(of_frames, shapes.distance_m)),
    Statistic("silhouettes cut by the border", "share", partial(of_frames, shapes.is_cut), is_share=True),
    Statistic("upright: area / height^2", "", partial(of_upright, shapes.area_share)),
    Statistic("upright: width of both shins / height", "", partial(of_upright, shapes.shins_width)),
    Statistic("upright: width of both thighs / height", "", partial(of_upright, shapes.thighs_width)),
    Statistic("upright: width of both feet", "cm", partial(of_upright, shapes.feet_width_cm)),
    Statistic("upright: outline^2 / area", "", partial(of_upright, shapes.outline_shape)),
    Statistic("upright: outline / smoothed outline", "", partial(of_upright, shapes.raggedness)),
    Statistic("standing: distance of the feet", "cm", foot_distances_cm),
    Statistic("standing: feet closer than 20 cm", "share", feet_together, is_share=True),
    Statistic("holes in the silhouette", "share of it", partial(of_frames, shapes.hole_share)),
    Statistic("roughness of surfaces", "steps", partial(of_frames, shapes.roughness_steps)),
    Statistic("ridge", "share of the silhouette", partial(of_frames, shapes.ridge_share)),
    Statistic("frame difference of still pixels: variance", "steps^2", noise_variances),
    Statistic("frame difference: correlation at 1 px", "", noise_correlations),
    *[
        Statistic(
            f"upright: {name} behind the surface", "cm", partial(of_upright, partial(shapes.joint_depth_cm, joints=joints))
        )
        for name, joints in JOINT_GROUPS.items()
    ],
)
"""Every statistic that real and generated data share, in the table's order."""


def measure(source: Source) -> dict[str, np.ndarray]:
    """The values of every statistic by its name."""
    return {one.name: one.values(source) for one in tqdm(STATISTICS, source.name, unit="statistic", disable=None)}
