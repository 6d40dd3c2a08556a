"""The report on raters of a set of dances: their agreement, their consistency, and scorers beside them."""

import numpy as np

from kpopnet.dance.scoring import SCORERS
from kpopnet.datasets.dances.dance_set import LABELS, KpopSet, Learner, read_labels
from kpopnet.datasets.dances.ratings import Answer
from kpopnet.datasets.protocol import Origin
from kpopnet.errors import InputError
from kpopnet.evaluation.dances.ranking import TRUTH, similarities
from kpopnet.evaluation.dances.raters import Estimate, against, alpha, consistency, mean_w, one_against_others, votes_of
from kpopnet.evaluation.dances.run import run_dances
from kpopnet.evaluation.intervals import FEWEST_UNITS
from kpopnet.evaluation.registry import BestConfig
from kpopnet.evaluation.report import made_by
from kpopnet.evaluation.values import Table, Value, plain

DEFINITIONS = (
    "Ranks of a rater: by pairs won within a dance, equal ones as half; a dance counts for a rater when all its pairs are "
    "answered. Kendall's W: mean over dances, corrected for ties; raters at random have 1 / (number of raters), not 0. "
    "Krippendorff's alpha: ordinal, of the ranks within dances; raters at random have 0. Same answer: to a pair that was shown "
    "again with sides swapped; who answers at random and never says equal has 50 %. Pairs in agreement: of the preferences of "
    "the raters, or of the other raters; a pair that is equal to who is compared with them counts as half. Kendall's tau-a: "
    "with the pooled order of the same raters, mean over dances; a pair that is equal in one of both orders counts 0."
)
INTERVALS = (
    "Ranges in parentheses: 95 % intervals, of same answers by Wilson, of the others by a bootstrap over dances. They say how "
    "a figure varies over dances, not over raters: these raters are fixed. There is no interval below "
    f"{FEWEST_UNITS} dances, nor where all dances have the same value."
)


def rating_report(
    dances: KpopSet, ratings: dict[str, list[Answer]], seed: int, processes: int
) -> tuple[list[str | Table], dict]:
    """Blocks of a page and figures for JSON on a set's ratings by rater; scores all learners."""
    votes = votes_of({name: [one.name for one in dances.dance(name).learners] for name in dances.names}, ratings)
    source, signs, failed = scorers_signs(dances, seed, processes)
    raters = {
        rater: {"same": consistency(answers)} | one_against_others(rater, votes, seed) for rater, answers in ratings.items()
    }
    scored = {dance: one for dance, one in votes.items() if all(dance in by_dance for by_dance in signs.values())}
    scorers = {scorer: against(by_dance, scored, seed) for scorer, by_dance in signs.items()}
    agreement = {"Kendall's W": mean_w(votes, seed), "Krippendorff's alpha": alpha(votes, seed)}
    name, origin = dances.manifest.name, dances.manifest.origin
    remarks = [
        f"{name}: {origin.value.upper()} learners of {len(dances)} dances, {len(votes)} of them compared completely, by "
        f"{len(ratings)} raters.",
        *(["No person danced: these figures say nothing about people."] if origin is Origin.SIMULATED else []),
        f"Scorers had {'the true joints' if source == TRUTH else 'joints by mode best of the package'}.",
        *(f"Left out by the scorers because of an error: {dance}: {reason}" for dance, reason in failed.items()),
        DEFINITIONS,
        INTERVALS,
    ]
    asked = {rater: [len(answers), sum(one.choice == "equal" for one in answers)] for rater, answers in ratings.items()}
    blocks = [
        f"Ratings of {name}",
        *remarks,
        Table(["agreement", "value", "dances"], [[what, _value(one, ""), one.dances] for what, one in agreement.items()]),
        Table(
            ["rater", "answers", "equal", "same answer", *COMPARED],
            [[rater, *asked[rater], _value(one["same"], "%"), *_compared(one)] for rater, one in raters.items()],
        ),
        Table(["scorer", *COMPARED], [[scorer, *_compared(one)] for scorer, one in scorers.items()]),
    ]
    about = {"set": name, "origin": origin.value, "joints": source, "failed_dances": failed}
    figures = {"agreement": agreement, "raters": raters, "scorers": scorers}
    return blocks, plain(about | figures | made_by() | {"seed": seed})


COMPARED = ("pairs in agreement", "Kendall's tau", "dances")


def _compared(one: dict[str, Estimate]) -> list[Value | int]:
    return [_value(one["pairs"], "%"), _value(one["tau"], ""), one["tau"].dances]


def _value(one: Estimate, unit: str) -> Value:
    return Value(one.value, unit, one.interval, digits=None if unit else 2)


def scorers_signs(dances: KpopSet, seed: int, processes: int) -> tuple[str, dict[str, dict[str, np.ndarray]], dict[str, str]]:
    """The source of the joints; by scorer and dance which learner scores higher: (L, L) signs, learners by name; and the
    dances that could not be scored, with the reason.

    True joints are scored where all learners have them, otherwise those of the package's mode best. Where all learners are
    labelled, the labels stand beside the scorers.
    """
    learners = {name: dances.dance(name).learners for name in dances.names}
    known = all(_may_have_joints(one) for each in learners.values() for one in each)
    estimators = {} if known else {"best": BestConfig()}
    run = run_dances(dances, estimators, SCORERS, dances.folder / "poses", None, seed, processes)
    scores = {
        method.scorer: {name: similarities(scored) for name, scored in by_dance.items()}
        for method, by_dance in run.scores.items()
        if method.source == run.main.source
    }
    if all((dances.folder / name / LABELS).is_file() for name in dances.names):
        orders = {name: read_labels(dances.folder / name / LABELS) for name in dances.names}
        if all(sorted(order) == [one.name for one in learners[name]] for name, order in orders.items()):
            scores[LABELS] = {name: -np.argsort(order).astype(float) for name, order in orders.items()}
    signs = {
        scorer: {name: np.sign(np.nan_to_num(np.subtract.outer(one, one))) for name, one in by_dance.items()}
        for scorer, by_dance in scores.items()
    }
    return run.main.source, signs, run.failed


def _may_have_joints(learner: Learner) -> bool:
    """False where there is no true joint; a dance with a file that cannot be read is left out, whatever its joints."""
    try:
        return learner.joints() is not None
    except InputError:
        return True
