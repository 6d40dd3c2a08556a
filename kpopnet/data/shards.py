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

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.data.made_sets import located
from kpopnet.errors import InputError
from kpopnet.runtime.hdf5_files import (
    Hdf5Schema,
    attributes_of,
    kept_open,
    open_hdf5,
    opened_hdf5,
    read_array,
    readable,
    stored_array,
)
from kpopnet.runtime.input_files import ArraySchema, as_path, expect, parse_json
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

FORMAT = "kpopnet-shard"
VERSION = 1
KINDS = ("clean", "frozen")
ROOMS_KEPT = 256
"""Rooms cached by a process: 40 MB at 320x240. Another one costs 0.3 ms to read, half of what its sample costs to observe."""

COLUMNS = {
    "box": ArraySchema("i", ("N", 4)),
    "joints_m": ArraySchema("f", ("N", NUM_JOINTS, 3)),
    "visible": ArraySchema("b", ("N", NUM_JOINTS)),
    "body": ArraySchema("i", ("N",)),
    "motion": ArraySchema("S", ("N",)),
    "yaw": ArraySchema("f", ("N",)),
    "room": ArraySchema("i", ("N",)),
}
SCHEMA = Hdf5Schema(
    name="a shard",
    arrays=COLUMNS
    | {
        "depth_mm": ArraySchema("u", ("N", "H", "W")),
        "ridge": ArraySchema("u", ("N", "H", "W"), required=False),
        "room_mm": ArraySchema("u", ("R", "H", "W")),
        "floor": ArraySchema("f", ("R", 4)),
    },
    attributes=dict.fromkeys(("format", "kind", "config", "config_hash", "split"), str)
    | dict.fromkeys(("version", "seed", "shard", "start", "stop"), int)
    | {"camera": list[float], "joint_names": list[str]},
    fixed={"format": FORMAT, "version": VERSION, "joint_names": list(JOINT_NAMES)},
    remedy="delete it and make it again",
)


def shard_path(folder: Path, shard: int) -> Path:
    return Path(folder) / f"shard_{shard:05d}.h5"


@dataclass(frozen=True)
class Sample:
    """One stored sample: a row of the data sets in the module docstring."""

    depth_mm: np.ndarray
    box: tuple[int, int, int, int]
    joints_camera_m: np.ndarray
    visible: np.ndarray
    body: int
    motion: str
    yaw_rad: float
    room: int
    ridge: np.ndarray | None


class ShardHeader(NamedTuple):
    """Attributes of a shard, described in the module docstring."""

    kind: str
    config: dict
    config_hash: str
    seed: int
    split: str
    start: int
    stop: int
    camera: Camera


def open_shard(path: Path) -> h5py.File:
    """Opens a shard for reading; raises InputError if it is missing, damaged, or not as the module docstring describes it."""
    # Each sample is read once an epoch, and HDF5 would cache 8 MB of every file.
    return opened_hdf5(path, SCHEMA, rdcc_nbytes=0)


def read_header(path: Path) -> ShardHeader:
    """The attributes of a shard; errors as in `open_shard`."""
    with open_hdf5(path, SCHEMA) as file:
        found = attributes_of(file)
        expect(found["kind"] in KINDS, f"{path}: attribute kind", f"{' or '.join(KINDS)}, found {found['kind'][:40]}")
        config = parse_json(found["config"], f"{path}: attribute config")
        expect(isinstance(config, dict), f"{path}: attribute config", "a JSON object")
        camera = Camera.from_numbers(found["camera"], f"{path}: attribute camera")
        declared = (found["stop"] - found["start"], camera.height, camera.width)
        stored = stored_array(file, "depth_mm").shape
        fits = declared[0] > 0 and stored == declared
        expect(fits, f"{path}: depth_mm", f"the shape {declared} by its attributes, found {stored}")
        expect(found["kind"] == "clean" or "ridge" in file, str(path), "an array ridge in a frozen shard")
    found |= {"config": config, "camera": camera}
    return ShardHeader(*(found[name] for name in ShardHeader._fields))


class _OpenShard:
    """An open file with all columns except images in memory: reading one number costs as much as reading a column."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = open_shard(path)
        with readable(path, SCHEMA):
            self.depth_mm, self.room_mm = stored_array(self.file, "depth_mm"), stored_array(self.file, "room_mm")
            self.ridge = stored_array(self.file, "ridge") if "ridge" in self.file else None
            self.columns = {name: read_array(self.file, name) for name in COLUMNS}
            self.floor = read_array(self.file, "floor")
        unknown = np.argwhere(~np.isfinite(self.columns["joints_m"]).all(axis=-1))
        if len(unknown):
            row, joint = unknown[0].tolist()
            raise InputError(f"{path}: joints_m: expected finite metres, found {JOINT_NAMES[joint]} of row {row} unknown")


class ShardedSet:
    """A folder of shards as one random-access sequence of samples.

    Each process opens a file when it first needs it, so a set can be passed to worker processes.
    """

    def __init__(self, folder: Path | str) -> None:
        """Reads every shard's header; raises InputError for no shards, a damaged one, or shards of different sets."""
        self.folder = as_path(folder)
        self.paths = sorted(self.folder.glob("shard_*.h5"))
        if not self.paths:
            raise InputError(
                f"{self.folder}: no shards (shard_00000.h5, ...) in this folder; "
                f"generate some, for instance with: python -m synth preset=small out={self.folder.parent}"
            )
        headers = [read_header(path) for path in self.paths]
        self.header, self._ends = headers[0], [header.stop for header in headers]
        for path, header, end in zip(self.paths, headers, [0, *self._ends[:-1]], strict=True):
            if header.start != end:
                raise InputError(
                    f"{path}: starts with sample {header.start}, but those before end at {end}: shards are missing, or "
                    "remain from a set of another size; run the command that generates the set again"
                )
            found, expected = (f"{one.kind}, {one.camera}, {one.split} {one.config_hash}" for one in (header, self.header))
            expect(found == expected, f"{path}: {found}", f"{expected} as in {self.paths[0].name}")
        self.camera, self.kind = self.header.camera, self.header.kind
        self._open: dict[int, _OpenShard] = {}
        self._rooms: dict[tuple[Path, int], tuple[np.ndarray, np.ndarray]] = {}

    def __len__(self) -> int:
        return self._ends[-1]

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_open": {}, "_rooms": {}}

    def _locate(self, index: int) -> tuple["_OpenShard", int]:
        if not 0 <= index < len(self):
            raise IndexError(f"sample {index} of {len(self)}")
        shard, row = located(self._ends, index)
        return kept_open(self._open, shard, lambda: _OpenShard(self.paths[shard])), row

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
        """Row `room` (see `Sample.room`) of the rooms in the shard of sample `index`; up to ROOMS_KEPT of them are cached.

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
        for path in self.paths:
            with open_hdf5(path, SCHEMA) as file:
                rows.append(read_array(file, name))
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
