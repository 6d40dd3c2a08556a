"""The report of an evaluation of joints: figures, views of the worst sequences, tables and what they mean."""

from pathlib import Path

import numpy as np

from kpopnet.datasets.protocol import Origin
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.poses import tables
from kpopnet.evaluation.poses.confidence import BINS
from kpopnet.evaluation.poses.figures import confidence_figure, error_curve, examples_sheet, joint_bars, sequence_bars
from kpopnet.evaluation.poses.run import PoseRun, run_benchmark
from kpopnet.evaluation.poses.sweep import Sweep, sweep_of
from kpopnet.evaluation.registry import build_benchmark, build_estimators
from kpopnet.evaluation.report import (
    SIMULATED,
    Block,
    Heading,
    Picture,
    Report,
    future_remark,
    interval_remarks,
    save_plots,
    save_view,
)
from kpopnet.viz.drawing import save_png
from kpopnet.viz.view_page import Shown

MAX_LISTED_SEQUENCES = 40
VIEWS = 3
"""Number of worst sequences that are shown in 3D."""

DIFFERENCES = (
    "How much larger the figures are than those of {}: percentage points within 10 cm, and mean error over the joints that "
    "both found. The intervals are paired: both are resampled on the same frames. One without 0 shows a difference."
)
DEFINITION = (
    "The labels are other points of the body than the estimated joints. Here every joint is moved by an offset that is "
    "constant in axes of the estimated torso and limbs, and was fitted on the labels of the other people."
)
CAUSES = (
    "Joints that are not within 10 cm, in percent of all joints, by the first cause that fits: absent (not estimated), "
    "hidden in the depth image, other side (found on the joint of the other side), momentary (found within a quarter of a "
    "second before and after), wrong depth (off along the viewing ray), elsewhere."
)
CONFIDENCE = (
    "The confidence is meant as the probability that a joint is within 10 cm of its true position. Calibration error: mean "
    f"distance between the confidence and the share within 10 cm, in {BINS} bins. Area: mean error of the most confident "
    "share of the joints, averaged over all shares; the best one orders joints by their true error. Missing joints are "
    "left out. The mean pose and the tree walk have confidence 1 throughout."
)
LABEL_FREE = (
    "How well the joints agree with each other over time and with the depth, whatever the labels say: standard deviation of "
    "bone lengths, jitter (root mean square about a straight movement) of joints that move by less than 2 cm in 0.2 s, "
    "impossible accelerations, and the distance of the person's points to the body that the joints pose. Small curved "
    "movements count as jitter: it compares estimators. Less is better, beside small errors: a pose that never moves is steady."
)
CLOCK = (
    "Definitions of the metrics: kpopnet/evaluation/poses/metrics.py. Frames per second are those of one core: the number of "
    "frames divided by the processor time of the estimator, or by wall-clock time on a GPU, after an untimed warm-up."
)


def evaluate_poses(config: EvaluateConfig, folder: Path) -> Report:
    """Judges estimated joints by true ones; writes figures and views into the folder.

    Raises InputError if scorers are named, which judge dances; see `run_benchmark`.
    """
    config.refuse("scorer")
    sweep = sweep_of(config.sweep, config.estimator) if config.sweep else None
    estimators = build_estimators(config.estimator | (sweep.settings if sweep else {}))
    benchmark = build_benchmark(config.benchmark)
    run = run_benchmark(benchmark, estimators, config.sequences, config.seed, config.processes_at_work(), config.extraction)
    return pose_report(run, folder, config.seed, sweep)


