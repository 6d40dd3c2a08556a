"""Which estimated person is which true one, frame by frame, and the figures that follow from it.

An estimate is taken for a person whose centre, the mean of the joints found, is within CENTRE_M of its own, one for one. A
person keeps the identity of the frame before as long as it is that near; the others are matched such that the sum of distances
is least. A person is judged where at least half of the body shows (`sight`). Estimates within NEAR_M of other people, of whom
less shows or who are behind others, count as neither right nor wrong. All others are false.

MOTA is that of CLEAR MOT: Bernardin & Stiefelhagen, "Evaluating Multiple Object Tracking Performance", EURASIP Journal on Image
and Video Processing 2008.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from kpopnet.datasets.simulated import StoredSequence
from kpopnet.evaluation.intervals import Bootstrap
from kpopnet.evaluation.poses.metrics import WITHIN_M, joint_errors_m, ratio
from kpopnet.evaluation.values import plain
from kpopnet.skeleton import NUM_JOINTS

CENTRE_M, NEAR_M = 0.3, 0.5
"""Greatest distance of the centres: of a judged person and the estimate taken for them, of another person and theirs."""

LEAST_IN_SIGHT, LEAST_INSIDE = 0.5, 0.8
"""Least share of the pixels of a judged person that show, and of the joints inside the image where `whole_px` is unknown."""

NOBODY = -1
ALL = "all"
"""The row of all kinds of scenes."""

DIVIDED_JOINTS = 3
"""An estimate is of two people as one if this many of its joints or more are nearest to each of them."""


@dataclass(frozen=True)
class MatchedSequence:
    """One sequence of T frames and P people with the estimates that were matched to them."""

    name: str
    kind: str  # of scene
    seen: np.ndarray  # (T, P) bool, whether the person is judged
    hidden: np.ndarray  # (T, P) bool, whether the person is in view, but less than half of the body shows
    empty: np.ndarray  # (T,) bool, whether the image shows no part of any person
    identity: np.ndarray  # (T, P) int, identity of the matched estimate, NOBODY where there is none
    errors_m: np.ndarray  # (T, P, 15) distances of its joints from the true ones, infinite where missing
    false: np.ndarray  # (T,) number of estimates that were taken for no person
    estimates_m: np.ndarray  # (E, T, 15, 3) joints of all people found, metres, NaN where missing
    identities: np.ndarray  # (E,) their identities
    seconds: float  # processor time of the estimation

    def switches(self) -> np.ndarray:
        """(T, P) bool: frames in which a seen person has another identity than when it was last found and seen."""
        switched = np.zeros(self.identity.shape, bool)
        for person, found in enumerate((self.seen & (self.identity != NOBODY)).T):
            frames = np.flatnonzero(found)
            switched[frames[1:], person] = np.diff(self.identity[frames, person]) != 0
        return switched

    def identified(self) -> int:
        """The frames of people under the identity that is theirs, by the best map of people to identities.

        It is IDTP of Ristani et al., "Performance Measures and a Data Set for Multi-Target, Multi-Camera Tracking", ECCV
        workshops 2016, counted over the CLEAR MOT matches: where two estimates lie on one person, only the matched one counts,
        so it is at most theirs.
        """
        identities = np.unique(self.identity[self.identity != NOBODY])
        counts = ((self.identity[..., None] == identities) & self.seen[..., None]).sum(axis=0)  # (P, identities)
        return int(counts[linear_sum_assignment(counts, maximize=True)].sum())


def sight(sequence: StoredSequence) -> tuple[np.ndarray, np.ndarray]:
    """(T, P) bool each: who is judged, and who is in view, but not enough of them shows."""
    seen_px, alone_px, whole_px = sequence.seen_px, sequence.alone_px, sequence.whole_px
    assert seen_px is not None, sequence.name
    if whole_px is not None:
        judged = (seen_px > 0) & (seen_px >= LEAST_IN_SIGHT * whole_px)
        return judged, (seen_px > 0) & ~judged
    assert alone_px is not None, sequence.name
    camera, (u, v, z) = sequence.camera, np.moveaxis(sequence.camera.project(sequence.joints_m), -1, 0)
    joint_inside = (z > 0) & (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)
    inside = (joint_inside.mean(axis=-1) >= LEAST_INSIDE) & (alone_px > 0)
    in_sight = seen_px >= LEAST_IN_SIGHT * alone_px
    return inside & in_sight, inside & ~in_sight


def match(sequence: StoredSequence, estimates_m: np.ndarray, identities: np.ndarray, seconds: float) -> MatchedSequence:
    """Matches estimates, as `MatchedSequence` has them, to the people of a sequence."""
    truth_m = sequence.joints_m
    seen, hidden = sight(sequence)
    identity, errors_m = np.full(seen.shape, NOBODY), np.full((*seen.shape, NUM_JOINTS), np.inf)
    false = np.zeros(len(seen), int)
    shows = np.asarray(sequence.seen_px) > 0
    empty, others = ~shows.any(axis=1), ~seen & (shows | hidden)
    matched: dict[int, int] = {}
    for frame in range(len(seen)):
        found = np.isfinite(estimates_m[:, frame]).any(axis=(1, 2))
        people = seen[frame], others[frame]
        matched = {} if empty[frame] else _match_frame(truth_m[frame], people, estimates_m[:, frame], found, matched)
        for person, one in matched.items():
            identity[frame, person] = identities[one]
            errors_m[frame, person] = joint_errors_m(truth_m[frame, person], estimates_m[one, frame])
        false[frame] = found.sum() - len(matched)
    name, kind = sequence.name, sequence.kind
    return MatchedSequence(name, kind, seen, hidden, empty, identity, errors_m, false, estimates_m, identities, seconds)


def _match_frame(
    truth_m: np.ndarray,
    people: tuple[np.ndarray, np.ndarray],
    estimates_m: np.ndarray,
    found: np.ndarray,
    before: dict[int, int],
) -> dict[int, int]:
    """Number of the estimate of each person who has one in a frame; `before` is the result for the frame before.

    Of the (P, 15, 3) true joints two of (P,) bool in `people` say who is judged and chooses first, and who else is in view; of
    the (E, 15, 3) estimates (E,) `found` which have a joint.
    """
    apart_m = np.full((len(truth_m), len(estimates_m)), np.inf)
    apart_m[:, found] = np.linalg.norm(np.nanmean(truth_m[:, None] - estimates_m[None, found], axis=2), axis=-1)
    matched: dict[int, int] = {}
    for choosing, reach_m in zip(people, (CENTRE_M, NEAR_M), strict=True):
        free = np.isin(np.arange(len(estimates_m)), list(matched.values()), invert=True)
        cost = np.where(choosing[:, None] & free & (apart_m < reach_m), apart_m, 1e3)
        for person, one in before.items():
            if cost[person, one] < reach_m:
                cost[person, one] = -1e6  # kept whatever it costs the others
        pairs = zip(*linear_sum_assignment(cost), strict=True)
        matched |= {int(person): int(one) for person, one in pairs if cost[person, one] < reach_m}
    return matched


def wrong_joints(part: MatchedSequence) -> np.ndarray:
    """(T,) joints beyond WITHIN_M or missing, of judged people and of estimates of no person."""
    return ((part.errors_m >= WITHIN_M) & part.seen[..., None]).sum(axis=(1, 2)) + NUM_JOINTS * part.false


def causes(truth_m: np.ndarray, part: MatchedSequence, frame: int) -> dict[str, int]:
    """What is wrong in a frame with (P, 15, 3) true joints: a number of people by cause, and the wrong joints of those found.

    Two people are estimated as one if a judged person is not found, and an estimate has DIVIDED_JOINTS joints or more that are
    nearer to this person than to any other, and as many that are nearest to one other.
    """
    seen, found, estimates_m = part.seen[frame], part.identity[frame] != NOBODY, part.estimates_m[:, frame]
    apart_m = np.linalg.norm(truth_m[:, None] - estimates_m[None], axis=-1)  # (P, E, 15), NaN where missing
    nearest = (apart_m == apart_m.min(axis=0)).sum(axis=2) if len(truth_m) else np.zeros(apart_m.shape[:2])  # (P, E)
    divided = (nearest >= DIVIDED_JOINTS) & ((nearest >= DIVIDED_JOINTS).sum(axis=0) > 1)
    as_one = seen & ~found & divided.any(axis=1)
    counts = {
        "two as one": as_one.sum(),
        "not found": (seen & ~found & ~as_one).sum(),
        "false person": part.false[frame],
        "wrong joints": (part.errors_m[frame, seen & found] >= WITHIN_M).sum(),
    }
    return {cause: int(number) for cause, number in counts.items() if number}


def by_kind(parts: list[MatchedSequence], seed: int) -> dict[str, dict]:
    """`figures` of each kind of scene, and of ALL."""
    kinds = dict.fromkeys(part.kind for part in parts)
    groups = {kind: [part for part in parts if part.kind == kind] for kind in kinds} | {ALL: parts}
    return {kind: figures(group, seed) for kind, group in groups.items()}


def figures(parts: list[MatchedSequence], seed: int) -> dict:
    """The figures of some sequences, pooled over frames and people; None where undefined. `seed` is the bootstrap's.

    `seen`, `hidden`: people in frames who are judged, and of whom less than half shows; `people_recall`: share of the judged
    who were found; `people_precision`: share of the estimates that are of a judged person, without those of other people;
    `map_10cm`, `mean_error_cm`: of the joints of the judged, where a person who was not found counts as fifteen joints beyond
    10 cm and is left out of the mean; the same with `hidden_`; `false`: estimates of no person; `switches`: of identities;
    `mota`: 1 - (missed + false + switches) / judged (CLEAR MOT); `idf1` (Ristani et al. 2016, over the same matches);
    `empty_images`: images without a person, `empty_images_with_people`: those of them in which one was found, `empty_share`:
    their share; `interval`: 95 % intervals over sequences; `fps`: images a second of one core, all stages.
    """
    sums = [_sums(part) for part in parts]
    columns = {name: np.array([one[name] for one in sums], float).T[..., None] for name in sums[0]}  # (2, N, 1)
    bootstrap = Bootstrap(np.arange(len(parts)), seed)

    def total(count: Callable[[MatchedSequence], int]) -> int:
        return int(sum(count(part) for part in parts))

    pooled = {
        "sequences": len(parts),
        "images": total(lambda part: len(part.seen)),
        "seen": total(lambda part: part.seen.sum()),
        "hidden": total(lambda part: part.hidden.sum()),
        **{name: ratio(one.sum(), other.sum()) for name, (one, other) in columns.items()},
        "false": total(lambda part: part.false.sum()),
        "switches": total(lambda part: part.switches().sum()),
        "empty_images": total(lambda part: part.empty.sum()),
        "empty_images_with_people": total(lambda part: (part.false[part.empty] > 0).sum()),
        "interval": {name: bootstrap.interval(*pair) for name, pair in columns.items()},
        "fps": ratio(total(lambda part: len(part.seen)), max(sum(part.seconds for part in parts), 1e-9)),
    }
    return plain(pooled)


def _sums(part: MatchedSequence) -> dict[str, tuple[float, float]]:
    """Numerator and denominator of every figure of `figures` that is a ratio."""
    seen, false = int(part.seen.sum()), int(part.false.sum())
    right = int((part.seen & (part.identity != NOBODY)).sum())

    def of_joints(people: np.ndarray) -> dict[str, tuple[float, float]]:
        errors_m = part.errors_m[people]
        found = errors_m[np.isfinite(errors_m)]
        return {
            "map_10cm": ((errors_m < WITHIN_M).sum(), errors_m.size),
            "mean_error_cm": (100 * found.sum(), found.size),
        }

    return {
        "people_recall": (right, seen),
        "people_precision": (right, right + false),
        **of_joints(part.seen),
        "mota": (right - false - part.switches().sum(), seen),
        "idf1": (2 * part.identified(), seen + right + false),
        **{f"hidden_{name}": pair for name, pair in of_joints(part.hidden).items()},
        "empty_share": ((part.false[part.empty] > 0).sum(), part.empty.sum()),
    }
