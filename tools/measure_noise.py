"""Measures what an estimator's errors do to scores of training dances, for the table `kpopnet.dance.noise.table.NOISE`.

    python tools/graded_learners.py data/graded/best --dances 12 --mode best
    python tools/measure_noise.py data/graded/best data/graded/best_clips --estimator network --write
    python -m synth benchmark=kpop_sim benchmark.split=train benchmark.dances=6 out=data/kpop_train
    python tools/measure_noise.py data/kpop_train --estimator tracker                    # of images
    python tools/measure_noise.py data/graded/fresh --estimator realtime --known         # other people and dances
    python tools/measure_noise.py data/graded/best data/graded/best_clips --estimator network --seen-teacher --write

Folders hold dances in the K-Pop format, or what tools/graded_learners.py makes. What perfect dancing keeps is learnt from every
learner compared with their own true joints, so that only the sensor and the estimator differ; beside teachers as the estimator
sees them, from the perfect learners alone. What is printed of scores is with the noise and the spread that other dances give,
of other recordings: excerpts of the scored one's are left out with it. Run from the root of a checkout with `PYTHONPATH=.`.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares, minimize
from tqdm import tqdm

from kpopnet.dance.dtw import PathDistances
from kpopnet.dance.features import FEATURES
from kpopnet.dance.noise.sight import path_distances, segment_differences
from kpopnet.dance.noise.steady import PART_OF_SEGMENT, SEGMENTS, steady_squared
from kpopnet.dance.noise.table import NOISE, RECORDED, SEEN, TABLE, EstimatorNoise, doubt, known_noise
from kpopnet.dance.parts import CONTEXT_FRAMES, HOP_FRAMES
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import OURS, DanceScore, TimeGrid, score_dance
from kpopnet.dance.window import PARTS, WINDOW_FRAMES, or_nan, part_of_angles
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.evaluation.registry import ESTIMATORS
from kpopnet.networks.over_time import Measured, OverTime, read
from kpopnet.programs.score import seen_teacher
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.teacher.live.lesson import Lesson
from kpopnet.teacher.live.score import scorer_config
from kpopnet.tracker.estimator import TrackerEstimatorConfig
from kpopnet.weights import shipped

MEASURED = ("tracker", "network", "fitted_network", "realtime", "best")
CONFIG = replace(OURS, noise="none")
KINDS = ("arm", "leg", "torso", "turning")
LATE_S = (0.05, 0.1)
"""How late perfect dancing is taken to be, to see whether its timing tells."""

TESTED = "measured"
"""Name in NOISE of what is being measured."""


class Seen(NamedTuple):
    """A learner of a dance as they danced, and as sensor and estimator saw them; `fault` is what is wrong, if it is known."""

    dance: str  # of films and images: its path
    fault: str
    teacher: Performance
    true: Performance
    estimated: Performance
    shown: Performance | None = None  # the teacher as the estimator sees them, whom the estimated joints are compared with
    recording: str = ""  # of which the dance is an excerpt, if it is known

    @property
    def unit(self) -> str:
        """What is left out together when a learner is scored by what the others give."""
        return self.recording or self.dance

    @property
    def is_perfect(self) -> bool:
        return self.fault.startswith("perfect")


class Own(NamedTuple):
    """A learner's estimated joints compared with their own true ones: frame by frame, and in N windows of P parts."""

    distances: PathDistances
    kept: np.ndarray  # (N, P) mean similarity of the frames that show the part; NaN where none does
    doubt: np.ndarray  # (N, P) as the score has it
    steady_rad2: np.ndarray  # (N, S) `steady_squared` of each segment


class Scored(NamedTuple):
    """Scores of a learner: on true joints, through the estimator without and with its noise known, and the uncertainty."""

    true: float
    unknown: float
    known: float
    uncertainty: float


