"""What all simulated benchmarks share: settings, the claim on a folder, the making of missing files, and checks of motions."""

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.camera import Camera
from kpopnet.datasets.simulated import MANIFEST
from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import remove_unfinished, write_json
from kpopnet.runtime.input_files import read_json
from kpopnet.viz.drawing import save_png
from synth.body.asset import digest
from synth.motion import SPLITS, MotionConfig, build_motion, identity_of_recordings
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, resampled
from synth.resumable import differences, make_missing
from synth.sensor.model import SENSORS, SensorConfig

MAX_HIP_ACCELERATION_M_S2 = 50.0
"""A greater acceleration of the hips is not a dancer's jump but an error of the recording."""


@dataclass(frozen=True)
class SetGenerator(ABC):
    """Makes a simulated set; its fields are every setting that the set depends on. Each benchmark adds its own.

    A part is what is made and resumed alone: a sequence, or a dance with its learners. Part k is a pure function of the fields
    and k, whatever the number of processes.
    """

    generator: ClassVar[int] = 3  # its version: increased with every change that makes another set from the same settings
    # What a part is called. `benchmark` has the number of parts as PARTs: a smaller set is the beginning of a larger one.
    part: ClassVar[str]
    finished_files: ClassVar[str]  # glob patterns of the files that finish a part,
    unfinished_files: ClassVar[str]  # and of temporary files that killed processes left
    camera: ClassVar[Camera]
    composed_only: ClassVar[str] = ""  # why recorded motion is refused; empty where it is not
    images_differ: ClassVar[bool] = False  # whether images differ in size, which OpenGL's window does not: the CPU draws
    seeded: ClassVar[tuple[str, ...]] = ("person", "sequence", "noise")  # what has random generators of its own

    benchmark: Any  # identity and size of the set
    # `choreography` for composed motion, or `clips` for recordings of the pack's test subjects
    motion: MotionConfig = field(default_factory=lambda: MotionConfig(source="choreography"))
    renderer: str = "cpu"  # cpu or gl; auto must be resolved before
    sensor: SensorConfig = SENSORS["ideal"]  # sensor model

    def __post_init__(self) -> None:
        if self.benchmark.name != type(self.benchmark).name:
            raise InputError(f"benchmark.name={self.benchmark.name}: the set is called {type(self.benchmark).name}")
        composed = MotionConfig(source="choreography")
        if self.motion.source != "clips" and self.motion != composed:
            raise InputError(
                f"motion={self.motion.source} with other settings: a benchmark's motion is either composed "
                "(motion=choreography, whose dances only benchmark.seed changes) or recorded (motion=clips motion.path=...)"
            )
        if self.composed_only and self.motion != composed:
            raise InputError(f"motion=clips: {self.composed_only}")
        if self.images_differ:
            object.__setattr__(self, "renderer", "cpu")

    def _seed(self, kind: str, *numbers: int) -> tuple[int, ...]:
        """The seed of one kind of `seeded`. Only this benchmark's seeds start with its name."""
        split = (SPLITS.index(self.benchmark.split),) if hasattr(self.benchmark, "split") else ()
        return *self.benchmark.name.encode(), self.benchmark.seed, *split, self.seeded.index(kind), *numbers

    def _rng(self, kind: str, *numbers: int) -> np.random.Generator:
        return np.random.default_rng(self._seed(kind, *numbers))

    @cached_property
    def recordings(self) -> Any:
        return build_motion(self.motion, getattr(self.benchmark, "split", "test"))

    def excerpt(self, rng: np.random.Generator, clip: int, fps: float, frames: int) -> Motion:
        """A random part of a recording, of at most this many frames at a frame rate."""
        return random_excerpt(rng, resampled(self.recordings.motion(clip), fps), frames)

    @abstractmethod
    def manifest_entries(self) -> dict:
        """What the manifest says of the set to the reader of a report."""

    @abstractmethod
    def frames_per_part(self) -> float:
        """Expected number of frames of a part."""

    @abstractmethod
    def path(self, folder: Path, index: int) -> Path:
        """The file that finishes part `index`."""

    @abstractmethod
    def make(self, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
        """Makes the files of part `index` and calls `on_frame` after each frame."""

    @abstractmethod
    def contact_sheet(self, folder: Path, manifest: dict) -> np.ndarray:
        """RGB image of a few frames of the set with the true joints."""

    def as_json(self) -> str:
        """The settings as JSON, without the size of the set, with the generator's version and digests of body and BVH files."""
        settings = asdict(self)
        benchmark = settings["benchmark"]
        del benchmark[f"{self.part}s"]
        children = benchmark.get("children", 0.0)
        # Sets of adults, and of composed dances, are known by the settings of before there were others.
        if not children:
            benchmark.pop("children", None)
        if not self.motion.uses_clips:
            benchmark.pop("facing", None)
        settings |= {"generator": self.version, "body_asset": digest(children > 0)} | identity_of_recordings(self.motion)
        return json.dumps(settings, sort_keys=True)

    @property
    def version(self) -> int:
        """The version of the generator that makes this configuration's set."""
        return self.generator

    @property
    def hash(self) -> str:
        """Twelve hexadecimal digits that identify the settings."""
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]

    @property
    def size(self) -> int:
        return getattr(self.benchmark, f"{self.part}s")

    def write(self, folder: Path, processes: int) -> dict:
        """Makes the parts that are missing, and a contact sheet; returns the manifest.

        Raises InputError if the folder holds something else, or a worker process died; finished files stay.
        """
        manifest = self._claim(folder)
        make_missing(
            partial(replace(self).make, folder),  # a copy without compiled scenes, which cannot be sent to a process
            range(self.size),
            lambda index: self.path(folder, index).exists(),
            folder,
            self.part,
            "frame",
            lambda _: self.frames_per_part(),
            processes,
        )
        remove_unfinished(folder, self.unfinished_files)
        save_png(folder / "contact_sheet.png", self.contact_sheet(folder, manifest))
        return manifest

    def _claim(self, folder: Path) -> dict:
        """Writes the manifest of a folder before its first file, so that no simulated file ever lies in a folder without one.

        The size in the manifest is the configured one, or that of an earlier run if it was larger. Raises InputError if the
        folder holds another set, or files without a manifest.
        """
        folder.mkdir(parents=True, exist_ok=True)
        path, size = folder / MANIFEST, self.size
        if path.exists():
            found = read_json(path, non_finite=True)
            if not isinstance(found, dict) or found.get("hash") != self.hash:
                config = found.get("config") if isinstance(found, dict) else None
                other = differences(config, json.loads(self.as_json()))
                raise InputError(f"{folder}: holds another set ({other}); choose another out=, or delete that folder")
            size = max(size, found[f"{self.part}s"])
        elif unknown := sorted(folder.glob(self.finished_files)):
            raise InputError(f"{unknown[0]}: not made by this program; choose another out=")
        identity = {"simulated": True, "seed": self.benchmark.seed, "hash": self.hash, f"{self.part}s": size}
        manifest = identity | self.manifest_entries() | {"config": json.loads(self.as_json())}
        write_json(path, manifest)
        return manifest


def is_faulty(motion: Motion) -> bool:
    """Whether the hips accelerate more than MAX_HIP_ACCELERATION_M_S2 in any frame."""
    acceleration_m_s2 = np.linalg.norm(np.diff(motion.root_m, n=2, axis=0), axis=1) * motion.fps**2
    return bool(acceleration_m_s2.max() > MAX_HIP_ACCELERATION_M_S2)


def random_excerpt(rng: np.random.Generator, motion: Motion, frames: int) -> Motion:
    """A part of a motion with the given number of frames at a random position; the whole motion if it is shorter."""
    start = int(rng.integers(max(len(motion) - frames, 0) + 1))
    return cut(motion, start, start + frames)
