"""Report of a dance evaluation: the paper's Table 2, agreement with the experts, and learners in the wrong order."""

import csv
import math
from dataclasses import asdict
from datetime import UTC, datetime
from itertools import combinations, zip_longest
from pathlib import Path

import numpy as np

from kpopnet.dance.scoring import SCORERS
from kpopnet.datasets.dances.dance_set import KpopConfig, open_set
from kpopnet.datasets.protocol import Origin
from kpopnet.errors import InputError
from kpopnet.evaluation.blocks import Block, Table
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.dances.figures import score_by_rank, timelines, worst_ordered_dance
from kpopnet.evaluation.dances.oracle import ORACLES
from kpopnet.evaluation.dances.ranking import TRUTH, confusions, is_ordered, paired_p_value, similarities
from kpopnet.evaluation.dances.run import MAIN_SCORER, DanceRun, run_dances
from kpopnet.evaluation.document import as_text, describe_files, describe_revision, printable, write_document
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.runtime.provenance import git_revision

MAX_LISTED_CONFUSIONS = 30
WRONG_ORDER_MARK = " ✗"


def evaluate_dances(config: EvaluateConfig, folder: Path) -> None:
    """Scores the learners of a set of dances, and writes the report into the folder.

    Raises:
        InputError: a setting applies to benchmarks of joints only, the dance to be plotted is not among the scored ones, or
            see `run_dances`.
    """
    if config.sweep is not None or config.sequences is not None:
        given = "sweep" if config.sweep is not None else f"sequences={config.sequences}"
        raise InputError(
            f"{given}: benchmark={config.benchmark.name} evaluates dances, not joints in sequences; for a quick test use "
            "benchmark.dances=10"
        )
    dances = open_set(config.benchmark)
    _check_plotted_dance(config.benchmark, dances.names)
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
    tables = (as_text(table) for table in tables_of(run))
    print(printable("\n".join([identity(run), *remarks(run), "", "\n\n".join(tables), ""])))