def of_films(folder: Path, estimator: str) -> list[Seen]:
    """The learners of a folder that tools/graded_learners.py made."""
    causal, future = map(OverTime.load, shipped("over_time"))
    estimates: dict[str, Callable[[Measured, np.ndarray], tuple[np.ndarray, np.ndarray]]] = {
        "network": lambda measured, _: (measured.detected_m, measured.detected),
        "fitted_network": lambda measured, _: (measured.fitted_m, measured.fitted),
        "realtime": lambda measured, times_s: causal(*read(measured, times_s, future=False)),
        "best": lambda measured, times_s: future(*read(measured, times_s, future=True)),
    }
    if estimator not in estimates:
        raise InputError(f"{folder}: its films hold what {', '.join(estimates)} say; {estimator} needs images")
    found = []
    for path in sorted(folder.glob("*.npz")):
        film, (_, number, fault) = np.load(path), path.stem.split("_", 2)
        teacher, true = (Performance(film[name], np.arange(len(film[name])) / film["fps"]) for name in ("teacher_m", "true_m"))
        measurements = Measured(*(film[name] for name in Measured._fields))
        joints_m, confidence = estimates[estimator](measurements, true.times_s)
        estimated = Performance(joints_m, true.times_s, confidence)
        found.append(Seen(str(folder / number), fault, teacher, true, estimated, recording=str(film["motion"])))
    return found


def of_images(folder: Path, estimator: Estimator) -> list[Seen]:
    """The learners of a folder of dances in the K-Pop format; raises InputError if one lacks depth or true joints."""
    found, dances = [], KpopSet(folder)
    for name in tqdm(dances.names, "dances", unit="dance"):
        dance = dances.dance(name)
        for learner in dance.learners:
            true, clip = learner.joints(), learner.depth()
            if true is None:
                raise InputError(f"{learner.path}: no true joints in it; noise is measured on simulated dances")
            joints_m, confidence = estimator.estimate(clip.depth_m, clip.camera)
            estimated = Performance(joints_m, clip.times_s, confidence)
            found.append(Seen(str(folder / name), "", dance.teacher(), true, estimated))
    return found


def with_seen_teachers(learners: Sequence[Seen], estimator: str) -> list[Seen]:
    """The learners beside teachers whose joints are as an estimator sees them."""
    teachers = {one.dance: one.teacher for one in learners}
    seen = {dance: seen_teacher(teachers[dance], estimator) for dance in tqdm(teachers, "teachers", unit="dance")}
    return [one._replace(shown=Performance(seen[one.dance].joints_m, seen[one.dance].times_s)) for one in learners]


def with_recorded_teachers(learners: Sequence[Seen]) -> list[Seen]:
    """The learners beside a teacher who was recorded as they were: the first other perfect learner of the dance."""
    perfect = [one for one in learners if one.is_perfect]
    return [
        one._replace(shown=next(other.estimated for other in perfect if other.dance == one.dance and other is not one))
        for one in learners
    ]


def own_errors(seen: Seen, sees_depth: bool = True) -> Own:
    """The errors of a learner's estimated joints; `sees_depth` as of `EstimatorNoise`."""
    grid = TimeGrid(seen.true, CONFIG.feature)
    estimated = grid.features(*grid.resampled(seen.estimated, grid.frames))
    frames, parts = np.arange(len(estimated.angles_rad)), part_of_angles(CONFIG.feature)
    path = np.stack([frames, np.zeros_like(frames)], axis=1)
    distances = path_distances(path, estimated, grid.teacher, 0, parts, sees_depth)
    shown = (distances.taught > 0) & (distances.seen == 1)
    similarity = np.where(shown, CONFIG.posture(distances.squared[:, 1]), 0.0)
    kept, unsure, steady = [], [], []
    for stop in range(WINDOW_FRAMES, len(frames) + 1, HOP_FRAMES):
        rows = slice(stop - WINDOW_FRAMES, stop)
        kept.append(similarity[rows].sum(axis=0) / or_nan(shown[rows].sum(axis=0)))
        unsure.append(doubt(distances.confidence[max(stop - CONTEXT_FRAMES, 0) : stop]))
        steady.append(steady_squared(segment_differences(estimated.at(rows), grid.teacher.at(rows), sees_depth)))
    return Own(distances, np.array(kept), np.array(unsure), np.array(steady))


