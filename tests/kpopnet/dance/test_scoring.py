import dataclasses
import math

import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, mirrored, noisy, performed, turned
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import PARTS, SCORERS, ScorerConfig, score_dance, timing_similarity
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

DANCES = range(4)
BOTH = pytest.mark.parametrize("scorer", SCORERS)


def similarity(teacher_m, learner_m, config=SCORERS["dance22"], delay_s=0.0) -> float:
    return score_dance(performed(teacher_m), performed(learner_m, delay_s), config).similarity


@BOTH
@pytest.mark.parametrize("index", DANCES)
def test_a_perfect_copy_scores_above_95_for_any_position_size_and_heading(scorer, index):
    joints_m = dance_joints_m(index)
    assert similarity(joints_m, joints_m, SCORERS[scorer]) > 95
    assert similarity(joints_m, joints_m * 0.8 + [0.5, 0.1, 1], SCORERS[scorer]) > 95
    if scorer == "dance22":  # [17] depends on the heading of the camera
        assert similarity(joints_m, turned(joints_m, [0.1, 1, 0], 0.6)) > 95


@BOTH
@pytest.mark.parametrize("index", DANCES)
def test_a_copy_one_second_late_scores_no_timing_and_full_posture(scorer, index):
    joints_m = dance_joints_m(index)
    score = score_dance(performed(joints_m), performed(joints_m, 1.0), SCORERS[scorer])
    assert score.timing < 5
    assert score.posture > {"dance22": 94.5, "raptis": 95}[scorer]
    np.testing.assert_allclose(np.median(score.windows.delay_s), 1.0, atol=0.02)


@BOTH
@pytest.mark.parametrize("index", DANCES)
def test_a_mirrored_copy_scores_below_75(scorer, index):
    joints_m = dance_joints_m(index)
    assert similarity(joints_m, mirrored(joints_m), SCORERS[scorer]) < 75


@BOTH
@pytest.mark.parametrize("index", DANCES)
def test_standing_still_scores_below_20_and_another_dance_below_30(scorer, index):
    joints_m = dance_joints_m(index)
    still_m = np.repeat(joints_m[:1], len(joints_m), axis=0)
    assert similarity(joints_m, still_m, SCORERS[scorer]) < 20
    assert similarity(joints_m, dance_joints_m(index + 1), SCORERS[scorer]) < 30


@BOTH
@settings(max_examples=8, deadline=None)
@given(st.sampled_from(DANCES), st.lists(st.floats(0, 0.12), min_size=2, max_size=2), st.integers(0, 99))
def test_more_noise_never_scores_more(scorer, index, deviations_m, seed):
    less_m, more_m = sorted(deviations_m)
    joints_m = dance_joints_m(index)
    less, more = (similarity(joints_m, noisy(joints_m, d, seed), SCORERS[scorer]) for d in (less_m, more_m))
    assert more <= less + 0.5


@BOTH
@settings(max_examples=8, deadline=None)
@given(st.sampled_from(DANCES), st.lists(st.floats(-1.2, 1.2), min_size=2, max_size=2))
def test_more_delay_never_scores_more(scorer, index, delays_s):
    less_s, more_s = sorted(delays_s, key=abs)
    assume(abs(more_s) - abs(less_s) > 1 / FPS)  # the resolution of delays is half a frame
    joints_m = dance_joints_m(index)
    less, more = (similarity(joints_m, joints_m, SCORERS[scorer], d) for d in (less_s, more_s))
    assert more <= less + 1


def test_delays_of_noisy_dances_are_found():
    for index in DANCES:
        joints_m = dance_joints_m(index)
        for delay_s in (-0.25, 0.1, 0.4):
            windows = score_dance(performed(joints_m), performed(noisy(joints_m, 0.05), delay_s)).windows
            assert abs(np.median(windows.delay_s) - delay_s) < 0.05


def test_points_are_lost_in_the_part_and_window_of_the_fault():
    teacher_m = dance_joints_m(0)
    learner_m = teacher_m.copy()
    arm = [Joint.LEFT_ELBOW, Joint.LEFT_HAND]
    learner_m[180:240, arm] = learner_m[180:240, [Joint.LEFT_SHOULDER]] + [[0.0, 0.3, 0.0], [0.0, 0.55, 0.0]]
    score = score_dance(performed(teacher_m), performed(learner_m))
    assert score.parts["left"] < score.parts["right"] - 2
    assert score.parts["arms"] < min(score.parts["legs"], score.parts["torso"]) - 2
    faulty = (score.windows.start_s > 4.2) & (score.windows.start_s < 7.8)
    assert score.windows.parts["arms"][faulty].mean() < score.windows.parts["arms"][~faulty].min() - 1
    assert set(score.parts) == set(score.windows.parts) == set(PARTS)


