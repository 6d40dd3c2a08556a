"""The report on dance scores: the paper's Table 2, and agreement with the experts."""

import math
from itertools import combinations, product, zip_longest
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from kpopnet.datasets.dances.dance_set import open_set
from kpopnet.datasets.protocol import Origin
from kpopnet.errors import InputError
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.dances.pose_cache import SeeTeacher
from kpopnet.evaluation.dances.ranking import in_order_by_one, is_ordered, mcnemar_p_value, similarities
from kpopnet.evaluation.dances.run import DanceRun, Method, run_dances
from kpopnet.evaluation.report import Block, Heading, Picture, Report, save_plots, write_text
from kpopnet.evaluation.values import Table, Value
from kpopnet.pose.extraction import DEFAULT_EXTRACTION, extraction_name

WRONG_ORDER_MARK = " ✗"
RIGHT_ORDER, WRONG_ORDER = "0.75", "tab:red"
RANK_COLOURS = ("tab:green", "tab:blue", "tab:orange", "tab:red", "tab:purple", "tab:brown")

SIMULATED = (
    "Learners and labels are simulated with a model of skill or of faults. The results compare scorers and estimators "
    "with each other; they do not predict the agreement with experts on real dancers. The difficulty of the set was "
    "chosen such that the feature of [17] on true joints puts about 86 of 100 other dances in the right order, as in "
    "the paper. Earlier looks at dances of other seeds: docs/ledger.md."
)
NOT_ORDERED = (
    "The learners of this set are ends of the score, which have no order: concordance, Kendall's tau, p and marks of a wrong "
    "order mean nothing. Look at the scores by rank."
)
NOT_INDEPENDENT = (
    "Its dances are excerpts of few recordings: how figures vary over dances is not known, and no interval is given."
)
DEFINITIONS = (
    "Concordance: percentage of dances whose scores decrease strictly from the best learner to the worst; a tie is a "
    "failure. Kendall's tau: (pairs of learners in the right order - pairs in the wrong order) / all pairs of a dance, "
    "mean over dances. Ranges in parentheses: 95 % intervals, of the concordance by Wilson, of tau by a bootstrap over "
    "dances. Joint error: of the joints that were found. p of a pair of scorers: exact test of McNemar on the same dances. "
    "Scores by rank: mean (lowest to highest) of the main scorer."
)
CLOCK = "Frames per second are those of one core for the estimation of the joints, after an untimed warm-up."


def evaluate_dances(config: EvaluateConfig, folder: Path, see_teacher: SeeTeacher | None = None) -> Report:
    """Scores the learners of a set of dances; writes the plots and table_2.csv into the folder, created if it does not exist.

    Without a requested dance, or where it failed, the one in which a worse learner is farthest above, or least below, the next
    better one is plotted. Raises InputError if a setting applies to benchmarks of joints only, or the dance to be plotted is
    not among the scored ones; see `run_dances`, also for `see_teacher`, which benchmark.seen_teacher asks for.
    """
    config.refuse("sweep")
    config.refuse("sequences", instead="benchmark.dances=10 makes a quick test")
    if config.extraction != DEFAULT_EXTRACTION:
        raise InputError(f"extraction={extraction_name(config.extraction)}: the depth of dances is segmented; leave it out")
    dances, plotted, count = open_set(config.benchmark), config.benchmark.dance, config.benchmark.dances
    poses = Path(config.benchmark.poses or dances.folder / "poses")
    if plotted not in (None, *dances.names[:count]):
        raise InputError(f"benchmark.dance={plotted}: not among the {len(dances.names[:count])} dances to be scored")
    see_teacher = see_teacher if config.benchmark.seen_teacher else None
    processes = config.processes_at_work()
    run = run_dances(dances, config.estimator, config.scorer, poses, count, config.seed, processes, see_teacher)
    folder.mkdir(parents=True, exist_ok=True)
    if plotted not in run.names:
        scores = {name: similarities(learners) for name, learners in run.scores[run.main].items()}
        plotted = min(scores, key=lambda name: np.nan_to_num(-np.diff(scores[name]), nan=-np.inf).min())
    save_plots(folder, {"score_by_rank": score_by_rank(run), "timelines": timelines(run, plotted)})
    write_text(folder / "table_2.csv", learners_table(run).csv())
    tables = [table for table in (agreement_table(run), rank_table(run), paired_table(run)) if table.rows]
    by_scorer = f"by {run.main.scorer}"
    blocks: list[Block] = [
        *tables,
        Heading("Scores by the labels' rank"),
        Picture("score_by_rank.png", "Scores over the labels' rank, one line per dance, red if in the wrong order"),
        Heading(f"{plotted} over time"),
        "Values per window of the learner's dance, over its start time. To plot another dance: benchmark.dance=NAME.",
        Picture("timelines.png", f"Similarity, posture and delay of each learner of {plotted} over time, {by_scorer}"),
        Heading("Table 2"),
        f"Scores from the best learner to the worst;{WRONG_ORDER_MARK} marks the wrong order. All: table_2.csv.",
        table_2(run),
    ]
    return Report(f"kpopnet on {run.dances.manifest.name}", remarks(run), blocks, tables, CLOCK, dance_metrics(run))


