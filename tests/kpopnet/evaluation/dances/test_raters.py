"""Agreement of raters: published worked examples, limits that are known, and simulated raters of known agreement."""

import numpy as np
import pytest
from rated_sets import answered, simulated_votes
from scipy.stats import rankdata

from kpopnet.datasets.dances.ratings import Answer
from kpopnet.errors import InputError
from kpopnet.evaluation.dances.raters import (
    Votes,
    against,
    agreed_order,
    alpha,
    coincidences,
    consistency,
    kendall_w,
    mean_w,
    one_against_others,
    ordinal_alpha,
    ranks,
    votes_of,
)
from kpopnet.evaluation.intervals import FEWEST_UNITS

N = np.nan
CANONICAL = np.array(
    [
        [1, 2, 3, 3, 2, 1, 4, 1, 2, N, N, N],
        [1, 2, 3, 3, 2, 2, 4, 1, 2, 5, N, 3],
        [N, 3, 3, 3, 2, 3, 4, 2, 2, 5, 1, N],
        [1, 2, 3, 3, 2, 4, 4, 1, 2, 5, 1, N],
    ]
)
"""Four observers, twelve units: Krippendorff, "Computing Krippendorff's alpha-reliability" (2011), section E: ordinal 0.815."""

BIRDS = np.array(
    [
        [10.4, 10.8, 11.1, 10.2, 10.3, 10.2, 10.7, 10.5, 10.8, 11.2, 10.6, 11.4],
        [7.4, 7.6, 7.9, 7.2, 7.4, 7.1, 7.4, 7.2, 7.8, 7.7, 7.8, 8.3],
        [17.0, 17.0, 20.0, 14.5, 15.5, 13.0, 19.5, 16.0, 21.0, 20.0, 18.0, 22.0],
    ]
)
"""Wing, tail and bill of twelve birds, with ties: Zar, Biostatistical Analysis (2010), example 20.5: corrected W 0.924."""

LEARNERS = ["ann", "bo", "cy", "di"]


def test_alpha_of_krippendorffs_example():
    assert ordinal_alpha(coincidences(CANONICAL.T, np.arange(1, 6))) == pytest.approx(0.815, abs=5e-4)


def test_w_of_zars_example_with_ties():
    ranked = rankdata(BIRDS, axis=1)
    assert ranked.sum(axis=0).tolist() == [14.5, 21, 30.5, 6, 11, 3.5, 20, 11.5, 29, 28.5, 22.5, 36]  # as printed there
    assert kendall_w(ranked) == pytest.approx(0.924, abs=5e-4)


def figures_of_many(noise: float) -> tuple[float, float]:
    """W and alpha of 1000 dances by 3 raters of this noise, known to about 0.01."""
    ranked = [ranks(one.signs) for one in simulated_votes(np.random.default_rng(1), 1000, 3, noise).values()]
    levels = np.unique(ranked)
    return np.mean([*map(kendall_w, ranked)]), ordinal_alpha(sum(coincidences(one.T, levels) for one in ranked))


def test_intervals_cover_the_truth_at_about_their_level():
    assert figures_of_many(0.0) == (1, 1)
    assert figures_of_many(np.inf) == pytest.approx((1 / 3, 0), abs=0.04)
    truth, covered = figures_of_many(0.7), np.zeros(2)
    for seed in range(20):
        votes = simulated_votes(np.random.default_rng([2, seed]), 30, 3, 0.7)
        for k, one in enumerate((mean_w(votes, seed), alpha(votes, seed))):
            covered[k] += one.interval[0] <= truth[k] <= one.interval[1]
    assert (covered >= 17).all(), covered


def test_intervals_need_five_dances_that_differ():
    rng = np.random.default_rng(3)
    for dances in (FEWEST_UNITS - 1, FEWEST_UNITS):
        votes = simulated_votes(rng, dances, 3, 1.0)
        assert (mean_w(votes, 0).interval is None) == (alpha(votes, 0).interval is None) == (dances < FEWEST_UNITS)
    assert mean_w(simulated_votes(rng, 9, 3, 0.0), 0) == (1.0, None, 9)
    assert mean_w(simulated_votes(rng, 9, 1, 1.0), 0).value is None and alpha({}, 0).value is None
    assert one_against_others("eve", {}, 0)["tau"] == consistency([]) == (None, None, 0)


