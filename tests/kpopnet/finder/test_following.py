"""Who is who, from places alone."""

import numpy as np
import pytest

from kpopnet.finder.following import DOUBTED_S, FORGOTTEN_S, MOST_MISSING, UNKNOWN, Followed


def seen(followed, time_s, *places_m, doubtful=()):
    """The identities of people who are found at some places, all certain but those whose numbers are doubtful."""
    certain = np.array([number not in doubtful for number in range(len(places_m))], bool)
    return followed.identify(np.array(places_m, np.float32).reshape(-1, 3), certain, time_s)


def walk(*paths):
    """The identities, image by image, of people whose places are given for each image, None where they are not found."""
    followed, found = Followed(), []
    for places in zip(*paths, strict=True):
        present = [k for k, place in enumerate(places) if place is not None]
        identities = seen(followed, len(found) / 30, *(places[k] for k in present))
        found.append(dict(zip(present, identities, strict=True)))
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
    followed, place = Followed(), (0, 0, 3)
    assert seen(followed, 0.0, place, doubtful=[0]) == [UNKNOWN]
    (identity,) = seen(followed, 0.1, place)
    assert seen(followed, 0.2, (1.5, 0, 3), (0.02, 0, 3), doubtful=[0, 1]) == [UNKNOWN, identity]


def test_who_reappears_is_rather_one_who_was_hidden_a_moment_ago_than_one_who_left_long_ago():
    followed = Followed()
    stays, leaves = seen(followed, 0.0, (1, 0, 3), (-1, 0, 3))
    for time_s in range(1, 601):
        assert seen(followed, float(time_s), (1, 0, 3)) == [stays]
    seen(followed, 601.0)
    assert seen(followed, 603.0, (1, 0, 6)) == [stays] != [leaves]


def test_a_clock_that_is_put_back_makes_nobody_somebody_else():
    followed, times_s = Followed(), (10.0, 10.03, 10.07, 9.8, 9.83, 9.87, 2.0, 2.03)
    assert [seen(followed, time_s, (0, 0, 3)) for time_s in times_s] == [[0]] * len(times_s)


def test_an_empty_chair_does_not_stay_a_person_for_ever():
    followed, chair = Followed(), (0, 0, 3)
    identities = [seen(followed, number / 30, chair, doubtful=[0] if number else [])[0] for number in range(120)]
    times_s = np.flatnonzero(np.array(identities) != UNKNOWN) / 30
    assert np.diff(times_s).max() < 0.05 and times_s[-1] == pytest.approx(DOUBTED_S, abs=0.05)
    assert seen(followed, 4.1, chair) == [0]  # a person sits down on it


def test_an_empty_chair_that_was_taken_for_a_person_does_not_become_who_left():
    """The chair is certain once; the person leaves after two seconds and is back after nine."""
    followed, person, chair = Followed(), (0, 0, 3), (1, 0.3, 3)
    for number in range(300):
        away = 60 <= number < 270
        places = [chair] if away else [chair, person]
        of_chair, *of_person = seen(followed, number / 30, *places, doubtful=[] if number == 59 else [0])
        assert of_chair != 0 and of_person == ([] if away else [0])


def test_a_chair_that_is_no_longer_trusted_does_not_take_the_identity_of_who_stands_beside_it():
    followed, both = Followed(), ((0, 0, 3), (0.25, 0, 3))
    found = [seen(followed, number / 30, *both, doubtful=[1] if number else []) for number in range(120)]
    assert found[0] == [0, 1] and found[-1] == [0, UNKNOWN]


@pytest.mark.parametrize("fps", [5, 90])
def test_people_who_walk_keep_their_identities_at_any_rate_of_images(fps):
    followed, images = Followed(), 2 * fps
    places_m = zip(line((-1.5, 0, 3), (1.5, 0, 3), images), line((1.5, 0, 3.3), (-1.5, 0, 3.3), images), strict=True)
    assert [seen(followed, number / fps, *both) for number, both in enumerate(places_m)] == [[0, 1]] * images


def test_people_who_move_while_the_images_stall_are_still_the_same():
    followed = Followed()
    assert [seen(followed, time_s, (0, 0, 3), (2, 0, 4)) for time_s in (0.0, 0.03)] == [[0, 1]] * 2
    assert seen(followed, 1.63, (1.5, 0, 4.3), (0.3, 0.5, 3.5)) == [1, 0]


def test_nobody_is_given_to_an_uncertain_detection_so_that_somebody_hidden_gets_their_place():
    followed, (stands, other, between) = Followed(), ((x, 0, 3) for x in (0.0, 1.25, -0.4))
    for image in range(10):
        assert seen(followed, image / 30, stands, other) == [0, 1]
    for image in range(10, 40):
        assert seen(followed, image / 30, stands) == [0]
    assert seen(followed, 40 / 30, stands, between, doubtful=[1]) == [0, UNKNOWN]
    assert seen(followed, 41 / 30, stands) == [0]