def pose_report(run: PoseRun, folder: Path, seed: int, sweep: Sweep | None = None) -> Report:
    """The report of a run, whose figures and views it writes into the folder, created if it does not exist.

    The additional estimators of a sweep appear only in its table. `seed` is of the random example frames.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run, all_metrics = run.without(sweep.settings if sweep else ()), run.metrics
    fractions = {name: part["map_10cm"] for name, part in run.metrics[run.main]["per_sequence"].items()}
    by_worst = sorted(fractions, key=lambda name: np.inf if fractions[name] is None else fractions[name])
    listed = by_worst[:MAX_LISTED_SEQUENCES]
    plots = {"per_joint": joint_bars(run), "error_curve": error_curve(run), "confidence": confidence_figure(run)}
    if len(listed) > 1:
        plots["per_sequence"] = sequence_bars(run, [name for name in fractions if name in listed])
    save_plots(folder, plots)
    save_png(folder / "examples.png", examples_sheet(run, seed))
    pictures = ["examples.png", *(f"{name}.png" for name in plots)]
    views = save_views(run, by_worst[:VIEWS], folder)
    blocks = [*_joint_blocks(run), *_sequence_blocks(run, listed, views)]
    printed = [tables.across("", run.metrics, tables.HEADLINE), *([tables.difference_table(run)] if run.differences else [])]
    printed += [*tables.group_tables(run.metrics), *tables.definition_tables(run.metrics)]
    if sweep:
        printed.append(sweep.table(all_metrics))
        blocks += [Heading(f"{sweep.estimator} at other settings (Table 1)"), printed[-1]]
    metrics = pose_metrics(run) | {"pictures": pictures, "sweep": sweep.figures(all_metrics) if sweep else None}
    return Report(f"kpopnet on {run.benchmark.name}", remarks(run), blocks, printed, CLOCK, metrics)


def remarks(run: PoseRun) -> list[str]:
    """Benchmark, origin of the depth and of the true joints, size, and what else is needed to interpret the metrics."""
    benchmark, main, about = run.benchmark, run.metrics[run.main], run.about
    evaluated, in_set, failed = len(main["per_sequence"]), about["sequences_in_set"], about["failed_sequences"]
    lines = [
        f"{benchmark.name}: {benchmark.origin.value.upper()} depth, compared with {benchmark.truth}; {main['images']} images "
        f"in {evaluated}{'' if evaluated == in_set else f' of {in_set}'} sequences.",
        benchmark.about,
    ]
    if benchmark.origin is Origin.SIMULATED:
        lines.append(SIMULATED)
    if (chosen := about["sequences"] + len(failed)) < in_set:
        lines.append(f"Partial evaluation: {chosen} of {in_set} sequences, evenly spaced; not a result on the whole set.")
    if about["extraction"] is not None:
        lines.append(
            f"The depth shows whole scenes: extraction={about['extraction']} segmented the person first, at "
            f"{about['extraction_fps']:.1f} frames per second. The frames per second of the estimators exclude this step."
        )
    for name in about["started_from_label"]:
        lines.append(f"{name} was given the first true pose of every sequence (start=label); it is not scored in that frame.")
    if about["images_without_person"]:
        lines.append(f"{about['images_without_person']} images show no person; their joints count as missing.")
    lines += [f"Left out because of an error: {name}: {reason}" for name, reason in failed.items()]
    lines += future_remark([name for name, one in run.metrics.items() if one["sees_future"]])
    units, count, people = about["resampled"].values()
    note = "; all stills in one room, from one camera, are one unit" if units == "rooms" else ""
    if people is not None:
        note += f"; the set shows {people} {'people' if people > 1 else 'person'}"
    return [*lines, *interval_remarks(units, count, note)]


def pose_metrics(run: PoseRun) -> dict:
    """metrics.json: metrics of the main estimator, of every estimator under `estimators`, and the benchmark.

    `mean_pose_error_cm` is the mean joint error of the mean pose baseline, null where no mean pose is known.
    """
    return {
        "estimator": run.main,
        **run.metrics[run.main],
        "mean_pose_error_cm": run.metrics.get("mean_pose", {}).get("mean_error_cm"),
        "benchmark": run.about,
        "estimators": run.metrics,
        "differences": {"from": run.main, "estimators": run.differences},
    }


def _joint_blocks(run: PoseRun) -> list[Block]:
    """The figures over all sequences."""
    main = run.metrics[run.main]
    published, headline = tables.published_on(run.benchmark), tables.across("", run.metrics, tables.HEADLINE)
    limits = [(f"within {name.removesuffix('cm')} cm", f"pck/{name}", "%") for name in main["pck"]]
    causes = [(cause, f"missed_by_cause/{cause}", "%") for cause in main["missed_by_cause"]]
    blocks: list[Block] = [headline, tables.across("", run.metrics, limits)]
    if without_labels := tables.label_free_table(run.metrics):
        blocks += [Heading("Without labels"), LABEL_FREE, without_labels]
    if published:
        blocks += ["Published results beside ours, over the paper's fourteen joints."]
        blocks += [tables.published_table(run.metrics, published)]
    if run.differences:
        blocks += [Heading(f"Differences from {run.main}"), DIFFERENCES.format(run.main), tables.difference_table(run)]
    blocks += [Heading(f"Example frames ({run.main})")]
    blocks += [Picture("examples.png", "Example frames with true and estimated skeletons over the depth")]
    blocks += [Heading("Joints"), *tables.group_tables(run.metrics)]
    if in_definition := tables.definition_tables(run.metrics):
        blocks += [DEFINITION, *in_definition]
    blocks += [Picture("per_joint.png", "Mean error and percentage within 10 cm of each joint")]
    blocks += [Picture("error_curve.png", "Percentage of joints within a distance of the true position")]
    blocks += [Heading("Why joints are missed"), CAUSES, tables.across("missed, by cause", run.metrics, causes)]
    blocks += [Heading("Confidence"), CONFIDENCE, tables.confidence_table(run.metrics)]
    return [*blocks, Picture("confidence.png", "Share within 10 cm over confidence, and error of the most confident joints")]


def _sequence_blocks(run: PoseRun, listed: list[str], views: list[Picture]) -> list[Block]:
    """Errors by sequence, the worst sequences, of which some have `views`, and errors by heading."""
    total = len(run.metrics[run.main]["per_sequence"])
    blocks: list[Block] = [
        Heading("Sequences" + (f", the {len(listed)} worst of {total}" if len(listed) < total else ", worst first")),
        "Error of visible joints (Eq. 16): mean and standard deviation.",
        tables.by_part("per_sequence", run.metrics, listed),
    ]
    if len(listed) > 1:
        blocks.append(Picture("per_sequence.png", "Mean and standard deviation of the error in each sequence"))
    blocks += [
        Heading(f"Worst sequences ({run.main})"),
        "Estimated joints in colours, true ones thin. Drag to turn, scroll or pinch to zoom, space to play.",
        *views,
    ]
    people = list(run.metrics[run.main]["per_person"])
    if 1 < len(people) <= MAX_LISTED_SEQUENCES:
        blocks += [Heading("People"), tables.by_part("per_person", run.metrics, people)]
    if sectors := run.metrics[run.main]["by_yaw"]:
        blocks += [
            Heading("Heading of the person"),
            "Centres of sectors of 45 degrees: 0 faces the camera, positive angles turn to the person's left.",
            tables.by_part("by_yaw", run.metrics, sectors),
        ]
    return blocks


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
