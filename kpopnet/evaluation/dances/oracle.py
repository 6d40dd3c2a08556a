"""What would be gained if the estimator had seen one part of the body as it was: where the errors are that confuse learners."""

import numpy as np

from kpopnet.dance.config import ScorerConfig
from kpopnet.dance.features import Features
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import Comparison, TimeGrid, features_of, summary
from kpopnet.dance.window import PARTS

ORACLES = {
    "arms": ("left arm", "right arm"), "legs": ("left leg", "right leg"), "torso": ("torso",), "turning": ("turning",),
}  # fmt: skip
"""Which of `PARTS` an oracle knows."""


def oracle_similarity(teacher: Performance, learner: Performance, truth: Performance, config: ScorerConfig) -> dict[str, float]:
    """The score of a learner whose angles of some parts are replaced by the true ones, which have no noise.

    Args:
        teacher: the reference dance.
        learner: the learner as an estimator sees them.
        truth: the learner's true joints, on the same clock.
        config: the scorer's settings, with the estimator's noise.

    Returns:
        Name of ORACLES to the similarity, 0 to 100.
    """
    grid = TimeGrid(teacher, config)
    seen, true = (
        features_of(*grid.resampled(one.earlier(config.latency_s), grid.teacher_frames), False, config)
        for one in (learner, truth)
    )
    similarity = {}
    for name, parts in ORACLES.items():
        known = np.isin(grid.teacher.parts, [PARTS.index(part) for part in parts])
        comparison = Comparison(grid.teacher._replace(variance=np.where(known, 0.0, grid.teacher.variance)), config)
        comparison.add(Features(*(np.where(known, right, estimated) for right, estimated in zip(true, seen, strict=True))))
        starts = grid.window_starts(len(grid.teacher_frames))
        windows = [comparison.window(start) for start in starts]
        similarity[name] = summary(windows, grid.time_s(starts), grid.teacher.movement, config).similarity
    return similarity
