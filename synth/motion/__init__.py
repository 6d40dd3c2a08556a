"""Sources of poses and motions: recorded clips, composed dances, procedural poses, or a mixture.

Every source returns rotations of the canonical skeleton (`skeleton`). Procedural poses and dances are defined by
anatomical angles (`posture`). Dances are sequences of moves (`choreography.moves`, `choreography.vocabulary`), which
`choreography.stage` turns into motions with foot contacts.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from kpopnet.errors import InputError, check_between, check_one_of, check_seed
from synth.motion.choreography.composer import Choreography
from synth.motion.poses import ProceduralPoses
from synth.motion.recorded import bvh_digest, open_clips
from synth.motion.skeleton import Poses

__all__ = ["SPLITS", "MixedPoses", "MotionConfig", "MotionSource", "Poses", "build_motion", "identity_of_recordings"]


class MotionSource(Protocol):
    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """Draws one pose per generator. Pose k depends only on generator k; a generator may be used again."""
        ...


SPLITS = ("train", "validation", "test")
SOURCES = ("clips", "choreography", "poses", "mix")


@dataclass(frozen=True)
class MotionConfig:
    """The source of motion.

    Attributes:
        source: clips, choreography, poses or mix.
        path: for clips: a motion pack, a BVH file or a folder of BVH files.
        fps: for clips: the true rate of BVH files that state a wrong one, frames per second; None takes the files' rate.
        dances: for choreography: number of dances.
        seconds: for choreography: length of each dance, seconds.
        seed: for choreography: seed of the collection.
        weights: for mix: relative number of poses from each source.
    """

    source: str = "mix"
    path: str | None = None
    fps: float | None = None
    dances: int = 100
    seconds: float = 20.0
    seed: int = 0
    weights: dict[str, float] = field(default_factory=lambda: {"poses": 0.8, "choreography": 0.2})

    def __post_init__(self) -> None:
        check_one_of("motion.source", self.source, SOURCES)
        if self.source == "clips" and self.path is None:
            raise InputError("motion.source=clips needs motion.path=PACK_OR_BVH_FILES; motion=choreography needs no data")
        if self.fps is not None:
            check_between("motion.fps", self.fps, 1, 1000)
            if self.path is None:
                raise InputError(f"motion.fps={self.fps}: the rate of BVH files; give them as motion.path, or leave it out")
        check_seed("motion.seed", self.seed)
        check_between("motion.dances", self.dances, 1, 1e6)
        check_between("motion.seconds", self.seconds, 1, 3600)
        if self.source == "mix":
            known, weights = set(SOURCES) - {"mix"}, self.weights.values()
            if not (set(self.weights) <= known and all(0 <= one < math.inf for one in weights) and 0 < sum(weights) < math.inf):
                raise InputError(
                    f"motion.weights={self.weights}: expected weights >= 0, not all 0, of clips, choreography and poses"
                )
            if self.weights.get("clips", 0) > 0 and self.path is None:
                raise InputError("motion.weights.clips is above 0: set motion.path, or motion.weights.clips=0")
        if self.path is not None and not self.uses_clips:
            raise InputError(
                f"motion.path={self.path}: no motion would be taken from it; choose motion=clips, or motion=mix with a weight, "
                "motion.weights.clips=0.5"
            )

    @property
    def uses_clips(self) -> bool:
        """Whether motions are taken from recordings."""
        return self.source == "clips" or (self.source == "mix" and self.weights.get("clips", 0) > 0)


class MixedPoses:
    """Draws each pose from one of several sources, by weight."""

    def __init__(self, sources: Sequence[MotionSource], weights: Sequence[float]) -> None:
        self._sources = list(sources)
        self._thresholds = (np.cumsum(weights) / np.sum(weights))[:-1]

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """Draws one pose per generator. The generator's first random number selects the source."""
        chosen = np.array([np.searchsorted(self._thresholds, g.random(), side="right") for g in generators], int)
        parts, order = [], []
        for number, source in enumerate(self._sources):
            rows = np.flatnonzero(chosen == number)
            if len(rows):
                parts.append(source.poses([generators[i] for i in rows]))
                order.extend(rows)
        inverse, drawn = np.argsort(order), Poses.joined(parts)
        names = [drawn.names[i] for i in inverse]
        return Poses(drawn.quats[inverse], drawn.root_m[inverse], drawn.leg_m[inverse], names)


def identity_of_recordings(config: MotionConfig) -> dict[str, str]:
    """What says, beside its path, which BVH files a config uses, for the identity of a set.

    Empty without any. It is empty for a motion pack too, of whose sets on disk the path alone is the identity.
    """
    digest = bvh_digest(config.path) if config.uses_clips and config.path is not None else None
    return {} if digest is None else {"bvh_files": digest}


def build_motion(config: MotionConfig, split: str) -> MotionSource:
    """Builds the source that a config names, for the split train, validation or test.

    Clips and choreography also give whole sequences: len(source) of them, by source.motion(index). Motion packs are split by
    their index, so that no subject is in two splits; a folder of BVH files is split by the files' names, if it holds
    enough; dances are split by their seeds. Procedural poses have no split. Raises InputError if recordings cannot be read.
    """
    check_one_of("split", split, SPLITS)
    if config.source == "clips":
        return open_clips(config.path, split, config.fps)
    if config.source == "choreography":
        own_seed = len(SPLITS) * config.seed + SPLITS.index(split)
        return Choreography(config.dances, own_seed, config.seconds, 30.0)
    if config.source == "poses":
        return ProceduralPoses()
    weights = {name: weight for name, weight in sorted(config.weights.items()) if weight > 0}  # the order says nothing
    recorded = {"path": config.path, "fps": config.fps}
    parts = [replace(config, source=name, **(recorded if name == "clips" else dict.fromkeys(recorded))) for name in weights]
    sources = [build_motion(part, split) for part in parts]
    return MixedPoses(sources, list(weights.values()))
