"""Benchmarks `eval` (Ganapathi et al., ECCV 2012) and `eval_sim`, its simulated stand-in: one reader for both.

Which of a file's joint ids is which joint nobody has published. For the real set the map is therefore a setting,

    python evaluate.py benchmark=eval benchmark.path=PATH 'benchmark.joints={head: 1, neck: 2, right_hand: [7, 8]}'

by the names of `kpopnet.skeleton`; of several ids the mean is taken, and joints that are not named are not judged. Without
a map the error says what frame 0 holds. The stand-in's ids are in its manifest.
"""

import logging
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.benchmarks.eval_format import FPS, describe, read_sequence
from kpopnet.benchmarks.headings import heading_rad
from kpopnet.benchmarks.joint_maps import checked_map, describe_skipped
from kpopnet.benchmarks.sequences import Origin, Sequence
from kpopnet.benchmarks.stand_ins import open_stand_in, provenance, refuse_simulated, warn_if_unfinished
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

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
        refuse_simulated(self.folder, "EVAL")
        self._names = sequence_names(self.folder)
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
            log.warning("%s: left out %s", name, describe_skipped(found.skipped))
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
        manifest = open_stand_in(self.folder, self.name, "joint_ids", "8 GB")
        self._names = sequence_names(self.folder)
        warn_if_unfinished(self.folder, manifest, len(self._names))
        self.provenance = provenance(manifest)
        self._joint_ids = checked_map(manifest["joint_ids"])
        self.about = (
            f"SIMULATED people in rooms, in the format of EVAL but not EVAL: seed {manifest['seed']}, configuration "
            f"{manifest['hash']}; {len(self._names)} of 24 sequences. People and motions are in no training set."
        )


def sequence_names(folder: Path) -> list[str]:
    """Names of the folder's sequences: the first of every subject, then the second."""
    names = [path.stem for path in folder.glob("seq_*.bin") if re.fullmatch(r"seq_[a-z]+_\d+", path.stem)]
    if not names:
        raise InputError(f"{folder}: no seq_<subject>_<number>.bin there; give the folder that holds seq_a_0.bin")
    return sorted(names, key=lambda name: (int(name.split("_")[2]), name))