def remarks(run: DanceRun) -> list[str]:
    """The set, the origin of learners and ranking, its size, and what else is needed to interpret the metrics."""
    manifest, scored = run.dances.manifest, len(run.names)
    in_set, simulated = run.in_set, manifest.origin is Origin.SIMULATED
    ranking = "the simulated skill levels" if simulated else "the labels of the set"
    lines = [
        f"{manifest.name}: {manifest.origin.value.upper()} learners of {scored}{'' if scored == in_set else f' of {in_set}'} "
        f"dances, compared with {ranking}.",
        manifest.about,
        *([SIMULATED] if simulated and manifest.ordered else []),
        *([] if manifest.ordered else [NOT_ORDERED]),
        *([] if manifest.independent else [NOT_INDEPENDENT]),
        *run.assumptions,
    ]
    for source in run.sources:
        by_dance = run.scores[Method(source, run.main.scorer)].values()
        unseen = sum(math.isnan(one.score.similarity) for learners in by_dance for one in learners)
        if unseen:
            lines.append(
                f"{source}: no joint of {unseen} of {sum(map(len, by_dance))} learners was found; no joint error of them."
            )
    if run.chosen < in_set:
        lines.append(f"Partial evaluation: {run.chosen} dances; not a result on the whole set.")
    if run.dances.unlabelled:
        lines.append(f"Left out: {run.dances.unlabelled} dances without labels.csv.")
    lines += [f"Left out because of an error: {name}: {reason}" for name, reason in run.failed.items()]
    return [*lines, DEFINITIONS]


def agreement_table(run: DanceRun) -> Table:
    """Concordance, tau, joint error and speed by source of joints and scorer."""
    table = Table(["joints", "scorer", "concordance", "Kendall's tau", "joint error", "frames per second"], [])
    for (source, scorer), one in run.agreements.items():
        concordance = Value(one.concordance, "", one.interval["concordance"], digits=0)
        tau = Value(one.kendall_tau, "", one.interval["kendall_tau"], digits=3)
        error_cm, fps = Value(mean_error_cm(run, source), "cm", digits=1), Value(run.fps.get(source), digits=0)
        table.rows.append([source, scorer, concordance, tau, error_cm, fps])
    return table


def rank_table(run: DanceRun) -> Table:
    """Mean score of the learners of each rank by the main scorer, and the lowest and highest."""
    rows: list = []
    for source in run.sources:
        by_dance = run.scores[Method(source, run.main.scorer)].values()
        by_rank = zip_longest(*map(similarities, by_dance), fillvalue=math.nan)
        known = ([score for score in scores if math.isfinite(score)] for scores in by_rank)
        means = (Value(float(np.mean(one)), "", (min(one), max(one)), digits=0) if one else Value(None) for one in known)
        rows.append([source, *means])
    return Table(["joints", *(f"rank {rank}" for rank in range(1, max(map(len, rows))))], rows)


def paired_table(run: DanceRun) -> Table:
    """Pairs of scorers on the same joints: dances that only the one orders, and the p-value of their difference."""
    table = Table(["joints", "scorers", "dances in order by one of them only", "p"], [])
    for source, (first, second) in product(run.sources, combinations(run.scorers, 2)):
        alone = in_order_by_one(*(run.agreements[Method(source, scorer)].wrong for scorer in (first, second)))
        p = Value(mcnemar_p_value(*alone) if run.dances.manifest.independent else None, digits=3)
        table.rows.append([source, f"{first}, {second}", "{} and {}".format(*alone), p])
    return table


def mean_error_cm(run: DanceRun, source: str) -> float | None:
    """Mean over learners of the mean distance of the found joints from the true joints, in cm; None if unknown."""
    by_dance = run.scores[Method(source, run.main.scorer)].values()
    errors_m = [one.error_m for learners in by_dance for one in learners if one.error_m is not None]
    return 100 * (sum(errors_m) / len(errors_m)) if errors_m else None


def table_2(run: DanceRun) -> Table:
    """The paper's Table 2: the scores of all learners of a dance by each method, marked if in the wrong order."""
    methods = [Method(source, scorer) for scorer, source in product(run.scorers, run.sources)]
    table = Table(["dance", *(f"{scorer}, {source}" for source, scorer in methods)], [])
    for name in run.names:
        scores = [similarities(run.scores[method][name]) for method in methods]
        marks = ("" if is_ordered(one) else WRONG_ORDER_MARK for one in scores)
        table.rows.append([name, *("  ".join(f"{s:.1f}" for s in one) + mark for one, mark in zip(scores, marks, strict=True))])
    return table


