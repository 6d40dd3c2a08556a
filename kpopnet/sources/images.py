"""Depth from images: 16-bit PNG and TIFF, one file a frame."""

import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from kpopnet.errors import InputError
from kpopnet.sources.camera_files import read_camera
from kpopnet.sources.source import Recording, StoredImage, check_size

SUFFIXES = (".png", ".tif", ".tiff")
CAMERA_FILE = "camera.json"
"""Name of the camera's file in a folder of images."""

DEPTH_MODES = ("I;16", "I;16B", "I;16L", "I", "F")
"""Pillow's names of images of one channel of 16 bits, 32 bits and floating-point numbers."""


def read_folder(folder: Path, key: str | None) -> Recording:
    """A folder of images in the natural order of their names: 2 before 10.

    Args:
        folder: the folder; a file camera.json in it tells the camera.
        key: a pattern of names; None takes all images.

    Raises:
        InputError: no image in it, or the first one is no depth.
    """
    pattern = "*" if key is None else key
    try:
        paths = [path for path in folder.glob(pattern) if path.suffix.lower() in SUFFIXES and not path.name.startswith(".")]
    except (OSError, ValueError, NotImplementedError) as error:
        raise InputError(f"{folder}: images named {pattern} cannot be listed ({error})") from error
    if not paths:
        raise InputError(f"{folder}: no image named {pattern} in it; expected 16-bit PNG or TIFF files of depth")
    camera_file = folder / CAMERA_FILE
    return _recording(sorted(paths, key=_natural), camera_file if camera_file.is_file() else None)


def read_image(path: Path, key: str | None) -> Recording:
    """A single image.

    Raises:
        InputError: it is no depth image, or a key is given.
    """
    if key is not None:
        raise InputError(f"{path}: an image has no arrays by name, such as {key}")
    return _recording([path], None)


def _recording(paths: Sequence[Path], camera_file: Path | None) -> Recording:
    height, width = _read(paths[0]).shape
    camera = None if camera_file is None else read_camera(camera_file, width, height)

    def images() -> Iterator[StoredImage]:
        return (StoredImage(_read(path), str(path)) for path in paths)

    return Recording(images, width, height, len(paths), camera=camera)


def _natural(path: Path) -> list[tuple[int, int | str]]:
    """A key that orders names by the numbers in them."""
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in re.split(r"([0-9]+)", path.name)]


def _read(path: Path) -> np.ndarray:
    """(H, W) uint16 millimetres or float metres.

    Raises:
        InputError: damaged, colour or 8 bits, or too large.
    """
    try:
        with warnings.catch_warnings(action="error"), Image.open(path, formats=("PNG", "TIFF")) as image:
            check_size(str(path), *image.size)
            if image.mode not in DEPTH_MODES:
                raise InputError(
                    f"{path}: an image of Pillow's mode {image.mode}; expected depth of one channel: 16-bit millimetres, or "
                    "floating-point metres (TIFF). Colour and 8-bit images do not hold depth"
                )
            stored = np.array(image)
    except UnidentifiedImageError as error:
        raise InputError(f"{path}: not a PNG or TIFF image, or damaged") from error
    except InputError:
        raise
    except Exception as error:  # of decoders, among others struct.error and zlib.error
        reason = next(iter(str(error).splitlines()), type(error).__name__)[:200]
        raise InputError(f"{path}: a damaged image ({reason}); remove it or write it again") from error
    if stored.dtype.kind == "i" and stored.min() >= 0 and stored.max() <= np.iinfo(np.uint16).max:
        return stored.astype(np.uint16)  # Pillow before 11 opens 16-bit PNG as 32 bits
    return stored
