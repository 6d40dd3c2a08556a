"""Report on everybody in films of several people: joints and identities by kind of scene, pictures and a film."""

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from kpopnet.datasets.simulated import PeopleSet
from kpopnet.errors import InputError
from kpopnet.evaluation.blocks import Block, Table
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.document import as_text, describe_files, describe_revision, printable, write_document
from kpopnet.evaluation.intervals import FEWEST_UNITS
from kpopnet.evaluation.people.matching import MatchedSequence
from kpopnet.evaluation.people.pictures import film, people_sheet, row
from kpopnet.evaluation.people.run import ALL, PeopleRun, figures, run_people
from kpopnet.evaluation.poses.report.tables import format_value
from kpopnet.evaluation.poses.report.worst_sequences import save_video
from kpopnet.extraction import HumanExtractionConfig
from kpopnet.runtime.provenance import git_revision
from kpopnet.viz.drawing import save_png

SHEET_SEQUENCES = 6
FILM_STEP = 2

DEFINITIONS = (
    "Joints: share within 10 cm of all joints of people who are seen, where a person who is not found counts as fifteen missed "
    "joints; mean error of those found. Hidden: the same for people of whom others hide more than half; they count in nothing "
    "else, nor does who is cut by the border. Missed: share of the people seen who were not found. False: estimates, image by "
    "image, that are nobody's. Switches: people who get another identity. MOTA, and the way people and estimates are matched: "
    "CLEAR MOT (Bernardin & Stiefelhagen 2008), within a mean joint distance of 50 cm. IDF1 (Ristani et al. 2016) is "
    "taken over the same matches."
)


def evaluate_people(config: EvaluateConfig, folder: Path) -> None:
    """Judges everybody found in films of several people, and reports into the folder.

    Raises:
        InputError: a setting is for other benchmarks, or see `run_people`.
    """
    if config.scorer or config.sweep is not None:
        raise InputError(f"benchmark={config.benchmark.name}: scorer and sweep are for other benchmarks; leave them out")
    if config.extraction != HumanExtractionConfig():
        raise InputError(
            f"benchmark={config.benchmark.name}: extraction.* is not used by estimators of several people; leave it out"
        )
    benchmark = PeopleSet(config.benchmark)
    run = run_people(benchmark, config.estimator, config.sequences, config.seed, config.processes_at_work())
    write_people_report(folder, run, config)
    tables = [as_text(table) for table in (main_table(run), identity_table(run))]
    print(printable("\n\n".join(["\n".join([identity(run), *remarks(run)]), *tables]) + "\n"))


def identity(run: PeopleRun) -> str:
    """One sentence: the set, the origin of its depth and of the true joints, and its size."""
    evaluated, total = len(next(iter(run.matched.values()))), len(run.benchmark.names)
    part = "" if evaluated == total else f" of {total}"
    return f"two_people: SIMULATED depth, compared with synthetic truth; {evaluated}{part} sequences."


def remarks(run: PeopleRun) -> list[str]:
    """What is needed to interpret the figures."""
    lines = [run.benchmark.about, "No real sensor recorded this depth: these results do not predict the errors on real depth."]
    lines += [f"Left out because of an error: {name}: {reason}" for name, reason in run.failed.items()]
    count = len(next(iter(run.matched.values())))
    if count < 2:
        return [*lines, "No intervals: they would resample sequences, and there is only one."]
    lines.append(f"Ranges in parentheses: 95 % bootstrap intervals; {count} sequences were resampled, in a row its own.")
    fewest = min(one["sequences"] for one in next(iter(run.figures.values())).values())
    if fewest < FEWEST_UNITS:
        lines.append(f"Intervals of fewer than {FEWEST_UNITS} sequences cannot be trusted; some rows have {fewest}.")
    return lines


def _with_interval(one: dict, name: str, unit: str) -> str:
    interval = one["interval"][name]
    scale, digits = (100, 1) if unit == "%" else (1, 2)
    between = f" ({scale * interval[0]:.{digits}f} to {scale * interval[1]:.{digits}f})" if interval else ""
    return format_value(one[name], unit) + between


