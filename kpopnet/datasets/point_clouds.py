"""Benchmarks `eval` (Ganapathi et al., ECCV 2012) and `smmc10` (Ganapathi et al., CVPR 2010), read as published.

A file is one sequence of C structs, one a frame, and nothing else. A frame has one point for each pixel (metres, x right, y up,
z negative in front of the camera; z = 0: not measured), to which a camera is fitted, and the positions of joints or markers,
which have ids instead of names. EVAL's seq_<subject>_<number>.bin has 930,704 bytes a frame:

    int32    magic, frame
    float32  points[240][320][3]
    int32    nmarkers
    { char name[255]; float32 x, y, z; } markers[32]      one byte of padding after the name; z = 0: absent; not used here
    int32    njoints
    { int32 id; float32 x, y, z; } joints[32]             z = 0: absent

SMMC-10's real01_<number>.cal.bin has 458,004 bytes a frame, or 458,008 where the compiler padded it to a multiple of int64's
size:

    int32    magic (-1982), frame
    int64    timestamp
    float32  points[25344][3]
    uint16   dist[25344], amp[25344], conf[25344]     raw values of the SwissRanger; not used here
    int32    nmarkers
    { int32 id, frame; float32 x, y, z, cond; uint32 flag; } markers[64]     visible where cond > 0

Its camera was in portrait orientation: point i is at column i // 176 and row i % 176 of an image of 144 x 176. Its true
positions are markers on the clothes, not joints in the body: a marker is some centimetres away from its joint, by an
unpublished distance. Reports therefore give the raw error and the error after a constant offset of each joint is subtracted.

Which id is which joint is not published in full, so it is a setting; `kpopnet describe` lists the ids in the files.
configs/benchmark/smmc10.yaml has the map of one public reader for head and hands (which also has 35 and 37 on the left lower
leg, 43 and 41 on the right):

    python evaluate.py benchmark=smmc10 benchmark.path=PATH 'benchmark.joints={head: [1, 3], left_hand: 24}'
"""

import logging
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.camera import Camera
from kpopnet.data.made_sets import MANIFEST
from kpopnet.datasets.protocol import BenchmarkConfig, Origin, Sequence, check_joints, heading_rad
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_budget, expect
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

log = logging.getLogger(__name__)

FROM_OPENGL = np.array([1, -1, -1], np.float32)
"""Multiply a position in the files' axes by this for the camera frame (x right, y down, z forward)."""

MAX_FIT_RMS_PX = 0.5
"""Largest accepted root-mean-square reprojection error of the fitted pinhole camera, in pixels."""


@dataclass
class PointCloudConfig(BenchmarkConfig):
    """Settings of EVAL and SMMC-10.

    Attributes:
        joints: id, or list of ids, of each joint by its name; None where no id is known. The mean of several ids is used.
    """

    joints: dict[str, Any] = field(default_factory=lambda: dict.fromkeys(JOINT_NAMES))


@dataclass(frozen=True)
class PointRecording:
    """The content of a file of T frames, with the pinhole camera fitted to its points."""

    camera: Camera
    depth_m: np.ndarray  # (T, H, W) float32 metres, 0 where nothing was measured
    # (T, 3) float32 metres of each joint or marker in the camera frame by its id, NaN where it is not visible
    positions_m: dict[int, np.ndarray]


