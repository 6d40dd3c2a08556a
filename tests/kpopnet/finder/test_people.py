"""From cells that vote to people and their pixels, in arrangements whose answer is known."""

import numpy as np

from kpopnet.data.canvas import STRIDE
from kpopnet.finder.people import (
    AGREE_M,
    BESIDE_M,
    BESIDE_PER_M,
    SEEDS,
    Cells,
    OwnedCells,
    densest,
    gather_people,
    pixel_owners,
)

H, W = 64, 80
LIMITS = 0.5, 0.03, 8


def cells(*parts):
    """Depth, area, probability and votes of the cells: each part is (rows, columns, torso)."""
    probability, votes_m = np.full((H, W), 0.02, np.float32), np.zeros((H, W, 3), np.float32)
    for rows, columns, torso_m in parts:
        probability[rows, columns], votes_m[rows, columns] = 0.95, torso_m
    rng = np.random.default_rng(0)
    votes_m += 0.03 * rng.standard_normal(votes_m.shape).astype(np.float32)
    area_m2 = np.full((H, W), 0.001, np.float32)
    return Cells(np.ones((H, W), np.float32), area_m2, probability, votes_m)


def test_votes_that_agree_are_one_person_however_the_body_is_divided():
    upper, lower = (np.s_[10:20], np.s_[10:20], (0, 0, 2)), (np.s_[40:50], np.s_[12:18], (0, 0, 2))
    beside = np.s_[10:40], np.s_[22:30], (0.7, 0, 2)
    centres_m, score, area_m2, size, owner = gather_people(cells(upper, lower, beside), *LIMITS)
    assert len(centres_m) == 2
    first = owner[15, 15]
    assert (owner[10:20, 10:20] == first).all() and (owner[40:50, 12:18] == first).all()
    assert (owner[10:40, 22:30] == 3 - first).all() and (owner > 0).sum() == 100 + 60 + 240
    assert np.allclose(centres_m[first - 1], (0, 0, 2), atol=0.02) and np.allclose(score, 0.95)
    assert np.allclose(sorted(area_m2), [0.16, 0.24]) and sorted(size) == [160, 240]


def test_people_one_behind_the_other_are_two():
    front, behind = (np.s_[10:40], np.s_[10:20], (0, 0, 2)), (np.s_[10:40], np.s_[20:23], (0.1, 0, 2.9))
    centres_m, *_, owner = gather_people(cells(front, behind), *LIMITS)
    assert len(centres_m) == 2 and len(np.unique(owner[10:40, 10:20])) == len(np.unique(owner[10:40, 20:23])) == 1


def test_specks_and_unmeasured_cells_are_not_people():
    given = cells((np.s_[5:7], np.s_[5:7], (0, 0, 2)), (np.s_[20:40], np.s_[20:30], (1, 0, 2)))
    given.area_m2[20:40, 20:30] = 0
    centres_m, *_, owner = gather_people(given, *LIMITS)
    assert not len(centres_m) and not owner.any()


