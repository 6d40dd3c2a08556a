"""Holistic head, the paper's class of network: a CNN that regresses all joints at once from flattened features.

The paper takes its CNN from a technical report (its reference [9]). It only says that this CNN regresses 3D joints from a
synthetic depth image, with or without a ridge probability map as a second channel. This is a reconstruction of that class
of network, not of that network: convolutions, flatten, two fully connected layers. The encoder is that of the dense
network, so that the two differ only in how joints are computed from the features.
"""

from torch import Tensor, nn

from kpopnet.networks import STRIDES
from kpopnet.networks.losses import Prediction, confidence_loss, joints_loss
from kpopnet.skeleton import NUM_JOINTS


class HolisticHead(nn.Module):
    """Flattened features, one hidden layer, and 15 x (u, v, d, confidence)."""

    HIDDEN = 256

    def __init__(self, widths: tuple[int, int, int], crop_px: int, half_size_m: float) -> None:
        super().__init__()
        self.half_size_m = half_size_m
        features = widths[-1] * (crop_px // STRIDES[-1]) ** 2
        self.layers = nn.Sequential(
            nn.Flatten(), nn.Linear(features, self.HIDDEN), nn.ReLU(), nn.Linear(self.HIDDEN, NUM_JOINTS * 4)
        )

    def forward(self, maps: tuple[Tensor, Tensor, Tensor]) -> Prediction:
        features, last = self.layers[:-1](maps[-1]), self.layers[-1]
        joints = last(features).view(-1, NUM_JOINTS, 4)[..., :3]
        # Detached: the confidence judges the features, and does not shape them (losses.confidence_loss).
        logit = last(features.detach()).view(-1, NUM_JOINTS, 4)[..., 3]
        return Prediction(joints, logit, {})

    def loss(self, prediction: Prediction, target: Tensor) -> dict[str, Tensor]:
        """The terms of the loss, by name; the loss is their sum."""
        return {
            "joints": joints_loss(prediction.joints, target),
            "confidence": confidence_loss(prediction, target, self.half_size_m),
        }
