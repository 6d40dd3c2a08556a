"""Who is who, from places alone."""

import numpy as np
import pytest

from kpopnet.finder.following import DOUBTED_S, FORGOTTEN_S, UNKNOWN, Followed
from kpopnet.pose import PersonPose
from kpopnet.teacher.live.loop import Learners


def walk(*paths):
    """The identities, image by image, of people whose places are given for each image, None where they are not found."""
    followed, found = Followed(), []
    for places in zip(*paths, strict=True):
        present = [k for k, place in enumerate(places) if place is not None]
        centres_m = np.array([places[k] for k in present], np.float32).reshape(-1, 3)
        found.append(
            dict(zip(present, followed.identify(centres_m, np.ones(len(present), bool), len(found) / 30), strict=True))
        )
    return found


def line(start, end, images):
    return [tuple(place) for place in np.linspace(start, end, images)]


def test_somebody_hidden_for_a_while_is_still_the_same():
    path = line((-1, 0, 3), (1, 0, 3), 60)
    found = walk(line((0, 0, 2), (0, 0, 2), 60), path[:25] + [None] * 8 + path[33:])
    assert found[-1] == found[0]


def test_who_returns_after_a_while_has_the_old_identity_and_who_comes_has_a_new_one():
    away = [None] * (round(30 * FORGOTTEN_S) + 5)
    found = walk([(-1.5, 0, 3)] * 5 + away + [(1.5, 0, 2)] * 5, [(0, 0, 3)] * (10 + len(away)))
    assert found[-1] == found[0]
    found = walk([(-1.5, 0, 3)] * 10, [None] * 5 + [(1.5, 0, 3)] * 5)
    assert found[-1][0] == found[0][0] and found[-1][1] not in found[0].values()
    found = walk([(-1.5, 0, 3)] * 5 + [None] * 5, [None] * 5 + [(1.5, 0, 3)] * 5)  # while the first is only hidden
    assert found[-1][1] != found[0][0]


def test_a_camera_that_turns_does_not_confuse_people():
    paths = [[(x + 0.03 * k, 0, 3) for k in range(40)] for x in (-1.0, 0.0, 1.0)]
    found = walk(*paths)
    assert all(one == found[0] for one in found)


def test_who_is_followed_needs_less_certainty_than_who_is_new():
    followed, place = Followed(), np.array([[0, 0, 3]], np.float32)
    assert followed.identify(place, np.array([False]), 0.0) == [UNKNOWN]
    (identity,) = followed.identify(place, np.array([True]), 0.1)
    two = np.array([[1.5, 0, 3], [0.02, 0, 3]], np.float32)
    assert followed.identify(two, np.array([False, False]), 0.2) == [UNKNOWN, identity]


def test_who_reappears_is_rather_one_who_was_hidden_a_moment_ago_than_one_who_left_long_ago():
    followed, alone, both = Followed(), np.array([[1, 0, 3]], np.float32), np.array([[1, 0, 3], [-1, 0, 3]], np.float32)
    stays, leaves = followed.identify(both, np.array([True, True]), 0.0)
    for time_s in range(1, 601):
        assert followed.identify(alone, CERTAIN, float(time_s)) == [stays]
    followed.identify(alone[:0], CERTAIN[:0], 601.0)
    assert followed.identify(alone + np.float32([0, 0, 3]), CERTAIN, 603.0) == [stays] != [leaves]


def test_a_clock_that_is_put_back_makes_nobody_somebody_else():
    followed, place = Followed(), np.array([[0, 0, 3]], np.float32)
    times_s = (10.0, 10.03, 10.07, 9.8, 9.83, 9.87, 2.0, 2.03)
    assert [followed.identify(place, CERTAIN, time_s) for time_s in times_s] == [[0]] * len(times_s)


CERTAIN, DOUBTFUL = np.array([True]), np.array([False])


