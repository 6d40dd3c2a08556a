"""Trained tree walks as an estimator of joints in depth sequences."""

from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.estimators import Estimate
from kpopnet.networks.cube import Cube, crop, person_centre
from kpopnet.skeleton import NUM_JOINTS
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
        """Joints of the one person in each frame.

        Args:
            depth_m: (T, H, W) of that person alone, 0 elsewhere; floating-point metres or uint16 millimetres.
            camera: the camera of these pixels.

        Returns:
            (T, 15, 3) joints and (T, 15) confidence; NaN and 0 in frames with an empty silhouette.

        Raises:
            InputError: depth of another type or shape.
        """
        depth_m = sequence_in_metres(depth_m, camera)
        joints_m = np.full((len(depth_m), NUM_JOINTS, 3), np.nan, np.float32)
        confidence = np.zeros((len(depth_m), NUM_JOINTS), np.float32)
        for frame, image in enumerate(depth_m):
            centre_m = person_centre(image, camera)
            if centre_m is None:
                continue
            cube = Cube(centre_m, self.model.half_size_m)
            seen = integer_image(crop(image, camera, cube, self.model.crop_px)[0])
            uvd, spread_m = self.model.walked(seen, frame)
            joints_m[frame] = cube.to_metres(uvd)
            confidence[frame] = self.model.confidence(spread_m)
        return Estimate(joints_m, confidence)
