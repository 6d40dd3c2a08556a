"""Sets of files of organised points, one a sequence: what the readers of EVAL, SMMC-10 and their simulated stand-ins share.

Which of a file's ids is which joint is a setting for a published set, and stands in a simulated one's manifest.
"""

import logging
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.benchmarks.headings import heading_rad
from kpopnet.benchmarks.joint_maps import checked_map, describe_skipped
from kpopnet.benchmarks.organised_points import PointSequence
from kpopnet.benchmarks.sequences import Origin, Sequence
from kpopnet.benchmarks.stand_ins import open_stand_in, provenance, refuse_simulated, warn_if_unfinished
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PointFiles:
    """The files of one published set, and of whatever is written in its bytes.

    Attributes:
        published: the set's name.
        called: what files are called, for messages; first: what the first one is.
        pattern: of a sequence's name, with groups `number` and `who`; nobody where the name does not say who it shows.
        suffix: what follows it in the file's name.
        fps: frames a second.
        read: a file, given the ids of each joint by the joint's name.
        describe: which ids a file holds, in a sentence.
    """

    published: str
    called: str
    first: str
    pattern: re.Pattern
    suffix: str
    fps: float
    read: Callable[[Path, Mapping[str, list[int]]], PointSequence]
    describe: Callable[[Path], str]

    def sequence_names(self, folder: Path) -> list[str]:
        """Names of a folder's sequences, by their number.

        Raises:
            InputError: there are none.
        """
        names = (path.name.removesuffix(self.suffix) for path in folder.glob(f"*{self.suffix}"))
        found = [match for name in names if (match := self.pattern.fullmatch(name))]
        if not found:
            raise InputError(f"{folder}: no {self.called} there; give the folder that holds {self.first}")
        return [match[0] for match in sorted(found, key=lambda match: (int(match["number"]), match[0]))]

    def path(self, folder: Path, name: str) -> Path:
        return folder / f"{name}{self.suffix}"


@dataclass
class PublishedConfig:
    """Attributes: path: the folder of the files. joints: id, or ids, of each joint by its name; None where none is known."""

    name: str
    path: str | None = None
    joints: dict[str, Any] = field(default_factory=lambda: dict.fromkeys(JOINT_NAMES))


@dataclass
class SimulatedConfig:
    """Attributes: path: a folder that `python -m synth benchmark=NAME` wrote."""

    name: str
    path: str


class PointBenchmark:
    """Reads a folder of such files; `_joint_ids` are the ids of each joint by its name."""

    files: ClassVar[PointFiles]
    name: ClassVar[str]
    origin: ClassVar[Origin]

    def sequence_names(self) -> list[str]:
        return self._names

    def read(self, name: str) -> Sequence:
        found = self.files.read(self.files.path(self.folder, name), self._joint_ids)
        if found.skipped and self.origin is Origin.REAL:  # of a stand-in nothing is lost but what was meant to be
            log.warning("%s: left out %s", name, describe_skipped(found.skipped))
        return Sequence(
            name=name,
            identity=self.files.pattern.fullmatch(name)["who"] or "",
            fps=self.files.fps,
            camera=found.camera,
            depth_m=found.depth_m,
            joints_camera_m=found.joints_camera_m,
            visible=np.isfinite(found.joints_camera_m).all(axis=-1),
            yaw_rad=heading_rad(found.joints_camera_m),
            # What SMMC-10 shows behind its people our sources do not say. Extraction takes both: who is alone stays.
            alone=False,
        )


class PublishedBenchmark(PointBenchmark):
    """The original files; what of them is left out is logged, with its number."""

    origin = Origin.REAL

    def __init__(self, config: PublishedConfig) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder holds no sequences, or simulated ones, or the map of joints is missing or odd.
        """
        needs = f"benchmark={self.name} needs benchmark."
        if config.path is None:
            raise InputError(f"{needs}path=PATH, the folder that holds {self.files.first} and the others")
        self.folder = Path(config.path)
        refuse_simulated(self.folder, self.files.published)
        self._names = self.files.sequence_names(self.folder)
        self._joint_ids = checked_map(config.joints)
        if not self._joint_ids:
            raise InputError(
                f"{needs}joints, which says which id in the files is which joint, for instance 'benchmark.joints="
                f"{{head: [1, 3], left_hand: 24}}'. {self.files.describe(self.files.path(self.folder, self._names[0]))}"
            )


class SimulatedBenchmark(PointBenchmark):
    """The stand-in.

    Attributes:
        ids_key: where its manifest has the ids of each joint.
        whole, size: how many sequences the whole set has, and what they take on disk.
        about_truth: what a reader of a score must know of the truth.
    """

    origin = Origin.SIMULATED
    ids_key: ClassVar[str]
    whole: ClassVar[int]
    size: ClassVar[str]
    about_truth: ClassVar[str] = ""

    def __init__(self, config: SimulatedConfig) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder holds no sequences, or none that synth made.
        """
        self.folder, published = Path(config.path), self.files.published
        manifest = open_stand_in(self.folder, self.name, self.ids_key, self.size)
        self._names = self.files.sequence_names(self.folder)
        warn_if_unfinished(self.folder, manifest, len(self._names))
        self.provenance = provenance(manifest)
        self._joint_ids = checked_map(manifest[self.ids_key])
        self.about = (
            f"SIMULATED people in rooms, in the format of {published} but not {published}: seed {manifest['seed']}, "
            f"configuration {manifest['hash']}; {len(self._names)} of {self.whole} sequences. {self.about_truth}People and "
            "motions are in no training set."
        )
