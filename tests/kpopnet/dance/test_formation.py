"""Places of a group relative to each other, on composed dances that travel."""

import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, performed
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.dance.dimensions.formation import MOST_SPREAD, formation
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

SECONDS, FAULT_S = 16.0, (6.0, 10.0)
PLACES_M = np.array([[1.0, 0.0], [0.0, 0.8], [-1.0, 0.0]])  # right of the camera, away from it
HIPS = [Joint.LEFT_HIP, Joint.RIGHT_HIP]


def group(places_m=PLACES_M, spread=1.0, away_m=0.0):
    """Three dancers: (T, 15, 3) joints, their paths over the floor multiplied by a factor and moved away from the camera."""
    dancers = []
    for index, place_m in enumerate(places_m):
        joints_m = dance_joints_m(index, SECONDS)
        path_m = joints_m[:, HIPS].mean(axis=1, keepdims=True) * [1, 0, 1] - [0, 0, 3]
        there_m = (path_m + np.insert(place_m, 1, 0)) * spread + [0, 0, 3 + away_m]
        dancers.append(joints_m - path_m - [0, 0, 3] + there_m)
    return dancers


def graded(learners, teachers=None, free_s=()):
    teachers = group() if teachers is None else teachers
    return formation([performed(one) for one in teachers], [performed(one) for one in learners], free_s)


def aside(metres):
    """The group, of which the third stands some metres aside for a while."""
    learners, seconds = group(), np.arange(round(SECONDS * FPS)) / FPS
    during = (seconds >= FAULT_S[0]) & (seconds < FAULT_S[1])
    return [*learners[:2], learners[2] + during[:, None, None] * [metres, 0, 0]]


@settings(max_examples=10, deadline=None)
@given(st.floats(1 / MOST_SPREAD, MOST_SPREAD), st.floats(-0.5, 2.0))
def test_a_smaller_room_and_another_distance_of_the_camera_are_right(spread, away_m):
    found = graded(group(spread=spread, away_m=away_m))
    assert found.similarity == pytest.approx(100, abs=0.1) and found.spread == pytest.approx(spread, rel=1e-3)
    assert not found.remarks


def test_the_farther_one_stands_from_their_place_the_less_and_who_where_and_when_is_told():
    found = [graded(aside(metres)) for metres in (0.0, 0.4, 0.8, 1.2)]
    figures = [one.similarity for one in found]
    assert figures[0] > 99 and np.all(np.diff(figures) < -5), figures
    member, at_s, text = found[-1].remarks[-1]
    assert member == 2 and at_s == pytest.approx(FAULT_S[0], abs=0.1) and "too far left" in text
    free = graded(aside(1.2), free_s=[FAULT_S])
    assert free.similarity > 99 and not free.remarks


def test_those_who_changed_places_are_wrong_but_stand_as_far_apart():
    found = graded(group(PLACES_M[::-1]))
    assert found.similarity < 5 and found.spread == pytest.approx(1, abs=0.05)


def test_who_is_not_seen_together_for_a_window_is_not_graded():
    first, second, third = group()
    assert graded([first, np.full_like(second, np.nan), third]) is None
    assert formation([performed(one) for one in group()], [performed(one, delay_s=SECONDS) for one in group()]) is None


@pytest.mark.parametrize("seconds", [2.5, SECONDS])
@pytest.mark.parametrize("centred", [("teacher",), ("learner",), ("teacher", "learner")])
def test_joints_about_the_hips_hold_no_places(centred, seconds):
    """As MediaPipe's world landmarks: all members dance in one point, which would be a right formation or a wrong one."""
    groups = {name: [one[: round(seconds * FPS)] for one in group()] for name in ("learner", "teacher")}
    for name in centred:
        groups[name] = [one - one[:, HIPS].mean(axis=1, keepdims=True) for one in groups[name]]
    found = graded(*groups.values())
    assert found.centred == centred and np.isnan([found.similarity, found.spread]).all() and not found.remarks


def test_two_who_stand_still_for_a_short_while_have_places():
    first, *others = (np.broadcast_to(one[:1], (75, 15, 3)) for one in group())
    assert graded([first, *others], [first, *others]).similarity > 99
    assert graded([first], [first])[:2] == (100, 1)
    # Who is not seen does not stand where another does.
    assert graded([np.full_like(first, np.nan), *others], [first, *others]) is None


def test_a_group_is_as_large_as_those_of_its_teachers_whose_feet_are_seen():
    footless, *others = group()
    footless[:, [Joint.LEFT_FOOT, Joint.RIGHT_FOOT]] = np.nan
    assert graded(group(), [footless, *others]).similarity > 99
    assert graded([footless], [footless]) is None
    for learners, teachers in ((0, 0), (3, 2)):
        with pytest.raises(InputError, match=f"{teachers} teachers and {learners} learners"):
            graded(group()[:learners], group()[:teachers])


def test_members_are_levelled_together():
    """The same group before two cameras, of which one looks down on it: one member leans all the time."""
    leaning, cosine, sine = group(), *(f(np.radians(25)) for f in (np.cos, np.sin))
    hips_m = leaning[0][:, HIPS].mean(axis=1, keepdims=True)
    to_side = np.array([[np.cos(0.35), np.sin(0.35), 0], [-np.sin(0.35), np.cos(0.35), 0], [0, 0, 1]])
    leaning[0] = hips_m + (leaning[0] - hips_m) @ to_side
    looks_down = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    above = [(one + np.array([0, 1.5, 0])) @ looks_down.T for one in leaning]
    found = graded(above, leaning)
    assert found.similarity > 99 and found.spread == pytest.approx(1, abs=0.01) and not found.remarks


def test_who_stands_too_near_the_camera_is_too_far_forward():
    learners = group()
    learners[2] = learners[2] - [0, 0, 1.2]
    (told,) = {str(text).split(" m ")[1] for member, _, text in graded(learners).remarks if member == 2}
    assert told == "too far forward"


def test_a_room_of_less_than_half_a_stage_is_too_small():
    found = graded(group(spread=0.5 / MOST_SPREAD))
    assert found.spread == pytest.approx(1 / MOST_SPREAD) and found.similarity < 90


def test_two_in_a_smaller_room_are_right_too():
    found = graded(group(spread=0.7)[:2], group()[:2])
    assert found.similarity == pytest.approx(100, abs=0.1) and found.spread == pytest.approx(0.7, rel=1e-3)


def test_a_fault_after_a_free_part_counts_and_is_told_at_the_time_of_the_dance():
    assert graded(aside(1.2), free_s=[(0.0, 4.0)]).similarity < graded(aside(1.2)).similarity - 10
    until = graded(aside(1.2), free_s=[(0.0, FAULT_S[0])])  # it is free no longer than it says
    assert until.remarks[-1][1] == pytest.approx(FAULT_S[0], abs=0.1)
    later = [[performed(one, delay_s=5.0) for one in dancers] for dancers in (group(), aside(1.2))]
    assert formation(*later).remarks[-1][1] == pytest.approx(FAULT_S[0] + 5, abs=0.1)
