"""One HTML page that shows joints and depth of a recording in 3D; it needs no other file and no network.

The page's own program is `view_page.html` beside this file. Numbers are stored in it as base64 of whole millimetres.
"""

import base64
import html
import json
from collections.abc import Sequence
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.skeleton import BONES, JOINT_NAMES

MISSING = -32768
FARTHEST_M = 32.0
"""Points beyond are left out: they do not fit into 16 bits of millimetres."""

MOST_CLOUDS, MOST_CLOUD_POINTS, MOST_POINTS = 300, 6000, 750_000
"""Frames of the page with depth, points in each, and points in all: 4.5 MB."""

PEOPLE_SHARE, AROUND_M = 0.7, 0.3
"""Share of a cloud's points that lies on people, if people have that many, and how far around their joints a person reaches."""

MOST_JOINT_BYTES = 2_500_000
"""With the points, and a third more as base64, the page stays below 10 MB."""

BYTES_PER_FRAME = len(JOINT_NAMES) * 7 + 4


class Shown(NamedTuple):
    """One person of the page."""

    joints_camera_m: np.ndarray  # (T, 15, 3) metres, NaN where missing
    confidence: np.ndarray  # (T, 15) in 0..1
    label: str = ""  # what is written above the head, and in the legend for a reference
    reference: bool = False  # drawn thin and in a colour of its own, as true joints beside estimated ones


class Cloud(NamedTuple):
    """What the camera saw in one frame: (N, 3) metres."""

    frame: int
    points_camera_m: np.ndarray


def cloud_frames(frames: int) -> range:
    """The frames of a recording whose depth the page shows: all, or evenly spaced ones."""
    return range(0, frames, -(-frames // MOST_CLOUDS))


def sampled_cloud(frame: int, depth_m: np.ndarray, camera: Camera, people_camera_m: Sequence[np.ndarray], clouds: int) -> Cloud:
    """Some points of an (H, W) depth image in metres, denser on people with (15, 3) joints in metres.

    The frame's number seeds the choice. All clouds of the page share MOST_POINTS.
    """
    most = min(MOST_CLOUD_POINTS, MOST_POINTS // clouds)
    points = camera.points(depth_m)[(depth_m > 0) & (depth_m < FARTHEST_M)]
    near = np.zeros(len(points), bool)
    for joints_m in people_camera_m:
        known = joints_m[np.isfinite(joints_m).all(axis=1)]
        if len(known):
            near |= ((points > known.min(axis=0) - AROUND_M) & (points < known.max(axis=0) + AROUND_M)).all(axis=1)
    rng = np.random.default_rng(frame)
    on_people = _some(np.flatnonzero(near), round(PEOPLE_SHARE * most), rng)
    others = _some(np.flatnonzero(~near), most - len(on_people), rng)
    return Cloud(frame, points[np.concatenate([on_people, others])])


def _some(indices: np.ndarray, most: int, rng: np.random.Generator) -> np.ndarray:
    return indices if len(indices) <= most else rng.choice(indices, most, replace=False)


def view_page(title: str, camera: Camera, times_s: np.ndarray, people: Sequence[Shown], clouds: Sequence[Cloud]) -> str:
    """The page as text, for frames at (T,) seconds, the main person first and clouds in the order of their frames.

    Of a long recording it holds every second, third, ... frame.
    """
    step = max(1, -(-len(times_s) * max(len(people), 1) * BYTES_PER_FRAME // MOST_JOINT_BYTES))
    kept = slice(None, None, step)
    sizes = [len(cloud.points_camera_m) for cloud in clouds]
    points = np.concatenate([cloud.points_camera_m for cloud in clouds]) if clouds else np.zeros((0, 3))
    data = {
        "joints": JOINT_NAMES,
        "bones": BONES,
        "camera": [camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height],
        "times": packed(np.asarray(times_s[kept] - times_s[0], "<f4")),
        "start": float(times_s[0]),
        "people": [
            {
                "joints": packed(millimetres(person.joints_camera_m[kept])),
                "confidence": packed(np.rint(255 * np.clip(person.confidence[kept], 0, 1)).astype(np.uint8)),
                "label": person.label,
                "reference": person.reference,
            }
            for person in people
        ],
        "clouds": {
            "frames": [cloud.frame // step for cloud in clouds],
            "ends": np.cumsum(sizes, dtype=int).tolist(),
            "points": packed(millimetres(points)),
        },
    }
    page = files("kpopnet.viz").joinpath("view_page.html").read_text(encoding="utf-8")
    page = page.replace("TITLE", html.escape(title.encode("utf-8", "replace").decode()))
    return page.replace('"DATA"', json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"))


def millimetres(points_m: np.ndarray) -> np.ndarray:
    """Little-endian 16-bit millimetres; MISSING where a coordinate is missing or too far."""
    usable = np.isfinite(points_m).all(axis=-1, keepdims=True) & (np.abs(points_m) < FARTHEST_M).all(axis=-1, keepdims=True)
    return np.where(usable, np.rint(np.where(usable, points_m, 0) * MM_PER_METRE), MISSING).astype("<i2")


def packed(numbers: np.ndarray) -> str:
    """The bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(numbers).tobytes()).decode()
