"""From what the network says of an image's cells to people and their pixels.

Every cell that shows a person votes for where this person's torso is. Votes that agree are one person, however their body is
divided in the image; each pixel belongs to the person whose cells are beside it at its depth.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.finder.canvas import STRIDE

MOST_PEOPLE = 20
NO_PERSON = 0

AGREE_M, TAKEN_M, REACH_M = 0.22, 0.35, 0.8
"""Votes this near to each other agree; a person takes those this near to their centre; a cell belongs to the nearest
person whose centre is this near to its vote."""

SEEDS = 160
"""The centre is sought among this many votes, at even distances in the list."""


class People(NamedTuple):
    """The P people of one image.

    Attributes:
        centres_m: (P, 3) float32 torso joints as voted, camera frame, metres.
        score: (P,) float32 mean probability of their cells.
        shown: (P,) float32 estimated share of the body that shows.
        area_m2: (P,) float32 visible surface, seen from the camera.
        owner: (h, w) uint8 person of each cell, 1..P, or NO_PERSON.
    """

    centres_m: np.ndarray
    score: np.ndarray
    shown: np.ndarray
    area_m2: np.ndarray
    owner: np.ndarray


@njit(cache=True)
def gather_people(probability, votes_m, shown, cell_m2, least_probability, least_m2, least_cells):
    """`People` of an image, in the order of the surface that agrees on them.

    Args:
        probability: (h, w) float32 that a cell shows a person.
        votes_m: (h, w, 3) float32 where its torso is, camera frame.
        shown: (h, w) float32 share of the body that shows.
        cell_m2: (h, w) float32 area that a cell sees, 0 where nothing was measured.
        least_probability: of cells that vote.
        least_m2: least visible surface of a person.
        least_cells: least number of a person's cells.
    """
    height, width = probability.shape
    rows, columns = np.empty(height * width, np.int32), np.empty(height * width, np.int32)
    count = 0
    for y in range(height):
        for x in range(width):
            if cell_m2[y, x] > 0 and probability[y, x] >= least_probability:
                rows[count], columns[count] = y, x
                count += 1
    points, weights, free = np.empty((count, 3), np.float32), np.empty(count, np.float32), np.ones(count, np.bool_)
    for k in range(count):
        y, x = rows[k], columns[k]
        points[k], weights[k] = votes_m[y, x], cell_m2[y, x] * probability[y, x]
    centres = np.zeros((MOST_PEOPLE, 3), np.float32)
    found = 0
    while found < MOST_PEOPLE:
        centre, weight = _densest(points, weights, free)
        if weight < 0.5 * least_m2:
            break
        for k in range(count):
            if free[k] and _squared(points[k], centre) < TAKEN_M**2:
                free[k] = False
        centres[found] = centre
        found += 1

    owner = np.zeros((height, width), np.uint8)
    sums, cells = np.zeros((found, 4), np.float64), np.zeros(found, np.int64)
    for k in range(count):
        best, nearest = -1, REACH_M**2
        for person in range(found):
            distance = _squared(points[k], centres[person])
            if distance < nearest:
                best, nearest = person, distance
        if best >= 0:
            y, x = rows[k], columns[k]
            owner[y, x] = best + 1
            cells[best] += 1
            sums[best, 0] += probability[y, x]
            sums[best, 1] += shown[y, x]
            sums[best, 2] += cell_m2[y, x]
    number = np.zeros(found + 1, np.uint8)
    kept = 0
    for person in range(found):
        if cells[person] >= least_cells and sums[person, 2] >= least_m2:
            centres[kept] = centres[person]
            sums[kept], cells[kept] = sums[person], cells[person]
            kept += 1
            number[person + 1] = kept
    for k in range(count):
        owner[rows[k], columns[k]] = number[owner[rows[k], columns[k]]]
    score, seen, area = np.empty(kept, np.float32), np.empty(kept, np.float32), np.empty(kept, np.float32)
    for person in range(kept):
        score[person], seen[person] = sums[person, 0] / cells[person], sums[person, 1] / cells[person]
        area[person] = sums[person, 2]
    return centres[:kept], score, seen, area, owner


@njit(cache=True)
def _densest(points, weights, free):
    """The point on which most of the free votes' weight agrees, moved twice to the mean of these, and their weight."""
    step = max(1, len(points) // SEEDS)
    most, best = 0.0, -1
    for seed in range(0, len(points), step):
        if not free[seed]:
            continue
        weight = 0.0
        for k in range(len(points)):
            if free[k] and _squared(points[k], points[seed]) < AGREE_M**2:
                weight += weights[k]
        if weight > most:
            most, best = weight, seed
    centre = np.zeros(3, np.float32)
    if best < 0:
        return centre, 0.0
    centre[:] = points[best]
    for _ in range(2):
        total, moved = 0.0, np.zeros(3)
        for k in range(len(points)):
            if free[k] and _squared(points[k], centre) < AGREE_M**2:
                total += weights[k]
                for axis in range(3):
                    moved[axis] += weights[k] * points[k, axis]
        if total > 0:
            for axis in range(3):
                centre[axis] = moved[axis] / total
    return centre, most


@njit(cache=True)
def _squared(a, b):
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


BESIDE_M, BESIDE_PER_M = 0.08, 0.02
"""A pixel is beside a cell in depth up to this difference, more at a distance."""


@njit(cache=True)
def pixel_owners(depth_m, cell_depth_m, probability, owner, reduction, people):
    """Gives every pixel of a whole image to a person.

    A pixel takes the opinion of the 4 x 4 cells around it, the nearest in the image and in depth first.

    Args:
        depth_m: (H, W) float32 metres.
        cell_depth_m: (h, w) float32 depth of the cells' pixels.
        probability: (h, w) float32 that a cell shows a person.
        owner: (h, w) uint8 person of each cell.
        reduction: pixels of the whole image to one of the canvas, of which every STRIDE-th is a cell.
        people: number of people.

    Returns:
        (H, W) uint8 person of each pixel, and (people, 4) int32 x0, y0, x1, y1 of their pixels, the last two exclusive.
    """
    height, width = depth_m.shape
    h, w = owner.shape
    owners = np.zeros((height, width), np.uint8)
    boxes = np.zeros((people, 4), np.int32)
    boxes[:, 0], boxes[:, 1] = width, height
    near = np.zeros((h, w), np.bool_)
    for y in range(h):
        for x in range(w):
            if owner[y, x] != NO_PERSON:
                for row in range(max(y - 1, 0), min(y + 2, h)):
                    for column in range(max(x - 1, 0), min(x + 2, w)):
                        near[row, column] = True
    opinion = np.zeros(people + 1, np.float32)
    for y in range(height):
        at_y = ((y + 0.5) / reduction - 0.5) / STRIDE
        row_0 = max(min(int(at_y + 0.5), h - 1), 0)
        for x in range(width):
            z = depth_m[y, x]
            at_x = ((x + 0.5) / reduction - 0.5) / STRIDE
            column_0 = max(min(int(at_x + 0.5), w - 1), 0)
            if z == 0 or not near[row_0, column_0]:
                continue
            opinion[:] = 0
            reach = np.float32(BESIDE_M + BESIDE_PER_M * z)
            for row in range(max(int(at_y) - 1, 0), min(int(at_y) + 3, h)):
                for column in range(max(int(at_x) - 1, 0), min(int(at_x) + 3, w)):
                    apart = abs(cell_depth_m[row, column] - z) / reach
                    if cell_depth_m[row, column] == 0 or apart > 1:
                        continue
                    beside = (row - at_y) ** 2 + (column - at_x) ** 2
                    weight = np.float32((1 - apart) / (0.2 + beside))
                    p = probability[row, column]
                    opinion[owner[row, column]] += weight * (p if owner[row, column] else 1 - p)
            best = np.argmax(opinion)
            if best:
                owners[y, x] = best
                box = boxes[best - 1]
                box[0], box[1] = min(box[0], x), min(box[1], y)
                box[2], box[3] = max(box[2], x + 1), max(box[3], y + 1)
    return owners, boxes