def test_a_turn_of_the_whole_body_lowers_the_score_only_with_the_heading():
    teacher_m = dance_joints_m(0)
    turning_m = turned(teacher_m, [0, 1, 0], np.sin(np.arange(len(teacher_m)) / 20))
    heading = dataclasses.replace(SCORERS["dance22"], heading=True)
    assert similarity(teacher_m, turning_m) > 93.5
    assert similarity(teacher_m, turning_m, heading) < 85
    assert similarity(teacher_m, teacher_m, heading) > 95


def test_timing_similarity_is_eq_13():
    config = ScorerConfig(alpha=0.5, tau=0.4)
    assert timing_similarity(0.0, config) == pytest.approx(1 - math.exp(-2))
    assert timing_similarity(-0.2, config) == timing_similarity(0.2, config) == pytest.approx(1 - math.exp(-1))
    assert timing_similarity(0.4, config) == timing_similarity(3.0, config) == 0


def test_similarity_is_the_mean_of_the_windows_products():
    score = score_dance(performed(dance_joints_m(0)), performed(noisy(dance_joints_m(0), 0.05), 0.2))
    windows = score.windows
    np.testing.assert_allclose(windows.similarity, windows.timing * windows.posture / 100)
    assert score.similarity == pytest.approx(windows.similarity.mean())
    assert (score.timing, score.posture) == pytest.approx((windows.timing.mean(), windows.posture.mean()))
    np.testing.assert_allclose(np.diff(windows.start_s), 0.5)


def test_algorithm_3_does_not_find_a_late_copy():
    config = dataclasses.replace(SCORERS["dance22"], matching="algorithm_3")
    joints_m = dance_joints_m(0)
    late = score_dance(performed(joints_m), performed(joints_m, 1.0), config)
    assert late.posture < 50
    assert score_dance(performed(joints_m), performed(joints_m), config).similarity > 95


@BOTH
def test_a_joint_missing_for_a_second_hardly_lowers_the_score(scorer):
    joints_m = dance_joints_m(0)
    learner_m = joints_m.copy()
    learner_m[100:130, [Joint.LEFT_HAND, Joint.RIGHT_FOOT]] = np.nan
    score = score_dance(performed(joints_m), performed(learner_m), SCORERS[scorer])
    assert score.similarity > 90
    assert score.scored == 1


@BOTH
def test_a_person_missing_for_seconds_excludes_only_those_windows(scorer):
    joints_m = dance_joints_m(0)
    learner_m = joints_m.copy()
    learner_m[100:190] = np.nan
    score = score_dance(performed(joints_m), performed(learner_m), SCORERS[scorer])
    assert 0.5 < score.scored < 1
    assert score.similarity > 95
    lost = performed(np.full_like(joints_m, np.nan))
    unobserved = score_dance(performed(joints_m), lost, SCORERS[scorer], unobserved_is_nan=True)
    assert unobserved.scored == 0 and math.isnan(unobserved.similarity)


