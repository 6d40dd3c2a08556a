"""Learners with one fault each score what a dance teacher would say, on composed and on recorded dances."""

from functools import cache

import dance_learners as made
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, mirrored, performed

from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import DanceScore, score_dance
from kpopnet.skeleton import Joint

SECONDS = 16.0
COMPOSED, RECORDED = ["composed 0", "composed 1"], ["g1_J_Dance11_Gnarly"]
"""The recorded dance is one of the split test: nothing was chosen on it."""


@cache
def taught_m(name: str) -> np.ndarray:
    if name in COMPOSED:
        return dance_joints_m(COMPOSED.index(name), SECONDS)
    if not made.CLIPS.is_dir():
        pytest.skip(f"{made.CLIPS}: no recorded dances here")
    return made.clip_joints_m("test", name, SECONDS)


def scored(name: str, joints_m: np.ndarray, delay_s: float = 0.0, tempo: float = 1.0) -> DanceScore:
    learner = Performance(joints_m, np.arange(len(joints_m)) / FPS / tempo + delay_s)
    return score_dance(performed(taught_m(name)), learner)


def begin_s(joints_m: np.ndarray) -> float:
    """When the teacher, who waits first in some recordings, has moved a joint by 10 cm relative to the torso."""
    relative_m = joints_m - joints_m[:, [Joint.TORSO]]
    return float(np.argmax(np.linalg.norm(relative_m - relative_m[0], axis=-1).max(axis=1) > 0.1) / FPS)


LEARNERS = {
    "copy": ((99.9, 100), lambda m: m),
    "movements at 0.75": ((55, 92), lambda m: made.smaller(m, 0.75)),
    "movements at 0.5": ((20, 75), lambda m: made.smaller(m, 0.5)),
    "hunched by 15 degrees": ((75, 97), lambda m: made.hunched(m, 15)),
    "hunched by 30 degrees": ((50, 90), lambda m: made.hunched(m, 30)),
    "arms 10 degrees low": ((80, 97), lambda m: made.arms_lowered(m, 10)),
    "arms 20 degrees low": ((45, 92), lambda m: made.arms_lowered(m, 20)),
    "arms 40 degrees low": ((0, 80), lambda m: made.arms_lowered(m, 40)),
    "bent elbows": ((0, 75), lambda m: made.elbows_bent(m, 45)),
    "turned from the camera": ((99.5, 100), lambda m: made.headed(m, np.full(len(m), 0.8))),
    "legs only": ((0, 70), made.legs_only),
    "arms only": ((10, 85), made.arms_only),
    "joins after 5 s of the dance": ((50, 70), lambda m: made.hidden(m, 0, begin_s(m) + 5)),
    "leaves for 5 s": ((55, 70), lambda m: made.hidden(m, 6, 11)),
    "still for 5 s": ((45, 96), lambda m: made.held(m, 6, 11)),
    "mirrored": ((0, 50), mirrored),
    "standing still": ((0, 10), made.standing),
    "mean pose": ((0, 15), made.mean_pose),
    "random waving": ((0, 10), made.waving),
    "1.5 times taller": ((99, 100), lambda m: 1.5 * m),
    "another build": ((99, 100), made.other_build),
}
"""Name to the interval that a teacher would accept, and the learner."""

LATE = {0.1: (85, 98), 0.2: (65, 92), 0.3: (40, 80), 0.5: (0, 30)}
"""Seconds by which a copy is late to the interval."""

DANCES = pytest.mark.parametrize("names", [COMPOSED, RECORDED], ids=["composed", "recorded"])


@DANCES
@pytest.mark.parametrize("learner", LEARNERS)
def test_a_learner_scores_what_a_teacher_would_say(names, learner):
    (low, high), of_teacher = LEARNERS[learner]
    for name in names:
        assert low <= scored(name, of_teacher(taught_m(name))).similarity <= high, name


