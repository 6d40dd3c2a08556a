"""Report of a pose evaluation: terminal table, metrics.json, figures, report.md and report.html.

The tables and reports begin with a sentence that names the origin of the depth (real or simulated) and of the true joints.
"""

import hashlib
import json
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from kpopnet.datasets.protocol import Origin
from kpopnet.evaluation.blocks import Block
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.document import as_text, describe_files, describe_revision, write_document
from kpopnet.evaluation.intervals import FEWEST_UNITS
from kpopnet.evaluation.poses.confidence import confidence_blocks, confidence_figure
from kpopnet.evaluation.poses.report.figures import error_curve, examples_sheet, joint_bars, sequence_bars, sweep_plot
from kpopnet.evaluation.poses.report.tables import (
    causes_table,
    definition_tables,
    difference_table,
    format_value,
    group_tables,
    headline_table,
    published_table,
    sequence_table,
    sweep_table,
    threshold_table,
    yaw_table,
)
from kpopnet.evaluation.poses.report.worst_sequences import (
    VIEWS,
    contact_sheet,
    render_video,
    save_video,
    view_in_3d,
    worst_sequences,
)
from kpopnet.evaluation.poses.run import Resampled, Run
from kpopnet.evaluation.poses.sweep import Sweep
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.runtime.provenance import git_revision
from kpopnet.viz.drawing import save_png

MAX_LISTED_SEQUENCES = 40


def identity(run: Run) -> str:
    """One sentence: benchmark, origin of the depth, origin of the true joints, number of frames and sequences."""
    benchmark, main = run.benchmark, next(iter(run.metrics.values()))
    evaluated = len(main["per_sequence"])
    part = "" if evaluated == run.sequences_in_set else f" of {run.sequences_in_set}"
    return (
        f"{benchmark.name}: {benchmark.origin.value.upper()} depth, compared with {benchmark.truth}; "
        f"{main['images']} images in {evaluated}{part} sequences."
    )


def remarks(run: Run) -> list[str]:
    """Notes that are needed to interpret the metrics."""
    lines = [run.benchmark.about]
    if run.benchmark.origin is Origin.SIMULATED:
        lines.append("No real sensor recorded this depth: these results do not predict the errors on real depth.")
    for estimator, settings in run.unlike_training.items():
        lines.append(f"This set differs from the training set of {estimator}: {', '.join(settings)}.")
    chosen = len(next(iter(run.results.values())).sequence_names) + len(run.failed)
    if chosen < run.sequences_in_set:
        lines.append(
            f"Partial evaluation: {chosen} of {run.sequences_in_set} sequences, evenly spaced; not a result on the whole set."
        )
    if run.extraction_fps is not None:
        lines.append(
            f"The depth shows whole scenes: the person was segmented first, at {format_value(run.extraction_fps)} frames per "
            "second. The frames per second of the estimators exclude this step."
        )
    for estimator in run.started_from_label:
        lines.append(
            f"{estimator} was given the first true pose of every sequence (start=label); it is not scored in that frame."
        )
    if run.images_without_person:
        lines.append(f"{run.images_without_person} images show no person; their joints count as missing.")
    lines += [f"Left out because of an error: {name}: {reason}" for name, reason in run.failed.items()]
    return [*lines, *interval_remarks(run.resampled)]


def interval_remarks(resampled: Resampled) -> list[str]:
    """What the bootstrap resampled, how many units, and what its intervals therefore do not cover."""
    units, count, people = resampled
    if count < 2:
        return [f"No intervals: they would resample {units}, and there is only {count}."]
    lines = [f"Ranges in parentheses: 95 % bootstrap intervals; {count} {units} were resampled."]
    if units == "rooms":
        lines[0] += " All stills in one room, from one camera, are one unit."
    elif people is not None and people < count:
        lines[0] += f" They show {people} {'people' if people > 1 else 'person'}: the intervals do not cover other people."
    if count < FEWEST_UNITS:
        lines.append(f"The intervals cannot be trusted: {count} {units} are too few to know how much they vary.")
    return lines


def terminal_table(run: Run, sweep: Sweep | None = None) -> str:
    """Text for a terminal: the main metrics, the differences of estimators, the joint groups and the sweep."""
    run, run_with_sweep = _without_sweep(run, sweep), run
    tables = [headline_table(run), *([difference_table(run)] if run.differences else []), *group_tables(run)]
    tables += definition_tables(run)
    if sweep:
        tables.append(sweep_table(run_with_sweep, sweep))
    return "\n\n".join(["\n".join([identity(run), *remarks(run)]), *map(as_text, tables)]) + "\n"


def _without_sweep(run: Run, sweep: Sweep | None) -> Run:
    """The run without the additional estimators of the sweep."""
    return run.select([name for name in run.metrics if sweep is None or name not in sweep.settings])


