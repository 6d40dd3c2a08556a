"""Scores a learner's dance against a teacher's, from two files of joints.

    kpopnet score teacher.bvh learner.bvh
    kpopnet score teacher.csv learner.csv --learner-fps 30 --out outputs/score/ann

Files are .npz, .bvh, .glb or others; docs/joint_files.md says what they hold. Time zero is the same instant of the music
in both; times since 1970 count from the file's first frame. A mirrored dance, swapped sides, left-handed axes, a clock that
is a second or more off and a wrong frame rate are corrected where that gains 30 points or more, and both scores are printed;
what may be the dancer's own fault, such as 0.3 s of delay, never is. The program prints the score and what to mend, phrase by
phrase, and writes score.json and score.html: one page with a replay of both dancers in 3D, which needs no other file. An
earlier score in the same folder is replaced.
"""

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from kpopnet.dance.diagnosis import AS_RECORDED, CORRECTIONS, Correction, RecordingFault, composed, corrected, delayed, diagnose
from kpopnet.dance.feedback import feedback
from kpopnet.dance.joint_files.reader import read_strangers_performance
from kpopnet.dance.noise.table import NOISE, RECORDED, SEEN
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import ABSOLUTE_S, Performance, check_dance, from_absolute_clocks, off_by
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.dance.window import WINDOW_S
from kpopnet.dance.words.moments import phrase_length_s
from kpopnet.errors import InputError, check_between
from kpopnet.estimator import Estimator
from kpopnet.evaluation.dances.score_text import score_json, score_notes, score_text
from kpopnet.evaluation.report import write_text
from kpopnet.evaluation.values import plain
from kpopnet.languages import LANGUAGES, Said, in_language
from kpopnet.programs.arguments import add_grading, check_grading, program_parser
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.folder_lock import locked
from kpopnet.skeleton import JOINT_NAMES, Joint
from kpopnet.teacher.library import TeacherBody
from kpopnet.teacher.live.words import score_result
from kpopnet.teacher.posing import at_rate, posed
from kpopnet.teacher.result_page import result_page


def other_formats(teacher: Path, learner: Path) -> list[RecordingFault]:
    """A warning where the two files may place joints differently."""
    if teacher.suffix.lower() == learner.suffix.lower():
        return []
    text = (
        "{teacher} and {learner} are of different formats, whose joints may lie elsewhere in the body (a hand at "
        "the wrist or in the palm); that costs points. Record both in the same way"
    )
    return [RecordingFault(Said(text, teacher=teacher.name, learner=learner.name), None, "format")]


def read_observed(path: Path, fps: float | None, joint_map: Path | None, correction: str, scorer: str) -> Performance:
    """Reads one dance; raises InputError as `read_performance`, or if a joint that the scorer needs is missing throughout."""
    performance = corrected(read_strangers_performance(path, fps, joint_map), correction)
    if SCORERS[scorer].feature == "raptis" and Joint.NECK in performance.unseen_joints:
        raise InputError(f"{path}: neck missing in every frame; scorer {scorer} needs it, dance22 does not")
    return performance


def seen_teacher(teacher: Performance, name: str, estimator: Estimator | None = None) -> Performance:
    """The teacher's dance as the estimator of a name of SEEN_BY sees it, the package's unless one is given.

    It takes a core 0.6 to 1.5 times the dance's length, by processor; a bar shows how far it is. Raises InputError where a
    joint is missing throughout, the dance is too long, or a slim installation lacks what simulates.
    """
    try:
        from synth.body.teacher import teacher_arrays
        from synth.dances.seen import FPS, PEOPLE, common_errors_m
    except ModuleNotFoundError as error:
        raise InputError(f"the teacher as {name} sees them is simulated, which needs {error.name}; install it") from error

    if missing := [JOINT_NAMES[joint] for joint in check_dance(teacher, "the teacher").unseen_joints]:
        raise InputError(f"the teacher as {name} sees them: {', '.join(missing)} missing in every frame; all joints are needed")
    joints_m = at_rate(teacher, FPS).astype(np.float64)
    movement, times_s = posed(joints_m, TeacherBody(**teacher_arrays())), teacher.times_s - teacher.times_s[0]
    with tqdm(total=PEOPLE, desc=f"the teacher as {name} sees them", unit="person", leave=False, disable=None) as bar:
        errors_m = common_errors_m(joints_m, *movement, estimator or seeing_estimator(name), times_s, bar.update)
    return off_by(teacher, errors_m, f"{name}{SEEN}")


def seeing_estimator(name: str) -> Estimator:
    """The package's estimator of a name of SEEN_BY."""
    from kpopnet.networks.estimator import NetworkEstimator
    from kpopnet.pose.person import PersonEstimator

    network = NetworkEstimator()
    return network if name == "network" else PersonEstimator(network, name)


