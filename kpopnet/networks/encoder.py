"""The convolutional encoder of all networks, and the neck that combines its maps at a quarter of the crop's resolution.

Plain 3x3 residual blocks (He et al. 2016): on a CPU they are faster than depthwise and inverted-residual blocks of equal
accuracy.
"""

import torch
from torch import Tensor, nn


def convolution(inputs: int, outputs: int, kernel: int, stride: int = 1) -> nn.Sequential:
    """A convolution without bias, followed by batch normalisation."""
    return nn.Sequential(nn.Conv2d(inputs, outputs, kernel, stride, padding=kernel // 2, bias=False), nn.BatchNorm2d(outputs))


class Residual(nn.Module):
    """conv3x3-BN-ReLU-conv3x3-BN plus a shortcut (conv1x1-BN where the shape changes), then ReLU."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.first = convolution(inputs, outputs, 3, stride)
        self.second = convolution(outputs, outputs, 3)
        same = inputs == outputs and stride == 1
        self.stride = stride
        self.shortcut = nn.Identity() if same else convolution(inputs, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        # Not a strided 1x1 convolution: its backward pass in channels_last writes out of bounds in torch 2.13 if the
        # channels do not fill a vector register (4 with AVX2, 8 with AVX-512).
        strided = x[:, :, :: self.stride, :: self.stride] if self.stride > 1 else x
        return torch.relu_(self.second(torch.relu_(self.first(x))) + self.shortcut(strided))


class Encoder(nn.Module):
    """Maps (B, C, S, S) crops to three feature maps of S/4, S/8 and S/16 pixels with `widths[1:]` channels."""

    def __init__(self, channels: int, widths: tuple[int, int, int, int]) -> None:
        super().__init__()
        stem, fine, middle, coarse = widths
        self.stem = nn.Sequential(convolution(channels, stem, 5, stride=2), nn.ReLU(inplace=True))
        self.fine = nn.Sequential(Residual(stem, fine, 2), Residual(fine, fine))
        self.middle = nn.Sequential(Residual(fine, middle, 2), Residual(middle, middle), Residual(middle, middle))
        self.coarse = nn.Sequential(Residual(middle, coarse, 2), Residual(coarse, coarse), Residual(coarse, coarse))

    def forward(self, crop: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        fine = self.fine(self.stem(crop))
        middle = self.middle(fine)
        return fine, middle, self.coarse(middle)


class Neck(nn.Module):
    """Sums the three maps at stride 4 (feature pyramid of Lin et al. 2017, without its last 3x3 at the coarser levels)."""

    def __init__(self, widths: tuple[int, int, int], channels: int) -> None:
        super().__init__()
        self.laterals = nn.ModuleList(nn.Conv2d(width, channels, 1) for width in widths)
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        self.smooth = nn.Sequential(convolution(channels, channels, 3), nn.ReLU(inplace=True))

    def forward(self, maps: tuple[Tensor, Tensor, Tensor]) -> Tensor:
        fine, middle, coarse = (lateral(x) for lateral, x in zip(self.laterals, maps, strict=True))
        return self.smooth(fine + self.up(middle + self.up(coarse)))  # (B, channels, S/4, S/4)
