"""The report of a dance evaluation: the paper's Table 2, how far scores agree with the experts, and where they do not."""

import csv
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from kpopnet.benchmarks.document import Block, Table, as_text, files_in_words, revision_in_words, write_document
from kpopnet.benchmarks.evaluation import EvaluateConfig
from kpopnet.benchmarks.kpop import KpopConfig, open_set
from kpopnet.benchmarks.kpop_evaluation import DanceRun, run_dances
from kpopnet.benchmarks.kpop_pictures import least_ordered, score_by_rank, timelines
from kpopnet.benchmarks.kpop_scores import TRUTH, confusions, is_ordered, similarities
from kpopnet.benchmarks.sequences import Origin
from kpopnet.checkpoint import git_revision
from kpopnet.dance.scoring import SCORERS
from kpopnet.errors import InputError

SHOWN_CONFUSIONS = 30
WRONG = " ✗"
MAIN_SCORER = "dance22"


def evaluate_dances(config: EvaluateConfig, folder: Path) -> None:
    """Scores the learners of a set of dances, and reports into the folder.

    Raises:
        InputError: what only benchmarks of joints have is asked for, a dance that will not be scored is to be drawn, or see
            `run_dances`.
    """
    if config.sweep is not None or config.sequences is not None:
        given = "sweep" if config.sweep is not None else f"sequences={config.sequences}"
        raise InputError(
            f"{given}: benchmark={config.benchmark.name} judges dances, not sequences of joints; a quick look is "
            "benchmark.dances=10"
        )
    dances = open_set(config.benchmark)
    _check_drawn(config.benchmark, dances.names)
    run = run_dances(
        dances,
        config.estimator,
        config.scorer or SCORERS,
        Path(config.benchmark.poses or dances.folder / "poses"),
        config.benchmark.dances,
        config.seed,
        config.processes_at_work(),
    )
    write_dance_report(folder, run, config)
    print("\n".join([identity(run), *remarks(run), "", as_text(agreement_table(run)), ""]))


