"""Two people of cones before a live camera."""

from dataclasses import astuple
from functools import partial
from pathlib import Path

import numpy as np
from teacher_page import UnsteadyCamera
from two_people_files import CAMERA, two_people_mm

from kpopnet.live.loop import Watching
from kpopnet.sources import open_depth
from kpopnet.sources.live import PlayedRecording
from kpopnet.sources.source import LiveCamera

FRAMES, FPS = 46, 15.0


def write_recording(folder: Path) -> np.ndarray:
    """Writes folder/two.npz; its (T, H, W) uint16 millimetres.

    Every person ends where they began, so that in a loop they stay who they are; each image has a first pixel of its own.
    """
    way = two_people_mm(FRAMES // 2 + 1)
    images = np.concatenate([way, way[-2:0:-1]])
    images[:, 0, 0] = 1000 + np.arange(FRAMES)
    np.savez(folder / "two.npz", depth_mm=images, camera=astuple(CAMERA), fps=FPS)
    return images


def open_unsteady_recording(folder: Path) -> LiveCamera:
    """The recording, again and again, as a camera that is unplugged while folder/unplugged exists."""
    return UnsteadyCamera(folder / "unplugged", PlayedRecording(partial(open_depth, folder / "two.npz"), loop=True))


def watched(folder: Path, loop: bool = True, **others: object) -> Watching:
    """The recording of a folder in its own time."""
    opened = partial(PlayedRecording, partial(open_depth, folder / "two.npz"), loop)
    return Watching("two.npz", **{"open_camera": opened, "folder": folder / "kept"} | others)