def test_nobody_is_found_again_farther_away_than_people_get():
    away = 15  # images: half a second
    near, far = (walk([(0, 0, 3)] * 10 + [None] * (away + 5), [None] * (10 + away) + [(x, 0, 3)] * 5) for x in (3.0, 4.0))
    assert near[-1][1] == near[0][0]
    assert far[-1][1] != far[0][0]


def after_a_second(x_m, path, doubtful_from=None):
    """Who is found, with little certainty, a second after a path, of which the images from a number on are doubtful."""
    followed, fps = Followed(), 30
    for number, place in enumerate(path):
        doubtful = [0] if doubtful_from is not None and number >= doubtful_from else []
        seen(followed, number / fps, place, doubtful=doubtful)
    return seen(followed, (len(path) - 1) / fps + 1, (x_m, 0, 3), doubtful=[0])


def test_who_vanishes_while_walking_is_expected_to_walk_on_for_a_moment_only():
    walked = line((-3, 0, 3), (0, 0, 3), 60)
    assert after_a_second(1.7, walked) == after_a_second(-1.2, walked) == [0]
    assert after_a_second(1.85, walked) == after_a_second(-1.35, walked) == [UNKNOWN]


def test_the_sliding_centre_of_who_is_nearly_hidden_is_no_walk():
    slid = [(0, 0, 3)] * 10 + line((0, 0, 3), (0.5, 0, 3), 16)
    assert after_a_second(0.5 - 1.45, slid, doubtful_from=10) == [0]


def test_who_comes_out_of_hiding_elsewhere_is_not_taken_to_run():
    followed = Followed()
    assert seen(followed, 0.0, (0, 0, 3)) == [0]
    for time_s in (0.1, 0.2):
        seen(followed, time_s)
    assert seen(followed, 0.3, (0.6, 0, 3)) == [0]
    assert seen(followed, 1.3, (0.6 - 1.45, 0, 3), doubtful=[0]) == [0]


def test_one_step_between_slow_images_tells_the_speed():
    followed = Followed()
    assert [seen(followed, time_s, (x_m, 0, 3)) for time_s, x_m in ((0.0, 0.0), (0.2, 0.8))] == [[0], [0]]
    assert seen(followed, 1.2, (0.8 + 1.5 + 0.55, 0, 3), doubtful=[0]) == [0]


def test_of_two_who_left_the_first_comes_back_first():
    followed = Followed()
    assert seen(followed, 0.0, (-1, 0, 3), (1, 0, 3)) == [0, 1]
    assert seen(followed, 0.5, (-1, 0, 3)) == [0]
    seen(followed, 1.0)
    assert seen(followed, 3.0, (0, 0, 6)) == [1]


def test_who_left_before_many_others_is_forgotten():
    followed = Followed()
    for number in range(MOST_MISSING + 2):
        assert seen(followed, number / 10, (100 * number, 0, 3)) == [number]
    assert seen(followed, number / 10 + 0.1, (200, 0, 3)) == [2]
    assert seen(followed, number / 10 + 0.2, (0, 0, 3)) == [number + 1]


def test_a_chair_is_not_followed_the_longer_because_a_clock_was_put_back():
    followed, chair = Followed(), (0, 0, 3)
    seen(followed, 100.0, chair)
    found = [seen(followed, number / 30, chair, doubtful=[0])[0] for number in range(90)]
    assert found[0] == 0 and found[-1] == UNKNOWN


def test_of_two_who_sat_for_long_the_one_who_moves_is_who_sat_there():
    followed, both = Followed(), ((0, 0, 3), (1, 0, 3))
    for number in range(45):
        assert seen(followed, number / 30, *both, doubtful=[0, 1] if number else []) == [0, 1]
    assert seen(followed, 1.5, both[0], doubtful=[0]) == [0]
    assert seen(followed, 3.0, both[0]) == [0]


def test_no_two_of_an_image_have_one_identity():
    followed = Followed()
    assert seen(followed, 0.0, (0, 0, 3)) == [0]
    seen(followed, 0.2)
    assert seen(followed, 0.5, (0, 0, 3), (2, 0, 3)) == [0, 1]  # the second is where the first, missing for 0.5 s, could be


def test_of_two_who_left_long_ago_the_later_one_comes_back_first():
    followed = Followed()
    assert seen(followed, 0.0, (-1, 0, 3), (1, 0, 3)) == [0, 1]
    assert seen(followed, 1.0, (-1, 0, 3)) == [0]
    assert seen(followed, 100.0, (0, 0, 6)) == [0]
