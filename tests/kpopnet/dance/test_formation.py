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


def graded(learners):
    return formation([performed(one) for one in group()], [performed(one) for one in learners])


@settings(max_examples=10, deadline=None)
@given(st.floats(1 / MOST_SPREAD, MOST_SPREAD), st.floats(-0.5, 2.0))
def test_a_smaller_room_and_another_distance_of_the_camera_are_right(spread, away_m):
    found = graded(group(spread=spread, away_m=away_m))
    assert found.similarity == pytest.approx(100, abs=0.1) and found.spread == pytest.approx(spread, rel=1e-3)
    assert not found.remarks


def test_the_farther_one_stands_from_their_place_the_less_and_who_where_and_when_is_told():
    figures = []
    for metres in (0.0, 0.4, 0.8, 1.2):
        learners = group()
        seconds = np.arange(len(learners[0])) / FPS
        learners[2] = learners[2] + ((seconds >= FAULT_S[0]) & (seconds < FAULT_S[1]))[:, None, None] * [metres, 0, 0]
        found = graded(learners)
        figures.append(found.similarity)
    assert figures[0] > 99 and np.all(np.diff(figures) < -5), figures
    member, at_s, text = found.remarks[-1]
    assert member == 2 and at_s == pytest.approx(FAULT_S[0], abs=0.1) and "too far left" in text


def test_those_who_changed_places_are_wrong_but_stand_as_far_apart():
    found = graded(group(PLACES_M[::-1]))
    assert found.similarity < 5 and found.spread == pytest.approx(1, abs=0.05)


def test_where_members_stand_while_all_is_free_is_not_graded():
    learners, seconds = group(), np.arange(round(SECONDS * FPS)) / FPS
    inside = (seconds >= FAULT_S[0]) & (seconds < FAULT_S[1])
    learners[2] = learners[2] + inside[: len(learners[2]), None, None] * [1.2, 0, 0]
    teachers, danced = ([performed(one) for one in dancers] for dancers in (group(), learners))
    found = formation(teachers, danced, [FAULT_S])
    assert found.similarity > 99 and not found.remarks


def test_who_is_not_seen_together_for_a_window_is_not_graded():
    learners = [performed(one) for one in group()]
    learners[1].joints_m[:] = np.nan
    assert formation([performed(one) for one in group()], learners) is None
    late = [performed(one, delay_s=SECONDS) for one in group()]
    assert formation([performed(one) for one in group()], late) is None


@pytest.mark.parametrize("seconds", [2.5, SECONDS])
@pytest.mark.parametrize("centred", [("teacher",), ("learner",), ("teacher", "learner")])
def test_joints_about_the_hips_hold_no_places(centred, seconds):
    """As MediaPipe's world landmarks: all members dance in one point, which would be a right formation or a wrong one."""
    groups = {name: [one[: round(seconds * FPS)] for one in group()] for name in ("teacher", "learner")}
    for name in centred:
        groups[name] = [one - one[:, HIPS].mean(axis=1, keepdims=True) for one in groups[name]]
    found = formation(*([performed(one) for one in dancers] for dancers in groups.values()))
    assert found.centred == centred and np.isnan([found.similarity, found.spread]).all() and not found.remarks


def test_two_who_stand_still_for_a_short_while_have_places():
    still = [np.broadcast_to(one[:1], (75, 15, 3)) for one in group()]
    pairs = [[performed(one) for one in dancers] for dancers in (still, still)]
    assert formation(*pairs).similarity > 99
    pairs[1][0].joints_m[:] = np.nan
    assert formation(*pairs) is None  # who is not seen does not stand where another does


def test_a_group_is_as_large_as_those_of_its_teachers_whose_feet_are_seen():
    teachers = group()
    teachers[0] = teachers[0].copy()
    teachers[0][:, [Joint.LEFT_FOOT, Joint.RIGHT_FOOT]] = np.nan
    assert formation(*([performed(one) for one in dancers] for dancers in (teachers, group()))).similarity > 99
    footless = [performed(teachers[0])]
    assert formation(footless, footless) is None


@pytest.mark.parametrize("learners", [0, 1, 3])
def test_groups_of_other_sizes_are_refused(learners):
    teachers = [performed(one) for one in group()[:2]] if learners else []
    with pytest.raises(InputError, match=f"{len(teachers)} teachers and {learners} learners"):
        formation(teachers, [performed(one) for one in group()[:learners]])
