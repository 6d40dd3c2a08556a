"""Films of two people: the scenes are what they are called, and a file is a pure function of the settings."""

import numpy as np
import pytest

from synth.motion.choreography.pairs import walk
from synth.motion.choreography.stage import perform
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS
from synth.simulated.film import CleanFrame
from synth.simulated.two_people import CAMERA, TwoPeople, TwoPeopleConfig, measure


@pytest.fixture(scope="module")
def maker() -> TwoPeople:
    return TwoPeople(TwoPeopleConfig(seed=5))


@pytest.mark.parametrize("distance_m", [1.6, -0.6])
def test_a_walk_goes_as_far_as_it_is_told(distance_m: float) -> None:
    motion = perform(walk(distance_m), 100.0, 200, 30.0, "walk")
    x, _, z = (motion.root_m[-1] - motion.root_m[0]).tolist()
    assert z == pytest.approx(distance_m, abs=0.03) and abs(x) < 0.1


def middles_m(maker: TwoPeople, index: int) -> np.ndarray:
    """(2, T, 2) x and y of the hips of both in the world."""
    return np.array([take.played.hips_m[:, :2] + take.place_m[:2] for take in maker.take(index).takes])


def test_the_scenes_are_what_they_are_called(maker: TwoPeople) -> None:
    crossing, hug, leaving, entering = (
        middles_m(maker, TwoPeople.kinds.index(kind)) for kind in ("crossing", "hug", "leaving", "entering")
    )
    order = np.sign(crossing[0, :, 0] - crossing[1, :, 0])
    assert order[0] == -order[-1]
    apart = np.linalg.norm(hug[0] - hug[1], axis=1)
    assert apart.min() < 0.55 and apart[[0, -1]].min() > 1.0
    assert abs(leaving[1, -1, 0]) > 1.6 > abs(leaving[1, 0, 0])
    assert abs(entering[1, 0, 0]) > 1.6 > abs(entering[1, -1, 0])


def clean(depth_m: float, columns: slice, room_m: np.ndarray) -> CleanFrame:
    person_m = np.zeros_like(room_m)
    person_m[:, columns] = depth_m
    return CleanFrame(0, person_m, room_m, np.full((15, 3), (0, 0, 1.0), np.float32))


def test_the_nearer_of_two_people_hides_the_other() -> None:
    room_m = np.full((CAMERA.height, CAMERA.width), 4, np.float32)
    room_m[0] = 0  # nothing is there
    near, far = clean(2.0, slice(0, 100), room_m), clean(3.0, slice(50, 150), room_m)
    for pair, turned in (((near, far), 1), ((far, near), -1)):
        shot = measure(pair, CAMERA, SENSORS["ideal"], FilmNoise((1,)))
        assert shot["alone_px"][::turned].tolist() == [100 * 240, 100 * 240]
        assert shot["seen_px"][::turned].tolist() == [100 * 240, 50 * 240]
        assert (shot["depth"][:, :100] == 2000).all() and (shot["depth"][:, 100:150] == 3000).all()
        assert (shot["depth"][1:, 150:] == 4000).all() and (shot["depth"][0, 150:] == 0).all()
