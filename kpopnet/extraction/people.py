"""Human detection and identification (Algorithm 1): which components are people, and which people they were.

A component is somebody's if it lies where they were in the picture before, at the depth they had; small ones beside
somebody are theirs too (a hand before the body is a component of its own). What is left and has moved is a new human if
it has a person's size.

The paper gives a human the identity of the nearest one in the picture before. That is not asked of people who are
continued by components, but of those who are missing: somebody who comes back is the nearest of them, however long it has
been. People who hide each other differ in depth, so that what comes to light piece by piece is whoever's depth it has.
"""

from collections.abc import Container
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from kpopnet.extraction.room import NOBODY, UNCOVERED, grown

OVERGROWN, SHARED = 253, 254
"""Owners of components that are divided pixel by pixel: somebody and things that the room's memory does not know; several
people."""

CONTINUED_SHARE = 0.2
"""A component continues somebody if so much of it lies where and as deep as they were."""

HELD_SHARE = 0.2
"""A component that holds so much of each of several people is divided, unless more of them is elsewhere."""

TOUCHING_SHARE, SURROUNDED_SHARE = 0.2, 0.5
"""A component that goes on in the known room along so much of its outline is room, not human: noise or, if most of it lies
where a human has always been (COVERED_SHARE), room that has come to light; the second share is for what was somebody's."""

COVERED_SHARE = 0.5

BESIDE_M, APART_M = 0.15, 0.3
"""How far beside what is somebody's other components may be to become theirs, and to stay it,"""

HEIGHT_GAP, DEPTH_GAP = 3, 4
"""and so many times as far above or below and before or behind, where something may hide what is between."""

FRAGMENT_M2, FRAGMENT_PX = 0.2, 3
"""What stands still and is no larger belongs to a newcomer beside it, if so close to them in the picture."""

NEAR_SOMEBODY_M = 0.5
"""What moves so near to somebody does not make a human of a thing that stood still."""

HIDDEN_FRAMES, HIDDEN_REACH_M = 60, 0.5
"""Who has been hidden for so few frames, wholly or in part, may come to light piece by piece, so near to where they were
or ASIDE times as far to the side."""

ASIDE = 2

HIDDEN_SHARE, FORGETTING = 0.5, 0.99
"""Less than this share of the most that was to be seen of somebody means that they are hidden in part; how fast that most
is forgotten, from one picture to the next."""

LEAST_SIZE_M, MOST_SIZE_M = 0.8, 2.6
LEAST_AREA_M2, MOST_AREA_M2 = 0.12, 1.5
"""A new human's longest extent and visible surface."""

LEAST_SEEN_M2 = 0.01
"""With less to be seen of them people are hidden."""

MOVED_M = 0.04
"""Whose centre has moved by so much has moved."""


@dataclass
class Known:
    """Somebody who was seen.

    Attributes:
        identity: their number.
        visible: whether they were to be seen in the picture before,
        pixels: and how much of them.
        centre_m: (3,) where they were last when they were not hidden,
        low_m: (2,) x and z where they began then,
        high_m: (2,) and where they ended.
        area_m2: the most that was to be seen of them lately.
        hidden: for how many frames they have been hidden, wholly or in part.
        expected_at_m: (3,) where they were found by their shape, as long as they have not moved.
    """

    identity: int
    visible: bool = False
    pixels: int = 0
    centre_m: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    low_m: np.ndarray = field(default_factory=lambda: np.zeros(2, np.float32))
    high_m: np.ndarray = field(default_factory=lambda: np.zeros(2, np.float32))
    area_m2: float = 0.0
    hidden: int = 0
    expected_at_m: np.ndarray | None = None

    def see(self, silhouette: np.void) -> None:
        """Takes note of what is seen of them in a picture."""
        area_m2 = float(silhouette["area_m2"])
        self.visible = area_m2 > LEAST_SEEN_M2
        self.pixels = int(silhouette["pixels"]) if self.visible else 0
        if not self.visible or (self.hidden < HIDDEN_FRAMES and area_m2 < HIDDEN_SHARE * self.area_m2):
            self.hidden += 1
            return
        self.hidden, self.area_m2 = 0, max(area_m2, FORGETTING * self.area_m2)
        self.centre_m, self.low_m, self.high_m = (silhouette[name].copy() for name in ("centre_m", "low_m", "high_m"))
        if self.expected_at_m is not None and _distance_m(self.centre_m, self.expected_at_m) > MOVED_M:
            self.expected_at_m = None


