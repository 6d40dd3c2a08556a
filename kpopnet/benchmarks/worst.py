"""The main estimator's worst sequence, to look at: a contact sheet, and a video where the set is a film."""

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from kpopnet.benchmarks.evaluation import Run
from kpopnet.benchmarks.metrics import joint_errors_m
from kpopnet.benchmarks.pictures import frame_tile, surroundings
from kpopnet.camera import Camera
from kpopnet.drawing import ESTIMATED, TRUE, depth_picture, draw_skeleton, enlarged, legend, sheet, with_captions

SHEET_ROWS, SHEET_COLUMNS = 3, 5
VIDEO_HEIGHT_PX = 360
SLOWEST_FPS = 8.0
"""Of a video every second, third, ... frame is left out, as long as so many a second remain: it takes time to write."""


def worst_sequence(run: Run) -> str:
    """The sequence of which the main estimator has the smallest share of joints within 10 cm; of several the first."""
    shares = {name: part["map_10cm"] for name, part in next(iter(run.metrics.values()))["per_sequence"].items()}
    return min(shares, key=lambda name: 2.0 if shares[name] is None else shares[name])


def contact_sheet(run: Run, name: str) -> np.ndarray:
    """RGB: frames evenly spaced over a sequence, with the true skeleton and the main estimator's."""
    main, scored = next(iter(run.scored.items()))
    rows = np.flatnonzero(scored.sequence == scored.sequence_names.index(name))
    chosen = rows[np.unique(np.linspace(0, len(rows) - 1, SHEET_ROWS * SHEET_COLUMNS).round().astype(int))]
    sequence = run.benchmark.read(name)
    tiles = [frame_tile(run, sequence, row) for row in chosen]
    title = f"{main}, worst sequence: {name} of {run.benchmark.name} ({run.benchmark.origin.value} depth)"
    bands = [("", tiles[start : start + SHEET_COLUMNS]) for start in range(0, len(tiles), SHEET_COLUMNS)]
    return sheet(bands, (TRUE, ESTIMATED), title)


def film(run: Run, name: str) -> tuple[float, Iterable[np.ndarray]]:
    """Frames a second and pictures (RGB, all of one size) of a sequence with both skeletons over the depth.

    The pictures show where the person is in any of the frames, without the room, whose noise would be most of the work of
    writing a video. A set of stills is no film: 0 frames a second.
    """
    main, scored = next(iter(run.scored.items()))
    rows = np.flatnonzero(scored.sequence == scored.sequence_names.index(name))
    sequence = run.benchmark.read(name)
    truth_m, estimate_m = scored.truth_m[rows], scored.estimate_m[rows]
    errors_m = joint_errors_m(truth_m, estimate_m)
    within, labelled = (errors_m < 0.1).sum(axis=1), (~np.isnan(errors_m)).sum(axis=1)
    step = max(1, int(sequence.fps // SLOWEST_FPS))
    view, camera = _stage(sequence.camera, truth_m)

    def pictures() -> Iterable[np.ndarray]:
        width_px = round(VIDEO_HEIGHT_PX * camera.width / camera.height / 2) * 2
        for frame in range(0, len(rows), step):
            depth_m = sequence.depth_m[frame]
            shown_m = depth_m if sequence.alone else surroundings(depth_m, sequence.camera, truth_m[frame])
            picture = enlarged(depth_picture(shown_m[view]), width_px)
            draw_skeleton(picture, estimate_m[frame], camera, ESTIMATED)
            draw_skeleton(picture, truth_m[frame], camera, TRUE)
            picture = np.concatenate([picture, legend((TRUE,), width_px), legend((ESTIMATED,), width_px)])
            share = f"{within[frame]} of {labelled[frame]} joints within 10 cm"
            captions = f"{main} on {run.benchmark.origin.value} depth", f"{name} frame {frame}: {share}"
            picture = with_captions(picture, captions)
            yield picture[: len(picture) // 2 * 2]  # codecs want even numbers

    return sequence.fps / step, pictures()


def _stage(camera: Camera, joints_camera_m: np.ndarray) -> tuple[tuple[slice, slice], Camera]:
    """The part of the image that all of (T, 15, 3) joints are in, rows and columns, and its camera."""
    known = joints_camera_m[np.isfinite(joints_camera_m).all(axis=-1)]
    uv = camera.project(known)[:, :2]
    size = np.array([camera.width, camera.height])
    margin = 0.12 * size
    low = np.clip(uv.min(axis=0) - margin, 0, size - 16).astype(int)
    high = np.clip(uv.max(axis=0) + margin, low + 16, size).astype(int)
    (x0, y0), (width, height) = low.tolist(), (high - low).tolist()
    return (slice(y0, y0 + height), slice(x0, x0 + width)), camera.cropped(x0, y0, width, height)


def save_video(path: Path, pictures: Iterable[np.ndarray], fps: float) -> bool:
    """Writes RGB pictures of one size, of even width and height, as VP9 in MP4, which browsers play.

    Returns:
        Whether this OpenCV can write it and read it again; else nothing is left at the path.
    """
    writer, count = None, 0
    for picture in pictures:
        if writer is None:
            height, width = picture.shape[:2]
            writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*"vp09"), fps, (width, height))
            if not writer.isOpened():
                break
        writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        count += 1
    if writer is not None:
        writer.release()
    reader = cv2.VideoCapture(str(path))
    readable = count > 0 and reader.read()[0]
    reader.release()
    if not readable:
        path.unlink(missing_ok=True)
    return readable
