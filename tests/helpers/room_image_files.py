"""Room images of a box-like person at different places before a wall, by two cameras in turns; and crops of such scenes."""

import json
from dataclasses import astuple
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera
from kpopnet.data import person_masks
from kpopnet.data.canvas import CANVAS
from kpopnet.data.person_masks import CROP_PX, OTHER, OWN, THEIRS
from kpopnet.data.room_images import MOST_PEOPLE, SCHEMA
from kpopnet.runtime.atomic_write import atomic_hdf5
from kpopnet.runtime.hdf5_files import Hdf5Schema

CAMERAS = Camera.centred(120.0, 160, 120), Camera(100.0, 100.0, 70.0, 66.0, 150, 112)


def write_room_images(folder: Path, count: int = 8) -> Path:
    """Writes one file of images and a manifest, whose hash and split are the folder's name, and returns the folder."""
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
    return _written(folder, "images_00000.h5", SCHEMA, arrays)


def write_person_masks(folder: Path, count: int = 8) -> Path:
    """Likewise crops around persons whom the finder takes for wider on one side and narrower on the other than they are, beside
    another.
    """
    size = (count, CROP_PX, CROP_PX)
    arrays = {
        "depth_mm": np.full(size, 2800, np.uint16),
        "labels": np.zeros(size, np.uint8),
        "centres_m": np.tile(np.float32([0.1, 0, 2]), (count, 1)),
    }
    for k, (depth_mm, labels) in enumerate(zip(arrays["depth_mm"], arrays["labels"], strict=True)):
        depth_mm[10:86, 34 + k : 58 + k] = depth_mm[10:86, 72 + k :] = 2000
        labels[10:86, 38 + k : 62 + k], labels[10:86, 72 + k :] = OWN, OTHER
        labels[10:86, 34 + k : 58 + k] |= THEIRS
        depth_mm[:, :4] = 0
    return _written(folder, "masks_00000.h5", person_masks.SCHEMA, arrays)


def _written(folder: Path, name: str, schema: Hdf5Schema, arrays: dict[str, np.ndarray]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "manifest.json").write_text(json.dumps({"hash": folder.name, "config": {"benchmark": {"split": folder.name}}}))
    with atomic_hdf5(folder / name) as file:
        file.attrs["format"], file.attrs["version"] = schema.fixed["format"], schema.fixed["version"]
        for one, array in arrays.items():
            file.create_dataset(one, data=array)
    return folder
