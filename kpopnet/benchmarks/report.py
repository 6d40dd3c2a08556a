"""The report of an evaluation: a table for the terminal, metrics.json, pictures, report.md and report.html.

All of them say first whether the depth is real or simulated and what the joints are judged against.
"""

import hashlib
import json
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from kpopnet.benchmarks.document import Block, as_text, files_in_words, revision_in_words, write_document
from kpopnet.benchmarks.evaluation import EvaluateConfig, Run
from kpopnet.benchmarks.pictures import error_curve, examples_sheet, joint_bars, sequence_bars, sweep_plot
from kpopnet.benchmarks.sequences import Origin
from kpopnet.benchmarks.sweep import Sweep
from kpopnet.benchmarks.tables import (
    group_tables,
    headline_table,
    number,
    published_table,
    sequence_table,
    sweep_table,
    threshold_table,
    yaw_table,
)
from kpopnet.benchmarks.worst import contact_sheet, film, save_video, worst_sequence
from kpopnet.checkpoint import git_revision
from kpopnet.drawing import save_png

LONGEST_SEQUENCE_TABLE = 40


def identity(run: Run) -> str:
    """One sentence: what was judged on what, and against what."""
    benchmark, main = run.benchmark, next(iter(run.metrics.values()))
    evaluated = len(main["per_sequence"])
    part = "" if evaluated == run.sequences_in_set else f" of {run.sequences_in_set}"
    return (
        f"{benchmark.name}: {benchmark.origin.value.upper()} depth, judged against {benchmark.truth}; "
        f"{main['images']} images in {evaluated}{part} sequences."
    )


def remarks(run: Run) -> list[str]:
    """What a reader must know to read the figures rightly."""
    lines = [run.benchmark.about]
    if run.benchmark.origin is Origin.SIMULATED:
        lines.append("Nothing here was seen by a real sensor: the figures say nothing certain about real depth.")
    for estimator, settings in run.unlike_training.items():
        lines.append(f"This set is not like what {estimator} was trained on: {', '.join(settings)}.")
    chosen = len(next(iter(run.scored.values())).sequence_names) + len(run.failed)
    if chosen < run.sequences_in_set:
        lines.append(f"A quick look: {chosen} of {run.sequences_in_set} sequences, evenly spaced; no score of the set.")
    if run.extraction_fps is not None:
        lines.append(
            f"The depth shows whole scenes: the person was found in them first, at {number(run.extraction_fps)} frames per "
            "second, which the estimators' own frames per second leave out."
        )
    for estimator in run.started_from_label:
        lines.append(f"{estimator} was told the first true pose of every sequence (start=label).")
    if run.images_without_person:
        lines.append(f"{run.images_without_person} images show nobody; their joints count as missing.")
    lines += [f"Left out, because it failed: {name}: {reason}" for name, reason in run.failed.items()]
    if next(iter(run.metrics.values()))["interval"]["map_10cm"]:
        lines.append("In brackets: 95 % bootstrap intervals over sequences.")
    return lines


def terminal_table(run: Run, sweep: Sweep | None = None) -> str:
    """The headline, the joint groups and the sweep, for a terminal."""
    run, swept = _without_sweep(run, sweep), run
    tables = [headline_table(run), *group_tables(run)]
    if sweep:
        tables.append(sweep_table(swept, sweep))
    return "\n\n".join(["\n".join([identity(run), *remarks(run)]), *map(as_text, tables)]) + "\n"


def _without_sweep(run: Run, sweep: Sweep | None) -> Run:
    return run.only([name for name in run.metrics if sweep is None or name not in sweep.settings])


