"""A network: the encoder and one of the heads."""

import torch
from torch import Tensor, nn

from kpopnet.data.cube import INPUTS
from kpopnet.networks import ModelConfig
from kpopnet.networks.dense import DenseHead
from kpopnet.networks.encoder import Encoder
from kpopnet.networks.holistic import HolisticHead
from kpopnet.networks.losses import Prediction

HEADS = {"holistic": HolisticHead, "dense": DenseHead}
"""By the name in ModelConfig.kind."""


class PoseNetwork(nn.Module):
    """Maps (B, C, S, S) crops to a `Prediction`."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        widths = tuple(config.widths)
        self.encoder = Encoder(INPUTS[config.input], widths)
        self.head = HEADS[config.kind](widths[1:], config.crop_px, config.half_size_m)

    def forward(self, crop: Tensor) -> Prediction:
        # bfloat16 only for the convolutions on GPUs, where it is faster; coordinates and their sums stay in float32.
        with torch.autocast(crop.device.type, torch.bfloat16, enabled=crop.is_cuda and self.training):
            maps = self.encoder(crop)
        return self.head(tuple(x.float() for x in maps))


def build_network(config: ModelConfig, seed: int = 0) -> PoseNetwork:
    """Builds a network with random weights, a pure function of the arguments."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        # channels_last is a quarter faster on CPUs, and the preferred layout of tensor cores.
        return PoseNetwork(config).to(memory_format=torch.channels_last)
