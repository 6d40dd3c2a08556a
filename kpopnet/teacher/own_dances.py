"""Dances of the user's own, from files of joints, recordings of depth and folders in the K-Pop format (docs/kpop_format.md)."""

import zipfile
from pathlib import Path

import numpy as np
from tqdm import tqdm

from kpopnet.dance.joint_files.reader import SUFFIXES as JOINT_SUFFIXES
from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.datasets.dances.format import TEACHER
from kpopnet.datasets.dances.format import read_performance as read_kpop
from kpopnet.errors import InputError
from kpopnet.pose import PoseEstimator
from kpopnet.sources.source import DepthSource

JOINT_ARRAYS = ("joints_m.npy", "keypoints3d.npy", "points.npy")
"""Members of an .npz file that make it a recording of joints."""


def kpop_teachers(path: Path) -> dict[str, Path]:
    """The teachers' files of a set in the K-Pop format, of one of its dances, or of none.

    Returns:
        Paths by the dances' names; empty where `path` is something else.
    """
    if path.name == TEACHER:
        return {path.parent.name: path}
    if (path / TEACHER).is_file():
        return {path.name: path / TEACHER}
    if not any(path.glob(f"*/{TEACHER}")):
        return {}
    dances = KpopSet(path)
    return {name: dances.folder / name / TEACHER for name in dances.names}


def kpop_dance(path: Path) -> Performance:
    """The joints in a teacher's file of the K-Pop format.

    Raises:
        InputError: it is missing or damaged, or has no joints.
    """
    performance = read_kpop(path)
    if performance is None:
        raise InputError(f"{path}: no joints_m in it")
    return performance


NOT_DEPTH = (*JOINT_SUFFIXES, ".pkl", ".pickle")
"""Endings of files of joints, and of pickles, which the reader of joints refuses with advice."""


def holds_depth(path: Path) -> bool:
    """Whether a recording is of depth rather than of joints, by its name, and of an .npz file by the names of its arrays."""
    if path.suffix.lower() != ".npz":
        return path.is_dir() or path.suffix.lower() not in NOT_DEPTH
    try:
        with zipfile.ZipFile(path) as archive:
            return not set(JOINT_ARRAYS) & set(archive.namelist())
    except (OSError, zipfile.BadZipFile, ValueError):  # whoever reads it says what is wrong with it
        return False


def danced_in(source: DepthSource, segmented: bool = False) -> Performance:
    """What the person who is seen longest in a recording of depth dances, by the network of the package.

    Args:
        source: the recording.
        segmented: its depth shows one person, and 0 elsewhere.

    Raises:
        InputError: an image is damaged, or nobody was found.
    """
    times_s: list[float] = []

    def images():
        for image in tqdm(source.timed(), "joints", source.frames, unit=" images", disable=None):
            times_s.append(image.time_s)
            yield image.depth_m

    people = PoseEstimator.load(mode="best").estimate(images(), source.camera, source.fps, segmented=segmented)
    if not people:
        raise InputError(f"{source.name}: nobody was found; the camera must stand still, and see the dancer from head to feet")
    return Performance(people[0].joints_camera_m, np.array(times_s), people[0].confidence)


def part_of(performance: Performance, from_s: float, to_s: float | None, where: str) -> Performance:
    """The part of a recording between two times from its first image on, on a clock that begins there.

    Raises:
        InputError: nothing is left.
    """
    since_s = performance.times_s - performance.times_s[0]
    inside = (since_s >= from_s) & (since_s <= (np.inf if to_s is None else to_s))
    if not inside.any():
        raise InputError(f"{where}: lasts {since_s[-1]:.1f} s; nothing is left from {from_s:g} s on")
    joints_m, times_s = performance.joints_m[inside], performance.times_s[inside]
    return Performance(joints_m, times_s - times_s[0], performance.confidence[inside])
