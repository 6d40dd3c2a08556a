"""Trained tree walks as an estimator of joints in depth sequences."""

from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimators import Estimate
from kpopnet.networks.cube import crop, person_cubes
from kpopnet.tree_walk.image import integer_image
from kpopnet.tree_walk.model import TreeWalkModel


@dataclass(frozen=True)
class TreeWalkEstimatorConfig:
    """Attributes: path: the folder of a trained model."""

    path: str | None = None


class TreeWalkEstimator:
    """Implements kpopnet.estimators.Estimator.

    Every frame stands for itself: its walks begin at the median of its silhouette, and draw their chance from its number in
    the sequence. The confidence is the share of joints within 10 cm of the truth among validation walks that spread alike.
    """

    name = "tree_walk"

    def __init__(self, config: TreeWalkEstimatorConfig) -> None:
        """Reads the model.

        Raises:
            InputError: none is named or it cannot be read.
        """
        if config.path is None:
            raise InputError(
                "estimator=tree_walk needs a trained model: estimator.tree_walk.path=outputs/tree_walk/RUN; "
                "`python train_tree_walk.py` makes one"
            )
        self.model = TreeWalkModel.load(config.path)

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimators.Estimator`."""
        depth_m = sequence_in_metres(depth_m, camera)
        found = Estimate.of_nobody(len(depth_m))
        for frame, cube in person_cubes(depth_m, camera, self.model.half_size_m).items():
            seen = integer_image(crop(depth_m[frame], camera, cube, self.model.crop_px)[0])
            uvd, spread_m = self.model.walked(seen, frame)
            found.joints_camera_m[frame] = cube.to_metres(uvd)
            found.confidence[frame] = self.model.confidence(spread_m)
        return found
