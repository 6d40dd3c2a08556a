"""The worst sequences of the main estimator: contact sheet and, where the frames are a film, a video; views in 3D."""

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.evaluation.poses.metrics import joint_errors_m
from kpopnet.evaluation.poses.report.figures import crop_around_joints, frame_tile
from kpopnet.evaluation.poses.run import Run
from kpopnet.viz.drawing import ESTIMATED, TRUE, depth_rgb, draw_skeleton, enlarged, legend, sheet, with_captions
from kpopnet.viz.view_page import Shown, cloud_frames, sampled_cloud, view_page

SHEET_ROWS, SHEET_COLUMNS = 3, 5
VIDEO_HEIGHT_PX = 360
VIEWS = 3
"""Number of sequences that are shown in 3D; they share the points that one page may hold."""

MIN_VIDEO_FPS = 8.0
"""A video is subsampled to every n-th frame, with the largest n that keeps this rate, to save writing time."""


def worst_sequences(run: Run) -> list[str]:
    """The sequences by the fraction of joints within 10 cm by the main estimator, the worst first; ties in the set's order."""
    fractions = {name: part["map_10cm"] for name, part in next(iter(run.metrics.values()))["per_sequence"].items()}
    return sorted(fractions, key=lambda name: 2.0 if fractions[name] is None else fractions[name])


def contact_sheet(run: Run, name: str) -> np.ndarray:
    """RGB image: frames evenly spaced over a sequence, with the true skeleton and that of the main estimator."""
    main, results = next(iter(run.results.items()))
    rows = np.flatnonzero(results.sequence == results.sequence_names.index(name))
    chosen = rows[np.unique(np.linspace(0, len(rows) - 1, SHEET_ROWS * SHEET_COLUMNS).round().astype(int))]
    sequence = run.benchmark.read(name)
    tiles = [frame_tile(run, sequence, row) for row in chosen]
    title = f"{main}, worst sequence: {name} of {run.benchmark.name} ({run.benchmark.origin.value} depth)"
    bands = [("", tiles[start : start + SHEET_COLUMNS]) for start in range(0, len(tiles), SHEET_COLUMNS)]
    return sheet(bands, (TRUE, ESTIMATED), title)


def render_video(run: Run, name: str) -> tuple[float, Iterable[np.ndarray]]:
    """Renders a sequence with true and estimated skeletons over the depth.

    The images show the region that holds the person in any frame, without the room: its noise would take most of the
    encoding time.

    Returns:
        Frames per second, 0 where the frames are independent stills; and the RGB images, all of one size.
    """
    main, results = next(iter(run.results.items()))
    rows = np.flatnonzero(results.sequence == results.sequence_names.index(name))
    sequence = run.benchmark.read(name)
    truth_m, estimate_m, given = results.truth_m[rows], results.estimate_m[rows], results.given[rows]
    errors_m = joint_errors_m(truth_m, estimate_m)
    within, labelled = (errors_m < 0.1).sum(axis=1), (~np.isnan(errors_m)).sum(axis=1)
    step = max(1, int(sequence.fps // MIN_VIDEO_FPS))
    view, camera = _region_of_joints(sequence.camera, truth_m)

    def images() -> Iterable[np.ndarray]:
        width_px = round(VIDEO_HEIGHT_PX * camera.width / camera.height / 2) * 2
        for frame in range(0, len(rows), step):
            depth_m = sequence.depth_m[frame]
            shown_m = depth_m if sequence.is_segmented else crop_around_joints(depth_m, sequence.camera, truth_m[frame])
            image = enlarged(depth_rgb(shown_m[view]), width_px)
            draw_skeleton(image, estimate_m[frame], camera, ESTIMATED)
            draw_skeleton(image, truth_m[frame], camera, TRUE)
            image = np.concatenate([image, legend((TRUE,), width_px), legend((ESTIMATED,), width_px)])
            counted = f"{within[frame]} of {labelled[frame]} joints within 10 cm"
            caption = "label was given" if given[frame] else counted
            captions = f"{main} on {run.benchmark.origin.value} depth", f"{name} frame {frame}: {caption}"
            image = with_captions(image, captions)
            yield image[: len(image) // 2 * 2]  # video codecs need an even height

    return sequence.fps / step, images()


def view_in_3d(run: Run, name: str) -> str:
    """A page that shows a sequence in 3D: the estimated joints in colours, the true ones thin, over the depth as points."""
    main, results = next(iter(run.results.items()))
    rows = np.flatnonzero(results.sequence == results.sequence_names.index(name))
    sequence = run.benchmark.read(name)
    truth_m, estimate_m = results.truth_m[rows], results.estimate_m[rows]
    times_s = np.arange(len(rows)) / (sequence.fps or 1.0)
    shown = cloud_frames(len(rows))
    clouds = [
        sampled_cloud(frame, sequence.depth_m[frame], sequence.camera, [truth_m[frame]], VIEWS * len(shown)) for frame in shown
    ]
    confidence = np.nan_to_num(results.confidence[rows])
    people = [Shown(estimate_m, confidence, main), Shown(truth_m, np.ones(truth_m.shape[:2]), "true joints", reference=True)]
    return view_page(f"{name}: {main} on {run.benchmark.origin.value} depth", sequence.camera, times_s, people, clouds)


def _region_of_joints(camera: Camera, joints_camera_m: np.ndarray) -> tuple[tuple[slice, slice], Camera]:
    """The image region that holds all of (T, 15, 3) joints, as row and column slices, and the camera of it."""
    known = joints_camera_m[np.isfinite(joints_camera_m).all(axis=-1)]
    uv = camera.project(known)[:, :2]
    size = np.array([camera.width, camera.height])
    margin = 0.12 * size
    low = np.clip(uv.min(axis=0) - margin, 0, size - 16).astype(int)
    high = np.clip(uv.max(axis=0) + margin, low + 16, size).astype(int)
    (x0, y0), (width, height) = low.tolist(), (high - low).tolist()
    return (slice(y0, y0 + height), slice(x0, x0 + width)), camera.cropped(x0, y0, width, height)


def save_video(path: Path, images: Iterable[np.ndarray], fps: float) -> bool:
    """Writes RGB images of one size, with even width and height, as VP9 in MP4, which browsers can play.

    Returns:
        Whether this build of OpenCV could write the video and read it again. Otherwise no file is left at the path.
    """
    writer, count = None, 0
    for image in images:
        if writer is None:
            height, width = image.shape[:2]
            writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*"vp09"), fps, (width, height))
            if not writer.isOpened():
                break
        writer.write(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        count += 1
    if writer is not None:
        writer.release()
    reader = cv2.VideoCapture(str(path))
    readable = count > 0 and reader.read()[0]
    reader.release()
    if not readable:
        path.unlink(missing_ok=True)
    return readable
