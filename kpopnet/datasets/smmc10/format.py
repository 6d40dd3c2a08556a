"""File format of SMMC-10 (Ganapathi et al., CVPR 2010), also written by `python -m synth benchmark=smmc10_sim`.

A file real01_<number>.cal.bin is one sequence: one C struct per frame, and nothing else.

    int32    magic (-1982), frame
    int64    timestamp
    float32  points[25344][3]     organised; metres, x right, y up, z negative in front of the camera
    uint16   dist[25344], amp[25344], conf[25344]     raw values of the SwissRanger; not used here
    int32    nmarkers
    { int32 id, frame; float32 x, y, z, cond; uint32 flag; } markers[64]     visible where cond > 0

The camera was in portrait orientation: point i is at column i // 176 and row i % 176 of an image of 144 x 176. A frame has
458,004 bytes, or 458,008 where the compiler padded it to a multiple of the size of int64. The offset of the second magic
number distinguishes the two layouts.

The reader converts all positions in metres to the camera frame: x right, y down, z forward.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from kpopnet.datasets.point_clouds.joint_maps import describe_map, describe_skipped
from kpopnet.datasets.point_clouds.organised import (
    FROM_OPENGL,
    PointSequence,
    check_marker_count,
    check_sequence_budget,
    depth_of_points,
    fit_camera,
)
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

WIDTH, HEIGHT, LIST_CAPACITY = 144, 176, 64
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
    ("markers", MARKER, LIST_CAPACITY),
]
PACKED = np.dtype(FIELDS)
PADDED = np.dtype(FIELDS, align=True)
FPS = 25.0
FRAMES_PER_BLOCK = 32
"""Number of frames that are read at once: 15 MB."""


def find_layout(path: Path) -> tuple[np.dtype, int]:
    """The layout of the frames in a file, PACKED or PADDED, and their number.

    Raises:
        InputError: the file is missing, empty, not an SMMC-10 sequence, or does not end with a complete frame.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    size = path.stat().st_size
    if not size:
        raise InputError(f"{path}: holds no frame; download it again")
    with path.open("rb") as file:

        def magic_at(offset: int) -> int | None:
            file.seek(offset)
            stored = file.read(4)
            return int.from_bytes(stored, "little", signed=True) if len(stored) == 4 else None

        first = magic_at(0)
        if first != MAGIC:
            raise InputError(f"{path}: begins with magic {first}, SMMC-10 with {MAGIC}: this is not an SMMC-10 sequence")
        for layout in (PACKED, PADDED):
            # A file with one frame has no second magic number, so its length decides.
            if size == layout.itemsize or magic_at(layout.itemsize) == MAGIC:
                frames, rest = divmod(size, layout.itemsize)
                if rest:
                    raise InputError(
                        f"{path}: ends {rest} bytes into frame {frames}; its frames have {layout.itemsize} bytes: the file "
                        "is truncated, download it again"
                    )
                return layout, frames
    raise InputError(
        f"{path}: {size} bytes, and no second frame begins after {PACKED.itemsize} or {PADDED.itemsize} bytes: the file "
        "is truncated, or is not an SMMC-10 sequence"
    )


def read_blocks(path: Path) -> Iterator[np.ndarray]:
    """Yields the frames of a file as arrays of PACKED or PADDED, FRAMES_PER_BLOCK at a time.

    Raises:
        InputError: see `find_layout`; or the header of a frame is invalid.
    """
    layout, frames = find_layout(path)
    for start in range(0, frames, FRAMES_PER_BLOCK):
        block = np.fromfile(path, layout, count=min(FRAMES_PER_BLOCK, frames - start), offset=start * layout.itemsize)
        invalid = (block["magic"] != MAGIC) | (block["nmarkers"] < 0) | (block["nmarkers"] > LIST_CAPACITY)
        if invalid.any():
            frame = int(invalid.argmax())
            raise InputError(
                f"{path}: frame {start + frame} has magic {block['magic'][frame]} and {block['nmarkers'][frame]} markers; "
                f"expected {MAGIC} and 0..{LIST_CAPACITY}: this is not an SMMC-10 sequence, or it is damaged"
            )
        yield block


