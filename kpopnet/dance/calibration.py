"""Chooses alpha, beta and tau of a scorer, which the paper does not give, on training dances.

    python -m synth benchmark=kpop_sim benchmark.split=train benchmark.dances=20 out=data/kpop_train
    python -m kpopnet.dance.calibration data/kpop_train                                 on true joints
    python -m kpopnet.dance.calibration data/kpop_train --checkpoint outputs/train/RUN/best    on a network's

Never on the dances that scores are reported on. What is asked of the three:

- A perfect copy keeps its score: 1 - exp(-1 / alpha) of Eq. (13) is at least `PERFECT`. The greatest such alpha is taken,
  since a greater one tells small delays better apart.
- Another dance, and standing still in the teacher's first pose, score less than `OTHER` and `STILL` in at least `OFTEN` of
  the dances: an upper bound of beta.
- Among what is left, most dances are in order; among equals neighbouring learners are told apart best: their scores' mean
  difference, over its standard deviation, in the pair where that is least. That alone would take the smallest tau, with which
  the worst learners' windows come to nothing and their order to chance.
"""

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.benchmarks.kpop import KpopSet
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, ScorerConfig, score_dance, timing_similarity
from kpopnet.entry import user_errors
from kpopnet.errors import InputError

PERFECT, OTHER, STILL, OFTEN = 0.96, 30.0, 20.0, 0.95

BETAS = (0.5, 0.7, 0.9, 1.1, 1.4, 1.8, 2.4)
TAUS = (0.3, 0.4, 0.5, 0.6, 0.75, 0.9)

TaughtDance = tuple[Performance, Sequence[Performance]]
"""A teacher, and the learners in the experts' order, the best first."""


class Candidate(NamedTuple):
    """What one choice of beta and tau makes of the training dances.

    Attributes:
        beta: radians.
        tau: seconds.
        separation: of neighbouring learners, in the pair where it is least; in standard deviations.
        concordance: percent of the dances in strict order.
        still: score of standing still that OFTEN of the dances stay below.
        other: the same of another dance.
    """

    beta: float
    tau: float
    separation: float
    concordance: float
    still: float
    other: float

    @property
    def allowed(self) -> bool:
        return self.still < STILL and self.other < OTHER


def greatest_alpha() -> float:
    """The greatest alpha with which a perfect copy keeps its score, to two digits."""
    return np.floor(-100 / np.log(1 - PERFECT)) / 100


def candidates(dances: Iterable[TaughtDance], config: ScorerConfig) -> list[Candidate]:
    """All choices of `BETAS` and `TAUS`, with the greatest alpha, for the scorer that `config` describes otherwise.

    Raises:
        InputError: fewer than two dances, or dances of different numbers of learners.
    """
    dances = list(dances)
    if len(dances) < 2 or len({len(learners) for _, learners in dances}) != 1:
        raise InputError(f"{len(dances)} dances: calibration needs two or more, each with the same number of learners")
    found = []
    for beta in tqdm(BETAS, "scores", unit="beta"):
        # Neither the match nor the posture depends on alpha and tau.
        trial = replace(config, alpha=greatest_alpha(), beta=beta, tau=max(TAUS))
        learners = [[_windows(teacher, learner, trial) for learner in learners] for teacher, learners in dances]
        still = [_windows(teacher, _standing(teacher), trial) for teacher, _ in dances]
        others = [_windows(dances[i][0], _on_the_beat(dances[i - 1][0], dances[i][0]), trial) for i in range(len(dances))]
        for tau in TAUS:
            timed = replace(trial, tau=tau)
            scores = np.array([[_similarity(windows, timed) for windows in one] for one in learners])
            ahead = scores[:, :-1] - scores[:, 1:]
            found.append(
                Candidate(
                    beta=beta,
                    tau=tau,
                    separation=float((ahead.mean(axis=0) / np.maximum(ahead.std(axis=0), 1e-9)).min()),
                    concordance=float(100 * (ahead > 0).all(axis=1).mean()),
                    still=float(np.quantile([_similarity(windows, timed) for windows in still], OFTEN)),
                    other=float(np.quantile([_similarity(windows, timed) for windows in others], OFTEN)),
                )
            )
    return found


def best_of(found: Sequence[Candidate]) -> Candidate:
    """The allowed candidate that orders most dances, and among equals tells learners apart best.

    Raises:
        InputError: none is allowed.
    """
    allowed = [candidate for candidate in found if candidate.allowed]
    if not allowed:
        raise InputError(f"no beta keeps standing still below {STILL:g} and another dance below {OTHER:g} on these dances")
    return max(allowed, key=lambda candidate: (candidate.concordance, candidate.separation))


def _windows(teacher: Performance, learner: Performance, config: ScorerConfig) -> np.ndarray:
    """(N, 2) delay and posture of the windows that were scored."""
    windows = score_dance(teacher, learner, config).windows
    found = np.stack([windows.delay_s, windows.posture], axis=1)
    return found[np.isfinite(found).all(axis=1)]


def _similarity(windows: np.ndarray, config: ScorerConfig) -> float:
    # Eq. (15); nobody seen is worse than anything seen
    return float(np.mean([timing_similarity(delay_s, config) * posture for delay_s, posture in windows])) if len(windows) else 0


def _standing(teacher: Performance) -> Performance:
    return Performance(np.repeat(teacher.joints_m[:1], len(teacher), axis=0), teacher.times_s)


def _on_the_beat(dance: Performance, teacher: Performance) -> Performance:
    """Another dance, begun with the teacher's."""
    return Performance(dance.joints_m, dance.times_s - dance.times_s[0] + teacher.times_s[0])


def read_dances(folder: str, checkpoint: str | None) -> list[TaughtDance]:
    """A K-Pop folder's dances, learners by their true joints or as a network sees them.

    Raises:
        InputError: no such folder, or a learner without true joints or depth.
    """
    dances = KpopSet(folder)
    network = None
    if checkpoint is not None:
        from kpopnet.networks.estimator import NetworkEstimator  # torch takes seconds to load

        network = NetworkEstimator(checkpoint)
    found = []
    for name in tqdm(dances.names, "dances", unit="dance"):
        dance = dances.dance(name)
        learners = []
        for learner in dance.learners:
            if network is not None:
                clip = learner.depth()
                joints_m, confidence = network.estimate(clip.depth_m, clip.camera)
                learners.append(Performance(joints_m, clip.times_s, confidence))
            elif (joints := learner.joints()) is not None:
                learners.append(joints)
            else:
                raise InputError(f"{learner.path}: no true joints in it; give --checkpoint=RUN/best to estimate them")
        found.append((dance.teacher(), learners))
    return found


@user_errors
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", help="training dances in the K-Pop format (docs/kpop_format.md)")
    parser.add_argument("--scorer", choices=SCORERS, default="dance22")
    parser.add_argument("--checkpoint", help="a network's folder, to calibrate on the joints that it finds")
    options = parser.parse_args(arguments)
    report(candidates(read_dances(options.folder, options.checkpoint), SCORERS[options.scorer]))


def report(found: Sequence[Candidate]) -> None:
    print("beta   tau  separation  in order  still  other dance")
    for one in found:
        line = f"{one.beta:4.2f}  {one.tau:4.2f}  {one.separation:10.2f}  {one.concordance:6.0f} %  {one.still:5.1f}"
        print(f"{line}  {one.other:11.1f}{'' if one.allowed else '  refused'}")
    best = best_of(found)
    print(f"alpha={greatest_alpha():g} beta={best.beta:g} tau={best.tau:g}")


if __name__ == "__main__":
    main()