def test_an_empty_chair_does_not_stay_a_person_for_ever():
    followed, chair = Followed(), np.array([[0, 0, 3]], np.float32)
    identities = [followed.identify(chair, CERTAIN if number == 0 else DOUBTFUL, number / 30)[0] for number in range(120)]
    times_s = np.flatnonzero(np.array(identities) != UNKNOWN) / 30
    assert np.diff(times_s).max() < 0.05 and times_s[-1] == pytest.approx(DOUBTED_S, abs=0.05)
    assert followed.identify(chair, CERTAIN, 4.1) == [0]  # a person sits down on it


def test_an_empty_chair_that_was_taken_for_a_person_does_not_become_the_learner():
    followed, learners, chosen = Followed(), Learners(1), []
    person_m, chair_m, images = (0, 0, 3), (1, 0.3, 3), 300
    for number in range(images):
        # The chair is certain once; the person leaves after two seconds and is back after nine.
        away = 60 <= number < 270
        centres_m = np.array([chair_m] if away else [chair_m, person_m], np.float32)
        identities = followed.identify(centres_m, np.array([number == 59, True])[: len(centres_m)], number / 30)
        people = [PersonPose(identity, np.zeros((15, 3)), np.ones(15)) for identity in identities if identity != UNKNOWN]
        (one,) = learners.choose(people, number / 30)
        chosen.append(UNKNOWN if one is None else one.identity)
    assert chosen == [0] * 60 + [UNKNOWN] * 210 + [0] * 30


def test_a_chair_that_is_no_longer_trusted_does_not_take_the_identity_of_who_stands_beside_it():
    followed = Followed()
    both = np.array([[0, 0, 3], [0.25, 0, 3]], np.float32)
    found = [followed.identify(both, np.array([True, number == 0]), number / 30) for number in range(120)]
    assert found[0] == [0, 1] and found[-1] == [0, UNKNOWN]


@pytest.mark.parametrize("fps", [5, 90])
def test_people_who_walk_keep_their_identities_at_any_rate_of_images(fps):
    followed, images = Followed(), 2 * fps
    paths_m = np.array([line((-1.5, 0, 3), (1.5, 0, 3), images), line((1.5, 0, 3.3), (-1.5, 0, 3.3), images)], np.float32)
    found = [followed.identify(paths_m[:, number], np.ones(2, bool), number / fps) for number in range(images)]
    assert found == [[0, 1]] * images


def test_people_who_move_while_the_images_stall_are_still_the_same():
    followed, certain = Followed(), np.ones(2, bool)
    places_m = np.array([[0, 0, 3], [2, 0, 4]], np.float32)
    assert [followed.identify(places_m, certain, time_s) for time_s in (0.0, 0.03)] == [[0, 1]] * 2
    moved_m = places_m + np.array([[0.3, 0.5, 0.5], [-0.5, 0, 0.3]], np.float32)
    assert followed.identify(moved_m[::-1], certain, 1.63) == [1, 0]


def test_nobody_is_given_to_an_uncertain_detection_so_that_somebody_hidden_gets_their_place():
    followed, certain = Followed(), np.ones(2, bool)
    stands, other, between = ((x, 0, 3) for x in (0.0, 1.25, -0.4))
    for image in range(10):
        assert followed.identify(np.array([stands, other]), certain, image / 30) == [0, 1]
    for image in range(10, 40):
        assert followed.identify(np.array([stands]), certain[:1], image / 30) == [0]
    assert followed.identify(np.array([stands, between]), np.array([True, False]), 40 / 30) == [0, UNKNOWN]
    assert followed.identify(np.array([stands]), certain[:1], 41 / 30) == [0]


def test_nobody_is_found_again_farther_away_than_people_get():
    away = 15  # images: half a second
    near, far = (walk([(0, 0, 3)] * 10 + [None] * (away + 5), [None] * (10 + away) + [(x, 0, 3)] * 5) for x in (3.0, 4.0))
    assert near[-1][1] == near[0][0]
    assert far[-1][1] != far[0][0]