def write_dance_report(folder: Path, run: DanceRun, config: EvaluateConfig) -> None:
    """Writes pictures, table_2.csv, metrics.json, report.md and report.html into the folder, which may be new.

    Where the dance that is to be drawn failed, another is, and the report says so.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scorer = main_scorer(run)
    main = main_source(run)
    shown = config.benchmark.dance
    if shown not in run.scores[main][scorer]:
        shown = least_ordered(run, main, scorer)
    score_by_rank(run).savefig(folder / "score_by_rank.png", dpi=110)
    timelines(run, shown, scorer).savefig(folder / "timelines.png", dpi=110)
    write_table_2(folder / "table_2.csv", run)
    described = metrics_json(run, config)
    write_document(folder, report_blocks(run, shown, described), described)


def _check_drawn(benchmark: KpopConfig, names: list[str]) -> None:
    """Refuses a dance to draw that will not be scored, before hours are spent on the others."""
    chosen = names[: benchmark.dances]
    if benchmark.dance is None or benchmark.dance in chosen:
        return
    what_to_do = "raise benchmark.dances" if benchmark.dance in names else f"there are {', '.join(chosen[:5])}, ..."
    raise InputError(
        f"benchmark.dance={benchmark.dance}: not among the {len(chosen)} dances that are to be scored; {what_to_do}"
    )


def main_scorer(run: DanceRun) -> str:
    scorers = list(next(iter(run.scores.values())))
    return MAIN_SCORER if MAIN_SCORER in scorers else scorers[0]


def main_source(run: DanceRun) -> str:
    """The first estimator, or the true joints where there is none."""
    return next((source for source in run.scores if source != TRUTH), TRUTH)


def identity(run: DanceRun) -> str:
    """One sentence: what was judged on what, and against what."""
    manifest = run.dances.manifest
    scored = len(next(iter(next(iter(run.scores.values())).values())))
    whole = manifest.dances or len(run.dances)
    part = "" if scored == whole else f" of {whole}"
    simulated = manifest.origin is Origin.SIMULATED
    judges = "the levels by which they were simulated" if simulated else "the set's labels"
    return f"{manifest.name}: {manifest.origin.value.upper()} learners of {scored}{part} dances, judged against {judges}."


def remarks(run: DanceRun) -> list[str]:
    """What a reader must know to read the figures rightly."""
    manifest = run.dances.manifest
    lines = [manifest.about]
    if manifest.origin is Origin.SIMULATED:
        lines.append(
            "Learners and labels come from a model of skill: the figures compare scorers and estimators with each other and "
            "say nothing certain about experts and real dancers. Its difficulty was set beforehand so that the feature of "
            "[17] on true joints orders about 86 of 100 other dances, as in the paper (docs/ledger.md)."
        )
    lines += run.assumed
    if len(run.evaluated) < (manifest.dances or len(run.dances)):
        lines.append(f"A quick look: {len(run.evaluated)} dances; no score of the set.")
    lines += [f"Left out: {name}: {reason}" for name, reason in run.failed.items()]
    lines.append(
        "Concordance: dances, of 100, whose scores fall strictly from the best learner to the worst; a tie is a failure. "
        "Kendall's tau: pairs of a dance's learners in the right order less those in the wrong one, as a share. In "
        "brackets: 95 % bootstrap intervals over dances."
    )
    return lines


def agreement_table(run: DanceRun) -> Table:
    header = ["joints", "scorer", "concordance", "Kendall's tau", "joint error", "frames per second"]
    rows = []
    for source, by_scorer in run.agreements.items():
        for scorer, one in by_scorer.items():
            low, high = one.interval["concordance"]
            tau_low, tau_high = one.interval["kendall_tau"]
            error_m, fps = mean_error_m(run, source), run.fps.get(source)
            rows.append(
                [
                    source,
                    scorer,
                    f"{one.concordance:.0f} ({low:.0f} to {high:.0f})",
                    f"{one.kendall_tau:.3f} ({tau_low:.3f} to {tau_high:.3f})",
                    "-" if error_m is None else f"{100 * error_m:.1f} cm",
                    "-" if fps is None else f"{fps:.0f}",
                ]
            )
    return header, rows


def mean_error_m(run: DanceRun, source: str) -> float | None:
    """Mean over learners of the mean distance of found joints from true ones."""
    by_dance = next(iter(run.scores[source].values()))
    errors_m = [one.error_m for learners in by_dance.values() for one in learners if one.error_m is not None]
    return sum(errors_m) / len(errors_m) if errors_m else None


def _columns(run: DanceRun) -> list[tuple[str, str]]:
    return [(scorer, source) for scorer in next(iter(run.scores.values())) for source in run.scores]


def table_2(run: DanceRun) -> Table:
    """As the paper's: four scores a dance and method, marked where they are not in the experts' order."""
    columns = _columns(run)
    dances = next(iter(next(iter(run.scores.values())).values()))
    rows = []
    for name in dances:
        cells = []
        for scorer, source in columns:
            scores = similarities(run.scores[source][scorer][name])
            cells.append("  ".join(f"{score:.1f}" for score in scores) + ("" if is_ordered(scores) else WRONG))
        rows.append([name, *cells])
    return ["dance", *(f"{scorer}, {source}" for scorer, source in columns)], rows


def write_table_2(path: Path, run: DanceRun) -> None:
    """Every score, with its timing and posture, a line a learner."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["dance", "rank", "learner", "scorer", "joints", "similarity", "timing", "posture", "error_cm"])
        for scorer, source in _columns(run):
            for dance, learners in run.scores[source][scorer].items():
                for rank, one in enumerate(learners, 1):
                    figures = (one.score.similarity, one.score.timing, one.score.posture)
                    error = "" if one.error_m is None else f"{100 * one.error_m:.2f}"
                    row = [dance, rank, one.name, scorer, source, *(f"{value:.4f}" for value in figures), error]
                    writer.writerow(row)


