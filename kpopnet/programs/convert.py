"""Makes dance sets (docs/kpop_format.md) from recordings of joints, and from ImperialDance.

    kpopnet convert recordings OUT --dance NAME --teacher T.bvh --learners BEST.bvh GOOD.bvh ...
    kpopnet convert recordings OUT --dance NAME --teacher T.json --learners BEST.json GOOD.json ... --fps 60
    kpopnet convert imperial FOLDER OUT

Learners are named from the best to the worst: their order becomes the labels. Then

    python evaluate.py benchmark=kpop benchmark.path=OUT 'estimator=[]'

Recordings are files of any format that `kpopnet score` reads (docs/joint_files.md): BVH, CSV, JSON, npz. The unit (metres,
centimetres or millimetres) and the vertical axis are inferred from the dancer's trunk. Every dancer is rotated about the
vertical axis to face the camera on average over the first twentieth of the frames.

ImperialDance: files dance_level_[e|i|b]_GENRE_chN.npy, (takes, 3, frames, 21) at 100 Hz. For every choreography one expert's
take is the teacher; the learners are another expert's, an intermediate dancer's and a beginner's.

AIST++: its keypoints are recorded at 60 frames per second. Its pickles can run code when they are opened, so they are refused.
If you trust them, save them with

    numpy.savez("T.npz", keypoints3d=pickle.load(open("T.pkl", "rb"))["keypoints3d_optim"], fps=60)
"""

import argparse
import re
from pathlib import Path

import numpy as np

from kpopnet.dance.features import SEEN_CONFIDENCE
from kpopnet.dance.joint_files.points import IMPERIAL_NAMES, NamedPoints, named_performances
from kpopnet.dance.joint_files.reader import read_strangers_performance
from kpopnet.dance.performance import Performance, from_absolute_clocks
from kpopnet.datasets.dances.dance_set import A_NAME, LABELS, MAX_COORDINATE_M, TEACHER, check_times, is_learner_name
from kpopnet.datasets.dances.writer import write_labels, write_learner, write_teacher
from kpopnet.datasets.protocol import check_joints
from kpopnet.errors import InputError
from kpopnet.programs.arguments import program_parser
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.folder_lock import locked
from kpopnet.runtime.input_files import ArraySchema, check_budget, expect, open_npy

IMPERIAL_FPS = 100.0

_IMPERIAL_FILE = re.compile(r"dance_level_([eib])_([a-z])_ch(\d+)\.npy")


def read_imperial(path: Path) -> np.ndarray:
    """Opens a file of ImperialDance as a (takes, T, 21, 3) array of points; raises InputError if it is not such an array."""
    try:
        data = open_npy(path, ArraySchema("fiu", (None, 3, None, len(IMPERIAL_NAMES))))
        check_budget(path, 8 * data[0].size, "the float64 points of a take")
    except InputError as error:
        raise InputError(f"{path}: not a plain numpy array; expected (takes, 3, frames, 21) ({error})") from error
    return data.transpose(0, 2, 3, 1)


def write_dance(out: Path, name: str, teacher: Performance, learners: dict[str, Performance]) -> None:
    """Writes a dance given as joints into the folder of a set; the learners from the best to the worst.

    Joints that are only guessed become missing ones, since the format knows no confidence. Raises InputError, before anything
    is written, for what is no name of a dance or a learner, no dance, and for a folder that holds other learners.
    """
    for what, word in (("--dance", name), *(("learner", learner) for learner in learners)):
        expect(is_learner_name(word), f"{what} {word!r}", A_NAME)
    others = sorted({path.stem for path in (out / name).glob("*.h5")} - {Path(TEACHER).stem, *learners})
    if others:
        raise InputError(
            f"{out / name}: holds {', '.join(others)} of an earlier conversion; delete them, or give another --dance"
        )
    for dancer, performance in {Path(TEACHER).stem: teacher, **learners}.items():
        check_times(out / name / dancer, performance.times_s)
        check_joints(f"{out / name / dancer}", _seen_m(performance), MAX_COORDINATE_M)
    with locked(out / name):
        (out / name / LABELS).unlink(missing_ok=True)  # a dance without it is incomplete
        write_teacher(out / name, Performance(_seen_m(teacher), teacher.times_s))
        for learner, performance in learners.items():
            write_learner(out / name, learner, performance.times_s, _seen_m(performance))
        write_labels(out / name, learners)
    print(f"{out / name}: teacher and {len(learners)} learners, best first: {', '.join(learners)}")


def _seen_m(performance: Performance) -> np.ndarray:
    return np.where(performance.confidence[..., None] < SEEN_CONFIDENCE, np.nan, performance.joints_m)


def convert_recordings(given: argparse.Namespace) -> None:
    """Writes a dance from the files of joints that the command line names."""
    names, paths = [path.stem for path in given.learners], [given.teacher, *given.learners]
    if len(set(map(str.casefold, names))) < max(len(names), 2):  # on Windows and macOS Ann.h5 and ann.h5 are one file
        raise InputError(
            "--learners: give at least two files of different names, the best dancer's first; capitals do not count"
        )
    teacher, *learners = from_absolute_clocks([read_strangers_performance(one, given.fps, given.joint_map) for one in paths])
    write_dance(given.out, given.dance, teacher, dict(zip(names, learners, strict=True)))


def convert_imperial(source: Path, out: Path) -> None:
    """Writes a dance for every choreography that is recorded at all three levels in a folder of dance_level_*.npy."""
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
            learner: imperial_performance(takes[level][take], levels[level]) for learner, (level, take) in chosen.items()
        }
        write_dance(out, name, imperial_performance(takes["e"][0], levels["e"]), learners)


def imperial_performance(points: np.ndarray, path: Path) -> Performance:
    """The dance of (T, 21, 3) points of ImperialDance."""
    return named_performances([(NamedPoints(IMPERIAL_NAMES, np.array(points)), str(path))], IMPERIAL_FPS)[0]


@user_errors
def main() -> None:
    parser = program_parser("kpopnet convert", __doc__)
    kinds = parser.add_subparsers(dest="kind", required=True)
    recordings = kinds.add_parser("recordings")
    recordings.add_argument("out", type=Path, help="folder of the set, may be new")
    recordings.add_argument("--dance", required=True, help="its name in the set")
    recordings.add_argument("--teacher", type=Path, required=True)
    recordings.add_argument("--learners", type=Path, nargs="+", required=True, help="from the best to the worst")
    recordings.add_argument("--fps", type=float, help="the true frame rate, where the files state none or a wrong one")
    recordings.add_argument("--joint-map", type=Path, metavar="FILE", help="JSON: which of the files' points are which joints")
    imperial = kinds.add_parser("imperial")
    imperial.add_argument("source", type=Path, help="folder of dance_level_*.npy")
    imperial.add_argument("out", type=Path, help="folder of the set, may be new")
    given = parser.parse_args()
    if given.kind == "imperial":
        convert_imperial(given.source, given.out)
    else:
        convert_recordings(given)
