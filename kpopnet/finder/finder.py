"""The finder: everybody in one depth image of any scene before any camera, and who is who in films."""

from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.data.canvas import STRIDE, Reduced, reduced
from kpopnet.finder.following import Followed
from kpopnet.finder.network import FinderNetwork, observed
from kpopnet.finder.people import gather_people, pixel_owners
from kpopnet.human import Human
from kpopnet.runtime.input_files import read_with

LEAST_PROBABILITY, LEAST_M2, LEAST_CELLS = 0.5, 0.03, 8
LEAST_SCORE, LEAST_SHOWN = 0.75, 0.15
"""A person is reported whose cells show a person with this mean probability, and of whose body this share shows."""


class PersonFinder:
    """Finds the people in the images of one camera, which may move, and follows them from image to image."""

    def __init__(self, camera: Camera, network: FinderNetwork) -> None:
        self.camera, self._network, self._followed = camera, network, Followed()

    def extract(self, depth_m: np.ndarray) -> list[Human]:
        """The people in the next image.

        Args:
            depth_m: (H, W) float32 metres, 0 where nothing was measured.

        Raises:
            InputError: not one depth image of the camera's size.
        """
        depth_m = depth_in_metres(depth_m, self.camera)
        if depth_m.ndim != 2:
            raise InputError(f"depth image: expected shape (H, W), got {depth_m.shape}; pass one image per call")
        canvas = reduced(depth_m, self.camera)
        if not canvas.depth_m.any():
            self._followed.identify(np.zeros((0, 3), np.float32))
            return []
        probability, votes_m, shown = self._seen(canvas)
        cell_depth_m = np.ascontiguousarray(canvas.depth_m[::STRIDE, ::STRIDE])
        fx, fy = canvas.intrinsics[:2]
        cell_m2 = cell_depth_m**2 * np.float32(STRIDE**2 / (fx * fy))
        centres_m, score, share, _, owner = gather_people(
            probability, votes_m, shown, cell_m2, LEAST_PROBABILITY, LEAST_M2, LEAST_CELLS
        )
        sure = (score >= LEAST_SCORE) & (share >= LEAST_SHOWN)
        numbers = np.zeros(len(score) + 1, np.uint8)
        numbers[1:][sure] = np.arange(1, sure.sum() + 1)
        owner, centres_m = numbers[owner], centres_m[sure]
        owners, boxes = pixel_owners(depth_m, cell_depth_m, probability, owner, canvas.reduction, len(centres_m))
        identities = self._followed.identify(centres_m)
        humans = [
            Human.cut_out(identity, depth_m, owners, number, box, centre_m)
            for number, (identity, box, centre_m) in enumerate(zip(identities, boxes, centres_m, strict=True), 1)
            if box[2] > box[0]
        ]
        return sorted(humans, key=lambda human: human.identity)

    @torch.inference_mode()
    def _seen(self, canvas: Reduced) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(h, w) probability of a person, (h, w, 3) votes in metres and (h, w) share of the body that shows."""
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            image = observed(torch.from_numpy(canvas.depth_m)[None], torch.from_numpy(canvas.intrinsics)[None])
            seen = self._network(image.contiguous(memory_format=torch.channels_last))
        finally:
            torch.set_num_threads(threads)
        height, width = seen.person_logit.shape[1:]
        z = canvas.depth_m[::STRIDE, ::STRIDE]
        fx, fy, cx, cy = canvas.intrinsics
        x, y = (STRIDE * np.arange(width) - cx) / fx, (STRIDE * np.arange(height)[:, None] - cy) / fy
        points_m = np.stack([x * z, y * z, z], axis=-1).astype(np.float32)
        votes_m = seen.vote_m[0].permute(1, 2, 0).numpy() + points_m
        return torch.sigmoid(seen.person_logit[0]).numpy(), votes_m, torch.sigmoid(seen.shown_logit[0]).numpy()


def load_finder(path: Path | str) -> FinderNetwork:
    """Loads a trained finder; raises InputError if the file is missing, damaged, or of another architecture."""
    network = FinderNetwork().to(memory_format=torch.channels_last).eval().requires_grad_(False)
    problem = "missing, damaged, or not a finder of this version"
    weights = read_with(load_file, Path(path), problem)
    as_floats = {name: value.float() if value.dtype == torch.float16 else value for name, value in weights.items()}
    read_with(lambda _: network.load_state_dict(as_floats), Path(path), problem)
    return network
