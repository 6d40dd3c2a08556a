"""Which estimated person is which true one, frame by frame, and the figures that follow from it.

The counts are those of CLEAR MOT (Bernardin & Stiefelhagen, "Evaluating Multiple Object Tracking Performance", EURASIP Journal
on Image and Video Processing 2008): people who are missed, people who are not there, and identity switches. A person keeps the
identity of the frame before as long as it is within REACH_M; the others are matched such that the sum of distances is least. A
person is judged where nearly the whole body is inside the image and at least half of it in sight; an estimate of a person who
is hidden or cut by the border counts as neither right nor wrong.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from kpopnet.datasets.simulated import StoredSequence
from kpopnet.evaluation.intervals import Bootstrap
from kpopnet.evaluation.poses.metrics import joint_errors_m
from kpopnet.skeleton import NUM_JOINTS

REACH_M = 0.5
"""Greatest mean distance between the joints of a person and of the estimate that is taken for this person."""

LEAST_INSIDE = 0.8
"""Least share of the joints inside the image, of a person who is judged."""

LEAST_IN_SIGHT = 0.5
"""Least share of the person's pixels that no one else hides, of a person who is seen."""

NOBODY = -1
ALL = "all"
"""The row of all kinds of scenes."""

WITHIN_M = 0.10


@dataclass(frozen=True)
class MatchedSequence:
    """One sequence of T frames and P people with the estimates that were matched to them.

    Attributes:
        name: of the sequence.
        kind: of scene.
        seen: (T, P) bool, whether the person is judged.
        hidden: (T, P) bool, whether the person is inside the image and hidden by others.
        identity: (T, P) int, identity of the matched estimate, NOBODY where there is none.
        errors_m: (T, P, 15) distances of its joints from the true ones, infinite where missing.
        false: (T,) number of estimates that were matched to no person.
        estimates_m: (E, T, 15, 3) joints of all people found, metres, NaN where missing.
        identities: (E,) their identities.
        seconds: processor time of the estimation.
    """

    name: str
    kind: str
    seen: np.ndarray
    hidden: np.ndarray
    identity: np.ndarray
    errors_m: np.ndarray
    false: np.ndarray
    estimates_m: np.ndarray
    identities: np.ndarray
    seconds: float

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
    """(T, P) bool each: who is seen, and who is inside the image but hidden by others."""
    camera, (u, v, z) = sequence.camera, np.moveaxis(sequence.camera.project(sequence.joints_m), -1, 0)
    joint_inside = (z > 0) & (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)
    inside = (joint_inside.mean(axis=-1) >= LEAST_INSIDE) & (sequence.alone_px > 0)
    in_sight = sequence.seen_px >= LEAST_IN_SIGHT * sequence.alone_px
    return inside & in_sight, inside & ~in_sight


def match(sequence: StoredSequence, estimates_m: np.ndarray, identities: np.ndarray, seconds: float) -> MatchedSequence:
    """Matches estimates, as `MatchedSequence` has them, to the people of a sequence."""
    truth_m = sequence.joints_m
    seen, hidden = sight(sequence)
    identity, errors_m = np.full(seen.shape, NOBODY), np.full((*seen.shape, NUM_JOINTS), np.inf)
    false = np.zeros(len(seen), int)
    matched: dict[int, int] = {}
    for frame in range(len(seen)):
        found = np.isfinite(estimates_m[:, frame]).any(axis=(1, 2))
        matched = _match_frame(truth_m[frame], estimates_m[:, frame], found, matched)
        for person, one in matched.items():
            identity[frame, person] = identities[one]
            errors_m[frame, person] = joint_errors_m(truth_m[frame, person], estimates_m[one, frame])
        false[frame] = found.sum() - len(matched)
    return MatchedSequence(
        sequence.name, sequence.kind, seen, hidden, identity, errors_m, false, estimates_m, identities, seconds
    )


