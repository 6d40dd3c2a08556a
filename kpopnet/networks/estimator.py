"""Pose estimation in depth sequences with a trained network."""

import logging
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres, subsampled
from kpopnet.data.cube import Cube, crop, person_centre
from kpopnet.estimator import WHOLE_ROOM, Estimate, shows_a_room
from kpopnet.networks import ModelConfig
from kpopnet.networks.backend import open_network
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.runtime.input_files import settings_from
from kpopnet.skeleton import Joint

log = logging.getLogger(__name__)

BATCH = 32
"""Crops that a network is run on at once."""

Said = tuple[np.ndarray, np.ndarray, np.ndarray | None]
"""Joints, confidence and logits, as `kpopnet.networks.backend.Backend` answers."""

SURER = 0.03
"""The mean confidence in joints by which a crop that was turned has to exceed the crop as it is."""


class NetworkEstimator:
    """A `kpopnet.estimator.Estimator`.

    Frames are independent: the person's centre is the median of the frame's silhouette, as in training. Who is not upright is
    looked at twice (`seen_upright`). The confidence is the network's estimate of the probability that the joint lies within
    10 cm of the ground truth.
    """

    def __init__(self, checkpoint: Path | str | None = None, device: str = "cpu") -> None:
        """Loads a network; arguments and errors as in `kpopnet.networks.backend.open_network`."""
        self.backend = open_network(checkpoint, device)
        self.meta = self.backend.meta
        self.model = ModelConfig(**self.meta["model"])
        self.name = self.model.name
        self._warned = False
        takes_ridge, settings = self.model.input == "depth_ridge", self.meta["config"].get("ridge", {})
        self.ridge = settings_from(RidgeConfig, settings, f"{checkpoint}: its ridge settings") if takes_ridge else None

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`."""
        depth_m, camera = subsampled(sequence_in_metres(depth_m, camera), camera)
        return self.judge([(frame_m, camera) for frame_m in depth_m])[0]

    def judge(self, images: Sequence[tuple[np.ndarray, Camera]]) -> tuple[Estimate, np.ndarray | None]:
        """See `kpopnet.estimator.Judge`."""
        if images and not self._warned and shows_a_room(*images[len(images) // 2]):
            self._warned = True
            log.warning(WHOLE_ROOM, self.name)
        result = Estimate.missing(len(images))
        judges, person_logit = False, np.full(len(images), -np.inf, np.float32)
        centres_m = [person_centre(*image) for image in images]
        cubes = {row: Cube(centre_m, self.model.half_size_m) for row, centre_m in enumerate(centres_m) if centre_m is not None}
        rows = list(cubes)
        for batch in (rows[i : i + BATCH] for i in range(0, len(rows), BATCH)):
            crops = np.stack([self._crop(*images[row], cubes[row]) for row in batch])
            uvd, result.confidence[batch], person = seen_upright(self.backend, crops)
            if person is not None:
                judges, person_logit[batch] = True, person
            for row, estimate in zip(batch, uvd, strict=True):
                result.joints_camera_m[row] = cubes[row].to_metres(estimate)
        return result, person_logit if judges else None

    def _crop(self, depth_m: np.ndarray, camera: Camera, cube: Cube) -> np.ndarray:
        ridge = None if self.ridge is None else ridge_probability(depth_m, self.ridge)
        return crop(depth_m, camera, cube, self.model.crop_px, ridge)


def seen_upright(network: Callable[[np.ndarray], Said], crops: np.ndarray) -> Said:
    """What a network says of (N, C, S, S) crops, as `Backend`; where it sees a trunk that is not upright it is asked again, of
    the crop turned by quarters until the trunk is, and what it is surer of counts.

    Few people of the training lie or stand on their hands, and few of its cameras are rolled. Whether it is a person at all is
    said of the crop as it is.
    """
    uvd, confidence, person = network(crops)
    trunk = uvd[:, Joint.NECK] - (uvd[:, Joint.RIGHT_HIP] + uvd[:, Joint.LEFT_HIP]) / 2
    quarters = np.rint(np.arctan2(trunk[:, 0], -trunk[:, 1]) / (np.pi / 2)).astype(int) % 4
    rows = np.flatnonzero(quarters)
    if len(rows):
        turned, sure, _ = network(np.stack([np.rot90(crops[row], quarters[row], (1, 2)) for row in rows]))
        for row, joints, one in zip(rows, turned, sure, strict=True):
            if one.mean() > confidence[row].mean() + SURER:
                back = np.linalg.matrix_power([[0, -1], [1, 0]], quarters[row])
                uvd[row, :, :2], uvd[row, :, 2], confidence[row] = joints[:, :2] @ back.T, joints[:, 2], one
    return uvd, confidence, person
