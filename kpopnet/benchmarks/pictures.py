"""The pictures of a report: bars by joint, the error curve, and example frames."""

import numpy as np
from matplotlib.figure import Figure

from kpopnet.benchmarks.evaluation import Run
from kpopnet.benchmarks.metrics import CURVE_END_M, THRESHOLDS_M, joint_errors_m, share_within
from kpopnet.camera import Camera
from kpopnet.drawing import ESTIMATED, TRUE, person_tile, sheet
from kpopnet.skeleton import JOINT_NAMES

EXAMPLES_PER_ROW = 4
SURROUNDINGS_M = 0.35


def joint_bars(run: Run) -> Figure:
    """Mean error and share within 10 cm, joint by joint, of every estimator."""
    figure = Figure(figsize=(10, 6.5), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    width = 0.8 / len(run.metrics)
    for panel, (key, unit, title) in zip(
        panels,
        (("mean_error_cm", 1, "mean error in cm"), ("map_10cm", 100, "within 10 cm, %")),
        strict=True,
    ):
        for place, (name, metrics) in enumerate(run.metrics.items()):
            values = [metrics["per_joint"][joint][key] for joint in JOINT_NAMES]
            heights = [np.nan if value is None else unit * value for value in values]
            x = np.arange(len(JOINT_NAMES)) + width * (place - (len(run.metrics) - 1) / 2)
            panel.bar(x, heights, width, label=name)
        panel.set_ylabel(title)
        panel.grid(axis="y", alpha=0.3)
    panels[0].legend()
    panels[0].set_title(f"{run.benchmark.name} ({run.benchmark.origin.value}), against {run.benchmark.truth}")
    panels[1].set_xticks(range(len(JOINT_NAMES)), [name.replace("_", "\n") for name in JOINT_NAMES], fontsize=8)
    return figure


def error_curve(run: Run) -> Figure:
    """The share of joints within a distance of their truth, over the distance."""
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    panel = figure.subplots()
    distances_m = np.linspace(0, CURVE_END_M, 101)
    for name, scored in run.scored.items():
        errors_m = joint_errors_m(scored.truth_m, scored.estimate_m)
        shares = [100 * share_within(errors_m, distance) for distance in distances_m]
        panel.plot(
            100 * distances_m, shares, label=f"{name}, area {100 * (run.metrics[name]['pck_area_20cm'] or 0):.1f} %"
        )
    for threshold in THRESHOLDS_M:
        panel.axvline(100 * threshold, color="grey", linewidth=0.5, linestyle=":")
    panel.set(xlabel="distance in cm", ylabel="joints closer than that, %", xlim=(0, 100 * CURVE_END_M), ylim=(0, 100))
    panel.set_title(f"{run.benchmark.name} ({run.benchmark.origin.value}), against {run.benchmark.truth}")
    panel.legend(loc="upper left")
    return figure


def example_frames(run: Run, seed: int) -> dict[str, list[int]]:
    """Frames of the main estimator by their mean joint error: best, median, worst and random, of different sequences as
    far as there are enough. A frame with missing joints is worse than any without, the more the worse.
    """
    scored = next(iter(run.scored.values()))
    errors_m = joint_errors_m(scored.truth_m, scored.estimate_m)
    found = np.isfinite(errors_m)
    mean_m = np.where(found, errors_m, 0).sum(axis=1) / np.maximum(found.sum(axis=1), 1)
    judged = np.flatnonzero(~np.isnan(errors_m).all(axis=1))
    order = judged[np.lexsort((mean_m[judged], np.isinf(errors_m[judged]).sum(axis=1)))]
    from_middle = order[np.argsort(np.abs(np.arange(len(order)) - (len(order) - 1) / 2), kind="stable")]
    shuffled = np.random.default_rng(seed).permutation(judged)

    def first_of_each_sequence(frames: np.ndarray) -> list[int]:
        _, first = np.unique(scored.sequence[frames], return_index=True)
        distinct = frames[np.sort(first)]
        others = frames[~np.isin(frames, distinct)]
        return np.concatenate([distinct, others])[:EXAMPLES_PER_ROW].tolist()

    return {
        "best": first_of_each_sequence(order),
        "median": first_of_each_sequence(from_middle),
        "worst": first_of_each_sequence(order[::-1]),
        "random": first_of_each_sequence(shuffled),
    }


def surroundings(depth_m: np.ndarray, camera: Camera, joints_camera_m: np.ndarray) -> np.ndarray:
    """(H, W) of a scene's depth what lies within SURROUNDINGS_M of the box around (15, 3) joints, 0 elsewhere."""
    low, high = np.nanmin(joints_camera_m, axis=0) - SURROUNDINGS_M, np.nanmax(joints_camera_m, axis=0) + SURROUNDINGS_M
    points = camera.points(depth_m)
    return np.where(((points > low) & (points < high)).all(axis=-1), depth_m, 0)


def examples_sheet(run: Run, seed: int) -> np.ndarray:
    """RGB: example frames with the true skeleton and the main estimator's over the depth, read again from the set."""
    main, scored = next(iter(run.scored.items()))
    errors_m = joint_errors_m(scored.truth_m, scored.estimate_m)
    examples = example_frames(run, seed)
    tiles: dict[int, np.ndarray] = {}
    sequence = None
    for row in sorted({frame for frames in examples.values() for frame in frames}):  # each sequence is read once
        name = scored.sequence_names[scored.sequence[row]]
        if sequence is None or sequence.name != name:
            sequence = run.benchmark.read(name)
        frame, found = run.frame[row], np.isfinite(errors_m[row])
        missing = int(np.isinf(errors_m[row]).sum())
        error = f"{100 * errors_m[row, found].mean():.1f} cm" if found.any() else "no joints"
        depth_m = sequence.depth_m[frame]
        tiles[row] = person_tile(
            depth_m if sequence.alone else surroundings(depth_m, sequence.camera, scored.truth_m[row]),
            sequence.camera,
            ((scored.estimate_m[row], ESTIMATED), (scored.truth_m[row], TRUE)),
            captions=(f"{name} frame {frame}", error + (f", {missing} missing" if missing else "")),
        )
    rows = [(f"{kind} frames", [tiles[frame] for frame in frames]) for kind, frames in examples.items()]
    title = f"{main} on {run.benchmark.name} ({run.benchmark.origin.value} depth), true = {run.benchmark.truth}"
    return sheet(rows, (TRUE, ESTIMATED), title)