class PointCloudBenchmark:
    """Reads the published files of a set; each set adds their layout."""

    name: ClassVar[str]
    origin = Origin.REAL
    set_name: ClassVar[str]
    first_file: ClassVar[str]  # for messages
    name_pattern: ClassVar[re.Pattern]  # of a sequence, with groups `number` and, if it names the person, `subject`
    suffix: ClassVar[str]  # of a file, after the name of the sequence
    fps: ClassVar[float]
    layouts: ClassVar[tuple[np.dtype, ...]]  # of a frame; a file has frames of one of them
    magic: ClassVar[int | None] = None  # of every frame; None for any, which is equal in all frames of a file
    lists: ClassVar[tuple[str, ...]]  # fields with as many entries as n<field> says; the last one has `id` and `pos`
    points_m: ClassVar[Callable[[np.ndarray], np.ndarray]]  # (H, W, 3) points of a frame, in the files' axes
    is_visible: ClassVar[Callable[[np.ndarray], np.ndarray]]  # (M,) bool, which of the M joints or markers of a frame

    def __init__(self, config: PointCloudConfig) -> None:
        """Lists the sequences; raises InputError if there are none, or the joint map is missing or invalid."""
        self.folder = config.folder(f"the folder that holds {self.first_file} and the others")
        if (self.folder / MANIFEST).exists():  # of a set that `synth` wrote
            raise InputError(f"{self.folder}: simulated according to its {MANIFEST}, and not {self.set_name}")
        self._names, self._ids = self.names_in(self.folder), checked_map(config.joints)
        if not self._names:
            raise InputError(
                f"{self.folder}: no sequence of {self.set_name} in it; give the folder that holds {self.first_file}"
            )
        if not self._ids:
            raise InputError(
                f"benchmark={self.name} needs benchmark.joints, the map from joints to ids in the files, for instance "
                f"'benchmark.joints={{head: [1, 3], left_hand: 24}}'; {listing(self.folder)}"
            )

    @classmethod
    def path(cls, folder: Path, name: str) -> Path:
        return folder / f"{name}{cls.suffix}"

    def sequence_names(self) -> list[str]:
        return self._names

    def read(self, name: str) -> Sequence:
        path = self.path(self.folder, name)
        found = self.recording(path)
        joints_m = np.full((len(found.depth_m), NUM_JOINTS, 3), np.nan, np.float32)
        for joint, ids in self._ids.items():
            if set(ids) <= set(found.positions_m):
                joints_m[:, JOINT_NAMES.index(joint)] = np.mean([found.positions_m[number] for number in ids], axis=0)
        if np.isnan(joints_m).all():
            raise InputError(f"{path}: no frame holds the joints of the map {self._ids}; {listing(path)}")
        check_joints(str(path), joints_m)
        mapped = {number for ids in self._ids.values() for number in ids}
        if set(found.positions_m) != mapped:
            log.warning(
                "%s: ids %s are not in the map; ids %s of the map are not in the file",
                *(path, sorted(set(found.positions_m) - mapped)[:20], sorted(mapped - set(found.positions_m))),
            )
        return Sequence(
            name=name,
            identity=self.name_pattern.fullmatch(name).groupdict().get("subject", ""),
            fps=self.fps,
            camera=found.camera,
            depth_m=found.depth_m,
            joints_camera_m=joints_m,
            visible=np.isfinite(joints_m).all(axis=-1),
            yaw_rad=heading_rad(joints_m),
            # Our sources do not state whether SMMC-10 has a background. The extraction accepts both cases: it keeps a person
            # that is segmented already.
            is_segmented=False,
        )

    @classmethod
    def names_in(cls, folder: Path) -> list[str]:
        """Names of the sequences in a folder, ordered by number."""
        names = (path.name.removesuffix(cls.suffix) for path in folder.glob(f"*{cls.suffix}"))
        matches = [match for name in names if (match := cls.name_pattern.fullmatch(name))]
        return [match[0] for match in sorted(matches, key=lambda match: (int(match["number"]), match[0]))]

    @classmethod
    def frames(cls, path: Path) -> np.ndarray:
        """(T,) frames of a file, mapped into memory; raises InputError if it is missing, truncated, or not of this set."""
        if not path.is_file():
            raise InputError(f"{path}: no such file")
        size = path.stat().st_size
        with path.open("rb") as file:
            start = file.read(max(layout.itemsize for layout in cls.layouts) + 4)

        def fits(layout: np.dtype) -> bool:  # one frame, or a second one that begins with the magic of the first
            return size == layout.itemsize or start[:4] == start[layout.itemsize : layout.itemsize + 4]

        layout = next(filter(fits, cls.layouts), cls.layouts[0])
        count, rest = divmod(size, layout.itemsize)
        if rest or not count:
            whole = f"a frame of {cls.set_name} has {layout.itemsize} bytes"
            raise InputError(f"{path}: truncated {rest} bytes into frame {count}; {whole}: download it again")
        frames = np.memmap(path, layout, "r")
        valid = frames["magic"] == (frames["magic"][0] if cls.magic is None else cls.magic)
        for name in cls.lists:
            valid &= (frames[f"n{name}"] >= 0) & (frames[f"n{name}"] <= layout[name].shape[0])
        if not valid.all():
            raise InputError(f"{path}: frame {int(valid.argmin())} is damaged, or this is not a sequence of {cls.set_name}")
        return frames

    @classmethod
    def recording(cls, path: Path) -> PointRecording:
        """Reads a file, and warns of points that are left out; raises InputError as `frames` and `fit_camera`."""
        frames = cls.frames(path)
        height, width = cls.points_m(frames[0]).shape[:2]
        check_budget(path, 4 * len(frames) * height * width, f"the depth of its {len(frames)} frames")
        depth_m, camera, invalid = np.empty((len(frames), height, width), np.float32), None, 0
        positions_m: dict[int, np.ndarray] = {}
        for number, frame in enumerate(frames):
            points_m = cls.points_m(frame)
            z_m = points_m[..., 2]
            measured = np.isfinite(points_m).all(axis=-1) & (z_m < 0)
            invalid += np.count_nonzero(~measured & (z_m != 0))
            depth_m[number] = np.where(measured, -z_m, 0)
            if camera is None and measured.any():
                camera = fit_camera(points_m, str(path))
            found = frame[cls.lists[-1]][: frame[f"n{cls.lists[-1]}"]]
            found = found[np.isfinite(found["pos"]).all(axis=1) & cls.is_visible(found)]
            for identity, position_m in zip(found["id"].tolist(), found["pos"], strict=True):
                track_m = positions_m.setdefault(identity, np.full((len(frames), 3), np.nan, np.float32))
                track_m[number] = position_m * FROM_OPENGL
        if camera is None:
            raise InputError(f"{path}: no point in front of the camera is measured in its {len(frames)} frames")
        if invalid:
            log.warning("%s: left out %d points that are not finite or lie behind the camera", path, invalid)
        return PointRecording(camera, depth_m, positions_m)


