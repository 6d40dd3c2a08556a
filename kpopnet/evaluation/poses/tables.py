"""Tables of the pose report: a column for each estimator. Published results stand beside ours on real sets only."""

from collections.abc import Iterable
from functools import reduce
from typing import NamedTuple

from kpopnet.datasets.protocol import Benchmark, Origin
from kpopnet.evaluation.poses.label_free import FIGURES
from kpopnet.evaluation.poses.run import PoseRun
from kpopnet.evaluation.values import Table, Value

Metrics = dict[str, dict]
"""Metrics by the estimator's name, as `PoseRun.metrics`."""

HEADLINE = (
    ("within 10 cm (mAP), fifteen joints", "map_10cm", "%"),
    ("within 10 cm, the paper's fourteen joints", "map_14", "%"),
    ("within 10 cm, moving joints", "moving_10cm", "%"),
    ("mean error", "mean_error_cm", "cm"),
    ("median error", "median_error_cm", "cm"),
    ("mean error of visible joints (Eq. 16)", "average_pose_error_cm", "cm"),
    ("its standard deviation", "pose_error_deviation_cm", "cm"),
    ("mean error of visible joints, constant offsets subtracted", "average_pose_error_no_offset_cm", "cm"),
    ("area under the curve, 0 to 20 cm", "pck_area_20cm", "%"),
    ("missing joints", "missing_joints", ""),
    ("frames per second", "fps", ""),
)
IN_DEFINITION = HEADLINE[:5]
CONFIDENCE = (
    ("mean confidence", "mean", "%"),
    ("within 10 cm", "within_10cm", "%"),
    ("calibration error", "ece", "%"),
    ("area", "risk_cm", "cm"),
    ("best area", "risk_best_cm", "cm"),
)
WITHIN, ERROR = ("within 10 cm", "map_10cm", "%"), ("mean error", "mean_error_cm", "cm")
PARTS = {
    "per_sequence": ("sequence", (("Eq. 16", "average_pose_error_cm", "cm"), WITHIN)),
    "per_person": ("person", (WITHIN, ("moving joints", "moving_10cm", "%"), ERROR)),
    "by_yaw": ("heading", (WITHIN, ERROR)),
}
"""Parts of the images: the key of their metrics, the name of one, and the figures that tables show of it."""


class Published(NamedTuple):
    """Published results over all joints of a method: the fraction within 10 cm, 0..1, and Eq. 16; None where not published."""

    method: str
    map_10cm: float | None = None
    pose_error_cm: float | None = None


PUBLISHED = {
    "eval": (
        Published("Kim & Kim 2018, tracker", map_10cm=0.9358),
        Published("Kim & Kim 2018, CNN, depth", map_10cm=0.9566),
        Published("Kim & Kim 2018, CNN, depth + ridge", map_10cm=0.9667),
    ),
    "smmc10": (
        Published("Kim & Kim 2018, tracker", pose_error_cm=3.88),
        Published("Kim & Kim 2015", map_10cm=0.9671),
    ),
}
"""By the name of the benchmark. Kim & Kim 2018 have fourteen joints, without the neck, as `map_14` of `metrics.evaluate`."""


def published_on(benchmark: Benchmark) -> tuple[Published, ...]:
    """The published results on a benchmark; none on a simulated one, whatever its name."""
    return PUBLISHED.get(benchmark.name, ()) if benchmark.origin is Origin.REAL else ()


def across(title: str, metrics: Metrics, rows: Iterable[tuple[str, str, str]]) -> Table:
    """A table of rows (name, path, unit): the figure at the path PART/PART of every estimator's metrics, with its interval."""
    table = Table([title, *metrics], [])
    for name, path, unit in rows:
        figures = ((reduce(dict.__getitem__, path.split("/"), one), one.get("interval", {})) for one in metrics.values())
        table.rows.append([name, *(Value(figure, unit, intervals.get(path)) for figure, intervals in figures)])
    return table


def group_tables(metrics: Metrics, title: str = "") -> list[Table]:
    """Percentage within 10 cm and mean error of every joint group."""
    groups = next(iter(metrics.values()))["per_group"]
    return [
        across(title + what, metrics, [(group, f"per_group/{group}/{key}", unit) for group in groups])
        for what, key, unit in (WITHIN, ERROR)
    ]


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


def label_free_table(metrics: Metrics) -> Table | None:
    """What needs no label, of films; None for stills."""
    if any(one["label_free"] is None for one in metrics.values()):
        return None
    return across("", metrics, [(name, f"label_free/{key}", unit) for key, (name, unit) in FIGURES.items()])


def difference_table(run: PoseRun) -> Table:
    """The paired differences of every other estimator from the main one, with bootstrap intervals."""
    table = Table([f"difference from {run.main}", "within 10 cm", "mean error"], [])
    for name, found in run.differences.items():
        within, error = found["within_10cm_points"], found["mean_error_cm"]
        cells = (within, "points"), (error, "cm")
        table.rows.append([name, *(Value(one["value"], unit, one["interval"], signed=True) for one, unit in cells)])
    return table


def by_part(key: str, metrics: Metrics, parts: Iterable[str]) -> Table:
    """A row for each part of the images, as PARTS has them: their number, and figures of every estimator.

    Eq. 16 stands with its standard deviation: the values of Fig. 10.
    """
    title, columns = PARTS[key]
    table = Table([title, "images", *(f"{name}, {what}" for name in metrics for what, _, _ in columns)], [])
    for part in parts:
        found = [one[key][part] for one in metrics.values()]
        cells = [
            Value(one[figure], unit, deviation=one["pose_error_deviation_cm"] if what == "Eq. 16" else None)
            for one in found
            for what, figure, unit in columns
        ]
        table.rows.append([part, found[0]["images"], *cells])
    return table


def published_table(metrics: Metrics, published: tuple[Published, ...]) -> Table:
    """Published results on this benchmark and ours, over the paper's fourteen joints."""
    figures = [*published]
    for name, one in metrics.items():
        figures.append(Published(f"here: {name}", one["map_14"], one["paper_joints"]["average_pose_error_cm"]))
    rows: list = [[one.method, Value(one.map_10cm, "%"), Value(one.pose_error_cm, "cm")] for one in figures]
    return Table(["fourteen joints", "within 10 cm (mAP)", "Eq. 16"], rows)
