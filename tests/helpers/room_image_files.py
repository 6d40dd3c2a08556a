"""Room images of a box-like person at different places before a wall, by two cameras in turns."""

import json
from dataclasses import astuple
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera
from kpopnet.data.canvas import CANVAS
from kpopnet.data.room_images import MOST_PEOPLE, SCHEMA
from kpopnet.runtime.atomic_write import atomic_hdf5

CAMERAS = Camera.centred(120.0, 160, 120), Camera(100.0, 100.0, 70.0, 66.0, 150, 112)


def write_room_images(folder: Path, count: int = 8) -> Path:
    """Writes one file of images and a manifest, whose hash is the folder's name, and returns the folder."""
    arrays = {
        "depth_mm": np.zeros((count, CANVAS[1], CANVAS[0]), np.uint16),
        "labels": np.zeros((count, CANVAS[1], CANVAS[0]), np.uint8),
        "cameras": np.zeros((count, 6)),
        "joints_m": np.full((count, MOST_PEOPLE, 15, 3), np.nan, np.float32),
        "whole_px": np.zeros((count, MOST_PEOPLE), np.float32),
    }
    for k in range(count):
        camera, left = CAMERAS[k % 2], 20 + 12 * k
        arrays["cameras"][k] = astuple(camera)
        arrays["depth_mm"][k, : camera.height, : camera.width] = 4000
        arrays["depth_mm"][k, 20:100, left : left + 28] = 2000
        arrays["labels"][k, 20:100, left : left + 28] = 1
        arrays["joints_m"][k, 0] = camera.back_project(np.array([left + 13.5, 59.5, 2.0]))
        arrays["whole_px"][k, 0] = 80 * 28
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "manifest.json").write_text(json.dumps({"hash": folder.name}))
    with atomic_hdf5(folder / "images_00000.h5") as file:
        file.attrs["format"], file.attrs["version"] = SCHEMA.fixed["format"], SCHEMA.fixed["version"]
        for name, array in arrays.items():
            file.create_dataset(name, data=array)
    return folder
