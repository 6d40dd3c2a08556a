"""Places: how they are drawn, and what is wrong with them, of bodies that are boxes in a plain room."""

import numpy as np
import pytest

from kpopnet.camera import CAMERAS
from synth.samples.placing import (
    ASIDE_M,
    BESIDE_M,
    BLOCKED,
    MISFRAMED,
    NEAREST_M,
    SOUND,
    Body,
    Site,
    StageConfig,
    are_apart,
    draw_place,
    draw_place_beside,
    faults,
)
from synth.scene.mesh import BOX_CORNERS
from synth.scene.room import Room, posed_view

CAMERA = CAMERAS["kinect_v1"]
HALF_VIEW = CAMERA.width / (2 * CAMERA.fx)
WALLS = Room(
    np.array([(0, 2, -0.1), (0, 9.1, 1.5), (-9.1, 2, 1.5), (9.1, 2, 1.5), (0, 6, 0.5)]),
    np.array([(8, 8, 0.1), (8, 0.1, 1.5), (0.1, 8, 1.5), (0.1, 8, 1.5), (0.5, 0.5, 0.5)]),
    np.zeros(5),
)
SITE = Site(WALLS, posed_view(np.array([0, 0, 1.0]), 0.0, 0.0), CAMERA, np.zeros((240, 320), np.uint16), np.zeros(4))


def body(half_m: float = 0.2) -> Body:
    vertices = (BOX_CORNERS * half_m).astype(np.float32)
    return Body(vertices, vertices.min(axis=0), vertices.max(axis=0), np.zeros(3), 1.0)


@pytest.mark.parametrize("cut", [False, True])
def test_people_who_may_be_cut_are_nearer_and_anywhere_across_the_image(cut: bool) -> None:
    config, rng = StageConfig(distance_m=(1.0, 5.0)), np.random.default_rng(0)
    x, y, z = np.array([draw_place(rng, config, body(), SITE, cut) for _ in range(600)]).T
    assert y.min() >= 1 and y.max() <= 5 and (z == 1).all()
    assert y.mean() == pytest.approx(1 + 4 / 3 if cut else 3, abs=0.15)
    assert np.abs(x / y / HALF_VIEW).max() == pytest.approx(1 if cut else config.off_centre, rel=0.02)


def test_a_place_is_sound_inside_the_image_not_too_near_and_clear_of_walls_and_furniture() -> None:
    ahead, small = np.array([0, 2.0, 1.0]), body(0.02)
    assert faults(body(), ahead, SITE, cut=False) == SOUND and faults(body(), ahead, SITE, cut=True) == MISFRAMED
    at_border = np.array([2 * HALF_VIEW, 2.0, 1.0])
    assert faults(body(), at_border, SITE, cut=False) == MISFRAMED
    assert faults(body(), at_border - np.array([0.05, 0, 0]), SITE, cut=True) == SOUND
    for depth_m, fault in ((NEAREST_M + 0.03, SOUND), (NEAREST_M, MISFRAMED)):
        assert faults(small, np.array([0, depth_m, 1.0]), SITE, cut=False) == fault
    for place in ((0, 8.85, 1.0), (0, 5.4, 1.0)):
        assert faults(body(), np.array(place), SITE, cut=False) == BLOCKED


def test_another_person_is_beside_the_line_of_sight_and_touches_neither_person_nor_furniture() -> None:
    rng, place_m, found = np.random.default_rng(0), np.array([1.0, 4.0, 1.0]), []
    for _ in range(400):
        if (other_m := draw_place_beside(rng, body(), place_m, body(), SITE)) is not None:
            assert are_apart(body(), place_m, body(), other_m) and (np.abs(other_m - place_m)[:2] > 0.4).any()
            found.append(other_m)
    x, y, _ = np.array(found).T
    aside_m = x - 0.25 * y
    assert ASIDE_M[0] <= np.abs(aside_m).min() and np.abs(aside_m).max() <= ASIDE_M[1]
    assert min(np.mean(aside_m > 0), np.mean(aside_m < 0)) > 0.3
    assert 4 + BESIDE_M[0] <= y.min() and y.max() <= 4 + BESIDE_M[1] and 100 < len(found) < 400
    near_furniture_m = np.array([-0.9, 6.0, 1.0])  # it stands in some of the drawn places
    others = [draw_place_beside(rng, body(), near_furniture_m, body(), SITE) for _ in range(400)]
    assert all(faults(body(), one, SITE, cut=False) != BLOCKED for one in others if one is not None)
