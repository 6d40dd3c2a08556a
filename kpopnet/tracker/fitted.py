"""Another estimator's joints, fitted: the body is moved until it explains the depth, and drawn to where it was said to be.

A network that looks at single frames knows where front and back, left and right are, and is a few centimetres off; the fit
knows the surface to a centimetre, and goes astray if it begins far away. Beyond the paper.
"""

from collections.abc import Iterable
from itertools import islice

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimators import Estimate, Estimator
from kpopnet.tracker.body import Body, body_of
from kpopnet.tracker.cells import FEWEST_CELLS, Cells, cells_of
from kpopnet.tracker.fitting import fit
from kpopnet.tracker.model import HumanModel
from kpopnet.tracker.surface import with_thickness

MEASURED_FRAMES, THICKNESS_EVERY = 60, 6
"""The person's lengths are the medians over so many frames, the first with a person; thickness over every sixth of these."""

STEPS = 4
SAID_WEIGHT = 0.1
"""How much joints are drawn to where they were said to be, against 1 for all points together. Of 0.01, 0.05, 0.1, 0.15 and 0.4
on 12 development sequences 0.05 has most joints within 10 cm and 0.15 the least mean error, all are close."""


class FittedEstimator:
    """Implements kpopnet.estimators.Estimator. Confidence is that of the estimator whose joints are fitted."""

    name = "fitted_network"

    def __init__(self, estimator: Estimator) -> None:
        self.estimator = estimator

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """Joints of the one person in each frame.

        Args:
            depth_m: (T, H, W) of that person alone, 0 elsewhere; floating-point metres or uint16 millimetres.
            camera: the camera of these pixels.

        Returns:
            (T, 15, 3) joints and (T, 15) confidence. What the estimator misses stays missing, and so does the fit where
            next to nothing of a person is seen.

        Raises:
            InputError: depth of another type or shape.
        """
        depth_m = sequence_in_metres(depth_m, camera)
        said = self.estimator.estimate(depth_m, camera)
        joints_m = said.joints_camera_m.copy()
        seen = [t for t in range(len(depth_m)) if np.isfinite(joints_m[t]).all() and (depth_m[t] > 0).any()]
        body = measured_body((joints_m[t], cells_of(depth_m[t], camera)) for t in seen)
        for t in seen if body is not None else ():
            cells = cells_of(depth_m[t], camera)
            if len(cells.points_m) >= FEWEST_CELLS:
                joints_m[t] = fit(joints_m[t], cells, body, STEPS, start_weight=SAID_WEIGHT)
        return Estimate(joints_m, said.confidence)


def measured_body(frames: Iterable[tuple[np.ndarray, Cells]]) -> Body | None:
    """The body of a person whose joints are about known in several frames.

    Args:
        frames: (15, 3) joints in the camera frame in metres, and the picture they are of.

    Returns:
        None if no frame shows a body.
    """
    bodies, pictures = [], []
    for joints_m, cells in islice(frames, MEASURED_FRAMES):
        try:
            bodies.append(body_of(HumanModel.from_joints(joints_m)))
        except InputError:  # no lengths of a body
            continue
        pictures.append((joints_m, cells))
    if not bodies:
        return None
    lengths_m, limbs_m, radii_m = (
        np.median([getattr(body, name) for body in bodies], axis=0) for name in ("lengths_m", "limbs_m", "radii_m")
    )
    body = bodies[0]._replace(lengths_m=lengths_m, limbs_m=limbs_m, radii_m=radii_m)
    return body._replace(radii_m=np.median([_radii_m(body, *picture) for picture in pictures[::THICKNESS_EVERY]], axis=0))


def _radii_m(body: Body, joints_m: np.ndarray, cells: Cells) -> np.ndarray:
    return with_thickness(body, fit(joints_m, cells, body, STEPS, start_weight=SAID_WEIGHT), cells).radii_m
