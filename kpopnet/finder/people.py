"""From what the network says of an image's cells to people and their pixels.

Every cell that shows a person votes for where this person's torso is. Votes that agree are one person, however their body is
divided in the image; each pixel belongs to the person whose cells are beside it at its depth.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from kpopnet.data.canvas import STRIDE

MOST_PEOPLE = 20
NO_PERSON = 0

AGREE_M, TAKEN_M, REACH_M = 0.18, 0.24, 0.8
"""Votes this near to each other agree; a person takes those this near to their centre; a cell belongs to the nearest
person whose centre is this near to its vote."""

PART_M, PART_SHARE = 0.7, 0.3
"""Of two centres this near to each other, one with less than this share of the other's surface is a part of the same person."""

SEEDS = 160
"""The centre is sought among this many votes, at even distances in the list."""


class Cells(NamedTuple):
    """What is known of the h x w cells of an image."""

    depth_m: np.ndarray  # (h, w) float32 metres, 0 where nothing was measured
    area_m2: np.ndarray  # (h, w) float32 area that a cell sees, 0 where nothing was measured
    probability: np.ndarray  # (h, w) float32 that the cell shows a person
    torso_m: np.ndarray  # (h, w, 3) float32 where this person's torso joint is, camera frame, metres


INPUTS, OUTPUT_NAMES = ("depth_m", "intrinsics"), ("probability", "torso_m")
Network = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, ...]]
"""From (1, 128, 160) depth in metres and (1, 4) intrinsics to OUTPUT_NAMES, as `Cells` has them."""


class People(NamedTuple):
    """The P people of one image."""

    centres_m: np.ndarray  # (P, 3) float32 torso joints as voted, camera frame, metres
    score: np.ndarray  # (P,) float32 mean probability of their cells
    area_m2: np.ndarray  # (P,) float32 visible surface, seen from the camera
    cells: np.ndarray  # (P,) number of their cells
    owner: np.ndarray  # (h, w) uint8 person of each cell, 1..P, or NO_PERSON


def gather_people(cells: Cells, least_probability: float, least_m2: float, least_cells: int) -> People:
    """The people of an image, by decreasing surface that agrees on them.

    Cells of `least_probability` vote; a person has a visible surface of `least_m2` and `least_cells` of them, or more.
    """
    # numpy gathers and sorts: what numba would compile for it takes a third of a user's wait for the first joints.
    seen = np.nonzero((cells.area_m2 > 0) & (cells.probability >= np.float64(least_probability)))
    votes_m, probability, area_m2 = cells.torso_m[seen], cells.probability[seen], cells.area_m2[seen]
    weights = area_m2 * probability
    centres_m = _agreed(votes_m, weights, 0.5 * least_m2)
    weight = np.bincount(_nearest_centres(votes_m, centres_m) + 1, weights, len(centres_m) + 1)[1:]
    centres_m = centres_m[_are_whole(centres_m, weight, np.argsort(-weight))]
    person, count = _nearest_centres(votes_m, centres_m) + 1, len(centres_m) + 1
    surface_m2 = np.bincount(person, area_m2, count)
    size = np.bincount(person, minlength=count)
    kept = 1 + np.flatnonzero((size[1:] >= least_cells) & (surface_m2[1:] >= least_m2))
    number, owner = np.zeros(count, np.uint8), np.zeros(cells.probability.shape, np.uint8)
    number[kept] = np.arange(1, len(kept) + 1)
    owner[seen] = number[person]
    score = np.bincount(person, probability, count)[kept] / size[kept]
    return People(centres_m[kept - 1], score.astype(np.float32), surface_m2[kept].astype(np.float32), size[kept], owner)


def _agreed(points: np.ndarray, weights: np.ndarray, least: float) -> np.ndarray:
    """(P, 3) the centres on which more than the least weight of votes agrees, one after another, each without those before."""
    free, centres = np.ones(len(points), bool), []
    while len(centres) < MOST_PEOPLE:
        centre, weight = densest(points, weights, free)
        if weight < least:
            break
        free &= np.square(points - centre).sum(axis=1) >= TAKEN_M**2
        centres.append(centre)
    return np.array(centres, np.float32).reshape(-1, 3)


@njit(cache=True)
def _nearest_centres(points, centres):
    """(N,) the number of the centre nearest to each point, -1 if none is within REACH_M."""
    nearest = np.full(len(points), -1)
    for k in range(len(points)):
        least = REACH_M**2
        for person in range(len(centres)):
            distance = _squared(points[k], centres[person])
            if distance < least:
                nearest[k], least = person, distance
    return nearest


def _are_whole(centres: np.ndarray, weight: np.ndarray, order: np.ndarray) -> np.ndarray:
    """(P,) bool, the heaviest first: not where a small part of a nearby person's votes agrees, a hand's or a foot's."""
    kept = np.zeros(len(centres), bool)
    for person in order:
        near = kept & (np.square(centres - centres[person]).sum(axis=1) < PART_M**2)
        kept[person] = not (weight[person] < PART_SHARE * weight[near]).any()
    return kept