def write_dance_report(folder: Path, run: DanceRun, config: EvaluateConfig) -> None:
    """Writes the report with its figures, tables, table_2.csv and metrics.json into the folder, and creates it if necessary.

    If the dance to be plotted failed, another dance is plotted, and the report states it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scorer = main_scorer(run)
    main = main_source(run)
    plotted = config.benchmark.dance
    if plotted not in run.scores[main][scorer]:
        plotted = worst_ordered_dance(run, main, scorer)
    for name, plot in (("score_by_rank", score_by_rank(run)), ("timelines", timelines(run, plotted, scorer))):
        plot.savefig(folder / f"{name}.png", dpi=110)
        plot.savefig(folder / f"{name}.svg")
    write_table_2(folder / "table_2.csv", run)
    metrics = metrics_json(run, config)
    write_document(folder, report_blocks(run, plotted, metrics), metrics)


def _check_plotted_dance(benchmark: KpopConfig, names: list[str]) -> None:
    """Checks before the evaluation, which can take hours, that the dance to be plotted will be scored.

    Raises:
        InputError: it is not among the chosen dances.
    """
    chosen = names[: benchmark.dances]
    if benchmark.dance is None or benchmark.dance in chosen:
        return
    remedy = "raise benchmark.dances" if benchmark.dance in names else f"there are {', '.join(chosen[:5])}, ..."
    raise InputError(f"benchmark.dance={benchmark.dance}: not among the {len(chosen)} dances to be scored; {remedy}")


def main_scorer(run: DanceRun) -> str:
    """MAIN_SCORER if it was used, otherwise the first scorer."""
    scorers = list(next(iter(run.scores.values())))
    return MAIN_SCORER if MAIN_SCORER in scorers else scorers[0]


def main_source(run: DanceRun) -> str:
    """The first estimator, or the true joints if there is no estimator."""
    return next((source for source in run.scores if source != TRUTH), TRUTH)


def identity(run: DanceRun) -> str:
    """One sentence: the set, the origin of its learners, the number of dances, and the origin of the ranking."""
    manifest = run.dances.manifest
    scored = len(next(iter(next(iter(run.scores.values())).values())))
    total = manifest.dances or len(run.dances)
    part = "" if scored == total else f" of {total}"
    simulated = manifest.origin is Origin.SIMULATED
    ranking = "the simulated skill levels" if simulated else "the labels of the set"
    return f"{manifest.name}: {manifest.origin.value.upper()} learners of {scored}{part} dances, compared with {ranking}."


def remarks(run: DanceRun) -> list[str]:
    """Notes that are needed to interpret the metrics."""
    manifest = run.dances.manifest
    lines = [manifest.about]
    if manifest.origin is Origin.SIMULATED:
        lines.append(
            "Learners and labels are simulated with a model of skill or of faults. The results compare scorers and estimators "
            "with each other; they do not predict the agreement with experts on real dancers. The difficulty of the set was "
            "chosen such that the feature of [17] on true joints puts about 86 of 100 other dances in the right order, as in "
            "the paper. Earlier looks at dances of other seeds: docs/ledger.md."
        )
    lines += run.assumptions
    if len(run.evaluated) < (manifest.dances or len(run.dances)):
        lines.append(f"Partial evaluation: {len(run.evaluated)} dances; not a result on the whole set.")
    lines += [f"Left out because of an error: {name}: {reason}" for name, reason in run.failed.items()]
    lines.append(
        "Concordance: percentage of dances whose scores decrease strictly from the best learner to the worst; a tie is a "
        "failure. Kendall's tau: (pairs of learners in the right order - pairs in the wrong order) / all pairs of a dance, "
        "mean over dances. Ranges in parentheses: 95 % intervals, of the concordance by Wilson, of tau by a bootstrap over "
        "dances. p of a pair of scorers: exact test of McNemar on the same dances. Scores by rank: mean (lowest to highest) of "
        "the main scorer. True arms, legs, torso, turning: dances in order if the estimator had seen that part as it was."
    )
    return lines


def agreement_table(run: DanceRun) -> Table:
    """Concordance, tau, joint error and speed by source of joints and scorer."""
    header = ["joints", "scorer", "concordance", "Kendall's tau", "joint error", "frames per second"]
    rows = []
    for source, by_scorer in run.agreements.items():
        for scorer, one in by_scorer.items():
            error_m, fps = mean_error_m(run, source), run.fps.get(source)
            rows.append(
                [
                    source,
                    scorer,
                    _with_interval(one.concordance, one.interval["concordance"], 0),
                    _with_interval(one.kendall_tau, one.interval["kendall_tau"], 3),
                    "-" if error_m is None else f"{100 * error_m:.1f} cm",
                    "-" if fps is None else f"{fps:.0f}",
                ]
            )
    return header, rows


def _with_interval(value: float, interval: list[float] | None, digits: int) -> str:
    """A figure with its interval, where there is one."""
    between = f" ({interval[0]:.{digits}f} to {interval[1]:.{digits}f})" if interval else ""
    return f"{value:.{digits}f}{between}"


def paired_table(run: DanceRun) -> Table:
    """Pairs of scorers on the same joints: dances that only the one orders, and the p-value of their difference."""
    rows = []
    for source, by_scorer in run.agreements.items():
        for (first, one), (second, other) in combinations(by_scorer.items(), 2):
            only = [str(len(set(b.wrong) - set(a.wrong))) for a, b in ((one, other), (other, one))]
            rows.append([source, f"{first}, {second}", " and ".join(only), f"{paired_p_value(one, other):.3f}"])
    return ["joints", "scorers", "dances in order by one of them only", "p"], rows


def rank_table(run: DanceRun) -> Table:
    """Mean score of the learners of each rank by the main scorer, and the lowest and highest."""
    scorer, rows = main_scorer(run), []
    for source, by_scorer in run.scores.items():
        by_rank = zip_longest(*(similarities(learners) for learners in by_scorer[scorer].values()), fillvalue=math.nan)
        known = ([score for score in scores if math.isfinite(score)] for scores in by_rank)
        rows.append([source, *(f"{np.mean(one):.0f} ({min(one):.0f} to {max(one):.0f})" if one else "-" for one in known)])
    return ["joints", *(f"rank {rank}" for rank in range(1, max(map(len, rows))))], rows


def oracle_table(run: DanceRun) -> Table:
    """Dances in order by the main scorer, as estimated and with the true angles of one part of the body at a time."""
    rows = []
    for source, by_part in run.oracle.items():
        dances = run.scores[source][MAIN_SCORER]
        ordered = len(dances) - len(run.agreements[source][MAIN_SCORER].wrong)
        rows.append([source, f"{ordered} of {len(dances)}", *(str(len(names)) for names in by_part.values())])
    return ["joints", "as estimated", *(f"true {part}" for part in ORACLES)], rows


def tables_of(run: DanceRun) -> list[Table]:
    """The tables of the report that say something, the agreement first."""
    tables = agreement_table(run), rank_table(run), oracle_table(run), paired_table(run)
    return [table for table in tables if table[1]]


def mean_error_m(run: DanceRun, source: str) -> float | None:
    """Mean over learners of the mean distance of the found joints from the true joints, in metres; None if unknown."""
    by_dance = next(iter(run.scores[source].values()))
    errors_m = [one.error_m for learners in by_dance.values() for one in learners if one.error_m is not None]
    return sum(errors_m) / len(errors_m) if errors_m else None


def _columns(run: DanceRun) -> list[tuple[str, str]]:
    """(scorer, source of joints) of each column of Table 2."""
    return [(scorer, source) for scorer in next(iter(run.scores.values())) for source in run.scores]


def table_2(run: DanceRun) -> Table:
    """The paper's Table 2: the scores of all learners of a dance by each method, marked if in the wrong order."""
    columns = _columns(run)
    dances = next(iter(next(iter(run.scores.values())).values()))
    rows = []
    for name in dances:
        cells = []
        for scorer, source in columns:
            scores = similarities(run.scores[source][scorer][name])
            cells.append("  ".join(f"{score:.1f}" for score in scores) + ("" if is_ordered(scores) else WRONG_ORDER_MARK))
        rows.append([name, *cells])
    return ["dance", *(f"{scorer}, {source}" for scorer, source in columns)], rows


