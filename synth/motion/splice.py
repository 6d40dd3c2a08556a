"""Motions brought to one rate, stood on the floor, and joined without a jump."""

import numpy as np

from synth.motion.skeleton import Motion, conjugate, forward_kinematics, height_above_floor, multiply, rotate

# A joint that has to turn to where the second motion has it does so about this fast at most, in radians per second.
_TURN_SPEED = 5.0
_SHORTEST_S = 0.25
_EASING_S = 0.4
_PEAK_OVER_MEAN = 1.875  # of the minimum-jerk curve


def resampled(motion: Motion, fps: float) -> Motion:
    """The motion at another frame rate."""
    if motion.fps == fps:
        return motion
    return at_times(motion, np.arange(int((len(motion) - 1) * fps / motion.fps + 1e-6) + 1) / fps, fps)


def eased(motion: Motion, *, at_start: bool = False, at_end: bool = False) -> Motion:
    """The motion begun from rest, or brought to rest: slowed down within its first or last _EASING_S seconds."""
    length_s = (len(motion) - 1) / motion.fps
    easing_s = min(_EASING_S, length_s / 2)
    frames = int((length_s + easing_s / 2 * (at_start + at_end)) * motion.fps + 1e-6)
    seconds = np.arange(frames + 1) / motion.fps
    if at_start:
        seconds = np.where(seconds < easing_s, seconds**2 / (2 * max(easing_s, 1e-9)), seconds - easing_s / 2)
    if at_end:
        # Still to go, of a way that ends at rest.
        behind_s = length_s + easing_s / 2 - seconds
        seconds = length_s - np.where(behind_s < easing_s, behind_s**2 / (2 * max(easing_s, 1e-9)), behind_s - easing_s / 2)
    return at_times(motion, np.clip(seconds, 0, length_s), motion.fps)


def at_times(motion: Motion, seconds: np.ndarray, fps: float) -> Motion:
    """The motion at given times (T,) within it, linearly between neighbouring frames."""
    at = seconds * motion.fps
    before = np.minimum(at.astype(int), len(motion) - 1)
    after = np.minimum(before + 1, len(motion) - 1)
    share = at - before
    a, b = motion.quats[before].astype(np.float64), motion.quats[after].astype(np.float64)
    b = np.where((a * b).sum(axis=-1, keepdims=True) < 0, -b, b)
    quats = a + share[:, None, None] * (b - a)
    quats /= np.linalg.norm(quats, axis=-1, keepdims=True)
    root_m = motion.root_m[before] + share[:, None] * (motion.root_m[after] - motion.root_m[before])
    return Motion(quats.astype(np.float32), root_m.astype(np.float32), fps, motion.name, motion.leg_m)


def follow(first: Motion, second: Motion) -> Motion:
    """The first motion, brought to rest, then the second from where the first ends, begun from rest.

    The second is turned and moved so that it begins where the first has led and facing the same way. What is still
    different, in every joint and in the height above the floor, is carried over and fades out along a minimum-jerk curve
    while the second motion already runs.
    """
    assert first.fps == second.fps, (first.fps, second.fps)
    first, second = eased(first, at_end=True), eased(second, at_start=True)
    root_m = second.root_m.astype(np.float64) * (first.leg_m / second.leg_m)
    quats = second.quats.astype(np.float64)
    turn = multiply(heading(first.quats[-1, 0]), conjugate(heading(quats[0, 0])))
    quats[:, 0] = multiply(turn, quats[:, 0])
    start_m = first.root_m[-1].astype(np.float64)
    hover_m = height_above_floor(quats, root_m)
    root_m[:, [0, 2]] = (rotate(turn, root_m - root_m[0]) + start_m)[:, [0, 2]]

    difference = multiply(first.quats[-1].astype(np.float64), conjugate(quats[0]))  # (23, 4)
    difference = np.where(difference[:, :1] < 0, -difference, difference)
    angle = 2 * np.arctan2(np.linalg.norm(difference[:, 1:], axis=1), difference[:, 0])  # (23,)
    axis = difference[:, 1:] / np.maximum(np.sin(angle / 2), 1e-9)[:, None]
    fading_s = max(_SHORTEST_S, _PEAK_OVER_MEAN * angle.max() / _TURN_SPEED)
    u = np.clip(np.arange(len(second)) / (second.fps * fading_s), 0, 1)
    left = 1 - u**3 * (10 - 15 * u + 6 * u**2)
    half = left[:, None] * angle / 2
    carried = np.concatenate([np.cos(half)[..., None], np.sin(half)[..., None] * axis], axis=-1)
    quats = multiply(carried, quats)

    first_hover_m = height_above_floor(first.quats[-1:], first.root_m[-1:])[0]
    hover_m = left * first_hover_m + (1 - left) * hover_m
    fading = left > 0
    root_m[fading, 1] = hover_m[fading] - height_above_floor(quats[fading], root_m[fading] * [1, 0, 1])
    return Motion(
        np.concatenate([first.quats, quats[1:].astype(np.float32)]),
        np.concatenate([first.root_m, root_m[1:].astype(np.float32)]),
        first.fps,
        f"{first.name}+{second.name}",
        first.leg_m,
    )


def cut(motion: Motion, start: int, stop: int) -> Motion:
    """Frames start..stop-1."""
    return Motion(motion.quats[start:stop], motion.root_m[start:stop], motion.fps, motion.name, motion.leg_m)


def heading(hips: np.ndarray) -> np.ndarray:
    """(4,) the turn about the vertical in a rotation (4,) of Hips; none where it lies upside down."""
    size = np.hypot(hips[0], hips[2])
    return np.array([hips[0], 0, hips[2], 0], np.float64) / size if size > 1e-3 else np.array([1.0, 0, 0, 0])


def planted(quats: np.ndarray, fps: float, name: str, leg_m: float) -> Motion:
    """A motion of rotations (T, 23, 4) alone, put on the floor: what touches it keeps its place.

    The lowest flesh is on the floor in every frame. Each point bears the more the lower it is; the hips move so that
    what bears does not slide.
    """
    nowhere_m = np.zeros((len(quats), 3))
    points_m, _ = forward_kinematics(quats, nowhere_m)
    height_m = -height_above_floor(quats, nowhere_m)
    bears = np.exp(-(points_m[..., 1] + height_m[:, None]) / _BEARING_M)
    bears = (bears[1:] * bears[:-1]) ** 0.5
    bears /= bears.sum(axis=1, keepdims=True)
    slide_m = (bears[..., None] * np.diff(points_m, axis=0)).sum(axis=1)
    root_m = np.zeros((len(quats), 3))
    root_m[1:] = -np.cumsum(slide_m, axis=0)
    root_m[:, 1] = height_m
    return Motion(quats.astype(np.float32), root_m.astype(np.float32), fps, name, leg_m)


_BEARING_M = 0.02  # a point so much higher bears less by a factor e
