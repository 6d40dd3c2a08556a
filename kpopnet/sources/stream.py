"""Depth as another program sends it, through a pipe, a socket or in a file: any camera, in any language.

The sender writes one line, a camera in JSON as `camera_files` reads it, with the type and the unit of its depth:

    {"width": 640, "height": 480, "fx": 570.3, "fy": 570.3, "cx": 319.5, "cy": 239.5, "dtype": "uint16", "unit_m": 0.001}

and after it, for each image and without gaps:

    float64   when it was taken, seconds: on the clock of `PipeCamera`, or of any clock in a file; NaN if it is not known
    uint64    number of bytes of the depth: width x height x 2 or 4
    depth     uint16 or float32, row by row from the top left; 1 is `unit_m` metres, 0 is not measured, nor is 65535 of uint16

all little-endian. A file of the same bytes is a recording, whose name ends with .depth.
"""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from kpopnet.camera import MM_PER_METRE, measured
from kpopnet.errors import check_between
from kpopnet.runtime.input_files import expect, parse_json
from kpopnet.sources.camera_files import optics_in
from kpopnet.sources.lenses import Optics
from kpopnet.sources.source import Recording, StoredImage

LINE_BYTES = 4096
"""Longest first line."""

HEAD = struct.Struct("<dQ")
TYPES = {"uint16": "<u2", "float32": "<f4"}


class Header(NamedTuple):
    """What the first line says."""

    optics: Optics
    dtype: np.dtype
    unit_m: float

    @property
    def depth_bytes(self) -> int:
        return self.optics.camera.width * self.optics.camera.height * self.dtype.itemsize

    def read(self, file: BinaryIO, where: str) -> StoredImage | None:
        """The next image, None where the sender has ended."""
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        time_s, stated = HEAD.unpack(head)
        expect(stated == self.depth_bytes, where, f"{self.depth_bytes:,} bytes of depth, found {stated:,} stated")
        depth = np.empty((self.optics.camera.height, self.optics.camera.width), self.dtype)
        if file.readinto(memoryview(depth).cast("B")) < self.depth_bytes:  # type: ignore[attr-defined]
            return None
        is_mm = depth.dtype.kind == "u" and self.unit_m == 1 / MM_PER_METRE
        stored = depth if is_mm else measured(depth) * np.float32(self.unit_m)
        return StoredImage(stored, where, time_s if np.isfinite(time_s) else None)


def parsed_header(line: bytes, where: str) -> Header:
    """The header of a first line. Raises InputError for one that is too long, no JSON, or no depth camera."""
    expect(line.endswith(b"\n"), where, f"a first line of at most {LINE_BYTES:,} bytes that ends with a newline")
    content = parse_json(line, where)
    optics = optics_in(content, where)
    dtype, unit_m = str(content.get("dtype")), content.get("unit_m")
    expect(dtype in TYPES, where, f"dtype to be one of {', '.join(TYPES)}")
    expect(isinstance(unit_m, int | float), where, "unit_m, the metres of a depth of 1: 0.001 for millimetres")
    check_between(f"{where}: unit_m", unit_m, 1e-6, 1)
    return Header(optics, np.dtype(TYPES[dtype]), float(unit_m))


def read_recording(path: Path) -> Recording:
    """A file of what a sender sent; an image that is cut off at its end does not count."""
    with path.open("rb") as file:
        header = parsed_header(file.readline(LINE_BYTES), str(path))
        begin, size = file.tell(), HEAD.size + header.depth_bytes
        frames = (path.stat().st_size - begin) // size
        expect(frames > 0, str(path), "images after its first line")
        times_s = []
        for number in range(frames):
            file.seek(begin + number * size)
            times_s.append(HEAD.unpack(file.read(HEAD.size))[0])
    known = [number for number, time_s in enumerate(times_s) if math.isfinite(time_s)]
    camera, lens = header.optics
    # By the median step, as of other recordings: a sender may have paused.
    steps_s = np.diff(np.array(times_s)[known]) / np.diff(known)
    fps = float(1 / np.median(steps_s)) if len(steps_s) and np.median(steps_s) > 0 else None
    has_clock = len(known) == frames
    return Recording(lambda: _images(path, has_clock), camera.width, camera.height, frames, fps, camera, lens)


def _images(path: Path, has_clock: bool) -> Iterator[StoredImage]:
    """The images, at their times since the first; at none where the time of some is not known: the rate tells them all."""
    with path.open("rb") as file:
        header, number, first_s = parsed_header(file.readline(LINE_BYTES), str(path)), 0, None
        while (image := header.read(file, f"{path}: image {number}")) is not None:
            if image.time_s is not None:  # of any clock
                first_s = image.time_s if first_s is None else first_s
                image = image._replace(time_s=image.time_s - first_s if has_clock else None)
            yield image
            number += 1
