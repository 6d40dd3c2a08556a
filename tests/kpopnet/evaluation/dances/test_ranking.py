"""Concordance, and Kendall's tau on hand-made scores."""

import numpy as np
import pytest

from kpopnet.errors import InputError
from kpopnet.evaluation.dances.ranking import agreement, in_order_by_one, is_ordered, kendall_tau, mcnemar_p_value


def test_only_strictly_decreasing_scores_are_in_order():
    assert is_ordered(np.array([62.4, 56.2, 51.9, 47.6]))
    assert not is_ordered(np.array([62.2, 53.1, 53.1, 47.8]))  # row 20 of the paper's Table 2: a tie is a failure
    assert not is_ordered(np.array([40.5, 37.9, 35.9, 48.0]))  # row 15
    assert not is_ordered(np.array([60.0, np.nan, 50.0, 40.0]))


def test_kendall_tau_by_hand():
    assert kendall_tau(np.array([4.0, 3, 2, 1])) == 1
    assert kendall_tau(np.array([1.0, 2, 3, 4])) == -1
    assert kendall_tau(np.array([4.0, 3, 1, 2])) == pytest.approx(4 / 6)
    assert kendall_tau(np.array([4.0, 3, 3, 2])) == pytest.approx(5 / 6)
    assert kendall_tau(np.array([4.0, np.nan, 3, 2])) == pytest.approx(3 / 6)


def test_scores_are_those_of_two_learners_or_more():
    assert is_ordered([3, 2, 1]) and kendall_tau([3, 2, 1]) == 1
    for judge in (is_ordered, kendall_tau, lambda scores: agreement({"one": scores}, seed=0)):
        for wrong in ([], [60.0], None, np.ones((2, 2))):
            with pytest.raises(InputError, match="expected those of two learners or more, the best first"):
                judge(wrong)
    with pytest.raises(InputError, match="scores: expected those of one dance or more"):
        agreement({}, seed=0)


def test_agreement_counts_dances_and_lists_those_in_the_wrong_order():
    good, tied = np.array([4.0, 3, 2, 1]), np.array([4.0, 3, 3, 1])
    found = agreement({"one": good, "two": tied, "three": good, "four": good}, seed=0)
    assert found.concordance == 75 and found.wrong == ("two",)
    assert found.kendall_tau == pytest.approx((3 + 5 / 6) / 4)
    assert found.interval["concordance"] == pytest.approx([30.06, 95.44], abs=0.01)  # Wilson, 3 of 4
    assert agreement({"one": good}, seed=0).interval["kendall_tau"] is None


def test_scorers_of_the_same_dances_are_compared_in_pairs():
    """McNemar by hand: of five dances that one of both orders, each is the one's with probability 1/2."""
    one, other = "cdefg", "fgh"
    assert in_order_by_one(one, other) == (1, 3)
    assert mcnemar_p_value(1, 3) == mcnemar_p_value(3, 1) == pytest.approx(2 * (1 + 4) / 16)
    assert mcnemar_p_value(0, 0) == 1
