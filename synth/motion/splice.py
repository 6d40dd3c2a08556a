"""Resamples motions, joins them smoothly, and adds root translations with foot contacts to rotations."""

import numpy as np

from kpopnet.rotations import about, conjugate, multiply, normalised, rotate, towards
from synth.motion.skeleton import Motion, forward_kinematics, height_above_floor

_BLEND_SPEED_RAD_S = 5.0
"""Peak angular speed at which a transition turns a joint from the first motion's pose to the second's."""

_MIN_BLEND_S = 0.25
_EASING_S = 0.4
_PEAK_OVER_MEAN = 1.875  # ratio of peak to mean speed of the minimum-jerk curve
_CONTACT_DECAY_M = 0.02  # height over which the contact weight of a point falls by a factor e


def resampled(motion: Motion, fps: float) -> Motion:
    if motion.fps == fps:
        return motion
    return at_times(motion, np.arange(int((len(motion) - 1) * fps / motion.fps + 1e-6) + 1) / fps, fps)


def eased(motion: Motion, *, at_start: bool = False, at_end: bool = False) -> Motion:
    """Makes a motion start or end at rest by slowing down its first or last _EASING_S seconds."""
    length_s = (len(motion) - 1) / motion.fps
    easing_s = min(_EASING_S, length_s / 2)
    frames = int((length_s + easing_s / 2 * (at_start + at_end)) * motion.fps + 1e-6)
    seconds = np.arange(frames + 1) / motion.fps
    if at_start:
        seconds = np.where(seconds < easing_s, seconds**2 / (2 * max(easing_s, 1e-9)), seconds - easing_s / 2)
    if at_end:
        remaining_s = length_s + easing_s / 2 - seconds
        slowed_s = remaining_s**2 / (2 * max(easing_s, 1e-9))
        seconds = length_s - np.where(remaining_s < easing_s, slowed_s, remaining_s - easing_s / 2)
    return at_times(motion, np.clip(seconds, 0, length_s), motion.fps)


def at_times(motion: Motion, seconds: np.ndarray, fps: float) -> Motion:
    """Samples a motion at times (T,) in seconds by linear interpolation between frames; `fps` is the result's rate."""
    position = seconds * motion.fps
    before = np.minimum(position.astype(int), len(motion) - 1)
    after = np.minimum(before + 1, len(motion) - 1)
    fraction = position - before
    a, b = motion.quats[before].astype(np.float64), motion.quats[after].astype(np.float64)
    quats = normalised(towards(a, b, fraction[:, None, None]))
    root_m = motion.root_m[before] + fraction[:, None] * (motion.root_m[after] - motion.root_m[before])
    return Motion(quats.astype(np.float32), root_m.astype(np.float32), fps, motion.name, motion.leg_m)


def follow(first: Motion, second: Motion) -> Motion:
    """Joins two motions: the first ends at rest, the second starts at rest where the first ends.

    The second motion, of the same frame rate, is scaled to the first's leg length, and rotated and translated so that it
    starts at the first's last position and heading. The remaining difference, in every joint rotation and in the height
    above the floor, is added to the start of the second motion and decays along a minimum-jerk curve.
    """
    assert first.fps == second.fps, (first.fps, second.fps)
    first, second = eased(first, at_end=True), eased(second, at_start=True)
    root_m = second.root_m.astype(np.float64) * (first.leg_m / second.leg_m)
    quats = second.quats.astype(np.float64)
    rotation = multiply(heading(first.quats[-1, 0]), conjugate(heading(quats[0, 0])))
    quats[:, 0] = multiply(rotation, quats[:, 0])
    start_m = first.root_m[-1].astype(np.float64)
    height_m = height_above_floor(quats, root_m, first.leg_m)
    root_m[:, [0, 2]] = (rotate(rotation, root_m - root_m[0]) + start_m)[:, [0, 2]]

    difference = multiply(first.quats[-1].astype(np.float64), conjugate(quats[0]))  # (23, 4)
    difference = np.where(difference[:, :1] < 0, -difference, difference)
    angle = 2 * np.arctan2(np.linalg.norm(difference[:, 1:], axis=1), difference[:, 0])  # (23,)
    axis = difference[:, 1:] / np.maximum(np.sin(angle / 2), 1e-9)[:, None]
    blend_s = max(_MIN_BLEND_S, _PEAK_OVER_MEAN * angle.max() / _BLEND_SPEED_RAD_S)
    u = np.clip(np.arange(len(second)) / (second.fps * blend_s), 0, 1)
    weight = 1 - u**3 * (10 - 15 * u + 6 * u**2)  # of the first motion's last pose
    half = weight[:, None] * angle / 2
    correction = np.concatenate([np.cos(half)[..., None], np.sin(half)[..., None] * axis], axis=-1)
    quats = multiply(correction, quats)

    first_height_m = height_above_floor(first.quats[-1:], first.root_m[-1:], first.leg_m)[0]
    height_m = weight * first_height_m + (1 - weight) * height_m
    blending = weight > 0
    root_m[blending, 1] = height_m[blending] - height_above_floor(quats[blending], root_m[blending] * [1, 0, 1], first.leg_m)
    return Motion(
        np.concatenate([first.quats, quats[1:].astype(np.float32)]),
        np.concatenate([first.root_m, root_m[1:].astype(np.float32)]),
        first.fps,
        f"{first.name}+{second.name}",
        first.leg_m,
    )


