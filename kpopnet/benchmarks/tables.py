"""The tables of a report."""

from kpopnet.benchmarks.document import Table
from kpopnet.benchmarks.evaluation import Run
from kpopnet.benchmarks.published import published_on
from kpopnet.benchmarks.sweep import Sweep

NOTHING = "-"

HEADLINE = (
    ("within 10 cm (mAP)", "map_10cm", "%"),
    ("mean error", "mean_error_cm", "cm"),
    ("median error", "median_error_cm", "cm"),
    ("mean error of visible joints (Eq. 16)", "average_pose_error_cm", "cm"),
    ("the same, constant offsets taken out", "average_pose_error_no_offset_cm", "cm"),
    ("its standard deviation", "pose_error_deviation_cm", "cm"),
    ("area under the curve, 0 to 20 cm", "pck_area_20cm", "%"),
    ("missing joints", "missing_joints", ""),
    ("frames per second", "fps", ""),
)


def number(value: float | None, unit: str = "") -> str:
    if value is None:
        return NOTHING
    if unit == "%":
        return f"{100 * value:.1f} %"
    if unit == "cm":
        return f"{value:.2f} cm"
    return f"{value}" if isinstance(value, int) else f"{value:.1f}"


def _with_interval(metrics: dict, key: str, unit: str) -> str:
    text, interval = number(metrics[key], unit), metrics["interval"].get(key)
    if interval is None or metrics[key] is None:
        return text
    low, high = (number(value, unit).removesuffix(f" {unit}") for value in interval)
    return f"{text} ({low} to {high})"


def headline_table(run: Run) -> Table:
    rows = [[title, *(_with_interval(m, key, unit) for m in run.metrics.values())] for title, key, unit in HEADLINE]
    return ["", *run.metrics], rows


def threshold_table(run: Run) -> Table:
    """The share of joints within each distance."""
    limits = next(iter(run.metrics.values()))["pck"]
    rows = [
        [f"within {limit.removesuffix('cm')} cm", *(number(m["pck"][limit], "%") for m in run.metrics.values())]
        for limit in limits
    ]
    return ["", *run.metrics], rows


def group_table(run: Run, key: str, unit: str, title: str) -> Table:
    """One figure by group of joints."""
    groups = next(iter(run.metrics.values()))["per_group"]
    rows = [[group, *(number(m["per_group"][group][key], unit) for m in run.metrics.values())] for group in groups]
    return [title, *run.metrics], rows


def group_tables(run: Run) -> tuple[Table, Table]:
    return group_table(run, "map_10cm", "%", "within 10 cm"), group_table(run, "mean_error_cm", "cm", "mean error")


def sequence_table(run: Run, names: list[str]) -> Table:
    """Fig. 10 in numbers: Eq. 16 with its standard deviation, and the share within 10 cm, of each sequence."""
    header = ["sequence", "images", *(f"{name}, {what}" for name in run.metrics for what in ("Eq. 16", "within 10 cm"))]
    first = next(iter(run.metrics.values()))["per_sequence"]
    rows = []
    for name in names:
        row = [name, number(first[name]["images"])]
        for metrics in run.metrics.values():
            part = metrics["per_sequence"][name]
            mean, deviation = part["average_pose_error_cm"], part["pose_error_deviation_cm"]
            row.append(NOTHING if mean is None else f"{mean:.2f} ± {deviation:.2f} cm")
            row.append(number(part["map_10cm"], "%"))
        rows.append(row)
    return header, rows


def yaw_table(run: Run) -> Table:
    """By the direction the person faces, in eighths of the circle."""
    first = next(iter(run.metrics.values()))["by_yaw"]
    header = ["heading", "images", *(f"{name}, {what}" for name in run.metrics for what in ("within 10 cm", "mean error"))]
    rows = [
        [
            heading,
            number(part["images"]),
            *(
                number(metrics["by_yaw"][heading][key], unit)
                for metrics in run.metrics.values()
                for key, unit in (("map_10cm", "%"), ("mean_error_cm", "cm"))
            ),
        ]
        for heading, part in first.items()
    ]
    return header, rows


def published_table(run: Run) -> Table:
    """What papers report on this benchmark; without rows where nothing is known, or the depth is simulated."""
    rows = [
        [one.method, number(one.map_10cm, "%"), number(one.pose_error_cm, "cm")] for one in published_on(run.benchmark)
    ]
    return ["published, all joints", "within 10 cm (mAP)", "Eq. 16"], rows


def sweep_table(run: Run, sweep: Sweep) -> Table:
    """Table 1: share within 10 cm and frames per second at every combination."""
    columns = sweep.config.columns
    header = [f"{sweep.config.rows.setting} / {columns.setting}"]
    header += [f"{value}: {what}" for value in columns.values for what in ("mAP", "fps")]
    rows = [
        [
            str(value),
            *(
                cell
                for name in names
                for cell in (f"{run.metrics[name]['map_10cm']:.3f}", number(run.metrics[name]["fps"]))
            ),
        ]
        for value, names in zip(sweep.config.rows.values, sweep.names, strict=True)
    ]
    return header, rows
