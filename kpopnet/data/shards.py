"""Shards: HDF5 files of depth samples. `synth` writes them; training and benchmarks read them.

A set is a folder of files `shard_00000.h5`, `shard_00001.h5`, ... The attributes of each file describe it:

    format "kpopnet-shard", version, kind, config (JSON), config_hash, seed, split, shard, start, stop,
    camera (fx, fy, cx, cy, width, height), joint_names, packages (JSON)

Its data sets hold N = stop - start samples, one per chunk:

    depth_mm   (N, H, W) uint16  depth of the person, 0 elsewhere
    box        (N, 4)    int16   x0, y0, x1, y1 of the person's pixels, x1 and y1 exclusive; all 0 if there are none
    joints_m   (N, 15, 3) float32  joints in the camera frame, metres
    visible    (N, 15)   bool    the joint is in the image and only its own body part lies in front of it
    body       (N,)      int64   number of the person; equal numbers in a set are the same person
    motion     (N,)      S48     source of the pose: "pose:kick", "choreography:0-3@1.2s", "clip:cmu_01_01@3.0s"
    yaw        (N,)      float32 the person's heading in radians, 0 facing the camera, positive to the person's left
    room       (N,)      int32   row of room_mm
    room_mm    (R, H, W) uint16  noise-free depth of the empty room from the same camera
    floor      (R, 4)    float32 the room's floor in the camera frame: unit normal n and d with n.x + d = 0, metres

A "clean" set holds noise-free depth: sensor noise, imperfect silhouettes and the ridge image are generated when it is
read, with new noise in every epoch. A "frozen" set holds them: its depth_mm includes sensor noise and the errors of human
extraction, and it also holds ridge (N, H, W) uint8, the ridge probability times 255.
"""

from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.hdf5_files import (
    Attribute,
    Described,
    Hdf5Schema,
    StoredArray,
    StoredRows,
    check_hdf5,
    open_hdf5,
    opened_hdf5,
    read_rows,
    readable,
    stored_array,
)
from kpopnet.runtime.input_files import expect, parse_json
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

FORMAT = "kpopnet-shard"
VERSION = 1
KINDS = ("clean", "frozen")
ROOMS_KEPT = 256
"""Rooms cached by a process: 40 MB at 320x240. Another one costs 0.3 ms to read, half of what its sample costs to observe."""
MAX_COORDINATE_M = 1000.0


def _lengths(where: str, attributes: dict[str, Any]) -> dict[str, int]:
    camera = Camera.from_numbers(attributes["camera"], f"{where}: attribute camera")
    count = attributes["stop"] - attributes["start"]
    expect(count > 0, f"{where}: start {attributes['start']}, stop {attributes['stop']}", "start < stop")
    return {"N": count, "H": camera.height, "W": camera.width}


_COUNT = Attribute("iu", low=0, high=2**63 - 1)
COLUMNS = {
    "box": StoredArray("i", ("N", 4)),
    "joints_m": StoredArray("f", ("N", NUM_JOINTS, 3)),
    "visible": StoredArray("b", ("N", NUM_JOINTS)),
    "body": StoredArray("i", ("N",)),
    "motion": StoredArray("S", ("N",)),
    "yaw": StoredArray("f", ("N",)),
    "room": StoredArray("i", ("N",)),
}
SCHEMA = Hdf5Schema(
    name="a shard",
    attributes={
        "format": Attribute("U", equals=FORMAT),
        "version": Attribute("iu", equals=VERSION),
        "kind": Attribute("U", one_of=KINDS),
        "config": Attribute("U"),
        "config_hash": Attribute("U"),
        "seed": Attribute("iu", low=0, high=2**64 - 1),
        "split": Attribute("U"),
        "shard": _COUNT,
        "start": _COUNT,
        "stop": _COUNT,
        "camera": Attribute("fiu", (6,)),
        "refused_poses": Attribute("iu", low=0, required=False),
        "refused_places": Attribute("iu", low=0, required=False),
        "forced_samples": Attribute("iu", low=0, required=False),
        "joint_names": Attribute("U", (NUM_JOINTS,), equals=list(JOINT_NAMES)),
    },
    arrays=COLUMNS
    | {
        "depth_mm": StoredArray("u", ("N", "H", "W"), item_bytes=2, rows_read=1),
        "ridge": StoredArray("u", ("N", "H", "W"), required=False, item_bytes=1, rows_read=1),
        "room_mm": StoredArray("u", ("R", "H", "W"), item_bytes=2, rows_read=1),
        "floor": StoredArray("f", ("R", 4)),
    },
    lengths=_lengths,
    remedy="delete it and make it again",
)


def shard_path(folder: Path, shard: int) -> Path:
    return Path(folder) / f"shard_{shard:05d}.h5"


