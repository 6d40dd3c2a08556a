"""What would be gained if the estimator had seen one part of the body as it was: where the errors are that confuse learners."""

from dataclasses import replace

import numpy as np

from kpopnet.dance.features import Features
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import Comparison, TimeGrid
from kpopnet.dance.window import PARTS

ORACLES = {
    "arms": ("left arm", "right arm"), "legs": ("left leg", "right leg"), "torso": ("torso",), "turning": ("turning",),
}  # fmt: skip
"""Which of `PARTS` an oracle knows."""


def oracle_similarity(teacher: Performance, learner: Performance, truth: Performance, config: PartScorer) -> dict[str, float]:
    """The score of a learner whose angles of some parts are replaced by the true ones, which have no noise.

    Args:
        teacher: the reference dance.
        learner: the learner as an estimator sees them.
        truth: the learner's true joints, on the same clock.
        config: the scorer's settings, with the estimator's noise.

    Returns:
        Name of ORACLES to the similarity, 0 to 100.
    """
    grid = TimeGrid(teacher, config.feature)
    prepared = config.teacher(grid.teacher)
    seen, true = (grid.features(*grid.resampled(one.earlier(config.latency_s), grid.frames)) for one in (learner, truth))
    similarity = {}
    for name, parts in ORACLES.items():
        known = np.isin(prepared.parts, [PARTS.index(part) for part in parts])
        comparison = Comparison(grid, replace(prepared, variance=np.where(known, 0.0, prepared.variance)))
        comparison.add(Features(*(np.where(known, right, estimated) for right, estimated in zip(true, seen, strict=True))))
        comparison.keep_windows(len(grid.frames))
        similarity[name] = comparison.summary().similarity
    return similarity
