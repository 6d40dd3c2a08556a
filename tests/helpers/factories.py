"""Small shards of capsule people on a floor in front of a wall; the ground truth is known by construction."""

import json
import zlib
from dataclasses import astuple
from pathlib import Path

import h5py
import numpy as np
from capsule_people import draw_joints
from spheres import draw_spheres, row

from kpopnet.camera import CAMERAS, Camera
from kpopnet.data.shards import FORMAT, VERSION, shard_path
from kpopnet.skeleton import BONES, JOINT_NAMES, NUM_JOINTS, Joint

RADII_M = {Joint.HEAD: 0.1, Joint.NECK: 0.09, Joint.TORSO: 0.14, Joint.RIGHT_HIP: 0.1, Joint.LEFT_HIP: 0.1}
LIMB_RADIUS_M = 0.06
CAMERA_HEIGHT_M = 0.95
WALL_M = 4.0


def draw_person(joints_camera_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W) float32 metres: closely spaced spheres along the bones, 0 elsewhere."""
    at, radii_m = joints_camera_m, {joint: RADII_M.get(joint, LIMB_RADIUS_M) for joint in Joint}
    return draw_spheres((ball for a, b in BONES for ball in row(at[a], at[b], radii_m[a], radii_m[b], 12)), camera)


def draw_room(camera: Camera) -> np.ndarray:
    """(H, W) float32 metres: a wall at WALL_M and a floor CAMERA_HEIGHT_M below a level camera."""
    below = (np.arange(camera.height) - camera.cy) / camera.fy
    floor = np.where(below > 0, CAMERA_HEIGHT_M / np.maximum(below, 1e-9), np.inf)
    return np.repeat(np.minimum(floor, WALL_M)[:, None], camera.width, axis=1).astype(np.float32)


def write_shard(
    folder: Path,
    shard: int = 0,
    count: int = 4,
    *,
    camera: Camera = CAMERAS["kinect_v1"],
    empty: tuple[int, ...] = (),
    kind: str = "clean",
) -> Path:
    """Writes one valid shard into a folder, created if necessary, and returns its path.

    Its samples start at shard * count, and a sample's number seeds its person; the rows `empty` show none. The camera is level;
    a "frozen" shard has the clean depth and an empty ridge image.
    """
    start = shard * count
    room_mm = np.rint(draw_room(camera) * 1000).astype(np.uint16)
    depth_mm = np.zeros((count, camera.height, camera.width), np.uint16)
    joints = np.zeros((count, NUM_JOINTS, 3), np.float32)
    boxes = np.zeros((count, 4), np.int16)
    for number in range(count):
        joints[number] = draw_joints(np.random.default_rng([7, start + number]))
        if number in empty:
            continue
        person_mm = np.rint(draw_person(joints[number], camera) * 1000).astype(np.uint16)
        depth_mm[number] = np.where(person_mm <= room_mm, person_mm, 0)
        y, x = depth_mm[number].nonzero()
        boxes[number] = x.min(), y.min(), x.max() + 1, y.max() + 1
    visible = np.ones((count, NUM_JOINTS), bool)
    visible[list(empty)] = False
    floor = np.array([[0, -1, 0, CAMERA_HEIGHT_M]], np.float32)
    columns = {"box": boxes, "room_mm": room_mm[None], "floor": floor}
    return store_shard(Path(folder), shard, start, depth_mm, joints, visible, camera=camera, kind=kind, **columns)


def store_shard(
    folder: Path,
    shard: int,
    start: int,
    depth_mm: np.ndarray,
    joints_m: np.ndarray,
    visible: np.ndarray,
    *,
    camera: Camera,
    kind: str,
    **columns: np.ndarray,
) -> Path:
    """Writes these samples in the layout of `kpopnet.data.shards`, with default columns where none are given.

    Folders of different names hold different sets.
    """
    count, size = len(depth_mm), depth_mm.shape[1:]
    folder.mkdir(parents=True, exist_ok=True)
    path = shard_path(folder, shard)
    defaults = {
        "box": np.zeros((count, 4), np.int16),
        "body": np.arange(start, start + count),
        "motion": np.array([f"test:made:{start + row}".encode() for row in range(count)], "S48"),
        "yaw": np.zeros(count, np.float32),
        "room": np.zeros(count, np.int16),
        "room_mm": np.full((1, *size), round(1000 * WALL_M), np.uint16),
        "floor": np.zeros((1, 4), np.float32),
    }
    if kind == "frozen":
        defaults["ridge"] = np.zeros(depth_mm.shape, np.uint8)
    with h5py.File(path, "w") as file:
        file.attrs.update(
            {
                "format": FORMAT, "version": VERSION, "kind": kind, "config": json.dumps({"made_by": "tests"}),
                "config_hash": f"{zlib.crc32(folder.name.encode()):012x}", "seed": 7, "split": folder.name, "shard": shard,
                "start": start, "stop": start + count, "packages": json.dumps({}),
                "camera": astuple(camera),
            }
        )  # fmt: skip
        file.attrs["joint_names"] = list(JOINT_NAMES)
        stored = {"depth_mm": depth_mm, "joints_m": joints_m, "visible": visible} | defaults | columns
        for name, values in stored.items():
            packed = {"chunks": (1, *size), "compression": 1, "shuffle": True} if values.shape[1:] == size else {}
            file.create_dataset(name, data=values, **packed)
    return path
