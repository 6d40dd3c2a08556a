"""Networks that estimate fifteen 3D joints from a depth crop of one person: `holistic` and `dense`.

Both go the same way:

    crop (kpopnet.networks.cube) -> encoder -> head -> joints in cube units, confidence
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from kpopnet.errors import InputError
from kpopnet.networks.dense import DenseHead
from kpopnet.networks.encoder import STRIDES, Encoder
from kpopnet.networks.holistic import HolisticHead
from kpopnet.networks.losses import Prediction

HEADS = {"holistic": HolisticHead, "dense": DenseHead}
INPUTS = {"depth": 1, "depth_ridge": 2}
"""The crop's channels by the name of the input."""


@dataclass
class ModelConfig:
    """What a network looks like; all that is needed to build it again.

    Attributes:
        kind: holistic (flatten and fully connected layers) or dense (places vote on the joints).
        input: depth, or depth_ridge for the ridge probability as a second channel.
        crop_px: side of the square crop, a multiple of 16.
        half_size_m: half the edge of the cube around the person.
        widths: the encoder's channels: stem, stride 4, stride 8, stride 16.
    """

    kind: str = "dense"
    input: str = "depth"
    crop_px: int = 96
    half_size_m: float = 1.15
    widths: list[int] = field(default_factory=lambda: [16, 32, 64, 128])

    def __post_init__(self) -> None:
        for name, found, known in (
            ("kind", self.kind, tuple(HEADS)),
            ("input", self.input, tuple(INPUTS)),
        ):
            if found not in known:
                raise InputError(f"model.{name}={found}: expected one of {', '.join(known)}")
        if self.crop_px < 32 or self.crop_px % STRIDES[-1]:
            raise InputError(f"model.crop_px={self.crop_px}: expected a multiple of {STRIDES[-1]}, at least 32")
        if not 0.5 <= self.half_size_m <= 5:
            raise InputError(f"model.half_size_m={self.half_size_m}: expected metres, 0.5 to 5")
        # Multiples of 8 fill vector registers.
        if len(self.widths) != 4 or min(self.widths) < 8 or any(width % 8 for width in self.widths):
            raise InputError(f"model.widths={self.widths}: expected four multiples of 8, e.g. [16,32,64,128]")

    @property
    def name(self) -> str:
        """Short, for folders and tables."""
        return f"{self.kind}-{self.input}"


class PoseNetwork(nn.Module):
    """(B, C, S, S) crops to `Prediction`."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        widths = tuple(config.widths)
        self.encoder = Encoder(INPUTS[config.input], widths)
        self.head = HEADS[config.kind](widths[1:], config.crop_px, config.half_size_m)

    def forward(self, crop: Tensor) -> Prediction:
        # bfloat16 for the convolutions where it pays, never for coordinates and their sums.
        with torch.autocast(crop.device.type, torch.bfloat16, enabled=crop.is_cuda and self.training):
            maps = self.encoder(crop)
        return self.head(tuple(x.float() for x in maps))


def build_network(config: ModelConfig, seed: int = 0) -> PoseNetwork:
    """A network with fresh weights, a pure function of its arguments."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        # channels_last: a quarter faster on CPUs, and what tensor cores want.
        return PoseNetwork(config).to(memory_format=torch.channels_last)