def compared(learners: Sequence[Seen]) -> list[Seen]:
    """Learners whose estimated joints differ from `true` by errors alone: all; beside a teacher as the estimator sees them the
    perfect ones, from that teacher.
    """
    own = (
        one if one.shown is None else one._replace(true=one.shown) for one in learners if one.shown is None or one.is_perfect
    )
    return list(own)


def measured(errors: Sequence[Own], sees_depth: bool = True) -> EstimatorNoise:
    """The noise of the estimator of learners with these errors, of spread 1; `sees_depth` as for `own_errors`."""
    own = [one.distances for one in errors]
    signed, weights = (np.concatenate([getattr(one, name) for one in own]) for name in ("signed", "weights"))
    mean = (np.nan_to_num(signed) ** 2 * weights).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-9)
    names = FEATURES[CONFIG.feature].names
    std_rad = {name: round(float(np.sqrt(one)), 3) for name, one in zip(names, mean, strict=True)}
    kept, unsure, steady_rad2 = (np.concatenate([getattr(one, name) for one in errors]) for name in Own._fields[1:])
    loss = {}
    for kind in KINDS:
        parts = [part for part, name in enumerate(PARTS) if name.endswith(kind)]
        known = np.isfinite(kept[:, parts])
        windows = unsure[:, parts][known], kept[:, parts][known]
        fitted = least_squares(_missing_kept, (0.0, 0.5), bounds=((-9, 0), (6, 3)), args=windows).x
        loss[kind] = (round(float(np.exp(fitted[0])), 3), round(float(fitted[1]), 3))
    return EstimatorNoise(std_rad, loss, 1.0, _steady(steady_rad2, unsure[:, PART_OF_SEGMENT]), sees_depth)


def _steady(steady_rad2: np.ndarray, unsure: np.ndarray) -> dict[str, tuple[float, float]]:
    """`EstimatorNoise.steady` of (N, S) squared steady errors, radians^2, and doubts: the likeliest of exponential squares."""
    found, kinds = {}, [name.split("_")[-1] for name in SEGMENTS]
    for kind in dict.fromkeys(kinds):
        columns = [number for number, one in enumerate(kinds) if one == kind]
        squared, doubts = steady_rad2[:, columns], unsure[:, columns]
        known = np.isfinite(squared)
        fitted = minimize(_deviance, (0.0, 0.5), args=(squared[known], np.log(doubts[known])), bounds=((-5, 3), (0, 3))).x
        size, power = np.exp(fitted[0]), fitted[1]
        found[kind] = (round(float(size), 3), round(float(power), 3))
    return found


def _deviance(parameters: np.ndarray, squared: np.ndarray, log_doubt: np.ndarray) -> float:
    log_mean = 2 * (parameters[0] + parameters[1] * log_doubt)
    return float(np.mean(squared * np.exp(-log_mean) + log_mean))


def _missing_kept(logarithmic: np.ndarray, unsure: np.ndarray, kept: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(logarithmic[0]) * unsure ** logarithmic[1]) - kept


def scored(one: Seen, noise: EstimatorNoise) -> Scored:
    """The scores of a learner with a noise."""
    NOISE[TESTED] = noise
    true, unknown = (score_dance(one.teacher, danced, CONFIG).similarity for danced in (one.true, one.estimated))
    known = score_dance(one.shown or one.teacher, one.estimated, replace(CONFIG, noise=TESTED))
    del NOISE[TESTED]
    return Scored(true, unknown, known.similarity, known.uncertainty)


