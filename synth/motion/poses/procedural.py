"""Procedural single poses for training images: families drawn by weight, converted to rotations, placed on the floor."""

from collections.abc import Callable, Sequence

import numpy as np

from synth.motion.limbs import Angles
from synth.motion.poses.families import FAMILIES
from synth.motion.posture import CHANNELS, angles, limited, rotations
from synth.motion.skeleton import LEG_M, Poses, height_above_floor

_JITTER_DEG = 2.5
"""Standard deviation of the noise added to every angle, so that no tabulated pose occurs twice."""


class ProceduralPoses:
    """A motion source that draws poses from families by weight."""

    def __init__(self, families: dict[str, tuple[float, Callable[[np.random.Generator], Angles]]] = FAMILIES) -> None:
        self._names = tuple(families)
        self._families = tuple(family for _, family in families.values())
        weights = np.array([weight for weight, _ in families.values()])
        self._thresholds = (np.cumsum(weights) / weights.sum())[:-1]

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """Draws one pose per generator; pose k depends only on generator k."""
        chosen = [int(np.searchsorted(self._thresholds, g.random(), side="right")) for g in generators]
        return self._build(chosen, generators)

    def family(self, name: str, generators: Sequence[np.random.Generator]) -> Poses:
        """Draws one pose of the named family per generator."""
        return self._build([self._names.index(name)] * len(generators), generators)

    def _build(self, chosen: list[int], generators: Sequence[np.random.Generator]) -> Poses:
        postures = np.empty((len(chosen), len(CHANNELS)))
        for row, family, generator in zip(postures, chosen, generators, strict=True):
            row[:] = angles(**self._families[family](generator))
            row += _JITTER_DEG * generator.standard_normal(len(row))
        quats = rotations(limited(postures))
        root_m = np.zeros((len(quats), 3), np.float32)
        root_m[:, 1] = -height_above_floor(quats, root_m)
        names = [f"pose:{self._names[family]}" for family in chosen]
        return Poses(quats, root_m, np.full(len(quats), LEG_M, np.float32), names)