def cut(motion: Motion, start: int, stop: int) -> Motion:
    """Frames start..stop-1 of a motion."""
    return Motion(motion.quats[start:stop], motion.root_m[start:stop], motion.fps, motion.name, motion.leg_m)


def heading(hips: np.ndarray) -> np.ndarray:
    """(4,) rotation about the vertical of a rotation (4,) of Hips; the identity where an upside-down pose has none."""
    size = np.hypot(hips[0], hips[2])
    return np.array([hips[0], 0, hips[2], 0], np.float64) / size if size > 1e-3 else np.array([1.0, 0, 0, 0])


def turned_to_front(motion: Motion) -> Motion:
    """The motion turned about the vertical so that Hips face the front in the mean of their headings."""
    headings = np.array([heading(hips) for hips in motion.quats[:, 0]])
    mean_rad = np.angle(np.exp(2j * np.arctan2(headings[:, 2], headings[:, 0])).mean())
    back = about(1, np.array([-mean_rad]))
    quats = motion.quats.astype(np.float64)
    quats[:, 0] = multiply(back, quats[:, 0])
    root_m = rotate(back, motion.root_m.astype(np.float64))
    return Motion(quats.astype(np.float32), root_m.astype(np.float32), motion.fps, motion.name, motion.leg_m)


def planted(quats: np.ndarray, fps: float, name: str, leg_m: float) -> Motion:
    """The motion of rotations (T, 23, 4) whose contacts with the floor do not slide.

    The lowest surface point is on the floor in every frame. Each point has a contact weight that decays exponentially with
    its height. The hips move so that the weighted mean horizontal displacement of the points is zero.
    """
    origin_m = np.zeros((len(quats), 3))
    points_m, _ = forward_kinematics(quats, origin_m)
    height_m = -height_above_floor(quats, origin_m)
    contact = np.exp(-(points_m[..., 1] + height_m[:, None]) / _CONTACT_DECAY_M)
    contact = (contact[1:] * contact[:-1]) ** 0.5
    contact /= contact.sum(axis=1, keepdims=True)
    slide_m = (contact[..., None] * np.diff(points_m, axis=0)).sum(axis=1)
    root_m = np.zeros((len(quats), 3))
    root_m[1:] = -np.cumsum(slide_m, axis=0)
    root_m[:, 1] = height_m
    return Motion(quats.astype(np.float32), root_m.astype(np.float32), fps, name, leg_m)


def as_high_as(like: Motion, quats: np.ndarray, root_m: np.ndarray) -> np.ndarray:
    """(T, 3) path, metres, on which the (T, 23, 4) pose is as high above the floor as another motion of its skeleton's size."""
    path_m = root_m.astype(np.float64)
    height_m = np.maximum(height_above_floor(like.quats, like.root_m, like.leg_m), 0)
    path_m[:, 1] = height_m - height_above_floor(quats, path_m * [1, 0, 1], like.leg_m)
    return path_m
