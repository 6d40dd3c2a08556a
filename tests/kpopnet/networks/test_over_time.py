"""The network over time: the past alone where it must be, any rate and any gap."""

from itertools import pairwise

import numpy as np
import pytest

from kpopnet.networks import over_time
from kpopnet.networks.over_time import (
    ANOTHER_AFTER_S,
    BASES,
    EXTRAPOLATED,
    FEATURES,
    FORGET_S,
    KINDS,
    TIME_CONSTANTS_S,
    Averages,
    Live,
    Measured,
    OverTime,
    read,
    whole,
)
from kpopnet.skeleton import MIRROR, Joint

POSE_M = np.random.default_rng(1).uniform(-0.5, 0.5, (15, 3)) + np.array([0, 0, 3])


TIMES_S = np.arange(96) / 30


def film(seed):
    """A still pose that moves as a whole, measured with noise."""
    rng, true_m = np.random.default_rng(seed), POSE_M + 0.1 * np.sin(2 * TIMES_S)[:, None, None]
    measured = (true_m + 0.03 * rng.standard_normal(true_m.shape) for _ in range(2))
    return Measured(*measured, *(rng.uniform(0.6, 1.0, (96, 15)) for _ in range(2)))


def frame(measured, number):
    return Measured(*(array[number] for array in measured))


def drawn(future=False):
    """A network with random weights."""
    rng, ways, arrays = np.random.default_rng(0), 2 if future else 1, {}
    for number, (columns, rows) in enumerate(pairwise([ways * FEATURES, 12, 12, ways * BASES + 1])):
        arrays[f"{2 * number}.weight"] = 0.2 * rng.standard_normal((rows, columns))
        arrays[f"{2 * number}.bias"] = 0.1 * rng.standard_normal(rows)
    return OverTime(arrays)


def test_the_causal_form_does_not_see_the_future_and_the_other_does():
    one, changed = film(0), film(0)
    changed.detected_m[60:] += 0.2
    for future in (False, True):
        network = drawn(future)
        first, second = (network(*read(measured, TIMES_S, future))[0] for measured in (one, changed))
        assert np.array_equal(first[:60], second[:60]) is not future
        assert not np.allclose(first[60:], second[60:])


def test_a_clock_that_stands_still_counts_as_thirty_images_a_second():
    for future in (False, True):
        network, stopped_s = drawn(future), np.full(96, 7)  # a whole number
        for one, other in zip(
            network(*read(film(0), stopped_s, future)), network(*read(film(0), TIMES_S, future)), strict=True
        ):
            np.testing.assert_allclose(one, other, atol=1e-5)
    live, other = Live(drawn()), Live(drawn())
    for number, time_s in enumerate(TIMES_S):
        stopped_m, running_m = (one.update(frame(film(0), number), at_s)[0] for one, at_s in ((live, 7.0), (other, time_s)))
        np.testing.assert_allclose(stopped_m, running_m, atol=1e-5)


@pytest.mark.parametrize("fps", [15, 60])
def test_live_equals_a_recording_with_drop_outs_at_any_rate(fps):
    times_s = np.arange(96) / fps
    kept = np.ones(96, bool)
    kept[[10, 11, 40]] = kept[60:95] = False
    measured, times_s = Measured(*(array[kept] for array in film(0))), times_s[kept]
    joints_m, confidence = drawn()(*read(measured, times_s, future=False))
    live, other = Live(drawn()), Live(drawn())
    for number, time_s in enumerate(times_s):
        found_m, sure = live.update(frame(measured, number), time_s)
        np.testing.assert_allclose(found_m, joints_m[number], atol=1e-5)
        np.testing.assert_allclose(sure, confidence[number], atol=1e-5)
        other.update(frame(measured, number), time_s)
    # A clock that goes back is a start, like a long gap.
    back_m, later_m = (one.update(frame(measured, 0), time_s)[0] for one, time_s in ((live, 0.0), (other, 1e3)))
    np.testing.assert_array_equal(back_m, later_m)


