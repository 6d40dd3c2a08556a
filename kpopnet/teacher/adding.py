"""Dances of the user's own, from files of joints, recordings of depth and folders in the K-Pop format (docs/kpop_format.md)."""

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from kpopnet.dance.features import SEEN_CONFIDENCE
from kpopnet.dance.joint_files.reader import SUFFIXES as JOINT_SUFFIXES
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import Stretches
from kpopnet.datasets.dances.dance_set import TEACHER, KpopSet
from kpopnet.datasets.dances.dance_set import read_performance as read_kpop
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.runtime.input_files import expect, named
from kpopnet.skeleton import Joint
from kpopnet.sources.opening import CONVERTERS, READERS, WITH_NAMES
from kpopnet.teacher.library import MAX_PLACE_M, MOST_DANCERS, Library, taught_dance
from kpopnet.teacher.posing import MAX_S, at_rate, posed

IS_OF_LIMB = np.array([joint.name.endswith(("ELBOW", "HAND", "KNEE", "FOOT")) for joint in Joint])

FPS = 30.0
MIN_S, LAST_STEP_S = 5.0, 0.1
"""Shortest dance, and the longest step from its last image to its end, seconds."""

USUAL_BPM = 120.0

JOINT_ARRAYS = {"joints_m.npy", "keypoints3d.npy", "keypoints3d_optim.npy", "points.npy", "poses.npy"}
"""Members of an .npz file that make it a recording of joints."""

NOT_DEPTH = (*JOINT_SUFFIXES, ".pkl", ".pickle")
"""Endings of files of joints, and of pickles, which the reader of joints refuses with advice."""


def add_group(
    library: Library,
    dancers: Sequence[Performance],
    where: str,
    title: str,
    bpm: float = USUAL_BPM,
    free_s: Stretches = (),
    weights: Mapping[str, float] = MappingProxyType({}),
) -> str:
    """Adds a dance known by its dancers' joints in the frame of one level camera and on one clock; returns its identity.

    It lasts while all are recorded; its first beat is at its start. `free_s` and `weights` are what the teacher leaves free and
    what the total consists of, as in `About`. Raises InputError, which names the file `where`, if it lasts less than MIN_S or
    more than MAX_S.
    """
    expect(len(dancers) <= MOST_DANCERS, where, f"at most {MOST_DANCERS} dancers")
    begin_s, end_s = (pick(float(one.times_s[at]) for one in dancers) for pick, at in ((max, 0), (min, -1)))
    check_length(where, end_s - begin_s)
    danced = [at_rate(one, FPS, begin_s, end_s) for one in dancers]
    near = not any((np.abs(joints_m) >= MAX_PLACE_M).any() for joints_m in danced)
    expect(near, where, f"joints within {MAX_PLACE_M:g} m of the camera")
    seen = [at_rate(_without_guesses(one), FPS, begin_s, end_s) for one in dancers]
    taught = [
        taught_dance(title, FPS, bpm, seen_m, *posed(joints_m, library.body), own=True)
        for joints_m, seen_m in zip(danced, seen, strict=True)
    ]
    first, *others = sorted(taught, key=lambda one: -one.start_m[0])
    about = replace(first.about, free_s=[list(one) for one in free_s], weights=dict(weights))
    return library.add(replace(first, about=about, others=tuple(others)))


def check_length(where: str, seconds: float) -> None:
    """Raises InputError, which names the file `where`, for a length that no dance has."""
    if not MIN_S - LAST_STEP_S <= seconds <= MAX_S:
        text = "{file}: lasts {seconds} s; a dance lasts {least} to {most} s"
        raise InputError(Said(text, file=where, seconds=f"{seconds:.1f}", least=f"{MIN_S:g}", most=f"{MAX_S:g}"))


def _without_guesses(performance: Performance) -> Performance:
    """A dance without the joints of limbs that are only guessed, as feet that a webcam does not see: the body shows them, but
    no learner is graded by them.
    """
    joints_m = performance.joints_m.copy()
    joints_m[IS_OF_LIMB & (performance.confidence < SEEN_CONFIDENCE)] = np.nan
    return Performance(joints_m, performance.times_s)


def kpop_teachers(path: Path) -> dict[str, Performance]:
    """The teachers of a set in the K-Pop format, or of one of its dances, by name; none where `path` is something else."""
    if path.name == TEACHER:
        paths = {named(path.parent).name: path}
    elif (path / TEACHER).is_file():
        paths = {named(path).name: path / TEACHER}
    elif any(path.glob(f"*/{TEACHER}")):
        dances = KpopSet(path)
        paths = {name: dances.folder / name / TEACHER for name in dances.names}
    else:
        paths = {}
    found = {}
    for name, teacher in paths.items():
        if (performance := read_kpop(teacher)) is None:
            raise InputError(f"{teacher}: no joints_m in it")
        found[name] = performance
    return found


def holds_depth(path: Path) -> bool:
    """Whether a recording is of depth rather than of joints, by its name, and of an .npz file by the names of its arrays.

    Raises InputError for a file of neither.
    """
    if path.suffix.lower() != ".npz":
        of_depth = (*READERS, *WITH_NAMES)
        known = path.is_dir() or path.suffix.lower() in (*of_depth, *CONVERTERS, *NOT_DEPTH)  # their readers give advice
        text = f"joints in a file {', '.join(JOINT_SUFFIXES)}, or depth in a folder or file {', '.join(of_depth)}"
        expect(known, str(path), text)
        return path.is_dir() or path.suffix.lower() not in NOT_DEPTH
    try:
        with zipfile.ZipFile(path) as archive:
            return JOINT_ARRAYS.isdisjoint(archive.namelist())
    except (OSError, zipfile.BadZipFile, ValueError):  # the reader of joints says what is wrong
        return False


def part_of(performance: Performance, from_s: float, to_s: float | None, origin_s: float, where: str) -> Performance:
    """The part of a recording between two times after `origin_s`, in seconds of its clock, on a clock that begins there.

    Raises InputError, which names the file `where`, if nothing is left.
    """
    since_s = performance.times_s - origin_s
    inside = (since_s >= from_s) & (since_s <= (np.inf if to_s is None else to_s))
    if not inside.any():
        raise InputError(f"{where}: lasts {max(since_s[-1], 0):.1f} s; nothing is left from {from_s:g} s on")
    return Performance(performance.joints_m[inside], since_s[inside], performance.confidence[inside])
