"""Reads recordings of ImperialDance and AIST++ and writes them in the folder format of dance sets (docs/kpop_format.md).

The points are converted to the fifteen joints by `kpopnet.dance.joint_sets`. The command is `python -m synth.dances.convert`.
"""

import re
from pathlib import Path

import numpy as np

from kpopnet.dance.joint_sets import IMPERIAL_POINTS, aist_joints_m, imperial_joints_m
from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.writer import write_labels, write_learner, write_teacher
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, check_budget, expect, open_npy, read_json, read_npz

AIST_FPS, IMPERIAL_FPS = 60.0, 100.0

_AIST_SCHEMA = {name: ArraySchema("fiu", (None, None, None), False) for name in ("keypoints3d", "keypoints3d_optim")}

_IMPERIAL_FILE = re.compile(r"dance_level_([eib])_([a-z])_ch(\d+)\.npy")


def read_aist(path: Path) -> np.ndarray:
    """Reads (T, 17, 3) keypoints from a JSON or npz file.

    Raises:
        InputError: The file is a pickle, or does not contain keypoints.
    """
    if path.suffix.lower() in (".pkl", ".pickle"):
        raise InputError(
            f"{path}: a pickle can run code when it is opened, so it is not opened; if you trust it, save its keypoints with "
            "numpy.savez first (python -m synth.dances.convert --help says how)"
        )
    try:
        points = _aist_json(path) if path.suffix.lower() == ".json" else _aist_npz(path)
    except InputError as error:
        raise InputError(f"{path}: keypoints3d could not be read ({error}); expected a JSON or npz file") from error
    if points.ndim != 3 or points.shape[1:] != (17, 3) or not len(points):
        raise InputError(f"{path}: its keypoints are {points.shape}; expected (frames, 17, 3) in COCO's order")
    return points.astype(np.float64)


def _aist_json(path: Path) -> np.ndarray:
    content = read_json(path, non_finite=True)
    expect(isinstance(content, dict), str(path), "an object with keypoints3d")
    points = content.get("keypoints3d_optim", content.get("keypoints3d"))
    expect(isinstance(points, list), str(path), "keypoints3d, a list of frames")
    try:
        values = np.array(points, object)
    except ValueError as error:
        raise InputError(f"{path}: expected frames of 17 points of 3 numbers ({error})") from error
    expect({type(value) for value in values.ravel().tolist()} <= {int, float, type(None)}, str(path), "numbers, or null")
    return values.astype(np.float64)


def _aist_npz(path: Path) -> np.ndarray:
    found = read_npz(path, _AIST_SCHEMA)
    expect(bool(found), str(path), "an array keypoints3d or keypoints3d_optim")
    return found["keypoints3d_optim"] if "keypoints3d_optim" in found else found["keypoints3d"]


def read_imperial(path: Path) -> np.ndarray:
    """Opens a file of ImperialDance as a (takes, T, 21, 3) array of points.

    Raises:
        InputError: The file is not such an array.
    """
    try:
        data = open_npy(path, ArraySchema("fiu", (None, 3, None, len(IMPERIAL_POINTS))))
        check_budget(path, 8 * data[0].size, "the float64 points of a take")
    except InputError as error:
        raise InputError(f"{path}: not a plain numpy array; expected (takes, 3, frames, 21) ({error})") from error
    return data.transpose(0, 2, 3, 1)


def write_dance(out: Path, name: str, fps: float, teacher_m: np.ndarray, learners_m: dict[str, np.ndarray]) -> None:
    """Writes a dance given as joints.

    Args:
        out: folder of the set.
        name: of the dance.
        fps: frames per second of all joints.
        teacher_m: (T, 15, 3) metres.
        learners_m: learner's name to (T, 15, 3) metres, from the best to the worst.
    """
    write_teacher(out / name, Performance(teacher_m, np.arange(len(teacher_m)) / fps))
    for learner, joints_m in learners_m.items():
        write_learner(out / name, learner, np.arange(len(joints_m)) / fps, joints_m)
    write_labels(out / name, learners_m)
    print(f"{out / name}: teacher and {len(learners_m)} learners, best first: {', '.join(learners_m)}")


def convert_aist(out: Path, dance: str, teacher: Path, learners: list[Path], fps: float | None) -> None:
    """Writes a dance from files of AIST++ keypoints.

    Args:
        out: folder of the set.
        dance: name of the dance.
        teacher: the teacher's file.
        learners: the learners' files, from the best to the worst.
        fps: frames per second; None for AIST_FPS.

    Raises:
        InputError: A file cannot be read, or there are fewer than two learners of different names.
    """
    joints_m = {path: aist_joints_m(read_aist(path), str(path)) for path in (teacher, *learners)}
    write_dance(out, dance, fps or AIST_FPS, joints_m[teacher], by_name({path: joints_m[path] for path in learners}))


def convert_imperial(source: Path, out: Path) -> None:
    """Writes a dance for every choreography that is recorded at all three levels.

    The teacher is one expert's take; the learners are another expert's, an intermediate dancer's and a beginner's.

    Args:
        source: folder of dance_level_*.npy.
        out: folder of the set.

    Raises:
        InputError: There is no such choreography, or a file cannot be read.
    """
    files: dict[str, dict[str, Path]] = {}
    for path in sorted(source.glob("*.npy")):
        if match := _IMPERIAL_FILE.fullmatch(path.name):
            level, genre, number = match.groups()
            files.setdefault(f"{genre}_ch{number}", {})[level] = path
    complete = {name: levels for name, levels in files.items() if set(levels) == set("eib")}
    if not complete:
        raise InputError(f"{source}: no choreography with files dance_level_[e|i|b]_GENRE_chN.npy of all three levels")
    for name, levels in complete.items():
        takes = {level: read_imperial(path) for level, path in levels.items()}
        if len(takes["e"]) < 2:
            raise InputError(f"{levels['e']}: one take; two experts are needed, a teacher and a learner")
        chosen = {"expert": ("e", 1), "intermediate": ("i", 0), "beginner": ("b", 0)}
        learners = {
            learner: imperial_joints_m(np.array(takes[level][take]), str(levels[level]))
            for learner, (level, take) in chosen.items()
        }
        write_dance(out, name, IMPERIAL_FPS, imperial_joints_m(np.array(takes["e"][0]), str(levels["e"])), learners)


def by_name(by_file: dict[Path, np.ndarray]) -> dict[str, np.ndarray]:
    """Learners' joints by the names of their files.

    Raises:
        InputError: There are fewer than two different names.
    """
    names = {path.stem: joints_m for path, joints_m in by_file.items()}
    if len(names) < len(by_file) or len(names) < 2:
        raise InputError("--learners: give at least two files of different names, the best dancer's first")
    return names
