"""The pictures of a report: bars by joint and by sequence, the error curve, a sweep, and example frames."""

import numpy as np
from matplotlib.figure import Figure

from kpopnet.benchmarks.evaluation import Run
from kpopnet.benchmarks.metrics import CURVE_END_M, THRESHOLDS_M, joint_errors_m, share_within
from kpopnet.benchmarks.published import published_on
from kpopnet.benchmarks.sequences import Sequence
from kpopnet.benchmarks.sweep import Sweep
from kpopnet.camera import Camera
from kpopnet.drawing import ESTIMATED, TRUE, person_tile, sheet
from kpopnet.skeleton import JOINT_NAMES

EXAMPLES_PER_ROW = 4
SURROUNDINGS_M = 0.35


def joint_bars(run: Run) -> Figure:
    """Figs. 8 and 9: mean error and share within 10 cm, joint by joint and of all together, of every estimator.

    Where papers report figures on a real benchmark, they are lines across, since they are those of all joints.
    """
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    width = 0.8 / len(run.metrics)
    for panel, (key, unit, title) in zip(
        panels,
        (("mean_error_cm", 1, "mean error in cm"), ("map_10cm", 100, "within 10 cm, %")),
        strict=True,
    ):
        for place, (name, metrics) in enumerate(run.metrics.items()):
            values = [*(metrics["per_joint"][joint][key] for joint in JOINT_NAMES), metrics[key]]
            heights = [np.nan if value is None else unit * value for value in values]
            x = np.arange(len(values)) + width * (place - (len(run.metrics) - 1) / 2)
            panel.bar(x, heights, width, label=name)
        panel.set_ylabel(title)
        panel.grid(axis="y", alpha=0.3)
    for k, one in enumerate(published_on(run.benchmark)):
        for panel, value in ((panels[0], one.pose_error_cm), (panels[1], one.map_10cm and 100 * one.map_10cm)):
            if value is not None:
                label = f"published, all joints: {one.method}, {value:.2f}"
                panel.axhline(value, color="black", linewidth=1, linestyle=("--", ":", "-.")[k % 3], label=label)
    for panel in panels:
        panel.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize=8)
    panels[0].set_title(f"{run.benchmark.name} ({run.benchmark.origin.value}), against {run.benchmark.truth}")
    labels = [*(name.replace("_", "\n") for name in JOINT_NAMES), "ALL"]
    panels[1].set_xticks(range(len(labels)), labels, fontsize=8)
    return figure


def sequence_bars(run: Run, names: list[str]) -> Figure:
    """Fig. 10: the average pose error (Eq. 16) of each of the named sequences, and its standard deviation as bars.

    The constant mean pose, which would only squeeze the others, is left out where there are any.
    """
    shown = {name: metrics for name, metrics in run.metrics.items() if name != "mean_pose"} or run.metrics
    figure = Figure(figsize=(max(7, 0.45 * len(names) + 2), 4.5), layout="constrained")
    panel = figure.subplots()
    for place, (name, metrics) in enumerate(shown.items()):
        x = np.arange(len(names)) + 0.7 / len(shown) * (place - (len(shown) - 1) / 2)
        parts = [metrics["per_sequence"][sequence] for sequence in names]
        means, deviations = (
            np.array([np.nan if part[key] is None else part[key] for part in parts])
            for key in ("average_pose_error_cm", "pose_error_deviation_cm")
        )
        downwards = np.minimum(means, deviations)  # no error is below nothing
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
    """Table 1 drawn: share within 10 cm and frames per second over the columns' setting, a line for each row."""
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
    figure.suptitle(f"{sweep.estimator} on {run.benchmark.name} ({run.benchmark.origin.value}), two settings varied")
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
    """(H, W) of a scene's depth what lies within SURROUNDINGS_M of the box around (15, 3) joints, 0 elsewhere.

    All of it where no joint is known.
    """
    if not np.isfinite(joints_camera_m).any():
        return depth_m
    low, high = np.nanmin(joints_camera_m, axis=0) - SURROUNDINGS_M, np.nanmax(joints_camera_m, axis=0) + SURROUNDINGS_M
    points = camera.points(depth_m)
    return np.where(((points > low) & (points < high)).all(axis=-1), depth_m, 0)


def frame_tile(run: Run, sequence: Sequence, row: int) -> np.ndarray:
    """RGB of the frame in a row of the run's arrays, with the true skeleton and the main estimator's over the depth."""
    scored, frame = next(iter(run.scored.values())), run.frame[row]
    errors_m = joint_errors_m(scored.truth_m[[row]], scored.estimate_m[[row]])[0]
    found, missing = np.isfinite(errors_m), int(np.isinf(errors_m).sum())
    error = "no truth" if np.isnan(errors_m).all() else "no joints"
    if found.any():
        error = f"{100 * errors_m[found].mean():.1f} cm"
    depth_m = sequence.depth_m[frame]
    return person_tile(
        depth_m if sequence.alone else surroundings(depth_m, sequence.camera, scored.truth_m[row]),
        sequence.camera,
        ((scored.estimate_m[row], ESTIMATED), (scored.truth_m[row], TRUE)),
        captions=(f"{sequence.name} frame {frame}", error + (f", {missing} missing" if missing else "")),
    )


def examples_sheet(run: Run, seed: int) -> np.ndarray:
    """Fig. 11, RGB: frames with the true skeleton and the main estimator's over the depth, read again from the set."""
    main, scored = next(iter(run.scored.items()))
    examples = example_frames(run, seed)
    tiles: dict[int, np.ndarray] = {}
    sequence = None
    for row in sorted({frame for frames in examples.values() for frame in frames}):  # each sequence is read once
        name = scored.sequence_names[scored.sequence[row]]
        if sequence is None or sequence.name != name:
            sequence = run.benchmark.read(name)
        tiles[row] = frame_tile(run, sequence, row)
    rows = [(f"{kind} frames", [tiles[frame] for frame in frames]) for kind, frames in examples.items()]
    title = f"{main} on {run.benchmark.name} ({run.benchmark.origin.value} depth), true = {run.benchmark.truth}"
    return sheet(rows, (TRUE, ESTIMATED), title)
