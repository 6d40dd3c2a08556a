"""Who is who from image to image, by the found people's places alone: no background, so the camera may move."""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

STEP_M, STEP_PER_IMAGE_M, MOST_STEP_M = 0.45, 0.08, 1.5
"""Largest distance between where a person is expected and where they are found; it grows with every image in which they were
not found, up to MOST_STEP_M."""

MOMENTUM = 0.6
"""Share of the speed of before in that of now."""

FORGOTTEN = 10
"""After so many images without them, a person who is found anywhere may be the one who was missing longest."""

MOST_MISSING = 64
"""People who are remembered while they are out of view."""


UNKNOWN = -1


@dataclass
class _Track:
    identity: int
    centre_m: np.ndarray
    step_m: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    missed: int = 0

    def expected_m(self) -> np.ndarray:
        # Somebody hidden does not go on for ever: the expectation stops after some images.
        return self.centre_m + self.step_m * min(self.missed + 1, 5)

    def see(self, centre_m: np.ndarray, certain: bool) -> None:
        if self.missed:
            self.step_m = np.zeros(3, np.float32)
        elif certain:  # the centre of a nearly hidden person slides to what is left of them: that is no speed
            self.step_m = MOMENTUM * self.step_m + (1 - MOMENTUM) * (centre_m - self.centre_m)
        self.centre_m, self.missed = centre_m, 0


class Followed:
    """The people of a film: gives the same number to the same person in all images."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._count = 0

    def identify(self, centres_m: np.ndarray, certain: np.ndarray) -> list[int]:
        """The identities of the people whose (P, 3) centres were found in the next image, metres.

        A person who is expected near a place needs no other evidence; where no person is expected, only (P,) `certain` ones are
        people, the others get the identity UNKNOWN.
        """
        identities = [UNKNOWN] * len(centres_m)
        if self._tracks and len(centres_m):
            expected_m = np.array([track.expected_m() for track in self._tracks])
            distance_m = np.linalg.norm(expected_m[:, None] - centres_m[None], axis=-1)
            reach_m = np.minimum([STEP_M + STEP_PER_IMAGE_M * track.missed for track in self._tracks], MOST_STEP_M)
            # Beyond the reach all pairs cost the same: they are not pairs.
            cost = np.where(distance_m < reach_m[:, None], distance_m, 100.0)
            for row, column in zip(*linear_sum_assignment(cost), strict=True):
                if cost[row, column] < 100.0:
                    identities[column] = self._tracks[row].identity
        for column in range(len(centres_m)):
            if identities[column] == UNKNOWN and certain[column]:
                identities[column] = self._returned(identities)
        known = {track.identity: track for track in self._tracks}
        for track in self._tracks:
            if track.identity in identities:
                column = identities.index(track.identity)
                track.see(centres_m[column], bool(certain[column]))
            else:
                track.missed += 1
        self._tracks += [
            _Track(identity, centre_m)
            for identity, centre_m in zip(identities, centres_m, strict=True)
            if identity not in known and identity != UNKNOWN
        ]
        missing = sorted((track for track in self._tracks if track.missed), key=lambda track: track.missed)
        self._tracks = [track for track in self._tracks if not track.missed] + missing[:MOST_MISSING]
        return identities

    def _returned(self, present: list[int]) -> int:
        """The identity of a person who was found where nobody was expected: of the one missing longest, or a new one."""
        missing = [track for track in self._tracks if track.missed >= FORGOTTEN and track.identity not in present]
        if missing:
            return max(missing, key=lambda track: track.missed).identity
        self._count += 1
        return self._count - 1
