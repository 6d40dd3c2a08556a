"""Draws how the trackers follow one frame of a recording, stage after stage: the paper's, repaired, and the body tracker.

    kpopnet stages DEPTH.npy 60 stages.png                      frame 60 of a recording that begins in the Y pose
    kpopnet stages DEPTH.npy 60 stages.png --start y_pose       of one that is tracked from the Y pose only

DEPTH.npy holds (T, H, W) depth, uint16 millimetres or floating-point metres, of a camera that does not move.
"""

from pathlib import Path

import numpy as np
from tqdm import tqdm

from kpopnet.camera import CAMERAS, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.extraction import extract_person
from kpopnet.paper_tracker.config import ALL_REPAIRS, PaperTrackerConfig
from kpopnet.paper_tracker.tracker import PaperTracker
from kpopnet.programs.arguments import program_parser
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.input_files import ArraySchema, check_budget, open_npy
from kpopnet.tracker.stages_figure import draw_stages
from kpopnet.tracker.start.finding import AWAITED
from kpopnet.tracker.tracker import Tracker, TrackerConfig
from kpopnet.viz.drawing import save_png


def stages_of(path: Path, frame: int, camera_name: str, start: str = "auto") -> np.ndarray:
    """RGB image of every stage of a frame, tracked from the first frame of the recording on.

    Raises:
        InputError: not a recording of this camera, no such frame, or no person tracked before it.
    """
    try:
        recorded = open_npy(path, ArraySchema("uf", (None, None, None)))
    except InputError as error:
        raise InputError(f"{path}: expected (T, H, W) depth that numpy.save wrote ({error})") from error
    camera = CAMERAS[camera_name]
    if not 0 < frame < len(recorded):
        raise InputError(f"{path}: frame {frame} of {len(recorded)}; frames count from 0, and one before it is needed")
    check_budget(path, 8 * (frame + 1) * recorded[0].size, f"depth and person of {frame + 1} frames")
    person_m = extract_person(sequence_in_metres(recorded[: frame + 1], camera), camera)
    tracker = Tracker(camera, TrackerConfig(start=start))
    paper_tracker = PaperTracker(camera, PaperTrackerConfig(repairs=ALL_REPAIRS))
    for depth_m in tqdm(person_m[:-1], "frames", disable=None):  # no bar in a log file
        joints_m, _ = tracker.track(depth_m)
        if paper_tracker.started:
            paper_tracker.track(depth_m)
        elif np.isfinite(joints_m).all():
            paper_tracker.start(joints_m)
    if not tracker.started:
        raise InputError(f"{path}: before frame {frame} no person {AWAITED[start]}")
    return draw_stages(paper_tracker, tracker, person_m[-1])


@user_errors
def main() -> None:
    parser = program_parser("kpopnet stages", __doc__)
    parser.add_argument("depth", type=Path, help="(T, H, W) depth, a file of numpy.save")
    parser.add_argument("frame", type=int, help="number of the frame to draw, from 1 on")
    parser.add_argument("figure", type=Path, help="the PNG to write")
    parser.add_argument("--camera", choices=sorted(CAMERAS), default="kinect_v1", help="the depth camera: %(default)s")
    parser.add_argument(
        "--start", choices=("auto", "y_pose", "standing"), default="auto", help="how the recording begins: %(default)s"
    )
    given = parser.parse_args()
    save_png(given.figure, stages_of(given.depth, given.frame, given.camera, given.start))
    print(f"stages of frame {given.frame}: {given.figure}")


if __name__ == "__main__":
    main()
