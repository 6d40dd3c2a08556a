"""Measures lessons by depth camera on SIMULATED learners in rooms: what they score, and how small a fault is told.

    PYTHONPATH=. python tools/measure_lessons.py --figures results/lessons.json
    PYTHONPATH=. python tools/measure_lessons.py --dances 60 70 --people train       # others, to choose something on

The learners stand in rooms as those of `kpopnet teach`, each another person, near those of the benchmarks, and are found by the
finder. They are scored as a lesson scores them: the joints that it shows, with realtime's errors, beside the teacher's own and
as realtime sees them; and what the network alone sees beside the teacher as it sees them, as lessons do once `kpopnet teach
see` was run. What was estimated of a learner is kept in a file. The dances are of the teacher's kind, none of its collection.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.dance.feedback import feedback
from kpopnet.dance.noise.table import SEEN, SEEN_PEOPLE
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import DanceScore
from kpopnet.data.made_sets import claim_folder
from kpopnet.networks import PASSES
from kpopnet.pose import PoseEstimator
from kpopnet.programs.score import seen_teacher
from kpopnet.runtime.atomic_write import write_json, write_npz
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.provenance import measured_by
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.weights import SHA256
from synth.dances.live import LiveLearner
from synth.dances.taught import DANCES, Teacher, composed
from tools.graded_learners import FAULTS, on_body
from tools.measure_noise import against_truth, area, lesson_score

SECONDS, STRIDE = 12.0, 2
"""Length of a learner's dance, and of how many frames of the dance, 30 a second, one is seen."""

LEVELS = ("best", "bad", "worst")
GRADED = (("arm", 15), ("arms", 10), ("forward", 15), ("smaller", 15), ("arm", 30))
"""One fault of known size each, of tools/graded_learners.py: degrees, or percent of the amplitude."""

KINDS = (("perfect", 0), ("perfect", 2), *GRADED, *((level, 0) for level in LEVELS))
WAYS = {"realtime": ("realtime", False), "realtime_seen": ("realtime", True), "network_seen": ("network", True)}
"""Whose joints are scored, and whether beside the teacher as it sees them."""


class Learner(NamedTuple):
    """A learner of a dance, and what was estimated of them."""

    dance: int
    kind: str
    teacher: Performance
    true: Performance
    estimated: dict[str, Performance]  # by the estimator's name


def learner(path: Path, dance: int, number: int, people_of: str, estimator: PoseEstimator) -> Learner:
    """The learner of KINDS of a dance; from a file, which is made if it does not exist."""
    made, (skill, size) = Teacher().dance(dance), KINDS[number]
    frames = range(0, min(round(SECONDS * made.fps), len(made.joints_m)), STRIDE)
    if not path.exists():
        quats, hips_m = made.quats, made.hips_m
        if (skill, size) in GRADED:
            quats, hips_m = on_body(FAULTS[skill](composed(dance)[0], size))
        danced = skill if skill in LEVELS else "perfect"
        person = LiveLearner(quats, hips_m, made.fps, danced, seed=3000 * dance + number, people_of=people_of)
        estimator.reset()
        found: dict[str, list[np.ndarray]] = {}
        for frame in frames:
            people = estimator.update(person.frame(frame / made.fps), person.camera, frame / made.fps)
            missing = np.full((NUM_JOINTS, 3), np.nan), np.zeros(NUM_JOINTS)
            realtime = people[0][1:3] if people else missing
            network = (people[0].network if people else None) or realtime
            columns = {"true_m": person.true_joints_m(), "realtime_m": realtime[0], "realtime_confidence": realtime[1]}
            for name, value in (columns | {"network_m": network[0], "network_confidence": network[1]}).items():
                found.setdefault(name, []).append(value)
        write_npz(path, **{name: np.array(column, np.float32) for name, column in found.items()})
    times_s, teacher_m = np.array(frames) / made.fps, made.joints_m[: frames.stop]
    with np.load(path) as stored:
        estimated = {name: Performance(stored[f"{name}_m"], times_s, stored[f"{name}_confidence"]) for name, _ in WAYS.values()}
        teacher = Performance(teacher_m, np.arange(len(teacher_m)) / made.fps)
        return Learner(dance, f"{skill}_{size}", teacher, Performance(stored["true_m"], times_s), estimated)