def confusion_blocks(run: DanceRun, source: str, scorer: str) -> list[Block]:
    """The pairs of learners in the wrong order, of many the widest apart alone."""
    truth = run.scores[TRUTH][scorer] if TRUTH in run.scores and source != TRUTH else None
    found = confusions(run.scores[source][scorer], truth)
    heading: Block = ("heading", f"Learners confused on {source} by {scorer}")
    if not found:
        return [heading, ("text", "None.")]
    header = ["dance", "ranks", "similarity", "timing", "posture", "joint error, cm", "why"]
    rows = []
    for pair in found[:SHOWN_CONFUSIONS]:
        both = pair.better, pair.worse
        figures = [
            " / ".join(f"{getattr(one.score, what):.1f}" for one in both) for what in ("similarity", "timing", "posture")
        ]
        errors = " / ".join("-" if one.error_m is None else f"{100 * one.error_m:.1f}" for one in both)
        rows.append([pair.dance, f"{pair.ranks[0]} and {pair.ranks[1]}", *figures, errors, pair.why])
    cut = f"{SHOWN_CONFUSIONS} of {len(found)} pairs, the widest apart first."
    return [heading, *([("text", cut)] if len(found) > len(rows) else []), ("table", (header, rows))]


def metrics_json(run: DanceRun, config: EvaluateConfig) -> dict:
    """What metrics.json holds: per source of joints the concordance by the main scorer, and by every one of them.

    The first estimator's figures stand at the top as well.
    """
    scorer, manifest = main_scorer(run), run.dances.manifest
    sources = {}
    for source, by_scorer in run.agreements.items():
        each = {
            name: {"concordance": one.concordance, "kendall_tau": one.kendall_tau, "interval": one.interval}
            | {"wrong": one.wrong}
            for name, one in by_scorer.items()
        }
        error_m = mean_error_m(run, source)
        sources[source] = each[scorer] | {
            "mean_error_cm": None if error_m is None else 100 * error_m,
            "fps": run.fps.get(source),
            "scorers": each,
        }
    main = main_source(run)
    return {
        "estimator": main,
        "scorer": scorer,
        **sources[main],
        "benchmark": {
            "name": manifest.name,
            "origin": manifest.origin.value,
            "about": manifest.about,
            "hash": manifest.hash,
            "dances": len(next(iter(next(iter(run.scores.values())).values()))),
            "dances_in_set": manifest.dances or len(run.dances),
            "failed_dances": run.failed,
        },
        "estimators": sources,
        "files": config.files(),
        "config": asdict(config),
        "git": git_revision(),
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def report_blocks(run: DanceRun, shown: str, described: dict) -> list[Block]:
    scorer = main_scorer(run)
    blocks: list[Block] = [
        ("title", f"kpopnet on {run.dances.manifest.name}"),
        ("text", identity(run)),
        *(("text", line) for line in remarks(run)),
        ("table", agreement_table(run)),
        ("heading", "Scores by the experts' order"),
        ("picture", ("score_by_rank.png", "Scores over the experts' rank, a line a dance, red where the order is wrong")),
    ]
    for source in run.scores:
        for name in run.scores[source]:
            blocks += confusion_blocks(run, source, name)
    asked = described["config"]["benchmark"]["dance"]
    failed = f"benchmark.dance={asked} failed and cannot be drawn; this is the dance whose scores are least in order."
    blocks += [
        ("heading", f"{shown} over time"),
        *([("text", failed)] if asked not in (None, shown) else []),
        ("text", "Windows of the learner's dance, by when they start. Another dance: benchmark.dance=NAME."),
        ("picture", ("timelines.png", f"Similarity, posture and delay of each learner of {shown} over time, by {scorer}")),
        ("heading", "Table 2"),
        (
            "text",
            f"Scores from the experts' best learner to the worst;{WRONG} marks another order. All figures: table_2.csv.",
        ),
        ("table", table_2(run)),
        ("heading", "How this was made"),
        (
            "text",
            f"{files_in_words(described['files'])}; code {revision_in_words(described['git'])}; {described['made']}. "
            "Figures: metrics.json.",
        ),
    ]
    return blocks