def continue_people(
    people: list[Known], pieces: np.ndarray, votes: np.ndarray, epsilon_m_m2: float
) -> tuple[np.ndarray, dict[int, int]]:
    """Gives components to the people they continue or belong to.

    Args:
        people: all who are known.
        pieces: (N + 1,) of `survey`.
        votes: (N + 1, len(people) + 1) of `survey`.
        epsilon_m_m2: somebody who was wholly hidden is back if so much of them has come to light.

    Returns:
        (N + 1,) uint8 owners by label: NOBODY, UNCOVERED, OVERGROWN, SHARED, or somebody's number, 1 + their place in
        `people`; and by the numbers of all who are there the label of their largest component.
    """
    had_px = np.array([0, *(person.pixels for person in people)])
    owners, largest_of, gaps_m = _continue(pieces, votes, had_px)
    largest = {k: label for k, label in enumerate(largest_of.tolist()) if label}
    hidden = {
        k: person
        for k, person in enumerate(people, 1)
        if person.hidden < HIDDEN_FRAMES and (person.hidden or k not in largest)
    }
    asked = (owners == NOBODY) & (pieces["touching"] <= TOUCHING_SHARE * pieces["outline"])
    if hidden:
        # What is taken for a part of whoever stands before them may be theirs.
        asked |= (owners != NOBODY) & (owners < OVERGROWN)
        asked[list(largest.values())] = False
    asked[0] = False
    for label in np.flatnonzero(asked).tolist():
        limit_m = BESIDE_M if owners[label] == NOBODY else APART_M
        away_m = {k: _away_m(pieces[label], pieces[largest[k]]) for k in largest if gaps_m[k][label] <= limit_m}
        for k, person in hidden.items():
            from_there_m = _away_m(pieces[label], person)
            if from_there_m < HIDDEN_REACH_M:
                away_m[k] = min(from_there_m, away_m.get(k, np.inf))
        nearest = min(away_m, key=away_m.__getitem__, default=NOBODY)
        if nearest == NOBODY or nearest in largest:
            owners[label] = nearest
        elif pieces["moved_m2"][label] > epsilon_m_m2:
            owners[label], largest[nearest], gaps_m[nearest] = nearest, label, _gaps_m(pieces, label)
    return owners, largest


@njit(cache=True)
def _continue(pieces, votes, had_px):
    """Whose components are that lie where somebody was; arguments as in `continue_people`.

    Returns:
        (N + 1,) uint8 owners by label; (P + 1,) the label of everybody's largest component, 0 for none; and (P + 1, N + 1)
        how far every component is beside what is somebody's.
    """
    owners = np.zeros(len(pieces), np.uint8)
    largest = np.zeros(len(had_px), np.int64)
    for k in range(1, len(had_px)):
        most = HELD_SHARE * had_px[k]
        for label in range(1, len(pieces)):
            if votes[label, k] > most:
                most, largest[k] = votes[label, k], label
    for label in range(1, len(pieces)):
        piece, best, holders = pieces[label], np.argmax(votes[label]), 0
        for k in range(1, len(had_px)):
            if largest[k] == label:
                best, holders = k, holders + 1
        if holders:
            owners[label] = SHARED if holders > 1 else best if _fits(piece) else OVERGROWN
            continue
        if votes[label, best] > CONTINUED_SHARE * piece.pixels:
            owners[label] = best
            if largest[best] == 0:
                largest[best] = label
                continue
        least = TOUCHING_SHARE if owners[label] == NOBODY else SURROUNDED_SHARE
        if piece.covered > COVERED_SHARE * piece.pixels and piece.touching > least * piece.outline:
            owners[label] = UNCOVERED

    gaps_m = np.full((len(had_px), len(pieces)), np.inf)
    joined = np.zeros(len(pieces), np.bool_)
    for k in range(1, len(had_px)):
        if largest[k] == 0:
            continue
        # Somebody's components hang together, each beside the largest or beside another that does.
        joined[:] = False
        following = largest[k]
        while following:
            joined[following] = True
            gaps_m[k] = np.minimum(gaps_m[k], _gaps_m(pieces, following))
            following = 0
            for label in range(1, len(pieces)):
                if owners[label] == k and not joined[label] and gaps_m[k, label] <= APART_M:
                    following = label
        for label in range(1, len(pieces)):
            if owners[label] == k and not joined[label]:
                owners[label] = NOBODY
    return owners, largest, gaps_m


