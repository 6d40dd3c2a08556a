"""Recordings of joints frame by frame: points by name, and when they were taken."""

from typing import Any

import numpy as np

from kpopnet.dance.joint_files.points import NamedPoints
from kpopnet.runtime.input_files import check_fields, expect

TIME = "time_s"
TIMES = {TIME: 1.0, "timestamp_ms": 0.001}
"""Names of a frame's time, and seconds per unit."""


def numbers_in(value: Any, lengths: tuple[int, ...], where: str) -> list[float]:
    """A list of numbers or nulls, which are NaN, of one of some lengths."""
    fits = isinstance(value, list) and len(value) in lengths and all(one is None or type(one) in (int, float) for one in value)
    expect(fits, where, f"{lengths[0]} numbers in each point")
    return [np.nan if one is None else float(one) for one in value]


def joint_points(frames: list[dict], fps: float | None, where: str) -> NamedPoints:
    """A recording of frames with "joints" by name."""
    for number, frame in enumerate(frames):
        check_fields(f"{where}: frame {number}", frame, {"joints": dict} | dict.fromkeys(TIMES, float), TIMES)
    names = list(dict.fromkeys(name for frame in frames for name in frame["joints"]))
    values = np.full((len(frames), len(names), 4), np.nan)
    values[..., 3] = 1.0
    places = {name: number for number, name in enumerate(names)}
    for number, frame in enumerate(frames):
        for name, point in frame["joints"].items():
            if point is not None:
                given = numbers_in(point, (3, 4), f"{where}: frame {number}, {name[:40]}")
                values[number, places[name], : len(given)] = given
    time = next((time for time in TIMES if time in frames[0]), TIME)
    times_s = [TIMES[time] * frame[time] for frame in frames if time in frame]
    expect(len(times_s) in (0, len(frames)), where, f"{time} in all frames or in none")
    given_s = np.array(times_s, float) if times_s else None
    return NamedPoints(names, values[..., :3], given_s, np.nan_to_num(values[..., 3]), fps)
