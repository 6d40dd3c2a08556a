"""A picture of every stage of tracking for one frame: for the README, and to see why a joint went wrong."""

import cv2
import numpy as np

from kpopnet.drawing import (
    BACKGROUND,
    ESTIMATED,
    depth_picture,
    draw_skeleton,
    enlarged,
    person_view,
    probability_picture,
    sheet,
    with_captions,
)
from kpopnet.ridge import ridge_stages
from kpopnet.tracker.cells import cells_of
from kpopnet.tracker.hierarchy import valid_candidates
from kpopnet.tracker.tracking import Tracker

TILE_PX = 360
COLLECTED, VALID = (150, 150, 160), (90, 240, 130)


def draw_stages(tracker: Tracker, depth_m: np.ndarray) -> np.ndarray:
    """Tracks one frame and draws how: depth, edges, distance map, ridge data, candidates kept and pruned, pose.

    Args:
        tracker: has been started; it goes on by this frame.
        depth_m: (H, W) float32 metres of the person alone.

    Returns:
        (H', W', 3) uint8 RGB.
    """
    camera, config = tracker.camera, tracker.config
    stages = ridge_stages(depth_m, config.ridge)
    cells = cells_of(depth_m, camera)
    collected, valid, joints = valid_candidates(
        stages.ridge, cells, tracker.joints_camera_m, tracker.velocity_m, tracker.body, tracker.lengths, config.hierarchy
    )
    followed, _ = tracker.track(depth_m)
    view, view_camera = person_view(depth_m, camera, (followed,))
    x0, y0 = round(camera.cx - view_camera.cx), round(camera.cy - view_camera.cy)
    side = np.arange(len(view))
    grid = np.ix_(np.clip(y0 + side, 0, camera.height - 1), np.clip(x0 + side, 0, camera.width - 1))

    def tile(picture: np.ndarray, caption: str) -> np.ndarray:
        return with_captions(enlarged(picture, TILE_PX), (caption,))

    def marked(mask: np.ndarray) -> np.ndarray:
        picture = np.full((*mask.shape, 3), BACKGROUND, np.uint8)
        picture[mask] = 235
        return picture

    person = view > 0
    outline = cv2.dilate(person.astype(np.uint8), np.ones((3, 3))).astype(bool) & stages.edges[grid]
    distance = np.where(np.isfinite(stages.distance_px[grid]), stages.distance_px[grid], 0) * person
    points = enlarged(depth_picture(view), TILE_PX)
    scale = TILE_PX / len(view)
    for chosen, colour in ((collected, COLLECTED), (valid, VALID)):
        uv = view_camera.project(chosen)[:, :2] if len(chosen) else np.empty((0, 2))
        for u, v in np.rint((uv + 0.5) * scale - 0.5).astype(int).tolist():
            cv2.circle(points, (u, v), 2, colour, -1, cv2.LINE_AA)
    poses = []
    for pose in (joints, followed):
        picture = enlarged(depth_picture(view), TILE_PX)
        draw_skeleton(picture, pose, view_camera, ESTIMATED)
        poses.append(picture)
    return sheet(
        [
            (
                "Section 2.2",
                [
                    tile(marked(outline), "depth edges"),
                    tile(probability_picture(distance / max(distance.max(), 1)), "distance map"),
                    tile(marked(stages.ridge[grid] & person), "ridge data, Eq. 2"),
                ],
            ),
            (
                "Section 2.4",
                [
                    tile(points, "candidates: pruned grey, valid green"),
                    tile(poses[0], "pose of Algorithm 2"),
                    tile(poses[1], "pose of the fitted body"),
                ],
            ),
        ]
    )
