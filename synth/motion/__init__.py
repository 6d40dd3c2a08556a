"""Where poses and motions come from: recorded clips, composed dances, made poses, or a mixture.

Sources speak the canonical skeleton (`skeleton`). Made poses and dances are written in anatomical angles (`posture`),
dances further in a language of moves (`moves`, `vocabulary`) that is put on the floor by `stage`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from kpopnet.errors import InputError
from synth.motion.choreography import Choreography
from synth.motion.clips import open_clips
from synth.motion.poses import MadePoses
from synth.motion.skeleton import Motion, Poses

__all__ = ["SPLITS", "MixedPoses", "Motion", "MotionConfig", "MotionSource", "Poses", "SequenceSource", "build_motion"]


class MotionSource(Protocol):
    """Gives single poses."""

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """One pose for each generator; pose k depends on generator k alone, which may be used again."""
        ...


@runtime_checkable
class SequenceSource(MotionSource, Protocol):
    """Gives sequences too."""

    def __len__(self) -> int: ...

    def motion(self, index: int) -> Motion:
        """Sequence number `index`."""
        ...


SPLITS = ("train", "validation", "test")


@dataclass(frozen=True)
class MotionConfig:
    """Which motion to take.

    Attributes:
        source: clips, choreography, poses or mix.
        path: For clips: a motion pack, a BVH file or a folder of BVH files.
        fps: For BVH files that state a wrong rate, the true one; for dances, the rate to make them at (30).
        dances: For choreography: how many dances there are.
        seconds: For choreography: the length of each.
        seed: For choreography: the seed of the collection.
        weights: For mix: source to its relative share of the poses.
    """

    source: str = "mix"
    path: str | None = None
    fps: float | None = None
    dances: int = 100
    seconds: float = 20.0
    seed: int = 0
    weights: dict[str, float] = field(default_factory=lambda: {"poses": 0.8, "choreography": 0.2})

    def __post_init__(self) -> None:
        if self.source not in _SOURCES:
            raise InputError(f"motion.source={self.source} is not one of {', '.join(_SOURCES)}")
        if self.source == "clips" and self.path is None:
            raise InputError(
                "motion.source=clips needs motion.path=<motion pack or BVH files>; motion=choreography needs no data"
            )
        if self.fps is not None and not 1 <= self.fps < math.inf:
            raise InputError(f"motion.fps={self.fps} is no frame rate; leave it out or give at least 1")
        if self.dances < 1:
            raise InputError(f"motion.dances={self.dances}: expected at least 1")
        if not 1 <= self.seconds < math.inf:
            raise InputError(f"motion.seconds={self.seconds}: a dance lasts at least a second")
        if self.source == "mix":
            unknown = set(self.weights) - (set(_SOURCES) - {"mix"})
            if unknown or not self.weights or min(self.weights.values()) < 0 or sum(self.weights.values()) <= 0:
                raise InputError(
                    f"motion.weights={self.weights}: expected shares >= 0, not all 0, of clips, choreography and poses"
                )
            if self.weights.get("clips", 0) > 0 and self.path is None:
                raise InputError("motion.weights gives clips a share: set motion.path, or motion.weights.clips=0")


class MixedPoses:
    """Draws each pose from one of several sources, by weight."""

    def __init__(self, sources: Sequence[MotionSource], weights: Sequence[float]) -> None:
        self._sources = list(sources)
        self._thresholds = (np.cumsum(weights) / np.sum(weights))[:-1]

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """One pose for each generator, from the source that the generator's first draw chooses."""
        chosen = np.array([np.searchsorted(self._thresholds, g.random(), side="right") for g in generators], int)
        parts, order = [], []
        for number, source in enumerate(self._sources):
            mine = np.flatnonzero(chosen == number)
            if len(mine):
                parts.append(source.poses([generators[i] for i in mine]))
                order.extend(mine)
        back = np.argsort(order)
        names = [name for part in parts for name in part.names]
        quats, root_m, leg_m = (
            np.concatenate([getattr(p, a) for p in parts])[back] for a in ("quats", "root_m", "leg_m")
        )
        return Poses(quats, root_m, leg_m, [names[i] for i in back])


def _clips(config: MotionConfig, split: str) -> MotionSource:
    return open_clips(config.path, split, config.fps)


def _choreography(config: MotionConfig, split: str) -> MotionSource:
    # Each split is a stream of seeds of its own.
    seed = len(SPLITS) * config.seed + SPLITS.index(split)
    return Choreography(config.dances, seed, config.seconds, config.fps or 30.0)


def _poses(config: MotionConfig, split: str) -> MotionSource:
    return MadePoses()


def _mix(config: MotionConfig, split: str) -> MotionSource:
    weights = {name: weight for name, weight in config.weights.items() if weight > 0}
    return MixedPoses([_SOURCES[name](config, split) for name in weights], list(weights.values()))


_SOURCES = {"clips": _clips, "choreography": _choreography, "poses": _poses, "mix": _mix}


def build_motion(config: MotionConfig, split: str) -> MotionSource:
    """The source that a config names, for train, validation or test. Clips and choreography are `SequenceSource`s.

    Packs are split by their index, which keeps subjects apart; a folder of BVH files by file, if it holds enough; dances
    by their seeds. Made poses are drawn anew each time and have no split.

    Raises:
        InputError: an unknown split.
    """
    if split not in SPLITS:
        raise InputError(f"split={split} is not one of {', '.join(SPLITS)}")
    return _SOURCES[config.source](config, split)
