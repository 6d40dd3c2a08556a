"""What all simulated benchmarks share: their configuration, the claim on their folder, and checks of motions."""

import dataclasses
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.runtime.input_files import read_json
from synth.body.asset import ASSET
from synth.motion import MotionConfig
from synth.motion.skeleton import Motion
from synth.motion.splice import cut
from synth.sensor.model import SENSORS, SensorConfig

MANIFEST = "manifest.json"
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

    def claim(self, folder: Path, files: str, **described: Any) -> dict:
        """Writes the manifest of a folder before its first file, so that no simulated file ever lies in a folder without one.

        Args:
            folder: of the set, made if it is missing.
            files: glob pattern of the set's files.
            described: further entries of the manifest.

        Returns:
            The manifest. The size in it is the configured one, or that of an earlier run if it was larger.

        Raises:
            InputError: the folder holds another set, or files without a manifest.
        """
        folder.mkdir(parents=True, exist_ok=True)
        path, count = folder / MANIFEST, getattr(self.benchmark, self.counted)
        if path.exists():
            found = read_json(path, non_finite=True)
            if not isinstance(found, dict) or found.get("hash") != self.hash:
                raise InputError(
                    f"{folder}: holds another set, made with other settings than {self.hash}; choose another out=, or "
                    "delete that folder"
                )
            count = max(count, found[self.counted])
        elif unknown := sorted(folder.glob(files)):
            raise InputError(f"{unknown[0]}: not made by this program; choose another out=")
        identity = {"simulated": True, "seed": self.benchmark.seed, "hash": self.hash, self.counted: count}
        manifest = identity | described | {"config": json.loads(self.as_json())}
        with atomic_path(path) as part:
            part.write_text(json.dumps(manifest, indent=1))
        return manifest


_makers: dict[str, Any] = {}


def maker_of(kind: type, config: SimulatedSet) -> Any:
    """A maker of this kind for a configuration; a worker process keeps the last one, which holds compiled scenes."""
    if config.hash not in _makers:
        _makers.clear()
        _makers[config.hash] = kind(config)
    return _makers[config.hash]


def is_faulty(motion: Motion) -> bool:
    """Whether the hips accelerate more than MAX_HIP_ACCELERATION_M_S2 in any frame."""
    acceleration_m_s2 = np.linalg.norm(np.diff(motion.root_m, n=2, axis=0), axis=1) * motion.fps**2
    return bool(acceleration_m_s2.max() > MAX_HIP_ACCELERATION_M_S2)


def random_excerpt(rng: np.random.Generator, motion: Motion, frames: int) -> Motion:
    """A part of a motion with the given number of frames at a random position; the whole motion if it is shorter."""
    start = int(rng.integers(max(len(motion) - frames, 0) + 1))
    return cut(motion, start, start + frames)
