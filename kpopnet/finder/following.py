"""Who is who from image to image, by the found people's places alone: no background, so the camera may move."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from kpopnet.estimator import FRAME_S

STEP_M, STEP_M_PER_S, MOST_STEP_M = 0.37, 2.4, 1.5
"""Largest distance between where a person is expected and where they are found; it grows with the time since they were last
found, up to MOST_STEP_M."""

MOMENTUM = 0.6
"""Share of the speed of before in that of now, after FRAME_S; its power after other times."""

COASTING_S = 1 / 6
"""A person is expected to keep their speed for this time, seconds: a hidden person does not walk on for ever."""

FORGOTTEN_S, FASTEST_M_PER_S = 0.35, 6.0
"""A person who was missing for longer, seconds, may be found again wherever this speed takes them, the camera's own included;
of several the one missing longest comes first."""

GONE_S = 60.0
"""A person who was missing for longer, seconds, comes after all others; of several the one missing shortest comes first."""

DOUBTED_S = 2.0
"""For this time after a person was last certain, in seconds, little certainty is enough to follow them: what is taken for a
person, such as a chair, is not followed for ever."""

MOST_MISSING = 64
"""People who are remembered while they are out of view."""

UNKNOWN = -1


@dataclass
class _Track:
    identity: int
    centre_m: np.ndarray
    seen_s: float
    certain_s: float
    speed_m_per_s: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    hidden: bool = False

    def expected_m(self, time_s: float) -> np.ndarray:
        return self.centre_m + self.speed_m_per_s * min(time_s - self.seen_s, COASTING_S)

    def reach_m(self, time_s: float) -> float:
        return min(STEP_M + STEP_M_PER_S * (time_s - self.seen_s), MOST_STEP_M)

    def see(self, centre_m: np.ndarray, certain: bool, time_s: float) -> None:
        elapsed_s = time_s - self.seen_s
        if self.hidden:
            self.speed_m_per_s = np.zeros(3, np.float32)
        elif certain and elapsed_s > 0:  # the centre of a nearly hidden person slides to what is left of them: that is no speed
            kept = MOMENTUM ** (elapsed_s / FRAME_S)
            self.speed_m_per_s = kept * self.speed_m_per_s + (1 - kept) * (centre_m - self.centre_m) / elapsed_s
        self.centre_m, self.seen_s, self.hidden = centre_m, time_s, False
        self.certain_s = time_s if certain else self.certain_s


class Followed:
    """The people of a film: gives the same number to the same person in all images."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._count, self._time_s = 0, -math.inf

    def identify(self, centres_m: np.ndarray, certain: np.ndarray, time_s: float) -> list[int]:
        """The identities of the people whose (P, 3) centres were found in the next image, metres, taken at `time_s` seconds.

        Where a person is expected who was certain less than DOUBTED_S ago, no other evidence is needed; anywhere else only (P,)
        `certain` ones are people, the others get the identity UNKNOWN. A clock that was put back counts as standing still.
        """
        if time_s < self._time_s:
            for track in self._tracks:
                track.seen_s += time_s - self._time_s
                track.certain_s += time_s - self._time_s
        self._time_s = time_s
        trusted = [track for track in self._tracks if time_s - track.certain_s < DOUBTED_S]
        doubted = [track for track in self._tracks if time_s - track.certain_s >= DOUBTED_S]
        # Certain ones choose first: no person is given to an uncertain one so that a hidden person gets what is theirs.
        found = _paired(trusted, centres_m, np.flatnonzero(certain).tolist(), time_s)
        left = [track for track in trusted if all(track is not one for one in found.values())]
        found |= _paired(left, centres_m, np.flatnonzero(~certain).tolist(), time_s)
        certain_left = [column for column in np.flatnonzero(certain).tolist() if column not in found]
        found |= _paired(doubted, centres_m, certain_left, time_s)
        for column in certain_left:
            if column not in found:
                found[column] = self._returned(centres_m[column], time_s, found)
        for column, track in found.items():
            track.see(centres_m[column], bool(certain[column]), time_s)
        for track in self._tracks:
            track.hidden = track.seen_s < time_s
        self._tracks = sorted(self._tracks, key=lambda track: -track.seen_s)[: len(found) + MOST_MISSING]
        return [found[column].identity if column in found else UNKNOWN for column in range(len(centres_m))]

    def _returned(self, centre_m: np.ndarray, time_s: float, found: dict[int, _Track]) -> _Track:
        """Who was found where no person was expected: of the missing by FORGOTTEN_S and GONE_S, or a new one."""
        present = {track.identity for track in found.values()}
        missing = [
            one
            for one in self._tracks
            if time_s - one.seen_s > FORGOTTEN_S
            and one.identity not in present
            and math.dist(one.centre_m, centre_m) < STEP_M + FASTEST_M_PER_S * (time_s - one.seen_s)
        ]
        if missing:
            lately = [track for track in missing if time_s - track.seen_s < GONE_S]
            return min(lately, key=lambda track: track.seen_s) if lately else max(missing, key=lambda track: track.seen_s)
        self._tracks.append(_Track(self._count, centre_m, time_s, time_s))
        self._count += 1
        return self._tracks[-1]


def _paired(tracks: list[_Track], centres_m: np.ndarray, columns: Sequence[int], time_s: float) -> dict[int, _Track]:
    """Who was found where they are expected, by the number, one of `columns`, of their (3,) centre."""
    if not tracks or not columns:
        return {}
    expected_m = np.array([track.expected_m(time_s) for track in tracks])
    distance_m = np.linalg.norm(expected_m[:, None] - centres_m[None, list(columns)], axis=-1)
    # Beyond the reach all pairs cost the same: they are not pairs.
    cost = np.where(distance_m < np.array([[track.reach_m(time_s)] for track in tracks]), distance_m, 100.0)
    return {columns[one]: tracks[row] for row, one in zip(*linear_sum_assignment(cost), strict=True) if cost[row, one] < 100.0}
