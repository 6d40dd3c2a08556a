"""From two recordings of joints to a dance score, in a program of your own; `kpopnet score` also writes a page.

    python examples/recordings_to_score.py teacher.npz learner.npz

Each file is an .npz, .bvh, .glb or another that docs/joint_files.md describes. `kpopnet predict` writes them from depth.
"""

import argparse
from pathlib import Path

from kpopnet.dance.feedback import feedback
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.dance.performance import from_absolute_clocks
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.errors import InputError


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("teacher", type=Path)
    parser.add_argument("learner", type=Path)
    parser.add_argument("--fps", type=float, help="frames per second of files that state none or a wrong one")
    given = parser.parse_args()

    teacher, learner = from_absolute_clocks([read_performance(path, given.fps) for path in (given.teacher, given.learner)])
    score = score_dance(teacher, learner, SCORERS["dance22"])
    print(f"similarity {score.similarity:.0f}, timing {score.timing:.0f}, posture {score.posture:.0f} of 100")
    print("parts: " + ", ".join(f"{name} {value:.0f}" for name, value in score.parts.items()))
    told = feedback(score)
    for line in (*told.hints, *(fault.text for fault in told.faults[:5])):
        print(line)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:  # what was wrong, where, and what to do
        raise SystemExit(f"error: {error}") from None
