"""The verdict on each move."""

import numpy as np
import pytest

from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.skeleton import Joint
from kpopnet.teacher.live.lesson import Lesson
from kpopnet.teacher.live.moves import COUNTS, EARLY_S, Moves
from kpopnet.teacher.live.running import excerpt, scorer_config


@pytest.fixture(scope="module")
def dance(library):
    return library.dance("dance_001")


def judged(dance, learner: Performance, seconds: float = 10.0) -> list:
    """The verdicts on what a learner danced, with the time of the newest image at each."""
    teacher = excerpt(dance.performance, 0.0, seconds)
    scorer, found = OnlineScorer(teacher, scorer_config(Lesson("d"), "none")), []
    moves = Moves(0.0, seconds, 60 / dance.about.bpm)
    for joints_m, time_s in zip(learner.joints_m, learner.times_s, strict=True):
        latest = scorer.update(joints_m, float(time_s))
        verdict = latest and moves.judged(latest, scorer.score_so_far)
        if verdict:
            found.append((float(time_s), verdict))
    return found


def test_each_move_is_judged_once_soon_after_its_end(dance):
    found = judged(dance, excerpt(dance.performance, 0.0, 10.4))
    move_s = COUNTS * 60 / dance.about.bpm
    assert [one.number for _, one in found] == list(range(1, int((10 + EARLY_S) / move_s) + 1))
    for time_s, one in found:
        soonest_s = max(one.end_s, 2.0)  # the first window of the score lasts longer than the first move
        assert one.end_s == pytest.approx(one.number * move_s) and 0 < time_s - soonest_s < 0.27
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
    assert numbers == sorted(set(numbers)) and numbers[-1] == int((10 + EARLY_S) / move_s)
    assert found[-1].total == pytest.approx(100, abs=1) and np.isfinite(found[-1].end_s)
