"""Cache on disk of the estimated joints of learners, so that scoring again takes seconds.

Each estimator has a folder, named after it and a digest of all that its joints depend on: its settings, the contents of the
files that these name (weights and description of a model), and the source code. Each file in it is named after dance, learner,
a digest of the depth, and where the joints depend on them the frames per second, and a digest of the true joints.
"""

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import kpopnet
from kpopnet.dance.noise.table import SEEN
from kpopnet.dance.performance import Performance, mask_missing_joints
from kpopnet.datasets.dances.dance_set import Dance, Learner
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator, first_label, starts_from_label
from kpopnet.evaluation.engine import Timed, device_of
from kpopnet.evaluation.registry import build_estimators
from kpopnet.networks import META
from kpopnet.pose.person import PersonEstimator
from kpopnet.runtime.atomic_write import remove_unfinished, write_npz
from kpopnet.runtime.input_files import ArraySchema, expect, read_npz
from kpopnet.skeleton import NUM_JOINTS

_MODEL_FILES = ("*.safetensors", META)
"""Patterns of the files of a trained model in its folder."""

_SCHEMA = {
    "joints_m": ArraySchema("f", ("frames", NUM_JOINTS, 3)),
    "confidence": ArraySchema("f", ("frames", NUM_JOINTS)),
    "seconds": ArraySchema("f", ()),
}

_SEEN_SCHEMA = {"joints_m": ArraySchema("f", ("frames", NUM_JOINTS, 3))}

SeeTeacher = Callable[[Performance, str, Estimator], Performance]
"""From a teacher, the name of an estimator and itself, the teacher as it sees them: `kpopnet.programs.score.seen_teacher`."""

_WITHOUT_INFLUENCE = (
    *("dance/", "evaluation/dances/", "evaluation/people/", "evaluation/poses/", "programs/"),
    *("sources/", "teacher/", "training/", "viz/"),
)
"""Rooms of kpopnet on which no estimated joint depends; on all others it may."""

_SEEING = (
    *("dance/noise/table.py", "dance/performance.py", "programs/score.py"),
    *("teacher/library.py", "teacher/posing.py"),
)
"""Files of these rooms on which a teacher as an estimator sees them depends."""


