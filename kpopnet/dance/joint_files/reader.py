"""Reads a recording of joints from a file of any of the known formats: a reader for each kind of file."""

import csv
import io
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.dance.joint_files.bvh_motion import bvh_points, read_bvh_motion
from kpopnet.dance.joint_files.points import (
    COCO_NAMES,
    NamedPoints,
    checked_performance,
    frame_times_s,
    named_performance,
    unit_m,
)
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import (
    ArraySchema,
    check_array,
    check_fields,
    expect,
    names_in,
    parsing,
    read_json,
    read_npz,
    read_text,
)
from kpopnet.runtime.untrusted import read_in_child
from kpopnet.skeleton import NUM_JOINTS

SUFFIXES = (".npz", ".bvh", ".csv", ".json")

NPZ_SCHEMA = {
    "joints_m": ArraySchema("fiu", ("frames", NUM_JOINTS, 3), False),
    "keypoints3d_optim": ArraySchema("fiu", ("frames", len(COCO_NAMES), 3), False),
    "keypoints3d": ArraySchema("fiu", ("frames", len(COCO_NAMES), 3), False),
    "points": ArraySchema("fiu", ("frames", "points", 3), False),
    "names": ArraySchema("U", ("points",), False),
    "times_s": ArraySchema("fiu", ("frames",), False),
    "confidence": ArraySchema("fiu", ("frames", None), False),
    "fps": ArraySchema("fiu", (), False),
}
"""joints_m in metres in the camera frame, or keypoints3d in COCO's order, or points and their names; then times_s or fps, and
the confidence of each joint or point."""

TIME = "time_s"
_COLUMN = re.compile(r"(.+?)[ _.:-]?(x|y|z|confidence)", re.IGNORECASE)


def read_performance(path: Path | str, fps: float | None = None) -> Performance:
    """Reads a recording of joints; the ending of the file's name gives the format (docs/dance_scoring.md).

    Joints of .npz files of our own stay in their camera frame, those of all other files are turned to face a level camera (see
    `kpopnet.dance.joint_files.points`). `fps` is the true frame rate of a file that states none or a wrong one. A stranger's
    file is read by `read_strangers_performance`.
    """
    path = Path(path)
    match path.suffix.lower():
        case ".npz":
            return _read_npz(path, fps)
        case ".bvh":
            recorded = bvh_points(read_bvh_motion(path, fps))
        case ".csv":
            recorded = _read_csv(path)
        case ".json":
            recorded = _read_json(path)
        case ".pkl" | ".pickle":
            raise InputError(f"{path}: a pickle can run code when it is opened; save its arrays with numpy.savez first")
        case _:
            raise InputError(f"{path}: expected a file that ends with {', '.join(SUFFIXES)}")
    return named_performance(recorded, str(path), fps)


def read_strangers_performance(path: Path | str, fps: float | None = None) -> Performance:
    """`read_performance` in a process with limits of time and memory, which a hostile file may harm."""
    return Performance(**read_in_child(_arrays, path, fps))


def _arrays(path: Path, fps: float | None) -> dict[str, np.ndarray]:
    found = read_performance(path, fps)
    return {"joints_m": found.joints_m, "times_s": found.times_s, "confidence": found.confidence}


def _read_npz(path: Path, fps: float | None) -> Performance:
    found, source = read_npz(path, NPZ_SCHEMA), str(path)
    times_s, confidence = found.get("times_s"), found.get("confidence")
    stated_fps = float(found["fps"]) if "fps" in found else None
    if "joints_m" in found:
        joints_m = found["joints_m"].astype(np.float64)
        if (unit := unit_m(joints_m, source)) != 1:
            raise InputError(f"{source}: joints_m is in units of {unit:g} m; expected metres")
        times_s = frame_times_s(len(joints_m), times_s, stated_fps, fps, source)
        return checked_performance(joints_m, times_s, confidence, source)
    name = next((name for name in ("keypoints3d_optim", "keypoints3d", "points") if name in found), None)
    if name is None:
        raise InputError(f"{source}: expected an array joints_m, keypoints3d, or points with names")
    expect(name != "points" or "names" in found, source, "an array names, of its points")
    names, points = [str(one) for one in found["names"]] if name == "points" else COCO_NAMES, found[name]
    if confidence is not None:
        check_array(f"{source}: confidence", confidence.shape, confidence.dtype, ArraySchema("fiu", points.shape[:2]))
    return named_performance(NamedPoints(names, points.astype(np.float64), times_s, confidence, stated_fps), source, fps)


def _read_csv(path: Path) -> NamedPoints:
    """Columns NAME_x, NAME_y, NAME_z of each point, NAME_confidence and time_s if known; an empty cell is missing."""
    text = read_text(path).removeprefix("\ufeff")  # which spreadsheets write
    table = csv.reader(io.StringIO(text))
    with parsing(path, "not a CSV file"):
        header = [word.strip() for word in next(table, [])]
        rows = [(table.line_num, row) for row in table if row]
    columns: dict[str, dict[str, int]] = {}
    for number, word in enumerate(header):
        if match := _COLUMN.fullmatch(word):
            columns.setdefault(match[1], {}).setdefault(match[2].lower(), number)
    parts = ("x", "y", "z", "confidence")
    places = {
        name: [own[part] for part in parts if part in own] for name, own in columns.items() if own.keys() >= {"x", "y", "z"}
    }
    expect(bool(places), f"{path}, line 1", f"columns NAME_x, NAME_y, NAME_z, found {names_in(header) or 'none'}")
    expect(bool(rows), str(path), "a line of numbers below the header")
    frames = []
    for line, row in rows:
        expect(len(row) == len(header), f"{path}, line {line}", f"{len(header)} cells as in the header, found {len(row)}")
        joints = {name: [_number(row[place], f"{path}, line {line}") for place in own] for name, own in places.items()}
        times = {TIME: _number(row[header.index(TIME)], f"{path}, line {line}")} if TIME in header else {}
        frames.append({"joints": joints} | times)
    return _joint_points(frames, None, str(path))


