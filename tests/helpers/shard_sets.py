"""Tiny sets of shards in which the people are boxes."""

from pathlib import Path

import numpy as np
from factories import store_shard

from kpopnet.camera import Camera

CAMERA = Camera.centred(140.0, 80, 60)


def write_shard(
    folder: Path,
    bodies: list[int],
    *,
    shard: int = 0,
    start: int = 0,
    kind: str = "frozen",
    empty: tuple[int, ...] = (),
    rooms: list[int] | None = None,
) -> None:
    """Writes one shard with one sample per body number.

    The person is an upright box with joints along it; sample i is shifted to the right by i % 20 pixels. The rows in
    `empty` show no person. `rooms` are the numbers of the samples' rooms in the set, in ascending order without gaps; by
    default all are in one.
    """
    count = len(bodies)
    depth = np.zeros((count, CAMERA.height, CAMERA.width), np.uint16)
    joints = np.zeros((count, 15, 3), np.float32)
    for i in range(count):
        left = 20 + (start + i) % 20
        depth[i, 10:50, left : left + 12] = 2500
        v, u = np.linspace(12, 47, 15), np.full(15, left + 5.5)
        joints[i] = CAMERA.back_project(np.stack([u, v, np.full(15, 2.5)], axis=-1))
        if i in empty:
            depth[i] = 0
    visible = np.ones((count, 15), bool)
    visible[:, 4] = False
    columns = {"body": np.array(bodies, np.int64), "yaw": np.linspace(-3, 3, count).astype(np.float32)}
    if rooms is not None:
        numbers = np.unique(rooms)
        pictures = np.broadcast_to((4000 + numbers)[:, None, None], (len(numbers), *depth.shape[1:]))
        columns |= {
            "room": (np.array(rooms) - rooms[0]).astype(np.int16),
            "room_mm": pictures.astype(np.uint16),
            "floor": np.zeros((len(numbers), 4), np.float32),
        }
    store_shard(folder, shard, start, depth, joints, visible, camera=CAMERA, kind=kind, **columns)
