"""Cache on disk of the estimated joints of learners, so that scoring again takes seconds.

Each estimator has a folder, named after the estimator and a digest of everything that its poses depend on: its settings,
the contents of the files that the settings name (weights and description of a model), and the source code. Each file in it
is named after dance, learner and a digest of the depth.
"""

import hashlib
import inspect
import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import kpopnet
from kpopnet.dance.performance import Performance, mask_missing_joints
from kpopnet.datasets.dances.dance_set import Dance, Learner
from kpopnet.datasets.dances.format import check_frame_count
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.evaluation.poses.sequence import WARM_UP_FRAMES
from kpopnet.evaluation.registry import build_estimators
from kpopnet.networks.description import META
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.runtime.input_files import ArraySchema, expect, read_npz
from kpopnet.skeleton import NUM_JOINTS

_MODEL_FILES = ("*.safetensors", META)
"""Patterns of the files of a trained model in its folder."""

_SCHEMA = {
    "joints_m": ArraySchema("f", ("frames", NUM_JOINTS, 3)),
    "confidence": ArraySchema("f", ("frames", NUM_JOINTS)),
    "seconds": ArraySchema("f", ()),
}

_SHARED_CODE = (
    *("*.py", "data/**/*.py", "geometry/**/*.py", "networks/**/*.py", "paper_tracker/**/*.py"),
    *("datasets/dances/format.py", "evaluation/registry.py"),  # decoding of depth, construction of estimators
    "weights/__init__.py",  # which has the digests of the network that comes with the package
)
"""Patterns, relative to kpopnet, of the source files that the joints of every estimator may depend on."""


@dataclass(frozen=True)
class Poses:
    """The estimated joints of one recording.

    Attributes:
        joints_m: (T, 15, 3) float32 in metres in the camera frame, NaN where missing.
        confidence: (T, 15) float32 in 0..1.
        times_s: (T,) float64 in seconds, read from the learner's file, so that corrected times need no new estimation.
        seconds: estimation time.
    """

    joints_m: np.ndarray
    confidence: np.ndarray
    times_s: np.ndarray
    seconds: float

    def performance(self) -> Performance:
        """Joints, times and confidence for a scorer."""
        return Performance(self.joints_m, self.times_s, self.confidence)


class PoseCache:
    """The cached poses of one estimator. In a worker process the estimator is built when it is first needed.

    It can be pickled for worker processes.
    """

    def __init__(self, folder: Path, name: str, settings: Any) -> None:
        """Builds the estimator once, to find its source files; reads no poses.

        Args:
            folder: folder of the cached poses of all estimators.
            name: of the estimator.
            settings: of the estimator.

        Raises:
            InputError: a file that the settings name is missing.
        """
        self.name, self.settings = name, settings
        estimator = self._build()
        self.folder = folder / f"{name}-{estimator_key(estimator, settings)}"
        self._estimator: Estimator | None = estimator
        self._warmed_up = False

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_estimator": None, "_warmed_up": False}

    def _build(self) -> Estimator:
        return build_estimators({self.name: self.settings})[self.name]

    def path(self, dance: Dance, learner: Learner) -> Path:
        """Path of the cached poses of a learner."""
        return self.folder / f"{dance.name}.{learner.name}.{learner.depth_key}.npz"

    def has(self, dance: Dance, learner: Learner) -> bool:
        """Whether the poses of a learner are cached."""
        return self.path(dance, learner).is_file()

    def read(self, dance: Dance, learner: Learner) -> Poses:
        """Reads cached poses.

        Raises:
            InputError: the cached file is damaged or has another format, or the number of times in the learner's file
                differs from the number of frames.
        """
        path = self.path(dance, learner)
        try:
            stored = read_npz(path, _SCHEMA)
            joints_m, confidence, seconds = stored["joints_m"], stored["confidence"], float(stored["seconds"])
            expect(len(joints_m) > 0 and 0 <= seconds < math.inf, str(path), "frames, and a time of 0 seconds or more")
            mask_missing_joints(joints_m, confidence)
        except InputError as error:
            raise InputError(f"{path}: damaged ({error}); delete it to estimate these poses again") from error
        times_s = learner.times_s()
        check_frame_count(len(joints_m), "frames", times_s, learner.path)
        return Poses(joints_m, confidence, times_s, seconds)

    def estimate(self, dance: Dance, learner: Learner) -> None:
        """Estimates and writes the poses of a learner unless they are cached.

        Raises:
            InputError: the learner has no depth recording, or it cannot be read.
        """
        if self.has(dance, learner):
            return
        clip = learner.depth()
        if self._estimator is None:
            self._estimator = self._build()
        if not self._warmed_up:
            self._estimator.estimate(clip.depth_m[:WARM_UP_FRAMES], clip.camera)
            self._warmed_up = True
        start = time.perf_counter()
        joints_m, confidence = self._estimator.estimate(clip.depth_m, clip.camera)
        seconds = time.perf_counter() - start
        path = self.path(dance, learner)
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as part, part.open("wb") as file:
            np.savez(file, joints_m=joints_m, confidence=confidence, seconds=seconds)


def estimator_key(estimator: Estimator, settings: Any) -> str:
    """Ten hexadecimal digits: a digest of the settings, of the files that they name, and of the source code."""
    digest = hashlib.sha256()
    for name, value in sorted(asdict(settings).items()):
        digest.update(json.dumps([name, _with_file_digests(value)], sort_keys=True, default=str).encode())
    for source in source_files(estimator):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:10]


def source_files(estimator: Estimator, patterns: tuple[str, ...] = _SHARED_CODE) -> list[Path]:
    """The source files that the joints of an estimator depend on: its own package in kpopnet, and `patterns`.

    Raises:
        RuntimeError: a pattern matches no file. Without that file in the digest the cache would return joints of older code.
    """
    package = Path(kpopnet.__file__).resolve().parent
    own = Path(inspect.getfile(type(estimator))).resolve()
    if own.is_relative_to(package):
        patterns = (*patterns, f"{own.relative_to(package).parts[0]}/**/*.py")
    files = {own}
    for pattern in patterns:
        found = set(package.glob(pattern))
        if not found:
            raise RuntimeError(f"{package}: no file matches {pattern}, which estimated joints depend on")
        files |= found
    return sorted(files)


def _with_file_digests(value: Any) -> Any:
    """The value of a setting; for the path of a file or of a model's folder, digests of the file contents."""
    if not isinstance(value, str):
        return value
    path = Path(value)
    files = [path] if path.is_file() else sorted(file for pattern in _MODEL_FILES for file in path.glob(pattern))
    return [hashlib.sha256(file.read_bytes()).hexdigest() for file in files] or value
