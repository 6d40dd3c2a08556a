"""A trained network as an estimator of joints in depth sequences."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
import torch

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.checkpoint import load_network
from kpopnet.errors import InputError
from kpopnet.estimators import Estimate
from kpopnet.networks.cube import Cube, crop, person_cubes
from kpopnet.ridge import RidgeConfig, ridge_probability

BATCH = 32


class NetworkEstimator:
    """Implements kpopnet.estimators.Estimator.

    Every frame stands for itself: the person's centre is the median of its silhouette, as in training. The confidence
    is the network's own estimate of the probability that the joint lies within 10 cm of the truth.
    """

    def __init__(self, checkpoint: Path | str, device: str = "cpu") -> None:
        """Loads a checkpoint.

        Raises:
            InputError: nothing there, foreign or damaged; or no such device.
        """
        if device not in ("cpu", "cuda") or (device == "cuda" and not torch.cuda.is_available()):
            raise InputError(f"device={device}: expected cpu, or cuda on a machine with a GPU")
        self.network, self.meta = load_network(checkpoint, device)
        self.device = torch.device(device)
        self.model = self.network.config
        self.name = self.model.name
        self.ridge = RidgeConfig(**self.meta["config"].get("ridge", {})) if self.model.input == "depth_ridge" else None

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimators.Estimator`."""
        depth_m = sequence_in_metres(depth_m, camera)
        found = Estimate.of_nobody(len(depth_m))
        cubes = person_cubes(depth_m, camera, self.model.half_size_m)
        frames = list(cubes)
        for chosen in (frames[i : i + BATCH] for i in range(0, len(frames), BATCH)):
            uvd, found.confidence[chosen] = self._predict([self._crop(depth_m[i], camera, cubes[i]) for i in chosen])
            for frame, estimate in zip(chosen, uvd, strict=True):
                found.joints_camera_m[frame] = cubes[frame].to_metres(estimate)
        return found

    def _crop(self, depth_m: np.ndarray, camera: Camera, cube: Cube) -> np.ndarray:
        ridge = None if self.ridge is None else ridge_probability(depth_m, self.ridge)
        return crop(depth_m, camera, cube, self.model.crop_px, ridge)

    @torch.inference_mode()
    def _predict(self, crops: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        batch = torch.from_numpy(np.stack(crops)).to(self.device)
        with _one_thread() if len(crops) == 1 else nullcontext():
            prediction = self.network(batch)
        return prediction.joints.cpu().numpy(), prediction.confidence.cpu().numpy()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Keeps torch to one thread: a batch of one takes three times as long on two.

    For it torch does not use oneDNN but many small matrix products, and each waits for the other threads to wake up.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
