"""Writes sequences of `eval_sim` in slow motion, for trackers that lose fast motion.

    PYTHONPATH=. python tools/slow_motion.py data/slow_101 --seed 101 --sequences 5
    python evaluate.py benchmark=eval_sim benchmark.path=data/slow_101 'estimator=[paper_tracker,paper_tracker_repaired]'

The people, dances, rooms and cameras are those of `benchmark=eval_sim` with the same seed. Every motion takes four times as
long, and only its first 480 frames are filmed: 4 s of the dance with the Y pose. Noise is drawn anew for each frame.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from synth.motion.splice import resampled
from synth.simulated.film import Played, Take
from synth.simulated.stand_ins import EvalSim, EvalSimConfig

TIMES, FRAMES = 4, 480


@dataclass(frozen=True)
class SlowEvalSim(EvalSim):
    """Films the motions of simulated EVAL in slow motion, each at the place that it has at full speed."""

    times: int = TIMES  # how many times as long each motion takes
    filmed: int = FRAMES  # greatest number of frames of a sequence

    def take(self, index: int) -> Take:
        take = super().take(index)
        return replace(take, played=slowed(take.played, self.times, self.filmed))


def slowed(played: Played, times: int, filmed: int) -> Played:
    """The first frames of a motion on a body that takes `times` times as long: rotations and hips interpolated linearly."""
    position = np.arange(min(times * (len(played) - 1) + 1, filmed)) / times
    before = position.astype(int)
    after, fraction = np.minimum(before + 1, len(played) - 1), position - before

    def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        weight = fraction.reshape(-1, *(1,) * (a.ndim - 1))
        return (1 - weight) * a + weight * b

    a, b = played.local[before], played.local[after]
    local = between(a, np.where((a * b).sum(axis=-1, keepdims=True) < 0, -b, b))  # the shorter of both ways
    return replace(
        played,
        motion=resampled(played.motion, times * played.motion.fps),
        local=local / np.linalg.norm(local, axis=-1, keepdims=True),
        hips_m=between(played.hips_m[before], played.hips_m[after]),
        penetration_m=between(played.penetration_m[before], played.penetration_m[after]),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="for the sequences")
    parser.add_argument("--seed", type=int, default=101, help="of the set: %(default)s")
    parser.add_argument("--sequences", type=int, default=5, help="the set's first ones: %(default)s")
    parser.add_argument("--processes", type=int, default=1, help="working side by side: %(default)s")
    given = parser.parse_args()
    SlowEvalSim(EvalSimConfig(seed=given.seed, sequences=given.sequences)).write(given.folder, given.processes)


if __name__ == "__main__":
    main()
