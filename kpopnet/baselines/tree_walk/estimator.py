"""Pose estimation in depth sequences with a trained random tree walk."""

from dataclasses import dataclass

import numpy as np

from kpopnet.baselines.tree_walk.image import integer_image
from kpopnet.baselines.tree_walk.model import TreeWalkModel
from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.data.cube import crop, person_cubes
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate


@dataclass(frozen=True)
class TreeWalkEstimatorConfig:
    """The random tree walk.

    Attributes:
        path: folder of a trained model.
    """

    path: str | None = None


class TreeWalkEstimator:
    """Implements kpopnet.estimator.Estimator.

    Frames are independent: the walks of a frame start at the median of its silhouette, and are seeded with its index in the
    sequence. The confidence is the share of joints within 10 cm of the ground truth among validation walks with a similar
    deviation.
    """

    name = "tree_walk"

    def __init__(self, config: TreeWalkEstimatorConfig) -> None:
        """Loads the model.

        Raises:
            InputError: no path is given, or the model cannot be read.
        """
        if config.path is None:
            raise InputError(
                "estimator=tree_walk needs a trained model: estimator.tree_walk.path=outputs/tree_walk/RUN; "
                "`python train.py --config-name tree_walk` trains one"
            )
        self.model = TreeWalkModel.load(config.path)

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`."""
        depth_m = sequence_in_metres(depth_m, camera)
        result = Estimate.missing(len(depth_m))
        for frame, cube in person_cubes(depth_m, camera, self.model.half_size_m).items():
            image = integer_image(crop(depth_m[frame], camera, cube, self.model.crop_px)[0])
            uvd, deviation_m = self.model.run_walks(image, frame)
            result.joints_camera_m[frame] = cube.to_metres(uvd)
            result.confidence[frame] = self.model.confidence(deviation_m)
        return result
