"""A person found in a depth image: what every way of finding people answers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera

MARGIN_PX = 2
"""Empty pixels around a human in their box: the ridge needs them."""


class Look(NamedTuple):
    """What a network saw in one human's depth."""

    joints_camera_m: np.ndarray  # (15, 3) float32 joints, metres, NaN where missing
    confidence: np.ndarray  # (15,) float32, 0 where missing
    person_logit: float | None  # its sigmoid is the probability that the depth shows a person at all; None: not judged


@dataclass(frozen=True)
class Human:
    """One human in one image."""

    identity: int  # the same number for the same human in all images
    # x0, y0, x1, y1 in pixels, the last two exclusive; it includes MARGIN_PX empty pixels around the human, except at the image
    # border
    box: tuple[int, int, int, int]
    depth_m: np.ndarray  # (y1 - y0, x1 - x0) float32 metres, the depth of this human only, 0 elsewhere
    # (3,) float32 the human's middle, camera frame, metres: of the visible surface by Algorithm 1, the torso joint as the
    # finder estimates it
    centre_m: np.ndarray
    certainty: float = 1.0  # the probability that it is a human; 1 by Algorithm 1, which does not judge
    look: Look | None = None  # where a network has looked at it already

    @classmethod
    def cut_out(
        cls, identity: int, depth_m: np.ndarray, labels: np.ndarray, label: int, box: np.ndarray, centre_m: np.ndarray
    ) -> "Human":
        """The human whose pixels, in an (H, W) image in metres with an integer label for each pixel, have a label.

        The (4,) box is x0, y0, x1, y1 of these pixels, without a margin.
        """
        height, width = depth_m.shape
        x0, y0 = np.maximum(box[:2] - MARGIN_PX, 0).tolist()
        x1, y1 = np.minimum(box[2:] + MARGIN_PX, (width, height)).tolist()
        inside = np.s_[y0:y1, x0:x1]
        person_m = np.where(labels[inside] == label, depth_m[inside], np.float32(0))
        return cls(identity, (x0, y0, x1, y1), person_m, centre_m.copy())

    def whole(self, camera: Camera) -> np.ndarray:
        """(H, W) float32 metres: the full image with the depth of this human only, 0 elsewhere."""
        x0, y0, x1, y1 = self.box
        depth_m = np.zeros((camera.height, camera.width), np.float32)
        depth_m[y0:y1, x0:x1] = self.depth_m
        return depth_m

    def cropped(self, camera: Camera) -> Camera:
        """The camera of `depth_m`, given the camera of the full image."""
        x0, y0, x1, y1 = self.box
        return camera.cropped(x0, y0, x1 - x0, y1 - y0)


Looker = Callable[[Sequence[Human]], list[Look]]
"""Looks at what may be the humans of an image, at once."""
