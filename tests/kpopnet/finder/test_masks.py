"""The second look at each person: crops of the scene, and pixels given to people anew, around networks that know the answer."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.camera import Camera
from kpopnet.data.canvas import STRIDE
from kpopnet.data.cube import Cube, crop
from kpopnet.data.person_masks import CROP_PX, HALF_M, OTHER, OWN
from kpopnet.finder.masks import REACH_M, THEIRS_FROM, crop_owner, open_masks, refine_masks, scene_crop, taken
from kpopnet.finder.people import BESIDE_M, BESIDE_PER_M, OwnedCells, pixel_owners

CAMERAS = Camera.centred(280.0, 320, 240), Camera(110.0, 120.0, 50.0, 70.0, 120, 100), Camera.centred(700.0, 848, 480)


def two_people(camera):
    """Flat bodies of 0.5 x 1.6 m at 2 and 2.2 m, the first hiding a part of the second, before a wall at 4 m: depth, and the
    person of each pixel.
    """
    depth_m, labels = np.full((camera.height, camera.width), 4.0, np.float32), np.zeros((camera.height, camera.width), np.uint8)
    for number, (x_m, z) in ((2, (0.3, 2.2)), (1, (0.0, 2.0))):
        (x0, y0), (x1, y1) = camera.project(np.array([(x_m - 0.25, -0.8, z), (x_m + 0.25, 0.8, z)])).round().astype(int)[:, :2]
        depth_m[max(y0, 0) : y1, max(x0, 0) : x1], labels[max(y0, 0) : y1, max(x0, 0) : x1] = z, number
    return depth_m, labels, np.array([(0, 0, 2.0), (0.3, 0, 2.2)], np.float32)


def owned(labels, depth_m):
    """A finder's word that every pixel, here a cell of its own, belongs to the person of `labels`."""
    return OwnedCells.of(depth_m, np.full(labels.shape, 0.9, np.float32), labels, 1 / STRIDE)


def knowing(labels, camera, centres_m):
    """A network that says of each crop what `labels` have."""
    crops = [scene_crop(labels, camera, centre_m) for centre_m in centres_m]
    truly = np.stack([crop.depth_m[::2, ::2] == number for number, crop in enumerate(crops, 1)])
    return lambda *_: truly.astype(np.float32)


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_crop_is_that_of_the_cube_with_the_surroundings(camera):
    depth_m, labels, centres_m = two_people(camera)
    depth_m[:, ::7] = 0
    for number, centre_m in enumerate(centres_m, 1):
        seen = scene_crop(depth_m, camera, centre_m)
        crop_m, said = seen.depth_m, crop_owner(owned(labels, depth_m), seen, number)
        cube = Cube(centre_m, HALF_M)
        expected = crop(depth_m, camera, cube, CROP_PX)[0]
        found = np.where(crop_m > 0, np.clip((crop_m - centre_m[2]) / np.float32(HALF_M), -1, 1), 1)
        assert (np.abs(found - expected) < 1e-5).mean() > 0.999  # a pixel between two may round to the other
        assert np.array_equal(np.unique(said), [0, OWN, OTHER])
        whole = pixel_owners(owned(labels, depth_m), depth_m, *map(np.arange, depth_m.shape))
        assert np.array_equal(said == OWN, taken(whole, seen.rows, seen.columns) == number)
        alone = crop(np.where(labels == number, depth_m, 0), camera, cube, CROP_PX)[0] < 1
        assert ((said == OWN) & (crop_m > 0) == alone).mean() > 0.99
        rows, columns = np.nonzero(said == OWN)
        (step_x, first_x), (step_y, first_y) = seen.to_image
        at = np.rint((step_y * rows + first_y, step_x * columns + first_x)).astype(int)
        assert (labels[*at] == number).mean() > 0.999