def returning(people: list[Known], present: Container[int], piece: np.void) -> int | None:
    """The number of the missing one who was last seen nearest to a new human; None if nobody is missing."""
    missing = [k for k in range(1, len(people) + 1) if k not in present]
    return min(missing, key=lambda k: _distance_m(people[k - 1].centre_m, piece["centre_m"]), default=None)


def has_persons_size(piece: np.void) -> bool:
    extent_m = (piece["high_m"] - piece["low_m"]).max()
    return bool(extent_m > LEAST_SIZE_M and piece["area_m2"] > LEAST_AREA_M2 and _fits(piece))


@njit(cache=True)
def _fits(piece):
    return np.max(piece.high_m - piece.low_m) < MOST_SIZE_M and piece.area_m2 < MOST_AREA_M2


def fragments_beside(objects: np.ndarray, labels: np.ndarray, newcomer: int) -> np.ndarray:
    """(N,) bool: a newcomer, and the small objects before and beside them (a raised leg, the foot behind the other).

    Args:
        objects: (N,) of `survey`.
        labels: (H, W) int32 whose objects they are.
        newcomer: the label.
    """
    theirs = (_gaps_m(objects, newcomer) <= BESIDE_M) & (objects["area_m2"] < FRAGMENT_M2)
    # A patch of wall seen past an arm is an object too.
    theirs &= objects["low_m"][:, 2] < objects["high_m"][newcomer, 2] + BESIDE_M
    theirs &= np.bincount(labels[grown(labels == newcomer, FRAGMENT_PX)], minlength=len(objects)) > 0
    theirs[0], theirs[newcomer] = False, True
    return theirs


def near_somebody(pieces: np.ndarray, label: int, present: dict[int, int]) -> bool:
    return bool((_gaps_m(pieces, label)[list(present.values())] < NEAR_SOMEBODY_M).any())


def _distance_m(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b))


def _away_m(piece: np.void, other: np.void | Known) -> float:
    """How far apart in x and z a component and another or somebody are; people come forth from behind others sideways."""
    low_m, high_m = (other.low_m, other.high_m) if isinstance(other, Known) else _ranges_m(other)
    piece_low_m, piece_high_m = _ranges_m(piece)
    aside, behind = np.maximum(np.maximum(piece_low_m - high_m, low_m - piece_high_m), 0).tolist()
    return max(aside / ASIDE, behind)


def _ranges_m(piece: np.void) -> tuple[np.ndarray, np.ndarray]:
    return piece["low_m"][::2], piece["high_m"][::2]


@njit(cache=True)
def _gaps_m(pieces, label):
    """(N,) how far components are beside one of them: the largest gap between the boxes around them along an axis."""
    gaps_m = np.zeros(len(pieces))
    here = pieces[label]
    for other in range(len(pieces)):
        there = pieces[other]
        for axis, shrunk in enumerate((1, HEIGHT_GAP, DEPTH_GAP)):
            gap_m = max(there.low_m[axis] - here.high_m[axis], here.low_m[axis] - there.high_m[axis]) / shrunk
            gaps_m[other] = max(gaps_m[other], gap_m)
    return gaps_m
