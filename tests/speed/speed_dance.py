"""How fast a dance is scored: all at once, frame by frame, and its matching beside a library's."""

import math
import time

import numpy as np
from dance_people import FPS, dance_joints_m, noisy, performed
from dtaidistance import dtw_ndim

from kpopnet.dance.dtw import banded_distances, best_match
from kpopnet.dance.features import Features
from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.scoring import score_dance

SECONDS = 180.0
WINDOW, SURROUNDINGS = 60, 150
"""Frames of a learner's window, and of the teacher's dance around it."""


def measure() -> dict[str, tuple[float, str, str]]:
    """Processor time of one core over a dance of three minutes, 5,400 frames."""
    joints_m = dance_joints_m(0, SECONDS)
    learner_m = noisy(joints_m, 0.05)
    teacher, learner = performed(joints_m), performed(learner_m, 0.15)
    score_dance(performed(joints_m[:300]), performed(learner_m[:300]))  # compiles
    start = time.process_time()
    score = score_dance(teacher, learner)
    offline_s = time.process_time() - start

    scorer, updates_ms = OnlineScorer(teacher), []
    for joints, time_s in zip(learner.joints_m, learner.times_s, strict=True):
        start = time.process_time()
        scorer.update(joints, time_s)
        updates_ms.append(1000 * (time.process_time() - start))
    assert scorer.finish().similarity == score.similarity

    ours_s, library_s = _matching()
    return {
        "dance.offline_s": (offline_s, "s", f"a dance of {len(joints_m)} frames, {len(score.windows.start_s)} windows"),
        "dance.online_ms_p95": (
            float(np.percentile(updates_ms, 95)),
            "ms an update",
            f"95th percentile of {len(updates_ms)} frames at {FPS:g} fps; {np.median(updates_ms):.2f} in the median, "
            f"{max(updates_ms):.1f} at most",
        ),
        "dance.dtw_vs_library": (
            ours_s / library_s,
            "times",
            f"dtaidistance, compiled, of the same 22-D windows to the same end at the same cost: {1000 * library_s:.2f} ms",
        ),
    }


def _matching() -> tuple[float, float]:
    """Median seconds of matching a window anywhere in its surroundings with the paper's steps, by us and by a library."""
    rng = np.random.default_rng(0)
    ours_s, library_s = [], []
    for _ in range(200):
        around = np.cumsum(rng.normal(0, 0.02, (SURROUNDINGS, 22)), axis=0)
        window = around[50 : 50 + WINDOW] + rng.normal(0, 0.05, (WINDOW, 22))
        learner, teacher = (Features(angles, *np.ones((2, *angles.shape))) for angles in (window, around))

        start = time.process_time()
        distances = banded_distances(learner, teacher, 0, SURROUNDINGS, math.inf)
        path = best_match(distances, False, 0.0, SURROUNDINGS)
        ours_s.append(time.process_time() - start)

        start = time.process_time()
        _, costs = dtw_ndim.warping_paths_fast(
            window, around, inner_dist="euclidean", psi=(0, 0, SURROUNDINGS, SURROUNDINGS), psi_neg=False
        )
        end = int(np.argmin(costs[-1, 1:]))
        library_s.append(time.process_time() - start)

        assert path[-1].sum() - SURROUNDINGS == end
        assert math.isclose(distances[path[:, 0], path[:, 1]].sum(), costs[-1, end + 1], rel_tol=1e-9)
    return float(np.median(ours_s)), float(np.median(library_s))