@dataclass(frozen=True)
class Sample:
    """One stored sample; the fields are described in the module docstring."""

    depth_mm: np.ndarray
    box: tuple[int, int, int, int]
    joints_camera_m: np.ndarray
    visible: np.ndarray
    body: int
    motion: str
    yaw_rad: float
    room: int
    ridge: np.ndarray | None


@dataclass(frozen=True)
class ShardHeader:
    """The attributes of a shard, described in the module docstring."""

    kind: str
    config: dict
    config_hash: str
    seed: int
    split: str
    shard: int
    start: int
    stop: int
    camera: Camera

    def __len__(self) -> int:
        return self.stop - self.start


def open_shard(path: Path) -> h5py.File:
    """Opens a shard for reading.

    Raises:
        InputError: the file is missing, damaged, or not a shard of this version as the module docstring describes it.
    """
    return _opened(path, check_hdf5(Path(path), SCHEMA))


def _opened(path: Path, described: Described) -> h5py.File:
    # No chunk cache: each sample is read once per epoch, and HDF5 would cache 8 MB per file.
    return opened_hdf5(path, SCHEMA, described, rdcc_nbytes=0)


def read_header(path: Path) -> ShardHeader:
    """The attributes of a shard.

    Raises:
        InputError: as `open_shard`.
    """
    return _header(path, check_hdf5(Path(path), SCHEMA))


def _header(path: Path, described: Described) -> ShardHeader:
    attributes = described.attributes
    config = parse_json(attributes["config"], f"{path}: attribute config")
    expect(isinstance(config, dict), f"{path}: attribute config", "a JSON object")
    expect(attributes["kind"] == "clean" or "ridge" in described, str(path), "an array ridge in a frozen shard")
    names = ("kind", "config_hash", "seed", "split", "shard", "start", "stop")
    camera = Camera.from_numbers(attributes["camera"], f"{path}: attribute camera")
    return ShardHeader(config=config, camera=camera, **{name: attributes[name] for name in names})


def _column(file: h5py.File, path: Path, name: str, header: ShardHeader) -> np.ndarray:
    """Reads and checks one of COLUMNS, or `floor`."""
    column, where = read_rows(stored_array(file, name)), f"{path}: {name}"
    if name == "box":
        width, height = header.camera.width, header.camera.height
        x0, y0, x1, y1 = column.T.astype(np.int64)
        inside = (x0 >= 0) & (x0 <= x1) & (x1 <= width) & (y0 >= 0) & (y0 <= y1) & (y1 <= height)
        _expect_rows(inside, column, where, f"x0 <= x1 and y0 <= y1 within {width}x{height} pixels")
    elif name == "joints_m":
        wrong = np.abs(column) > MAX_COORDINATE_M  # not so if NaN
        _expect_rows(~wrong.any(axis=(1, 2)), column, where, f"metres up to {MAX_COORDINATE_M:g}, NaN for missing joints")
    elif name == "visible":
        stored = column.view(np.uint8)
        _expect_rows(~(stored > 1).any(axis=1), stored, where, "0 or 1")
    elif name == "room":
        rooms = len(stored_array(file, "room_mm"))
        _expect_rows((column >= 0) & (column < rooms), column, where, f"a row of the {rooms} in room_mm")
    elif name in ("yaw", "floor"):
        wrong = ~np.isfinite(column).reshape(len(column), -1)
        _expect_rows(~wrong.any(axis=1), column, where, "finite numbers")
    return column


def _expect_rows(valid: Any, column: np.ndarray, where: str, expectation: str) -> None:
    if not valid.all():
        row = int(np.argmin(valid))
        shown = " ".join(str(column[row]).split())[:100]
        raise InputError(f"{where}: row {row} is {shown}, expected {expectation}; {SCHEMA.remedy}")


class _OpenShard:
    """An open file with all columns except images in memory: reading one number costs as much as reading a column."""

    def __init__(self, path: Path, described: Described) -> None:
        self.path = path
        self.file = _opened(path, described)
        header = _header(path, described)
        with readable(path, SCHEMA):
            self.depth_mm = StoredRows(stored_array(self.file, "depth_mm"))
            self.room_mm = StoredRows(stored_array(self.file, "room_mm"))
            self.ridge = StoredRows(stored_array(self.file, "ridge")) if "ridge" in described else None
            self.columns = {name: _column(self.file, path, name, header) for name in COLUMNS}
            visible, missing = self.columns["visible"], np.isnan(self.columns["joints_m"]).any(axis=-1)
            _expect_rows(~(visible & missing).any(axis=1), visible, f"{path}: visible", "no joint whose joints_m is missing")
            self.floor = _column(self.file, path, "floor", header)


