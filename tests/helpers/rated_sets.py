"""Small sets of dances without depth, and simulated raters of known agreement."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from dance_people import dance_joints_m, noisy, performed

from kpopnet.datasets.dances.ratings import Answer, all_pairs
from kpopnet.datasets.dances.writer import write_labels, write_learner, write_teacher
from kpopnet.evaluation.dances.raters import Votes

SKILLS_M = {"cyril": 0.02, "anna": 0.08, "boris": 0.2}
"""Learners, the best first, and the deviation of their joints from the teacher's."""


def write_set(folder: Path, dances: int = 2, labels: bool = False) -> Path:
    """A set of dances of 4 s by these learners; their joints alone are stored."""
    for index in range(dances):
        place, joints_m = folder / f"dance_{index}", dance_joints_m(index, seconds=4.0)
        write_teacher(place, performed(joints_m))
        for name, deviation_m in SKILLS_M.items():
            write_learner(place, name, np.arange(len(joints_m)) / 30, noisy(joints_m, deviation_m, index))
        if labels:
            write_labels(place, SKILLS_M)
    return folder


def answered(dances: dict[str, list[str]], rater: str, better=lambda pair: pair.left < pair.right) -> list[Answer]:
    """All answers of a rater; by default the learner whose name comes first dances better."""
    return [replace(pair, choice="left" if better(pair) else "right") for pair in all_pairs(dances, rater, 0)]


def simulated_votes(rng: np.random.Generator, dances: int, raters: int, noise: float, learners: int = 4) -> dict[str, Votes]:
    """Votes of raters who see the difference of two learners, whose qualities are normal, with normal noise.

    Noise is relative to the qualities' deviation; 0 is perfect agreement, infinite none.
    """
    quality = rng.normal(size=(dances, 1, learners, 1))
    error = np.triu(rng.normal(size=(dances, raters, learners, learners)), 1)
    seen = quality - quality.swapaxes(2, 3) if np.isfinite(noise) else 0
    seen = seen + min(noise, 1e9) * (error - error.swapaxes(2, 3))
    names = tuple("abcdefgh"[:learners]), tuple(map(str, range(raters)))
    return {str(dance): Votes(*names, signs) for dance, signs in enumerate(np.sign(seen))}