def test_answers_that_are_none_or_about_others_are_refused():
    for answer, message in (
        (Answer("one", "ann", "bo"), "eve on one: choice=: expected one of left, equal, right"),
        (Answer("one", "ann", "zoe", choice="left"), "eve on one: learner=zoe: expected one of ann, bo"),
    ):
        with pytest.raises(InputError, match=message):
            votes_of({"one": ["ann", "bo"]}, {"eve": [answer]})


def test_a_dance_counts_for_raters_who_answered_all_of_its_pairs():
    dances = {"one": LEARNERS, "two": LEARNERS[:2]}
    whole = answered(dances, "eve")
    part = [one for one in answered(dances, "fay") if one.dance == "two" or "di" not in one.pair[1]]
    votes = votes_of(dances, {"eve": whole, "fay": part})
    assert votes["one"].raters == ("eve",) and votes["two"].raters == ("eve", "fay")
    assert ranks(votes["one"].signs).tolist() == [[1, 2, 3, 4]]
    assert votes_of(dances, {"fay": part[:0]}) == {}


def test_consistency_counts_the_same_learner_on_the_other_side():
    dances = {f"dance_{k}": LEARNERS for k in range(8)}
    steady, by_side = answered(dances, "eve"), answered(dances, "eve", lambda pair: True)
    assert consistency(steady)[0] == 1 and consistency(steady).dances == 8
    assert consistency(steady).interval[0] == pytest.approx(1 / (1 + 1.96**2 / 8), abs=1e-3)  # Wilson's
    assert consistency(by_side)[0] == 0  # always the left one
    equal = [Answer("d", "a", "b", False, "equal"), Answer("d", "b", "a", True, "equal"), Answer("e", "b", "a", True, "left")]
    assert consistency(equal) == (1.0, None, 1)  # what was never shown first says nothing


def test_scorers_and_raters_are_compared_with_raters():
    right = np.sign(np.subtract.outer(-np.arange(4.0), -np.arange(4.0)))
    votes = {str(k): Votes(tuple(LEARNERS), ("eve", "fay"), np.array([right, right])) for k in range(6)}
    for signs, share, tau in ((right, 1, 1), (-right, 0, -1), (0 * right, 0.5, 0)):
        found = against(dict.fromkeys(votes, signs), votes, 0)
        assert (found["pairs"].value, found["tau"].value) == (share, tau)
    wrong = {dance: Votes(one.learners, (*one.raters, "gil"), np.array([right, right, -right])) for dance, one in votes.items()}
    assert one_against_others("gil", wrong, 0)["tau"].value == -1
    assert one_against_others("eve", wrong, 0)["pairs"].value == 0.5
    half = against({dance: right * (-1 if dance < "3" else 1) for dance in votes}, votes, 0)["pairs"]
    assert half.value == 0.5 and half.interval[0] < 0.2 and half.interval[1] > 0.8


def test_ranks_are_written_where_two_raters_agree():
    right = np.sign(np.subtract.outer(-np.arange(3.0), -np.arange(3.0)))
    names = ("ann", "bo", "cy")
    assert agreed_order(Votes(names, ("eve", "fay"), np.array([-right, -right]))) == (["cy", "bo", "ann"], "")
    assert "one rater" in agreed_order(Votes(names, ("eve",), right[None]))[1]
    assert "divided on" in agreed_order(Votes(names, ("eve", "fay"), np.array([right, -right])))[1]
    circle = np.array([[0, 1, -1], [-1, 0, 1], [1, -1, 0]])
    assert "divided on" in agreed_order(Votes(names, ("eve", "fay"), np.array([circle, circle])))[1]


def test_who_won_more_pairs_but_was_preferred_by_no_more_raters_is_divided():
    names = ("ann", "bo", "cy")
    one = np.array([[0, 1, 1], [-1, 0, 1], [-1, -1, 0]])
    other = np.array([[0, -1, 1], [1, 0, -1], [-1, 1, 0]])
    votes = Votes(names, ("eve", "fay"), np.array([one, other]))
    assert votes.pooled[0] > votes.pooled[1] and "divided on ann and bo" in agreed_order(votes)[1]
