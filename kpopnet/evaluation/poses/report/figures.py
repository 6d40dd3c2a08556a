"""Figures of the pose report: bars by joint and by sequence, the error curve, the sweep, and example frames."""

import numpy as np
from matplotlib.figure import Figure

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import Sequence
from kpopnet.evaluation.poses.metrics import CURVE_END_M, THRESHOLDS_M, fraction_within, joint_errors_m
from kpopnet.evaluation.poses.report.published import published_on
from kpopnet.evaluation.poses.run import Run
from kpopnet.evaluation.poses.sweep import Sweep
from kpopnet.skeleton import JOINT_NAMES
from kpopnet.viz.drawing import ESTIMATED, TRUE, person_tile, sheet

EXAMPLES_PER_ROW = 4
CROP_MARGIN_M = 0.35


def joint_bars(run: Run) -> Figure:
    """Figs. 8 and 9: mean error and percentage within 10 cm of each joint, of all, and of the paper's fourteen, by estimator.

    Published results on a real benchmark are horizontal lines, since they are over all fourteen joints.
    """
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    width = 0.8 / len(run.metrics)
    for panel, (key, unit, title) in zip(
        panels,
        (("mean_error_cm", 1, "mean error in cm"), ("map_10cm", 100, "within 10 cm, %")),
        strict=True,
    ):
        for position, (name, metrics) in enumerate(run.metrics.items()):
            values = [*(metrics["per_joint"][joint][key] for joint in JOINT_NAMES), metrics[key], metrics["paper_joints"][key]]
            heights = [np.nan if value is None else unit * value for value in values]
            x = np.arange(len(values)) + width * (position - (len(run.metrics) - 1) / 2)
            panel.bar(x, heights, width, label=name)
        panel.set_ylabel(title)
        panel.grid(axis="y", alpha=0.3)
    for k, one in enumerate(published_on(run.benchmark)):
        for panel, value in ((panels[0], one.pose_error_cm), (panels[1], one.map_10cm and 100 * one.map_10cm)):
            if value is not None:
                label = f"published, fourteen joints: {one.method}, {value:.2f}"
                panel.axhline(value, color="black", linewidth=1, linestyle=("--", ":", "-.")[k % 3], label=label)
    for panel in panels:
        panel.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize=8)
    panels[0].set_title(f"{run.benchmark.name} ({run.benchmark.origin.value}), against {run.benchmark.truth}")
    labels = [*(name.replace("_", "\n") for name in JOINT_NAMES), "ALL", "PAPER'S\n14"]
    panels[1].set_xticks(range(len(labels)), labels, fontsize=8)
    return figure


def sequence_bars(run: Run, names: list[str]) -> Figure:
    """Fig. 10: the average pose error (Eq. 16) of each named sequence, with its standard deviation as error bars.

    The mean pose baseline is left out if there are other estimators: its large error would compress their scale.
    """
    shown = {name: metrics for name, metrics in run.metrics.items() if name != "mean_pose"} or run.metrics
    figure = Figure(figsize=(max(7, 0.45 * len(names) + 2), 4.5), layout="constrained")
    panel = figure.subplots()
    for position, (name, metrics) in enumerate(shown.items()):
        x = np.arange(len(names)) + 0.7 / len(shown) * (position - (len(shown) - 1) / 2)
        parts = [metrics["per_sequence"][sequence] for sequence in names]
        means, deviations = (
            np.array([np.nan if part[key] is None else part[key] for part in parts])
            for key in ("average_pose_error_cm", "pose_error_deviation_cm")
        )
        downwards = np.minimum(means, deviations)  # an error is not negative
        panel.errorbar(x, means, (downwards, deviations), fmt="o", markersize=4, linewidth=1.2, capsize=2, label=name)
    for k, one in enumerate(published_on(run.benchmark)):
        if one.pose_error_cm is not None:
            label = f"published, all sequences: {one.method}, {one.pose_error_cm:.2f}"
            panel.axhline(one.pose_error_cm, color="black", linewidth=1, linestyle=("--", ":", "-.")[k % 3], label=label)
    panel.set_xticks(range(len(names)), names, rotation=60, ha="right", fontsize=8)
    panel.set(ylabel="error of visible joints in cm (Eq. 16)", xlim=(-0.6, len(names) - 0.4))
    panel.set_ylim(bottom=0)
    panel.grid(axis="y", alpha=0.3)
    panel.legend(fontsize=8)
    panel.set_title(f"{run.benchmark.name} ({run.benchmark.origin.value}): mean and standard deviation by sequence")
    return figure


