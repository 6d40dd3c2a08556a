"""Joints over time: a small network that weighs what the frames before, and those after, say of each joint.

A frame's joints are those measured in it, plus weighted differences: to exponential averages of several time constants, to
the usual bone lengths, and to the fit. One network for all joints reads the lengths of these differences and gives weights and
a confidence. Positions are relative to the trunk's centre, in the camera's axes; the centre is filtered likewise. Any rate.

Both forms come with the package, for the modes of `kpopnet.pose`; tools/over_time.py trains and measures them.
"""

from copy import deepcopy
from typing import NamedTuple

import numpy as np

from kpopnet.estimator import FRAME_S
from kpopnet.networks.layers import Layers
from kpopnet.skeleton import BONE_CHILDREN, BONE_PARENTS, BONES, MIRROR, NUM_JOINTS, Joint

TRUNK = (Joint.NECK, Joint.TORSO, Joint.RIGHT_HIP, Joint.LEFT_HIP)

TIME_CONSTANTS_S = np.array([0.04, 0.12, 0.4, 1.2])
EXTRAPOLATED = 2
"""Number of averages, the shortest, that are also given extrapolated to the frame (Brown's double exponential average)."""

SURE_S, LENGTH_S = 0.3, 3.0
"""Time constants of the averages that are weighted by confidence: of positions and of bone lengths."""

FORGET_S, ANOTHER_AFTER_S = 0.5, 10.0
"""After a longer gap, seconds, a person starts again; after an absence of the second it may be another person, whose lengths
are measured anew."""

POINTS = NUM_JOINTS + 1
BASES = len(TIME_CONSTANTS_S) + EXTRAPOLATED + 3
OWNERS = np.arange(NUM_JOINTS)
OWNERS[BONE_CHILDREN] = BONE_PARENTS
"""The joint that each hangs on; the torso's is itself."""

KINDS = np.eye(POINTS)[:, np.unique(np.append(np.minimum(np.arange(NUM_JOINTS), MIRROR), NUM_JOINTS))]
KINDS[:NUM_JOINTS] = np.maximum(KINDS[:NUM_JOINTS], KINDS[MIRROR])
"""(16, 10) one-hot kinds of points: left and right are one kind."""

SLOWEST_M_S, SHORTEST_S, SHORTEST_M = 0.02, 0.01, 0.001
"""Least speed, time between frames and length of a bone that are divided by."""

FEATURES = 2 * BASES + 1 + 6 + 2 + KINDS.shape[1]


class Measured(NamedTuple):
    """What single frames say of people: arrays with the same leading axes."""

    detected_m: np.ndarray  # (..., 15, 3) the image network's joints, camera frame, metres
    fitted_m: np.ndarray  # (..., 15, 3) those after the fit to the depth
    detected: np.ndarray  # (..., 15) the network's confidence
    fitted: np.ndarray  # (..., 15) the fit's


