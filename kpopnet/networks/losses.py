"""What the networks' heads predict, and the two loss terms that all of them share.

Every term is a mean over samples of something computed within one sample, so that the mean over processes of a batch
dealt out among them is the loss of the whole batch.
"""

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

CONFIDENT_WITHIN_M = 0.10
"""Confidence is the estimated probability that the joint's error is below this, the paper's threshold of a hit."""

SMOOTH_BELOW = 0.02
"""Cube units (2.3 cm at the default half size) below which the joints' loss turns from linear to quadratic."""

CONFIDENCE_WEIGHT = 0.01


class Prediction(NamedTuple):
    """What a network says of a batch of crops.

    Attributes:
        joints: (B, 15, 3) u, v, d in cube units (kpopnet.networks.cube).
        confidence_logit: (B, 15); its sigmoid is the confidence.
        maps: what the head's own loss needs besides, by name.
    """

    joints: Tensor
    confidence_logit: Tensor
    maps: dict[str, Tensor]

    @property
    def confidence(self) -> Tensor:
        """(B, 15) in 0..1: the estimated probability that the joint lies within 10 cm of the truth."""
        return torch.sigmoid(self.confidence_logit)


def joints_loss(joints: Tensor, target: Tensor) -> Tensor:
    """Smooth L1 (Huber over `SMOOTH_BELOW`), the mean over all coordinates."""
    return functional.smooth_l1_loss(joints, target, beta=SMOOTH_BELOW)


def confidence_loss(prediction: Prediction, target: Tensor, half_size_m: float) -> Tensor:
    """Binary cross-entropy of the confidence with whether this very prediction is a hit; trains only the confidence.

    In a cube that augmentation has scaled a hit lies within 9 to 11 cm, as the cube is.
    """
    error_m = (prediction.joints.detach() - target).norm(dim=-1) * half_size_m
    hit = (error_m < CONFIDENT_WITHIN_M).to(target.dtype)
    return CONFIDENCE_WEIGHT * functional.binary_cross_entropy_with_logits(prediction.confidence_logit, hit)
