"""The formation of a group: where its members are relative to each other, whatever each of them dances.

At each moment the places of the hips on the floor count from the middle of the group. A room is smaller than a stage: the
learners' distances are multiplied by one factor for the whole dance, which makes them as large as the teachers' in the mean,
at most MOST_SPREAD or its inverse. Nothing is turned: both groups face their camera, as they would an audience, and two who
have changed places are wrong. Of two, both are wrong by half if one stands wrong. The figure is that of
`kpopnet.dance.dimensions.stage`: errors at its scale of place, above a group that stands as the teachers' does on average.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kpopnet.dance.dimensions.stage import CENTRED_M, DIMENSIONS, StageScore, Stance, figure, levelling, stance
from kpopnet.dance.performance import Performance, check_dance, resampled
from kpopnet.dance.scoring import Stretches, check_free
from kpopnet.dance.window import FPS, WINDOW_S
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.skeleton import Joint

MOST_SPREAD = 2.0
"""Greatest factor between the learners' distances and the teachers': a room of half a stage. Chosen, not measured."""


class Formation(NamedTuple):
    """How a group keeps its formation."""

    similarity: float  # 0 to 100; NaN, as is the spread, where the recordings hold no places
    spread: float  # distances between the learners, 1 for as far apart as the teachers
    remarks: list[tuple[int, float, Said]]  # member, from 0; seconds of the dance; "0.8 m too far left", on the teachers' stage
    centred: tuple[str, ...] = ()  # of teacher and learner, of whom a member's joints are about the hips: no place is known


def formation(teachers: Sequence[Performance], learners: Sequence[Performance], free_s: Stretches = ()) -> Formation | None:
    """Grades learners' places relative to each other; the first of them dances as the first teacher, and so on.

    Both in the frames of their cameras, on the clock of the dance, of which the stretches `free_s` are left out. None where all
    learners are not seen together for a window, or the size of no teacher is known. Raises InputError unless there are as many
    learners as teachers, in lists.
    """
    for name, dances in (("teachers", teachers), ("learners", learners)):
        if not isinstance(dances, list | tuple):
            raise InputError(f"{name}: expected a list of dances, got {dances!r:.80}")
    if not len(teachers) == len(learners) > 0:
        raise InputError(f"{len(teachers)} teachers and {len(learners)} learners: expected as many, one or more")
    both, free_s = [check_dance(one, "a dance of the group") for one in (*teachers, *learners)], check_free(free_s)
    at_s = np.arange(max(one.times_s[0] for one in both), min(one.times_s[-1] for one in both), 1 / FPS)
    if not len(at_s):
        return None
    joints_m = [resampled(one.joints_m, one.confidence, one.times_s, at_s)[0] for one in both]
    groups = {"teacher": slice(len(teachers)), "learner": slice(len(teachers), None)}
    # Levelled together: each by a rotation of their own, one who leans would move to another place.
    levels = {name: levelling(joints_m[group]) for name, group in groups.items()}
    stances = [stance(one, levels[name]) for name, group in groups.items() for one in joints_m[group]]
    if centred := tuple(name for name, group in groups.items() if _is_centred(joints_m[group], stances[group])):
        return Formation(math.nan, math.nan, [], centred)
    places_m = np.array([np.stack([one.hips_m[:, 0], -one.hips_m[:, 2]], axis=1) for one in stances])  # to the left, forward
    for begin_s, end_s in free_s:
        places_m[:, (at_s >= begin_s) & (at_s < end_s)] = np.nan
    known = np.isfinite(places_m).all(axis=(0, 2))
    lengths_m = [one.length_m for one in stances[: len(teachers)] if np.isfinite(one.length_m)]
    if known.sum() < WINDOW_S * FPS or not lengths_m:
        return None
    goal_m, danced_m = (one - one.mean(axis=0) for one in (places_m[: len(teachers)], places_m[len(teachers) :]))
    factor = np.sqrt((goal_m**2)[:, known].sum() / max((danced_m**2)[:, known].sum(), 1e-9))
    factor = float(np.clip(factor, 1 / MOST_SPREAD, MOST_SPREAD)) if len(teachers) > 1 else 1.0
    length_m = float(np.mean(lengths_m))
    place, errors = DIMENSIONS["place"], (factor * danced_m - goal_m) / length_m
    staying = np.nanmean(goal_m, axis=1, keepdims=True) - goal_m
    similarity = figure(place.similarity(errors.reshape(-1, 2)), place.similarity(staying.reshape(-1, 2) / length_m))
    remarks = [
        (member, float(at_s[0] + begin_s), text)
        for member, one in enumerate(errors)
        for begin_s, text in StageScore({}, {"place": one}, length_m).remarks()
    ]
    return Formation(similarity, 1 / factor, remarks)


def _is_centred(joints_m: Sequence[np.ndarray], stances: Sequence[Stance]) -> bool:
    """Whether the (T, 15, 3) joints of a member are about the hips, or those of two, whose hips then stay in one point.

    Of one that takes LEAST_CENTRED_FRAMES, since people keep their hips still for as long; no two have them in one place.
    """

    def stay_together(*pair: np.ndarray) -> bool:
        hips_m = np.stack([one[:, [Joint.LEFT_HIP, Joint.RIGHT_HIP]].mean(axis=1) for one in pair])
        known_m = hips_m[:, np.isfinite(hips_m).all(axis=(0, 2))]
        return known_m.size > 0 and bool(np.linalg.norm(known_m.std(axis=(0, 1))) < CENTRED_M)

    return any(one.is_centred for one in stances) or any(stay_together(*pair) for pair in itertools.combinations(joints_m, 2))
