"""Pose estimation in depth sequences with a trained network."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
import torch

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.data.cube import Cube, crop, person_cubes
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.networks.checkpoint import load_network
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.runtime.input_files import settings_from

log = logging.getLogger(__name__)

BATCH = 32

ROOM_FRACTION, ROOM_M2 = 0.6, 3.0
"""A frame shows more than one person if more than this fraction of its pixels is measured, and these pixels cover more than
this area seen from the front: a person's, with wide clothes and arms stretched out, is below 1.5 m2."""


class NetworkEstimator:
    """Implements kpopnet.estimator.Estimator.

    Frames are independent: the person's centre is the median of the frame's silhouette, as in training. The confidence is
    the network's estimate of the probability that the joint lies within 10 cm of the ground truth.
    """

    def __init__(self, checkpoint: Path | str, device: str = "cpu") -> None:
        """Loads a checkpoint.

        Raises:
            InputError: no checkpoint in the folder, or a damaged one; or no such device.
        """
        if device not in ("cpu", "cuda") or (device == "cuda" and not torch.cuda.is_available()):
            raise InputError(f"device={device}: expected cpu, or cuda on a machine with a GPU")
        self.network, self.meta = load_network(checkpoint, device)
        self.device = torch.device(device)
        self.model = self.network.config
        self.name = self.model.name
        self._warned = False
        self.ridge = None
        if self.model.input == "depth_ridge":
            self.ridge = settings_from(RidgeConfig, self.meta["config"].get("ridge", {}), f"{checkpoint}: its ridge settings")

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`."""
        depth_m = sequence_in_metres(depth_m, camera)
        if not self._warned and shows_a_room(depth_m[len(depth_m) // 2 :][:1], camera):
            self._warned = True
            log.warning(
                "%s: the depth shows a whole room, and a network expects one person and 0 elsewhere: its joints will be wrong; "
                "extract the person first (kpopnet.extraction.extract_person)",
                self.name,
            )
        result = Estimate.missing(len(depth_m))
        cubes = person_cubes(depth_m, camera, self.model.half_size_m)
        frames = list(cubes)
        for batch in (frames[i : i + BATCH] for i in range(0, len(frames), BATCH)):
            uvd, result.confidence[batch] = self._predict([self._crop(depth_m[i], camera, cubes[i]) for i in batch])
            for frame, estimate in zip(batch, uvd, strict=True):
                result.joints_camera_m[frame] = cubes[frame].to_metres(estimate)
        return result

    def _crop(self, depth_m: np.ndarray, camera: Camera, cube: Cube) -> np.ndarray:
        ridge = None if self.ridge is None else ridge_probability(depth_m, self.ridge)
        return crop(depth_m, camera, cube, self.model.crop_px, ridge)

    @torch.inference_mode()
    def _predict(self, crops: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        batch = torch.from_numpy(np.stack(crops)).to(self.device)
        with _one_thread() if len(crops) == 1 else nullcontext():
            prediction = self.network(batch)
        return prediction.joints.cpu().numpy(), prediction.confidence.cpu().numpy()


def shows_a_room(depth_m: np.ndarray, camera: Camera) -> bool:
    """Whether (N, H, W) depth in metres shows much more than one person."""
    measured = np.count_nonzero(depth_m)
    if measured <= ROOM_FRACTION * depth_m.size or not measured:
        return False
    return float(np.square(depth_m, dtype=np.float64).sum()) / (camera.fx * camera.fy) > ROOM_M2 * len(depth_m)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limits torch to one thread, with which a batch of one crop takes a third of the time that it takes with two.

    For such a batch torch uses many small matrix products instead of oneDNN, and each waits for the other threads.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
