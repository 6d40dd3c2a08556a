"""Human detection and identification (Algorithm 1): which components are people, and which person each one is.

A component belongs to a tracked person if enough of its pixels belonged to that person in the previous image, at a
similar depth. A small component next to a person belongs to that person as well (a hand in front of the body is a
component of its own). A component that belongs to no person and has moved is a new human if it has the size of a person.

The paper gives a human the identity of the nearest human of the previous image. Here, components continue the people who
are visible, and only a new human is compared with the missing ones: a person who returns takes the identity of the
nearest missing person, however long the absence was. People who occlude each other differ in depth, so a part that
reappears is given to the person at its depth.
"""

from collections.abc import Container
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from kpopnet.extraction.background import NO_PERSON, UNCOVERED, dilated

PERSON_AND_OBJECT, SEVERAL_PEOPLE = 253, 254
"""Owners of components that `assignment` divides pixel by pixel: a person merged with an object that is not in the
background, and several people merged."""

MIN_CONTINUED_SHARE = 0.2
"""A component continues a person if at least this share of its pixels belonged to the person at a similar depth."""

MIN_HELD_SHARE = 0.2
"""A person's main component holds more of the person's previous pixels than any other, and more than this share of them.
A component that is the main component of several people is divided."""

MAX_TOUCHING_SHARE, MAX_TOUCHING_SHARE_OWNED = 0.2, 0.5
"""A component is background if it continues into the known background along more than this share of its outline: noise,
or uncovered background where more than MIN_OCCLUDED_SHARE of it was occluded since the first image. The second value
holds for components that belonged to a person."""

MIN_OCCLUDED_SHARE = 0.5

JOIN_GAP_M, KEEP_GAP_M = 0.15, 0.3
"""A component joins a person whose components are at most JOIN_GAP_M beside it, and stays theirs up to KEEP_GAP_M."""

HEIGHT_GAP_RATIO, DEPTH_GAP_RATIO = 3, 4
"""Gaps in height and in depth may be larger than sideways by these factors: what lies between may be occluded."""

MAX_FRAGMENT_M2, MAX_FRAGMENT_GAP_PX = 0.2, 3
"""A static object up to this area belongs to a new person if it is at most this many pixels beside them in the image."""

MIN_NEW_PERSON_GAP_M = 0.5
"""Movement nearer than this to a tracked person does not turn a static object into a new person."""

MAX_HIDDEN_FRAMES, REAPPEAR_DISTANCE_M = 60, 0.5
"""For this many frames after a person became hidden, wholly or in part, components within this distance of their last
position may be theirs; sideways within LATERAL_RATIO times the distance."""

LATERAL_RATIO = 2

MIN_VISIBLE_RATIO, AREA_DECAY = 0.5, 0.99
"""A person is partly hidden if less than this ratio of their largest recent area is visible. The largest recent area
decays by AREA_DECAY per frame."""

MIN_EXTENT_M, MAX_EXTENT_M = 0.8, 2.6
MIN_AREA_M2, MAX_AREA_M2 = 0.12, 1.5
"""Largest extent and visible surface area of a new person."""

MIN_VISIBLE_M2 = 0.01
"""A person with less visible surface is hidden."""

MIN_MOVED_M = 0.04
"""A person has moved if their centre has moved by more than this."""


@dataclass
class Track:
    """The state of one tracked person.

    Attributes:
        identity: the person's number in the output.
        visible: whether the person was visible in the previous image.
        pixels: number of visible pixels in the previous image.
        centre_m: (3,) centre when the person was last not hidden, camera frame, metres.
        low_m: (2,) lower bounds of x and z at that time.
        high_m: (2,) upper bounds of x and z at that time.
        area_m2: largest recent visible area.
        hidden: number of frames for which the person has been hidden, wholly or in part.
        expected_at_m: (3,) centre at which `stationary` found the person; None once they have moved.
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

    def update(self, silhouette: np.void) -> None:
        """Updates the state with the person's SILHOUETTE in one image."""
        area_m2 = float(silhouette["area_m2"])
        self.visible = area_m2 > MIN_VISIBLE_M2
        self.pixels = int(silhouette["pixels"]) if self.visible else 0
        if not self.visible or (self.hidden < MAX_HIDDEN_FRAMES and area_m2 < MIN_VISIBLE_RATIO * self.area_m2):
            self.hidden += 1
            return
        self.hidden, self.area_m2 = 0, max(area_m2, AREA_DECAY * self.area_m2)
        self.centre_m, self.low_m, self.high_m = (silhouette[name].copy() for name in ("centre_m", "low_m", "high_m"))
        if self.expected_at_m is not None and _distance_m(self.centre_m, self.expected_at_m) > MIN_MOVED_M:
            self.expected_at_m = None


