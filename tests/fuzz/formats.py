"""A small valid example of every file format that strangers send, and how a program reads it whole."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from bvh_files import write_bvh
from depth_files import CAMERA as DEPTH_CAMERA
from depth_files import depth_mm, write_npz, write_pngs, write_video
from recorded_points import FRAMES, coco
from y_people import y_joints

from kpopnet.dance.joint_files.points import COCO_NAMES
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.sources import open_depth
from kpopnet.sources.camera_files import read_camera
from synth.motion.skeleton import LEG_M, NUM_JOINTS, Motion


class Format(NamedTuple):
    """A file format.

    Attributes:
        make: writes a valid example into an empty folder.
        files: patterns of the files to mutate, below the folder.
        read: reads the example as a program does; raises InputError where it is invalid.
    """

    make: Callable[[Path], object]
    files: tuple[str, ...]
    read: Callable[[Path], object]


def joints(frames: int) -> np.ndarray:
    """(frames, 15, 3) metres of a person whose arms move."""
    return np.stack([y_joints(20 + 2 * frame) for frame in range(frames)]).astype(np.float32)


def make_bvh(folder: Path) -> None:
    quats = np.tile(np.float32([1, 0, 0, 0]), (40, NUM_JOINTS, 1))
    write_bvh(folder / "a.bvh", Motion(quats, np.ones((40, 3), np.float32), 30.0, "still", LEG_M))


def read_dance(folder: Path) -> None:
    for path in sorted(folder.iterdir()):
        read_performance(path)


def read_depth(folder: Path) -> None:
    files = sorted(folder.iterdir())
    for path in [folder] if files[0].suffix in (".png", ".tif") else files:
        for _ in open_depth(path, DEPTH_CAMERA).timed():
            pass


def make_csv(folder: Path) -> None:
    header = ["time_s", *(f"{name}_{axis}" for name in COCO_NAMES for axis in ("x", "y", "z", "confidence"))]
    rows = [[k / 30, *np.append(frame, np.ones((17, 1)), axis=1).round(3).ravel()] for k, frame in enumerate(coco()[:5])]
    (folder / "a.csv").write_text("\n".join([",".join(header), *(",".join(map(str, row)) for row in rows)]))


def make_named_json(folder: Path) -> None:
    frames = [
        {"time_s": k / 30, "joints": dict(zip(COCO_NAMES, frame.tolist(), strict=True))} for k, frame in enumerate(coco()[:3])
    ]
    (folder / "a.json").write_text(json.dumps({"frames": frames}))


def make_azure_json(folder: Path) -> None:
    bodies = [[{"body_id": 1, "joint_positions": (1000 * frame).tolist()}] for frame in coco()[:3]]
    frames = [{"timestamp_usec": 33_333 * k, "bodies": body} for k, body in enumerate(bodies)]
    (folder / "a.json").write_text(json.dumps({"joint_names": COCO_NAMES, "frames": frames}))


def make_points(folder: Path) -> None:
    np.savez(folder / "a.npz", points=coco(), names=np.array(COCO_NAMES), fps=30.0, confidence=np.ones((FRAMES, 17)))


def make_camera(folder: Path) -> None:
    camera = {"fx": 570, "fy": 570, "cx": 320, "cy": 240, "width": 640, "height": 480}
    (folder / "a.json").write_text(json.dumps(camera))


FORMATS = {
    "bvh": Format(make_bvh, ("*.bvh",), read_dance),
    "joints_npz": Format(
        lambda folder: np.savez(folder / "a.npz", joints_m=joints(5), times_s=np.arange(5) / 30, confidence=np.ones((5, 15))),
        ("*.npz",),
        read_dance,
    ),
    "points_npz": Format(make_points, ("*.npz",), read_dance),
    "named_json": Format(make_named_json, ("*.json",), read_dance),
    "azure_json": Format(make_azure_json, ("*.json",), read_dance),
    "joints_csv": Format(make_csv, ("*.csv",), read_dance),
    "camera": Format(make_camera, ("*.json",), lambda folder: read_camera(folder / "a.json", 640, 480)),
    "depth_png": Format(lambda folder: write_pngs(folder, depth_mm(2)), ("*.png",), read_depth),
    "depth_npz": Format(lambda folder: write_npz(folder / "a.npz", depth_mm(3), fps=25.0), ("*.npz",), read_depth),
    "depth_video": Format(lambda folder: write_video(folder / "a.mkv", depth_mm(3)), ("*.mkv",), read_depth),
}