@njit(cache=True)
def densest(points, weights, free):
    """The point on which most of the free votes' weight agrees, moved twice to the mean of these, and their weight.

    Of (N, 3) float32 points, metres, (N,) weights, and (N,) bool which are free; (3,) float32, 0 where none is, and float.
    """
    step = max(1, len(points) // SEEDS)
    x, y, z = points[::step].T.copy()
    agreed = np.zeros(len(x))
    for k in range(len(points)):
        if free[k]:
            weight = np.float64(weights[k])
            for seed in range(len(x)):  # the inner loop, so that it vectorises
                apart = (points[k, 0] - x[seed]) ** 2 + (points[k, 1] - y[seed]) ** 2 + (points[k, 2] - z[seed]) ** 2
                agreed[seed] += weight if apart < np.float32(AGREE_M**2) else 0.0
    most, best = 0.0, -1
    for seed in range(len(x)):
        if free[seed * step] and agreed[seed] > most:
            most, best = agreed[seed], seed * step
    centre = np.zeros(3, np.float32)
    if best < 0:
        return centre, 0.0
    for axis in range(3):
        centre[axis] = points[best, axis]
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


SURE = (-0.18, 0.77, 2.74, 0.76)
"""Constant and weights of `certainty_features`, fitted by tools/fit_finder.py on validation images."""


def certainty_features(people: People) -> np.ndarray:
    """(P, 3) the logarithms of the odds of the mean probability, of the visible surface in square metres, and of its cells."""
    score = np.clip(people.score, 1e-3, 1 - 1e-3)
    return np.stack([np.log(score / (1 - score)), np.log(people.area_m2), np.log(people.cells)], axis=1)


def certainty(people: People) -> np.ndarray:
    """(P,) probability that each is a person whose centre is within 30 cm of the torso, in scenes full of clutter."""
    return 1 / (1 + np.exp(-(SURE[0] + certainty_features(people) @ SURE[1:])))


TOGETHER = (-0.37, 0.57, 0.67)
"""Constant and weights of a logistic regression on the log odds of a person by the finder and by the network that ships, fitted
by tools/fit_person.py on scenes of validation."""


def certainty_together(certainty: float, person_logit: float) -> float:
    """The probability of a person, from the finder's, strictly between 0 and 1, and the network's logit."""
    logit = TOGETHER[0] + TOGETHER[1] * math.log(certainty / (1 - certainty)) + TOGETHER[2] * person_logit
    return 1 / (1 + math.exp(-max(logit, -500.0)))


BESIDE_M, BESIDE_PER_M = 0.08, 0.02
"""A pixel is beside a cell in depth up to this difference, more at a distance."""


class OwnedCells(NamedTuple):
    """Whose the h x w cells of an image are."""

    depth_m: np.ndarray  # (h, w) float32 metres, 0 where nothing was measured
    probability: np.ndarray  # (h, w) float32 that the cell shows a person
    owner: np.ndarray  # (h, w) uint8 person of each cell, 1..P, or NO_PERSON
    reduction: float  # pixels of the image to one of the canvas, of which every STRIDE-th is a cell
    near: np.ndarray  # (h, w) uint8 whether a cell or one beside it is a person's
    alike: np.ndarray  # (h, w) bool whether the 4 x 4 cells around the pixels between each cell and the next are of one owner

    @classmethod
    def of(cls, depth_m: np.ndarray, probability: np.ndarray, owner: np.ndarray, reduction: float) -> "OwnedCells":
        """From the first four."""
        near = cv2.dilate(np.minimum(owner, 1), np.ones((3, 3)))
        least, most = (of(owner, np.ones((4, 4)), anchor=(1, 1)) for of in (cv2.erode, cv2.dilate))
        return cls(depth_m, probability, owner, reduction, near, least == most)


@njit(cache=True)
def pixel_owners(cells, depth_m, rows, columns):
    """Gives the pixels in some rows and columns of an image to people.

    A pixel takes the opinion of the 4 x 4 cells around it, the nearest in the image and in depth first, if the nearest or one
    beside it is a person's. From the (R, C) float32 depth, metres, of the (R,) rows and (C,) columns; (R, C) uint8 person.
    """
    h, w = cells.owner.shape
    owners = np.zeros(depth_m.shape, np.uint8)
    opinion = np.zeros(np.max(cells.owner) + 1, np.float32)
    for y in range(len(rows)):
        at_y = ((rows[y] + 0.5) / cells.reduction - 0.5) / STRIDE
        top, nearest_row = max(min(int(at_y), h - 1), 0), max(min(int(at_y + 0.5), h - 1), 0)
        for x in range(len(columns)):
            z = depth_m[y, x]
            at_x = ((columns[x] + 0.5) / cells.reduction - 0.5) / STRIDE
            left, nearest_column = max(min(int(at_x), w - 1), 0), max(min(int(at_x + 0.5), w - 1), 0)
            if z == 0 or not cells.near[nearest_row, nearest_column]:
                continue
            if cells.alike[top, left] and abs(cells.depth_m[top, left] - z) < BESIDE_M:
                owners[y, x] = cells.owner[top, left]  # whatever the others' depths: they would say the same
                continue
            reach = np.float32(BESIDE_M + BESIDE_PER_M * z)
            opinion[:] = 0
            for row in range(max(int(at_y) - 1, 0), min(int(at_y) + 3, h)):
                for column in range(max(int(at_x) - 1, 0), min(int(at_x) + 3, w)):
                    apart = abs(cells.depth_m[row, column] - z) / reach
                    if cells.depth_m[row, column] == 0 or apart > 1:
                        continue
                    beside = (row - at_y) ** 2 + (column - at_x) ** 2
                    weight = np.float32((1 - apart) / (0.2 + beside))
                    p, person = cells.probability[row, column], cells.owner[row, column]
                    opinion[person] += weight * (p if person else 1 - p)
            owners[y, x] = np.argmax(opinion)
    return owners
