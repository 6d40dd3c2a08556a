"""SMMC-10's files (Ganapathi et al., CVPR 2010), as published and as `python -m synth benchmark=smmc10_sim` writes them.

A file real01_<number>.cal.bin is one sequence: C structs, one a frame, and nothing else.

    int32    magic (-1982), frame
    int64    timestamp
    float32  points[25344][3]     organised; metres, x right, y up, z negative before the camera
    uint16   dist[25344], amp[25344], conf[25344]     as the SwissRanger gives them; not read here
    int32    nmarkers
    { int32 id, frame; float32 x, y, z, cond; uint32 flag; } markers[64]     visible where cond > 0

The camera was held upright: point i is at column i // 176 and row i % 176 of an image of 144 x 176. A frame has 458,004
bytes, or 458,008 where the compiler filled it up to a whole number of int64; where the second magic lies tells which.

Whatever is here in metres is turned into the camera frame at the door: x right, y down, z forward.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.joint_maps import describe_map, describe_skipped
from kpopnet.benchmarks.organised_points import FROM_OPENGL, PointSequence, depth_of_points, fit_camera
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

WIDTH, HEIGHT, SLOTS = 144, 176, 64
PIXELS = WIDTH * HEIGHT
MAGIC = -1982
MARKER = np.dtype(
    [("id", "<i4"), ("frame", "<i4"), ("pos", "<f4", 3), ("cond", "<f4"), ("flag", "<u4")],
)
FIELDS = [
    ("magic", "<i4"),
    ("frame", "<i4"),
    ("timestamp", "<i8"),
    ("points", "<f4", (PIXELS, 3)),
    ("dist", "<u2", PIXELS),
    ("amp", "<u2", PIXELS),
    ("conf", "<u2", PIXELS),
    ("nmarkers", "<i4"),
    ("markers", MARKER, SLOTS),
]
PACKED = np.dtype(FIELDS)
PADDED = np.dtype(FIELDS, align=True)
FPS = 25.0
BLOCK = 32
"""Frames read at a time, 15 MB."""


def find_layout(path: Path) -> tuple[np.dtype, int]:
    """Whether a file's frames are PACKED or PADDED, and how many it holds.

    Raises:
        InputError: the file is missing, empty, no SMMC-10 sequence, or does not end with a whole frame.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    size = path.stat().st_size
    if not size:
        raise InputError(f"{path}: holds no frame at all; fetch it again")
    with open(path, "rb") as file:

        def magic_at(offset: int) -> int | None:
            file.seek(offset)
            found = file.read(4)
            return int.from_bytes(found, "little", signed=True) if len(found) == 4 else None

        first = magic_at(0)
        if first != MAGIC:
            raise InputError(f"{path}: begins with magic {first}, SMMC-10 with {MAGIC}: this is no SMMC-10 sequence")
        for layout in (PACKED, PADDED):
            # A single frame has no second magic to be known by, only its length.
            if size == layout.itemsize or magic_at(layout.itemsize) == MAGIC:
                frames, rest = divmod(size, layout.itemsize)
                if rest:
                    raise InputError(
                        f"{path}: ends {rest} bytes into frame {frames}; its frames have {layout.itemsize} bytes: the file "
                        "was cut off, fetch it again"
                    )
                return layout, frames
    raise InputError(
        f"{path}: {size} bytes, and no second frame begins after {PACKED.itemsize} or {PADDED.itemsize} of them: the file "
        "was cut off, or is no SMMC-10 sequence"
    )


def read_blocks(path: Path) -> Iterator[np.ndarray]:
    """Yields a file's frames as arrays of PACKED or PADDED, some at a time.

    Raises:
        InputError: see `find_layout`; or a frame's header is none.
    """
    layout, frames = find_layout(path)
    for start in range(0, frames, BLOCK):
        block = np.fromfile(path, layout, count=min(BLOCK, frames - start), offset=start * layout.itemsize)
        odd = (block["magic"] != MAGIC) | (block["nmarkers"] < 0) | (block["nmarkers"] > SLOTS)
        if odd.any():
            frame = int(odd.argmax())
            raise InputError(
                f"{path}: frame {start + frame} has magic {block['magic'][frame]} and {block['nmarkers'][frame]} markers; "
                f"expected {MAGIC} and 0..{SLOTS}: this is no SMMC-10 sequence, or it is torn"
            )
        yield block


