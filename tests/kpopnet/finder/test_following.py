"""Who is who, from places alone."""

import numpy as np

from kpopnet.finder.following import FORGOTTEN, UNKNOWN, Followed


def walk(*paths):
    """The identities, image by image, of people whose places are given for each image, None where they are not found."""
    followed, found = Followed(), []
    for places in zip(*paths, strict=True):
        present = [k for k, place in enumerate(places) if place is not None]
        centres_m = np.array([places[k] for k in present], np.float32).reshape(-1, 3)
        found.append(dict(zip(present, followed.identify(centres_m, np.ones(len(present), bool)), strict=True)))
    return found


def line(start, end, images):
    return [tuple(place) for place in np.linspace(start, end, images)]


def test_people_who_cross_at_a_distance_keep_their_identities():
    found = walk(line((-1.5, 0, 3), (1.5, 0, 3), 60), line((1.5, 0, 3.4), (-1.5, 0, 3.4), 60))
    assert all(one == found[0] for one in found) and len(set(found[0].values())) == 2


def test_somebody_hidden_for_a_while_is_still_the_same():
    path = line((-1, 0, 3), (1, 0, 3), 60)
    found = walk(line((0, 0, 2), (0, 0, 2), 60), path[:25] + [None] * 8 + path[33:])
    assert found[-1] == found[0]


def test_who_returns_after_a_while_has_the_old_identity_and_who_comes_has_a_new_one():
    away = [None] * (FORGOTTEN + 5)
    found = walk([(-1.5, 0, 3)] * 5 + away + [(1.5, 0, 2)] * 5, [(0, 0, 3)] * (10 + len(away)))
    assert found[-1] == found[0]
    found = walk([(-1.5, 0, 3)] * 10, [None] * 5 + [(1.5, 0, 3)] * 5)
    assert found[-1][0] == found[0][0] and found[-1][1] not in found[0].values()


def test_a_camera_that_turns_does_not_confuse_people():
    paths = [[(x + 0.03 * k, 0, 3) for k in range(40)] for x in (-1.0, 0.0, 1.0)]
    found = walk(*paths)
    assert all(one == found[0] for one in found)


def test_who_is_followed_needs_less_certainty_than_who_is_new():
    followed, place = Followed(), np.array([[0, 0, 3]], np.float32)
    assert followed.identify(place, np.array([False])) == [UNKNOWN]
    (identity,) = followed.identify(place, np.array([True]))
    two = np.array([[1.5, 0, 3], [0.02, 0, 3]], np.float32)
    assert followed.identify(two, np.array([False, False])) == [UNKNOWN, identity]
