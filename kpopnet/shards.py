"""The shard: one HDF5 file of depth samples. `synth` writes shards, training and benchmarks read them.

A set is a folder of files `shard_00000.h5`, `shard_00001.h5`, ... Every file says what it is in its attributes:

    format "kpopnet-shard", version, kind, config (JSON), config_hash, seed, split, shard, start, stop,
    camera (fx, fy, cx, cy, width, height), joint_names, packages (JSON)

and holds N = stop - start samples, one a chunk:

    depth_mm   (N, H, W) uint16  the person alone, 0 elsewhere
    box        (N, 4)    int16   x0, y0, x1, y1 of the person's pixels, x1 and y1 exclusive; all 0 if none are seen
    joints_m   (N, 15, 3) float32  camera frame
    visible    (N, 15)   bool    the joint is in the picture and nothing but its own body part lies in front of it
    body       (N,)      int64   which person; equal numbers in a set are the same person
    motion     (N,)      S48     where the pose came from: "pose:kick", "choreography:0-3@1.2s", "clip:cmu_01_01@3.0s"
    yaw        (N,)      float32 the person's heading in radians, 0 facing the camera, positive to the person's left
    room       (N,)      int16   row of room_mm
    room_mm    (R, H, W) uint16  the empty room as the camera sees it, without noise
    floor      (R, 4)    float32 the room's floor in the camera frame: unit normal n and d with n.x + d = 0, metres

A "clean" set is a perfect camera's: noise, imperfect silhouettes and the ridge image are made when it is read, anew in
every epoch. A "frozen" set has them made already: its depth_mm is what the sensor and the human extraction deliver, and
it holds ridge (N, H, W) uint8 besides, the ridge probability times 255.
"""

import json
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

FORMAT = "kpopnet-shard"
VERSION = 1
KINDS = ("clean", "frozen")
ROOMS_KEPT = 1024
COLUMNS = ("box", "joints_m", "visible", "body", "motion", "yaw", "room")
DATASETS = ("depth_mm", *COLUMNS, "room_mm", "floor")


def shard_path(folder: Path, shard: int) -> Path:
    return Path(folder) / f"shard_{shard:05d}.h5"


@dataclass(frozen=True)
class Sample:
    """One stored sample; the fields are those of the file (see the module)."""

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
    """What a shard says of itself."""

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
        InputError: the file is missing, torn, or not a shard of this version.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such shard")
    try:
        # No lock: any number of readers, also from a read-only or network folder. No chunk cache: a sample is read once an
        # epoch, and HDF5 would keep 8 MB of them for every file.
        file = h5py.File(path, "r", locking=False, rdcc_nbytes=0)
    except OSError as error:
        raise InputError(
            f"{path}: not a readable HDF5 file (truncated or foreign): {error}; delete it and make it again"
        ) from error
    found = file.attrs.get("format"), file.attrs.get("version")
    if found != (FORMAT, VERSION):
        file.close()
        raise InputError(f"{path}: expected a {FORMAT} of version {VERSION}, found {found[0]} of version {found[1]}")
    missing = [name for name in DATASETS if name not in file]
    if missing or tuple(file.attrs["joint_names"]) != JOINT_NAMES:
        file.close()
        raise InputError(f"{path}: not a whole shard: it lacks {missing}" if missing else f"{path}: foreign joints")
    return file


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Names the file where HDF5 fails to read a part of it."""
    try:
        yield
    except (OSError, KeyError) as error:
        raise InputError(f"{path}: a part of it cannot be read ({error}); delete it and make it again") from error


def read_header(path: Path) -> ShardHeader:
    with open_shard(path) as file:
        attrs = file.attrs
        fx, fy, cx, cy, width, height = attrs["camera"]
        return ShardHeader(
            kind=attrs["kind"],
            config=json.loads(attrs["config"]),
            config_hash=attrs["config_hash"],
            seed=int(attrs["seed"]),
            split=attrs["split"],
            shard=int(attrs["shard"]),
            start=int(attrs["start"]),
            stop=int(attrs["stop"]),
            camera=Camera(fx, fy, cx, cy, int(width), int(height)),
        )


class _OpenShard:
    """An open file and, in memory, all of it but the images: a read of one number costs as much as one of a column."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = open_shard(path)
        self.depth_mm = self.file["depth_mm"]
        self.ridge = self.file.get("ridge")
        with readable(path):
            self.columns = {name: self.file[name][()] for name in COLUMNS}


class ShardedSet:
    """A folder of shards as one random-access sequence of samples.

    Files are opened when first needed and once a process, so it can be handed to worker processes.
    """

    def __init__(self, folder: Path | str) -> None:
        """Reads every shard's header.

        Raises:
            InputError: no shards there, a torn one, or shards of different runs.
        """
        self.folder = Path(folder)
        self.paths = sorted(self.folder.glob("shard_*.h5"))
        if not self.paths:
            raise InputError(
                f"{self.folder}: no shards (shard_00000.h5, ...) there; "
                f"make some, for instance with: python -m synth preset=small out={self.folder.parent}"
            )
        headers = [read_header(path) for path in self.paths]
        self.header = headers[0]
        end = 0
        for path, header in zip(self.paths, headers, strict=True):
            if header.start != end:
                raise InputError(
                    f"{path}: starts with sample {header.start}, but those before end at {end}: shards are missing, or "
                    "left over from another size of the set; run the command that makes the set again"
                )
            end = header.stop
            if (header.config_hash, header.split) != (self.header.config_hash, self.header.split):
                raise InputError(
                    f"{path}: made by another configuration than {self.paths[0].name} "
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
            self._open[shard] = _OpenShard(self.paths[shard])
        return self._open[shard], index - (self._ends[shard - 1] if shard else 0)

    def __getitem__(self, index: int) -> Sample:
        shard, row = self._locate(index)
        columns = shard.columns
        with readable(shard.path):
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
        """Row `room` of the rooms in the shard of sample `index`, as `Sample.room` names it; many stay in memory.

        Returns:
            (H, W) uint16 millimetres of the empty room, and its (4,) float32 floor.
        """
        shard, _ = self._locate(index)
        key = shard.path, room
        if key not in self._rooms:
            if len(self._rooms) >= ROOMS_KEPT:
                self._rooms.pop(next(iter(self._rooms)))
            with readable(shard.path):
                self._rooms[key] = shard.file["room_mm"][room], shard.file["floor"][room]
        return self._rooms[key]

    def column(self, name: str) -> np.ndarray:
        """A whole per-sample dataset other than an image (joints_m, body, motion, ...), over all shards."""
        rows = []
        for path in self.paths:
            with open_shard(path) as file, readable(path):
                rows.append(file[name][:])
        return np.concatenate(rows)
