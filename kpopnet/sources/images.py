"""Depth from images: 16-bit PNG and TIFF, one file a frame."""

import re
import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import parsing
from kpopnet.sources.camera_files import read_optics
from kpopnet.sources.source import Recording, StoredImage, check_size

SUFFIXES = (".png", ".tif", ".tiff")
CAMERA_FILE = "camera.json"
"""Name of the camera's file in a folder of images."""

DEPTH_MODES = ("I;16", "I;16B", "I;16L", "I", "F")
"""Pillow's names of images of one channel of 16 bits, 32 bits and floating-point numbers."""


def read_folder(folder: Path, key: str | None) -> Recording:
    """A folder of images in the natural order of their names: 2 before 10. A file camera.json in it describes the camera.

    `key` is a pattern of names; None takes all images.
    """
    pattern = "*" if key is None else key
    try:
        paths = [path for path in folder.glob(pattern) if path.suffix.lower() in SUFFIXES and not path.name.startswith(".")]
    except (OSError, ValueError, NotImplementedError) as error:
        raise InputError(f"{folder}: images named {pattern} cannot be listed ({error})") from error
    if not paths:
        raise InputError(f"{folder}: no image named {pattern} in it; expected 16-bit PNG or TIFF files of depth")
    return read_images(sorted(paths, key=_natural), folder / CAMERA_FILE)


def read_images(paths: Sequence[Path], camera_file: Path | None = None) -> Recording:
    """Images of one size, and their camera if its file is there."""
    height, width = _read(paths[0]).shape
    known = camera_file is not None and camera_file.is_file()
    camera, lens = read_optics(camera_file, width, height) if known else (None, None)

    def images() -> Iterator[StoredImage]:
        return (StoredImage(_read(path), str(path)) for path in paths)

    return Recording(images, width, height, len(paths), camera=camera, lens=lens)


def _natural(path: Path) -> list[tuple[int, int | str]]:
    """A key that orders names by the numbers in them."""
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in re.split(r"([0-9]+)", path.name)]


def _read(path: Path) -> np.ndarray:
    """(H, W) uint16 millimetres or float metres."""
    opened = partial(Image.open, path, formats=("PNG", "TIFF"))
    with parsing(str(path), "not a PNG or TIFF image, or damaged"), warnings.catch_warnings(action="error"):
        with opened() as image:
            image.verify()  # Pillow does not compare the checksums of PNG when it unpacks the pixels
        with opened() as image:
            return _unpacked(path, image)


def _unpacked(path: Path, image: Image.Image) -> np.ndarray:
    check_size(str(path), *image.size)
    if image.mode not in DEPTH_MODES:
        raise InputError(
            f"{path}: an image of Pillow's mode {image.mode}; expected depth of one channel: 16-bit millimetres, or "
            "floating-point metres (TIFF). Colour and 8-bit images do not hold depth"
        )
    stored = np.array(image)
    if stored.dtype.kind == "i" and stored.min() >= 0 and stored.max() <= np.iinfo(np.uint16).max:
        return stored.astype(np.uint16)  # Pillow before 11 opens 16-bit PNG as 32 bits
    return stored