def listing(path: Path) -> str:
    """What lists the ids in a file, or in the first file of a folder."""
    return f"`kpopnet describe {path}` lists the ids"


def fit_camera(points_m: np.ndarray, where: str) -> Camera:
    """Fits a pinhole camera to organised points by least squares: u = cx + fx X/(-Z), v = cy - fy Y/(-Z).

    The (H, W, 3) points are in the files' axes, metres; those that are not finite or not in front of the camera are left out.
    Raises InputError, beginning with `where`, if they are too few, or if no camera fits them to MAX_FIT_RMS_PX.
    """
    height, width = points_m.shape[:2]
    v, u = np.mgrid[:height, :width]
    usable = np.isfinite(points_m).all(axis=-1) & (points_m[..., 2] < 0)
    x, y, z = np.moveaxis(points_m[usable].astype(np.float64), -1, 0)
    intrinsics, rms_px = [], []
    for pixel, slope in ((u[usable], x / -z), (v[usable], -y / -z)):
        if not slope.size or np.ptp(slope) < 1e-6:
            raise InputError(f"{where}: too few measured points to fit a camera; download it again")
        matrix = np.stack([slope, np.ones_like(slope)], axis=1)
        (focal_px, centre_px), *_ = np.linalg.lstsq(matrix, pixel.astype(np.float64), rcond=None)
        intrinsics.append((float(focal_px), float(centre_px)))
        rms_px.append(float(np.sqrt(np.mean((matrix @ [focal_px, centre_px] - pixel) ** 2))))
    (fx, cx), (fy, cy) = intrinsics
    if max(rms_px) > MAX_FIT_RMS_PX or min(fx, fy) <= 0:
        raise InputError(
            f"{where}: the best-fitting camera (fx {fx:.1f}, fy {fy:.1f}) has a reprojection error of {max(rms_px):.2f} "
            f"pixels; expected {width}x{height} organised points, x right, y up, z negative in front of the camera"
        )
    return Camera(fx, fy, cx, cy, width, height)


