"""How fast a dance is scored: all at once, and frame by frame."""

import numpy as np
from dance_people import FPS, dance_joints_m, noisy, performed

from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.scoring import score_dance
from tests.speed.common import Figures, timed

SECONDS = 180.0


def measure() -> Figures:
    """Processor time of one core over a dance of three minutes, 5,400 frames."""
    joints_m = dance_joints_m(0, SECONDS)
    learner_m = noisy(joints_m, 0.05)
    teacher, learner = performed(joints_m), performed(learner_m, 0.15)
    score_dance(performed(joints_m[:300]), performed(learner_m[:300]))  # compiles
    offline_ms, score = timed(score_dance, teacher, learner)

    scorer = OnlineScorer(teacher)
    updates_ms = [timed(scorer.update, *one)[0] for one in zip(learner.joints_m, learner.times_s, strict=True)]
    assert scorer.finish().similarity == score.similarity
    middle, late = np.percentile(updates_ms, (50, 95))
    against = f"95th percentile of {len(updates_ms)} frames at {FPS:g} fps; {middle:.2f} in the median"
    return {
        "dance.offline_s": (offline_ms / 1000, "s", f"a dance of {len(joints_m)} frames, {len(score.windows.start_s)} windows"),
        "dance.online_ms_p95": (late, "ms an update", against),
    }
