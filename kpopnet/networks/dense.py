"""Heads that let places of the image vote on the joints, instead of regressing them from flattened features.

Each is the core of a published method, cut to one stage and a small encoder:

- `integral`: heatmaps whose expectation is (u, v) (Sun et al. 2018), with the depth attended where it can be read.
- `anchors`: anchor points that vote with weighted offsets, A2J (Xiong et al. 2019).
- `offsets`: body pixels that vote with weighted offsets from their own 3D position (as in AWR, Huang et al. 2020).

All coordinates are cube units (kpopnet.networks.cube); J = 15 joints.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpopnet.networks.encoder import STRIDES, Neck, convolution
from kpopnet.networks.losses import Prediction, confidence_loss, joints_loss
from kpopnet.skeleton import NUM_JOINTS

NECK_CHANNELS = 48


def grid(size: int) -> Tensor:
    """(2, size * size) u and v of the centres of size x size cells over the crop, rows first."""
    centres = (torch.arange(size) + 0.5) * (2 / size) - 1
    v, u = torch.meshgrid(centres, centres, indexing="ij")
    return torch.stack([u.flatten(), v.flatten()])


class IntegralHead(nn.Module):
    """Heatmap H gives P = softmax(H) and (u, v) = sum P (u, v); attention A gives Q = softmax(H + A) and d = sum Q D.

    Q may look away from P: the depth of a hidden wrist is not read from the torso in front of it.
    """

    GAUSSIAN_CELLS = 1.5
    HEATMAP_WEIGHT = 0.01

    def __init__(self, widths: tuple[int, int, int], crop_px: int, half_size_m: float) -> None:
        super().__init__()
        self.half_size_m = half_size_m
        self.size = crop_px // STRIDES[0]
        self.neck = Neck(widths, NECK_CHANNELS)
        self.maps = nn.Conv2d(NECK_CHANNELS, NUM_JOINTS * 4, 1)
        self.register_buffer("grid", grid(self.size), persistent=False)

    def forward(self, maps: tuple[Tensor, Tensor, Tensor], crop: Tensor) -> Prediction:
        heat, attention, depth, confidence = self.maps(self.neck(maps)).flatten(2).chunk(4, dim=1)  # (B, J, cells)
        log_p = functional.log_softmax(heat, dim=-1)
        p = log_p.exp()
        q = torch.softmax(heat + attention, dim=-1)
        uv = p @ self.grid.T  # (B, J, 2)
        d = (q * depth).sum(-1, keepdim=True)
        logit = (p.detach() * confidence).sum(-1)
        return Prediction(torch.cat([uv, d], dim=-1), logit, {"log_p": log_p})

    def loss(self, prediction: Prediction, target: Tensor) -> dict[str, Tensor]:
        """The terms to be added up, by name."""
        cells = (target[..., :2, None] - self.grid) * (self.size / 2)  # (B, J, 2, cells), from the joint, in cells
        truth = torch.softmax(-cells.square().sum(2) / (2 * self.GAUSSIAN_CELLS**2), dim=-1)
        return {
            "joints": joints_loss(prediction.joints, target),
            "heatmap": -self.HEATMAP_WEIGHT * (truth * prediction.maps["log_p"]).sum(-1).mean(),
            "confidence": confidence_loss(prediction, target, self.half_size_m),
        }


class AnchorHead(nn.Module):
    """2 x 2 anchors in every cell of the coarsest map; joint = sum softmax(w) (anchor + offset), without a neck."""

    PER_SIDE = 2
    HIDDEN = 96
    ANCHOR_WEIGHT = 0.3

    def __init__(self, widths: tuple[int, int, int], crop_px: int, half_size_m: float) -> None:
        super().__init__()
        self.half_size_m = half_size_m
        per_cell = self.PER_SIDE**2
        self.weights = self._branch(widths[-1], per_cell * NUM_JOINTS * 2)
        self.offsets = self._branch(widths[-1], per_cell * NUM_JOINTS * 3)
        anchors = grid(crop_px // STRIDES[-1] * self.PER_SIDE)
        self.register_buffer("anchors", functional.pad(anchors, (0, 0, 0, 1)), persistent=False)  # (3, anchors), d = 0

    def _branch(self, inputs: int, outputs: int) -> nn.Sequential:
        return nn.Sequential(convolution(inputs, self.HIDDEN, 3), nn.ReLU(inplace=True), nn.Conv2d(self.HIDDEN, outputs, 1))

    def forward(self, maps: tuple[Tensor, Tensor, Tensor], crop: Tensor) -> Prediction:
        weights, confidence = self._spread(self.weights(maps[-1]), 2).unbind(2)  # (B, J, anchors)
        offsets = self._spread(self.offsets(maps[-1]), 3)  # (B, J, 3, anchors)
        p = torch.softmax(weights, dim=-1)
        attended = p @ self.anchors.T  # (B, J, 3)
        joints = attended + (offsets @ p[..., None]).squeeze(-1)
        return Prediction(joints, (p.detach() * confidence).sum(-1), {"anchor_uv": attended[..., :2]})

    def _spread(self, maps: Tensor, values: int) -> Tensor:
        """(B, J * values * 4, n, n) to (B, J, values, 2n * 2n), each cell's four channels being its 2 x 2 anchors."""
        return functional.pixel_shuffle(maps, self.PER_SIDE).flatten(2).view(len(maps), NUM_JOINTS, values, -1)

    def loss(self, prediction: Prediction, target: Tensor) -> dict[str, Tensor]:
        """The terms to be added up, by name."""
        return {
            "joints": joints_loss(prediction.joints, target),
            "anchors": self.ANCHOR_WEIGHT * joints_loss(prediction.maps["anchor_uv"], target[..., :2]),
            "confidence": confidence_loss(prediction, target, self.half_size_m),
        }