def scored_by_others(learners: Sequence[Seen], sees_depth: bool = True) -> list[Scored]:
    """The scores of all learners, each with the noise that the other units give; `sees_depth` as for `own_errors`.

    Their uncertainty is that of spread 1.
    """
    own, found = [(one.unit, own_errors(one, sees_depth)) for one in compared(learners)], dict[int, Scored]()
    for unit in sorted({one.unit for one in learners}):
        noise = measured([errors for of, errors in own if of != unit], sees_depth)
        found |= {number: scored(one, noise) for number, one in enumerate(learners) if one.unit == unit}
    return [found[number] for number in range(len(learners))]


def spread(scores: Sequence[Scored]) -> float:
    """The spread with which 95 % of true scores lie within the uncertainty; `scores` have that of spread 1."""
    return float(np.quantile([abs(one.known - one.true) / max(one.uncertainty, 1e-9) for one in scores], 0.95))


def spread_by_others(learners: Sequence[Seen], scores: Sequence[Scored]) -> list[Scored]:
    """Scores of spread 1 with the uncertainty of the spread that the other units give."""
    widths = {
        unit: spread([score for one, score in zip(learners, scores, strict=True) if one.unit != unit])
        for unit in {one.unit for one in learners}
    }
    return [
        score._replace(uncertainty=widths[one.unit] * score.uncertainty) for one, score in zip(learners, scores, strict=True)
    ]


def summary(learners: Sequence[Seen], scores: Sequence[Scored]) -> str:
    """Errors of the scores, perfect dancing, and each fault against it, with the noise unknown and known."""
    true, unknown, known, uncertainty = np.array(scores).T
    perfect = np.array([one.is_perfect for one in learners])
    lines = [f"{len(learners)} learners; true scores {true.mean():.1f}"]
    for name, values in (("unknown", unknown), ("known", known)):
        error, slope = values - true, np.polyfit(true, values, 1)[0] if np.ptp(true) > 1 else np.nan
        line = f"noise {name}: bias {error.mean():+.1f}, rms {np.sqrt((error**2).mean()):.1f}, slope {slope:.2f}"
        if perfect.any():
            line += f"; perfect dancing mean {values[perfect].mean():.1f}, least {values[perfect].min():.1f}"
        lines.append(line)
    within = abs(known - true) <= uncertainty
    middle, least, greatest = np.quantile(uncertainty, (0.5, 0, 1))
    lines.append(f"uncertainty {middle:.1f} ({least:.1f} to {greatest:.1f}), holds for {within.mean():.0%}")
    if not perfect.any():
        return "\n".join(lines)
    lines[-1] += f", for perfect dancing {within[perfect].mean():.0%}"
    for fault in sorted({one.fault for one in learners if not one.is_perfect}):
        chosen = np.array([one.fault == fault for one in learners])
        means = ", ".join(f"{values[chosen].mean():.1f}" for values in (true, unknown, known))
        areas = ", ".join(f"{area(values[perfect], values[chosen]):.2f}" for values in (true, unknown, known))
        lines.append(f"{fault}: true, noise unknown, known: {means}; AUC {areas}")
    return "\n".join(lines)


def lesson_score(teacher: Performance, danced: Performance, noise: str) -> DanceScore:
    """The score that a lesson gives one who dances like `danced`."""
    return score_dance(teacher, danced, scorer_config(Lesson("dance"), noise))


def against_truth(scores: Sequence[DanceScore], true: np.ndarray) -> dict[str, float]:
    """How far scores are from those on true joints, and how often they are within their uncertainty."""
    points, uncertainty = (np.array([getattr(one, name) for one in scores]) for name in ("similarity", "uncertainty"))
    error = points - true
    return {
        "rms": float(np.sqrt((error**2).mean())),
        "bias": float(error.mean()),
        "slope": float(np.polyfit(true, points, 1)[0]),
        "correlation": float(np.corrcoef(true, points)[0, 1]),
        "uncertainty": float(np.median(uncertainty)),
        "within_uncertainty": float(100 * np.mean(abs(error) <= uncertainty)),
    }