def metrics_json(run: Run, config: EvaluateConfig, figures: list[str]) -> dict:
    """Contents of metrics.json: metrics of the main estimator, of every estimator under `estimators`, and the benchmark.

    `in_label_definition` of an estimator holds its figures in the labels' definition, fitted on the other people, where the
    labels have one of their own; `confidence` is the result of `evaluate_confidence`. `images` is the number of evaluated
    frames; `pictures` lists the files of `figures`; `mean_pose_error_cm` is the mean joint error of the mean pose baseline,
    null where no mean pose is known. `benchmark` has seed, version and config_hash of a simulated set, null of a real one, and
    `resampled`, what the intervals resample (`Resampled`). `differences` has the paired differences of the other estimators
    from the main one. `files` is the result of `EvaluateConfig.files`.
    """
    resolved = asdict(config)
    canonical = json.dumps(resolved, sort_keys=True)
    main, metrics = next(iter(run.metrics.items()))
    provenance = getattr(run.benchmark, "provenance", {})
    return {
        "estimator": main,
        **metrics,
        "mean_pose_error_cm": run.metrics.get("mean_pose", {}).get("mean_error_cm"),
        "benchmark": {
            "name": run.benchmark.name,
            "depth": run.benchmark.origin.value,
            "against": run.benchmark.truth,
            "about": run.benchmark.about,
            **{key: provenance.get(key) for key in ("seed", "version", "config_hash")},
            "sequences": len(next(iter(run.results.values())).sequence_names),
            "sequences_in_set": run.sequences_in_set,
            "failed_sequences": run.failed,
            "images_without_person": run.images_without_person,
            "unlike_training": run.unlike_training,
            "started_from_label": run.started_from_label,
            "extraction_fps": run.extraction_fps,
            "resampled": run.resampled._asdict(),
        },
        "estimators": run.metrics,
        "differences": {"from": main, "estimators": run.differences},
        "pictures": figures,
        "files": config.files(),
        "config": resolved,
        "config_hash": hashlib.sha256(canonical.encode()).hexdigest()[:12],
        "git": git_revision(),
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def sweep_json(run: Run, sweep: Sweep) -> dict:
    """Table 1: the axes, and for each metric a list of rows of columns."""
    return {
        "estimator": sweep.estimator,
        **{axis: asdict(getattr(sweep.config, axis)) for axis in ("rows", "columns")},
        **{
            metric: [[run.metrics[name][metric] for name in names] for names in sweep.names]
            for metric in ("map_10cm", "mean_error_cm", "missing_joints", "fps")
        },
    }


def write_report(folder: Path, run: Run, config: EvaluateConfig, sweep: Sweep | None = None) -> None:
    """Writes the report with its figures, views in 3D, tables and metrics.json into the folder, created if it does not exist.

    Args:
        folder: output folder.
        run: the results, including those of the estimators of a sweep.
        config: settings of the evaluation.
        sweep: the estimators of a sweep, if any. The additional ones appear only in the table and the plot of the sweep.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run, run_with_sweep = _without_sweep(run, sweep), run
    by_worst = worst_sequences(run)
    listed, worst = by_worst[:MAX_LISTED_SEQUENCES], by_worst[0]
    plots = {"per_joint.png": joint_bars(run), "error_curve.png": error_curve(run)}
    title = f"{run.benchmark.name} ({run.benchmark.origin.value}), against {run.benchmark.truth}"
    plots["confidence.png"] = confidence_figure(run.results, title)
    if len(listed) > 1:
        plots["per_sequence.png"] = sequence_bars(run, sorted(listed, key=list(main_metrics(run)["per_sequence"]).index))
    if sweep:
        plots["sweep.png"] = sweep_plot(run_with_sweep, sweep)
    for name, plot in plots.items():
        plot.savefig(folder / name, dpi=110)
        plot.savefig((folder / name).with_suffix(".svg"))
    save_png(folder / "examples.png", examples_sheet(run, config.seed))
    save_png(folder / "worst.png", contact_sheet(run, worst))
    fps, images = render_video(run, worst)
    videos = ["worst.mp4"] if fps and save_video(folder / "worst.mp4", images, fps) else []
    views = {f"worst_{number}.html": name for number, name in enumerate(by_worst[:VIEWS], 1)}
    for file, name in views.items():
        with atomic_path(folder / file) as part:
            part.write_text(view_in_3d(run, name), encoding="utf-8", errors="backslashreplace")
    metrics = metrics_json(run, config, ["examples.png", "worst.png", *plots, *videos])
    metrics["sweep"] = sweep_json(run_with_sweep, sweep) if sweep else None
    blocks = report_blocks(run, metrics, views)
    if sweep:
        blocks += [
            ("heading", f"{sweep.estimator} at other settings (Table 1)"),
            ("table", sweep_table(run_with_sweep, sweep)),
            ("figure", ("sweep.png", "Fraction of joints within 10 cm and frames per second at every combination")),
        ]
    write_document(folder, blocks + provenance_blocks(metrics), metrics)


def main_metrics(run: Run) -> dict:
    """The metrics of the main estimator."""
    return next(iter(run.metrics.values()))


def report_blocks(run: Run, metrics: dict, views: dict[str, str]) -> list[Block]:
    """The report up to the sweep: `metrics` is the result of `metrics_json`, `views` names the sequence of each page in 3D."""
    figures, main = metrics["pictures"], metrics["estimator"]
    published = published_table(run)
    blocks: list[Block] = [
        ("title", f"kpopnet on {run.benchmark.name}"),
        ("text", identity(run)),
        *(("text", line) for line in remarks(run)),
        ("table", headline_table(run)),
        ("table", threshold_table(run)),
    ]
    if published[1]:
        blocks += [("text", "Published results beside ours, over the paper's fourteen joints."), ("table", published)]
    if run.differences:
        blocks += [
            ("heading", f"Differences from {main}"),
            (
                "text",
                f"How much larger the figures are than those of {main}: percentage points within 10 cm, and mean error over "
                "the joints that both found. The intervals are paired: both are resampled on the same frames. One without "
                "0 shows a difference.",
            ),
            ("table", difference_table(run)),
        ]
    blocks += [
        ("heading", f"Example frames ({main})"),
        ("figure", ("examples.png", "Example frames with true and estimated skeletons over the depth")),
        ("heading", "Joints"),
        *(("table", table) for table in group_tables(run)),
        *definition_blocks(run),
        ("figure", ("per_joint.png", "Mean error and percentage within 10 cm of each joint")),
        ("figure", ("error_curve.png", "Percentage of joints within a distance of the true position")),
        *causes_blocks(run),
        *confidence_blocks(run.metrics),
    ]
    blocks += sequence_blocks(run, figures, views)
    if main_metrics(run)["by_yaw"]:
        blocks += [
            ("heading", "Heading of the person"),
            ("text", "Centres of sectors of 45 degrees: 0 faces the camera, positive angles turn to the person's left."),
            ("table", yaw_table(run)),
        ]
    return blocks


def causes_blocks(run: Run) -> list[Block]:
    """Why joints are missed."""
    text = (
        "Joints that are not within 10 cm, in percent of all joints, by the first cause that fits: absent (not estimated), "
        "hidden in the depth image, other side (found on the joint of the other side), momentary (found within a quarter of a "
        "second before and after), wrong depth (off along the viewing ray), elsewhere."
    )
    return [("heading", "Why joints are missed"), ("text", text), ("table", causes_table(run))]


def sequence_blocks(run: Run, figures: list[str], views: dict[str, str]) -> list[Block]:
    """Errors by sequence, and the worst ones; `figures` are those that were drawn, `views` as in `report_blocks`."""
    listed, main = worst_sequences(run)[:MAX_LISTED_SEQUENCES], next(iter(run.metrics))
    total = len(main_metrics(run)["per_sequence"])
    of_all = f", the {len(listed)} worst of {total}" if len(listed) < total else ", worst first"
    blocks: list[Block] = [
        ("heading", f"Sequences{of_all}"),
        ("text", "Error of visible joints (Eq. 16): mean and standard deviation."),
        ("table", sequence_table(run, listed)),
    ]
    if "per_sequence.png" in figures:
        blocks.append(("figure", ("per_sequence.png", "Mean and standard deviation of the error in each sequence")))
    blocks += [
        ("heading", f"Worst sequences in 3D ({main})"),
        ("text", "Estimated joints in colours, true ones thin. Drag to turn, scroll or pinch to zoom, space to play."),
        *(("view", (file, name)) for file, name in views.items()),
        ("heading", f"Worst sequence ({main})"),
        ("figure", ("worst.png", "Evenly spaced frames of the worst sequence, with true and estimated skeletons")),
    ]
    if "worst.mp4" in figures:
        blocks.append(("video", ("worst.mp4", "Video of the worst sequence")))
    return blocks


def definition_blocks(run: Run) -> list[Block]:
    """The figures in the labels' definition; empty where the labels have none of their own."""
    tables = definition_tables(run)
    text = (
        "The labels are other points of the body than the estimated joints. Here every joint is moved by an offset that is "
        "constant in axes of the estimated torso and limbs, and was fitted on the labels of the other people."
    )
    return [("text", text), *(("table", table) for table in tables)] if tables else []


def provenance_blocks(metrics: dict) -> list[Block]:
    """The end of the report: input files, configuration, code revision, date, and how the speed was measured."""
    return [
        ("heading", "How this report was made"),
        (
            "text",
            f"{describe_files(metrics['files'])}; configuration {metrics['config_hash']}; code "
            f"{describe_revision(metrics['git'])}; {metrics['made']}. All metrics: metrics.json; their definitions: "
            "kpopnet/evaluation/poses/metrics.py.",
        ),
        (
            "text",
            "Frames per second are those of one core: the number of frames divided by the processor time of the estimator, or "
            "by wall-clock time on a GPU, after an untimed warm-up.",
        ),
    ]