def metrics_json(run: Run, config: EvaluateConfig, pictures: list[str]) -> dict:
    """What metrics.json holds: the main estimator's figures, every estimator's under `estimators`, and what was judged.

    `images` is the number of evaluated frames; `pictures` lists the picture files; `mean_pose_error_cm` is the mean joint
    error of the constant mean pose, null where none is known. `benchmark` has seed, version and config_hash of a simulated
    set, null of a real one. `files` is what `EvaluateConfig.files` says.
    """
    resolved = asdict(config)
    canonical = json.dumps(resolved, sort_keys=True)
    main, figures = next(iter(run.metrics.items()))
    provenance = getattr(run.benchmark, "provenance", {})
    return {
        "estimator": main,
        **figures,
        "mean_pose_error_cm": run.metrics.get("mean_pose", {}).get("mean_error_cm"),
        "benchmark": {
            "name": run.benchmark.name,
            "depth": run.benchmark.origin.value,
            "against": run.benchmark.truth,
            "about": run.benchmark.about,
            **{key: provenance.get(key) for key in ("seed", "version", "config_hash")},
            "sequences": len(next(iter(run.scored.values())).sequence_names),
            "sequences_in_set": run.sequences_in_set,
            "failed_sequences": run.failed,
            "images_without_person": run.images_without_person,
            "unlike_training": run.unlike_training,
            "started_from_label": run.started_from_label,
            "extraction_fps": run.extraction_fps,
        },
        "estimators": run.metrics,
        "pictures": pictures,
        "files": config.files(),
        "config": resolved,
        "config_hash": hashlib.sha256(canonical.encode()).hexdigest()[:12],
        "git": git_revision(),
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def sweep_json(run: Run, sweep: Sweep) -> dict:
    """Table 1: by figure, rows of columns."""
    return {
        "estimator": sweep.estimator,
        **{axis: asdict(getattr(sweep.config, axis)) for axis in ("rows", "columns")},
        **{
            figure: [[run.metrics[name][figure] for name in names] for names in sweep.names]
            for figure in ("map_10cm", "mean_error_cm", "missing_joints", "fps")
        },
    }


def write_report(folder: Path, run: Run, config: EvaluateConfig, sweep: Sweep | None = None) -> None:
    """Writes pictures, metrics.json, report.md and report.html into the folder, which may be new.

    Args:
        folder: where.
        run: what came out, of the estimators of a sweep too.
        config: what was asked for.
        sweep: which of the run's estimators are one at other settings; they are only in the sweep's table and plot.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run, swept = _without_sweep(run, sweep), run
    listed, worst = listed_sequences(run), worst_sequence(run)
    plots = {"per_joint.png": joint_bars(run), "error_curve.png": error_curve(run)}
    if len(listed) > 1:
        plots["per_sequence.png"] = sequence_bars(run, sorted(listed, key=list(main_metrics(run)["per_sequence"]).index))
    if sweep:
        plots["sweep.png"] = sweep_plot(swept, sweep)
    for name, plot in plots.items():
        plot.savefig(folder / name, dpi=110)
    save_png(folder / "examples.png", examples_sheet(run, config.seed))
    save_png(folder / "worst.png", contact_sheet(run, worst))
    fps, pictures = film(run, worst)
    videos = ["worst.mp4"] if fps and save_video(folder / "worst.mp4", pictures, fps) else []
    described = metrics_json(run, config, ["examples.png", "worst.png", *plots, *videos])
    described["sweep"] = sweep_json(swept, sweep) if sweep else None
    blocks = report_blocks(run, described)
    if sweep:
        blocks += [
            ("heading", f"{sweep.estimator} at other settings (Table 1)"),
            ("table", sweep_table(swept, sweep)),
            ("picture", ("sweep.png", "Share within 10 cm and frames per second at every combination")),
        ]
    write_document(folder, blocks + how_made(described), described)


def main_metrics(run: Run) -> dict:
    return next(iter(run.metrics.values()))


def listed_sequences(run: Run) -> list[str]:
    """Sequences, those first of which the main estimator has the smallest share within 10 cm; not too many."""
    shares = {name: part["map_10cm"] for name, part in main_metrics(run)["per_sequence"].items()}
    ordered = sorted(shares, key=lambda name: 2.0 if shares[name] is None else shares[name])
    return ordered[:LONGEST_SEQUENCE_TABLE]


def report_blocks(run: Run, described: dict) -> list[Block]:
    """The report up to the sweep."""
    listed, pictures, main = listed_sequences(run), described["pictures"], described["estimator"]
    published = published_table(run)
    blocks: list[Block] = [
        ("title", f"kpopnet on {run.benchmark.name}"),
        ("text", identity(run)),
        *(("text", line) for line in remarks(run)),
        ("table", headline_table(run)),
        ("table", threshold_table(run)),
    ]
    if published[1]:
        blocks += [("text", "Papers on this benchmark; Kim & Kim leave out the neck."), ("table", published)]
    blocks += [
        ("heading", f"Example frames ({main})"),
        ("picture", ("examples.png", "Frames with true and estimated skeletons over the depth")),
        ("heading", "Joints"),
        *(("table", table) for table in group_tables(run)),
        ("picture", ("per_joint.png", "Mean error and share within 10 cm of each joint")),
        ("picture", ("error_curve.png", "Share of joints within a distance of the truth")),
    ]
    total = len(main_metrics(run)["per_sequence"])
    of_all = f", the {len(listed)} worst of {total}" if len(listed) < total else ", worst first"
    blocks += [
        ("heading", f"Sequences{of_all}"),
        ("text", "Error of visible joints (Eq. 16): mean and standard deviation."),
        ("table", sequence_table(run, listed)),
    ]
    if "per_sequence.png" in pictures:
        blocks.append(("picture", ("per_sequence.png", "Mean and standard deviation of the error in each sequence")))
    blocks += [
        ("heading", f"The worst sequence ({main})"),
        ("picture", ("worst.png", "Frames evenly spaced over it, with true and estimated skeletons")),
    ]
    if "worst.mp4" in pictures:
        blocks.append(("video", ("worst.mp4", "The same as a film")))
    if main_metrics(run)["by_yaw"]:
        blocks += [
            ("heading", "Where the person faces"),
            ("text", "Middles of eighths of the circle in degrees: 0 faces the camera, positive to the person's left."),
            ("table", yaw_table(run)),
        ]
    return blocks


def how_made(described: dict) -> list[Block]:
    """The report's end: from what it was made, and how speed was measured."""
    return [
        ("heading", "How this was made"),
        (
            "text",
            f"{files_in_words(described['files'])}; configuration {described['config_hash']}; code "
            f"{revision_in_words(described['git'])}; {described['made']}. All figures: metrics.json; their definitions: "
            "kpopnet/benchmarks/metrics.py.",
        ),
        (
            "text",
            "Frames per second are those of one core: all frames over all seconds of processor time in an estimator's calls, "
            "of the wall clock where a GPU works, after a warm-up that is not counted.",
        ),
    ]
