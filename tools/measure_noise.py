"""Measures the errors of an estimator's angles on training dances, for the table `kpopnet.dance.parts.NOISE`.

    python -m synth benchmark=kpop_sim benchmark.split=train benchmark.dances=6 out=data/kpop_train
    python tools/measure_noise.py data/kpop_train                                        # the tracker
    python tools/measure_noise.py data/kpop_train --estimator network --checkpoint outputs/train/RUN/best
    python tools/measure_noise.py data/kpop_train --estimator realtime --write           # enters it in the table
    python tools/measure_noise.py data/kpop_sim --known tracker      # other people, with the noise of the table

Every learner is compared with their own true joints, so that only the sensor and the estimator differ. The ceiling is what this
perfect dancing scores in each dance with the errors that the other dances give. Run from the root of a checkout with
`PYTHONPATH=.`.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.dance.dtw import distances_on_path
from kpopnet.dance.features import FEATURES
from kpopnet.dance.parts import NOISE, TABLE, AngleNoise
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import OURS, TimeGrid, score_dance
from kpopnet.dance.window import part_of_angles
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.evaluation.registry import ESTIMATORS
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.tracker.estimator import TrackerEstimatorConfig

MEASURED = ("tracker", "network", "fitted_network", "realtime", "best")
CONFIG = replace(OURS, noise="none")


class Seen(NamedTuple):
    """A learner as they danced, and as sensor and estimator saw them."""

    dance: int
    true: Performance
    estimated: Performance


def seen_learners(folder: str, estimator: Estimator) -> list[Seen]:
    """The learners of a folder of dances.

    Raises:
        InputError: the folder does not exist, or a learner lacks depth or true joints.
    """
    found, dances = [], KpopSet(folder)
    for number, name in enumerate(tqdm(dances.names, "dances", unit="dance")):
        for learner in dances.dance(name).learners:
            true, clip = learner.joints(), learner.depth()
            if true is None:
                raise InputError(f"{learner.path}: no true joints in it; noise is measured on simulated dances")
            joints_m, confidence = estimator.estimate(clip.depth_m, clip.camera)
            found.append(Seen(number, true, Performance(joints_m, clip.times_s, confidence)))
    return found


def angle_errors(seen: Seen) -> tuple[np.ndarray, np.ndarray]:
    """(T, D) squared error of every angle of a learner, radians^2, and (T, D) its weight in the distance of the score."""
    grid = TimeGrid(seen.true, CONFIG.feature)
    estimated = grid.features(*grid.resampled(seen.estimated, grid.frames))
    frames = np.arange(len(estimated.angles_rad))
    path, parts = np.stack([frames, np.zeros_like(frames)], axis=1), part_of_angles(CONFIG.feature)
    on_path = distances_on_path(path, estimated, grid.teacher, 0, parts, np.zeros(len(parts)))
    return np.nan_to_num(on_path.signed) ** 2, on_path.weights


def measured_std_rad(learners: Sequence[Seen]) -> dict[str, float]:
    """The standard deviation of the error of each angle, radians, rounded to milliradians; see `AngleNoise`."""
    errors = [angle_errors(one) for one in learners]
    squared, weight = (np.concatenate(arrays) for arrays in zip(*errors, strict=True))
    mean = (squared * weight).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-9)
    names = FEATURES[CONFIG.feature].names
    return {name: round(float(np.sqrt(one)), 3) for name, one in zip(names, mean, strict=True)}


def perfect_scores(learners: Sequence[Seen]) -> tuple[list[float], list[float]]:
    """Scores of perfect dancing through sensor and estimator: without the noise known, and with that of the other dances."""
    without, known = [], []
    for dance in sorted({one.dance for one in learners}):
        NOISE["measured"] = AngleNoise(measured_std_rad([one for one in learners if one.dance != dance]), 100.0)
        own = [one for one in learners if one.dance == dance]
        without += scores_with(own, "none")
        known += scores_with(own, "measured")
        del NOISE["measured"]
    return without, known


def scores_with(learners: Sequence[Seen], name: str) -> list[float]:
    """Scores of perfect dancing through sensor and estimator with the noise of an entry of `NOISE`."""
    return [score_dance(one.true, one.estimated, replace(CONFIG, noise=name)).similarity for one in learners]


def _build(name: str, checkpoint: str | None) -> Estimator:
    """The estimator of a name of an evaluation, with its default settings."""
    kind, builder = ESTIMATORS[name]
    return builder(TrackerEstimatorConfig() if name == "tracker" else kind(checkpoint=checkpoint))


def _summary(scores: Sequence[float]) -> str:
    return (
        f"mean {np.mean(scores):.1f}, median {np.median(scores):.1f}, at least 90 for {np.mean(np.array(scores) >= 90):.0%} of "
        f"{len(scores)} learners"
    )


def enter(name: str, noise: AngleNoise) -> None:
    """Enters an estimator's noise in the table, in place of what the table said of it."""
    table = json.loads(TABLE.read_text()) | {name: noise._asdict()}
    with atomic_path(TABLE) as part:
        part.write_text(json.dumps(table, indent=1) + "\n")


@user_errors
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", help="dances in the K-Pop format (docs/kpop_format.md), with true joints")
    parser.add_argument("--estimator", choices=MEASURED, default="tracker", help="what is measured: %(default)s")
    parser.add_argument("--checkpoint", help="folder of its network")
    parser.add_argument("--known", choices=NOISE, help="only score perfect dancing, with this noise of the table")
    parser.add_argument("--write", action="store_true", help=f"enter the noise in {TABLE.name} under the estimator's name")
    options = parser.parse_args(arguments)
    learners = seen_learners(options.folder, _build(options.estimator, options.checkpoint))
    if options.known:
        print(f"perfect dancing, noise of {options.known}: {_summary(scores_with(learners, options.known))}")
        return
    if len({one.dance for one in learners}) < 2:
        raise InputError(f"{options.folder}: one dance; the ceiling is measured on other dances than the noise")
    without, known = perfect_scores(learners)
    for name, scores in (("noise unknown", without), ("noise known", known)):
        print(f"perfect dancing, {name}: {_summary(scores)}")
    noise = AngleNoise(measured_std_rad(learners), round(float(np.mean(known)), 1))
    print(json.dumps({options.estimator: noise._asdict()}, indent=1))
    if options.write:
        enter(options.estimator, noise)


if __name__ == "__main__":
    main()
