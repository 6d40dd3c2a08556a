"""Dense head: integral heatmaps (Sun et al. 2018) with attention-weighted depth, instead of regression from flattened features.

One stage on a small encoder. Two other dense heads, A2J's anchors and votes of body pixels, had larger errors on the same
data (docs/ledger.md).

All coordinates are cube units (kpopnet.data.cube); J = 15 joints.
"""

import math
from functools import lru_cache

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpopnet.networks.encoder import Neck
from kpopnet.networks.losses import Prediction, confidence_loss, joints_loss
from kpopnet.skeleton import NUM_JOINTS

NECK_CHANNELS = 48


@lru_cache(maxsize=8)
@torch.inference_mode(False)  # a tensor made in inference mode could not be trained with later
def grid(size: int, device: torch.device) -> Tensor:
    """(2, size * size) u and v of the centres of size x size cells over the crop, in row-major order."""
    centres = (torch.arange(size, device=device) + 0.5) * (2 / size) - 1
    v, u = torch.meshgrid(centres, centres, indexing="ij")
    return torch.stack([u.flatten(), v.flatten()])


class DenseHead(nn.Module):
    """Heatmap H gives P = softmax(H) and (u, v) = sum P (u, v); attention A gives Q = softmax(H + A) and d = sum Q D.

    Q may have its mass elsewhere than P, so that the depth of an occluded wrist is not read from the torso in front of it.
    """

    GAUSSIAN_CELLS = 1.5
    """Standard deviation of the target heatmap in cells."""

    HEATMAP_WEIGHT = 0.01

    def __init__(self, widths: tuple[int, int, int], _crop_px: int, half_size_m: float) -> None:
        """The weights do not depend on the size of the crops."""
        super().__init__()
        self.half_size_m = half_size_m
        self.neck = Neck(widths, NECK_CHANNELS)
        self.maps = nn.Conv2d(NECK_CHANNELS, NUM_JOINTS * 4, 1)

    def forward(self, maps: tuple[Tensor, Tensor, Tensor]) -> Prediction:
        features, joints = self.neck(maps), 3 * NUM_JOINTS
        weight, bias = self.maps.weight, self.maps.bias
        heat, attention, depth = functional.conv2d(features, weight[:joints], bias[:joints]).flatten(2).chunk(3, dim=1)
        # Detached: the confidence judges the features, and does not shape them (losses.confidence_loss).
        confidence = functional.conv2d(features.detach(), weight[joints:], bias[joints:]).flatten(2)  # (B, J, cells)
        log_p = functional.log_softmax(heat, dim=-1)
        p = log_p.exp()
        q = torch.softmax(heat + attention, dim=-1)
        uv = p @ grid(features.shape[-1], features.device).T  # (B, J, 2)
        d = (q * depth).sum(-1, keepdim=True)
        logit = (p.detach() * confidence).sum(-1)
        return Prediction(torch.cat([uv, d], dim=-1), logit, {"log_p": log_p})

    def loss(self, prediction: Prediction, target: Tensor) -> dict[str, Tensor]:
        """The terms of the loss, by name; the loss is their sum."""
        log_p = prediction.maps["log_p"]
        size = math.isqrt(log_p.shape[-1])
        cells = (target[..., :2, None] - grid(size, target.device)) * (
            size / 2
        )  # (B, J, 2, cells) offsets to the joint in cells
        truth = torch.softmax(-cells.square().sum(2) / (2 * self.GAUSSIAN_CELLS**2), dim=-1)
        return {
            "joints": joints_loss(prediction.joints, target),
            "heatmap": -self.HEATMAP_WEIGHT * (truth * log_p).sum(-1).mean(),
            "confidence": confidence_loss(prediction, target, self.half_size_m),
        }