def image_points(points: np.ndarray) -> np.ndarray:
    """(..., 25344, 3) as stored, column after column, to (..., 176, 144, 3)."""
    return points.reshape(*points.shape[:-2], WIDTH, HEIGHT, 3).swapaxes(-3, -2)


def stored_points(image: np.ndarray) -> np.ndarray:
    """(176, 144, ...) to (25344, ...): the inverse of `image_points`, of any values."""
    return image.swapaxes(0, 1).reshape(PIXELS, *image.shape[2:])


def read_sequence(path: Path, joint_markers: Mapping[str, list[int]]) -> PointSequence:
    """Reads one file.

    Args:
        path: of the file.
        joint_markers: the ids of the markers whose mean is taken for a joint of ours, by its name in `kpopnet.skeleton`;
            joints of ours that are not named have no truth.

    Raises:
        InputError: the file is missing, torn, or no SMMC-10 sequence; its points are no pinhole camera's; none of the
            markers that the map names is ever visible.
    """
    _, frames = find_layout(path)
    depth_m = np.empty((frames, HEIGHT, WIDTH), np.float32)
    markers_m: dict[int, np.ndarray] = {}
    skipped: Counter[str] = Counter()
    camera, start = None, 0
    for block in read_blocks(path):
        rows = slice(start, start + len(block))
        points = image_points(block["points"])
        depth_m[rows] = depth_of_points(points, skipped)
        if camera is None and depth_m[rows].any():
            camera = fit_camera(points[depth_m[rows].any(axis=(1, 2))][0], str(path))
        for row, (ids, positions_m) in enumerate(_visible_markers(block, skipped), start=start):
            for number, position_m in zip(ids.tolist(), positions_m, strict=True):
                markers_m.setdefault(number, np.full((frames, 3), np.nan, np.float32))[row] = position_m
        start += len(block)
    if camera is None:
        raise InputError(
            f"{path}: not one point is measured before the camera in its {frames} frames "
            f"({describe_skipped(+skipped) or 'all are 0'})"
        )
    named = {number for ids in joint_markers.values() for number in ids}
    unnamed = sorted(set(markers_m) - named)
    for number in unnamed:
        seen = int(np.isfinite(markers_m[number]).all(axis=1).sum())
        skipped[f"places of markers that the map does not name ({', '.join(map(str, unnamed))})"] += seen
    for number in sorted(named - set(markers_m)):
        skipped[f"frames without marker {number}, which the map names"] += frames
    joints_m = np.full((frames, NUM_JOINTS, 3), np.nan, np.float32)
    for name, ids in joint_markers.items():
        if set(ids) <= set(markers_m):
            joints_m[:, JOINT_NAMES.index(name)] = np.mean([markers_m[number] for number in ids], axis=0)
    if np.isnan(joints_m).all():
        raise InputError(
            f"{path}: no frame shows the markers that the map names. {describe_map(joint_markers)}. {describe(path)}"
        )
    return PointSequence(camera, depth_m, joints_m, markers_m, +skipped)


def _visible_markers(block: np.ndarray, skipped: Counter[str]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yields (K,) ids and (K, 3) places in the camera frame for every frame of a block."""
    for frame in block:
        markers = frame["markers"][: frame["nmarkers"]]
        seen = markers["cond"] > 0
        finite = np.isfinite(markers["pos"]).all(axis=1)
        skipped["markers that were not visible"] += int((~seen).sum())
        skipped["visible markers whose place is not finite"] += int((seen & ~finite).sum())
        markers = markers[seen & finite]
        ids, first = np.unique(markers["id"], return_index=True)
        skipped["markers whose id another one of the frame has"] += len(markers) - len(ids)
        yield ids, markers["pos"][first] * FROM_OPENGL


def describe(path: Path) -> str:
    """Which markers a file's frame 0 holds, in a sentence."""
    frame = next(read_blocks(path))[0]
    markers = frame["markers"][: frame["nmarkers"]]
    places = [
        f"{number} at ({x:.2f}, {-y:.2f}, {-z:.2f})" if cond > 0 else f"{number} not visible"
        for number, (x, y, z), cond in zip(markers["id"], markers["pos"].tolist(), markers["cond"], strict=True)
    ]
    return f"Frame 0 of {path} holds markers {', '.join(places) or 'none'} (metres right, down, forward of the camera)"