def checked_map(joints: Mapping[str, Any]) -> dict[str, list[int]]:
    """The ids of each joint in a map, which holds an id, a list of ids or None by the joint's name; without None."""
    ids: dict[str, list[int]] = {}
    for name, given in joints.items():
        expect(name in JOINT_NAMES, f"benchmark.joints: {name}", f"one of the joints {', '.join(JOINT_NAMES)}")
        if given is None:
            continue
        own = given if isinstance(given, list) else [given]
        expect(bool(own) and all(type(one) is int for one in own), f"benchmark.joints: {name}", f"ids, found {given!r}")
        for other, others in ids.items():
            expect(set(own) != set(others), f"benchmark.joints: {other} and {name}", f"different ids, found {own} for both")
        ids[name] = own
    return ids


EVAL_FRAME = np.dtype(
    [
        ("magic", "<i4"),
        ("frame", "<i4"),
        ("points", "<f4", (240, 320, 3)),
        ("nmarkers", "<i4"),
        ("markers", [("name", "S256"), ("pos", "<f4", 3)], 32),
        ("njoints", "<i4"),
        ("joints", [("id", "<i4"), ("pos", "<f4", 3)], 32),
    ]
)
SMMC10_FIELDS = [
    ("magic", "<i4"),
    ("frame", "<i4"),
    ("timestamp", "<i8"),
    ("points", "<f4", (144, 176, 3)),
    ("dist", "<u2", 25344),
    ("amp", "<u2", 25344),
    ("conf", "<u2", 25344),
    ("nmarkers", "<i4"),
    ("markers", [("id", "<i4"), ("frame", "<i4"), ("pos", "<f4", 3), ("cond", "<f4"), ("flag", "<u4")], 64),
]


class EvalBenchmark(PointCloudBenchmark):
    """Reads the published EVAL."""

    name = "eval"
    truth = "motion capture"
    about = (
        "Real Kinect depth of whole scenes. The joints come from marker-based motion capture; the authors of the set defined "
        "their positions in the body. The paper evaluates on this set."
    )
    set_name, first_file, suffix, fps = "EVAL", "seq_a_0.bin", ".bin", 30.0
    name_pattern = re.compile(r"seq_(?P<subject>[a-z]+)_(?P<number>\d+)")
    layouts, lists = (EVAL_FRAME,), ("markers", "joints")
    points_m = staticmethod(lambda frame: frame["points"])
    is_visible = staticmethod(lambda joints: joints["pos"][:, 2] != 0)


class Smmc10Benchmark(PointCloudBenchmark):
    """Reads the published SMMC-10."""

    name = "smmc10"
    truth = "motion-capture markers"
    about = (
        "Real SwissRanger depth. The true positions are markers on the surface of the body, not joints inside it. Read the "
        "error after subtracting the constant offset of each joint beside the raw error. Joints without a known marker are "
        "not evaluated. The paper evaluates on this set."
    )
    set_name, first_file, suffix, fps = "SMMC-10", "real01_1.cal.bin", ".cal.bin", 25.0
    name_pattern = re.compile(r"real\d+_(?P<number>\d+)")  # who is recorded is not published
    layouts, magic, lists = (np.dtype(SMMC10_FIELDS), np.dtype(SMMC10_FIELDS, align=True)), -1982, ("markers",)
    points_m = staticmethod(lambda frame: frame["points"].swapaxes(0, 1))
    is_visible = staticmethod(lambda markers: markers["cond"] > 0)
