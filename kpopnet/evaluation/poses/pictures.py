"""Pictures of the pose report: example frames (Fig. 11), and the worst sequences as a video and as pages in 3D."""

from collections.abc import Iterable

import numpy as np

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import Sequence
from kpopnet.evaluation.poses.run import PoseRun
from kpopnet.viz.drawing import (
    ESTIMATED,
    TRUE,
    depth_rgb,
    draw_skeleton,
    enlarged,
    legend,
    person_tile,
    sheet,
    with_captions,
)
from kpopnet.viz.view_page import Shown, cloud_frames, sampled_cloud, view_page

EXAMPLES_PER_ROW = 4
CROP_MARGIN_M = 0.35
VIDEO_HEIGHT_PX = 360
VIEWS = 3
"""Number of sequences that are shown in 3D; they share the points that one page may hold."""

MIN_VIDEO_FPS = 8.0
"""A video is subsampled to every n-th frame, with the largest n that keeps this rate, to save writing time."""


def example_frames(run: PoseRun, seed: int) -> dict[str, list[int]]:
    """Example frames of the main estimator, ordered by mean joint error: best, median, worst and random.

    They come from different sequences if there are enough. Frames are ordered by the number of missing joints first, so a
    frame with missing joints is worse than any frame without.
    """
    results = run.results[run.main]
    errors_m = results.errors_m()
    found = np.isfinite(errors_m)
    mean_m = np.where(found, errors_m, 0).sum(axis=1) / np.maximum(found.sum(axis=1), 1)
    labelled = np.flatnonzero(~np.isnan(errors_m).all(axis=1))
    order = labelled[np.lexsort((mean_m[labelled], np.isinf(errors_m[labelled]).sum(axis=1)))]
    from_middle = order[np.argsort(np.abs(np.arange(len(order)) - (len(order) - 1) / 2), kind="stable")]
    shuffled = np.random.default_rng(seed).permutation(labelled)

    def first_of_each_sequence(frames: np.ndarray) -> list[int]:
        _, first = np.unique(results.sequence[frames], return_index=True)
        distinct = frames[np.sort(first)]
        others = frames[~np.isin(frames, distinct)]
        return np.concatenate([distinct, others])[:EXAMPLES_PER_ROW].tolist()

    kinds = {"best": order, "median": from_middle, "worst": order[::-1], "random": shuffled}
    return {kind: first_of_each_sequence(frames) for kind, frames in kinds.items()}


def examples_sheet(run: PoseRun, seed: int) -> np.ndarray:
    """Fig. 11 as an RGB image: example frames with true and estimated skeletons over the depth, read again from the set."""
    results, examples = run.results[run.main], example_frames(run, seed)
    tiles: dict[int, np.ndarray] = {}
    sequence = None
    for row in sorted({frame for frames in examples.values() for frame in frames}):  # each sequence is read once
        number = results.sequence[row]
        if sequence is None or sequence.name != results.sequence_names[number]:
            sequence = run.benchmark.read(results.sequence_names[number])
        tiles[row] = _tile(run, sequence, row, row - int(np.argmax(results.sequence == number)))
    rows = [(f"{kind} frames", [tiles[frame] for frame in frames]) for kind, frames in examples.items()]
    title = f"{run.main} on {run.benchmark.name} ({run.benchmark.origin.value} depth), true = {run.benchmark.truth}"
    return sheet(rows, (TRUE, ESTIMATED), title)


def _tile(run: PoseRun, sequence: Sequence, row: int, frame: int) -> np.ndarray:
    """RGB image of a frame of a sequence, row `row` of the results: depth, true skeleton, and that of the main estimator."""
    results = run.results[run.main]
    errors_m = results.errors_m()[row]
    found, missing = np.isfinite(errors_m), int(np.isinf(errors_m).sum())
    error = "no label" if np.isnan(errors_m).all() else "no joints"
    if results.given[row]:
        error = "label was given"
    elif found.any():
        error = f"{100 * errors_m[found].mean():.1f} cm"
    return person_tile(
        _person_depth_m(sequence, frame),
        sequence.camera,
        ((results.estimate_m[row], ESTIMATED), (results.truth_m[row], TRUE)),
        captions=(f"{sequence.name} frame {frame}", error + (f", {missing} missing" if missing else "")),
    )