def parsed() -> argparse.Namespace:
    parser = program_parser("kpopnet score", __doc__)
    parser.add_argument("teacher", type=Path, help="file of the reference dance")
    parser.add_argument("learner", type=Path, help="file of the dance to score")
    parser.add_argument("--out", type=Path, default=Path("outputs/score"), help="folder of page and JSON: %(default)s")
    parser.add_argument("--scorer", choices=sorted(SCORERS), default="dance22", help="settings of the scorer: %(default)s")
    for name in ("teacher", "learner"):
        rate = f"the true frame rate of a {name}'s file that states none or a wrong one"
        joints = f"what is done to the {name}'s joints"
        parser.add_argument(f"--{name}-fps", type=float, help=rate)
        parser.add_argument(f"--correct-{name}", choices=CORRECTIONS, default="as_recorded", help=f"{joints}: %(default)s")
    mapped = "JSON that names the points of each joint, for files (also .npy) that use other names than ours"
    parser.add_argument("--joint-map", type=Path, metavar="FILE", help=mapped)
    parser.add_argument("--late", type=float, default=0.0, help="seconds by which the learner's clock is late: %(default)s")
    parser.add_argument("--as-is", action="store_true", help="correct nothing, only name probable faults of the files")
    noise = (
        "estimator of the learner's joints, whose known errors are not counted; auto, the default, is webcam for MediaPipe's "
    )
    noise += "points and none, as for true joints, elsewhere"
    kinds = [name for name in NOISE if not name.endswith((SEEN, RECORDED))]
    parser.add_argument("--noise", choices=("auto", *kinds), default="auto", help=noise)
    joints = (
        "what the teacher's joints are: true; recorded, by the estimator of --noise, too; or seen: true, and compared are what"
    )
    joints += (
        " that estimator sees of simulated people who dance the same, so that what it is off of all of them is no fault (a"
    )
    joints += " core takes about the dance's length for it): %(default)s"
    parser.add_argument("--teacher-joints", choices=("true", "seen", "recorded"), default="true", help=joints)
    parser.add_argument("--lang", choices=LANGUAGES, default="en", help="language of page and text: %(default)s")
    add_grading(parser, "with --bpm")
    parser.add_argument("--bpm", type=float, help="tempo of the music: phrases of eight beats instead of 4 s, delays in beats")
    given = parser.parse_args()
    if given.bpm is not None and not 20 <= given.bpm <= 400:
        raise InputError(f"--bpm {given.bpm:g}: expected 20 to 400 beats a minute")
    for joints, of in (("seen", SEEN), ("recorded", RECORDED)):
        known = [name.removesuffix(of) for name in NOISE if name.endswith(of)]
        if given.teacher_joints == joints and given.noise not in known:
            raise InputError(
                f"--teacher-joints {joints}: needs the estimator of the learner's joints, --noise {', '.join(known)}; found "
                f"{given.noise}"
            )
    check_between("--late", given.late, -ABSOLUTE_S, ABSOLUTE_S)
    check_grading(given)
    return given


@user_errors
def main() -> None:
    given = parsed()
    beat_s = 60 / given.bpm if given.bpm else None
    scorer = SCORERS[given.scorer]
    if isinstance(scorer, PartScorer):
        scorer = replace(scorer, noise=given.noise)
    elif given.noise not in ("auto", "none"):
        raise InputError(f"--noise {given.noise}: scorer {given.scorer} knows no noise; dance22 does")
    teacher = read_observed(given.teacher, given.teacher_fps, given.joint_map, given.correct_teacher, given.scorer)
    learner = read_observed(given.learner, given.learner_fps, given.joint_map, given.correct_learner, given.scorer)
    teacher, learner = from_absolute_clocks([teacher, learner])
    learner = delayed(learner, given.late)
    before = Correction(given.correct_teacher, given.correct_learner, late_s=given.late)
    diagnosis = diagnose(teacher, learner, scorer, given.as_is, given.free, before)
    diagnosis.faults[:0] = other_formats(given.teacher, given.learner)
    done = composed(before.learner, (diagnosis.correction or AS_RECORDED).learner)
    diagnosis = diagnosis._replace(mirrored=done == "mirrored")
    teacher, learner = diagnosis.teacher, diagnosis.learner
    compared = teacher
    if given.teacher_joints == "seen":
        with locked(given.out):  # a folder that cannot be written is told before minutes of work
            compared = seen_teacher(teacher, given.noise)
    elif given.teacher_joints == "recorded":
        compared = Performance(teacher.joints_m, teacher.times_s, teacher.confidence, given.noise)
    score = score_dance(compared, learner, scorer, free_s=given.free)
    if math.isnan(score.similarity):
        if score.all_free:
            raise InputError("--free: the whole dance is free; leave a part of it to be compared")
        raise InputError(f"{given.learner}: in no window of {WINDOW_S:g} s are enough joints known to compare the dances")
    from synth.body.teacher import teacher_arrays

    advice, notes = feedback(score, beat_s, diagnosis.faults), score_notes(score, diagnosis)
    wanted, total, told = dict(given.weights), {}, []
    if wanted:
        beats_s = score.beats_s(beat_s)
        if not (wanted := score.counted(wanted, beats_s)):
            raise InputError(
                "--weights: nothing of it is known of this dance (rhythm needs --bpm and a dance on the beat, place and height "
                "joints that know where the hips are)"
            )
        total = {"total": score.total(wanted, beats_s), "weights": wanted}
        shares = [Said("{what} {figure}", what=Said(name), figure=f"{share:g}") for name, share in wanted.items()]
        told = [Said("total {total} of 100: {weights}", total=f"{total['total']:.0f}", weights=shares)]
    title = Said("{learner} after {teacher}", learner=given.learner.name, teacher=given.teacher.name)
    result = score_result(score, advice, wanted, beat_s)
    phrase_s = phrase_length_s(beat_s)
    page = result_page(title, TeacherBody(**teacher_arrays()), (teacher, learner), result, notes, phrase_s, given.lang)
    files = {"teacher": str(given.teacher), "learner": str(given.learner)}
    content = score_json(score, advice, diagnosis, beat_s) | plain(total)
    content |= files | {"scorer": {"name": given.scorer, "feature": scorer.feature, **content["scorer"]}}
    with locked(given.out):
        write_text(given.out / "score.html", page)
        write_json(given.out / "score.json", content, allow_nan=False)
    look = Said("look at {path}", path=str(given.out / "score.html"))
    text = (*score_text(score, advice, [*told, *notes], beat_s), look)
    print("\n".join(in_language(line, given.lang) for line in text))
