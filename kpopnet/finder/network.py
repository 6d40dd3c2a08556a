"""The finder's two networks. One says for every second pixel of a depth image whether it shows a person, and where this
person's torso is; the other looks at each person so found in a crop of their own, and says which pixels are theirs.

Both see metric depth, no statistics of a data set, and one image without history.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from kpopnet.data.canvas import CANVAS, STRIDE
from kpopnet.data.person_masks import CROP_PX, HALF_M, OTHER, OWN
from kpopnet.finder import masks
from kpopnet.finder.people import INPUTS, OUTPUT_NAMES, Network
from kpopnet.networks.checkpoint import load_weights, on_one_thread
from kpopnet.networks.network import Encoder, convolution
from kpopnet.networks.onnx_export import traced


class Seen(NamedTuple):
    """What the network says of the cells of B images."""

    person_logit: Tensor  # (B, h, w) its sigmoid is the probability that the cell's pixel shows a person
    vote_m: Tensor  # (B, 3, h, w) the person's torso joint relative to the cell's point, camera frame, metres


class CellsNetwork(nn.Module):
    """Encoder and decoder with a skip from every level; the output has half the resolution of the input."""

    def __init__(self, inputs: int, outputs: int, widths: tuple[int, int, int, int], fine: int) -> None:
        super().__init__()
        stem, *others = widths
        self.encoder = Encoder(inputs, widths)
        self.laterals = nn.ModuleList(nn.Conv2d(width, fine, 1) for width in others)
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        self.smooth = nn.Sequential(convolution(fine, fine, 3), nn.ReLU(inplace=True))
        self.from_coarse, self.from_stem = nn.Conv2d(fine, stem, 1), nn.Conv2d(stem, stem, 1)
        self.last = nn.Sequential(
            nn.ReLU(), convolution(stem, 2 * stem, 3), nn.ReLU(inplace=True), nn.Conv2d(2 * stem, outputs, 1)
        )
        self.bfloat16 = False  # whether all but the last layer is trained in it

    def cells(self, image: Tensor) -> Tensor:
        """(B, outputs, H / 2, W / 2) of (B, inputs, H, W), H and W multiples of 16."""
        # Votes are metres: bfloat16 would round them to whole centimetres.
        with torch.autocast(image.device.type, torch.bfloat16, enabled=self.training and self.bfloat16):
            features = self._features(image)
        return self.last[-1](features.float())

    def _features(self, image: Tensor) -> Tensor:
        stem = self.encoder.stem(image)
        fine = self.encoder.fine(stem)
        middle = self.encoder.middle(fine)
        coarse = self.encoder.coarse(middle)
        fine, middle, coarse = (lateral(x) for lateral, x in zip(self.laterals, (fine, middle, coarse), strict=True))
        joined = self.smooth(fine + self.up(middle + self.up(coarse)))
        return self.last[:-1](self.up(self.from_coarse(joined)) + self.from_stem(stem))


class FinderNetwork(CellsNetwork):
    """Whether cells show a person, and where this person's torso is."""

    def __init__(self) -> None:
        super().__init__(inputs=5, outputs=4, widths=(16, 32, 64, 128), fine=40)

    def forward(self, image: Tensor) -> Seen:
        """From the (B, 5, H, W) of `observed`."""
        out = self.cells(image)
        return Seen(out[:, 0], out[:, 1:])


class MaskNetwork(CellsNetwork):
    """Which cells of a person's crop show this person."""

    def __init__(self) -> None:
        super().__init__(inputs=7, outputs=1, widths=(16, 16, 32, 64), fine=16)

    def forward(self, crop: Tensor) -> Tensor:
        """(B, S / 2, S / 2) logits from the (B, 7, S, S) of `observed_crop`."""
        return self.cells(crop)[:, 0]


def observed(depth_m: Tensor, intrinsics: Tensor) -> Tensor:
    """The network's input, (B, 5, H, W): of each pixel, whether it was measured, the logarithms of its depth and of its size,
    and its ray, X / Z and Y / Z; of pixels that were not measured only the ray. From (B, H, W) depth in metres, 0 where nothing
    was measured, and (B, 4) fx, fy, cx, cy in pixels.
    """
    measured = depth_m > 0
    z = torch.where(measured, depth_m, 1.0)
    fx, fy, cx, cy = (value[:, None, None] for value in intrinsics.unbind(1))
    _, height, width = depth_m.shape
    u = torch.arange(width, device=depth_m.device)
    v = torch.arange(height, device=depth_m.device)[:, None]
    x, y = ((u - cx) / fx).expand_as(z), ((v - cy) / fy).expand_as(z)
    log_depth, zero = torch.log(z / 2.5), torch.zeros(())
    log_size = log_depth + torch.log(125 / fx)  # about 0 at 2 m before a wide camera
    return torch.stack(
        [measured.float(), torch.where(measured, log_depth, zero), torch.where(measured, log_size, zero), x, y], 1
    )