def _person_depth_m(sequence: Sequence, frame: int) -> np.ndarray:
    """(H, W) depth of a frame; of a whole scene only what is within CROP_MARGIN_M of the 3D bounding box of the true joints."""
    depth_m, joints_m = sequence.depth_m[frame], sequence.joints_camera_m[frame]
    if sequence.is_segmented or not np.isfinite(joints_m).any():
        return depth_m
    low, high = np.nanmin(joints_m, axis=0) - CROP_MARGIN_M, np.nanmax(joints_m, axis=0) + CROP_MARGIN_M
    points = sequence.camera.points(depth_m)
    return np.where(((points > low) & (points < high)).all(axis=-1), depth_m, 0)


def worst_sequences(run: PoseRun) -> list[str]:
    """The sequences by the fraction of joints within 10 cm by the main estimator, the worst first; ties in the set's order."""
    fractions = {name: part["map_10cm"] for name, part in run.metrics[run.main]["per_sequence"].items()}
    return sorted(fractions, key=lambda name: 2.0 if fractions[name] is None else fractions[name])


def render_video(run: PoseRun, name: str) -> tuple[float, Iterable[np.ndarray]]:
    """Renders a sequence with true and estimated skeletons over the depth.

    The images show the region that holds the person in any frame, without the room: its noise would take most of the
    encoding time.

    Returns:
        Frames per second, 0 where the frames are independent stills; and the RGB images, all of one size.
    """
    results, sequence = run.results[run.main].of_sequence(name), run.benchmark.read(name)
    errors_m = results.errors_m()
    within, labelled = (errors_m < 0.1).sum(axis=1), (~np.isnan(errors_m)).sum(axis=1)
    step = max(1, int(sequence.fps // MIN_VIDEO_FPS))
    view, camera = _region_of_joints(sequence.camera, results.truth_m)

    def images() -> Iterable[np.ndarray]:
        width_px = round(VIDEO_HEIGHT_PX * camera.width / camera.height / 2) * 2
        for frame in range(0, len(errors_m), step):
            image = enlarged(depth_rgb(_person_depth_m(sequence, frame)[view]), width_px)
            draw_skeleton(image, results.estimate_m[frame], camera, ESTIMATED)
            draw_skeleton(image, results.truth_m[frame], camera, TRUE)
            image = np.concatenate([image, legend((TRUE,), width_px), legend((ESTIMATED,), width_px)])
            counted = f"{within[frame]} of {labelled[frame]} joints within 10 cm"
            caption = f"{name} frame {frame}: {'label was given' if results.given[frame] else counted}"
            image = with_captions(image, (f"{run.main} on {run.benchmark.origin.value} depth", caption))
            yield image[: len(image) // 2 * 2]  # video codecs need an even height

    return sequence.fps / step, images()


def view_in_3d(run: PoseRun, name: str) -> str:
    """A page that shows a sequence in 3D: the estimated joints in colours, the true ones thin, over the depth as points."""
    results, sequence = run.results[run.main].of_sequence(name), run.benchmark.read(name)
    truth_m, shown = results.truth_m, cloud_frames(len(results.truth_m))
    clouds = [
        sampled_cloud(frame, sequence.depth_m[frame], sequence.camera, [truth_m[frame]], VIEWS * len(shown)) for frame in shown
    ]
    people = [
        Shown(results.estimate_m, np.nan_to_num(results.confidence), run.main),
        Shown(truth_m, np.ones(truth_m.shape[:2]), "true joints", reference=True),
    ]
    times_s = np.arange(len(truth_m)) / (sequence.fps or 1.0)
    return view_page(f"{name}: {run.main} on {run.benchmark.origin.value} depth", sequence.camera, times_s, people, clouds)


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
