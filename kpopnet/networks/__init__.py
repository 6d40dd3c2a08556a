"""Networks that estimate fifteen 3D joints from a depth crop of one person: `holistic` and `dense`.

crop (kpopnet.data.cube) -> encoder -> head -> joints in cube units, confidence

`network` builds them with torch, `estimator` runs them; this module, the estimator and ONNX files need no torch.
"""

from dataclasses import dataclass, field

from kpopnet.data.cube import INPUTS
from kpopnet.errors import InputError

KINDS = ("holistic", "dense")

STRIDES = (4, 8, 16)
"""Strides of the encoder's three outputs in crop pixels."""

BATCH = 32
"""Crops that a network is run on at once, in prediction."""

MAX_CROP_PX, MAX_WIDTH = 256, 512
"""A checkpoint's description chooses these sizes: they bound the weights to 0.3 GB, and a batch's maps to a few."""


@dataclass
class ModelConfig:
    """The architecture of a network.

    Attributes:
        kind: holistic (flattened features and fully connected layers) or dense (integral heatmaps).
        input: depth, or depth_ridge for the ridge probability as a second channel.
        crop_px: side of the square crop in pixels, a multiple of 16, at most 256.
        half_size_m: half the edge of the cube around the person in metres.
        widths: number of the encoder's channels: stem, stride 4, stride 8, stride 16; at most 512.
    """

    kind: str = "dense"
    input: str = "depth"
    crop_px: int = 96
    half_size_m: float = 1.15
    widths: list[int] = field(default_factory=lambda: [16, 32, 64, 128])

    def __post_init__(self) -> None:
        for name, found, known in (
            ("kind", self.kind, KINDS),
            ("input", self.input, tuple(INPUTS)),
        ):
            if found not in known:
                raise InputError(f"model.{name}={found}: expected one of {', '.join(known)}")
        if not 32 <= self.crop_px <= MAX_CROP_PX or self.crop_px % STRIDES[-1]:
            raise InputError(f"model.crop_px={self.crop_px}: expected a multiple of {STRIDES[-1]}, 32 to {MAX_CROP_PX}")
        if not 0.5 <= self.half_size_m <= 5:
            raise InputError(f"model.half_size_m={self.half_size_m}: expected metres, 0.5 to 5")
        # Multiples of 8 fill vector registers.
        if len(self.widths) != 4 or any(not 8 <= width <= MAX_WIDTH or width % 8 for width in self.widths):
            raise InputError(
                f"model.widths={str(self.widths)[:60]}: expected four multiples of 8 up to {MAX_WIDTH}, e.g. [16,32,64,128]"
            )

    @property
    def name(self) -> str:
        """Short name, for folders and tables."""
        return f"{self.kind}-{self.input}"
