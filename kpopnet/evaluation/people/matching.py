"""Which estimated person is which true one, frame by frame, and what follows from it.

The counts are those of CLEAR MOT (Bernardin & Stiefelhagen, "Evaluating Multiple Object Tracking Performance", EURASIP Journal
on Image and Video Processing 2008): people who are missed, people who are not there, and identity switches. A person keeps the
identity of the frame before as long as it is within REACH_M; the others are matched such that the sum of distances is least. A
person is judged where nearly the whole body is inside the image and at least half of it in sight; an estimate of a person who
is hidden or cut by the border counts as neither right nor wrong.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from kpopnet.camera import Camera
from kpopnet.datasets.simulated import StoredSequence
from kpopnet.evaluation.poses.metrics import joint_errors_m
from kpopnet.skeleton import NUM_JOINTS

REACH_M = 0.5
"""Greatest mean distance between the joints of a person and of the estimate that is taken for this person."""

LEAST_INSIDE = 0.8
"""Least share of the joints inside the image, of a person who is judged."""

LEAST_IN_SIGHT = 0.5
"""Least share of the person's pixels that no one else hides, of a person who is seen."""

NOBODY = -1


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
        if not len(identities):
            return 0
        counts = ((self.identity[..., None] == identities) & self.seen[..., None]).sum(axis=0)  # (P, identities)
        return int(counts[linear_sum_assignment(counts, maximize=True)].sum())


def sight(sequence: StoredSequence) -> tuple[np.ndarray, np.ndarray]:
    """(T, P) bool each: who is seen, and who is inside the image but hidden by others."""
    inside = _share_inside(sequence.joints_m, sequence.camera) >= LEAST_INSIDE
    inside &= sequence.alone_px > 0
    in_sight = sequence.seen_px >= LEAST_IN_SIGHT * sequence.alone_px
    return inside & in_sight, inside & ~in_sight


def _share_inside(joints_m: np.ndarray, camera: Camera) -> np.ndarray:
    """Share of (..., 15, 3) joints that are inside the image."""
    u, v, z = np.moveaxis(camera.project(joints_m), -1, 0)
    return ((z > 0) & (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)).mean(axis=-1)


def match(sequence: StoredSequence, estimates_m: np.ndarray, identities: np.ndarray, seconds: float) -> MatchedSequence:
    """Matches estimates, as `MatchedSequence` has them, to the people of a sequence."""
    truth_m = sequence.joints_m
    seen, hidden = sight(sequence)
    frames, people = seen.shape
    identity = np.full((frames, people), NOBODY)
    errors_m = np.full((frames, people, NUM_JOINTS), np.inf)
    false = np.zeros(frames, int)
    before: dict[int, int] = {}
    for frame in range(frames):
        found = np.flatnonzero(np.isfinite(estimates_m[:, frame]).any(axis=(1, 2)))
        before = _match_frame(truth_m[frame], estimates_m[found, frame], found, before)
        for person, one in before.items():
            identity[frame, person] = identities[one]
            errors_m[frame, person] = joint_errors_m(truth_m[frame, person], estimates_m[one, frame])
        false[frame] = len(found) - len(before)
    return MatchedSequence(
        sequence.name, sequence.kind, seen, hidden, identity, errors_m, false, estimates_m, identities, seconds
    )


def _match_frame(truth_m: np.ndarray, estimates_m: np.ndarray, found: np.ndarray, before: dict[int, int]) -> dict[int, int]:
    """Number of the estimate of each person who has one in a frame.

    Args:
        truth_m: (P, 15, 3) true joints.
        estimates_m: (F, 15, 3) joints of those found in the frame.
        found: (F,) their numbers.
        before: the result for the frame before.
    """
    distance_m = np.nanmean(np.linalg.norm(truth_m[:, None] - estimates_m[None], axis=-1), axis=-1)  # (P, F)
    kept = {}
    for person, one in before.items():
        if one in found and distance_m[person, column := int(np.flatnonzero(found == one)[0])] < REACH_M:
            kept[person] = one
            distance_m[person], distance_m[:, column] = np.inf, np.inf
    cost = np.where(distance_m < REACH_M, distance_m, 1e3)
    rows, columns = linear_sum_assignment(cost)
    new = {
        int(person): int(found[column]) for person, column in zip(rows, columns, strict=True) if cost[person, column] < REACH_M
    }
    return kept | new
