"""The report of an evaluation: a table for the terminal, metrics.json, pictures, report.md and report.html.

All of them say first whether the depth is real or simulated and what the joints are judged against.
"""

import hashlib
import json
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.document import Block, Table, as_html, as_markdown, as_text
from kpopnet.benchmarks.evaluation import EvaluateConfig, Run
from kpopnet.benchmarks.pictures import error_curve, examples_sheet, joint_bars
from kpopnet.benchmarks.sequences import Origin
from kpopnet.benchmarks.sweep import Sweep
from kpopnet.checkpoint import git_revision
from kpopnet.drawing import save_png

LONGEST_SEQUENCE_TABLE = 40
NOTHING = "-"

HEADLINE = (
    ("within 10 cm (mAP)", "map_10cm", "%"),
    ("mean error", "mean_error_cm", "cm"),
    ("median error", "median_error_cm", "cm"),
    ("mean error of visible joints (Eq. 16)", "average_pose_error_cm", "cm"),
    ("the same, constant offsets taken out", "average_pose_error_no_offset_cm", "cm"),
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
    header = ["", *run.metrics]
    rows = [[title, *(_with_interval(m, key, unit) for m in run.metrics.values())] for title, key, unit in HEADLINE]
    return header, rows


def group_table(run: Run) -> Table:
    header = ["joints", *(f"{name}, {what}" for name in run.metrics for what in ("within 10 cm", "mean error"))]
    first = next(iter(run.metrics.values()))
    rows = [
        [
            group,
            *(
                number(m["per_group"][group][key], unit)
                for m in run.metrics.values()
                for key, unit in (("map_10cm", "%"), ("mean_error_cm", "cm"))
            ),
        ]
        for group in first["per_group"]
    ]
    return header, rows


def _main_table(run: Run, part: str, title: str, rows: list[str]) -> Table:
    metrics = next(iter(run.metrics.values()))[part]
    header = [title, "images", "within 10 cm", "mean error", "median error", "visible joints (Eq. 16)", "missing"]
    keys = ("mean_error_cm", "median_error_cm", "average_pose_error_cm")
    return header, [
        [
            row,
            number(metrics[row]["images"]),
            number(metrics[row]["map_10cm"], "%"),
            *(number(metrics[row][key], "cm") for key in keys),
            number(metrics[row]["missing_joints"]),
        ]
        for row in rows
    ]


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
    if run.images_without_person:
        lines.append(f"{run.images_without_person} images show nobody; their joints count as missing.")
    lines += [f"Left out, because it failed: {name}: {reason}" for name, reason in run.failed.items()]
    if next(iter(run.metrics.values()))["interval"]["map_10cm"]:
        lines.append("In brackets: 95 % bootstrap intervals over sequences.")
    return lines


def terminal_table(run: Run) -> str:
    """The headline and the joint groups, for a terminal."""
    parts = [identity(run), *remarks(run)]
    for table in (headline_table(run), group_table(run)):
        parts += ["", as_text(table)]
    return "\n".join(parts) + "\n"


def metrics_json(run: Run, config: EvaluateConfig, pictures: list[str]) -> dict:
    """What metrics.json holds: the main estimator's figures, every estimator's under `estimators`, and what was judged.

    `images` is the number of evaluated frames; `pictures` lists the picture files; `mean_pose_error_cm` is the mean joint
    error of the constant mean pose, null where none is known.
    """
    resolved = asdict(config)
    canonical = json.dumps(resolved, sort_keys=True)
    main, figures = next(iter(run.metrics.items()))
    return {
        "estimator": main,
        **figures,
        "mean_pose_error_cm": run.metrics.get("mean_pose", {}).get("mean_error_cm"),
        "benchmark": {
            "name": run.benchmark.name,
            "depth": run.benchmark.origin.value,
            "against": run.benchmark.truth,
            "about": run.benchmark.about,
            "sequences": len(next(iter(run.scored.values())).sequence_names),
            "sequences_in_set": run.sequences_in_set,
            "failed_sequences": run.failed,
            "images_without_person": run.images_without_person,
            "unlike_training": run.unlike_training,
            "extraction_fps": run.extraction_fps,
        },
        "estimators": run.metrics,
        "pictures": pictures,
        "checkpoint": config.checkpoint,
        "config": resolved,
        "config_hash": hashlib.sha256(canonical.encode()).hexdigest()[:12],
        "git": git_revision(),
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def write_report(folder: Path, run: Run, config: EvaluateConfig, sweep: Sweep | None = None) -> None:
    """Writes pictures, metrics.json, report.md and report.html into the folder, which may be new."""
    folder.mkdir(parents=True, exist_ok=True)
    joint_bars(run).savefig(folder / "per_joint.png", dpi=110)
    error_curve(run).savefig(folder / "error_curve.png", dpi=110)
    save_png(folder / "examples.png", examples_sheet(run, config.seed))
    pictures = ["examples.png", "per_joint.png", "error_curve.png"]
    described = metrics_json(run, config, pictures)
    (folder / "metrics.json").write_text(json.dumps(described, indent=2, allow_nan=False) + "\n")
    blocks = report_blocks(run, described)
    (folder / "report.md").write_text(as_markdown(blocks))
    (folder / "report.html").write_text(as_html(blocks, title=f"kpopnet on {run.benchmark.name}"))


def report_blocks(run: Run, described: dict) -> list[Block]:
    main = next(iter(run.metrics.values()))
    errors = {name: figures["mean_error_cm"] for name, figures in main["per_sequence"].items()}
    sequences = sorted(errors, key=lambda name: -np.inf if errors[name] is None else -errors[name])
    shown = sequences[:LONGEST_SEQUENCE_TABLE]
    blocks: list[Block] = [
        ("title", f"kpopnet on {run.benchmark.name}"),
        ("text", identity(run)),
        *(("text", line) for line in remarks(run)),
        ("table", headline_table(run)),
        ("heading", "Example frames"),
        ("picture", ("examples.png", "Frames with true and estimated skeletons over the depth")),
        ("heading", "Joints"),
        ("table", group_table(run)),
        ("picture", ("per_joint.png", "Mean error and share within 10 cm of each joint")),
        ("picture", ("error_curve.png", "Share of joints within a distance of the truth")),
    ]
    if main["by_yaw"]:
        blocks += [
            ("heading", f"Where the person faces ({described['estimator']})"),
            ("text", "Middles of eighths of the circle in degrees: 0 faces the camera, positive to the person's left."),
            ("table", _main_table(run, "by_yaw", "heading", list(main["by_yaw"]))),
        ]
    of_all = f", the {len(shown)} worst of {len(sequences)}" if len(shown) < len(sequences) else ", worst first"
    git = described["git"]
    revision = f"{git['revision'][:12]}{' with changes' if git['dirty'] else ''}" if git else "unknown"
    blocks += [
        ("heading", f"Sequences{of_all} ({described['estimator']})"),
        ("table", _main_table(run, "per_sequence", "sequence", shown)),
        ("heading", "How this was made"),
        (
            "text",
            f"Checkpoint {described['checkpoint'] or 'none'}; configuration {described['config_hash']}; code "
            f"{revision}; {described['made']}. All figures: metrics.json; their definitions: "
            "kpopnet/benchmarks/metrics.py.",
        ),
    ]
    return blocks