def test_a_long_recording_is_read_in_parts_with_the_same_joints(monkeypatch):
    monkeypatch.setattr(over_time, "PART", 20)
    times_s, network, longest = TIMES_S.copy(), drawn(future=True), []
    times_s[40:] += ANOTHER_AFTER_S - 1
    times_s[77] = times_s[76]
    told = network.through
    monkeypatch.setattr(network, "through", lambda seen: longest.append(len(seen)) or told(seen))
    parts, at_once = whole(network, film(0), times_s), network(*read(film(0), times_s, future=True))
    assert longest == [20, 20, 20, 20, 16, 96]
    for one, other in zip(parts, at_once, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_averages_take_the_same_time_at_every_rate():
    """After a step of the pose, 0.4 s later, the difference to the average of 0.4 s has fallen to 1/e."""
    for fps in (15, 30, 60):
        averages, moved_m = Averages(), POSE_M + np.eye(15, 3) * 0.1
        chance = np.full(15, 0.9)
        averages.add(Measured(POSE_M, POSE_M, chance, chance), np.inf)
        for _ in range(round(0.4 * fps)):
            _, differences_m, _ = averages.add(Measured(moved_m, moved_m, chance, chance), 1 / fps)
        start_m, _, _ = Averages().add(Measured(POSE_M, POSE_M, chance, chance), np.inf)
        end_m, _, _ = Averages().add(Measured(moved_m, moved_m, chance, chance), np.inf)
        np.testing.assert_allclose(differences_m[2], (start_m - end_m) / np.e, atol=1e-9)


def test_turned_and_mirrored_people_get_turned_and_mirrored_joints_and_chances():
    measured, network = film(3), drawn()
    turn = np.array([[0.8, 0, -0.6], [0, 1, 0], [0.6, 0, 0.8]]) * [[-1], [1], [1]]
    turned = Measured(*(one[:, MIRROR] @ turn for one in measured[:2]), *(one[:, MIRROR] for one in measured[2:]))
    plain_m, plain_chance = network(*read(measured, TIMES_S, future=False))
    found_m, found_chance = network(*read(turned, TIMES_S, future=False))
    np.testing.assert_allclose(found_m, plain_m[:, MIRROR] @ turn, atol=1e-4)
    np.testing.assert_allclose(found_chance, plain_chance[:, MIRROR], atol=1e-4)
    assert ((plain_chance > 0) & (plain_chance < 1)).all()
    assert (KINDS.sum(axis=1) == 1).all()


def test_after_a_long_absence_the_lengths_are_those_of_another_person():
    one, network = film(3), drawn()
    child = Measured(0.65 * one.detected_m, 0.65 * one.fitted_m, *one[2:])
    for away_s, is_forgotten in ((ANOTHER_AFTER_S + 1, True), (ANOTHER_AFTER_S - 1, False), (-60.0, True)):
        alone, after = Live(network), Live(network)
        for number in range(30):
            after.update(frame(child, number), number / 30)
        first_s = 29 / 30 + away_s
        found = [live.update(frame(one, 0), first_s)[0] for live in (alone, after)]
        assert np.array_equal(*found) is is_forgotten
        both = Measured(*(np.concatenate([a[:30], b[:30]]) for a, b in zip(child, one, strict=True)))
        times_s = np.concatenate([np.arange(30) / 30, first_s + np.arange(30) / 30])
        whole = read(both, times_s, future=True)
        assert np.allclose(whole[1][30:], read(Measured(*(a[:30] for a in one)), times_s[30:], future=True)[1]) is is_forgotten


def same(joints_m):
    """What single frames say that are all of one opinion."""
    return Measured(joints_m, joints_m, np.full(15, 0.9), np.full(15, 0.9))


def test_averages_lag_behind_a_steady_movement_and_those_that_are_extrapolated_do_not():
    averages, speed_m_s = Averages(), np.zeros((15, 3))
    speed_m_s[Joint.LEFT_HAND, 0] = 0.3
    for number in range(300):
        _, differences_m, _ = averages.add(same(POSE_M + speed_m_s * number / 30), 1 / 30)
    behind_m = -differences_m[:, Joint.LEFT_HAND, 0]
    count = len(TIME_CONSTANTS_S)
    np.testing.assert_allclose(behind_m[:count], 0.3 / 30 / np.expm1(1 / 30 / TIME_CONSTANTS_S), rtol=1e-3)
    np.testing.assert_allclose(behind_m[count : count + EXTRAPOLATED], 0, atol=1e-4)


def test_after_a_gap_places_start_again_and_the_lengths_of_the_same_person_are_kept():
    for gap_s in (FORGET_S + 0.1, ANOTHER_AFTER_S - 1):
        averages = Averages()
        for _ in range(30):
            averages.add(same(0.65 * POSE_M), 1 / 30)
        _, differences_m, _ = averages.add(same(POSE_M), gap_s)
        np.testing.assert_allclose(differences_m[: BASES - 2], 0, atol=1e-12)
        to_hand_m, shorter_m = POSE_M[Joint.LEFT_HAND] - POSE_M[Joint.LEFT_ELBOW], differences_m[BASES - 2, Joint.LEFT_HAND]
        np.testing.assert_allclose(to_hand_m + shorter_m, 0.665 * to_hand_m, rtol=0.01)