def main_table(run: PeopleRun) -> Table:
    """Joints by estimator and kind of scene."""
    header = ["estimator", "scene", "sequences", "within 10 cm", "mean error", "hidden: within 10 cm", "hidden: mean error"]
    rows = [
        [
            label,
            kind,
            str(one["sequences"]),
            _with_interval(one, "within_10cm", "%"),
            _with_interval(one, "mean_error_cm", "cm"),
            format_value(one["hidden_within_10cm"], "%"),
            format_value(one["hidden_mean_error_cm"], "cm"),
        ]
        for label, kinds in run.figures.items()
        for kind, one in kinds.items()
    ]
    return header, rows


def identity_table(run: PeopleRun) -> Table:
    """Who was missed, seen though not there, or exchanged, by estimator and kind of scene."""
    header = ["estimator", "scene", "people seen", "missed", "false", "switches", "MOTA", "IDF1", "images a second"]
    rows = [
        [
            label,
            kind,
            f"{one['seen']:,}",
            _with_interval(one, "missed", "%"),
            str(one["false"]),
            str(one["switches"]),
            format_value(one["mota"], "%"),
            format_value(one["idf1"], "%"),
            format_value(one["fps"]),
        ]
        for label, kinds in run.figures.items()
        for kind, one in kinds.items()
    ]
    return header, rows


def write_people_report(folder: Path, run: PeopleRun, config: EvaluateConfig) -> None:
    """Writes the report with pictures, a film of the worst sequence, tables and metrics.json into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    label, parts = next(iter(run.matched.items()))
    listed, worst = _one_of_each(parts), min(parts, key=_within)
    rows = [row(run.benchmark.read(part.name), part) for part in listed]
    save_png(folder / "people.png", people_sheet(rows, f"SIMULATED, two_people, {label}"))
    sequence = run.benchmark.read(worst.name)
    filmed = save_video(folder / "worst.mp4", film(sequence, worst, FILM_STEP), sequence.fps / FILM_STEP)
    metrics = metrics_json(run, config)
    blocks: list[Block] = [
        ("title", "kpopnet on two_people"),
        ("text", identity(run)),
        *(("text", line) for line in remarks(run)),
        ("heading", "Joints"),
        ("table", main_table(run)),
        ("heading", "Identities"),
        ("table", identity_table(run)),
        ("text", DEFINITIONS),
        ("heading", f"Sequences ({label})"),
        ("figure", ("people.png", "Frames of a sequence of each kind: depth, true joints in white, identities in colours")),
        ("table", sequence_table(parts)),
        *([("video", ("worst.mp4", f"Film of the worst sequence, {worst.name}: {worst.kind}"))] if filmed else []),
        ("heading", "How this report was made"),
        (
            "text",
            f"{describe_files(metrics['files'])}; code {describe_revision(metrics['git'])}; {metrics['made']}. Images a second "
            "are those of one core, with the extraction and everybody in view.",
        ),
    ]
    write_document(folder, blocks, metrics)


def sequence_table(parts: list[MatchedSequence]) -> Table:
    """The figures of each sequence by itself."""
    header = ["sequence", "scene", "within 10 cm", "mean error", "missed", "false", "switches"]
    rows = []
    for part in parts:
        one = figures([part], 0)
        cells = [
            format_value(one[name], unit) for name, unit in (("within_10cm", "%"), ("mean_error_cm", "cm"), ("missed", "%"))
        ]
        rows.append([part.name, part.kind, *cells, str(one["false"]), str(one["switches"])])
    return header, rows


def metrics_json(run: PeopleRun, config: EvaluateConfig) -> dict:
    """Contents of metrics.json: `figures` of every estimator by kind of scene, and those of the first over all on top."""
    main, by_kind = next(iter(run.figures.items()))
    return {
        "estimator": main,
        **by_kind[ALL],
        "benchmark": {
            "name": config.benchmark.name,
            "depth": "simulated",
            "about": run.benchmark.about,
            **run.benchmark.provenance,
            "sequences": len(next(iter(run.matched.values()))),
            "sequences_in_set": len(run.benchmark.names),
            "failed_sequences": run.failed,
        },
        "estimators": run.figures,
        "files": config.files(),
        "config": asdict(config),
        "git": git_revision(),
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _within(part: MatchedSequence) -> float:
    within = figures([part], 0)["within_10cm"]
    return 2.0 if within is None else within


def _one_of_each(parts: list[MatchedSequence]) -> list[MatchedSequence]:
    """The first sequence of each kind, at most SHEET_SEQUENCES."""
    return list({part.kind: part for part in reversed(parts)}.values())[::-1][:SHEET_SEQUENCES]