def write_table_2(path: Path, run: DanceRun) -> None:
    """Writes similarity, timing and posture score of every learner, one line per learner, scorer and source of joints."""
    with atomic_path(path) as part, part.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file:
        writer = csv.writer(file)
        writer.writerow(["dance", "rank", "learner", "scorer", "joints", "similarity", "timing", "posture", "error_cm"])
        for scorer, source in _columns(run):
            for dance, learners in run.scores[source][scorer].items():
                for rank, one in enumerate(learners, 1):
                    scores = (one.score.similarity, one.score.timing, one.score.posture)
                    error = "" if one.error_m is None else f"{100 * one.error_m:.2f}"
                    row = [dance, rank, one.name, scorer, source, *(f"{value:.4f}" for value in scores), error]
                    writer.writerow(row)


def confusion_blocks(run: DanceRun, source: str, scorer: str) -> list[Block]:
    """The MAX_LISTED_CONFUSIONS pairs of learners in the wrong order with the largest difference of scores."""
    truth = run.scores[TRUTH][scorer] if TRUTH in run.scores and source != TRUTH else None
    pairs = confusions(run.scores[source][scorer], truth)
    heading: Block = ("heading", f"Learners in the wrong order: joints {source}, scorer {scorer}")
    if not pairs:
        return [heading, ("text", "None.")]
    header = ["dance", "ranks", "similarity", "timing", "posture", "joint error, cm", "likely cause"]
    rows = []
    for pair in pairs[:MAX_LISTED_CONFUSIONS]:
        both = pair.better, pair.worse
        scores = [" / ".join(f"{getattr(one.score, what):.1f}" for one in both) for what in ("similarity", "timing", "posture")]
        errors = " / ".join("-" if one.error_m is None else f"{100 * one.error_m:.1f}" for one in both)
        rows.append([pair.dance, f"{pair.ranks[0]} and {pair.ranks[1]}", *scores, errors, pair.cause])
    note = f"{MAX_LISTED_CONFUSIONS} of {len(pairs)} pairs, largest difference of similarity first."
    return [heading, *([("text", note)] if len(pairs) > len(rows) else []), ("table", (header, rows))]


def metrics_json(run: DanceRun, config: EvaluateConfig) -> dict:
    """Contents of metrics.json: for each source of joints, the agreement by the main scorer and by every scorer.

    The values of the first estimator are repeated at the top level.
    """
    scorer, manifest = main_scorer(run), run.dances.manifest
    sources = {}
    for source, by_scorer in run.agreements.items():
        by_name = {
            name: {"concordance": one.concordance, "kendall_tau": one.kendall_tau, "interval": one.interval}
            | {"wrong": one.wrong}
            for name, one in by_scorer.items()
        }
        error_m = mean_error_m(run, source)
        sources[source] = by_name[scorer] | {
            "mean_error_cm": None if error_m is None else 100 * error_m,
            "fps": run.fps.get(source),
            "scorers": by_name,
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


def report_blocks(run: DanceRun, plotted: str, metrics: dict) -> list[Block]:
    """The report. `plotted` is the name of the plotted dance, `metrics` the result of `metrics_json`."""
    scorer = main_scorer(run)
    blocks: list[Block] = [
        ("title", f"kpopnet on {run.dances.manifest.name}"),
        ("text", identity(run)),
        *(("text", line) for line in remarks(run)),
        ("table", agreement_table(run)),
        *(("table", table) for table in tables_of(run)[1:]),
        ("heading", "Scores by the experts' ranking"),
        ("figure", ("score_by_rank.png", "Scores over the experts' rank, one line per dance, red if in the wrong order")),
    ]
    for source in run.scores:
        for name in run.scores[source]:
            blocks += confusion_blocks(run, source, name)
    requested = metrics["config"]["benchmark"]["dance"]
    failed = (
        f"benchmark.dance={requested} failed and cannot be plotted. This is the dance whose scores agree least with the "
        "ranking."
    )
    blocks += [
        ("heading", f"{plotted} over time"),
        *([("text", failed)] if requested not in (None, plotted) else []),
        ("text", "Values per window of the learner's dance, over its start time. To plot another dance: benchmark.dance=NAME."),
        ("figure", ("timelines.png", f"Similarity, posture and delay of each learner of {plotted} over time, by {scorer}")),
        ("heading", "Table 2"),
        (
            "text",
            f"Scores from the experts' best learner to the worst;{WRONG_ORDER_MARK} marks the wrong order. All: table_2.csv.",
        ),
        ("table", table_2(run)),
        ("heading", "How this report was made"),
        (
            "text",
            f"{describe_files(metrics['files'])}; code {describe_revision(metrics['git'])}; {metrics['made']}. "
            "All metrics: metrics.json.",
        ),
    ]
    return blocks
