"""Plots of the pose report: bars by joint and by sequence, the error curve and the confidence."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kpopnet.evaluation.poses.confidence import judged, reliability, risk_curve_m
from kpopnet.evaluation.poses.metrics import CURVE_END_M, THRESHOLDS_M, fraction_within
from kpopnet.evaluation.poses.run import PoseRun
from kpopnet.evaluation.poses.tables import published_on
from kpopnet.skeleton import JOINT_NAMES

CURVE_POINTS = 200


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
        (line,) = reliable.plot(mean[count > 0], within[count > 0], linewidth=1, label=name)
        # The area of a dot is its bin's share of the joints.
        reliable.scatter(mean, within, s=6 + 400 * count / count.sum(), color=line.get_color(), alpha=0.6)
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
