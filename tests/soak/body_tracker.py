"""Follows a person with the body tracker over 100,000 frames: memory must stay flat.

    python -m tests.soak.body_tracker --frames 100000

A person of round cones lowers and lifts the arms and turns, played forwards and backwards for ever, seen by a SwissRanger-sized
camera. Every tenth of the frames a line shows the resident memory. Exit code 1 if it
grows by more than 5 MB from the first tenth to the last.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.tracker.tracker import Tracker
from tests.soak.__main__ import resident_mb

sys.path.append(str(Path(__file__).parents[1] / "helpers"))  # where the tests' own modules lie
from cone_people import cone_body, cone_joints, draw_cones

CAMERA = CAMERAS["smmc10"]
POSES, MAX_GROWTH_MB = 20, 5.0


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("python -m tests.soak.body_tracker", description=__doc__, formatter_class=form)
    parser.add_argument("--frames", type=int, default=100_000, help="number of frames: %(default)s")
    frames = parser.parse_args().frames

    joints_m = [cone_joints(30 - 5 * pose, yaw_deg=2 * pose) for pose in range(POSES)]
    body = cone_body(joints_m[0])
    depth_m = [draw_cones(pose, body, CAMERA) for pose in joints_m]
    tracker = Tracker(CAMERA)
    tracker.start(joints_m[0])
    memory_mb, missing = [], 0
    for frame in range(frames):
        pose = abs((frame + POSES - 1) % (2 * POSES - 2) - (POSES - 1))
        found_m, _ = tracker.track(depth_m[pose])
        missing += bool(np.isnan(found_m).any())
        if (frame + 1) % max(frames // 10, 1) == 0:
            memory_mb.append(resident_mb())
            error_cm = 100 * np.linalg.norm(found_m - joints_m[pose], axis=1).mean()
            print(
                f"{frame + 1:7} frames: {memory_mb[-1]:.1f} MB, {missing} without a person, off by {error_cm:.1f} cm",
                flush=True,
            )
    sys.exit(missing > 0 or memory_mb[-1] > memory_mb[0] + MAX_GROWTH_MB)


if __name__ == "__main__":
    main()