class OffsetHead(nn.Module):
    """Every body cell votes from its own 3D position: joint = sum softmax(w) (base + offset), over body cells only."""

    NEAR = 0.4
    DENSE_WEIGHT = 0.3

    def __init__(self, widths: tuple[int, int, int], crop_px: int, half_size_m: float) -> None:
        super().__init__()
        self.half_size_m = half_size_m
        self.neck = Neck(widths, NECK_CHANNELS)
        self.maps = nn.Conv2d(NECK_CHANNELS, NUM_JOINTS * 5, 1)
        self.register_buffer("grid", grid(crop_px // STRIDES[0]), persistent=False)

    def forward(self, maps: tuple[Tensor, Tensor, Tensor], crop: Tensor) -> Prediction:
        values = self.maps(self.neck(maps)).flatten(2).view(len(crop), NUM_JOINTS, 5, -1)
        d = -functional.max_pool2d(-crop[:, :1], STRIDES[0]).flatten(2)  # (B, 1, cells), of the nearest surface
        body = d < 1
        base = torch.cat([self.grid.expand(len(crop), -1, -1), d], dim=1)  # (B, 3, cells)
        votes = base[:, None] + values[:, :, :3]  # (B, J, 3, cells)
        # Finite, so that a crop without a body gives a uniform softmax and not NaN.
        p = torch.softmax(values[:, :, 3].masked_fill(~body, -1e4), dim=-1)
        joints = (votes @ p[..., None]).squeeze(-1)
        logit = (p.detach() * values[:, :, 4]).sum(-1)
        return Prediction(joints, logit, {"votes": votes, "base": base, "body": body})

    def loss(self, prediction: Prediction, target: Tensor) -> dict[str, Tensor]:
        """The terms to be added up, by name."""
        votes, base, body = (prediction.maps[name] for name in ("votes", "base", "body"))
        near = body & ((base[:, None] - target[..., None]).norm(dim=2) < self.NEAR)  # (B, J, cells)
        wrong = functional.smooth_l1_loss(votes, target[..., None].expand_as(votes), beta=0.02, reduction="none").mean(2)
        dense = (wrong * near).sum((1, 2)) / near.sum((1, 2)).clamp_min(1)
        return {
            "joints": joints_loss(prediction.joints, target),
            "votes": self.DENSE_WEIGHT * dense.mean(),
            "confidence": confidence_loss(prediction, target, self.half_size_m),
        }


DENSE_HEADS = {"integral": IntegralHead, "anchors": AnchorHead, "offsets": OffsetHead}
