"""Figures of a dance evaluation: scores over the experts' rank, and the scores of one dance over time."""

import numpy as np
from matplotlib.figure import Figure

from kpopnet.evaluation.dances.ranking import is_ordered, similarities
from kpopnet.evaluation.dances.run import DanceRun

RIGHT_ORDER, WRONG_ORDER = "0.75", "tab:red"
RANK_COLOURS = ("tab:green", "tab:blue", "tab:orange", "tab:red", "tab:purple", "tab:brown")


def score_by_rank(run: DanceRun) -> Figure:
    """One panel per scorer and source of joints, with one line per dance over its learners, red in the wrong order."""
    sources, scorers = list(run.scores), list(next(iter(run.scores.values())))
    figure = Figure(figsize=(3.6 * len(sources) + 0.6, 3.2 * len(scorers)), layout="constrained")
    panels = figure.subplots(len(scorers), len(sources), sharex=True, sharey="row", squeeze=False)
    for row, scorer in zip(panels, scorers, strict=True):
        for panel, source in zip(row, sources, strict=True):
            by_dance = {name: similarities(one) for name, one in run.scores[source][scorer].items()}
            for scores in sorted(by_dance.values(), key=is_ordered, reverse=True):
                right = is_ordered(scores)
                style = {"color": RIGHT_ORDER, "alpha": 0.6} if right else {"color": WRONG_ORDER, "alpha": 0.9}
                panel.plot(range(1, len(scores) + 1), scores, marker=".", linewidth=0.8, **style)
            ordered = sum(map(is_ordered, by_dance.values()))
            panel.set_title(f"{scorer}, {source}: {ordered} of {len(by_dance)}", fontsize=10)
            panel.grid(axis="y", alpha=0.3)
            panel.set_xticks(range(1, max(map(len, by_dance.values())) + 1))
        row[0].set_ylabel("score")
    for panel in panels[-1]:
        panel.set_xlabel("rank by the experts, 1 = best")
    return figure


def timelines(run: DanceRun, dance: str, scorer: str) -> Figure:
    """Similarity, posture and delay of every learner of one dance in every window; one row per source of joints."""
    sources = list(run.scores)
    figure = Figure(figsize=(12, 2.4 * len(sources) + 0.6), layout="constrained")
    panels = figure.subplots(len(sources), 3, sharex=True, squeeze=False)
    for row, source in zip(panels, sources, strict=True):
        for rank, learner in enumerate(run.scores[source][scorer][dance], 1):
            windows = learner.score.windows
            colour = RANK_COLOURS[(rank - 1) % len(RANK_COLOURS)]
            label = f"{rank}: {learner.name}, {learner.score.similarity:.1f}"
            for panel, values in zip(row, (windows.similarity, windows.posture, windows.delay_s), strict=True):
                panel.plot(windows.start_s, values, color=colour, marker=".", markersize=3, linewidth=1, label=label)
        for panel, what in zip(row, ("similarity", "posture", "delay in s"), strict=True):
            panel.set_ylabel(what)
            panel.grid(alpha=0.3)
        row[0].set_ylim(0, 100)
        row[1].set_ylim(0, 100)
        row[2].axhline(0, color="black", linewidth=0.5)
        row[0].set_title(f"{dance}, {source}, {scorer}", fontsize=10, loc="left")
        row[0].legend(fontsize=7, title="rank: learner, score", title_fontsize=7, loc="best", ncols=2)
    for panel in panels[-1]:
        panel.set_xlabel("start of the window, s")
    return figure


def worst_ordered_dance(run: DanceRun, source: str, scorer: str) -> str:
    """The dance in which a worse learner is farthest ahead of the next better one; the first one if tied.

    If all dances are in the right order, it is the dance with the smallest difference between neighbouring ranks.
    """
    by_dance = {name: similarities(one) for name, one in run.scores[source][scorer].items()}
    return min(by_dance, key=lambda name: np.nan_to_num(-np.diff(by_dance[name]), nan=-np.inf).min())
