"""Depth of the LiDAR of iPhones and iPads, as two apps record it.

Stray Scanner  a folder: depth/*.png in millimetres, confidence/*.png, odometry.csv with times, and camera_matrix.csv of the
               colour image (https://docs.strayrobots.io/apps/scanner/format.html)
Record3D       an archive .r3d: rgbd/N.depth, float32 metres packed by LZFSE, N.conf, and metadata in JSON with the matrix K of
               the colour image, column by column (https://github.com/marek-simonik/record3d); the extra `record3d`

Pixels of the lowest of three confidences count as not measured.
"""

import csv
import math
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.camera import Camera
from kpopnet.runtime.input_files import check_fields, expect, parse_json, parse_numbers, parsing, read_text
from kpopnet.runtime.provenance import optional_library
from kpopnet.sources.images import CAMERA_FILE, images_in, read_image, read_images
from kpopnet.sources.source import Recording, StoredImage, check_size, rate

STRAY_COLOUR_PX = (1920, 1440)
"""Size of the colour images of Stray Scanner, which its files do not state beside the matrix."""

CENTRED = 0.05
"""A matrix whose centre is farther from that of the image, as a part of its size, is of images of another size."""

METADATA = {"K": list[float], "w": int, "h": int, "dw": int, "dh": int, "fps": float, "frameTimestamps": list[float]}
MAX_METADATA_BYTES, PACKED_MOST = 64_000_000, 2
"""LZFSE stores at most a little more than it was given."""

NOT_RECORD3D = "not a readable archive of Record3D"


def read_stray(folder: Path) -> Recording | None:
    """A recording of Stray Scanner, None for another folder."""
    matrix = folder / "camera_matrix.csv"
    if not matrix.is_file() or not (folder / "depth").is_dir():
        return None
    paths = images_in(folder / "depth", "*")
    expect(bool(paths), str(folder / "depth"), "images of depth")
    found = read_images(paths, folder / CAMERA_FILE, _odometry(folder / "odometry.csv", paths))
    if found.camera is None:
        found = found._replace(camera=_stray_camera(matrix, found.width, found.height))
    if not (folder / "confidence").is_dir():
        return found

    def images() -> Iterator[StoredImage]:
        for path, image in zip(paths, found.images(), strict=True):
            confidence = read_image(folder / "confidence" / path.name, modes=("L",))
            yield image._replace(depth=_confident(image.depth, confidence, str(folder / "confidence" / path.name)))

    return found._replace(images=images)


def _stray_camera(path: Path, width: int, height: int) -> Camera:
    k = parse_numbers(read_text(path), str(path), 9)
    colour = Camera.from_numbers((k[0], k[4], k[2], k[5], *STRAY_COLOUR_PX), str(path))
    centred = all(
        abs(2 * at / size - 1) < 2 * CENTRED for at, size in zip((colour.cx, colour.cy), STRAY_COLOUR_PX, strict=True)
    )
    expect(centred, str(path), f"the matrix of colour images of {STRAY_COLOUR_PX[0]}x{STRAY_COLOUR_PX[1]} pixels; put the "
           f"depth's camera into {CAMERA_FILE} in the folder")  # fmt: skip
    return colour.resized(width, height)


def _odometry(path: Path, images: list[Path]) -> list[float] | None:
    """Seconds of the images since the first, by their numbers; None where the file is missing or lacks one."""
    if not path.is_file():
        return None
    rows = csv.DictReader(read_text(path).splitlines(), skipinitialspace=True)
    with parsing(path, "expected columns timestamp, in seconds, and frame"):
        times_s = {int(row["frame"]): float(row["timestamp"]) for row in rows}
    expect(all(map(math.isfinite, times_s.values())), str(path), "finite times")
    numbers = [int(image.stem) if image.stem.isdecimal() else -1 for image in images]
    return [times_s[number] - times_s[numbers[0]] for number in numbers] if set(numbers) <= set(times_s) else None


def _confident(depth: np.ndarray, confidence: np.ndarray, where: str) -> np.ndarray:
    expect(confidence.shape == depth.shape, where, f"a confidence for each of {depth.shape[1]}x{depth.shape[0]} pixels")
    return np.where(confidence == 0, depth.dtype.type(0), depth)


def read_record3d(path: Path) -> Recording:
    with optional_library(str(path), "lzfse", "record3d"):
        import lzfse
    with parsing(path, NOT_RECORD3D), zipfile.ZipFile(path) as archive:
        held = {info.filename: info for info in archive.infolist()}
        numbers = sorted(int(found[1]) for name in held if (found := re.fullmatch(r"rgbd/([0-9]{1,7})\.depth", name)))
        expect(
            "metadata" in held and bool(numbers), str(path), "metadata and rgbd/N.depth in it: a recording of depth by Record3D"
        )
        expect(held["metadata"].file_size <= MAX_METADATA_BYTES, f"{path}: metadata", f"at most {MAX_METADATA_BYTES:,} bytes")
        about = parse_json(archive.read("metadata"), f"{path}: metadata")
    check_fields(f"{path}: metadata", about, METADATA, ("dw", "dh", "fps", "frameTimestamps"))
    width, height = (about.get(name, about[name[1:]]) for name in ("dw", "dh"))  # the first versions had one size
    k, times_s = about["K"], about.get("frameTimestamps", [])
    check_size(str(path), width, height, len(numbers))
    expect(len(k) == 9, f"{path}: metadata: K", "9 numbers")
    colour = Camera.from_numbers((k[0], k[4], k[6], k[7], about["w"], about["h"]), f"{path}: metadata")
    times_s = [time_s - times_s[0] for time_s in times_s] if len(times_s) == len(numbers) else None

    def part(archive: zipfile.ZipFile, name: str, dtype: Any) -> np.ndarray:
        where, size = f"{path}: {name}", width * height * np.dtype(dtype).itemsize
        expect(held[name].file_size <= PACKED_MOST * size + 1000, where, f"{size:,} bytes, packed by LZFSE")
        with parsing(where, "not packed by LZFSE, or damaged"):
            content = lzfse.decompress(archive.read(name))
        expect(len(content) == size, where, f"{size:,} bytes for {width}x{height} pixels, found {len(content):,}")
        return np.frombuffer(content, dtype).reshape(height, width)

    def images() -> Iterator[StoredImage]:
        with parsing(path, NOT_RECORD3D), zipfile.ZipFile(path) as archive:
            for place, number in enumerate(numbers):
                depth, confidence = part(archive, f"rgbd/{number}.depth", "<f4"), f"rgbd/{number}.conf"
                if confidence in held:
                    depth = _confident(depth, part(archive, confidence, "u1"), f"{path}: {confidence}")
                yield StoredImage(depth, f"{path}: frame {number}", None if times_s is None else times_s[place])

    fps = rate(times_s) or about.get("fps")
    return Recording(images, width, height, len(numbers), fps, colour.resized(width, height))
