"""The constant baseline: the mean pose of the training set, placed at the person's centre.

The difference between a network's score and this baseline's is what the network gains from the image.
"""

import numpy as np
from numpy.typing import ArrayLike

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.data.cube import person_centre
from kpopnet.estimator import Estimate, complete_joints
from kpopnet.skeleton import NUM_JOINTS


class MeanPoseEstimator:
    """Estimates the person's centre plus one constant pose. Implements kpopnet.estimator.Estimator."""

    name = "mean_pose"

    def __init__(self, mean_pose_m: ArrayLike) -> None:
        """`mean_pose_m`: (15, 3) metres relative to the person's centre (`person_centre`), along the camera's axes.

        Raises InputError for another shape, or missing joints.
        """
        self.mean_pose_m = complete_joints(mean_pose_m, "mean pose").astype(np.float32)

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`. The confidence is 1 in every frame with a person, since it cannot be estimated."""
        depth_m = sequence_in_metres(depth_m, camera)
        joints = np.full((len(depth_m), NUM_JOINTS, 3), np.nan, np.float32)
        for frame, image in enumerate(depth_m):
            centre = person_centre(image, camera)
            if centre is not None:
                joints[frame] = centre + self.mean_pose_m
        return Estimate(joints, np.asarray(np.isfinite(joints).all(axis=-1), np.float32))