def observed_crop(depth_m: Tensor, owner: Tensor, centre_m: Tensor) -> Tensor:
    """The mask network's input, (B, 7, S, S): of each pixel of a crop, its depth from the centre in half sizes, whether it was
    measured, whether the finder takes it for this person's, or for another's, its place in the crop, and the logarithm of the
    centre's depth. From (B, S, S) depth in metres, 0 where nothing was measured, the (B, S, S) uint8 owner, OWN, OTHER or 0,
    and the (B, 3) centres of the crops' cubes, metres.
    """
    measured, centre_z = depth_m > 0, centre_m[:, 2, None, None]
    depth = torch.where(measured, ((depth_m - centre_z) / HALF_M).clamp(-1.5, 1.5), torch.zeros(()))
    place = (torch.arange(CROP_PX, device=depth.device) + 0.5) * (2 / CROP_PX) - 1
    said = [(owner.float() == whose).float() for whose in (OWN, OTHER)]  # ONNX Runtime 1.20 compares no bytes
    u, v = place.expand_as(depth), place[:, None].expand_as(depth)
    return torch.stack([depth, measured.float(), *said, u, v, torch.log(centre_z / 2.5).expand_as(depth)], 1)


def cell_points_m(depth_m: Tensor, intrinsics: Tensor) -> Tensor:
    """(B, 3, h, w) points of the cells in the camera frame, metres; (0, 0, 0) where nothing was measured."""
    z = depth_m[:, ::STRIDE, ::STRIDE]
    fx, fy, cx, cy = (value[:, None, None] for value in intrinsics.unbind(1))
    u = STRIDE * torch.arange(z.shape[2], device=z.device)
    v = STRIDE * torch.arange(z.shape[1], device=z.device)[:, None]
    return torch.stack([(u - cx) / fx * z, (v - cy) / fy * z, z], 1)


VOTE_BETA_M = 0.1


def loss(seen: Seen, target: "Target") -> dict[str, Tensor]:
    """The terms of the loss by name; the loss is their sum. People count by the square root of their area."""
    person = target.weight * (target.person > 0)
    binary = functional.binary_cross_entropy_with_logits
    mask = binary(seen.person_logit, target.person, weight=target.weight, reduction="sum") / target.weight.sum()
    vote = functional.smooth_l1_loss(seen.vote_m, target.vote_m, beta=VOTE_BETA_M, reduction="none").sum(1)
    return {"person": mask, "vote": (vote * person).sum() / person.sum().clamp(min=1.0)}


def mask_loss(logit: Tensor, target: "Target") -> dict[str, Tensor]:
    """Of the mask network, likewise."""
    binary = functional.binary_cross_entropy_with_logits
    return {"mask": binary(logit, target.person, weight=target.weight, reduction="sum") / target.weight.sum()}


class Target(NamedTuple):
    """What a network should say of the cells of B images."""

    person: Tensor  # (B, h, w) 1 where the cell's pixel shows a person, or the person, else 0
    weight: Tensor  # (B, h, w) weight of the cell, 0 where nothing was measured
    vote_m: Tensor | None = None  # (B, 3, h, w) as in `Seen`


def load_network(path: Path | str, kind: type[CellsNetwork] = FinderNetwork) -> CellsNetwork:
    """Loads a trained network of the finder; raises InputError if the file is missing, damaged, or of another architecture."""
    network = kind().to(memory_format=torch.channels_last).eval().requires_grad_(False)
    load_weights(network, Path(path), "missing, damaged, or not a finder of this version")
    return network


class CellsOfImage(nn.Module):
    """What a finder says of the cells of one image, from its depth and intrinsics: what is exported."""

    def __init__(self, network: FinderNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, depth_m: Tensor, intrinsics: Tensor) -> tuple[Tensor, Tensor]:
        """(h, w) probability of a person and (h, w, 3) torso in metres, of (1, H, W) and (1, 4)."""
        seen = self.network(observed(depth_m, intrinsics))
        torso_m = (cell_points_m(depth_m, intrinsics) + seen.vote_m)[0].permute(1, 2, 0)
        return torch.sigmoid(seen.person_logit[0]), torso_m


class CellsOfCrops(nn.Module):
    """The probability that the cells of B crops show the crop's person: what is exported."""

    def __init__(self, network: MaskNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, depth_m: Tensor, owner: Tensor, centre_m: Tensor) -> Tensor:
        """(B, S / 2, S / 2) of the arguments of `observed_crop`."""
        return torch.sigmoid(self.network(observed_crop(depth_m, owner, centre_m)))


def torch_finder(path: Path | str) -> Network:
    """The finder of a file of weights, run by torch; more threads than one would wait for each other."""
    finder = CellsOfImage(load_network(path))

    @torch.inference_mode()
    def run(depth_m: np.ndarray, intrinsics: np.ndarray) -> tuple[np.ndarray, ...]:
        with on_one_thread():
            found = finder(torch.from_numpy(depth_m), torch.from_numpy(intrinsics))
        return tuple(one.contiguous().numpy() for one in found)

    return run


def export_finder(network: CellsNetwork) -> bytes:
    """A network of the finder as an ONNX file."""
    if isinstance(network, FinderNetwork):
        example = torch.rand(1, *CANVAS[::-1]) + 1, torch.tensor([[100.0, 100.0, 80.0, 60.0]])
        return traced("kpopnet finder", CellsOfImage(network), example, INPUTS, OUTPUT_NAMES).SerializeToString()
    size = (2, CROP_PX, CROP_PX)
    example = torch.rand(size) + 1, torch.randint(3, size, dtype=torch.uint8), torch.tensor([[0.0, 0.0, 2.0]] * 2)
    batch = ({0: torch.export.Dim("batch")},) * 3
    masked = traced("kpopnet masks", CellsOfCrops(network), example, masks.INPUTS, masks.OUTPUT_NAMES, dynamic_shapes=batch)
    return masked.SerializeToString()
