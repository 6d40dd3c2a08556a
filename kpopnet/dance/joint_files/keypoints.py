"""Reads JSON files of points: COCO keypoints, frames of named joints, and what Azure Kinect's offline processor writes."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.dance.joint_files.named_points import COCO_NAMES, NamedPoints
from kpopnet.runtime.input_files import check_budget, check_fields, expect, read_json

MAX_NAMES = 1000


def read_json_points(path: Path) -> NamedPoints:
    """Reads a JSON file of one of three kinds.

    - {"keypoints3d": [[[x, y, z], 17 times], ...], "fps": 60}: COCO's order; keypoints3d_optim is preferred.
    - {"fps": 30, "frames": [{"joints": {"WristLeft": [x, y, z], ...}}, ...]}: names of COCO, of a Kinect or our own; a fourth
      number is the confidence, null or a name left out a missing point. Frames may state time_s instead of fps.
    - {"joint_names": [...], "frames": [{"timestamp_usec": 0, "bodies": [{"body_id": 1, "joint_positions": [...]}]}]}: of Azure
      Kinect. Of several bodies the one that is seen most is read. Times count from the first frame.

    Raises:
        InputError: it is none of them.
    """
    content, where = read_json(path, non_finite=True), str(path)
    expect(isinstance(content, dict), where, "an object with keypoints3d or frames")
    check_fields(where, content, {"fps": float}, ["fps"])
    fps = float(content["fps"]) if "fps" in content else None
    if "keypoints3d" in content or "keypoints3d_optim" in content:
        return NamedPoints(COCO_NAMES, _coco_keypoints(content, where), fps=fps)
    check_fields(where, content, {"frames": list[dict], "joint_names": list[str]}, ["joint_names"])
    frames = content["frames"]
    expect(len(frames) > 0, where, "frames, found none")
    return (
        _azure_points(content["joint_names"], frames, where) if "joint_names" in content else _joint_points(frames, fps, where)
    )


def _coco_keypoints(content: dict[str, Any], where: str) -> np.ndarray:
    """(T, 17, 3) keypoints; null is a missing number."""
    points: Any = content.get("keypoints3d_optim", content.get("keypoints3d"))
    expect(isinstance(points, list) and len(points) > 0, where, "keypoints3d, a list of frames")
    return np.array([_rows(frame, len(COCO_NAMES), f"{where}: keypoints3d, frame {k}") for k, frame in enumerate(points)])


def _rows(value: Any, count: int, where: str) -> list[list[float]]:
    """A list of `count` points of three numbers or nulls."""
    expect(isinstance(value, list) and len(value) == count, where, f"a list of {count} points")
    return [_numbers(point, (3,), where) for point in value]


def _numbers(value: Any, lengths: tuple[int, ...], where: str) -> list[float]:
    """A list of numbers or nulls, which are NaN, of one of some lengths."""
    fits = isinstance(value, list) and len(value) in lengths
    expect(
        fits and all(one is None or type(one) in (int, float) for one in value), where, f"{lengths[0]} numbers in each point"
    )
    return [np.nan if one is None else float(one) for one in value]


def _joint_points(frames: list[dict], fps: float | None, where: str) -> NamedPoints:
    """A recording of frames with "joints" by name."""
    for number, frame in enumerate(frames):
        check_fields(f"{where}: frame {number}", frame, {"joints": dict, "time_s": float}, ["time_s"])
    names = list(dict.fromkeys(name for frame in frames for name in frame["joints"]))
    expect(len(names) <= MAX_NAMES, where, f"at most {MAX_NAMES} names of joints, found {len(names)}")
    check_budget(where, 32 * len(frames) * len(names), f"{len(frames)} frames of {len(names)} joints")
    values = np.full((len(frames), len(names), 4), np.nan)
    values[..., 3] = 1.0
    places = {name: number for number, name in enumerate(names)}
    for number, frame in enumerate(frames):
        for name, point in frame["joints"].items():
            if point is not None:
                given = _numbers(point, (3, 4), f"{where}: frame {number}, {name[:40]}")
                values[number, places[name], : len(given)] = given
    timed = ["time_s" in frame for frame in frames]
    expect(all(timed) or not any(timed), where, "time_s in all frames or in none")
    times_s = np.array([frame["time_s"] for frame in frames], float) if all(timed) else None
    return NamedPoints(names, values[..., :3], times_s, np.nan_to_num(values[..., 3]), fps)


def _azure_points(names: list[str], frames: list[dict], where: str) -> NamedPoints:
    """The recording of the body that is seen most."""
    expect(0 < len(names) <= MAX_NAMES, where, f"1 to {MAX_NAMES} joint_names, found {len(names)}")
    seen: Counter[int] = Counter()
    for number, frame in enumerate(frames):
        at = f"{where}: frame {number}"
        check_fields(at, frame, {"bodies": list[dict], "timestamp_usec": int})
        for body in frame["bodies"]:
            check_fields(at, body, {"body_id": int, "joint_positions": list})
            seen[body["body_id"]] += 1
    expect(bool(seen), where, "a body in some frame, found none")
    chosen = seen.most_common(1)[0][0]
    check_budget(where, 24 * len(frames) * len(names), f"{len(frames)} frames of {len(names)} joints")
    points = np.full((len(frames), len(names), 3), np.nan)
    for number, frame in enumerate(frames):
        for body in frame["bodies"]:
            if body["body_id"] == chosen:
                points[number] = _rows(body["joint_positions"], len(names), f"{where}: frame {number}, joint_positions")
    start = frames[0]["timestamp_usec"]
    return NamedPoints(names, points, np.array([(frame["timestamp_usec"] - start) / 1e6 for frame in frames]))
