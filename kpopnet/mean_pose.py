"""The constant baseline: everybody stands as the average person of the training set does.

What a network scores beside it is what looking at the picture is worth.
"""

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.estimators import Estimate
from kpopnet.networks.cube import person_centre
from kpopnet.skeleton import NUM_JOINTS


class MeanPoseEstimator:
    """The person's centre plus one pose, whatever the picture shows."""

    name = "mean_pose"

    def __init__(self, mean_pose_m: np.ndarray) -> None:
        """Takes (15, 3) joints in metres relative to the person's centre (`person_centre`), in the camera's axes."""
        self.mean_pose_m = np.asarray(mean_pose_m, np.float32).reshape(NUM_JOINTS, 3)

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimators.Estimator`. Its confidence is 1 wherever there is a person: it knows no better."""
        depth_m = sequence_in_metres(depth_m, camera)
        joints = np.full((len(depth_m), NUM_JOINTS, 3), np.nan, np.float32)
        for frame, image in enumerate(depth_m):
            centre = person_centre(image, camera)
            if centre is not None:
                joints[frame] = centre + self.mean_pose_m
        return Estimate(joints, np.isfinite(joints).all(axis=-1).astype(np.float32))
