"""Benchmarks `eval` (Ganapathi et al., ECCV 2012) and `eval_sim`, its simulated stand-in: one reader for both.

Which of a file's joint ids is which joint nobody has published. For the real set the map is therefore a setting,

    python evaluate.py benchmark=eval benchmark.path=PATH 'benchmark.joints={head: 1, neck: 2, right_hand: [7, 8]}'

by the names of `kpopnet.skeleton`; of several ids the mean is taken, and joints that are not named are not judged. Without
a map the error says what frame 0 holds. The stand-in's ids are in its manifest.
"""

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.benchmarks.eval_format import FPS, describe, read_manifest, read_sequence
from kpopnet.benchmarks.sequences import Origin, Sequence
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, Joint

log = logging.getLogger(__name__)


@dataclass
class EvalConfig:
    """Attributes: path: the folder of seq_*.bin. joints: id, or ids, of each joint by its name; None where there is none."""

    name: str = "eval"
    path: str | None = None
    joints: dict[str, Any] = field(default_factory=lambda: dict.fromkeys(JOINT_NAMES))


@dataclass
class EvalSimConfig:
    """Attributes: path: a folder that `python -m synth benchmark=eval_sim` wrote."""

    name: str = "eval_sim"
    path: str = "data/eval_sim"


class EvalBenchmark:
    """The original files; what of them is left out is logged, with its number."""

    name = "eval"
    origin = Origin.REAL
    truth = "motion capture"
    about = (
        "Real Kinect depth of whole scenes; joints from marker-based motion capture, where the data set's authors put them "
        "in the body. The paper's set."
    )

    def __init__(self, config: EvalConfig) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder holds no sequences, or simulated ones, or the map of joints is missing or odd.
        """
        if config.path is None:
            raise InputError("benchmark=eval needs benchmark.path=PATH, the folder that holds seq_a_0.bin and the others")
        self.folder = Path(config.path)
        if read_manifest(self.folder) is not None:
            raise InputError(f"{self.folder}: simulated, as its manifest.json says, and not EVAL: take benchmark=eval_sim")
        self._names = _sequence_names(self.folder)
        self._joint_ids = checked_map(config.joints)
        if not self._joint_ids:
            raise InputError(
                "benchmark=eval needs benchmark.joints, which says what each joint's id is in the file, for instance "
                f"'benchmark.joints={{head: 1, neck: 2}}'. {describe(self._path(self._names[0]))}"
            )

    def sequence_names(self) -> list[str]:
        return self._names

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.bin"

    def read(self, name: str) -> Sequence:
        found = read_sequence(self._path(name), self._joint_ids)
        if found.skipped:
            log.warning("%s: left out %s", name, "; ".join(f"{count} {what}" for what, count in found.skipped.items()))
        return Sequence(
            name=name,
            identity=name.split("_")[1],
            fps=FPS,
            camera=found.camera,
            depth_m=found.depth_m,
            joints_camera_m=found.joints_camera_m,
            visible=np.isfinite(found.joints_camera_m).all(axis=-1),
            yaw_rad=heading_rad(found.joints_camera_m),
            alone=False,
        )


class EvalSimBenchmark(EvalBenchmark):
    """The stand-in."""

    name = "eval_sim"
    origin = Origin.SIMULATED
    truth = "synthetic truth"

    def __init__(self, config: EvalSimConfig) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder holds no sequences, or none that synth made.
        """
        self.folder = Path(config.path)
        manifest = read_manifest(self.folder)
        if manifest is None:
            raise InputError(
                f"{self.folder}: no manifest.json that says what it is; `python -m synth benchmark=eval_sim "
                f"out={self.folder}` makes the set (8 GB; with benchmark.sequences=8 a third of it)"
            )
        self._names = _sequence_names(self.folder)
        if len(self._names) < manifest["sequences"]:
            log.warning(
                "%s: %d of its %d sequences are there; run the command that made it again",
                *(self.folder, len(self._names), manifest["sequences"]),
            )
        self._joint_ids = checked_map(manifest["joint_ids"])
        self.about = (
            f"SIMULATED people in rooms, in the format of EVAL but not EVAL: seed {manifest['seed']}, configuration "
            f"{manifest['hash']}; {len(self._names)} of 24 sequences. People and motions are in no training set."
        )


def _sequence_names(folder: Path) -> list[str]:
    """Names of the folder's sequences: the first of every subject, then the second."""
    names = [path.stem for path in folder.glob("seq_*.bin") if re.fullmatch(r"seq_[a-z]+_\d+", path.stem)]
    if not names:
        raise InputError(f"{folder}: no seq_<subject>_<number>.bin there; give the folder that holds seq_a_0.bin")
    return sorted(names, key=lambda name: (int(name.split("_")[2]), name))


def checked_map(joints: Mapping[str, Any]) -> dict[str, list[int]]:
    """Ids by the joint's name, in lists, of the joints that have any.

    Raises:
        InputError: a name that no joint has, an id that is no number, or one that two joints share.
    """
    ids: dict[str, list[int]] = {}
    for name, given in joints.items():
        if name not in JOINT_NAMES:
            raise InputError(f"benchmark.joints: {name} is no joint; the joints are {', '.join(JOINT_NAMES)}")
        if given is None:
            continue
        numbers = given if isinstance(given, list) else [given]
        if not numbers or not all(isinstance(number, int) and not isinstance(number, bool) for number in numbers):
            raise InputError(f"benchmark.joints: {name} is {given!r}; expected the joint's id, or a list of ids")
        ids[name] = numbers
    owners: dict[tuple[int, ...], str] = {}
    for name, numbers in ids.items():
        other = owners.setdefault(tuple(sorted(numbers)), name)
        if other != name:
            raise InputError(f"benchmark.joints: {other} and {name} both have id {numbers}; one of them is wrong")
    return ids


def heading_rad(joints_camera_m: np.ndarray) -> np.ndarray:
    """(T,) float32: where the person's front points, 0 at the camera, positive to the person's left; NaN if unknown.

    By the lines of hips and shoulders and the trunk between them, in the plane of the camera's x and z: the tilt of the
    camera is not known and left out.
    """
    joints = joints_camera_m.astype(np.float64)
    hips = joints[:, Joint.LEFT_HIP] + joints[:, Joint.RIGHT_HIP]
    shoulders = joints[:, Joint.LEFT_SHOULDER] + joints[:, Joint.RIGHT_SHOULDER]
    to_left = joints[:, [Joint.LEFT_HIP, Joint.LEFT_SHOULDER]] - joints[:, [Joint.RIGHT_HIP, Joint.RIGHT_SHOULDER]]
    front = np.cross(to_left.sum(axis=1), shoulders - hips)
    towards_front, towards_camera = front[:, 0] + 1j * front[:, 2], -(hips[:, 0] + 1j * hips[:, 2])
    return np.angle(towards_front * towards_camera.conj()).astype(np.float32)
