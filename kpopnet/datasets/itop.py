"""Benchmark `itop` (Haque et al., ECCV 2016; Zenodo record 3932973): real depth of 20 people from the side and from above.

Each view and split has two HDF5 files, which are read as published (decompressed, if they end in .gz):

    ITOP_<side|top>_<train|test>_depth_map.h5     id   (N,) "PP_FFFFF", person and frame
                                                  data (N, 240, 320) float16 metres, 0: not measured
    ITOP_<side|top>_<train|test>_labels.h5        id   (N,) the same
                                                  is_valid (N,) whether the labels were checked by a person
                                                  visible_joints (N, 15)
                                                  real_world_coordinates (N, 15, 3) metres, x right, y up, z forward

Its fifteen joints have the order of `kpopnet.skeleton.Joint`; right is the person's right. Unchecked labels are not used as
true joints, but their frames stay in the sequence, so that a tracker gets all frames. The recording of one person does not fit
into memory: it is split into sequences of at most MAX_SEQUENCE_FRAMES frames.
"""

import logging
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.datasets.protocol import BenchmarkConfig, Origin, Sequence, heading_rad
from kpopnet.errors import InputError, check_one_of
from kpopnet.runtime.hdf5_files import Hdf5Schema, open_hdf5, read_array, stored_array
from kpopnet.runtime.input_files import ArraySchema, expect
from kpopnet.skeleton import NUM_JOINTS

log = logging.getLogger(__name__)

CAMERA = Camera(1 / 0.0035, 1 / 0.0035, 160.0, 120.0, 320, 240)
"""From the formula published with the set: X = (u - 160) Z 0.0035, Y = (120 - v) Z 0.0035."""

VIEWS, SPLITS = ("side", "top"), ("train", "test")
MAX_SEQUENCE_FRAMES = 400  # 120 MB
FROM_ITOP = np.array([1, -1, 1], np.float32)
"""Multiply a position in ITOP's axes (y up) by this for the camera frame (y down)."""

LABELS = Hdf5Schema(
    "labels of ITOP",
    {
        "id": ArraySchema("S", ("N",)),
        "is_valid": ArraySchema("fiub", ("N",)),
        "visible_joints": ArraySchema("fiub", ("N", NUM_JOINTS)),
        "real_world_coordinates": ArraySchema("fiu", ("N", NUM_JOINTS, 3)),
    },
    remedy="download it again",
)
DEPTH = Hdf5Schema(
    "depth of ITOP",
    {"id": ArraySchema("S", ("N",)), "data": ArraySchema("fu", ("N", CAMERA.height, CAMERA.width))},
    remedy="download it again",
)


@dataclass
class ItopConfig(BenchmarkConfig):
    """Settings of the benchmark `itop`.

    Attributes:
        view: side or top.
        split: test or train.
    """

    name: str = "itop"
    view: str = "side"
    split: str = "test"

    def __post_init__(self) -> None:
        for name, known in (("view", VIEWS), ("split", SPLITS)):
            check_one_of(f"benchmark.{name}", getattr(self, name), known)


def _ids(stored: np.ndarray, path: Path) -> list[str]:
    expect(len(stored) > 0, f"{path}: id", "at least one frame")
    ids = [one.decode(errors="replace") if isinstance(one, bytes) else str(one) for one in stored]
    for row, name in enumerate(ids):
        is_id = bool(re.fullmatch("[0-9]{1,9}_[0-9]{1,9}", name))
        expect(is_id, f"{path}: id of row {row}", f"person and frame, for instance 00_00053, found {name[:40]!r}")
    return ids


def split_into_sequences(ids: list[str]) -> dict[str, slice]:
    """The rows of sequences of nearly equal length, each of one person, by the id of the first frame."""
    people = np.array([name.partition("_")[0] for name in ids])
    starts = np.flatnonzero(np.append(True, people[1:] != people[:-1]))
    rows = {}
    for start, stop in zip(starts.tolist(), [*starts[1:].tolist(), len(ids)], strict=True):
        cuts = np.linspace(start, stop, -(-(stop - start) // MAX_SEQUENCE_FRAMES) + 1).round().astype(int).tolist()
        for first, last in pairwise(cuts):
            expect(ids[first] not in rows, f"ITOP: frame {ids[first]}", "each frame once; download the files again")
            rows[ids[first]] = slice(first, last)
    return rows


class ItopBenchmark:
    """Reads the published files of one view and split: ids and labels are in memory, depth is read on demand.

    The official metric of the set is the fraction of the joints of all valid frames with an error strictly below 10 cm.
    """

    name = "itop"
    origin = Origin.REAL
    truth = "manually checked labels"

    def __init__(self, config: ItopConfig) -> None:
        """Reads the labels and lists the sequences; raises InputError if files are missing or invalid."""
        folder = config.folder("the folder that holds ITOP_side_test_depth_map.h5")
        start = f"ITOP_{config.view}_{config.split}"
        labels, self._depth = (folder / f"{start}_{kind}.h5" for kind in ("labels", "depth_map"))
        for path in (labels, self._depth):
            if not path.is_file() and path.with_name(f"{path.name}.gz").is_file():
                raise InputError(f"{path}: no such file; decompress {path.name}.gz: gunzip {path}.gz")
        with open_hdf5(labels, LABELS) as file:
            ids = _ids(read_array(file, "id"), labels)
            self.valid: np.ndarray = read_array(file, "is_valid").astype(bool)  # (N,)
            self.visible = np.equal(read_array(file, "visible_joints"), 1)  # (N, 15)
            joints_m = read_array(file, "real_world_coordinates")
        with np.errstate(over="ignore", invalid="ignore"):
            self.joints_camera_m: np.ndarray = joints_m.astype(np.float32) * FROM_ITOP
        with open_hdf5(self._depth, DEPTH) as file:
            expect(_ids(read_array(file, "id"), self._depth) == ids, f"{self._depth}: id", f"the ids of {labels.name}")
        self._rows, self._from_above = split_into_sequences(ids), config.view == "top"
        self.about = (
            f"Real depth of whole scenes, seen from {'above' if self._from_above else 'the side'}, split {config.split}: "
            f"{int(self.valid.sum())} of {len(ids)} frames have manually checked labels, and only they "
            "are evaluated. The recording of a person is split into several sequences."
        )
        if self._from_above:
            self.about += (
                " The heading of a person is not computed for a camera that looks down. The extraction of the person assumes "
                "an upright camera and may therefore miss people."
            )

    def sequence_names(self) -> list[str]:
        return list(self._rows)

    def read(self, name: str) -> Sequence:
        rows = self._rows[name]
        valid = self.valid[rows]
        joints_m = np.where(valid[:, None, None], self.joints_camera_m[rows], np.nan)
        labelled = np.asarray(np.isfinite(joints_m).all(axis=-1))
        if invalid := int((~labelled[valid]).sum()):
            log.warning("%s: left out %d labels of valid frames that are not finite", name, invalid)
            joints_m[~labelled] = np.nan  # an infinite one would be a joint that no estimator finds
        with open_hdf5(self._depth, DEPTH) as file:
            stored = stored_array(file, "data")[rows]
        return Sequence(
            name=name,
            identity=name.partition("_")[0],
            fps=None,  # not published
            camera=CAMERA,
            depth_m=depth_in_metres(stored, CAMERA, where=str(self._depth)),
            joints_camera_m=joints_m.astype(np.float32),
            visible=self.visible[rows] & labelled,
            yaw_rad=None if self._from_above else heading_rad(joints_m),  # heading_rad assumes an upright camera
            is_segmented=False,
        )
