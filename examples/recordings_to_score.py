"""From two recordings of joints to a dance score.

    python examples/recordings_to_score.py teacher.npz learner.npz

Each file holds joints_m (T, 15, 3) in metres, in the order of kpopnet.skeleton.Joint, and times_s (T,) on the clock of the
music, or fps instead of times_s; confidence (T, 15) is optional. `examples/camera_to_joints.py` writes such joints.
"""

import argparse
from pathlib import Path

import numpy as np

from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, score_dance


def read(path: Path, fps: float) -> Performance:
    with np.load(path, allow_pickle=False) as file:
        joints_m = file["joints_m"]
        times_s = file["times_s"] if "times_s" in file else np.arange(len(joints_m)) / fps
        return Performance(joints_m, times_s, file.get("confidence"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("teacher", type=Path)
    parser.add_argument("learner", type=Path)
    parser.add_argument("--fps", type=float, default=30.0, help="frames per second of files without times: %(default)s")
    given = parser.parse_args()

    score = score_dance(read(given.teacher, given.fps), read(given.learner, given.fps), SCORERS["dance22"])
    print(f"similarity {score.similarity:.0f}, timing {score.timing:.0f}, posture {score.posture:.0f} of 100")
    print("parts: " + ", ".join(f"{name} {value:.0f}" for name, value in score.parts.items()))
    worst = int(np.nanargmin(score.windows.similarity))
    start_s, delay_s = score.windows.start_s[worst], score.windows.delay_s[worst]
    print(f"worst from {start_s:.1f} s: similarity {score.windows.similarity[worst]:.0f}, delay {1000 * delay_s:+.0f} ms")


if __name__ == "__main__":
    main()
