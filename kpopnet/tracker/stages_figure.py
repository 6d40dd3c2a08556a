"""A figure of every stage of tracking in one frame: for the README, and to find the cause of a wrong joint."""

import cv2
import numpy as np

from kpopnet.paper_tracker.frame import frame_of
from kpopnet.paper_tracker.hierarchy import ridge_candidates
from kpopnet.paper_tracker.tracker import PaperTracker
from kpopnet.ridge import ridge_stages
from kpopnet.tracker.tracker import Tracker
from kpopnet.viz.drawing import (
    BACKGROUND,
    ESTIMATED,
    depth_rgb,
    draw_skeleton,
    enlarged,
    person_view,
    probability_rgb,
    sheet,
    with_captions,
)

TILE_PX = 360
COLLECTED, VALID = (150, 150, 160), (90, 240, 130)


def draw_stages(paper_tracker: PaperTracker, tracker: Tracker, depth_m: np.ndarray) -> np.ndarray:
    """Tracks one frame with both trackers and draws its stages.

    The panels: depth edges, distance map, ridge data, candidates on the ridge before and after pruning, pose of Algorithm 2,
    fitted pose.

    Args:
        paper_tracker: the paper's tracker, started; it is advanced by this frame.
        tracker: the body tracker likewise.
        depth_m: (H, W) float32 metres of the person, 0 elsewhere.

    Returns:
        (H', W', 3) uint8 RGB.
    """
    camera, config = tracker.camera, paper_tracker.config
    stages = ridge_stages(depth_m, config.ridge)
    frame = frame_of(depth_m, stages.ridge, camera)
    collected, valid = ridge_candidates(frame, paper_tracker.state, paper_tracker.structure, config.for_kernels)
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
    poses = []
    for pose in (joints, fitted):
        image = enlarged(depth_rgb(view), TILE_PX)
        draw_skeleton(image, pose, view_camera, ESTIMATED)
        poses.append(image)
    return sheet(
        [
            (
                "Section 2.2",
                [
                    _tile(_mask_image(visible_edges), "depth edges"),
                    _tile(probability_rgb(distance / max(distance.max(), 1)), "distance map"),
                    _tile(_mask_image(stages.ridge[view_pixels] & person), "ridge data, Eq. 2"),
                ],
            ),
            (
                "Section 2.4",
                [
                    _tile(candidates_image, "on the ridge: pruned grey, valid green"),
                    _tile(poses[0], "pose of Algorithm 2, repaired"),
                    _tile(poses[1], "pose of the fitted body"),
                ],
            ),
        ]
    )


def _tile(image: np.ndarray, caption: str) -> np.ndarray:
    return with_captions(enlarged(image, TILE_PX), (caption,))


def _mask_image(mask: np.ndarray) -> np.ndarray:
    image = np.full((*mask.shape, 3), BACKGROUND, np.uint8)
    image[mask] = 235
    return image