def test_the_densest_vote_equals_the_rule_written_plainly():
    for count in (5, 60, SEEDS + 1, 3 * SEEDS):
        rng, is_seed = np.random.default_rng(count), np.arange(count) % max(1, count // SEEDS) == 0
        points_m = rng.normal(0, 0.15, (count, 3)) + rng.integers(0, 3, (count, 1))
        weights, free = rng.uniform(0.1, 1, count), rng.random(count) < 0.8
        near = np.linalg.norm(points_m[:, None] - points_m, axis=2) < AGREE_M
        free[np.where(is_seed, (near & free) @ weights, 0).argmax()] = False  # on which most weight agrees, no centre now
        agreed = np.where(is_seed & free, (near & free) @ weights, 0)
        centre_m = points_m[agreed.argmax()]
        for _ in range(2):
            around = free & (np.linalg.norm(points_m - centre_m, axis=1) < AGREE_M)
            centre_m = np.average(points_m[around], axis=0, weights=weights[around])
        found_m, weight = densest(points_m.astype(np.float32), weights.astype(np.float32), free)
        assert np.allclose(found_m, centre_m, atol=1e-5) and np.isclose(weight, agreed.max(), rtol=1e-5)
    assert densest(points_m.astype(np.float32), weights.astype(np.float32), np.zeros(count, bool))[1] == 0


def test_pixels_take_the_person_beside_them_at_their_depth():
    owner, probability = np.zeros((H, W), np.uint8), np.full((H, W), 0.02, np.float32)
    cell_depth_m = np.full((H, W), 4.0, np.float32)
    owner[20:30, 20:30], probability[20:30, 20:30], cell_depth_m[20:30, 20:30] = 1, 0.9, 2.0
    owner[20:30, 30:40], probability[20:30, 30:40], cell_depth_m[20:30, 30:40] = 2, 0.9, 3.0
    reduction = 2.0  # four pixels of the image a cell
    depth_m = np.kron(cell_depth_m, np.ones((4, 4), np.float32))
    depth_m[100:104, 100:104] = 0
    owned, rows, columns = OwnedCells.of(cell_depth_m, probability, owner, reduction), np.arange(70, 130), np.arange(75, 170, 3)
    owners = pixel_owners(owned, depth_m[np.ix_(rows, columns)], rows, columns)
    assert (owners == np.select([depth_m == 2, depth_m == 3], [1, 2], 0)[np.ix_(rows, columns)]).all()


def test_a_hand_that_votes_elsewhere_stays_with_its_person():
    body, hand = (np.s_[10:40], np.s_[10:22], (0, 0, 2)), (np.s_[10:17], np.s_[30:37], (0.5, 0, 2))
    centres_m, *_, owner = gather_people(cells(body, hand), *LIMITS)
    assert len(centres_m) == 1 and owner[12, 32] == owner[20, 15] == 1


def test_pixels_equal_the_rule_written_plainly():
    """What is skipped changes nothing: the owner has the greatest sum of weights among the 4 x 4 cells around a pixel."""
    for seed in range(12):
        rng, h, w, reduction = np.random.default_rng(seed), 8, 10, (1.0, 1.7)[seed % 2]
        owner = np.kron(rng.integers(0, 3, (2, 2)), np.ones((4, 5), int)).astype(np.uint8)
        owner[rng.random((h, w)) < 0.15] = 0
        cell_depth_m = np.choose(owner, (2.16, 2.0, 2.1)).astype(np.float32) + rng.normal(0, 0.03, (h, w)).astype(np.float32)
        cell_depth_m[rng.random((h, w)) < 0.1] = 0
        owner[cell_depth_m == 0] = 0
        probability = np.where(owner, 0.8, 0.2).astype(np.float32)
        height, width = int(h * STRIDE * reduction), int(w * STRIDE * reduction)
        depth_m = rng.choice((0, 2.0, 2.05, 2.12, 2.2, 2.4), (height, width)).astype(np.float32)
        owned = OwnedCells.of(cell_depth_m, probability, owner, reduction)
        owners = pixel_owners(owned, depth_m, np.arange(height), np.arange(width))
        for y in range(height):
            for x in range(width):
                at_y, at_x = (((one + 0.5) / reduction - 0.5) / STRIDE for one in (y, x))
                near_y, near_x = min(int(at_y + 0.5), h - 1), min(int(at_x + 0.5), w - 1)
                beside_a_person = owner[max(near_y - 1, 0) : near_y + 2, max(near_x - 1, 0) : near_x + 2].any()
                opinion, z = np.zeros(3), depth_m[y, x]
                for row in range(max(int(at_y) - 1, 0), min(int(at_y) + 3, h)):
                    for column in range(max(int(at_x) - 1, 0), min(int(at_x) + 3, w)):
                        apart = abs(cell_depth_m[row, column] - z) / (BESIDE_M + BESIDE_PER_M * z)
                        if z and cell_depth_m[row, column] and apart < 1 and beside_a_person:
                            p, person = probability[row, column], owner[row, column]
                            weight = (1 - apart) / (0.2 + (row - at_y) ** 2 + (column - at_x) ** 2)
                            opinion[person] += weight * (p if person else 1 - p)
                first, second = np.sort(opinion)[[-1, -2]]
                if first - second > 1e-4 * first or not first:  # the two sums round otherwise
                    assert owners[y, x] == np.argmax(opinion), (seed, y, x)
