"""Pictures of the pose report: example frames (Fig. 11), and the worst sequences in 3D."""

from pathlib import Path

import numpy as np

from kpopnet.datasets.protocol import Sequence
from kpopnet.evaluation.poses.run import PoseRun
from kpopnet.evaluation.report import Picture, save_view
from kpopnet.viz.drawing import ESTIMATED, TRUE, person_tile, sheet
from kpopnet.viz.view_page import Shown

EXAMPLES_PER_ROW = 4
CROP_MARGIN_M = 0.35


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
        name = str(results.sequence[row])
        if sequence is None or sequence.name != name:
            sequence = run.benchmark.read(name)
        tiles[row] = _tile(run, sequence, row, row - int(np.argmax(results.sequence == name)))
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


def save_views(run: PoseRun, names: list[str], folder: Path) -> list[Picture]:
    """Writes a page for each sequence, which shows it in 3D."""
    views = [Picture(f"worst_{number}.html", name) for number, name in enumerate(names, 1)]
    for file, name in views:
        results, sequence = run.results[run.main], run.benchmark.read(name)
        results = results.select_frames(results.sequence == name)
        people = [
            Shown(results.estimate_m, np.nan_to_num(results.confidence), run.main),
            Shown(results.truth_m, np.ones(results.truth_m.shape[:2]), "true joints", reference=True),
        ]
        title = f"{name}: {run.main} on {run.benchmark.origin.value} depth"
        save_view(folder / file, title, sequence.camera, sequence.fps, sequence.depth_m, people, len(names))
    return views
