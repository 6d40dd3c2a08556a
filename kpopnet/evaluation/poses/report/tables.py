"""Tables of the pose report."""

from dataclasses import replace

from kpopnet.evaluation.blocks import Table
from kpopnet.evaluation.poses.report.published import published_on
from kpopnet.evaluation.poses.run import Run
from kpopnet.evaluation.poses.sweep import Sweep

NO_VALUE = "-"

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


def format_value(value: float | None, unit: str = "") -> str:
    """A metric as text. `unit` is "%" for a fraction in 0..1, "cm", or empty."""
    if value is None:
        return NO_VALUE
    if unit == "%":
        return f"{100 * value:.1f} %"
    if unit == "cm":
        return f"{value:.2f} cm"
    return f"{value}" if isinstance(value, int) else f"{value:.1f}"


def _with_interval(metrics: dict, key: str, unit: str) -> str:
    text, interval = format_value(metrics[key], unit), metrics["interval"].get(key)
    if interval is None or metrics[key] is None:
        return text
    low, high = (format_value(value, unit).removesuffix(f" {unit}") for value in interval)
    return f"{text} ({low} to {high})"


def headline_table(run: Run) -> Table:
    """The main metrics of every estimator, with bootstrap intervals."""
    rows = [[title, *(_with_interval(m, key, unit) for m in run.metrics.values())] for title, key, unit in HEADLINE]
    return ["", *run.metrics], rows


DIFFERENCES = (("within 10 cm", "within_10cm_points", "points"), ("mean error", "mean_error_cm", "cm"))


def difference_table(run: Run) -> Table:
    """The paired differences of every other estimator from the main one, with bootstrap intervals."""
    header = [f"difference from {next(iter(run.metrics))}", *(title for title, _, _ in DIFFERENCES)]
    rows = [[name, *(_signed(found[key], unit) for _, key, unit in DIFFERENCES)] for name, found in run.differences.items()]
    return header, rows


def _signed(difference: dict, unit: str) -> str:
    """A difference and its interval as text."""
    if difference["value"] is None:
        return NO_VALUE
    text = f"{difference['value']:+.2f} {unit}"
    if difference["interval"] is None:
        return text
    low, high = difference["interval"]
    return f"{text} ({low:+.2f} to {high:+.2f})"


def threshold_table(run: Run) -> Table:
    """Percentage of joints within each distance threshold."""
    limits = next(iter(run.metrics.values()))["pck"]
    rows = [
        [f"within {limit.removesuffix('cm')} cm", *(format_value(m["pck"][limit], "%") for m in run.metrics.values())]
        for limit in limits
    ]
    return ["", *run.metrics], rows


def group_table(run: Run, key: str, unit: str, title: str) -> Table:
    """The metric `key` of every joint group."""
    groups = next(iter(run.metrics.values()))["per_group"]
    rows = [[group, *(format_value(m["per_group"][group][key], unit) for m in run.metrics.values())] for group in groups]
    return [title, *run.metrics], rows


def group_tables(run: Run) -> tuple[Table, Table]:
    """Percentage within 10 cm and mean error of every joint group."""
    return group_table(run, "map_10cm", "%", "within 10 cm"), group_table(run, "mean_error_cm", "cm", "mean error")


def causes_table(run: Run) -> Table:
    """Percentage of all joints that are missed for each cause."""
    causes = next(iter(run.metrics.values()))["missed_by_cause"]
    return ["missed, by cause", *run.metrics], [
        [cause, *(format_value(m["missed_by_cause"][cause], "%") for m in run.metrics.values())] for cause in causes
    ]


DEFINITION = tuple(row for row in HEADLINE if row[1] in ("map_10cm", "map_14", "mean_error_cm", "median_error_cm"))


def definition_tables(run: Run) -> list[Table]:
    """The main metrics and the joint groups in the labels' definition; empty where the labels have none of their own."""
    found = {name: m["in_label_definition"] for name, m in run.metrics.items() if "in_label_definition" in m}
    if not found:
        return []
    definition = f"{next(iter(found.values()))['definition']} definition"
    rows = [[title, *(_with_interval(m, key, unit) for m in found.values())] for title, key, unit in DEFINITION]
    run = replace(run, metrics=found)
    return [
        ([f"{definition}, fitted on the other people", *found], rows),
        group_table(run, "map_10cm", "%", f"{definition}, within 10 cm"),
        group_table(run, "mean_error_cm", "cm", f"{definition}, mean error"),
    ]


def sequence_table(run: Run, names: list[str]) -> Table:
    """The values of Fig. 10: Eq. 16 with its standard deviation, and the percentage within 10 cm, of each sequence."""
    header = ["sequence", "images", *(f"{name}, {what}" for name in run.metrics for what in ("Eq. 16", "within 10 cm"))]
    first = next(iter(run.metrics.values()))["per_sequence"]
    rows = []
    for name in names:
        row = [name, format_value(first[name]["images"])]
        for metrics in run.metrics.values():
            part = metrics["per_sequence"][name]
            mean, deviation = part["average_pose_error_cm"], part["pose_error_deviation_cm"]
            row.append(NO_VALUE if mean is None else f"{mean:.2f} ± {deviation:.2f} cm")
            row.append(format_value(part["map_10cm"], "%"))
        rows.append(row)
    return header, rows


def yaw_table(run: Run) -> Table:
    """Metrics by the heading of the person, in sectors of 45 degrees."""
    first = next(iter(run.metrics.values()))["by_yaw"]
    header = ["heading", "images", *(f"{name}, {what}" for name in run.metrics for what in ("within 10 cm", "mean error"))]
    rows = [
        [
            heading,
            format_value(part["images"]),
            *(
                format_value(metrics["by_yaw"][heading][key], unit)
                for metrics in run.metrics.values()
                for key, unit in (("map_10cm", "%"), ("mean_error_cm", "cm"))
            ),
        ]
        for heading, part in first.items()
    ]
    return header, rows


def published_table(run: Run) -> Table:
    """Published results on this benchmark and ours, over the paper's fourteen joints.

    It has no rows where none are published or the depth is simulated.
    """
    published = [(one.method, one.map_10cm, one.pose_error_cm) for one in published_on(run.benchmark)]
    ours = [
        (f"here: {name}", metrics["map_14"], metrics["paper_joints"]["average_pose_error_cm"])
        for name, metrics in run.metrics.items()
    ]
    rows = [
        [method, format_value(fraction, "%"), format_value(error_cm, "cm")]
        for method, fraction, error_cm in (published + ours if published else [])
    ]
    return ["fourteen joints", "within 10 cm (mAP)", "Eq. 16"], rows


def sweep_table(run: Run, sweep: Sweep) -> Table:
    """Table 1: fraction of joints within 10 cm and frames per second at every combination."""
    columns = sweep.config.columns
    header = [f"{sweep.config.rows.setting} / {columns.setting}"]
    header += [f"{value}: {what}" for value in columns.values for what in ("mAP", "fps")]
    rows = [
        [
            str(value),
            *(
                cell
                for name in names
                for cell in (f"{run.metrics[name]['map_10cm']:.3f}", format_value(run.metrics[name]["fps"]))
            ),
        ]
        for value, names in zip(sweep.config.rows.values, sweep.names, strict=True)
    ]
    return header, rows