def image_points(points: np.ndarray) -> np.ndarray:
    """Converts (..., 25344, 3) points from the stored order, column by column, to (..., 176, 144, 3)."""
    return points.reshape(*points.shape[:-2], WIDTH, HEIGHT, 3).swapaxes(-3, -2)


def stored_points(image: np.ndarray) -> np.ndarray:
    """Converts (176, 144, ...) values of any kind to the stored order (25344, ...): the inverse of `image_points`."""
    return image.swapaxes(0, 1).reshape(PIXELS, *image.shape[2:])


def read_sequence(path: Path, joint_markers: Mapping[str, list[int]]) -> PointSequence:
    """Reads the sequence in one file.

    Args:
        path: of the file.
        joint_markers: marker ids by the name of our joint in `kpopnet.skeleton`; the mean of several markers is used. Joints
            that are not in the map are NaN.

    Raises:
        InputError: the file is missing, damaged, or not an SMMC-10 sequence; no pinhole camera fits its points; no frame
            shows the markers in the map.
    """
    _, frames = find_layout(path)
    check_sequence_budget(path, frames, HEIGHT * WIDTH)
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
        check_marker_count(path, markers_m)
    if camera is None:
        raise InputError(
            f"{path}: no point in front of the camera is measured in its {frames} frames "
            f"({describe_skipped(+skipped) or 'all are 0'})"
        )
    mapped = {number for ids in joint_markers.values() for number in ids}
    unmapped = sorted(set(markers_m) - mapped)
    for number in unmapped:
        visible_frames = int(np.isfinite(markers_m[number]).all(axis=1).sum())
        skipped[f"positions of markers that are not in the map ({', '.join(map(str, unmapped))})"] += visible_frames
    for number in sorted(mapped - set(markers_m)):
        skipped[f"frames without marker {number}, which is in the map"] += frames
    joints_m = np.full((frames, NUM_JOINTS, 3), np.nan, np.float32)
    for name, ids in joint_markers.items():
        if set(ids) <= set(markers_m):
            joints_m[:, JOINT_NAMES.index(name)] = np.mean([markers_m[number] for number in ids], axis=0)
    if np.isnan(joints_m).all():
        raise InputError(f"{path}: no frame shows the markers in the map. {describe_map(joint_markers)}. {describe_ids(path)}")
    return PointSequence(camera, depth_m, joints_m, markers_m, +skipped)


def _visible_markers(block: np.ndarray, skipped: Counter[str]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yields (K,) ids and (K, 3) positions in metres in the camera frame of the visible markers of each frame."""
    for frame in block:
        markers = frame["markers"][: frame["nmarkers"]]
        visible = markers["cond"] > 0
        finite = np.isfinite(markers["pos"]).all(axis=1)
        skipped["markers that were not visible"] += int((~visible).sum())
        skipped["visible markers whose position is not finite"] += int((visible & ~finite).sum())
        markers = markers[visible & finite]
        ids, first = np.unique(markers["id"], return_index=True)
        skipped["markers with the id of another marker of the frame"] += len(markers) - len(ids)
        yield ids, markers["pos"][first] * FROM_OPENGL


def describe_ids(path: Path) -> str:
    """Lists the markers in frame 0 of a file."""
    frame = next(read_blocks(path))[0]
    markers = frame["markers"][: frame["nmarkers"]]
    positions = [
        f"{number} at ({x:.2f}, {-y:.2f}, {-z:.2f})" if cond > 0 else f"{number} not visible"
        for number, (x, y, z), cond in zip(markers["id"], markers["pos"].tolist(), markers["cond"], strict=True)
    ]
    return f"Frame 0 of {path} holds markers {', '.join(positions) or 'none'} (metres right, down, forward of the camera)"
