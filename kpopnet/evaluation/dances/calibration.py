"""Chooses alpha, beta and tau of our scorer, which the paper does not give, on training dances.

    python -m synth benchmark=kpop_sim benchmark.split=train benchmark.dances=20 out=data/kpop_train
    python -m kpopnet.evaluation.dances.calibration data/kpop_train                                 # on true joints
    python -m kpopnet.evaluation.dances.calibration data/kpop_train --checkpoint outputs/train/RUN/best    # on estimates

The dances of an evaluation must not be used for calibration. The parameters are chosen as follows:

- A perfect copy scores at least `MIN_COPY_SIMILARITY`: 1 - exp(-1 / alpha) of Eq. (13) for delay 0. The largest such alpha is
  taken, since a larger alpha separates small delays better.
- Another dance scores less than `MAX_OTHER_DANCE_SCORE`, and standing still in the teacher's first pose less than
  `MAX_STANDING_SCORE`, in at least the fraction `QUANTILE` of the dances. This is an upper bound of beta.
- Of the remaining values, those with the most dances in the right order are taken. Ties are resolved by the separation of
  neighbouring learners: the mean difference of their scores over its standard deviation, in the pair with the smallest value.
  Separation alone would choose the smallest tau. With it, the windows of the worst learners score 0, and their order is
  random.
"""

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import OURS, score_dance
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.errors import InputError
from kpopnet.runtime.hydra_app import user_errors

MIN_COPY_SIMILARITY = 0.96
MAX_OTHER_DANCE_SCORE = 30.0
MAX_STANDING_SCORE = 20.0
QUANTILE = 0.95

BETAS = (0.5, 0.7, 0.9, 1.1, 1.4, 1.8, 2.4)
TAUS = (0.3, 0.4, 0.5, 0.6, 0.75, 0.9)

RankedDance = tuple[Performance, Sequence[Performance]]
"""The teacher, and the learners in the experts' order, the best first."""


class Candidate(NamedTuple):
    """Results of one choice of beta and tau on the training dances.

    Attributes:
        beta: radians.
        tau: seconds.
        separation: mean score difference of neighbouring learners in standard deviations, in the pair with the smallest value.
        concordance: percentage of the dances in strict order.
        standing_score: QUANTILE over the dances of the score of standing still.
        other_dance_score: QUANTILE over the dances of the score of another dance.
    """

    beta: float
    tau: float
    separation: float
    concordance: float
    standing_score: float
    other_dance_score: float

    @property
    def allowed(self) -> bool:
        """Whether standing still and another dance score low enough."""
        return self.standing_score < MAX_STANDING_SCORE and self.other_dance_score < MAX_OTHER_DANCE_SCORE


def largest_alpha() -> float:
    """The largest alpha with which a perfect copy scores MIN_COPY_SIMILARITY (Eq. 13), rounded down to two decimals."""
    return np.floor(-100 / np.log(1 - MIN_COPY_SIMILARITY)) / 100


def candidates(dances: Iterable[RankedDance], config: PartScorer) -> list[Candidate]:
    """Evaluates all combinations of `BETAS` and `TAUS`, with the largest alpha and the other settings of `config`.

    Raises:
        InputError: there are fewer than two dances, or their numbers of learners differ.
    """
    dances = list(dances)
    if len(dances) < 2 or len({len(learners) for _, learners in dances}) != 1:
        raise InputError(f"{len(dances)} dances: calibration needs two or more, each with the same number of learners")
    found = []
    for beta in tqdm(BETAS, "scores", unit="beta"):
        # Neither the alignment nor the posture score depends on alpha and tau.
        trial = replace(config, alpha=largest_alpha(), beta=beta, tau=max(TAUS))
        learners = [[_windows(teacher, learner, trial) for learner in learners] for teacher, learners in dances]
        standing = [_windows(teacher, _standing(teacher), trial) for teacher, _ in dances]
        others = [_windows(dances[i][0], _shifted_to_start(dances[i - 1][0], dances[i][0]), trial) for i in range(len(dances))]
        for tau in TAUS:
            timed = replace(trial, tau=tau)
            scores = np.array([[_similarity(windows, timed) for windows in one] for one in learners])
            margin = scores[:, :-1] - scores[:, 1:]
            found.append(
                Candidate(
                    beta=beta,
                    tau=tau,
                    separation=float((margin.mean(axis=0) / np.maximum(margin.std(axis=0), 1e-9)).min()),
                    concordance=float(100 * (margin > 0).all(axis=1).mean()),
                    standing_score=float(np.quantile([_similarity(windows, timed) for windows in standing], QUANTILE)),
                    other_dance_score=float(np.quantile([_similarity(windows, timed) for windows in others], QUANTILE)),
                )
            )
    return found


def select_candidate(found: Sequence[Candidate]) -> Candidate:
    """The allowed candidate with the highest concordance; ties are resolved by separation.

    Raises:
        InputError: no candidate is allowed.
    """
    allowed = [candidate for candidate in found if candidate.allowed]
    if not allowed:
        raise InputError(
            f"no beta keeps the score of standing still below {MAX_STANDING_SCORE:g} and of another dance below "
            f"{MAX_OTHER_DANCE_SCORE:g} on these dances"
        )
    return max(allowed, key=lambda candidate: (candidate.concordance, candidate.separation))


def _windows(teacher: Performance, learner: Performance, config: PartScorer) -> np.ndarray:
    """(N, 3) delay in seconds, posture score and weight of the windows that were scored."""
    windows = score_dance(teacher, learner, config, unobserved_is_nan=True).windows
    found = np.stack([windows.delay_s, windows.posture, windows.weight], axis=1)
    return found[np.isfinite(found).all(axis=1)]


def _similarity(windows: np.ndarray, config: PartScorer) -> float:
    # Eq. (15); 0 if no window was scored
    if not windows[:, 2].any():
        return 0.0
    products = [config.timing(delay_s) * posture for delay_s, posture, _ in windows]
    return float(np.average(products, weights=windows[:, 2]))


def _standing(teacher: Performance) -> Performance:
    """A learner who stands still in the first pose of the teacher."""
    return Performance(np.repeat(teacher.joints_m[:1], len(teacher), axis=0), teacher.times_s)


def _shifted_to_start(dance: Performance, teacher: Performance) -> Performance:
    """Another dance, shifted in time to start with the teacher."""
    return Performance(dance.joints_m, dance.times_s - dance.times_s[0] + teacher.times_s[0])


def read_dances(folder: str, checkpoint: str | None) -> list[RankedDance]:
    """Reads the dances of a folder in the K-Pop format.

    Args:
        folder: of the dances.
        checkpoint: folder of a network that estimates the joints of the learners; None for true joints.

    Raises:
        InputError: the folder does not exist, or a learner has no true joints or depth.
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
    parser.add_argument("--checkpoint", help="folder of a network, to calibrate on joints that it estimates")
    options = parser.parse_args(arguments)
    report(candidates(read_dances(options.folder, options.checkpoint), OURS))


def report(found: Sequence[Candidate]) -> None:
    """Prints all candidates and the selected parameters."""
    print("beta   tau  separation  in order  standing  other dance")
    for one in found:
        line = f"{one.beta:4.2f}  {one.tau:4.2f}  {one.separation:10.2f}  {one.concordance:6.0f} %  {one.standing_score:8.1f}"
        print(f"{line}  {one.other_dance_score:11.1f}{'' if one.allowed else '  not allowed'}")
    best = select_candidate(found)
    print(f"alpha={largest_alpha():g} beta={best.beta:g} tau={best.tau:g}")


if __name__ == "__main__":
    main()
