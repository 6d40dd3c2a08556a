"""Draws how one frame of a recording is tracked, stage after stage.

python -m kpopnet.tracker DEPTH.npy 60 stages.png                      frame 60 of a dance that begins in the Y pose
python -m kpopnet.tracker DEPTH.npy 60 stages.png --start standing     of somebody who stands upright at first

DEPTH.npy holds (T, H, W) depth, uint16 millimetres or floating-point metres, of a camera that stands still.
"""

import argparse
from pathlib import Path

import numpy as np
from tqdm import tqdm

from kpopnet.camera import CAMERAS, sequence_in_metres
from kpopnet.drawing import save_png
from kpopnet.entry import user_errors
from kpopnet.errors import InputError
from kpopnet.extraction import extract_person
from kpopnet.tracker.picture import draw_stages
from kpopnet.tracker.tracking import Tracker


def stages_of(path: Path, frame: int, camera_name: str, standing: bool) -> np.ndarray:
    """RGB: every stage of a frame, tracked from the recording's beginning.

    Raises:
        InputError: not a recording of this camera, no such frame, or nobody followed until then.
    """
    try:
        recorded = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise InputError(f"{path}: expected an array that numpy.save wrote ({error})") from error
    if not isinstance(recorded, np.ndarray) or recorded.ndim != 3:
        raise InputError(f"{path}: expected one array of depth, (T, H, W)")
    camera = CAMERAS[camera_name]
    if not 0 < frame < len(recorded):
        raise InputError(f"{path}: frame {frame} of {len(recorded)}; frames count from 0, and one before it is needed")
    person_m = extract_person(sequence_in_metres(recorded[: frame + 1], camera), camera)
    tracker = Tracker(camera, standing=standing)
    for depth_m in tqdm(person_m[:-1], "frames", disable=None):  # no bar where nobody watches
        tracker.track(depth_m)
    if not tracker.started:
        start = "stood upright facing the camera" if standing else "was seen in the Y pose; try --start standing"
        raise InputError(f"{path}: until frame {frame} nobody {start}")
    return draw_stages(tracker, person_m[-1])


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(
        "python -m kpopnet.tracker", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("depth", type=Path, help="a file of numpy.save")
    parser.add_argument("frame", type=int, help="which one to draw, from 1 on")
    parser.add_argument("picture", type=Path, help="the PNG to write")
    parser.add_argument("--camera", choices=sorted(CAMERAS), default="kinect_v1", help="which camera it was: %(default)s")
    parser.add_argument("--start", choices=("y_pose", "standing"), default="y_pose", help="how the dance begins: %(default)s")
    given = parser.parse_args()
    save_png(given.picture, stages_of(given.depth, given.frame, given.camera, given.start == "standing"))
    print(f"stages of frame {given.frame}: {given.picture}")


if __name__ == "__main__":
    main()
