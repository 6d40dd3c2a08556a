"""Depth from images: 16-bit PNG, TIFF and PGM, one file a frame."""

import io
import re
import warnings
from collections.abc import Iterator, Sequence
from decimal import Decimal
from functools import partial
from itertools import repeat
from pathlib import Path

import numpy as np
from PIL import Image

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import names_in, parsing
from kpopnet.sources.camera_files import read_optics
from kpopnet.sources.source import Recording, StoredImage, check_size, rate

SUFFIXES = (".png", ".tif", ".tiff", ".pgm")
CAMERA_FILE = "camera.json"
"""Name of the camera's file in a folder of images."""

DEPTH_MODES = ("I;16", "I;16B", "I;16L", "I", "F")
"""Pillow's names of images of one channel of 16 bits, 32 bits and floating-point numbers."""


def read_folder(folder: Path, key: str | None) -> Recording:
    """A folder of images in the natural order of their names: 2 before 10. A file camera.json in it describes the camera.

    `key` is a pattern of names; None takes all images, whose names must then differ in their numbers alone.
    """
    paths = images_in(folder, "*" if key is None else key)
    if not paths:
        inner = names_in(sorted(one.name for one in folder.iterdir() if one.is_dir()))
        raise InputError(
            f"{folder}: no image named {key or '*'} in it; expected 16-bit PNG, TIFF or PGM files of depth"
            + (f"; perhaps a folder in it is meant: {inner}" if inner else "")
        )
    series = dict.fromkeys(re.sub(r"\d+", "#", path.stem) for path in paths)
    if key is None and len(series) > 1:
        raise InputError(
            f"{folder}: images of {len(series)} kinds of names ({names_in(series)}; # is a number), not of one recording; "
            "choose one by a pattern (--key 'depth_*.png'), or all (--key '*')"
        )
    return read_images(paths, folder / CAMERA_FILE)


def images_in(folder: Path, pattern: str) -> list[Path]:
    """The images of a folder whose names fit a pattern, in natural order, or in that of decimals in their names.

    Fractions that begin with 0 and do not end with it are decimals without trailing zeros (84231.0333, 84231.1), those that end
    with 0 are numbers of images (3.9, 3.10). Raises InputError where neither occurs and both orders differ.
    """
    try:
        paths = [path for path in folder.glob(pattern) if path.suffix.lower() in SUFFIXES and not path.name.startswith(".")]
    except (OSError, ValueError, NotImplementedError) as error:
        raise InputError(f"{folder}: images named {pattern} cannot be listed ({error})") from error
    whole = sorted(paths, key=natural)
    fractions = [FRACTION.findall(path.stem) for path in paths]
    if any(len(one) != 1 for one in fractions) or len({len(one) for (one,) in fractions}) < 2:
        return whole
    decimal = sorted(paths, key=partial(natural, numbers=DECIMALS))
    longer = [one for (one,) in fractions if len(one) > 1]
    if whole == decimal or any(one.endswith("0") for one in longer):
        return whole
    if any(one.startswith("0") for one in longer):
        return decimal
    first, other = next(pair for pair in zip(whole, decimal, strict=True) if pair[0] != pair[1])
    raise InputError(
        f"{folder}: {first.name} or {other.name} may be the earlier image: the numbers in their names are decimals, or not; "
        "rename the images, with equally many digits after the point"
    )


def read_images(paths: Sequence[Path], camera_file: Path | None = None, times_s: Sequence[float] | None = None) -> Recording:
    """Images of one size, their camera if its file is there, and their times."""
    height, width = read_image(paths[0]).shape
    camera, lens = read_optics(camera_file, width, height) if camera_file and camera_file.is_file() else (None, None)

    def images() -> Iterator[StoredImage]:
        return (StoredImage(read_image(path), str(path), at) for path, at in zip(paths, times_s or repeat(None), strict=False))

    return Recording(images, width, height, len(paths), rate(times_s), camera, lens)


NUMBERS = re.compile(r"((?<!\d)\d{9,10}\.\d+|\d+)")
"""Numbers in a name, also in wide digits: seconds since 1970 with a fraction, as of time.time(), and whole ones."""

DECIMALS = re.compile(r"(\d+\.\d+|\d+)")
FRACTION = re.compile(r"(?<![0-9])(?<![0-9]\.)[0-9]+\.([0-9]+)(?!\.?[0-9])")
"""What stands behind the point of a number with one point."""


def natural(path: Path, numbers: re.Pattern = NUMBERS) -> list[tuple[int, Decimal | str]]:
    """A key that orders names by the numbers in them."""
    return [(0, Decimal(part)) if part[:1].isdecimal() else (1, part) for part in numbers.split(path.name)]


def read_image(source: Path | io.BytesIO, where: str = "", modes: Sequence[str] = DEPTH_MODES) -> np.ndarray:
    """(H, W) numbers of an image of one channel; `where` stands in messages for the path."""
    where = where or str(source)
    with parsing(where, "not a PNG, TIFF or PGM image, or damaged"), warnings.catch_warnings(action="error"):
        with Image.open(source, formats=("PNG", "TIFF", "PPM")) as image:
            image.verify()  # Pillow does not compare the checksums of PNG when it unpacks the pixels
        with Image.open(source, formats=("PNG", "TIFF", "PPM")) as image:
            return _unpacked(where, image, modes)


def _unpacked(where: str, image: Image.Image, modes: Sequence[str]) -> np.ndarray:
    check_size(where, *image.size)
    if (pages := getattr(image, "n_frames", 1)) > 1:
        raise InputError(f"{where}: {pages} images in one file; expected one in each: save every page as a file of its own")
    if image.mode not in modes:
        raise InputError(
            f"{where}: an image of Pillow's mode {image.mode}; expected depth of one channel: 16-bit millimetres, or "
            "floating-point metres (TIFF). Colour and 8-bit images do not hold depth"
        )
    # Pillow stretches a PGM image from its own greatest value to that of 16 bits.
    decoder, _, _, of_decoder = image.tile[0] if image.tile else ("", None, 0, None)
    greatest = of_decoder[-1] if decoder.startswith("ppm") else None
    stored = np.array(image)
    if isinstance(greatest, int):
        return np.rint(stored * (greatest / np.iinfo(np.uint16).max)).astype(np.uint16)
    if stored.dtype.kind == "i" and stored.min() >= 0 and stored.max() <= np.iinfo(np.uint16).max:
        return stored.astype(np.uint16)  # Pillow before 11 opens 16-bit PNG as 32 bits
    return stored
