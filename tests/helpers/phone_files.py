"""Recordings of the LiDAR of a phone as Stray Scanner and Record3D write them, with rows of confidence 0 at the top."""

import json
import zipfile
from pathlib import Path

import numpy as np
from depth_files import FPS
from PIL import Image

from kpopnet.camera import Camera

STRAY_COLOUR = Camera(1440.0, 1440.0, 963.5, 715.5, 1920, 1440)
RECORD3D_COLOUR = Camera(720.0, 720.0, 355.5, 483.5, 720, 960)
UNSURE_ROWS = 3


def confidence(shape: tuple[int, ...]) -> np.ndarray:
    """0, 1 and 2."""
    found = np.full(shape, 2, np.uint8)
    found[:UNSURE_ROWS], found[UNSURE_ROWS] = 0, 1
    return found


def write_stray(folder: Path, images: np.ndarray, fps: float = FPS) -> Path:
    """Writes (T, H, W) uint16 millimetres."""
    for name in ("depth", "confidence"):
        (folder / name).mkdir(parents=True)
    for number, image in enumerate(images):
        Image.fromarray(image).save(folder / "depth" / f"{number:06d}.png")
        Image.fromarray(confidence(image.shape)).save(folder / "confidence" / f"{number:06d}.png")
    c = STRAY_COLOUR
    (folder / "camera_matrix.csv").write_text(f"{c.fx}, 0.0, {c.cx}\n0.0, {c.fy}, {c.cy}\n0.0, 0.0, 1.0\n")
    rows = [f"{7000 + number / fps:.6f}, {number:06d}, 0.1, 0.2, 0.3, 0, 0, 0, 1" for number in range(len(images))]
    (folder / "odometry.csv").write_text("\n".join(["timestamp, frame, x, y, z, qx, qy, qz, qw", *rows]))
    return folder


def write_record3d(path: Path, images: np.ndarray, fps: float = FPS, with_confidence: bool = True, **changed: object) -> Path:
    """Writes (T, H, W) uint16 millimetres; `changed` replaces names of the metadata, or removes them."""
    import lzfse

    c = RECORD3D_COLOUR
    about = {
        "w": c.width, "h": c.height, "dw": images.shape[2], "dh": images.shape[1], "fps": fps, "cameraType": 1,
        "K": [c.fx, 0, 0, 0, c.fy, 0, c.cx, c.cy, 1], "initPose": [0, 0, 0, 1, 0, 0, 0],
        "frameTimestamps": [7000 + number / fps for number in range(len(images))],
    }  # fmt: skip
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "metadata", json.dumps({name: value for name, value in (about | changed).items() if value is not None})
        )
        archive.writestr("icon", b"jpg")
        for number, image in enumerate(images):
            archive.writestr(f"rgbd/{number}.depth", lzfse.compress((image.astype("<f4") / 1000).tobytes()))
            if with_confidence:
                archive.writestr(f"rgbd/{number}.conf", lzfse.compress(confidence(image.shape).tobytes()))
    return path
