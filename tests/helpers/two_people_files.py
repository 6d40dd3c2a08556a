"""A small set in the format of `two_people`, of people of cones."""

from pathlib import Path

import numpy as np
from cone_people import cone_body, cone_joints, draw_cones
from simulated_files import write_simulated

from kpopnet.camera import CAMERAS
from kpopnet.datasets.simulated import StoredSequence

CAMERA = CAMERAS["kinect_v1"]
WALL_M = 4.6


STANDING = cone_joints(-70, 6, place_m=(0, 0, 0))


def draw_people(ways_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(T, H, W) uint16 millimetres, (T, P, 15, 3) true joints and (T, P) pixels of people who glide before a wall.

    Their (T, P, 2) ways are x and z in metres.
    """
    joints_m = (STANDING + np.insert(ways_m, 1, 0.15, axis=-1)[:, :, None]).astype(np.float32)
    depth_m, body = np.full((len(ways_m), CAMERA.height, CAMERA.width), WALL_M), cone_body(STANDING)
    pixels = np.zeros(ways_m.shape[:2], np.int32)
    for frame, person in np.ndindex(pixels.shape):
        drawn = draw_cones(joints_m[frame, person], body, CAMERA)
        np.minimum(depth_m[frame], drawn, out=depth_m[frame], where=drawn > 0)
        pixels[frame, person] = np.count_nonzero(drawn)
    return np.rint(1000 * depth_m).astype(np.uint16), joints_m, pixels


def draw_two_people(frames: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`draw_people` for two who glide sideways."""
    x_m = np.linspace(-0.2, 0.2, frames)[:, None] * (1, -1) + (-0.7, 0.7)
    return draw_people(np.stack([x_m, np.full_like(x_m, 2.8)], axis=-1))


def two_people_mm(frames: int) -> np.ndarray:
    """The depth of `draw_two_people`."""
    return draw_two_people(frames)[0]


def write_two_people(folder: Path, frames: int) -> None:
    """Writes one sequence of `draw_two_people`."""
    depth_mm, joints_m, pixels = draw_two_people(frames)
    sequence = StoredSequence(
        "pair_00", "side_by_side", 30.0, CAMERA, ("ann", "bob"), depth_mm, joints_m, alone_px=pixels, seen_px=pixels
    )
    write_simulated(folder, "two_people", {"pair_00": sequence})
