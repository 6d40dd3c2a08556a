"""The verdict on each move."""

import numpy as np
import pytest

from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.skeleton import Joint
from kpopnet.teacher.live.lesson import Lesson
from kpopnet.teacher.live.moves import COUNTS, LEAST_S, WAIT_S, Moves
from kpopnet.teacher.live.running import excerpt, scorer_config


@pytest.fixture(scope="module")
def dance(library):
    return library.dance("dance_001")


def judged(dance, learner: Performance, seconds: float = 10.0, bpm: float | None = None) -> list:
    """The verdicts on what a learner danced, with the time of the newest image at each."""
    teacher = excerpt(dance.performance, 0.0, seconds)
    scorer, found = OnlineScorer(teacher, scorer_config(Lesson("d"), "none")), []
    moves = Moves(0.0, seconds, 60 / (bpm or dance.about.bpm))
    for joints_m, time_s in zip(learner.joints_m, learner.times_s, strict=True):
        scorer.update(joints_m, float(time_s))
        if verdict := moves.judged(scorer, float(time_s), speed=1.0):
            found.append((float(time_s), verdict))
    return found


def test_each_move_is_judged_once_soon_after_its_end(dance):
    found = judged(dance, excerpt(dance.performance, 0.0, 10.4))
    move_s = COUNTS * 60 / dance.about.bpm
    assert [one.number for _, one in found] == list(range(1, int(10.01 / move_s) + 1))
    for time_s, one in found:
        assert one.end_s == pytest.approx(one.number * move_s) and WAIT_S <= time_s - one.end_s < WAIT_S + 1 / dance.fps
        assert one.total > 99 and one.words == ""


def test_the_reason_is_the_limb_that_hangs_and_only_while_it_hangs(dance):
    whole = excerpt(dance.performance, 0.0, 10.4)
    joints_m, move_s = whole.joints_m.copy(), COUNTS * 60 / dance.about.bpm
    hanging = whole.times_s > 2 * move_s
    for joint, down_m in ((Joint.LEFT_ELBOW, 0.28), (Joint.LEFT_HAND, 0.53)):
        joints_m[hanging, joint] = joints_m[hanging, Joint.LEFT_SHOULDER] + [0, down_m, 0.02]
    found = [one for _, one in judged(dance, Performance(joints_m, whole.times_s))]
    assert [one.words for one in found[:2]] == ["", ""]
    assert all(one.words.startswith("left arm") and one.total < 90 for one in found[3:])


def test_who_is_late_is_told_so(dance):
    whole = excerpt(dance.performance, 0.0, 10.4)
    late = Performance(whole.joints_m, whole.times_s + 0.3)
    words = [one.words for _, one in judged(dance, late)][1:]
    assert words and words.count("late") > len(words) / 2


def test_after_a_gap_the_next_move_is_judged_and_those_in_it_are_not(dance):
    whole, move_s = excerpt(dance.performance, 0.0, 10.4), COUNTS * 60 / dance.about.bpm
    seen = (whole.times_s < 0.9 * move_s) | (whole.times_s > 2.2 * move_s)
    found = [one for _, one in judged(dance, Performance(whole.joints_m[seen], whole.times_s[seen]))]
    numbers = [one.number for one in found]
    assert numbers == sorted(set(numbers)) and numbers[-1] == int(10.01 / move_s)
    assert found[-1].total == pytest.approx(100, abs=1) and np.isfinite(found[-1].end_s)


def test_moves_shorter_than_anything_can_be_said_of_begin_with_the_first_that_can_be_judged(dance):
    bpm = 360.0
    found = judged(dance, excerpt(dance.performance, 0.0, 4.4), 4.0, bpm)
    move_s = COUNTS * 60 / bpm
    assert found[0][1].end_s == pytest.approx(move_s) and found[0][0] == pytest.approx(LEAST_S + WAIT_S, abs=0.04)
    assert [one.number for _, one in found] == list(range(1, round(4.0 / move_s) + 1))
    assert all(one.total > 99 for _, one in found)


def test_a_verdict_leaves_the_score_as_it_is(dance):
    """A scorer that is asked for verdicts gives what one that is not asked gives, frame by frame and at the end."""
    learner, teacher = excerpt(dance.performance, 0.0, 6.4), excerpt(dance.performance, 0.0, 6.0)
    joints_m = learner.joints_m + np.random.default_rng(1).normal(0, 0.04, learner.joints_m.shape)
    for mirrored in (True, False):
        asked, other = (OnlineScorer(teacher, scorer_config(Lesson("d", mirrored=mirrored), "none")) for _ in range(2))
        previewed = 0
        for one_m, time_s in zip(joints_m, learner.times_s.tolist(), strict=True):
            latest = [scorer.update(one_m, time_s) for scorer in (asked, other)]
            assert repr(latest[0]) == repr(latest[1])
            previewed += asked.preview(time_s - 0.01, LEAST_S) is not None
        assert previewed > 100
        np.testing.assert_array_equal(asked.finish().windows.similarity, other.finish().windows.similarity)


def test_a_verdict_is_the_score_of_the_window_when_all_is_known(dance):
    """Three images after the end the score hardly differs from that of the window when its smoothing is complete."""
    learner, teacher = excerpt(dance.performance, 0.0, 8.4), excerpt(dance.performance, 0.0, 8.0)
    joints_m = learner.joints_m + np.random.default_rng(2).normal(0, 0.03, learner.joints_m.shape)
    scorer, previewed, known = OnlineScorer(teacher, scorer_config(Lesson("d"), "none")), {}, {}
    for one_m, time_s in zip(joints_m, learner.times_s.tolist(), strict=True):
        if latest := scorer.update(one_m, time_s):
            known[round(latest.time_s * 30)] = latest
        if early := scorer.preview(time_s - WAIT_S, LEAST_S):
            previewed[round(early.time_s * 30)] = early
    common = sorted(set(known) & set(previewed))
    off = [previewed[frame].similarity - known[frame].similarity for frame in common]
    assert len(common) > 150 and np.abs(off).max() < 3 and np.abs(off).mean() < 0.5
    assert {previewed[frame].time_s for frame in common} == {known[frame].time_s for frame in common}
    assert min(previewed) < min(known)  # the dance's first window may be shorter


def test_before_anything_is_seen_there_is_no_verdict(dance):
    scorer = OnlineScorer(excerpt(dance.performance, 0.0, 8.0), scorer_config(Lesson("d"), "none"))
    assert scorer.preview(3.0, LEAST_S) is None
    scorer.update(dance.joints_m[150], 5.0)  # the learner arrives late
    assert scorer.preview(5.0, LEAST_S).similarity == 0.0