def _number(cell: str, where: str) -> float:
    """The number in a cell; NaN for an empty one."""
    try:
        return float(cell) if cell.strip() else np.nan
    except ValueError:
        raise InputError(f"{where}: expected a number, found {cell[:40]!r}") from None


def _read_json(path: Path) -> NamedPoints:
    """One of three kinds of JSON.

    - {"keypoints3d": [[[x, y, z], 17 times], ...], "fps": 60}: COCO's order; keypoints3d_optim is preferred.
    - {"fps": 30, "frames": [{"joints": {"WristLeft": [x, y, z], ...}}, ...]}: names of COCO, of a Kinect or our own; a fourth
      number is the confidence, null or a name left out a missing point. Frames may state time_s instead of fps.
    - {"joint_names": [...], "frames": [{"timestamp_usec": 0, "bodies": [{"body_id": 1, "joint_positions": [...]}]}]}: of Azure
      Kinect's offline processor; see `_azure_points`.
    """
    content, where = read_json(path, non_finite=True), str(path)
    expect(isinstance(content, dict), where, "an object with keypoints3d or frames")
    check_fields(where, content, {"fps": float}, ["fps"])
    fps = float(content["fps"]) if "fps" in content else None
    if (keypoints := content.get("keypoints3d_optim", content.get("keypoints3d"))) is not None:
        expect(isinstance(keypoints, list) and len(keypoints) > 0, where, "keypoints3d, a list of frames")
        count = len(COCO_NAMES)
        points = [_points(frame, count, f"{where}: keypoints3d, frame {number}") for number, frame in enumerate(keypoints)]
        return NamedPoints(COCO_NAMES, np.array(points), fps=fps)
    check_fields(where, content, {"frames": list[dict], "joint_names": list[str]}, ["joint_names"])
    expect(len(content["frames"]) > 0, where, "frames, found none")
    if "joint_names" in content:
        return _azure_points(content["joint_names"], content["frames"], where)
    return _joint_points(content["frames"], fps, where)


def _points(value: Any, count: int, where: str) -> list[list[float]]:
    """A list of `count` points of three numbers or nulls."""
    expect(isinstance(value, list) and len(value) == count, where, f"a list of {count} points")
    return [_numbers(point, (3,), where) for point in value]


def _numbers(value: Any, lengths: tuple[int, ...], where: str) -> list[float]:
    """A list of numbers or nulls, which are NaN, of one of some lengths."""
    fits = isinstance(value, list) and len(value) in lengths and all(one is None or type(one) in (int, float) for one in value)
    expect(fits, where, f"{lengths[0]} numbers in each point")
    return [np.nan if one is None else float(one) for one in value]


def _joint_points(frames: list[dict], fps: float | None, where: str) -> NamedPoints:
    """A recording of frames with "joints" by name."""
    for number, frame in enumerate(frames):
        check_fields(f"{where}: frame {number}", frame, {"joints": dict, TIME: float}, [TIME])
    names = list(dict.fromkeys(name for frame in frames for name in frame["joints"]))
    values = np.full((len(frames), len(names), 4), np.nan)
    values[..., 3] = 1.0
    places = {name: number for number, name in enumerate(names)}
    for number, frame in enumerate(frames):
        for name, point in frame["joints"].items():
            if point is not None:
                given = _numbers(point, (3, 4), f"{where}: frame {number}, {name[:40]}")
                values[number, places[name], : len(given)] = given
    times_s = [frame[TIME] for frame in frames if TIME in frame]
    expect(len(times_s) in (0, len(frames)), where, "time_s in all frames or in none")
    given_s = np.array(times_s, float) if times_s else None
    return NamedPoints(names, values[..., :3], given_s, np.nan_to_num(values[..., 3]), fps)


def _azure_points(names: list[str], frames: list[dict], where: str) -> NamedPoints:
    """The recording of the body that is seen most; times count from the first frame."""
    seen: Counter[int] = Counter()
    for number, frame in enumerate(frames):
        check_fields(f"{where}: frame {number}", frame, {"bodies": list[dict], "timestamp_usec": int})
        for body in frame["bodies"]:
            check_fields(f"{where}: frame {number}", body, {"body_id": int, "joint_positions": list})
            seen[body["body_id"]] += 1
    expect(bool(seen), where, "a body in some frame, found none")
    chosen = seen.most_common(1)[0][0]
    points = np.full((len(frames), len(names), 3), np.nan)
    for number, frame in enumerate(frames):
        for body in frame["bodies"]:
            if body["body_id"] == chosen:
                points[number] = _points(body["joint_positions"], len(names), f"{where}: frame {number}, joint_positions")
    start = frames[0]["timestamp_usec"]
    return NamedPoints(names, points, np.array([(frame["timestamp_usec"] - start) / 1e6 for frame in frames]))
