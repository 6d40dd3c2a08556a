"""What stays of a depth camera's noise from frame to frame of a film.

Structured light: the projected pattern does not move, so the errors of its matching stay where a surface stays; in
recordings of UTD-MHAD (real Kinect v1) a still body's picture keeps its grain for seconds. Calibration does not change
within a film either, and holes last for more than a frame. Time of flight has independent noise in every frame.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

HOLE_FRAMES = 2
"""Frames for which a hole lasts. Of the pixels of a real hole of 5 to 15 pixels 57 % are still lost in the next frame."""


class FilmFrame(NamedTuple):
    """What a frame shares with other frames of its film."""

    key: np.uint64  # uint64 key of the film's grain
    gain: float  # standard normal deviate of the gain
    dropout: float  # uniform deviate of the fraction of lost pixels
    holes: tuple[np.random.Generator, ...]  # generators of the holes that the frame shows, each of an equal share


@dataclass(frozen=True)
class FilmNoise:
    """The noise of a film, any frame of which can be drawn by itself. No other film's seed begins with its seed."""

    seed: tuple[int, ...]

    @cached_property
    def _shared_by_all(self) -> tuple[np.uint64, float, float]:
        rng = np.random.default_rng([*self.seed, 0])
        return rng.integers(2**64, dtype=np.uint64), rng.standard_normal(), rng.random()

    def frame(self, number: int) -> tuple[np.random.Generator, FilmFrame]:
        """The generator of a frame's own noise, and what it shares with others; the number is at least 0."""
        holes = tuple(np.random.default_rng([*self.seed, 1, number + age]) for age in range(HOLE_FRAMES))
        return np.random.default_rng([*self.seed, 2, number]), FilmFrame(*self._shared_by_all, holes)
