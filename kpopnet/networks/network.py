"""The networks: one encoder, and a head that is either `HolisticHead` or `DenseHead`.

All coordinates are cube units (kpopnet.data.cube); J = 15 joints. Every term of a loss is a mean over samples, so the loss of a
batch divided among processes is the mean over the processes.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpopnet.data.cube import INPUTS
from kpopnet.networks import STRIDES, ModelConfig
from kpopnet.skeleton import NUM_JOINTS

CONFIDENT_WITHIN_M = 0.10
"""Confidence is the estimated probability that the joint's error is below this, the paper's threshold for a correct joint."""

HUBER_DELTA = 0.02
"""Error in cube units (2.3 cm at the default half size) below which the loss of the joints is quadratic, else linear."""

GAUSSIAN_CELLS = 1.5
"""Standard deviation of the target heatmap in cells."""

CONFIDENCE_WEIGHT, HEATMAP_WEIGHT = 0.01, 0.01
NECK_CHANNELS = 48
Maps = tuple[Tensor, Tensor, Tensor]


class Prediction(NamedTuple):
    """Output of a network for a batch of crops."""

    joints: Tensor  # (B, 15, 3) u, v, d in cube units
    confidence_logit: Tensor  # (B, 15); its sigmoid is the confidence
    log_p: Tensor | None = None  # (B, 15, cells) logarithms of the heatmaps, of a dense network
    person_logit: Tensor | None = None  # (B,); its sigmoid is the probability that the crop shows a person, where it is judged

    @property
    def confidence(self) -> Tensor:
        """(B, 15) in 0..1: the estimated probability that the joint lies within 10 cm of the ground truth."""
        return torch.sigmoid(self.confidence_logit)


def confidence_loss(prediction: Prediction, target: Tensor, half_size_m: float) -> Tensor:
    """Binary cross-entropy between the confidence and whether this prediction is a hit.

    Trains only the confidence: neither the joints nor the features have a gradient, since the heads compute the logit from
    detached features. In three pairs of short trainings (600 steps, 1,000 held-out simulated images) the calibration error was
    0.041 with a gradient on the features and 0.032 without; the joints were equally good, the order of joints by confidence
    slightly worse (`risk_cm` 9.79 and 10.01).

    Augmentation scales the cube, and the threshold of a hit with it: to 9 to 11 cm at the default scale of 0.1.
    """
    error_m = (prediction.joints.detach() - target).norm(dim=-1) * half_size_m
    hit = (error_m < CONFIDENT_WITHIN_M).to(target.dtype)
    return CONFIDENCE_WEIGHT * functional.binary_cross_entropy_with_logits(prediction.confidence_logit, hit)


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
        # channels do not fill a vector register (4 with AVX2, 8 with AVX-512). Nor a slice, for which ONNX Runtime leaves its
        # layout of blocks of channels.
        strided = functional.max_pool2d(x, 1, self.stride) if self.stride > 1 else x
        return torch.relu_(self.second(torch.relu_(self.first(x))) + self.shortcut(strided))


class Encoder(nn.Module):
    """Maps (B, C, S, S) crops to three feature maps of S/4, S/8 and S/16 pixels with `widths[1:]` channels.

    Plain 3x3 residual blocks (He et al. 2016): on a CPU they are faster than depthwise and inverted-residual blocks of equal
    accuracy.
    """

    def __init__(self, channels: int, widths: tuple[int, int, int, int]) -> None:
        super().__init__()
        stem, fine, middle, coarse = widths
        self.stem = nn.Sequential(convolution(channels, stem, 5, stride=2), nn.ReLU(inplace=True))
        self.fine = nn.Sequential(Residual(stem, fine, 2), Residual(fine, fine))
        self.middle = nn.Sequential(Residual(fine, middle, 2), Residual(middle, middle), Residual(middle, middle))
        self.coarse = nn.Sequential(Residual(middle, coarse, 2), Residual(coarse, coarse), Residual(coarse, coarse))

    def forward(self, crop: Tensor) -> Maps:
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

    def forward(self, maps: Maps) -> Tensor:
        fine, middle, coarse = (lateral(x) for lateral, x in zip(self.laterals, maps, strict=True))
        return self.smooth(fine + self.up(middle + self.up(coarse)))  # (B, channels, S/4, S/4)


class HolisticHead(nn.Module):
    """The paper's class of network: regresses all joints at once from flattened features, by two fully connected layers.

    The paper takes its CNN from a technical report (its reference [9]), and only says that it regresses 3D joints from a
    synthetic depth image, with or without a ridge probability map as a second channel. This is a reconstruction of that class
    of network, not of that network. The encoder is that of the dense network, so that only the heads differ.
    """

    HIDDEN = 256

    def __init__(self, widths: tuple[int, int, int], crop_px: int) -> None:
        super().__init__()
        features = widths[-1] * (crop_px // STRIDES[-1]) ** 2
        self.layers = nn.Sequential(
            nn.Flatten(), nn.Linear(features, self.HIDDEN), nn.ReLU(), nn.Linear(self.HIDDEN, NUM_JOINTS * 4)
        )

    def forward(self, maps: Maps) -> Prediction:
        features, last = self.layers[:-1](maps[-1]), self.layers[-1]
        joints = last(features).view(-1, NUM_JOINTS, 4)[..., :3]
        # Detached: the confidence judges the features, and does not shape them (confidence_loss).
        logit = last(features.detach()).view(-1, NUM_JOINTS, 4)[..., 3]
        return Prediction(joints, logit)


@lru_cache(maxsize=8)
@torch.inference_mode(False)  # a tensor made in inference mode could not be trained with later
def grid(size: int, device: torch.device) -> Tensor:
    """(2, size * size) u and v of the centres of size x size cells over the crop, in row-major order."""
    centres = (torch.arange(size, device=device) + 0.5) * (2 / size) - 1
    v, u = torch.meshgrid(centres, centres, indexing="ij")
    return torch.stack([u.flatten(), v.flatten()])


class DenseHead(nn.Module):
    """Integral heatmaps (Sun et al. 2018) with attention-weighted depth.

    Heatmap H gives P = softmax(H) and (u, v) = sum P (u, v); attention A gives Q = softmax(H + A) and d = sum Q D. Q may have
    its mass elsewhere than P, so that the depth of an occluded wrist is not read from the torso in front of it. Two other
    dense heads, A2J's anchors and votes of body pixels, had larger errors on the same data (docs/ledger.md).
    """

    def __init__(self, widths: tuple[int, int, int], _crop_px: int) -> None:
        """The weights do not depend on the size of the crops."""
        super().__init__()
        self.neck = Neck(widths, NECK_CHANNELS)
        self.maps = nn.Conv2d(NECK_CHANNELS, NUM_JOINTS * 4, 1)

    def forward(self, maps: Maps) -> Prediction:
        features, joints = self.neck(maps), 3 * NUM_JOINTS
        weight, bias = self.maps.weight, self.maps.bias
        heat, attention, depth = functional.conv2d(features, weight[:joints], bias[:joints]).flatten(2).chunk(3, dim=1)
        # Detached: the confidence judges the features, and does not shape them (confidence_loss).
        confidence = functional.conv2d(features.detach(), weight[joints:], bias[joints:]).flatten(2)  # (B, J, cells)
        log_p = functional.log_softmax(heat, dim=-1)
        p = log_p.exp()
        q = torch.softmax(heat + attention, dim=-1)
        uv = p @ grid(features.shape[-1], features.device).T  # (B, J, 2)
        d = (q * depth).sum(-1, keepdim=True)
        logit = (p.detach() * confidence).sum(-1)
        return Prediction(torch.cat([uv, d], dim=-1), logit, log_p)


def heatmap_loss(log_p: Tensor, target: Tensor) -> Tensor:
    """Cross-entropy between heatmaps and Gaussians about the true joints."""
    size = math.isqrt(log_p.shape[-1])
    # (B, J, 2, cells) offsets to the joint in cells
    cells = (target[..., :2, None] - grid(size, target.device)) * (size / 2)
    truth = torch.softmax(-cells.square().sum(2) / (2 * GAUSSIAN_CELLS**2), dim=-1)
    return -HEATMAP_WEIGHT * (truth * log_p).sum(-1).mean()


class PersonHead(nn.Module):
    """Judges whether a crop shows a person at all: the second stage of a two-stage detector (Ren et al. 2015), whose first is
    the finder.

    Two layers on what a network that knows people sees in the crop, the mean and the maximum of its coarsest map and its
    joints' confidences. It is trained apart, by tools/fit_person.py, and shapes nothing else.
    """

    HIDDEN = 64

    def __init__(self, coarse: int) -> None:
        super().__init__()
        features = 2 * coarse + NUM_JOINTS
        self.layers = nn.Sequential(
            nn.BatchNorm1d(features, affine=False), nn.Linear(features, self.HIDDEN), nn.ReLU(), nn.Dropout(0.3),
            nn.Linear(self.HIDDEN, 1),
        )  # fmt: skip

    @staticmethod
    def features(coarse: Tensor, confidence_logit: Tensor) -> Tensor:
        return torch.cat([coarse.mean((2, 3)), coarse.amax((2, 3)), confidence_logit], 1)

    def forward(self, coarse: Tensor, confidence_logit: Tensor) -> Tensor:
        """(B,) logits from the (B, C, h, w) coarsest map and (B, 15)."""
        return self.layers(self.features(coarse, confidence_logit))[:, 0]


HEADS = {"holistic": HolisticHead, "dense": DenseHead}
"""By the name in ModelConfig.kind."""


class PoseNetwork(nn.Module):
    """Maps (B, C, S, S) crops to a `Prediction`."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        widths = tuple(config.widths)
        self.encoder = Encoder(INPUTS[config.input], widths)
        self.head = HEADS[config.kind](widths[1:], config.crop_px)
        self.person: PersonHead | None = None
        self.bfloat16 = False  # whether the encoder is trained in it on a CPU too; on GPUs it always is

    def forward(self, crop: Tensor) -> Prediction:
        # bfloat16 only for the encoder, in training; coordinates and their sums stay in float32.
        with torch.autocast(crop.device.type, torch.bfloat16, enabled=self.training and (crop.is_cuda or self.bfloat16)):
            maps = self.encoder(crop)
        seen = self.head(tuple(x.float() for x in maps))
        return seen if self.person is None else seen._replace(person_logit=self.person(maps[-1], seen.confidence_logit))

    def loss(self, prediction: Prediction, target: Tensor) -> dict[str, Tensor]:
        """The terms of the loss, by name; the loss is their sum."""
        terms = {"joints": functional.smooth_l1_loss(prediction.joints, target, beta=HUBER_DELTA)}
        if prediction.log_p is not None:
            terms["heatmap"] = heatmap_loss(prediction.log_p, target)
        return terms | {"confidence": confidence_loss(prediction, target, self.config.half_size_m)}


def build_network(config: ModelConfig, seed: int = 0) -> PoseNetwork:
    """Builds a network with random weights, a pure function of the arguments."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        # channels_last is a quarter faster on CPUs, and the preferred layout of tensor cores.
        return PoseNetwork(config).to(memory_format=torch.channels_last)
