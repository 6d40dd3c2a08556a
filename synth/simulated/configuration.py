"""Configuration of simulated benchmarks, the check that a folder holds one set only, and checks of motions."""

import dataclasses
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.errors import InputError
from synth.body.asset import ASSET
from synth.motion import MotionConfig
from synth.motion.skeleton import Motion
from synth.motion.splice import cut
from synth.sensor.model import SENSORS, SensorConfig

MAX_HIP_ACCELERATION_M_S2 = 50.0
"""A greater acceleration of the hips is not a dancer's jump but an error of the recording."""


@dataclass(frozen=True)
class SimulatedSet:
    """Every setting that a set depends on. Each benchmark adds its own.

    Attributes:
        benchmark: identity and size of the set.
        motion: `choreography` for composed motion, or `clips` for recordings of the pack's test subjects.
        renderer: cpu or gl; auto must be resolved before.
        sensor: sensor model.
    """

    generator: ClassVar[int] = 2
    """Version of the generator: increased with every change that makes another set from the same configuration."""

    counted: ClassVar[str]
    """Name of the field of `benchmark` that holds the size of the set: a smaller set is the beginning of a larger one."""

    benchmark: Any
    motion: MotionConfig = field(default_factory=lambda: MotionConfig(source="choreography"))
    renderer: str = "cpu"
    sensor: SensorConfig = SENSORS["ideal"]

    def __post_init__(self) -> None:
        composed = MotionConfig(source="choreography")
        if self.motion.source != "clips" and self.motion != composed:
            raise InputError(
                f"motion={self.motion.source} with other settings: a benchmark's motion is either composed "
                "(motion=choreography, whose dances only benchmark.seed changes) or recorded (motion=clips motion.path=...)"
            )

    def as_json(self) -> str:
        """The configuration as JSON, without the size of the set, with the generator's version and the body's digest."""
        described = dataclasses.asdict(self)
        del described["benchmark"][self.counted]
        body = hashlib.sha256(ASSET.read_bytes()).hexdigest()[:12]
        return json.dumps(described | {"generator": self.generator, "body_asset": body}, sort_keys=True)

    @property
    def hash(self) -> str:
        """Twelve hexadecimal digits that identify the configuration."""
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]

    def amount_in(self, folder: Path, manifest: dict | None, files: str, real: str) -> int:
        """The size that the set in a folder will have: the configured size, or the size in its manifest if that is larger.

        Args:
            folder: of the set.
            manifest: content of the folder's manifest, None if there is none.
            files: glob pattern of the set's files.
            real: name of the real data that such files without a manifest may be, for messages.

        Raises:
            InputError: The folder holds another set, or files without a manifest.
        """
        wanted = getattr(self.benchmark, self.counted)
        if manifest is None:
            if unknown := sorted(folder.glob(files)):
                raise InputError(f"{unknown[0]}: not made by this program, maybe {real}; choose another out=")
            return wanted
        if manifest.get("hash") != self.hash:
            raise InputError(
                f"{folder}: holds another set (made with other settings, {manifest.get('hash')} against {self.hash}); choose "
                "another out=, or delete that folder"
            )
        return max(wanted, manifest[self.counted])


def is_faulty(motion: Motion) -> bool:
    """Whether the hips accelerate more than MAX_HIP_ACCELERATION_M_S2 in any frame."""
    acceleration_m_s2 = np.linalg.norm(np.diff(motion.root_m, n=2, axis=0), axis=1) * motion.fps**2
    return bool(acceleration_m_s2.max() > MAX_HIP_ACCELERATION_M_S2)


def random_excerpt(rng: np.random.Generator, motion: Motion, frames: int) -> Motion:
    """A part of a motion with the given number of frames at a random position; the whole motion if it is shorter."""
    start = int(rng.integers(max(len(motion) - frames, 0) + 1))
    return cut(motion, start, start + frames)
