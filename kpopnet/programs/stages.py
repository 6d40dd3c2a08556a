"""Draws how the trackers follow one frame of a recording, stage after stage: the paper's, repaired, and the body tracker.

    kpopnet stages DEPTH.npy 60 stages.png                      frame 60 of a recording that begins in the Y pose
    kpopnet stages DEPTH.npy 60 stages.png --start y_pose       of one that is tracked from the Y pose only

DEPTH.npy holds (T, H, W) depth, uint16 millimetres or floating-point metres.
"""

from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from kpopnet.camera import CAMERAS, sequence_in_metres
from kpopnet.errors import InputError
from kpopnet.paper_tracker.algorithm2 import ridge_candidates
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig
from kpopnet.pose.extraction import extract_person
from kpopnet.programs.arguments import png, program_parser
from kpopnet.ridge import RidgeConfig, ridge_stages
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.input_files import ArraySchema, check_budget, open_npy
from kpopnet.tracker.start import AWAITED
from kpopnet.tracker.tracker import Tracker
from kpopnet.viz.drawing import (
    BACKGROUND,
    ESTIMATED,
    depth_rgb,
    enlarged,
    person_view,
    probability_rgb,
    save_png,
    scene_tile,
    sheet,
    with_captions,
)

TILE_PX = 360
COLLECTED, VALID = (150, 150, 160), (90, 240, 130)


def stages_of(path: Path, frame: int, camera_name: str, start: str = "auto") -> np.ndarray:
    """RGB image of every stage of a frame, tracked from the first frame of the recording on.

    Raises InputError if this is no recording of the camera, or no person is tracked before the frame.
    """
    try:
        recorded = open_npy(path, ArraySchema("uf", (None, None, None)))
    except InputError as error:
        raise InputError(f"{error}; give (T, H, W) depth that numpy.save wrote") from error
    camera = CAMERAS[camera_name]
    if not 0 < frame < len(recorded):
        raise InputError(f"{path}: frame {frame} of {len(recorded)}; frames count from 0, and one before it is needed")
    check_budget(path, 8 * (frame + 1) * recorded[0].size, f"depth and person of {frame + 1} frames")
    try:
        depth_m = sequence_in_metres(recorded[: frame + 1], camera)
    except InputError as error:
        raise InputError(f"{path}, read with --camera {camera_name}: {error}") from error
    person_m = extract_person(depth_m, camera)
    tracker = Tracker(camera, start)
    paper_tracker = PaperTracker(camera, PaperTrackerConfig(repaired=True))
    for depth_m in tqdm(person_m[:-1], "frames", disable=None):  # no bar in a log file
        joints_m, _ = tracker.track(depth_m)
        if paper_tracker.started:
            paper_tracker.track(depth_m)
        elif np.isfinite(joints_m).all():
            paper_tracker.start(joints_m)
    if not tracker.started:
        raise InputError(f"{path}: before frame {frame} no person {AWAITED[start]}")
    return draw_stages(paper_tracker, tracker, person_m[-1])


def draw_stages(paper_tracker: PaperTracker, tracker: Tracker, depth_m: np.ndarray) -> np.ndarray:
    """Tracks the person in an (H, W) depth image in metres with both started trackers, and draws the stages, RGB."""
    camera, stages = tracker.camera, ridge_stages(depth_m, RidgeConfig())
    collected, valid = ridge_candidates(paper_tracker.frame(depth_m), paper_tracker.state, paper_tracker.plan())
    (joints, _), (fitted, _) = paper_tracker.track(depth_m), tracker.track(depth_m)
    view, view_camera = person_view(depth_m, camera, (fitted,))
    x0, y0 = round(camera.cx - view_camera.cx), round(camera.cy - view_camera.cy)
    side = np.arange(len(view))
    view_pixels = np.ix_(np.clip(y0 + side, 0, camera.height - 1), np.clip(x0 + side, 0, camera.width - 1))

    person = view > 0
    visible_edges = cv2.dilate(person.astype(np.uint8), np.ones((3, 3))).astype(bool) & stages.edges[view_pixels]
    distance = np.where(np.isfinite(stages.distance_px[view_pixels]), stages.distance_px[view_pixels], 0) * person
    candidates_image = enlarged(depth_rgb(view), TILE_PX)
    scale = TILE_PX / len(view)
    for surface_points, colour in ((collected, COLLECTED), (valid, VALID)):
        uv = view_camera.project(surface_points)[:, :2] if len(surface_points) else np.empty((0, 2))
        for u, v in np.rint((uv + 0.5) * scale - 0.5).astype(int).tolist():
            cv2.circle(candidates_image, (u, v), 2, colour, -1, cv2.LINE_AA)
    poses = [scene_tile(view, view_camera, ((pose, ESTIMATED),), TILE_PX) for pose in (joints, fitted)]
    section_2_2 = [
        (_mask_image(visible_edges), "depth edges"),
        (probability_rgb(distance / max(distance.max(), 1)), "distance map"),
        (_mask_image(stages.ridge[view_pixels] & person), "ridge data, Eq. 2"),
    ]
    section_2_4 = [
        (candidates_image, "on the ridge: pruned grey, valid green"),
        (poses[0], "pose of Algorithm 2, repaired"),
        (poses[1], "pose of the fitted body"),
    ]
    rows = (("Section 2.2", section_2_2), ("Section 2.4", section_2_4))
    return sheet([(title, [with_captions(enlarged(image, TILE_PX), (text,)) for image, text in row]) for title, row in rows])


def _mask_image(mask: np.ndarray) -> np.ndarray:
    image = np.full((*mask.shape, 3), BACKGROUND, np.uint8)
    image[mask] = 235
    return image


@user_errors
def main() -> None:
    parser = program_parser("kpopnet stages", __doc__)
    parser.add_argument("depth", type=Path, help="(T, H, W) depth, a file of numpy.save")
    parser.add_argument("frame", type=int, help="number of the frame to draw, from 1 on")
    parser.add_argument("figure", type=png, help="the PNG to write")
    parser.add_argument("--camera", choices=sorted(CAMERAS), default="kinect_v1", help="the depth camera: %(default)s")
    parser.add_argument(
        "--start", choices=("auto", "y_pose", "standing"), default="auto", help="how the recording begins: %(default)s"
    )
    given = parser.parse_args()
    save_png(given.figure, stages_of(given.depth, given.frame, given.camera, given.start))
    print(f"stages of frame {given.frame}: {given.figure}")
