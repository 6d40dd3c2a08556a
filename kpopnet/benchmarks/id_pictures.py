"""The ids of EVAL's joints and SMMC-10's markers, drawn where they are: to see which is which joint, and write the map."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from kpopnet.benchmarks import eval_format, smmc10_format
from kpopnet.benchmarks.organised_points import FROM_OPENGL, depth_of_points, fit_camera
from kpopnet.drawing import depth_picture, enlarged, write

WIDTH_PX = 960
MARK = (225, 25, 45)


class Ids(NamedTuple):
    """A frame: (H, W, 3) organised points and (3,) places by their id, as stored: metres, y up, z negative."""

    points: np.ndarray
    places: dict[int, list[float]]


def eval_ids(path: Path) -> Ids | None:
    """The first frame of a file of EVAL that shows anything, None if none does."""
    frames = (frame for block in eval_format.read_blocks(path) for frame in block)
    return _first_shown(
        Ids(frame["xyz"], {number: xyz for number, xyz in frame["joints"][: frame["njoints"]].tolist() if xyz[2] != 0})
        for frame in frames
    )


def smmc10_ids(path: Path) -> Ids | None:
    """The first frame of a file of SMMC-10 that shows anything, None if none does."""
    frames = (frame for block in smmc10_format.read_blocks(path) for frame in block)
    return _first_shown(
        Ids(
            smmc10_format.image_points(frame["points"]),
            {int(one["id"]): one["pos"].tolist() for one in frame["markers"][: frame["nmarkers"]] if one["cond"] > 0},
        )
        for frame in frames
    )


def _first_shown(frames: Iterable[Ids]) -> Ids | None:
    return next((frame for frame in frames if (frame.points[..., 2] < 0).any()), None)


def id_picture(frame: Ids, where: str) -> np.ndarray:
    """RGB: the depth with every id beside its place.

    Raises:
        InputError: the points are no camera's; `where` says whose they are.
    """
    camera = fit_camera(frame.points, where)
    picture = enlarged(depth_picture(depth_of_points(frame.points, Counter())), WIDTH_PX)
    scale = WIDTH_PX / camera.width
    for number, xyz_opengl_m in frame.places.items():
        u, v, z = camera.project(np.array(xyz_opengl_m) * FROM_OPENGL)
        if not (z > 0 and 0 <= u < camera.width and 0 <= v < camera.height):
            continue
        at = round((u + 0.5) * scale), round((v + 0.5) * scale)
        cv2.circle(picture, at, 4, MARK, -1, cv2.LINE_AA)
        write(picture, str(number), (min(at[0] + 6, WIDTH_PX - 40), at[1] - 4))
    return picture
