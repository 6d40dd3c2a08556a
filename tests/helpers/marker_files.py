"""Recordings of named points as C3D and TRC, written from the formats' descriptions (c3d.org; OpenSim's documentation)."""

import struct

import numpy as np


def write_c3d(path, points_mm, names, fps=100.0, integers=False, labels=None, first=None):
    """Writes (T, P, 3) points, NaN where missing, as 32-bit numbers, or as integers of a fifth of a millimetre; their first
    frame has a number in the trial if that is given.
    """
    frames, count = points_mm.shape[:2]
    scale = 0.2 if integers else -0.2
    labels = names if labels is None else labels
    width = max(map(len, labels), default=0)

    def parameter(group, name, kind, dimensions, content):
        rest = struct.pack("<bB", kind, len(dimensions)) + bytes(dimensions) + content + b"\0"  # no description
        return struct.pack("<bb", len(name), group) + name + struct.pack("<h", len(rest) + 2) + rest

    text = "".join(label.ljust(width) for label in labels).encode()
    groups = struct.pack("<bb5shB", 5, -1, b"POINT", 3, 0) + b"".join(
        [
            parameter(1, b"USED", 2, [], struct.pack("<h", count)),
            parameter(1, b"SCALE", 4, [], struct.pack("<f", scale)),
            parameter(1, b"RATE", 4, [], struct.pack("<f", fps)),
            parameter(1, b"DATA_START", 2, [], struct.pack("<h", 0)),
            parameter(1, b"FRAMES", 2, [], struct.pack("<h", frames)),
            parameter(1, b"LABELS", -1, [width, len(labels)], text),
        ]
    )
    if first is not None:
        ends = {b"ACTUAL_START_FIELD": first, b"ACTUAL_END_FIELD": first + frames - 1}
        trial = [parameter(2, name, 2, [2], struct.pack("<I", number)) for name, number in ends.items()]
        groups = struct.pack("<bb5shB", 5, -2, b"TRIAL", 3, 0) + groups + b"".join(trial)
    blocks = -(-(len(groups) + 6) // 512)
    groups = groups.replace(
        b"DATA_START" + struct.pack("<hbBh", 7, 2, 0, 0), b"DATA_START" + struct.pack("<hbBh", 7, 2, 0, 2 + blocks)
    )
    first, last = (min(number, 65535) for number in (first or 1, (first or 1) + frames - 1))
    header = struct.pack("<BBHHHHHfHHf", 2, 0x50, count, 0, first, last, 0, scale, 2 + blocks, 0, fps).ljust(512, b"\0")
    parameters = (struct.pack("<BBBB", 1, 0x50, blocks, 84) + groups).ljust(512 * blocks, b"\0")
    seen = np.isfinite(points_mm).all(axis=-1, keepdims=True)
    values = np.append(np.where(seen, points_mm, 0), np.where(seen, 0, -1), axis=-1)
    stored = (np.rint(values * [5, 5, 5, 1])).astype("<i2") if integers else values.astype("<f4")
    path.write_bytes(header + parameters + stored.tobytes() + bytes(-stored.nbytes % 512))
    return path


def write_trc(path, points_mm, names, fps=100.0):
    """Writes (T, P, 3) points; a missing one's cells are empty."""
    frames, count = points_mm.shape[:2]
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{fps}\t{fps}\t{frames}\t{count}\tmm\t{fps}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(names),
        "\t\t" + "\t".join(f"{axis}{number}" for number in range(1, count + 1) for axis in "XYZ"),
        "",
    ]
    for frame, points in enumerate(points_mm):
        cells = ["" if np.isnan(value) else f"{value:.5f}" for value in points.ravel()]
        lines.append("\t".join([str(frame + 1), f"{frame / fps:.5f}", *cells]))
    path.write_text("\n".join(lines) + "\n")
    return path