class ShardedSet:
    """A folder of shards as one random-access sequence of samples.

    Each process opens a file when it first needs it, so a set can be passed to worker processes.
    """

    def __init__(self, folder: Path | str) -> None:
        """Reads every shard's header.

        Raises:
            InputError: no shards in the folder, a truncated one, or shards of different configurations.
        """
        self.folder = Path(folder)
        self.paths = sorted(self.folder.glob("shard_*.h5"))
        if not self.paths:
            raise InputError(
                f"{self.folder}: no shards (shard_00000.h5, ...) in this folder; "
                f"generate some, for instance with: python -m synth preset=small out={self.folder.parent}"
            )
        self._described = [check_hdf5(path, SCHEMA) for path in self.paths]
        headers = [_header(path, described) for path, described in zip(self.paths, self._described, strict=True)]
        self.header = headers[0]
        end = 0
        for path, header in zip(self.paths, headers, strict=True):
            if header.start != end:
                raise InputError(
                    f"{path}: starts with sample {header.start}, but those before end at {end}: shards are missing, or "
                    "remain from a set of another size; run the command that generates the set again"
                )
            end = header.stop
            expect(
                (header.camera, header.kind) == (self.header.camera, self.header.kind),
                f"{path}: {header.kind}, {header.camera}",
                f"{self.header.kind}, {self.header.camera} as in {self.paths[0].name}",
            )
            if (header.config_hash, header.split) != (self.header.config_hash, self.header.split):
                raise InputError(
                    f"{path}: generated with another configuration than {self.paths[0].name} "
                    f"({header.split} {header.config_hash} against {self.header.split} {self.header.config_hash})"
                )
        self.camera = self.header.camera
        self.kind = self.header.kind
        self._ends = np.cumsum([len(header) for header in headers]).tolist()
        self._open: dict[int, _OpenShard] = {}
        self._rooms: dict[tuple[Path, int], tuple[np.ndarray, np.ndarray]] = {}

    def __len__(self) -> int:
        return self._ends[-1]

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_open": {}, "_rooms": {}}

    def _locate(self, index: int) -> tuple["_OpenShard", int]:
        if not 0 <= index < len(self):
            raise IndexError(f"sample {index} of {len(self)}")
        shard = bisect_right(self._ends, index)
        if shard not in self._open:
            self._open[shard] = _OpenShard(self.paths[shard], self._described[shard])
        return self._open[shard], index - (self._ends[shard - 1] if shard else 0)

    def __getitem__(self, index: int) -> Sample:
        shard, row = self._locate(index)
        columns = shard.columns
        with readable(shard.path, SCHEMA):
            return Sample(
                depth_mm=shard.depth_mm[row],
                box=tuple(columns["box"][row].tolist()),
                joints_camera_m=columns["joints_m"][row],
                visible=columns["visible"][row],
                body=int(columns["body"][row]),
                motion=columns["motion"][row].decode(errors="replace"),
                yaw_rad=float(columns["yaw"][row]),
                room=int(columns["room"][row]),
                ridge=shard.ridge[row] if shard.ridge is not None else None,
            )

    def room(self, index: int, room: int) -> tuple[np.ndarray, np.ndarray]:
        """Row `room` (see `Sample.room`) of the rooms in the shard of sample `index`; up to ROOMS_KEPT rooms are cached.

        Returns:
            (H, W) uint16 depth of the empty room in millimetres, and its (4,) float32 floor plane.
        """
        shard, _ = self._locate(index)
        key = shard.path, room
        if key not in self._rooms:
            if len(self._rooms) >= ROOMS_KEPT:
                self._rooms.pop(next(iter(self._rooms)))
            with readable(shard.path, SCHEMA):
                self._rooms[key] = shard.room_mm[room], shard.floor[room]
        return self._rooms[key]

    def column(self, name: str) -> np.ndarray:
        """A per-sample data set that is no image (joints_m, body, motion, ...), concatenated over all shards."""
        rows = []
        for path, described in zip(self.paths, self._described, strict=True):
            with open_hdf5(path, SCHEMA, described, rdcc_nbytes=0) as file:
                rows.append(_column(file, path, name, _header(path, described)))
        return np.concatenate(rows)

    def room_numbers(self) -> np.ndarray:
        """(N,) int64 number of each sample's room in the set, in the order of the samples.

        Each shard numbers its rooms from 0. A room goes on in the next shard if the empty room has the same depth there.
        """
        row = self.column("room").astype(np.int64)
        begins = np.diff(row, prepend=-1) != 0
        for start in self._ends[:-1]:
            before, after = self.room(start - 1, int(row[start - 1])), self.room(start, int(row[start]))
            begins[start] = not np.array_equal(before[0], after[0])
        return np.cumsum(begins) - 1