def as_seen(path: Path, teacher: Performance, name: str) -> Performance:
    """The teacher as an estimator sees them; from a file, which is made if it does not exist."""
    if not path.exists():
        write_npz(path, joints_m=seen_teacher(teacher, name).joints_m)
    with np.load(path) as stored:
        return Performance(stored["joints_m"], teacher.times_s)


def figures(learners: Sequence[Learner], scores: Sequence[DanceScore], true: np.ndarray) -> dict[str, Any]:
    """The errors of scores against those on true joints, and what is told of whom."""
    points, kinds = np.array([one.similarity for one in scores]), np.array([one.kind for one in learners])
    perfect = np.char.startswith(kinds, "perfect")
    levels = np.array([points[kinds == f"{level}_0"] for level in LEVELS])
    remarks = np.array([np.mean([len(phrase.moments) for phrase in feedback(one).phrases]) for one in scores])
    return against_truth(scores, true) | {
        "perfect": [float(points[perfect].mean()), float(points[perfect].min())],
        "auc": {f"{kind}_{size}": area(points[perfect], points[kinds == f"{kind}_{size}"]) for kind, size in GRADED},
        "in_order": int((np.diff(levels, axis=0) < 0).all(axis=0).sum()),
        "remarks_of_perfect": float(remarks[perfect].mean()),
        "remarks_of_best": float(remarks[kinds == "best_0"].mean()),
    }


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path("outputs/lessons"), help="of what was estimated: %(default)s")
    parser.add_argument("--dances", type=int, nargs=2, default=(80, 88), metavar=("FROM", "TO"), help="numbers: %(default)s")
    people = "near whom the learners are: of the benchmarks or of the training; %(default)s"
    parser.add_argument("--people", choices=("benchmark", "train"), default="benchmark", help=people)
    parser.add_argument("--figures", type=Path, help="a JSON file for the figures, as those of results/")
    given = parser.parse_args()
    weights = {name: digest for files in SHA256.values() for name, digest in files.items()}
    made_with = {"seconds": SECONDS, "stride": STRIDE, "passes": PASSES, "mode": "best"}
    claim_folder(given.folder, "*.npz", made_with | {"people": given.people, "seen": SEEN_PEOPLE} | weights)
    estimator, learners = PoseEstimator.load(mode="best"), []
    dances = range(DANCES + given.dances[0], DANCES + given.dances[1])
    with tqdm(total=len(dances) * len(KINDS), unit="learner") as bar:
        for dance in dances:
            for number, (skill, size) in enumerate(KINDS):
                path = given.folder / f"{dance}_{skill}_{size}.npz"
                learners.append(learner(path, dance, number, given.people, estimator))
                bar.update()
    true = np.array([lesson_score(one.teacher, one.true, "none").similarity for one in learners])
    found: dict[str, Any] = {"what": "SIMULATED lessons in rooms", "learners": len(learners), "dances": len(dances)}
    for way, (name, is_seen) in WAYS.items():
        teachers = {one.dance: one.teacher for one in learners}
        if is_seen:
            teachers = {dance: as_seen(given.folder / f"{dance}_{way}.npz", one, name) for dance, one in teachers.items()}
        noise = f"{name}{SEEN}" if is_seen else name
        scores = [lesson_score(teachers[one.dance], one.estimated[name], noise) for one in learners]
        found[way] = figures(learners, scores, true)
        print(way, found[way])
    if given.figures:
        write_json(given.figures, found | measured_by())


if __name__ == "__main__":
    main()
