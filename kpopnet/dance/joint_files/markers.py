"""Recordings of markers or joint centres by name: C3D (extra `c3d`) and TRC, and arrays whose columns have numbers."""

import io
import warnings
from pathlib import Path

import numpy as np

from kpopnet.dance.joint_files.points import NamedPoints
from kpopnet.runtime.input_files import ArraySchema, check_budget, expect, open_npy, parsing, read_text, read_with
from kpopnet.runtime.provenance import optional_library


def read_c3d(path: Path) -> NamedPoints:
    """The points of a C3D file by their labels; raises InputError if it is damaged or truncated."""
    with optional_library(str(path), "c3d", "c3d"):
        import c3d

    class Reader(c3d.Reader):
        """The library's, whose numbers of frames overflow from 65,536 on."""

        @property
        def first_frame(self) -> int:
            start = self.get("TRIAL:ACTUAL_START_FIELD")
            low, high = (self.header.first_frame, 0) if start is None else start.uint16_array[:2]
            return int(low) + 65536 * int(high)

        @property
        def last_frame(self) -> int:
            return int(super().last_frame)

    data = read_with(Path.read_bytes, path, "cannot be read")
    with parsing(path, "not a readable C3D file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it has no analog data, above all
        file = Reader(io.BytesIO(data))
        names, frames = [name.strip() for name in file.point_labels], file.last_frame - file.first_frame + 1
        expect(
            0 < len(names) <= file.point_used, str(path), f"a label for each of {file.point_used} points, found {len(names)}"
        )
        points = np.full((min(frames, len(data) // (8 * len(names)) + 1), len(names), 3), np.nan)
        read = 0
        for number, (_, own, _) in enumerate(file.read_frames(copy=False)):
            expect(number < len(points), str(path), f"{frames} frames; the file is truncated")
            seen, read = own[: len(names), 3] >= 0, number + 1
            points[number, seen] = own[: len(names), :3][seen]
        expect(read == frames > 0, str(path), f"{frames} frames, found {read}; the file is truncated")
        return NamedPoints(names, points, fps=float(file.point_rate))


def read_trc(path: Path) -> NamedPoints:
    """The points of a TRC file, as of OpenSim: four lines of header, names above X1, Y1, Z1 ..., a line for each frame."""
    lines = read_text(path).splitlines()
    expect(len(lines) >= 5 and lines[0].startswith("PathFileType"), str(path), '"PathFileType" and five lines of header')
    names = [word.strip() for word in lines[3].split("\t")[2:] if word.strip()]
    expect(bool(names), f"{path}, line 4", "names of points")
    width = 2 + 3 * len(names)
    rows = []
    for number, line in enumerate(lines[5:], 6):
        cells = line.split("\t")
        if not line.strip():
            continue
        where = f"{path}, line {number}"
        expect(len(cells) >= 2 and not any(map(str.strip, cells[width:])), where, f"frame, time and {len(names)} points")
        with parsing(where, "expected numbers"):
            rows.append([float(cell) if cell.strip() else np.nan for cell in [*cells, *[""] * width][1:width]])
    expect(bool(rows), str(path), "a line of numbers below the header")
    table = np.array(rows)
    return NamedPoints(names, table[:, 1:].reshape(len(rows), -1, 3), table[:, 0])


def read_npy(path: Path) -> NamedPoints:
    """The points of a (T, K, 3) array, named by their numbers from 0."""
    array = open_npy(path, ArraySchema("fiu", (None, None, 3)))
    check_budget(path, 8 * array.size, f"{len(array)} frames")
    return NamedPoints([str(number) for number in range(array.shape[1])], np.array(array, np.float64))
