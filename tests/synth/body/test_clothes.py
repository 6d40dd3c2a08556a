"""Garments: they lie outside the body, move no joint and no collision capsule, and cover what they are made to cover."""

from dataclasses import replace

import numpy as np
import pytest

from kpopnet.camera import CAMERAS
from synth.body.asset import load_body
from synth.body.garments import HELD_BACK, ORDINARY, Figure, hair, shoes
from synth.body.outfit import PIECES, ClothesConfig, put_on, unworn
from synth.body.shape import dress, shape_person
from synth.scene.scene import Scene

NOTHING = ClothesConfig(**dict.fromkeys(vars(ClothesConfig()), 0.0))
EVERYTHING = ClothesConfig(**dict.fromkeys(vars(ClothesConfig()), 1.0))
NUM_VERTICES = len(load_body().weights)
BARE = shape_person(np.zeros(len(load_body().basis), np.float32), load_body())
FIGURE = Figure(BARE.bare_m, BARE.heads_m, female=True)
WORN = ORDINARY.tops | ORDINARY.bottoms | HELD_BACK.tops | HELD_BACK.bottoms
GARMENTS = {name: garment for name, (_, garment) in WORN.items()} | {"shoes": shoes, "hair": hair}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", GARMENTS)
def test_a_garment_lies_outside_the_skin_and_stays_near_it(name: str, seed: int) -> None:
    moved = GARMENTS[name](FIGURE, np.random.default_rng(seed))
    assert moved.shape == BARE.bare_m.shape
    length = np.linalg.norm(moved, axis=1)
    assert 0.002 < length.max() < 0.2
    assert (length > 0.0005).mean() < 0.85  # never the whole body
    outwards = (moved * FIGURE.normals).sum(axis=1)
    # A tube moves skin away from its axis, which is not everywhere along the normal, but nowhere deep into the body.
    assert outwards.min() > -0.05 and outwards[length > 0.0005].mean() > 0


def test_an_undressed_person_is_the_bare_body_with_its_pieces_inside() -> None:
    naked = dress(BARE, True, np.random.default_rng(0), NOTHING)
    np.testing.assert_array_equal(naked.vertices_m[:NUM_VERTICES], BARE.bare_m)
    for points in unworn(FIGURE).values():
        assert np.ptp(points, axis=0).max() == 0
        assert (BARE.bare_m.min(axis=0) < points[0]).all() and (points[0] < BARE.bare_m.max(axis=0)).all()


def test_clothes_move_no_joint_and_no_collision_capsule() -> None:
    """Bodies collide with their skin: loose clothes must not refuse close poses."""
    scene = Scene(CAMERAS["kinect_v1"])
    dressed = dress(BARE, True, np.random.default_rng(3), EVERYTHING)
    assert np.abs(dressed.vertices_m - BARE.vertices_m).max() > 0.05
    fitted = []
    for person in (BARE, dressed):
        scene.set_person(person)
        np.testing.assert_array_equal(scene.model.skin_vert, person.vertices_m)
        fitted.append([getattr(scene.model, name).copy() for name in ("geom_size", "geom_pos", "geom_quat", "body_pos")])
    for one, other in zip(*fitted, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(dressed.joints_m, BARE.joints_m)
    outwards_m = ((dressed.vertices_m[:NUM_VERTICES] - BARE.bare_m) * FIGURE.normals).sum(axis=1)
    assert np.median(outwards_m) > 0.005 and outwards_m.min() > -0.05


def test_a_skirt_lies_around_the_closed_legs() -> None:
    config = replace(NOTHING, skirt=1.0)
    for seed in range(2):
        dressed = dress(BARE, True, np.random.default_rng(seed), config)
        skirt = dressed.vertices_m[NUM_VERTICES:][: len(PIECES["skirt"].weights)]  # the first piece
        hips = BARE.bare_m[(FIGURE.cover("Hips") > 0.5) & (BARE.bare_m[:, 2] < FIGURE.bone_m("LowerBack")[2])]
        assert np.ptp(skirt[:, 0]) > np.ptp(hips[:, 0]) and np.ptp(skirt[:, 1]) > np.ptp(hips[:, 1])
        assert skirt[:, 2].min() < FIGURE.bone_m("LeftUpLeg")[2]


def test_an_outfit_depends_only_on_the_seed_and_on_what_is_worn() -> None:
    one, two = (np.concatenate(put_on(FIGURE, np.random.default_rng(4), EVERYTHING)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    hatless = put_on(FIGURE, np.random.default_rng(4), replace(EVERYTHING, hat=0.0, bag=0.0))
    np.testing.assert_array_equal(one[:NUM_VERTICES], hatless[0])  # one choice does not shift the others
