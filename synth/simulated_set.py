"""Simulated benchmarks: what one depends on, and the folder it lies in, which holds one set and nothing else."""

import dataclasses
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.errors import InputError
from synth.body import ASSET
from synth.motion import MotionConfig
from synth.motion.skeleton import Motion
from synth.sensor import SENSORS, SensorConfig

JOLT_M_S2 = 50.0
"""What accelerates the hips more is no jump of a dancer but a fault of a recording."""


@dataclass(frozen=True)
class SimulatedSet:
    """The whole of what a set depends on; each benchmark adds what is its own.

    Attributes:
        benchmark: which set, and how much of it.
        motion: `choreography`, or `clips` for recordings of the pack's test subjects.
        renderer: cpu or gl; auto must be decided first.
        sensor: what measures.
    """

    generator: ClassVar[int] = 1
    """Raised with every change after which the same configuration gives another set."""

    counted: ClassVar[str]
    """The field of `benchmark` that says how much of the set is wanted: the less is the beginning of the more."""

    benchmark: Any
    motion: MotionConfig = field(default_factory=lambda: MotionConfig(source="choreography"))
    renderer: str = "cpu"
    sensor: SensorConfig = SENSORS["ideal"]

    def __post_init__(self) -> None:
        composed = MotionConfig(source="choreography")
        if self.motion.source != "clips" and self.motion != composed:
            raise InputError(
                f"motion: {self.motion.source} with settings of its own; a benchmark's motion is either composed "
                "(motion=choreography, whose dances only benchmark.seed changes) or recorded (motion=clips motion.path=...)"
            )

    def as_json(self) -> str:
        described = dataclasses.asdict(self)
        del described["benchmark"][self.counted]
        body = hashlib.sha256(ASSET.read_bytes()).hexdigest()[:12]
        return json.dumps(described | {"generator": self.generator, "body_asset": body}, sort_keys=True)

    @property
    def hash(self) -> str:
        """Twelve hexadecimal digits that differ when anything in the set might."""
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]

    def amount_in(self, folder: Path, manifest: dict | None, files: str, real: str) -> int:
        """How much of the set a folder is to hold: what is asked for, or was before if that was more.

        Args:
            folder: the set's.
            manifest: what lies there says of itself, if it does.
            files: pattern of the set's files.
            real: what those are where no manifest says otherwise, for messages.

        Raises:
            InputError: the folder holds something else.
        """
        wanted = getattr(self.benchmark, self.counted)
        if manifest is None:
            if strange := sorted(folder.glob(files)):
                raise InputError(f"{strange[0]}: not made by this program, maybe {real}; choose another out=")
            return wanted
        if manifest.get("hash") != self.hash:
            raise InputError(
                f"{folder}: holds another set (made with other settings, {manifest.get('hash')} against {self.hash}); choose "
                "another out=, or delete that folder"
            )
        return max(wanted, manifest[self.counted])


def is_faulty(motion: Motion) -> bool:
    """Whether the hips jump as nobody's do."""
    acceleration_m_s2 = np.linalg.norm(np.diff(motion.root_m, n=2, axis=0), axis=1) * motion.fps**2
    return bool(acceleration_m_s2.max() > JOLT_M_S2)