def test_dropped_frames_and_other_frame_rates_hardly_change_the_score():
    joints_m = dance_joints_m(0)
    kept = np.sort(np.random.default_rng(0).permutation(len(joints_m))[: len(joints_m) * 2 // 3])
    dropped = Performance(joints_m[kept], kept / FPS)
    assert score_dance(performed(joints_m), dropped).similarity > 90
    for fps in (15.0, 100.0):
        other = Performance(dance_joints_m(0, fps=fps), np.arange(round(12 * fps)) / fps)
        assert score_dance(performed(joints_m), other).similarity > 85


def test_a_learner_is_scored_only_within_the_teachers_dance():
    joints_m = dance_joints_m(0)
    teacher = Performance(joints_m[60:240], np.arange(60, 240) / FPS)
    score = score_dance(teacher, performed(joints_m))
    assert score.similarity > 95
    assert score.windows.start_s[0] == 2.0 and score.windows.start_s[-1] <= 6.0


def test_bones_of_zero_length_are_excluded():
    joints_m = dance_joints_m(0)
    learner_m = joints_m.copy()
    learner_m[:, Joint.LEFT_ELBOW] = learner_m[:, Joint.LEFT_SHOULDER]
    assert score_dance(performed(joints_m), performed(learner_m)).scored == 1
    point = score_dance(performed(joints_m), performed(np.zeros_like(joints_m)))
    assert point.scored == 0 and math.isnan(point.similarity)


def test_bad_input_is_rejected_with_a_message():
    joints_m = dance_joints_m(0)
    with pytest.raises(InputError, match=r"dance lasts 1\.63 s, less than a window of 2\.0 s"):
        score_dance(performed(joints_m[:50]), performed(joints_m))
    with pytest.raises(InputError, match=r"learner was recorded for 1\.63 s of a dance of 11\.97 s, in no whole window"):
        score_dance(performed(joints_m), performed(joints_m[:50]))
    with pytest.raises(InputError, match=r"learner was recorded for 0\.00 s"):
        score_dance(performed(joints_m), performed(joints_m, delay_s=100))
    with pytest.raises(InputError, match=r"frame 3 has time 0\.0: times must be finite and increase"):
        Performance(joints_m[:5], np.array([0, 0.1, 0.2, 0.0, 0.3]))
    with pytest.raises(InputError, match="frame 1 has time nan"):
        Performance(joints_m[:3], np.array([0, np.nan, 0.2]))
    with pytest.raises(InputError, match=r"joints of shape \(5, 14, 3\)"):
        Performance(joints_m[:5, :14], np.arange(5.0))
    with pytest.raises(InputError, match="expected one time a frame"):
        Performance(joints_m[:5], np.arange(4.0))
    with pytest.raises(InputError, match=r"confidence of shape \(5,\): expected one number a joint, \(5, 15\)"):
        Performance(joints_m[:5], np.arange(5.0), np.ones(5))
    for wrong in (-0.1, 1.1, np.nan):
        with pytest.raises(InputError, match="expected numbers from 0 to 1"):
            Performance(joints_m[:5], np.arange(5.0), np.full((5, 15), wrong))
    for wrong, message in (
        ({"tau": 0}, "^tau=0 must be"), ({"smoothing_s": 0}, "expected 0.02 to 0.5"), ({"steps": "odd"}, "slope, free"),
        ({"matching": "odd"}, "^matching=odd .*subsequence, algorithm_3"), ({"window_delay_penalty": -1}, "0 or more"),
        ({"window_s": 0.03}, "^window_s=0.03 .* at fps=30.0; give a longer one"),
        ({"outlier_rad": 0}, "inf for the plain norm"), ({"feature": "odd"}, "^feature=odd .*dance22, raptis"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            ScorerConfig(**wrong)


def test_dances_without_any_known_joint_are_refused():
    joints_m = dance_joints_m(0)
    known, lost = performed(joints_m), performed(np.full_like(joints_m, np.nan))
    doubted = Performance(joints_m, known.times_s, np.zeros(joints_m.shape[:2]))
    for unknown in (lost, doubted):
        with pytest.raises(InputError, match=r"the learner's dance: no joint is known in any of its 360 frames"):
            score_dance(known, unknown)
        with pytest.raises(InputError, match="the teacher's dance: no joint is known"):
            score_dance(unknown, known)
        with pytest.raises(InputError, match="the teacher's dance: no joint is known"):
            OnlineScorer(unknown)


def test_times_that_are_no_seconds_are_refused_before_memory_is_allocated():
    joints_m = dance_joints_m(0)
    for last_s in (3e6, 1e300):
        with pytest.raises(InputError, match="are they seconds"):
            Performance(joints_m[:3], np.array([0, 0.1, last_s]))
    with pytest.raises(InputError, match="are they seconds"):
        Performance(joints_m[:3], 1e12 + np.arange(3))
    assert len(Performance(joints_m[:3], np.array([-5, 0, 7190.0]))) == 3


def test_low_confidence_lowers_the_weight_and_confidence_zero_gives_no_score():
    joints_m = dance_joints_m(0)
    teacher, times_s = performed(joints_m), np.arange(len(joints_m)) / FPS
    lost_m, confidences = joints_m.copy(), np.ones(joints_m.shape[:2])
    arm = [Joint.LEFT_ELBOW, Joint.LEFT_HAND]
    lost_m[:, arm] = dance_joints_m(1)[: len(joints_m), arm]
    scores = {}
    for confidence in (1.0, 0.3, 0.0):
        confidences[:, arm] = confidence
        scores[confidence] = score_dance(teacher, Performance(lost_m, times_s, confidences))
    assert scores[1.0].similarity + 10 < scores[0.3].similarity < scores[0.0].similarity
    assert scores[0.0].similarity > 95
    lost_m[:, arm] = np.nan
    missing = score_dance(teacher, Performance(lost_m, times_s))
    assert scores[0.0].similarity == pytest.approx(missing.similarity, abs=0.5)
    arms = [*arm, Joint.RIGHT_ELBOW, Joint.RIGHT_HAND]
    confidences[:, arms] = 0
    unseen = score_dance(teacher, Performance(joints_m, times_s, confidences))
    assert math.isnan(unseen.parts["arms"]) and unseen.parts["legs"] > 95
    unobserved = score_dance(teacher, Performance(joints_m, times_s, np.zeros_like(confidences)), unobserved_is_nan=True)
    assert math.isnan(unobserved.similarity) and unobserved.scored == 0


@settings(max_examples=6, deadline=None)
@given(st.floats(0.2, 1.0))
def test_a_constant_confidence_does_not_matter(confidence):
    joints_m = dance_joints_m(2)
    learner_m, times_s = noisy(joints_m, 0.05), np.arange(len(joints_m)) / FPS
    with_full, with_constant = (
        score_dance(performed(joints_m), Performance(learner_m, times_s, np.full(joints_m.shape[:2], c))).similarity
        for c in (1.0, confidence)
    )
    assert with_constant == pytest.approx(with_full, abs=1e-6)


def test_bad_input_to_the_online_scorer_is_rejected_with_a_message():
    joints_m = dance_joints_m(0)
    scorer = OnlineScorer(performed(joints_m))
    scorer.update(joints_m[0], 0.0)
    with pytest.raises(InputError, match=r"joints of shape \(14, 3\)"):
        scorer.update(joints_m[0, :14], 0.1)
    with pytest.raises(InputError, match=r"confidence of shape \(14,\)"):
        scorer.update(joints_m[1], 0.1, np.ones(14))
    with pytest.raises(InputError, match=r"a frame at 0\.0 s"):
        scorer.update(joints_m[0], 0.0)
    with pytest.raises(InputError, match="no whole window"):
        scorer.finish()
    with pytest.raises(InputError, match="no whole window"):
        OnlineScorer(performed(joints_m)).finish()


@pytest.mark.parametrize(
    "config",
    [*SCORERS.values(), ScorerConfig(heading=True, steps="free", hop_s=0.8)],
)
def test_online_scores_equal_offline_scores(config):
    teacher = Performance(dance_joints_m(1)[15:], np.arange(15, 360) / FPS)
    rng = np.random.default_rng(0)
    joints_m = noisy(dance_joints_m(1), 0.03)
    joints_m[100:130, 6] = np.nan
    kept = np.delete(np.arange(360), np.r_[200:215, 300:302])
    times_s = kept / FPS + rng.uniform(0, 0.02, len(kept)) + 0.2
    confidence = rng.uniform(size=joints_m.shape[:2])
    scorer, latest = OnlineScorer(teacher, config), []
    for frame, time_s in zip(kept, times_s, strict=True):
        latest.append(scorer.update(joints_m[frame], time_s, confidence[frame]))
    whole, online = score_dance(teacher, Performance(joints_m[kept], times_s, confidence[kept]), config), scorer.finish()
    for a, b in zip(whole[:3], online[:3], strict=True):
        assert a == b
    for name in ("start_s", "delay_s", "timing", "posture", "similarity"):
        np.testing.assert_array_equal(getattr(whole.windows, name), getattr(online.windows, name))
    assert latest[10] is None
    # The online score at the end of each window, where no later sample of that window was delayed.
    windows = {round(score.time_s, 3): score for score in latest if score is not None}
    ends = np.round(whole.windows.start_s + (config.window_frames - 1) / config.fps, 3)
    posture = {end: posture for end, posture in zip(ends, whole.windows.posture, strict=True) if end in windows}
    assert len(posture) > 0.5 * len(ends)
    assert posture == {end: windows[end].posture for end in posture}


def test_arrays_score_as_performances_do():
    joints_m, learner_m = dance_joints_m(0), noisy(dance_joints_m(0), 0.02)
    expected = score_dance(performed(joints_m), performed(learner_m)).similarity
    assert score_dance(joints_m, learner_m, fps=FPS).similarity == expected
    assert score_dance(performed(joints_m), learner_m, fps=FPS).similarity == expected
    with pytest.raises(InputError, match="teacher's dance is an array without times and fps=None; give its frames"):
        score_dance(joints_m, learner_m)
    with pytest.raises(InputError, match=r"the learner's dance: joints of shape \(360, 14, 3\)"):
        score_dance(joints_m, learner_m[:, :14], fps=FPS)