@pytest.mark.parametrize("camera", CAMERAS)
def test_pixels_become_whose_they_are(camera):
    """From masks that lack feet, and have parts of the other and of the wall."""
    depth_m, labels, centres_m = two_people(camera)
    wrong = np.roll(labels, camera.width // 12, axis=1)
    wrong[-camera.height // 4 :] = 0
    decided, boxes = refine_masks(knowing(labels, camera, centres_m), depth_m, camera, owned(wrong, depth_m), centres_m)
    reached = np.abs(depth_m - 2) < REACH_M  # the wall is not
    for number in (1, 2):
        union = ((decided == number) | (labels == number)) & reached
        assert ((decided == number) & (labels == number)).sum() / union.sum() > 0.95
        rows, columns = np.nonzero(decided == number)
        assert boxes[number - 1].tolist() == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert not decided[~reached & (wrong > 0) & (np.abs(np.arange(camera.width) - camera.cx) < camera.fx / 2.2 * 0.8)].any()


def test_beyond_their_crop_pixels_are_whose_the_finder_takes_them_for():
    """Feet far in front of their torso, which look larger than the crop; and those of a person whom another's crop shows."""
    camera = Camera.centred(200.0, 320, 480)
    depth_m, labels = np.full((480, 320), 4.0, np.float32), np.zeros((480, 320), np.uint8)
    depth_m[100:470, 140:180], labels[100:470, 140:180] = 1.4, 1
    centres_m = np.array([(0, -0.4, 2.0), (0.4, 0.1, 2.0)], np.float32)
    end, later = (scene_crop(depth_m, camera, centre_m).to_image[1] @ (CROP_PX - 1, 1) for centre_m in centres_m)
    nothing = np.zeros((2, CROP_PX // 2, CROP_PX // 2), np.float32)
    decided, boxes = refine_masks(lambda *_: nothing, depth_m, camera, owned(labels, depth_m), centres_m)
    beyond = np.arange(480)[:, None] >= end
    assert np.array_equal(decided == 1, (labels == 1) & beyond) and 0 < beyond.sum() < 200 * 320 and later > end + 20
    assert boxes.tolist() == [[140, np.ceil(end), 180, 470], [0, 0, 0, 0]]


def test_beyond_their_crops_all_pixels_of_people_who_touch_are_someones():
    """Also those between two people's cells, and around the last of them."""
    camera = Camera.centred(800.0, 640, 480)
    depth_m, owner = np.full((480, 640), 1.5, np.float32), np.zeros((60, 80), np.uint8)
    owner[5:55, 10:70] = 1 + (np.indices((50, 60)).sum(0) // 7 + np.arange(60) // 30) % 2
    cells = OwnedCells.of(depth_m[::8, ::8].copy(), np.full(owner.shape, 0.9, np.float32), owner, 8 / STRIDE)
    far_away = np.array([(-0.2, -0.1, 9.0), (0.2, 0.1, 9.0)], np.float32)  # whose crops show a few pixels
    crops = [scene_crop(depth_m, camera, centre_m) for centre_m in far_away]
    nothing = np.zeros((2, CROP_PX // 2, CROP_PX // 2), np.float32)
    decided, _ = refine_masks(lambda *_: nothing, depth_m, camera, cells, far_away)
    whole = pixel_owners(cells, depth_m, *map(np.arange, depth_m.shape))
    beyond = np.ones(depth_m.shape, bool)
    for crop_ in crops:
        beyond[max(crop_.rows[0], 0) : crop_.rows[-1] + 1, max(crop_.columns[0], 0) : crop_.columns[-1] + 1] = False
    assert set(np.unique(whole)) == {0, 1, 2} and beyond.mean() > 0.7
    np.testing.assert_array_equal(decided[beyond], whole[beyond])


def test_no_people_have_no_pixels():
    depth_m, labels, _ = two_people(CAMERAS[0])
    decided, boxes = refine_masks(None, depth_m, CAMERAS[0], owned(labels, depth_m), np.zeros((0, 3), np.float32))
    assert not decided.any() and boxes.shape == (0, 4)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_pixels_are_decided_as_one_by_one(seed):
    """Against loops without shortcuts, for noise of all kinds."""
    rng, camera, size = np.random.default_rng(seed), Camera(55.0, 60.0, 22.0, 30.0, 60, 50), (50, 60)
    depth_m = np.where(rng.random(size) < 0.1, 0, rng.choice([2.0, 2.1, 2.4, 3.6], size)).astype(np.float32)
    owners = rng.integers(0, 3, size).astype(np.uint8)
    centres_m = np.float32(rng.uniform((-0.5, -0.5, 1.8), (0.5, 0.5, 2.4), (2, 3)))
    said = np.float32(rng.random((2, CROP_PX // 2, CROP_PX // 2)) ** rng.choice([0.3, 1, 4]))
    cells = OwnedCells.of(*(one[::8, ::8].copy() for one in (depth_m, np.float32(rng.random(size)), owners)), 4.0)
    decided, boxes = refine_masks(lambda *_: said, depth_m, camera, cells, centres_m)
    for number, (x0, y0, x1, y1) in enumerate(boxes, 1):
        inside = np.zeros(owners.shape, bool)
        inside[y0:y1, x0:x1] = True
        assert not ((decided == number) & ~inside).any()
    np.testing.assert_array_equal(decided, _one_by_one(said, depth_m, camera, cells, centres_m))


@pytest.mark.parametrize("z", [-0.5, 0.0, 0.01, 60.0, 60000.0])
def test_a_torso_anywhere_is_looked_at(z):
    """Votes of an untrained network, or of depth in a wrong unit; and one who is not in the picture."""
    depth_m, labels, centres_m = two_people(CAMERAS[1])
    centres_m[0, 2] = z
    decided, boxes = refine_masks(open_masks(), depth_m, CAMERAS[1], owned(np.minimum(labels, 1), depth_m), centres_m)
    assert decided.max() <= 2 and boxes.shape == (2, 4)
    assert (boxes[:, 2:] >= boxes[:, :2]).all() and (boxes >= 0).all() and (boxes <= (120, 100, 120, 100)).all()


def test_the_surer_of_two_has_a_surface_whatever_single_cells_say():
    camera, cells = CAMERAS[0], CROP_PX // 2
    depth_m = np.full((240, 320), 2.0, np.float32)
    no_one = owned(np.zeros((240, 320), np.uint8), depth_m)
    centres_m = np.array([(0, 0, 2.0), (0.05, 0, 2.0)], np.float32)
    said = np.stack([np.full((cells, cells), 0.99), np.full((cells, cells), 0.40)]).astype(np.float32)
    said[0, ::4, ::4] = 0.36
    for order in ([0, 1], [1, 0]):
        decided, _ = refine_masks(lambda *_, order=order: said[order], depth_m, camera, no_one, centres_m[order])
        assert (decided == 1 + order.index(0)).mean() > 0.9 * (decided > 0).mean()


def _one_by_one(said, depth_m, camera, owned_cells, centres_m):
    owners = pixel_owners(owned_cells, depth_m, *map(np.arange, depth_m.shape))
    cells, out, surest = CROP_PX // 2, np.zeros(owners.shape, np.uint8), np.zeros(owners.shape)
    shown = np.zeros((len(said), *owners.shape), bool)
    for number, (person, centre_m) in enumerate(zip(said, centres_m, strict=True), 1):
        crop_m, _, _, to_image = scene_crop(depth_m, camera, centre_m)
        for y, x in np.ndindex(owners.shape):
            column, row = (np.array([x, y]) - to_image[:, 1]) / to_image[:, 0]
            z = depth_m[y, x]
            if not (0 <= row < CROP_PX - 1 and 0 <= column < CROP_PX - 1):
                continue
            shown[number - 1, y, x] = True
            if z == 0:
                continue
            top, left = int(row / 2), int(column / 2)
            rows, columns = (range(max(0, first - 1), min(first + 3, cells)) for first in (top, left))
            around = [(r, c) for r in rows for c in columns]
            said_around = [person[cell] for cell in around]
            apart = [abs(crop_m[2 * r, 2 * c] - z) / (BESIDE_M + BESIDE_PER_M * z) for r, c in around]
            weights = [(crop_m[2 * r, 2 * c] > 0) * max(0, 1 - far) / (0.2 + (r - row / 2) ** 2 + (c - column / 2) ** 2)
                       for (r, c), far in zip(around, apart, strict=True)]  # fmt: skip
            if max(said_around) < THEIRS_FROM or abs(z - centre_m[2]) > REACH_M:
                continue
            if min(said_around) >= THEIRS_FROM and abs(crop_m[2 * top, 2 * left] - z) < BESIDE_M:
                theirs = person[top, left]
            else:
                theirs = np.dot(weights, said_around) / sum(weights) if sum(weights) else 0
            if theirs >= THEIRS_FROM and theirs > surest[y, x]:
                out[y, x], surest[y, x] = number, theirs
    for number in range(1, len(said) + 1):
        out[(owners == number) & ~shown[number - 1] & (out == 0)] = number
    return out


def test_the_network_that_ships_takes_away_what_is_another_persons():
    """Taking the finder's word for everything would not do."""
    camera = CAMERAS[0]
    depth_m, labels, centres_m = two_people(camera)
    wrong = labels.copy()
    wrong[120:, :] = np.where(labels[120:] == 2, 1, labels[120:])  # the second one's legs

    def shared(network):
        decided, _ = refine_masks(network, depth_m, camera, owned(wrong, depth_m), centres_m)
        return np.array([((decided == n) & (labels == n)).sum() / ((decided == n) | (labels == n)).sum() for n in (1, 2)])

    by_word, by_look = shared(lambda _, owner, __: np.float32(owner[:, ::2, ::2] == OWN)), shared(open_masks())
    assert (by_look > by_word + 0.05).all()
