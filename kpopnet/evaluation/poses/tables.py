"""Tables of the pose report: a column for each estimator."""

from functools import reduce

from kpopnet.evaluation.poses.published import Published
from kpopnet.evaluation.poses.run import PoseRun
from kpopnet.evaluation.poses.sweep import Sweep
from kpopnet.evaluation.values import Table, Value

Metrics = dict[str, dict]
"""Metrics by the estimator's name, as `PoseRun.metrics`."""

HEADLINE = (
    ("within 10 cm (mAP), fifteen joints", "map_10cm", "%"),
    ("within 10 cm, the paper's fourteen joints", "map_14", "%"),
    ("mean error", "mean_error_cm", "cm"),
    ("median error", "median_error_cm", "cm"),
    ("mean error of visible joints (Eq. 16)", "average_pose_error_cm", "cm"),
    ("the same, constant offsets subtracted", "average_pose_error_no_offset_cm", "cm"),
    ("its standard deviation", "pose_error_deviation_cm", "cm"),
    ("area under the curve, 0 to 20 cm", "pck_area_20cm", "%"),
    ("missing joints", "missing_joints", ""),
    ("frames per second", "fps", ""),
)
IN_DEFINITION = HEADLINE[:4]
CONFIDENCE = (
    ("mean confidence", "mean", "%"),
    ("within 10 cm", "within_10cm", "%"),
    ("calibration error", "ece", "%"),
    ("area", "risk_cm", "cm"),
    ("best area", "risk_best_cm", "cm"),
)


def across(title: str, metrics: Metrics, rows: list[tuple[str, str, str]] | tuple[tuple[str, str, str], ...]) -> Table:
    """A table of rows (name, path, unit): the figure at the path PART/PART of every estimator's metrics, with its interval."""
    table = Table([title, *metrics], [])
    for name, path, unit in rows:
        found = [
            (reduce(dict.__getitem__, path.split("/"), one), one.get("interval", {}).get(path)) for one in metrics.values()
        ]
        table.rows.append([name, *(Value(figure, unit, interval) for figure, interval in found)])
    return table


def headline_table(metrics: Metrics) -> Table:
    """The main metrics with bootstrap intervals."""
    return across("", metrics, HEADLINE)


def threshold_table(metrics: Metrics) -> Table:
    """Percentage of joints within each distance threshold."""
    limits = next(iter(metrics.values()))["pck"]
    return across("", metrics, [(f"within {limit.removesuffix('cm')} cm", f"pck/{limit}", "%") for limit in limits])


def group_tables(metrics: Metrics, title: str = "") -> list[Table]:
    """Percentage within 10 cm and mean error of every joint group."""
    groups = next(iter(metrics.values()))["per_group"]
    return [
        across(title + what, metrics, [(group, f"per_group/{group}/{key}", unit) for group in groups])
        for what, key, unit in (("within 10 cm", "map_10cm", "%"), ("mean error", "mean_error_cm", "cm"))
    ]


def causes_table(metrics: Metrics) -> Table:
    """Percentage of all joints that are missed for each cause."""
    causes = next(iter(metrics.values()))["missed_by_cause"]
    return across("missed, by cause", metrics, [(cause, f"missed_by_cause/{cause}", "%") for cause in causes])


def definition_tables(metrics: Metrics) -> list[Table]:
    """The main metrics and the joint groups in the labels' definition; empty where the labels have none of their own."""
    found = {name: one["in_label_definition"] for name, one in metrics.items() if "in_label_definition" in one}
    if not found:
        return []
    definition = f"{next(iter(found.values()))['definition']} definition"
    main = across(f"{definition}, fitted on the other people", found, IN_DEFINITION)
    return [main, *group_tables(found, f"{definition}, ")]


def confidence_table(metrics: Metrics) -> Table:
    """Calibration and ranking of the confidence, also in the labels' definition, of estimators that found joints."""
    found = {}
    for name, one in metrics.items():
        found[name] = one["confidence"]
        if "in_label_definition" in one:
            found[f"{name}, in the labels' definition"] = one["in_label_definition"]["confidence"]
    found = {name: one for name, one in found.items() if one["joints"]}
    shares = next(iter(found.values()))["error_cm"] if found else ()
    return across("", found, [*CONFIDENCE, *((f"error of {share}", f"error_cm/{share}", "cm") for share in shares)])


def difference_table(run: PoseRun) -> Table:
    """The paired differences of every other estimator from the main one, with bootstrap intervals."""
    table = Table([f"difference from {run.main}", "within 10 cm", "mean error"], [])
    for name, found in run.differences.items():
        within, error = found["within_10cm_points"], found["mean_error_cm"]
        cells = (within, "points"), (error, "cm")
        table.rows.append([name, *(Value(one["value"], unit, one["interval"], signed=True) for one, unit in cells)])
    return table


def sequence_table(metrics: Metrics, names: list[str]) -> Table:
    """The values of Fig. 10: Eq. 16 with its standard deviation, and the percentage within 10 cm, of each sequence."""
    first = next(iter(metrics.values()))["per_sequence"]
    table = Table(["sequence", "images", *(f"{name}, {what}" for name in metrics for what in ("Eq. 16", "within 10 cm"))], [])
    for name in names:
        row: list = [name, first[name]["images"]]
        for part in (one["per_sequence"][name] for one in metrics.values()):
            row.append(Value(part["average_pose_error_cm"], "cm", deviation=part["pose_error_deviation_cm"]))
            row.append(Value(part["map_10cm"], "%"))
        table.rows.append(row)
    return table


def yaw_table(metrics: Metrics) -> Table:
    """Metrics by the heading of the person, in sectors of 45 degrees."""
    first = next(iter(metrics.values()))["by_yaw"]
    table = Table(
        ["heading", "images", *(f"{name}, {what}" for name in metrics for what in ("within 10 cm", "mean error"))], []
    )
    for heading, part in first.items():
        row: list = [heading, part["images"]]
        for one in (one["by_yaw"][heading] for one in metrics.values()):
            row += [Value(one["map_10cm"], "%"), Value(one["mean_error_cm"], "cm")]
        table.rows.append(row)
    return table


def published_table(metrics: Metrics, published: tuple[Published, ...]) -> Table:
    """Published results on this benchmark and ours, over the paper's fourteen joints."""
    figures = [*published]
    for name, one in metrics.items():
        figures.append(Published(f"here: {name}", one["map_14"], one["paper_joints"]["average_pose_error_cm"]))
    rows: list = [[one.method, Value(one.map_10cm, "%"), Value(one.pose_error_cm, "cm")] for one in figures]
    return Table(["fourteen joints", "within 10 cm (mAP)", "Eq. 16"], rows)


def sweep_table(metrics: Metrics, sweep: Sweep) -> Table:
    """Table 1: fraction of joints within 10 cm and frames per second at every combination."""
    rows, columns = sweep.config.rows, sweep.config.columns
    what = [f"{value}: {what}" for value in columns.values for what in ("mAP", "fps")]
    table = Table([f"{rows.setting} / {columns.setting}", *what], [])
    for value, names in zip(rows.values, sweep.names, strict=True):
        found = [metrics[name] for name in names]
        cells = [cell for one in found for cell in (Value(one["map_10cm"], digits=3), Value(one["fps"]))]
        table.rows.append([str(value), *cells])
    return table