class Averages:
    """Averages over the frames so far of a batch of people."""

    def __init__(self, shape: tuple[int, ...] = ()) -> None:
        self._single = np.zeros((*shape, len(TIME_CONSTANTS_S), POINTS, 3))
        self._double, self._last_m = self._single.copy(), np.zeros((*shape, POINTS, 3))
        self._sure, self._sure_weight = np.zeros((*shape, POINTS, 3)), np.zeros((*shape, POINTS, 1))
        self._length, self._length_weight = (np.zeros((*shape, len(BONES), 1)) for _ in range(2))
        self._fresh = np.ones(shape, bool)

    def add(self, measured: Measured, step_s: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Adds a frame `step_s` seconds after the one before, (...).

        (..., 16, 3) points: the joints relative to the trunk's centre, and that centre; (..., BASES, 16, 3) differences to
        them, metres; and (..., 16, FEATURES) float32 what the network reads.
        """
        step_s = np.broadcast_to(np.asarray(step_s, float), self._fresh.shape)
        fresh = (self._fresh | (step_s > FORGET_S))[..., None, None]
        self._fresh = np.zeros_like(self._fresh)
        joints_m = (measured.detected_m + measured.fitted_m) / 2.0
        centre_m = joints_m[..., TRUNK, :].mean(axis=-2, keepdims=True)
        points_m = np.concatenate([joints_m - centre_m, centre_m], axis=-2)
        differences_m = np.concatenate(
            [
                self._averaged(points_m, step_s, fresh),
                self._confident(points_m, measured.fitted, step_s, fresh)[..., None, :, :],
                self._along_bones(joints_m, measured.fitted, step_s)[..., None, :, :],
                _by_fit(measured, centre_m)[..., None, :, :],
            ],
            axis=-3,
        )
        moved_m = np.where(fresh, 0, points_m - self._last_m)
        self._last_m = points_m
        seen = _seen(
            differences_m, moved_m / np.maximum(step_s, SHORTEST_S)[..., None, None], measured, step_s, fresh[..., 0, 0]
        )
        return points_m, differences_m, seen.astype(np.float32)

    def _averaged(self, points_m: np.ndarray, step_s: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        here, start = points_m[..., None, :, :], fresh[..., None]
        gain = (1 - np.exp(-step_s[..., None] / TIME_CONSTANTS_S))[..., None, None]
        self._single, self._double = (np.where(start, here, old) for old in (self._single, self._double))
        self._single = self._single + gain * (here - self._single)
        self._double = self._double + gain * (self._single - self._double)
        # A ramp's single average lags behind it as the double one lags behind the single one.
        ahead = 2 * self._single[..., :EXTRAPOLATED, :, :] - self._double[..., :EXTRAPOLATED, :, :]
        return np.concatenate([self._single, ahead], axis=-3) - here

    def _confident(self, points_m: np.ndarray, chance: np.ndarray, step_s: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        weight = np.concatenate([chance, chance.mean(axis=-1, keepdims=True)], axis=-1)[..., None] ** 4 + 1e-3
        kept = np.where(fresh, 0, np.exp(-step_s / SURE_S)[..., None, None])
        self._sure, self._sure_weight = kept * self._sure + weight * points_m, kept * self._sure_weight + weight
        return self._sure / self._sure_weight - points_m

    def _along_bones(self, joints_m: np.ndarray, chance: np.ndarray, step_s: np.ndarray) -> np.ndarray:
        bones_m = joints_m[..., BONE_CHILDREN, :] - joints_m[..., BONE_PARENTS, :]
        lengths_m = np.maximum(np.linalg.norm(bones_m, axis=-1, keepdims=True), SHORTEST_M)
        weight = (chance[..., BONE_CHILDREN] * chance[..., BONE_PARENTS])[..., None] ** 4 + 1e-3
        kept = np.where(step_s > ANOTHER_AFTER_S, 0.0, np.exp(-np.minimum(step_s, FORGET_S) / LENGTH_S))[..., None, None]
        self._length = kept * self._length + weight * lengths_m
        self._length_weight = kept * self._length_weight + weight
        found = np.zeros((*joints_m.shape[:-2], POINTS, 3))
        found[..., BONE_CHILDREN, :] = bones_m * (self._length / self._length_weight / lengths_m - 1)
        return found


def _by_fit(measured: Measured, centre_m: np.ndarray) -> np.ndarray:
    """(..., 16, 3) differences of the fit to the mean of both estimates, metres."""
    half_m = (measured.fitted_m - measured.detected_m) / 2.0
    trunk_m = half_m[..., TRUNK, :].mean(axis=-2, keepdims=True)
    return np.concatenate([half_m - trunk_m, trunk_m], axis=-2)


def _seen(
    differences_m: np.ndarray, speed_m_s: np.ndarray, measured: Measured, step_s: np.ndarray, fresh: np.ndarray
) -> np.ndarray:
    """(..., 16, FEATURES) what the network reads of each point: nothing in it depends on the direction of the axes."""
    speed = np.linalg.norm(speed_m_s, axis=-1, keepdims=True)
    along_m = (differences_m * (speed_m_s / np.maximum(speed, SLOWEST_M_S))[..., None, :, :]).sum(axis=-1)
    chances = _logit(np.stack([measured.detected, measured.fitted], axis=-1))
    mean = np.broadcast_to(chances.mean(axis=-2, keepdims=True), chances.shape)
    chances = np.concatenate([chances, chances[..., OWNERS, :], mean], axis=-1)
    chances = np.concatenate([chances, chances.mean(axis=-2, keepdims=True)], axis=-2)
    both = np.stack([30 * np.minimum(step_s, FORGET_S) - 1, fresh], axis=-1)[..., None, :]
    parts = (
        np.log1p(50 * np.linalg.norm(differences_m, axis=-1)).swapaxes(-1, -2),
        np.clip(10 * along_m, -4, 4).swapaxes(-1, -2),
        np.log1p(2 * speed),
        chances,
        np.broadcast_to(both, (*speed.shape[:-1], 2)),
        np.broadcast_to(KINDS, (*speed.shape[:-1], KINDS.shape[1])),
    )
    return np.concatenate(parts, axis=-1)


def _logit(chance: np.ndarray) -> np.ndarray:
    chance = np.clip(chance, 0.01, 0.99)
    return np.log(chance / (1 - chance)) / 2


class OverTime(Layers):
    """The network, from its arrays by name."""

    OTHERWISE = "no network over time"

    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        super().__init__(arrays)
        self.future = self.inputs == 2 * FEATURES

    def __call__(self, points_m: np.ndarray, differences_m: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(..., 15, 3) joints in metres and (..., 15) confidence from the results of `Averages.add` or `read`."""
        out = self.through(seen)
        moved_m = points_m + (out[..., :-1].swapaxes(-1, -2)[..., None] * differences_m).sum(axis=-3)
        confidence = 1 / (1 + np.exp(-out[..., :-1, -1]))
        return (moved_m[..., :-1, :] + moved_m[..., -1:, :]).astype(np.float32), confidence.astype(np.float32)


class Live:
    """The causal form: one person's joints, frame after frame."""

    def __init__(self, network: OverTime) -> None:
        self._network, self._averages, self._before_s = network, Averages(), -np.inf

    def update(self, measured: Measured, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """(15, 3) float32 joints, metres, and (15,) float32 confidence in the next frame, taken at `time_s` seconds of any
        clock; after a time that is before the last one the person starts again.
        """
        step_s = time_s - self._before_s if time_s >= self._before_s else np.inf
        step_s = step_s or FRAME_S  # a clock that stands still
        self._before_s = time_s
        return self._network(*self._averages.add(measured, step_s))


def read(measured: Measured, times_s: np.ndarray, future: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The results of `Averages.add` for (T, ..., 15, 3) frames at (T, ...) times, from the past or from past and future.

    Before a time that is before the one before it, people start again.
    """
    (before_s, after_s), shape = _steps(times_s), times_s.shape[1:]
    if not future:
        return _one_way(measured, before_s, Averages(shape))
    return _both_ways(measured, before_s, after_s, Averages(shape), Averages(shape))


PART = 2000
"""Frames that `whole` reads at a time: those of two hours would take 7 GB."""


def whole(network: OverTime, measured: Measured, times_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`network(*read(measured, times_s, future=True))` of a recording, which may be long: in parts."""
    before_s, after_s = _steps(times_s)
    parts = [slice(start, start + PART) for start in range(0, len(times_s), PART)]
    later, after = Averages(times_s.shape[1:]), []  # the averages over what follows each part
    for part in reversed(parts):
        after.append(deepcopy(later))
        if part.start:
            for *frame, step_s in zip(*(one[part][::-1] for one in (*measured, after_s)), strict=True):
                later.add(Measured(*frame), step_s)
    earlier, found = Averages(times_s.shape[1:]), []
    for part in parts:
        one = Measured(*(array[part] for array in measured))
        found.append(network(*_both_ways(one, before_s[part], after_s[part], earlier, after.pop())))
    joints_m, confidence = zip(*found, strict=True)
    return np.concatenate(joints_m), np.concatenate(confidence)


def _steps(times_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Seconds from the frame before each of (T, ...) times, and to the one after it; infinite where there is none."""
    gap_s, steps_s = np.full_like(times_s[:1], np.inf, float), np.diff(times_s, axis=0)
    steps_s = np.where(steps_s < 0, gap_s, np.where(steps_s == 0, FRAME_S, steps_s))
    return np.concatenate([gap_s, steps_s]), np.concatenate([steps_s, gap_s])


def _both_ways(
    measured: Measured, before_s: np.ndarray, after_s: np.ndarray, earlier: Averages, later: Averages
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    points_m, differences_m, seen = _one_way(measured, before_s, earlier)
    _, later_m, seen_later = _one_way(Measured(*(one[::-1] for one in measured)), after_s[::-1], later)
    return points_m, np.concatenate([differences_m, later_m[::-1]], axis=-3), np.concatenate([seen, seen_later[::-1]], axis=-1)


def _one_way(measured: Measured, steps_s: np.ndarray, averages: Averages) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    found = [averages.add(Measured(*frame), step_s) for *frame, step_s in zip(*measured, steps_s, strict=True)]
    points_m, differences_m, seen = (np.stack(part) for part in zip(*found, strict=True))
    return points_m, differences_m, seen
