"""Learners' joints as estimators find them, kept on disk: another scorer, or another look, then costs seconds.

A folder for each estimator, named after it and after what its poses depend on: its settings, the contents of the files
that they name (a model's weights and description), and the source code. A file in it is named after the learner and the depth.
"""

import hashlib
import inspect
import json
import time
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.benchmarks.estimating import WARM_UP_FRAMES
from kpopnet.benchmarks.kpop import Dance, Learner
from kpopnet.benchmarks.kpop_format import check_one_each
from kpopnet.benchmarks.registry import build_estimators
from kpopnet.checkpoint import META
from kpopnet.dance.performance import Performance, whole_joints
from kpopnet.errors import InputError
from kpopnet.estimators import Estimator
from kpopnet.replacing import replacing
from kpopnet.skeleton import NUM_JOINTS

_MODEL = ("*.safetensors", META)
"""What a trained model is made of, in its folder."""

_SHARED_CODE = (
    *("camera.py", "checkpoint.py", "estimators.py", "networks/*.py", "ridge.py", "skeleton.py"),
    *("benchmarks/kpop_format.py", "benchmarks/registry.py"),  # how depth is unpacked, how estimators are built
)


@dataclass(frozen=True)
class Poses:
    """What an estimator made of a recording.

    Attributes:
        joints_m: (T, 15, 3) float32 in the camera frame, NaN where missing.
        confidence: (T, 15) float32.
        times_s: (T,) float64, from the learner's file: they may be corrected without another estimation.
        seconds: what it took.
    """

    joints_m: np.ndarray
    confidence: np.ndarray
    times_s: np.ndarray
    seconds: float

    def performance(self) -> Performance:
        return Performance(self.joints_m, self.times_s, self.confidence)


class PoseCache:
    """The poses of one estimator; the estimator is built when there is something to estimate.

    Can be handed to worker processes.
    """

    def __init__(self, folder: Path, name: str, settings: Any) -> None:
        """Reads nothing yet.

        Args:
            folder: of all estimators' poses.
            name: of the estimator.
            settings: as configured.

        Raises:
            InputError: what the settings name is missing.
        """
        self.name, self.settings = name, settings
        estimator = self._build()
        self.folder = folder / f"{name}-{estimator_key(estimator, settings)}"
        self._estimator: Estimator | None = estimator
        self._warm = False

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_estimator": None, "_warm": False}

    def _build(self) -> Estimator:
        return build_estimators({self.name: self.settings})[self.name]

    def path(self, dance: Dance, learner: Learner) -> Path:
        return self.folder / f"{dance.name}.{learner.name}.{learner.depth_key}.npz"

    def has(self, dance: Dance, learner: Learner) -> bool:
        return self.path(dance, learner).is_file()

    def read(self, dance: Dance, learner: Learner) -> Poses:
        """Poses that are there.

        Raises:
            InputError: the file is torn or foreign, or the learner's has times for another number of frames.
        """
        path = self.path(dance, learner)
        try:
            with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                joints_m, confidence, seconds = file["joints_m"], file["confidence"], float(file["seconds"])
            if joints_m.ndim != 3 or joints_m.shape[1:] != (NUM_JOINTS, 3) or not len(joints_m):
                raise ValueError(f"joints of shape {joints_m.shape}")
            whole_joints(joints_m, confidence)
        except (OSError, EOFError, KeyError, ValueError, TypeError, zipfile.BadZipFile, InputError) as error:
            raise InputError(f"{path}: not whole ({error}); delete it, and it is made again") from error
        times_s = learner.times_s()
        check_one_each(len(joints_m), "frames", times_s, learner.path)
        return Poses(joints_m, confidence, times_s, seconds)

    def make(self, dance: Dance, learner: Learner) -> None:
        """Estimates and writes what is not there yet.

        Raises:
            InputError: there is no depth, or it cannot be read.
        """
        if self.has(dance, learner):
            return
        clip = learner.depth()
        if self._estimator is None:
            self._estimator = self._build()
        if not self._warm:
            self._estimator.estimate(clip.depth_m[:WARM_UP_FRAMES], clip.camera)
            self._warm = True
        start = time.perf_counter()
        joints_m, confidence = self._estimator.estimate(clip.depth_m, clip.camera)
        seconds = time.perf_counter() - start
        path = self.path(dance, learner)
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part, part.open("wb") as file:
            np.savez(file, joints_m=joints_m, confidence=confidence, seconds=seconds)


def estimator_key(estimator: Estimator, settings: Any) -> str:
    """Ten hexadecimal digits that differ wherever an estimator's poses might."""
    digest = hashlib.sha256()
    for name, value in sorted(asdict(settings).items()):
        digest.update(json.dumps([name, _without_place(value)], sort_keys=True, default=str).encode())
    own = Path(inspect.getfile(type(estimator))).resolve().parent
    package = Path(__file__).resolve().parents[1]
    code = sorted(own.glob("*.py")) if own != package else [Path(inspect.getfile(type(estimator)))]
    for source in (*code, *(source for pattern in _SHARED_CODE for source in sorted(package.glob(pattern)))):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:10]


def _without_place(value: Any) -> Any:
    """A setting as it is, or for the name of a file or of a model's folder what is in it."""
    if not isinstance(value, str):
        return value
    path = Path(value)
    files = [path] if path.is_file() else sorted(file for pattern in _MODEL for file in path.glob(pattern))
    return [hashlib.sha256(file.read_bytes()).hexdigest() for file in files] or value
