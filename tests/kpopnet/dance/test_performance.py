import numpy as np
import pytest
from dance_people import dance_joints_m, performed

from kpopnet.dance import performance
from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

JOINTS_M = dance_joints_m(0, 4.0)
TIMES_S = np.arange(len(JOINTS_M)) / 30


def resampled(joints_m, times_s, at_s):
    return performance.resampled(joints_m, np.ones(joints_m.shape[:2]), times_s, at_s)[0]


def test_linear_motion_is_preserved_for_any_times():
    rng = np.random.default_rng(0)
    times_s = np.cumsum(rng.uniform(0.005, 0.1, 80))
    line_m = np.array([1.0, 2.0, 3.0]) + times_s[:, None] * [0.5, -1.0, 0.1]
    joints_m = np.repeat(line_m[:, None], 15, axis=1)
    at_s = np.arange(times_s[0], times_s[-1], 1 / 30)
    expected = np.array([1.0, 2.0, 3.0]) + at_s[:, None] * [0.5, -1.0, 0.1]
    np.testing.assert_allclose(resampled(joints_m, times_s, at_s), np.repeat(expected[:, None], 15, axis=1), atol=1e-9)


def test_noise_and_single_jumps_are_smoothed():
    rng = np.random.default_rng(1)
    noisy = JOINTS_M + rng.normal(0, 0.03, JOINTS_M.shape)
    at_s = TIMES_S[10:-10]
    smooth = resampled(JOINTS_M, TIMES_S, at_s)
    assert np.std(resampled(noisy, TIMES_S, at_s) - smooth) < 0.4 * 0.03
    jumping = JOINTS_M.copy()
    jumping[50, 6] += [0.8, 0, 0]
    assert np.abs(resampled(jumping, TIMES_S, at_s) - smooth).max() < 0.1


def test_short_gaps_are_closed_and_long_gaps_stay():
    joints_m = JOINTS_M.copy()
    joints_m[20:26, 6] = np.nan  # 7 / 30 s from sample to sample
    joints_m[60:70, 6] = np.nan
    kept = np.delete(np.arange(len(TIMES_S)), np.arange(80, 100))
    missing = np.isnan(resampled(joints_m[kept], TIMES_S[kept], TIMES_S)).any(axis=2)
    assert np.flatnonzero(missing[:, 6]).tolist() == [*range(60, 70), *range(80, 100)]
    assert np.flatnonzero(np.delete(missing, 6, axis=1).any(axis=1)).tolist() == [*range(80, 100)]


def test_confidence_is_a_weighted_mean_of_the_samples_around():
    confidence = np.random.default_rng(0).uniform(size=(len(TIMES_S), 15))
    at_s = np.array([0.5, 1.234, TIMES_S[-1] + 2])
    _, result = performance.resampled(JOINTS_M, confidence, TIMES_S, at_s)
    weights = np.exp(-0.5 * ((TIMES_S - at_s[:2, None]) / 0.08) ** 2) * (np.abs(TIMES_S - at_s[:2, None]) <= 0.25)
    np.testing.assert_allclose(result[:2], weights @ confidence / weights.sum(axis=1, keepdims=True))
    assert not result[2].any()  # no sample is near


def test_a_dance_on_an_absolute_clock_begins_with_its_first_frame_or_with_the_dance_beside_it():
    starts_s = 1.7e9, 1.7e9 + 1.5, 1.7e9 - 500, 12.0, 86400.0
    dances = [performance.Performance(JOINTS_M, start_s + TIMES_S) for start_s in starts_s]
    given = performance.from_absolute_clocks(dances)
    np.testing.assert_allclose([one.times_s[0] for one in given], [0, 1.5, 0, 12, 0])
    np.testing.assert_array_equal(given[3].times_s, dances[3].times_s)
    np.testing.assert_allclose(performance.from_absolute_clocks(dances[::-1])[3].times_s, TIMES_S, atol=1e-6)
    assert performance.from_absolute_clocks([]) == []
    with pytest.raises(InputError, match="dances: expected a list of them, got"):
        performance.from_absolute_clocks(dances[0])
    with pytest.raises(InputError, match="are they seconds"):
        performance.Performance(JOINTS_M, 1000 * (1.7e9 + TIMES_S))


@pytest.mark.parametrize("unit", [100, 1000])
def test_a_dance_in_centimetres_or_millimetres_is_refused_and_a_giant_in_metres_is_not(unit):
    dance_m = dance_joints_m(0, 4.0)
    times_s = np.arange(len(dance_m)) / 30
    for in_metres in (dance_m, 5 * dance_m, np.where(np.arange(15)[:, None] == Joint.HEAD, 1000 * dance_m, dance_m)):
        Performance(in_metres, times_s)
    with pytest.raises(InputError, match=r"bones of \d+(\.\d+)? m in the median: expected metres; of millimetres give"):
        Performance(unit * dance_m, times_s)


def test_what_is_no_dance_is_refused_in_one_line_online_and_offline():
    joints_m, times_s = np.zeros((60, 15, 3)), np.arange(60) / 30
    hidden = np.ma.masked_array(joints_m, np.arange(60)[:, None, None] < np.ones((15, 3)))
    online = OnlineScorer(performed(dance_joints_m(0, 4.0)))
    for joints, message in (
        (hidden, "a masked array"),
        ("none", "expected an array of numbers"),
        ([[1, 2], [3]], "of numbers"),
    ):
        with pytest.raises(InputError, match=f"joints: .*{message}"):
            Performance(joints, times_s)
        with pytest.raises(InputError, match=message):
            online.update(joints if isinstance(joints, str | list) else joints[0], 0.0)
    with pytest.raises(InputError, match="confidence: a masked array"):
        Performance(joints_m, times_s, hidden[..., 0])
    slow = Performance(dance_joints_m(0, 12.0)[::9], np.arange(360)[::9] / 30)
    for dances in ((slow, slow), (performed(dance_joints_m(0)), slow)):
        with pytest.raises(InputError, match=r"the \w+'s dance: frames are 0\.3 s apart, in the median"):
            score_dance(*dances)
    for teacher, message in ((slow, r"the teacher's dance: frames are 0\.3 s apart"), (joints_m, "expected a Performance")):
        with pytest.raises(InputError, match=message):
            OnlineScorer(teacher)


@pytest.mark.parametrize("start_s", [0.0, 0.1, 1 / 3, 0.123])
def test_frames_that_are_as_far_apart_as_they_may_be_leave_no_gap(start_s):
    times_s = start_s + np.arange(40) / 4
    at_s = start_s + np.arange(round(30 * 9.7)) / 30
    assert np.isfinite(resampled(np.tile(JOINTS_M[:1], (40, 1, 1)), times_s, at_s)).all()
