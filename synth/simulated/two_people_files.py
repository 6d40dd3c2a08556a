"""Converts `two_people` to the files of `kpopnet.datasets.two_people`."""

import io
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np

from kpopnet.camera import MM_PER_METRE
from kpopnet.datasets.two_people import SCHEMA, SUFFIX
from kpopnet.runtime.input_files import read_npz
from synth.simulated.two_people import DuetShot, TwoPeople
from synth.simulated.writer import StandInFormat


def encode(shots: Iterator[DuetShot]) -> Iterator[bytes]:
    """The bytes of a file, in one piece."""
    shots = list(shots)
    file = io.BytesIO()
    np.savez_compressed(
        file,
        depth_mm=np.stack([np.rint(shot.depth_m * MM_PER_METRE).astype(np.uint16) for shot in shots]),
        joints_m=np.stack([shot.joints_camera_m for shot in shots]),
        alone_px=np.stack([shot.alone_px for shot in shots]).astype(np.int32),
        seen_px=np.stack([shot.seen_px for shot in shots]).astype(np.int32),
    )
    yield file.getvalue()


def _read(path: Path) -> dict[str, np.ndarray]:
    return _read_once(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=1)
def _read_once(path: Path, _changed_ns: int) -> dict[str, np.ndarray]:
    return read_npz(path, SCHEMA)


def count_frames(path: Path) -> int:
    """Number of frames in a file."""
    return len(_read(path)["depth_mm"])


def look(path: Path, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Depth (H, W) and joints (2, 15, 3) of a frame in a file, metres, camera frame."""
    found = _read(path)
    return found["depth_mm"][number] / np.float32(MM_PER_METRE), found["joints_m"][number]


TWO_PEOPLE = StandInFormat(
    maker=TwoPeople,
    stands_for=None,
    suffix=SUFFIX,
    truth={},
    encode=encode,
    count_frames=count_frames,
    look=look,
)
