"""Figures of the pose report: bars by joint and by sequence, the error curve, the confidence, and example frames (Fig. 11)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kpopnet.datasets.protocol import Sequence
from kpopnet.evaluation.poses.confidence import judged, reliability, risk_curve_m
from kpopnet.evaluation.poses.metrics import CURVE_END_M, THRESHOLDS_M, fraction_within
from kpopnet.evaluation.poses.run import PoseRun
from kpopnet.evaluation.poses.tables import published_on
from kpopnet.skeleton import JOINT_NAMES
from kpopnet.viz.drawing import ESTIMATED, TRUE, person_tile, sheet

CURVE_POINTS = 200
EXAMPLES_PER_ROW = 4
CROP_MARGIN_M = 0.35


def joint_bars(run: PoseRun) -> Figure:
    """Figs. 8 and 9: mean error and percentage within 10 cm of each joint, of all, and of the paper's fourteen, by estimator.

    Published results on a real benchmark are horizontal lines, since they are over all fourteen joints.
    """
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    error, within = figure.subplots(2, 1, sharex=True)
    width = 0.8 / len(run.metrics)
    for panel, key, unit in ((error, "mean_error_cm", 1), (within, "map_10cm", 100)):
        for position, (name, metrics) in enumerate(run.metrics.items()):
            parts = [*metrics["per_joint"].values(), metrics, metrics["paper_joints"]]
            heights = unit * np.array([part[key] for part in parts], float)  # NaN for None
            x = np.arange(len(heights)) + width * (position - (len(run.metrics) - 1) / 2)
            panel.bar(x, heights, width, label=name)
    published = published_on(run.benchmark)
    _published_lines(error, "fourteen joints", {one.method: one.pose_error_cm for one in published})
    _published_lines(within, "fourteen joints", {one.method: one.map_10cm and 100 * one.map_10cm for one in published})
    for panel, title in ((error, "mean error in cm"), (within, "within 10 cm, %")):
        panel.set_ylabel(title)
        panel.grid(axis="y", alpha=0.3)
        panel.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize=8)
    error.set_title(_title(run))
    labels = [*(name.replace("_", "\n") for name in JOINT_NAMES), "ALL", "PAPER'S\n14"]
    within.set_xticks(range(len(labels)), labels, fontsize=8)
    return figure


def _title(run: PoseRun) -> str:
    return f"{run.benchmark.name} ({run.benchmark.origin.value}), against {run.benchmark.truth}"


def _published_lines(panel: Axes, what: str, values: dict[str, float | None]) -> None:
    """A horizontal line for each published value, by the method's name, where there is one."""
    for k, (method, value) in enumerate(values.items()):
        if value is not None:
            style = {"color": "black", "linewidth": 1, "linestyle": ("--", ":", "-.")[k % 3]}
            panel.axhline(value, label=f"published, {what}: {method}, {value:.2f}", **style)


def sequence_bars(run: PoseRun, names: list[str]) -> Figure:
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
            np.array([part[key] for part in parts], float) for key in ("average_pose_error_cm", "pose_error_deviation_cm")
        )
        downwards = np.minimum(means, deviations)  # an error is not negative
        panel.errorbar(x, means, (downwards, deviations), fmt="o", markersize=4, linewidth=1.2, capsize=2, label=name)
    _published_lines(panel, "all sequences", {one.method: one.pose_error_cm for one in published_on(run.benchmark)})
    panel.set_xticks(range(len(names)), names, rotation=60, ha="right", fontsize=8)
    panel.set(ylabel="error of visible joints in cm (Eq. 16)", xlim=(-0.6, len(names) - 0.4))
    panel.set_ylim(bottom=0)
    panel.grid(axis="y", alpha=0.3)
    panel.legend(fontsize=8)
    panel.set_title(f"{run.benchmark.name} ({run.benchmark.origin.value}): mean and standard deviation by sequence")
    return figure


def error_curve(run: PoseRun) -> Figure:
    """The percentage of joints within a distance of the true position, over the distance."""
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    panel = figure.subplots()
    distances_m = np.linspace(0, CURVE_END_M, 101)
    for name, results in run.results.items():
        errors_m, area = results.errors_m(), 100 * (run.metrics[name]["pck_area_20cm"] or 0)
        percentages = [100 * fraction_within(errors_m, distance) for distance in distances_m]
        panel.plot(100 * distances_m, percentages, label=f"{name}, area {area:.1f} %")
    for threshold in THRESHOLDS_M:
        panel.axvline(100 * threshold, color="grey", linewidth=0.5, linestyle=":")
    panel.set(xlabel="distance from the true position, cm", xlim=(0, 100 * CURVE_END_M))
    panel.set(ylabel="joints within the distance, %", ylim=(0, 100))
    panel.set_title(_title(run))
    panel.legend(loc="upper left")
    return figure


def confidence_figure(run: PoseRun) -> Figure:
    """The reliability diagram and the risk-coverage curve of every estimator (`kpopnet.evaluation.poses.confidence`)."""
    figure = Figure(figsize=(11, 4.8), layout="constrained")
    reliable, risk = figure.subplots(1, 2)
    reliable.plot((0, 1), (0, 1), color="grey", linewidth=0.8, linestyle=":")
    for name, one in run.results.items():
        joints = judged(one)
        if not len(joints.error_m):
            continue
        count, mean, within = reliability(joints)
        # Not clipped: most joints are sure and right, at the corner of the panel.
        (line,) = reliable.plot(mean[count > 0], within[count > 0], linewidth=1, label=name, clip_on=False)
        # The area of a dot is its bin's share of the joints.
        reliable.scatter(mean, within, s=6 + 400 * count / count.sum(), color=line.get_color(), alpha=0.6, clip_on=False)
        curve_m = risk_curve_m(joints)
        at = np.linspace(0, len(curve_m) - 1, min(CURVE_POINTS, len(curve_m))).astype(int)
        risk.plot((at + 1) / len(curve_m) * 100, 100 * curve_m[at], label=name)
    reliable.set(xlabel="confidence", ylabel="share of joints within 10 cm", xlim=(0, 1), ylim=(0, 1))
    risk.set(xlabel="most confident share of the joints, %", ylabel="their mean error, cm", xlim=(0, 100))
    risk.set_ylim(bottom=0)
    for panel in (reliable, risk):
        panel.grid(alpha=0.3)
        if panel.get_legend_handles_labels()[0]:
            panel.legend(fontsize=8)
    figure.suptitle(_title(run))
    return figure


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
    """RGB image of a scored frame of a sequence, row `row` of the results: depth, true skeleton, and the main estimator's."""
    results = run.results[run.main]
    errors_m = results.errors_m()[row]
    found, missing = np.isfinite(errors_m), int(np.isinf(errors_m).sum())
    error = f"{100 * errors_m[found].mean():.1f} cm" if found.any() else "no joints"
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