@DANCES
def test_a_late_copy_another_tempo_and_another_dance_score_low_by_how_far_they_are_off(names):
    name = names[0]
    for delay_s, (low, high) in LATE.items():
        assert low <= scored(name, taught_m(name), delay_s).similarity <= high, delay_s
    for tempo in (0.9, 1.1):
        score = scored(name, taught_m(name), tempo=tempo)
        assert 3 < score.similarity < 50 and score.tempo == pytest.approx(tempo, abs=0.03)
    assert scored(name, taught_m(COMPOSED[1])).similarity < 20


def test_who_begins_two_seconds_late_is_not_told_a_tempo():
    """Seven of 29 windows fit elsewhere, by chance: 12% too slow, if they counted."""
    late_m = np.concatenate([np.repeat(taught_m(COMPOSED[0])[:1], round(2 * FPS), axis=0), taught_m(COMPOSED[0])])
    assert np.isnan(scored(COMPOSED[0], late_m[: len(taught_m(COMPOSED[0]))]).tempo)


def test_never_turning_costs_where_the_teacher_turns():
    teacher_m = made.headed(taught_m(COMPOSED[0]), np.linspace(0, 4 * np.pi, round(SECONDS * FPS)))
    score = score_dance(performed(teacher_m), performed(made.never_turning(teacher_m)))
    assert 40 < score.similarity < 85 and score.parts["turning"] < 85
    assert min(value for part, value in score.parts.items() if part != "turning") > 97


def test_a_teacher_who_waits_teaches_nothing_meanwhile():
    """Whoever stands in the pose in which the teacher waits is right all that time, and has not danced."""
    wait_s, (teacher_m, other_m) = 8.0, map(taught_m, COMPOSED)
    waiting_m = np.repeat(teacher_m[:1], round(wait_s * FPS), axis=0)
    teacher_m, other_m = (np.concatenate([waiting_m, one]) for one in (teacher_m, other_m))
    learners = teacher_m, made.standing(teacher_m), other_m, made.hidden(teacher_m, 0, wait_s)
    copy, still, other, late = (score_dance(performed(teacher_m), performed(one)) for one in learners)
    assert copy.similarity > 99.9 and late.similarity > 90 and still.similarity < 10 and other.similarity < 20
    weight = copy.windows.weight
    assert (weight[: round(2 * (wait_s - 2)) + 1] < 0.01).all() and (weight[round(2 * wait_s) :] > 0.9).mean() > 0.9


def test_a_teacher_who_never_moves_is_compared_all_the_same():
    still_m = made.standing(taught_m(COMPOSED[0]))
    scores = [score_dance(performed(still_m), performed(one)).similarity for one in (still_m, made.arms_lowered(still_m, 40))]
    assert scores[0] > 99.9 and scores[1] < 90


SEVERITIES = {
    "smaller movements": (made.smaller, (1, 0.75, 0.5, 0.25)),
    "smaller turns": (lambda m, x: made.headed(m, x * (made.heading_rad(m)[0] - made.heading_rad(m))), (0, 0.5, 1)),
    "hunched": (made.hunched, (0, 10, 20, 40)),
    "arms low": (made.arms_lowered, (0, 10, 20, 40)),
    "longer absence": (lambda m, seconds: made.hidden(m, 5, 5 + seconds), (0, 3, 6, 10)),
    "longer stillness": (lambda m, seconds: made.held(m, 4, 4 + seconds), (0, 4, 8, 12)),
}
"""Name to a fault of a severity, and severities in order."""


@pytest.mark.parametrize("fault", SEVERITIES)
def test_the_score_falls_with_the_severity_and_rises_when_a_fault_is_corrected(fault):
    of_severity, severities = SEVERITIES[fault]
    scores = [scored(COMPOSED[0], of_severity(taught_m(COMPOSED[0]), severity)).similarity for severity in severities]
    assert (np.diff(scores) < 0.2).all() and scores[-1] < scores[0] - 10, scores