def associate_components(
    tracks: list[Track], components: np.ndarray, votes: np.ndarray, epsilon_m_m2: float
) -> tuple[np.ndarray, dict[int, int]]:
    """Assigns components to the tracked people.

    Args:
        tracks: all tracked people.
        components: (N + 1,) COMPONENT from `component_stats`.
        votes: (N + 1, len(tracks) + 1) from `component_stats`.
        epsilon_m_m2: a person who was wholly hidden is visible again if more than this area of a component has moved.

    Returns:
        (N + 1,) uint8 owners by label: NO_PERSON, UNCOVERED, PERSON_AND_OBJECT, SEVERAL_PEOPLE, or a person's number,
        which is 1 + their index in `tracks`; and the label of the main component by the number of each visible person.
    """
    pixels_before = np.array([0, *(track.pixels for track in tracks)])
    owners, main_labels, gaps_m = _continue_tracks(components, votes, pixels_before)
    main = {k: label for k, label in enumerate(main_labels.tolist()) if label}
    hidden = {
        k: track for k, track in enumerate(tracks, 1) if track.hidden < MAX_HIDDEN_FRAMES and (track.hidden or k not in main)
    }
    candidates = (owners == NO_PERSON) & (components["touching"] <= MAX_TOUCHING_SHARE * components["outline"])
    if hidden:
        # A component assigned to the person in front may belong to the hidden person behind.
        candidates |= (owners != NO_PERSON) & (owners < PERSON_AND_OBJECT)
        candidates[list(main.values())] = False
    candidates[0] = False
    for label in np.flatnonzero(candidates).tolist():
        limit_m = JOIN_GAP_M if owners[label] == NO_PERSON else KEEP_GAP_M
        distances_m = {k: _distance_xz_m(components[label], components[main[k]]) for k in main if gaps_m[k][label] <= limit_m}
        for k, track in hidden.items():
            distance_m = _distance_xz_m(components[label], track)
            if distance_m < REAPPEAR_DISTANCE_M:
                distances_m[k] = min(distance_m, distances_m.get(k, np.inf))
        nearest = min(distances_m, key=distances_m.__getitem__, default=NO_PERSON)
        if nearest == NO_PERSON or nearest in main:
            owners[label] = nearest
        elif components["moved_m2"][label] > epsilon_m_m2:
            owners[label], main[nearest], gaps_m[nearest] = nearest, label, _gaps_m(components, label)
    return owners, main


@njit(cache=True)
def _continue_tracks(components, votes, pixels_before):
    """Assigns the components that overlap people of the previous image; arguments as in `associate_components`.

    Returns:
        (N + 1,) uint8 owners by label; (P + 1,) the label of each person's main component, 0 for none; and
        (P + 1, N + 1) the gap in metres between each person's components and each component.
    """
    owners = np.zeros(len(components), np.uint8)
    main = np.zeros(len(pixels_before), np.int64)
    for k in range(1, len(pixels_before)):
        most = MIN_HELD_SHARE * pixels_before[k]
        for label in range(1, len(components)):
            if votes[label, k] > most:
                most, main[k] = votes[label, k], label
    for label in range(1, len(components)):
        component, best, holders = components[label], np.argmax(votes[label]), 0
        for k in range(1, len(pixels_before)):
            if main[k] == label:
                best, holders = k, holders + 1
        if holders:
            owners[label] = SEVERAL_PEOPLE if holders > 1 else best if _is_small_enough(component) else PERSON_AND_OBJECT
            continue
        if votes[label, best] > MIN_CONTINUED_SHARE * component.pixels:
            owners[label] = best
            if main[best] == 0:
                main[best] = label
                continue
        most_touching = MAX_TOUCHING_SHARE if owners[label] == NO_PERSON else MAX_TOUCHING_SHARE_OWNED
        occluded = component.occluded > MIN_OCCLUDED_SHARE * component.pixels
        if occluded and component.touching > most_touching * component.outline:
            owners[label] = UNCOVERED

    gaps_m = np.full((len(pixels_before), len(components)), np.inf)
    joined = np.zeros(len(components), np.bool_)
    for k in range(1, len(pixels_before)):
        if main[k] == 0:
            continue
        # A person's components form a chain: each is beside the main component or beside another in the chain.
        joined[:] = False
        following = main[k]
        while following:
            joined[following] = True
            gaps_m[k] = np.minimum(gaps_m[k], _gaps_m(components, following))
            following = 0
            for label in range(1, len(components)):
                if owners[label] == k and not joined[label] and gaps_m[k, label] <= KEEP_GAP_M:
                    following = label
        for label in range(1, len(components)):
            if owners[label] == k and not joined[label]:
                owners[label] = NO_PERSON
    return owners, main, gaps_m


