"""Writes recorded joints to files that `kpopnet.dance.joint_files.reader` and other programs read."""

import csv
import io
import json
from pathlib import Path

import numpy as np

from kpopnet.dance.joint_files.bvh_writing import as_bvh
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.skeleton import JOINT_NAMES

SUFFIXES = (".npz", ".json", ".csv", ".bvh")
DIGITS, CONFIDENCE_DIGITS = 4, 3
"""Decimals of metres and of confidence in files of text: a tenth of a millimetre, a thousandth."""


def write_performance(path: Path | str, performance: Performance) -> None:
    """Writes a recording; the ending of the file's name tells the format (docs/predicting.md).

    All formats but BVH keep the camera frame: metres, x right, y down, z forward.

    Args:
        path: ends with .npz, .json, .csv or .bvh; its folder exists.
        performance: the joints.

    Raises:
        InputError: another ending; or BVH of joints that make no skeleton.
        OSError: the file cannot be written.
    """
    path = Path(path)
    match path.suffix.lower():
        case ".npz":
            content = _npz(performance)
        case ".json":
            content = _json(performance).encode()
        case ".csv":
            content = _csv(performance).encode()
        case ".bvh":
            content = as_bvh(performance).encode()
        case _:
            raise InputError(f"{path}: expected a name that ends with {', '.join(SUFFIXES)}")
    with atomic_path(path) as part:
        part.write_bytes(content)


def _npz(performance: Performance) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(
        stream,
        joints_m=performance.joints_m.astype(np.float32),
        confidence=performance.confidence.astype(np.float32),
        times_s=performance.times_s,
        joint_names=np.array(JOINT_NAMES),
    )
    return stream.getvalue()


def _json(performance: Performance) -> str:
    """One line a frame; of each joint x, y, z and confidence, null where it is missing."""
    lines = []
    for time_s, joints, confidence in zip(*_rounded(performance), strict=True):
        named = {name: None if c == 0 else [*point, c] for name, point, c in zip(JOINT_NAMES, joints, confidence, strict=True)}
        lines.append(json.dumps({"time_s": time_s, "joints": named}, allow_nan=False))
    frame = "camera: x right, y down, z forward"
    return '{"unit": "metre", "frame": "%s", "frames": [\n%s\n]}\n' % (frame, ",\n".join(lines))  # noqa: UP031 - of braces


def _csv(performance: Performance) -> str:
    """A header, then one line a frame; empty cells where a joint is missing."""
    stream = io.StringIO()
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow(["time_s", *(f"{name}_{part}" for name in JOINT_NAMES for part in ("x", "y", "z", "confidence"))])
    for time_s, joints, confidence in zip(*_rounded(performance), strict=True):
        cells = [["", "", "", 0.0] if c == 0 else [*point, c] for point, c in zip(joints, confidence, strict=True)]
        rows.writerow([time_s, *(cell for four in cells for cell in four)])
    return stream.getvalue()


def _rounded(performance: Performance) -> tuple[list, list, list]:
    """Times, joints and confidence as lists; a joint that was seen keeps a confidence above 0."""
    confidence = np.where(performance.confidence > 0, np.maximum(performance.confidence, 10.0**-CONFIDENCE_DIGITS), 0)
    return (
        np.round(performance.times_s, 6).tolist(),
        np.round(performance.joints_m, DIGITS).tolist(),
        np.round(confidence, CONFIDENCE_DIGITS).tolist(),
    )