class PoseCache:
    """The poses of one estimator."""

    def __init__(self, folder: Path, name: str, settings: Any) -> None:
        """Builds the estimator and makes the folder of its poses in `folder`, that of the cached poses of all.

        Raises InputError if a file of the estimator is missing, and OSError if the folder is missing and cannot be made.
        """
        self.name, self.folder = name, folder / f"{name}-{estimator_key(settings)}"
        self._estimator = build_estimators({name: settings})[name]
        self.folder.mkdir(parents=True, exist_ok=True)
        self._estimate = Timed(self._estimator.estimate, device_of(self._estimator))

    def path(self, dance: Dance, learner: Learner) -> Path:
        """Path of the cached poses of a learner; raises InputError if there is no depth to estimate them from."""
        known = "a recording depth_mm; only its true joints can be scored (estimator=[])"
        expect(learner.depth_key is not None, str(learner.path), known)
        parts = [dance.name, learner.name, learner.depth_key]
        if isinstance(self._estimator, PersonEstimator):
            parts.append(f"{_fps(learner):g}fps")
        if starts_from_label(self._estimator) and (truth := learner.joints()) is not None:
            parts.append(hashlib.sha256(truth.joints_m.tobytes()).hexdigest()[:10])
        return self.folder / f"{'.'.join(parts)}.npz"

    def poses(self, dance: Dance, learner: Learner) -> tuple[Performance, float]:
        """The estimated joints of a learner and the time of their estimation in seconds; estimates them if not cached.

        Times of frames are read from the learner's file, so that corrected ones need no new estimation. Raises InputError if
        the cached file is damaged, its frames are not as many as the times, or the learner has no depth recording or one that
        cannot be read.
        """
        path = self.path(dance, learner)
        if not path.is_file():
            self._write(path, learner)
        try:
            stored = read_npz(path, _SCHEMA)
            joints_m, confidence, seconds = stored["joints_m"], stored["confidence"], float(stored["seconds"])
            expect(len(joints_m) > 0 and 0 <= seconds < math.inf, str(path), "frames, and a time of 0 seconds or more")
            mask_missing_joints(joints_m, confidence)
        except InputError as error:
            raise InputError(f"{path}: damaged ({error}); delete it to estimate these poses again") from error
        times_s = learner.times_s()
        expect(len(joints_m) == len(times_s), str(learner.path), f"{len(joints_m)} frames as in {path}, found {len(times_s)}")
        return Performance(joints_m, times_s, confidence), seconds

    def seen_teacher(self, dance: Dance, see: SeeTeacher) -> Performance:
        """The teacher of a dance as `see` shows them, with the cache's estimator; what is not cached is made."""
        teacher = dance.teacher()
        digest = hashlib.sha256(teacher.joints_m.tobytes() + teacher.times_s.tobytes())
        package = Path(kpopnet.__file__).resolve().parent
        synth = package.parent / "synth"
        for source in (*(package / name for name in _SEEING), *sorted(synth.rglob("*.py")), *sorted(synth.rglob("*.npz"))):
            digest.update(source.read_bytes())
        path = self.folder / f"{dance.name}.teacher.{digest.hexdigest()[:10]}.npz"
        if not path.is_file():
            self._store(path, joints_m=see(teacher, self.name, self._estimator).joints_m)
        try:
            joints_m = read_npz(path, _SEEN_SCHEMA)["joints_m"]
            return Performance(joints_m, teacher.times_s, teacher.confidence, f"{self.name}{SEEN}")
        except InputError as error:
            raise InputError(f"{path}: damaged ({error}); delete it to make it again") from error

    def _write(self, path: Path, learner: Learner) -> None:
        clip, start = learner.depth(), {}
        if isinstance(self._estimator, PersonEstimator):
            self._estimator.fps = _fps(learner)
        if starts_from_label(self._estimator):
            truth = learner.joints()
            expect(truth is not None, str(learner.path), "true joints, from which start=label starts")
            start = {"start": first_label(truth.joints_m)}
        (joints_m, confidence), seconds = self._estimate(clip.depth_m, clip.camera, **start)
        self._store(path, joints_m=joints_m, confidence=confidence, seconds=seconds)

    def _store(self, path: Path, **arrays: Any) -> None:
        remove_unfinished(path.parent)  # of evaluations that were killed
        write_npz(path, **arrays)


def _fps(learner: Learner) -> float:
    """Frames per second of a learner's recording, to a tenth; 30 for a single frame."""
    steps_s = np.diff(learner.times_s())
    return round(float(1 / np.median(steps_s)), 1) if len(steps_s) else 30.0


def estimator_key(settings: Any) -> str:
    """Ten hexadecimal digits: a digest of the settings, of the files that they name, and of the source code."""
    digest = hashlib.sha256(type(settings).__name__.encode())  # kinds of estimators may have the same settings
    for name, value in sorted(asdict(settings).items()):
        digest.update(json.dumps([name, _with_file_digests(value)], sort_keys=True, default=str).encode())
    package = Path(kpopnet.__file__).resolve().parent
    for source in sorted(package.rglob("*.py")):
        if not source.relative_to(package).as_posix().startswith(_WITHOUT_INFLUENCE):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:10]


def _with_file_digests(value: Any) -> Any:
    """The value of a setting; for the path of a file or of a model's folder, digests of the file contents."""
    if not isinstance(value, str):
        return value
    path = Path(value)
    files = [path] if path.is_file() else sorted(file for pattern in _MODEL_FILES for file in path.glob(pattern))
    return [hashlib.sha256(file.read_bytes()).hexdigest() for file in files] or value
