"""Figures of the ids of EVAL's joints and SMMC-10's markers at their positions, for writing the joint map."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from kpopnet.datasets.eval import format as eval_format
from kpopnet.datasets.point_clouds.organised import FROM_OPENGL, depth_of_points, fit_camera
from kpopnet.datasets.smmc10 import format as smmc10_format
from kpopnet.viz.drawing import depth_rgb, enlarged, write

WIDTH_PX = 960
MARK_RGB = (225, 25, 45)


class Ids(NamedTuple):
    """A frame as stored: metres, y up, z negative in front of the camera.

    Attributes:
        points: (H, W, 3) organised points.
        positions: (3,) position of each joint or marker by its id.
    """

    points: np.ndarray
    positions: dict[int, list[float]]


def eval_ids(path: Path) -> Ids | None:
    """The first frame of an EVAL file with a measured point; None if there is none."""
    frames = (frame for block in eval_format.read_blocks(path) for frame in block)
    return _first_measured(
        Ids(frame["xyz"], {number: xyz for number, xyz in frame["joints"][: frame["njoints"]].tolist() if xyz[2] != 0})
        for frame in frames
    )


def smmc10_ids(path: Path) -> Ids | None:
    """The first frame of an SMMC-10 file with a measured point; None if there is none."""
    frames = (frame for block in smmc10_format.read_blocks(path) for frame in block)
    return _first_measured(
        Ids(
            smmc10_format.image_points(frame["points"]),
            {int(one["id"]): one["pos"].tolist() for one in frame["markers"][: frame["nmarkers"]] if one["cond"] > 0},
        )
        for frame in frames
    )


def _first_measured(frames: Iterable[Ids]) -> Ids | None:
    return next((frame for frame in frames if (frame.points[..., 2] < 0).any()), None)


def draw_ids(frame: Ids, where: str) -> np.ndarray:
    """RGB image of the depth with every id at its position.

    Args:
        frame: points and ids.
        where: name of the file, for messages.

    Raises:
        InputError: no pinhole camera fits the points.
    """
    camera = fit_camera(frame.points, where)
    image = enlarged(depth_rgb(depth_of_points(frame.points, Counter())), WIDTH_PX)
    scale = WIDTH_PX / camera.width
    for number, xyz_opengl_m in frame.positions.items():
        u, v, z = camera.project(np.array(xyz_opengl_m) * FROM_OPENGL)
        if not (z > 0 and 0 <= u < camera.width and 0 <= v < camera.height):
            continue
        position = round((u + 0.5) * scale), round((v + 0.5) * scale)
        cv2.circle(image, position, 4, MARK_RGB, -1, cv2.LINE_AA)
        write(image, str(number), (min(position[0] + 6, WIDTH_PX - 40), position[1] - 4))
    return image
