"""Adds a dance of the user's own, known by its joints, to the library."""

from pathlib import Path

import numpy as np

from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.teacher.library import DANCES, About, Library, TaughtDance, difficulty
from kpopnet.teacher.posing import posed

FPS = 30.0
MIN_S, MAX_S = 5.0, 900.0


def add_dance(library: Library, path: Path, title: str, bpm: float = 120.0, fps: float | None = None) -> str:
    """Adds a file of joints to the dances.

    Args:
        library: where to.
        path: an .npz, .bvh, .csv or .json file, see `read_performance`.
        title: its name in the menu.
        bpm: beats per minute; the first beat is at the recording's start.
        fps: the true frame rate of a file that states none or a wrong one.

    Returns:
        The dance's identity.

    Raises:
        InputError: the file is no such recording, or lasts less than MIN_S or more than MAX_S.
    """
    return add_performance(library, read_performance(path, fps), str(path), title, bpm)


def add_performance(library: Library, performance: Performance, where: str, title: str, bpm: float = 120.0) -> str:
    """Adds a dance known by its joints; see `add_dance`.

    Args:
        library: where to.
        performance: in the frame of a level camera.
        where: its file, for messages.
        title: its name in the menu.
        bpm: beats per minute.
    """
    seconds = float(performance.times_s[-1] - performance.times_s[0])
    if not MIN_S <= seconds <= MAX_S:
        raise InputError(f"{where}: lasts {seconds:.1f} s; a dance lasts {MIN_S:g} to {MAX_S:g} s")
    joints_m = at_rate(performance, FPS)
    quats, hips_m = posed(joints_m, library.body())
    about = About(title, len(joints_m) / FPS, bpm, difficulty(joints_m, FPS), own=True)
    number = 1
    while (library.folder / DANCES / f"own_{number:03d}.npz").exists():
        number += 1
    identity = f"own_{number:03d}"
    library.write(identity, TaughtDance(about, FPS, joints_m, quats, hips_m))
    return identity


def at_rate(performance: Performance, fps: float) -> np.ndarray:
    """(T, 15, 3) float32 joints of a performance at a constant rate from its first frame on: those of the nearest frames.

    Raises:
        InputError: it lasts more than MAX_S.
    """
    seconds = float(performance.times_s[-1] - performance.times_s[0])
    if not seconds <= MAX_S:
        raise InputError(f"a recording of {seconds:.3g} s; a dance lasts at most {MAX_S:g} s")
    times_s = np.arange(performance.times_s[0], performance.times_s[-1], 1 / fps)
    after = np.clip(np.searchsorted(performance.times_s, times_s), 1, len(performance) - 1)
    before_is_nearer = times_s - performance.times_s[after - 1] < performance.times_s[after] - times_s
    return performance.joints_m[after - before_is_nearer].astype(np.float32)