def lateness(learners: Sequence[Seen], noise: EstimatorNoise) -> str:
    """How well the timing of perfect dancing that is late tells it from perfect dancing on time, through the estimator."""
    NOISE[TESTED] = noise
    known, timings = replace(CONFIG, noise=TESTED), {}
    perfect = [one for one in learners if one.is_perfect]
    for late_s in (0.0, *LATE_S):
        late = [Performance(one.estimated.joints_m, one.true.times_s + late_s, one.estimated.confidence) for one in perfect]
        pairs = zip(perfect, late, strict=True)
        timings[late_s] = np.array([score_dance(one.shown or one.teacher, seen, known).timing for one, seen in pairs])
    del NOISE[TESTED]
    if not perfect:
        return "no learner dances perfectly: lateness was not looked at"
    return ", ".join(f"{late_s} s late: AUC of the timing {area(timings[0.0], timings[late_s]):.2f}" for late_s in LATE_S)


def area(better: Sequence[float] | np.ndarray, worse: Sequence[float] | np.ndarray) -> float:
    """How often, of all pairs, the better learner has the higher score; an equal one counts as half."""
    difference = np.subtract.outer(better, worse)
    return float(((difference > 0) + (difference == 0) / 2).mean())


def _build(name: str, checkpoint: str | None) -> Estimator:
    """The estimator of a name of an evaluation, with its default settings."""
    kind, builder = ESTIMATORS[name]
    return builder(TrackerEstimatorConfig() if name == "tracker" else kind(checkpoint=checkpoint))


def enter(name: str, noise: EstimatorNoise) -> None:
    """Enters an estimator's noise in the table, in place of what the table said of it."""
    write_json(TABLE, json.loads(TABLE.read_text()) | {name: noise._asdict()})


@user_errors
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+", help="dances with true joints")
    parser.add_argument("--estimator", choices=MEASURED, default="tracker", help="what is measured: %(default)s")
    parser.add_argument("--checkpoint", help="folder of its network")
    parser.add_argument("--seen-teacher", action="store_true", help="compare with teachers as the estimator sees them")
    recorded = "compare with teachers who were recorded as the learners were: others who dance perfectly"
    parser.add_argument("--recorded-teacher", action="store_true", help=recorded)
    parser.add_argument("--known", action="store_true", help="only score, with the estimator's noise of the table")
    parser.add_argument("--write", action="store_true", help=f"enter the noise in {TABLE.name} under the estimator's name")
    given = parser.parse_args(arguments)
    learners, estimator = [], None
    for folder in given.folders:
        if any(folder.glob("*.npz")):
            learners += of_films(folder, given.estimator)
        else:
            estimator = estimator or _build(given.estimator, given.checkpoint)
            learners += of_images(folder, estimator)
    name = given.estimator
    if given.seen_teacher:
        learners, name = with_seen_teachers(learners, name), f"{name}{SEEN}"
    elif given.recorded_teacher:
        learners, name = with_recorded_teachers(learners), f"{name}{RECORDED}"
    if given.known:
        noise = known_noise(name)
        print(summary(learners, [scored(one, noise) for one in learners]))
        print(lateness(learners, noise))
        return
    if len({one.unit for one in learners}) < 2:
        raise InputError(f"{given.folders[0]}: one dance; the uncertainty is measured on other dances than the noise")
    scores = scored_by_others(learners)
    noise = measured([own_errors(one) for one in compared(learners)])._replace(spread=round(spread(scores), 3))
    scores = spread_by_others(learners, scores)
    for folder in given.folders if len(given.folders) > 1 else ():
        of_it = [number for number, one in enumerate(learners) if Path(one.dance).parent == folder]
        print(f"{folder}: {summary([learners[k] for k in of_it], [scores[k] for k in of_it])}")
    print(summary(learners, scores))
    print(lateness(learners, noise))
    print(json.dumps({name: noise._asdict()}))
    if given.write:
        enter(name, noise)


if __name__ == "__main__":
    main()