def nearest_missing(tracks: list[Track], present: Container[int], component: np.void) -> int | None:
    """The number of the missing person whose last centre is nearest to a new human; None if no person is missing."""
    missing = [k for k in range(1, len(tracks) + 1) if k not in present]
    return min(missing, key=lambda k: _distance_m(tracks[k - 1].centre_m, component["centre_m"]), default=None)


def is_person_sized(component: np.void) -> bool:
    extent_m = (component["high_m"] - component["low_m"]).max()
    return bool(extent_m > MIN_EXTENT_M and component["area_m2"] > MIN_AREA_M2 and _is_small_enough(component))


@njit(cache=True)
def _is_small_enough(component):
    return np.max(component.high_m - component.low_m) < MAX_EXTENT_M and component.area_m2 < MAX_AREA_M2


def with_fragments(objects: np.ndarray, labels: np.ndarray, newcomer: int) -> np.ndarray:
    """(N,) bool: a new person and the small objects beside them (a raised leg, the foot behind the other).

    Args:
        objects: (N,) COMPONENT from `component_stats`.
        labels: (H, W) int32 label of each pixel's object.
        newcomer: the new person's label.
    """
    selected = (_gaps_m(objects, newcomer) <= JOIN_GAP_M) & (objects["area_m2"] < MAX_FRAGMENT_M2)
    # Objects behind the person are not theirs: a patch of wall visible past an arm is an object too.
    selected &= objects["low_m"][:, 2] < objects["high_m"][newcomer, 2] + JOIN_GAP_M
    selected &= np.bincount(labels[dilated(labels == newcomer, MAX_FRAGMENT_GAP_PX)], minlength=len(objects)) > 0
    selected[0], selected[newcomer] = False, True
    return selected


def is_near_person(components: np.ndarray, label: int, present: dict[int, int]) -> bool:
    return bool((_gaps_m(components, label)[list(present.values())] < MIN_NEW_PERSON_GAP_M).any())


def _distance_m(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b))


def _distance_xz_m(component: np.void, other: np.void | Track) -> float:
    """The gap in x and z between a component and another or a tracked person.

    The gap in x is divided by LATERAL_RATIO, since people reappear from behind others sideways.
    """
    low_m, high_m = (other.low_m, other.high_m) if isinstance(other, Track) else _bounds_xz_m(other)
    component_low_m, component_high_m = _bounds_xz_m(component)
    lateral, behind = np.maximum(np.maximum(component_low_m - high_m, low_m - component_high_m), 0).tolist()
    return max(lateral / LATERAL_RATIO, behind)


def _bounds_xz_m(component: np.void) -> tuple[np.ndarray, np.ndarray]:
    return component["low_m"][::2], component["high_m"][::2]


@njit(cache=True)
def _gaps_m(components, label):
    """(N,) the gap between every component's bounding box and that of `label`: the largest over the three axes.

    Gaps in height and depth are divided by HEIGHT_GAP_RATIO and DEPTH_GAP_RATIO.
    """
    gaps_m = np.zeros(len(components))
    here = components[label]
    for other in range(len(components)):
        there = components[other]
        for axis, ratio in enumerate((1, HEIGHT_GAP_RATIO, DEPTH_GAP_RATIO)):
            gap_m = max(there.low_m[axis] - here.high_m[axis], here.low_m[axis] - there.high_m[axis]) / ratio
            gaps_m[other] = max(gaps_m[other], gap_m)
    return gaps_m
