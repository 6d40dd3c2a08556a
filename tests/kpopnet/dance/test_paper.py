"""The paper's scorer beside a slow twin of its equations."""

import math

import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, noisy

from kpopnet.dance.paper import PaperScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, TimeGrid, score_dance
from kpopnet.dance.window import BAND_FRAMES, WINDOW_FRAMES

JOINTS_M = dance_joints_m(0)[:180]
TIMES_S = np.arange(len(JOINTS_M)) / FPS
LEARNERS = {
    "noisy": (noisy(JOINTS_M, 0.05, 1), TIMES_S),
    "late": (JOINTS_M, TIMES_S + 0.2),
    "another dance": (dance_joints_m(1)[:180], TIMES_S),
    "slow": (JOINTS_M, TIMES_S * 1.1),
}


def windows_by_equations(scorer: PaperScorer, teacher: Performance, learner: Performance) -> np.ndarray:
    """(N, 2) S_t and S_p of each window, by the equations one frame at a time."""
    grid, windows = TimeGrid(teacher, scorer.feature), []
    goal, danced = grid.teacher, grid.features(*grid.resampled(learner, grid.frames))

    def norm(i: int, j: int) -> float:
        difference = np.angle(np.exp(1j * (danced.angles_rad[i] - goal.angles_rad[j])))
        known = np.isfinite(difference)
        if 2 * known.sum() < len(known):
            return math.nan
        weighted = (danced.weights[i] * goal.weights[j] * difference**2)[known].sum()
        return math.sqrt(weighted * len(known) / known.sum())

    for start in range(0, len(goal.angles_rad) - WINDOW_FRAMES + 1, WINDOW_FRAMES):
        costs, before = {}, {}
        for i in range(start, start + WINDOW_FRAMES):
            reach = range(max(i - BAND_FRAMES, 0), min(i + BAND_FRAMES + 1, len(goal.angles_rad)))
            norms = {j: norm(i, j) for j in reach}
            worst = math.sqrt(goal.angles_rad.shape[1]) * math.pi  # of a frame of which nothing is known
            instead = min((one for one in norms.values() if not math.isnan(one)), default=worst)
            for j in reach:
                steps = [(costs[at], at) for at in ((i - 1, j - 1), (i - 1, j), (i, j - 1)) if at in costs]
                steps += [(0.0, None)] if i == start else []
                if steps:
                    least, before[i, j] = min(steps, key=lambda one: one[0])
                    costs[i, j] = least + (instead if math.isnan(norms[j]) else norms[j])
        at, path = min((at for at in costs if at[0] == start + WINDOW_FRAMES - 1), key=lambda at: (costs[at], at[1])), []
        while at is not None:
            path.append(at)
            at = before[at]
        path.reverse()
        compared = [(i, j) for i, j in path if not math.isnan(norm(i, j))]
        delay_s = sum(i - j for i, j in (compared[0], compared[-1])) / 2 / FPS
        timing = 1 - min(1.0, math.exp((abs(delay_s) - scorer.tau) / (scorer.alpha * scorer.tau)))  # Eq. (13)
        similar: dict[int, list[float]] = {}
        for i, j in path:
            if not math.isnan(one := norm(i, j)):
                similar.setdefault(j, []).append(math.exp(-one / scorer.beta))
        windows.append((timing, np.mean([np.mean(one) for one in similar.values()])))  # Eq. (14)
    return np.array(windows)


@pytest.mark.parametrize("learner", LEARNERS)
@pytest.mark.parametrize("scorer", ["paper", "raptis"])
def test_scores_are_those_of_the_equations(scorer, learner):
    teacher, learner = Performance(JOINTS_M, TIMES_S), Performance(*LEARNERS[learner])
    score, expected = score_dance(teacher, learner, SCORERS[scorer]), windows_by_equations(SCORERS[scorer], teacher, learner)
    known = np.isfinite(score.windows.timing)
    assert known.sum() >= 2
    expected = expected[: len(known)][known]
    np.testing.assert_allclose(score.windows.timing[known], 100 * expected[:, 0], atol=1e-9)
    np.testing.assert_allclose(score.windows.posture[known], 100 * expected[:, 1], atol=1e-9)
    assert score.similarity == pytest.approx(100 * expected.prod(axis=1).mean())  # Eq. (15)


def test_algorithm_3_as_printed_grades_its_delay_by_the_same_alpha_and_tau():
    scorer = PaperScorer(as_printed=True)
    windows = score_dance(Performance(JOINTS_M, TIMES_S), Performance(*LEARNERS["slow"]), scorer).windows
    over = np.minimum((abs(windows.delay_s) - scorer.tau) / (scorer.alpha * scorer.tau), 0)
    np.testing.assert_allclose(windows.timing, 100 * (1 - np.exp(over)))
    assert (abs(windows.delay_s) > 0.01).any()