def sweep_plot(run: Run, sweep: Sweep) -> Figure:
    """Table 1 as a plot: fraction within 10 cm and frames per second over the column setting, one line per row."""
    figure = Figure(figsize=(11, 4), layout="constrained")
    panels = figure.subplots(1, 2)
    columns, rows = sweep.config.columns, sweep.config.rows
    x = range(len(columns.values))
    for panel, (key, title) in zip(panels, (("map_10cm", "within 10 cm (mAP)"), ("fps", "frames per second")), strict=True):
        for value, names in zip(rows.values, sweep.names, strict=True):
            panel.plot(x, [run.metrics[name][key] for name in names], marker="o", label=f"{rows.setting}={value}")
        panel.set_xticks(x, [str(value) for value in columns.values])
        panel.set(xlabel=columns.setting, ylabel=title)
        panel.grid(alpha=0.3)
    panels[1].set_ylim(bottom=0)
    panels[1].legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize=8)
    figure.suptitle(f"{sweep.estimator} on {run.benchmark.name} ({run.benchmark.origin.value}), sweep of two settings")
    return figure


def error_curve(run: Run) -> Figure:
    """The percentage of joints within a distance of the true position, over the distance."""
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    panel = figure.subplots()
    distances_m = np.linspace(0, CURVE_END_M, 101)
    for name, results in run.results.items():
        errors_m = results.errors_m()
        percentages = [100 * fraction_within(errors_m, distance) for distance in distances_m]
        panel.plot(
            100 * distances_m, percentages, label=f"{name}, area {100 * (run.metrics[name]['pck_area_20cm'] or 0):.1f} %"
        )
    for threshold in THRESHOLDS_M:
        panel.axvline(100 * threshold, color="grey", linewidth=0.5, linestyle=":")
    panel.set(
        xlabel="distance from the true position, cm",
        ylabel="joints within the distance, %",
        xlim=(0, 100 * CURVE_END_M),
        ylim=(0, 100),
    )
    panel.set_title(f"{run.benchmark.name} ({run.benchmark.origin.value}), against {run.benchmark.truth}")
    panel.legend(loc="upper left")
    return figure


def example_frames(run: Run, seed: int) -> dict[str, list[int]]:
    """Example frames of the main estimator, ordered by mean joint error: best, median, worst and random.

    They come from different sequences if there are enough. Frames are ordered by the number of missing joints first, so a
    frame with missing joints is worse than any frame without.
    """
    results = next(iter(run.results.values()))
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

    return {
        "best": first_of_each_sequence(order),
        "median": first_of_each_sequence(from_middle),
        "worst": first_of_each_sequence(order[::-1]),
        "random": first_of_each_sequence(shuffled),
    }


def crop_around_joints(depth_m: np.ndarray, camera: Camera, joints_camera_m: np.ndarray) -> np.ndarray:
    """(H, W) depth of a scene within CROP_MARGIN_M of the 3D bounding box of (15, 3) joints, and 0 elsewhere.

    The whole depth image is returned where no joint is known.
    """
    if not np.isfinite(joints_camera_m).any():
        return depth_m
    low, high = np.nanmin(joints_camera_m, axis=0) - CROP_MARGIN_M, np.nanmax(joints_camera_m, axis=0) + CROP_MARGIN_M
    points = camera.points(depth_m)
    return np.where(((points > low) & (points < high)).all(axis=-1), depth_m, 0)


def frame_tile(run: Run, sequence: Sequence, row: int) -> np.ndarray:
    """RGB image of one frame: depth, true skeleton, and skeleton of the main estimator.

    Args:
        run: the evaluation.
        sequence: the sequence that holds the frame.
        row: index of the frame in the arrays of `run`.
    """
    results, frame = next(iter(run.results.values())), run.frame[row]
    errors_m = joint_errors_m(results.truth_m[[row]], results.estimate_m[[row]])[0]
    found, missing = np.isfinite(errors_m), int(np.isinf(errors_m).sum())
    error = "no label" if np.isnan(errors_m).all() else "no joints"
    if results.given[row]:
        error = "label was given"
    elif found.any():
        error = f"{100 * errors_m[found].mean():.1f} cm"
    depth_m = sequence.depth_m[frame]
    return person_tile(
        depth_m if sequence.is_segmented else crop_around_joints(depth_m, sequence.camera, results.truth_m[row]),
        sequence.camera,
        ((results.estimate_m[row], ESTIMATED), (results.truth_m[row], TRUE)),
        captions=(f"{sequence.name} frame {frame}", error + (f", {missing} missing" if missing else "")),
    )


def examples_sheet(run: Run, seed: int) -> np.ndarray:
    """Fig. 11 as an RGB image: example frames with true and estimated skeletons over the depth, read again from the set."""
    main, results = next(iter(run.results.items()))
    examples = example_frames(run, seed)
    tiles: dict[int, np.ndarray] = {}
    sequence = None
    for row in sorted({frame for frames in examples.values() for frame in frames}):  # each sequence is read once
        name = results.sequence_names[results.sequence[row]]
        if sequence is None or sequence.name != name:
            sequence = run.benchmark.read(name)
        tiles[row] = frame_tile(run, sequence, row)
    rows = [(f"{kind} frames", [tiles[frame] for frame in frames]) for kind, frames in examples.items()]
    title = f"{main} on {run.benchmark.name} ({run.benchmark.origin.value} depth), true = {run.benchmark.truth}"
    return sheet(rows, (TRUE, ESTIMATED), title)