def learners_table(run: DanceRun) -> Table:
    """Similarity, timing and posture score of every learner, one line per learner, scorer and source of joints."""
    table = Table(["dance", "rank", "learner", "scorer", "joints", "similarity", "timing", "posture", "error_cm"], [])
    for (source, scorer), by_dance in run.scores.items():
        for dance, learners in by_dance.items():
            for rank, (name, score, error_m) in enumerate(learners, 1):
                scores = (f"{value:.4f}" for value in (score.similarity, score.timing, score.posture))
                error_cm = "" if error_m is None else f"{100 * error_m:.2f}"
                table.rows.append([dance, rank, name, scorer, source, *scores, error_cm])
    return table


def dance_metrics(run: DanceRun) -> dict:
    """metrics.json: for each source of joints, the agreement by the main scorer and by every scorer; the main's on top."""
    manifest, sources = run.dances.manifest, {}
    for source in run.sources:
        by_scorer = {scorer: run.agreements[Method(source, scorer)]._asdict() for scorer in run.scorers}
        speed = {"mean_error_cm": mean_error_cm(run, source), "fps": run.fps.get(source)}
        sources[source] = by_scorer[run.main.scorer] | speed | {"scorers": by_scorer}
    return {
        "estimator": run.main.source,
        "scorer": run.main.scorer,
        **sources[run.main.source],
        "benchmark": {
            "name": manifest.name,
            "origin": manifest.origin.value,
            "about": manifest.about,
            "hash": manifest.hash,
            "dances": len(run.names),
            "dances_in_set": run.in_set,
            "failed_dances": run.failed,
        },
        "estimators": sources,
    }


def score_by_rank(run: DanceRun) -> Figure:
    """One panel per scorer and source of joints, with one line per dance over its learners, red in the wrong order."""
    sources, scorers = run.sources, run.scorers
    figure = Figure(figsize=(3.6 * len(sources) + 0.6, 3.2 * len(scorers)), layout="constrained")
    panels = figure.subplots(len(scorers), len(sources), sharex=True, sharey="row", squeeze=False)
    for panel, (scorer, source) in zip(panels.flat, product(scorers, sources), strict=True):
        by_dance = [similarities(one) for one in run.scores[Method(source, scorer)].values()]
        for scores in sorted(by_dance, key=is_ordered, reverse=True):
            style = {"color": RIGHT_ORDER, "alpha": 0.6} if is_ordered(scores) else {"color": WRONG_ORDER, "alpha": 0.9}
            panel.plot(range(1, len(scores) + 1), scores, marker=".", linewidth=0.8, **style)
        panel.set_title(f"{scorer}, {source}: {sum(map(is_ordered, by_dance))} of {len(by_dance)}", fontsize=10)
        panel.grid(axis="y", alpha=0.3)
        panel.set_xticks(range(1, max(map(len, by_dance)) + 1))
    for panel in panels[:, 0]:
        panel.set_ylabel("score")
    for panel in panels[-1]:
        panel.set_xlabel("rank by the labels, 1 = best")
    figure.suptitle(_title(run))
    return figure


def timelines(run: DanceRun, dance: str) -> Figure:
    """Similarity, posture and delay of every learner of one dance in every window; one row per source of joints."""
    figure = Figure(figsize=(12, 2.4 * len(run.sources) + 0.6), layout="constrained")
    panels = figure.subplots(len(run.sources), 3, sharex=True, squeeze=False)
    for row, source in zip(panels, run.sources, strict=True):
        for rank, learner in enumerate(run.scores[Method(source, run.main.scorer)][dance], 1):
            windows = learner.score.windows
            style = {"color": RANK_COLOURS[(rank - 1) % len(RANK_COLOURS)], "marker": ".", "markersize": 3, "linewidth": 1}
            label = f"{rank}: {learner.name}, {learner.score.similarity:.1f}"
            for panel, values in zip(row, (windows.similarity, windows.posture, windows.delay_s), strict=True):
                panel.plot(windows.start_s, values, label=label, **style)
        for panel, what in zip(row, ("similarity", "posture", "delay in s"), strict=True):
            panel.set_ylabel(what)
            panel.grid(alpha=0.3)
        row[0].set_ylim(0, 100)
        row[1].set_ylim(0, 100)
        row[2].axhline(0, color="black", linewidth=0.5)
        row[0].set_title(f"{dance}, {source}, {run.main.scorer}", fontsize=10, loc="left")
        row[2].legend(fontsize=7, title="rank: learner, score", title_fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))
    for panel in panels[-1]:
        panel.set_xlabel("start of the window, s")
    figure.suptitle(_title(run))
    return figure


def _title(run: DanceRun) -> str:
    return f"{run.dances.manifest.name} ({run.dances.manifest.origin.value})"
