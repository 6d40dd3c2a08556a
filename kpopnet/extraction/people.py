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
    owners, largest = _continued(people, pieces, votes)
    touching = pieces["touching"] > TOUCHING_SHARE * pieces["outline"]
    surrounded = pieces["touching"] > SURROUNDED_SHARE * pieces["outline"]
    covered = pieces["covered"] > COVERED_SHARE * pieces["pixels"]
    uncovered = np.where(owners == NOBODY, touching, surrounded) & covered
    uncovered[list(largest.values())] = False
    owners[uncovered] = UNCOVERED

    gaps_m = {k: _gaps_to_all_m(pieces, label, np.flatnonzero(owners == k)) for k, label in largest.items()}
    for k, gap_m in gaps_m.items():
        owners[(owners == k) & (gap_m > APART_M)] = NOBODY
    hidden = {
        k: person
        for k, person in enumerate(people, 1)
        if person.hidden < HIDDEN_FRAMES and (person.hidden or k not in largest)
    }
    asked = (owners == NOBODY) & ~touching
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
            owners[label], largest[nearest], gaps_m[nearest] = nearest, label, _gaps_m(pieces, pieces[label])
    return owners, largest


def _continued(people: list[Known], pieces: np.ndarray, votes: np.ndarray) -> tuple[np.ndarray, dict[int, int]]:
    """Owners by label, of what lies where somebody was, and the label of everybody's largest component."""
    owners = np.zeros(len(pieces), np.uint8)
    fits = _fits(pieces)
    held = votes > HELD_SHARE * np.array([0, *(person.pixels for person in people)])
    largest = {k: int(votes[:, k].argmax()) for k in np.flatnonzero(held.any(axis=0)).tolist()}
    for label in np.flatnonzero(votes.any(axis=1)).tolist():
        holds = [k for k, most in largest.items() if most == label]
        best = int(votes[label].argmax())
        if len(holds) > 1:
            owners[label] = SHARED
        elif holds and not fits[label]:
            owners[label] = OVERGROWN
        elif holds:
            owners[label] = holds[0]
        elif votes[label, best] > CONTINUED_SHARE * pieces["pixels"][label]:
            owners[label] = best
            largest.setdefault(best, label)
    return owners, largest


def returning(people: list[Known], present: Container[int], piece: np.void) -> int | None:
    """The number of the missing one who was last seen nearest to a new human; None if nobody is missing."""
    missing = [k for k in range(1, len(people) + 1) if k not in present]
    return min(missing, key=lambda k: _distance_m(people[k - 1].centre_m, piece["centre_m"]), default=None)


def has_persons_size(piece: np.void) -> bool:
    extent_m = (piece["high_m"] - piece["low_m"]).max()
    return bool(extent_m > LEAST_SIZE_M and piece["area_m2"] > LEAST_AREA_M2 and _fits(piece))


def _fits(pieces: np.ndarray) -> np.ndarray:
    return ((pieces["high_m"] - pieces["low_m"]).max(axis=-1) < MOST_SIZE_M) & (pieces["area_m2"] < MOST_AREA_M2)


def fragments_beside(objects: np.ndarray, labels: np.ndarray, newcomer: int) -> np.ndarray:
    """(N,) bool: a newcomer, and the small objects before and beside them (a raised leg, the foot behind the other).

    Args:
        objects: (N,) of `survey`.
        labels: (H, W) int32 whose objects they are.
        newcomer: the label.
    """
    theirs = (_gaps_m(objects, objects[newcomer]) <= BESIDE_M) & (objects["area_m2"] < FRAGMENT_M2)
    # A patch of wall seen past an arm is an object too.
    theirs &= objects["low_m"][:, 2] < objects["high_m"][newcomer, 2] + BESIDE_M
    theirs &= np.bincount(labels[grown(labels == newcomer, FRAGMENT_PX)], minlength=len(objects)) > 0
    theirs[0], theirs[newcomer] = False, True
    return theirs


def near_somebody(pieces: np.ndarray, label: int, present: dict[int, int]) -> bool:
    gaps_m = _gaps_m(pieces[list(present.values())], pieces[label])
    return bool((gaps_m < NEAR_SOMEBODY_M).any())


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


def _gaps_m(pieces: np.ndarray, piece: np.void) -> np.ndarray:
    """(N,) how far components are beside one of them: the largest gap between the boxes around them along an axis."""
    gap_m = np.maximum(pieces["low_m"] - piece["high_m"], piece["low_m"] - pieces["high_m"])
    gap_m /= 1, HEIGHT_GAP, DEPTH_GAP
    return np.maximum(gap_m.max(axis=1), 0)


def _gaps_to_all_m(pieces: np.ndarray, largest: int, theirs: np.ndarray) -> np.ndarray:
    """(N,) gaps to a human's largest component and those of their others that are near it or near one that is."""
    gap_m, joined = _gaps_m(pieces, pieces[largest]), {largest}
    while near := [label for label in theirs.tolist() if gap_m[label] <= APART_M and label not in joined]:
        for label in near:
            gap_m = np.minimum(gap_m, _gaps_m(pieces, pieces[label]))
        joined.update(near)
    return gap_m