def _match_frame(truth_m: np.ndarray, estimates_m: np.ndarray, found: np.ndarray, before: dict[int, int]) -> dict[int, int]:
    """Number of the estimate of each person who has one in a frame; `before` is the result for the frame before.

    Joints are (P, 15, 3) true and (E, 15, 3) estimated ones; (E,) `found` says whether any of them is estimated.
    """
    cost = np.full((len(truth_m), len(estimates_m)), 1e3)
    distance_m = np.nanmean(np.linalg.norm(truth_m[:, None] - estimates_m[None, found], axis=-1), axis=-1)
    cost[:, found] = np.where(distance_m < REACH_M, distance_m, 1e3)
    for person, one in before.items():
        if cost[person, one] < REACH_M:
            cost[person, one] = -1e6  # kept whatever it costs the others
    pairs = zip(*linear_sum_assignment(cost), strict=True)
    return {int(person): int(one) for person, one in pairs if cost[person, one] < REACH_M}


def by_kind(parts: list[MatchedSequence], seed: int) -> dict[str, dict]:
    """`figures` of each kind of scene, and of ALL."""
    kinds = dict.fromkeys(part.kind for part in parts)
    groups = {kind: [part for part in parts if part.kind == kind] for kind in kinds} | {ALL: parts}
    return {kind: figures(group, seed) for kind, group in groups.items()}


def figures(parts: list[MatchedSequence], seed: int) -> dict:
    """The figures of some sequences, pooled over frames and people; None where undefined. `seed` is the bootstrap's.

    Returns:
        `seen`, `hidden`: people in frames that are judged, and that others hide; `within_10cm`, `mean_error_cm`: of the seen,
        where a missed person counts as fifteen joints beyond 10 cm and is left out of the mean; the same with `hidden_`;
        `missed`: share of the seen who were not found; `false`: estimates of no person; `switches`: of identities; `mota`:
        1 - (missed + false + switches) / seen (CLEAR MOT); `idf1` (Ristani et al. 2016, over the same
        matches); `interval`: 95 % intervals over sequences; `fps`: images a second of one core, all stages.
    """
    seen, hidden, identity = (
        np.concatenate([getattr(part, name).ravel() for part in parts]) for name in ("seen", "hidden", "identity")
    )
    errors_m = np.concatenate([part.errors_m.reshape(-1, NUM_JOINTS) for part in parts])
    finite, lost = np.isfinite(errors_m), seen & (identity == NOBODY)
    bootstrap = Bootstrap(np.repeat(np.arange(len(parts)), [part.seen.size for part in parts]), seed)

    def of_joints(people: np.ndarray) -> dict:
        judged = np.tile(people[:, None], NUM_JOINTS)
        found = judged & finite
        return {
            "within_10cm": (judged & (errors_m < WITHIN_M), judged),
            "mean_error_cm": (100 * np.where(found, errors_m, 0), found),
        }

    sums = of_joints(seen) | {"missed": (lost[:, None], seen[:, None])}
    all_sums = sums | {f"hidden_{name}": pair for name, pair in of_joints(hidden).items()}
    false, switches, identified = (
        sum(int(count) for count in counts)
        for counts in zip(*((part.false.sum(), part.switches().sum(), part.identified()) for part in parts), strict=True)
    )
    return {
        "sequences": len(parts),
        "seen": int(seen.sum()),
        "hidden": int(hidden.sum()),
        **{name: _ratio(above.sum(), below.sum()) for name, (above, below) in all_sums.items()},
        "false": false,
        "switches": switches,
        "mota": _ratio(seen.sum() - lost.sum() - false - switches, seen.sum()),
        "idf1": _ratio(2 * identified, 2 * seen.sum() - lost.sum() + false),
        "interval": {name: bootstrap.interval(bootstrap.ratios(*pair)) for name, pair in sums.items()},
        "fps": _ratio(sum(len(part.seen) for part in parts), max(sum(part.seconds for part in parts), 1e-9)),
    }


def _ratio(above: float, below: float) -> float | None:
    return float(above / below) if below else None
