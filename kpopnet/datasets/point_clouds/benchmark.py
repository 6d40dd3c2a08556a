"""Common reader of EVAL, SMMC-10 and their simulated stand-ins: one file of organised points per sequence.

The map from the ids in a file to joints is a setting for a published set, and is in the manifest of a simulated set.
"""

import logging
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.datasets.heading import heading_rad
from kpopnet.datasets.manifest import open_stand_in, provenance, refuse_simulated, warn_if_unfinished
from kpopnet.datasets.point_clouds.joint_maps import checked_map, describe_skipped
from kpopnet.datasets.point_clouds.organised import PointSequence
from kpopnet.datasets.protocol import Origin, Sequence
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PointFiles:
    """The file format of a published set and of its stand-in.

    Attributes:
        set_name: name of the published set.
        file_pattern: pattern of the file names, for messages.
        first_file: name of the first file, for messages.
        name_pattern: regular expression of the name of a sequence, with groups `number` and `subject`. The group `subject`
            is None where the name does not contain the person.
        suffix: end of the file name, after the name of the sequence.
        fps: frames per second.
        read: reads a file, given the ids of each joint by the joint's name.
        describe_ids: lists the ids in a file, in a sentence.
    """

    set_name: str
    file_pattern: str
    first_file: str
    name_pattern: re.Pattern
    suffix: str
    fps: float
    read: Callable[[Path, Mapping[str, list[int]]], PointSequence]
    describe_ids: Callable[[Path], str]

    def sequence_names(self, folder: Path) -> list[str]:
        """Names of the sequences in a folder, ordered by number.

        Raises:
            InputError: the folder holds no sequences.
        """
        names = (path.name.removesuffix(self.suffix) for path in folder.glob(f"*{self.suffix}"))
        matches = [match for name in names if (match := self.name_pattern.fullmatch(name))]
        if not matches:
            raise InputError(f"{folder}: no {self.file_pattern} in it; give the folder that holds {self.first_file}")
        return [match[0] for match in sorted(matches, key=lambda match: (int(match["number"]), match[0]))]

    def path(self, folder: Path, name: str) -> Path:
        """Path of the file of a sequence."""
        return folder / f"{name}{self.suffix}"


@dataclass
class PublishedConfig:
    """Settings of a published set.

    Attributes:
        name: of the benchmark.
        path: folder of the files.
        joints: id, or list of ids, of each joint by its name; None where no id is known. The mean of several ids is used.
    """

    name: str
    path: str | None = None
    joints: dict[str, Any] = field(default_factory=lambda: dict.fromkeys(JOINT_NAMES))


@dataclass
class SimulatedConfig:
    """Settings of a simulated set.

    Attributes:
        name: of the benchmark.
        path: folder that `python -m synth benchmark=NAME` wrote.
    """

    name: str
    path: str


class PointBenchmark:
    """Base of the readers. `_joint_ids` holds the ids of each joint by its name."""

    files: ClassVar[PointFiles]
    name: ClassVar[str]
    origin: ClassVar[Origin]

    def sequence_names(self) -> list[str]:
        return self._names

    def read(self, name: str) -> Sequence:
        found = self.files.read(self.files.path(self.folder, name), self._joint_ids)
        if found.skipped and self.origin is Origin.REAL:  # stand-ins lack values on purpose
            log.warning("%s: left out %s", name, describe_skipped(found.skipped))
        return Sequence(
            name=name,
            identity=self.files.name_pattern.fullmatch(name)["subject"] or "",
            fps=self.files.fps,
            camera=found.camera,
            depth_m=found.depth_m,
            joints_camera_m=found.joints_camera_m,
            visible=np.isfinite(found.joints_camera_m).all(axis=-1),
            yaw_rad=heading_rad(found.joints_camera_m),
            # Our sources do not state whether SMMC-10 has a background. The extraction accepts both cases: it keeps a person
            # that is segmented already.
            is_segmented=False,
        )


class PublishedBenchmark(PointBenchmark):
    """Reads the published files; logs kind and number of values that are left out."""

    origin = Origin.REAL

    def __init__(self, config: PublishedConfig) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder holds no sequences or simulated ones, or the joint map is missing or invalid.
        """
        needed = f"benchmark={self.name} needs benchmark."
        if config.path is None:
            raise InputError(f"{needed}path=PATH, the folder that holds {self.files.first_file} and the others")
        self.folder = Path(config.path)
        refuse_simulated(self.folder, self.files.set_name)
        self._names = self.files.sequence_names(self.folder)
        self._joint_ids = checked_map(config.joints)
        if not self._joint_ids:
            raise InputError(
                f"{needed}joints, the map from joints to ids in the files, for instance 'benchmark.joints="
                f"{{head: [1, 3], left_hand: 24}}'. {self.files.describe_ids(self.files.path(self.folder, self._names[0]))}"
            )


class SimulatedBenchmark(PointBenchmark):
    """Reads a simulated stand-in.

    Attributes:
        ids_key: key of the manifest entry with the ids of each joint.
        full_set_sequences: number of sequences of the whole set.
        disk_size: size of the whole set on disk, for messages.
        about_truth: note on the true joints, for the reader of a report.
    """

    origin = Origin.SIMULATED
    ids_key: ClassVar[str]
    full_set_sequences: ClassVar[int]
    disk_size: ClassVar[str]
    about_truth: ClassVar[str] = ""

    def __init__(self, config: SimulatedConfig) -> None:
        """Lists the set's sequences.

        Raises:
            InputError: the folder holds no sequences, or they are not simulated.
        """
        self.folder, set_name = Path(config.path), self.files.set_name
        manifest = open_stand_in(self.folder, self.name, self.ids_key, self.disk_size)
        self._names = self.files.sequence_names(self.folder)
        warn_if_unfinished(self.folder, manifest, len(self._names))
        self.provenance = provenance(manifest)
        self._joint_ids = checked_map(manifest[self.ids_key])
        self.about = (
            f"SIMULATED people in rooms, in the format of {set_name}; this is not {set_name} itself: seed {manifest['seed']}, "
            f"configuration {manifest['hash']}; {len(self._names)} of {self.full_set_sequences} sequences. "
            f"{self.about_truth}People and motions are in no training set."
        )
