"""Benchmarks `smmc10` (Ganapathi et al., CVPR 2010) and `smmc10_sim`, its simulated stand-in: one reader for both.

The set's truth is markers on the clothes, not joints in the body. Which marker is where is published only in part; what one
public reader takes for the head and the hands is the default, and the rest of the map is a setting,

    python evaluate.py benchmark=smmc10 benchmark.path=PATH 'benchmark.joints={head: [1, 3], left_hand: 24}'

by the names of `kpopnet.skeleton`; of several markers the mean is taken, and joints that are not named are not judged. A
marker lies some centimetres from its joint, and no source says how far: reports give the raw error and the error after a
constant offset of each joint is taken out (`kpopnet.benchmarks.metrics.without_offsets`). The stand-in's map is in its
manifest, and its truth is markers just the same.
"""

import logging
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.benchmarks.headings import heading_rad
from kpopnet.benchmarks.joint_maps import checked_map, describe_skipped
from kpopnet.benchmarks.sequences import Origin, Sequence
from kpopnet.benchmarks.smmc10_format import FPS, describe, read_sequence
from kpopnet.benchmarks.stand_ins import open_stand_in, provenance, refuse_simulated, warn_if_unfinished
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

log = logging.getLogger(__name__)

KNOWN_MARKERS = {"head": [1, 3], "right_hand": 16, "left_hand": 24}
"""What one public reader takes; it also has 35 and 37 on the left lower leg, 43 and 41 on the right."""

FILE = re.compile(r"(real|sim)(\d+)_(\d+)\.cal\.bin")


@dataclass
class Smmc10Config:
    """Attributes: path: the folder of real01_*.cal.bin. joints: marker, or markers, of each joint; None where none is known."""

    name: str = "smmc10"
    path: str | None = None
    joints: dict[str, Any] = field(default_factory=lambda: dict.fromkeys(JOINT_NAMES) | KNOWN_MARKERS)


@dataclass
class Smmc10SimConfig:
    """Attributes: path: a folder that `python -m synth benchmark=smmc10_sim` wrote."""

    name: str = "smmc10_sim"
    path: str = "data/smmc10_sim"


class Smmc10Benchmark:
    """The original files; what of them is left out is logged, with its number."""

    name = "smmc10"
    origin = Origin.REAL
    truth = "motion-capture markers"
    about = (
        "Real SwissRanger depth. The truth is markers on the body's surface, not joints inside it: read the error after "
        "taking out each joint's constant offset beside the raw one. Joints without a known marker are not judged. The "
        "paper's set."
    )

    def __init__(self, config: Smmc10Config) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder holds no sequences, or simulated ones, or the map of joints is empty or odd.
        """
        if config.path is None:
            raise InputError(
                "benchmark=smmc10 needs benchmark.path=PATH, the folder that holds real01_1.cal.bin and the others"
            )
        self.folder = Path(config.path)
        refuse_simulated(self.folder, "SMMC-10")
        self._names = sequence_names(self.folder)
        self._joint_markers = checked_map(config.joints)
        if not self._joint_markers:
            raise InputError(
                "benchmark=smmc10 needs benchmark.joints, which says which marker is taken for each joint, for instance "
                f"'benchmark.joints={{head: [1, 3], left_hand: 24}}'. {describe(self._path(self._names[0]))}"
            )

    def sequence_names(self) -> list[str]:
        return self._names

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.cal.bin"

    def _identity(self, name: str) -> str:
        return ""  # nobody has published who is in which sequence

    def read(self, name: str) -> Sequence:
        found = read_sequence(self._path(name), self._joint_markers)
        if found.skipped and self.origin is Origin.REAL:  # of its stand-in nothing is lost but what was meant to be
            log.warning("%s: left out %s", name, describe_skipped(found.skipped))
        return Sequence(
            name=name,
            identity=self._identity(name),
            fps=FPS,
            camera=found.camera,
            depth_m=found.depth_m,
            joints_camera_m=found.joints_camera_m,
            visible=np.isfinite(found.joints_camera_m).all(axis=-1),
            yaw_rad=heading_rad(found.joints_camera_m),
            # What the real set shows behind its people our sources do not say. Extraction takes both: who is alone stays.
            alone=False,
        )


class Smmc10SimBenchmark(Smmc10Benchmark):
    """The stand-in."""

    name = "smmc10_sim"
    origin = Origin.SIMULATED
    truth = "simulated markers"

    def __init__(self, config: Smmc10SimConfig) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder holds no sequences, or none that synth made.
        """
        self.folder = Path(config.path)
        manifest = open_stand_in(self.folder, self.name, "joint_markers", "3 GB")
        self._names = sequence_names(self.folder)
        warn_if_unfinished(self.folder, manifest, len(self._names))
        self.provenance = provenance(manifest)
        self._joint_markers = checked_map(manifest["joint_markers"])
        self.about = (
            f"SIMULATED people in rooms, in the format of SMMC-10 but not SMMC-10: seed {manifest['seed']}, configuration "
            f"{manifest['hash']}; {len(self._names)} of 28 sequences. The truth is markers on the skin, as there: read the "
            "error after taking out each joint's constant offset beside the raw one. People and motions are in no training "
            "set."
        )

    def _identity(self, name: str) -> str:
        return name.split("_")[0]


def sequence_names(folder: Path) -> list[str]:
    """Names of the folder's sequences by their number."""
    found = [match for path in folder.glob("*.cal.bin") if (match := FILE.fullmatch(path.name))]
    if not found:
        raise InputError(f"{folder}: no real01_<number>.cal.bin there; give the folder that holds real01_1.cal.bin")
    ordered = sorted(found, key=lambda match: (int(match[3]), match[0]))
    return [match[0].removesuffix(".cal.bin") for match in ordered]
