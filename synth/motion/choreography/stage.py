"""Converts a move, keys on a beat grid, to a `Motion` with feet on the floor.

Every channel interpolates its keys by a monotone cubic (PCHIP). The curve is continuously differentiable, has zero slope
at extrema and holds, and does not overshoot its keys, so a motion stays within the limits if its keys do. The feet are
placed in the world, and the legs follow by two-bone inverse kinematics. A foot with a constant position does not slide; a
foot with a new position takes a step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Integral

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from kpopnet.errors import InputError, check_between, check_one_of, check_type
from kpopnet.rotations import about, conjugate, multiply, rotate
from synth.motion.choreography.moves import RELAXED_LOWER, RELAXED_UPPER, Key, Move
from synth.motion.posture import CHANNELS, LEG_COLUMNS, STANDING, rotations, yaw_pitch_roll
from synth.motion.skeleton import CLEARANCE_M, INDEX, LEG_M, REST_OFFSETS_M, Motion, height_above_floor

THIGH_M = -REST_OFFSETS_M[INDEX["LeftLeg"], 1]
SHIN_M = -REST_OFFSETS_M[INDEX["LeftFoot"], 1]
ANKLE_M = CLEARANCE_M[INDEX["LeftFoot"]]
_HIP_JOINTS_M = REST_OFFSETS_M[[INDEX["LeftUpLeg"], INDEX["RightUpLeg"]]]
_TOE_M = REST_OFFSETS_M[INDEX["LeftToeBase"], 2]

_REACH = 0.997
"""Largest distance from hip to ankle as a fraction of the leg's length, so that the knees are never locked."""

STANDING_HIPS_M = ANKLE_M + 0.993 * LEG_M - _HIP_JOINTS_M[0, 1]
_MIN_STEP_M = 0.01  # a foot takes a step if its position changes by more than this

# The lift of a stepping foot grows linearly with the length of the step, up to a maximum.
_LIFT_BASE_M, _LIFT_PER_M, _MAX_LIFT_M = 0.025, 0.14, 0.11

# Largest peak speed of a channel, degrees per second, else 400. A key that needs a higher speed is only partly reached.
_SPEED_LIMITS_DEG_S = {
    "raise": 480, "plane": 560, "twist": 480, "elbow": 620, "wrist": 500, "head": 300, "waist": 190, "chest": 260,
}  # fmt: skip
_LAGS = {"elbow": 1.5, "wrist": 2.0, "raise": 0.5, "plane": 0.5, "twist": 0.8, "pronate": 1.5, "head": 0.7}
"""Delays of the channels behind the trunk, in units of `Style.lag_s`."""

_PEAK_OVER_MEAN = 1.5  # ratio of peak to mean speed between two keys


@dataclass(frozen=True)
class Style:
    sharpness: float = 1.0  # divides the time in which a hit reaches its key; above 1 is a harder hit
    bounce_m: float = 0.02  # depth of the bounce of the hips on every beat, metres
    # delay of the forearm relative to the upper arm, seconds; the upper arm's delay relative to the trunk is half of it
    lag_s: float = 0.04
    unsteadiness_deg: float = 1.0  # amplitude of the slow sway of every upper channel, degrees
    phases: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, 0.9)  # phases, in 0..1, of the five sine waves of the sway


def check_move(move: Move) -> None:
    """Raises InputError for a move that cannot be performed, with the place of what is wrong in it."""
    for track, channels in (("lower", RELAXED_LOWER), ("upper", RELAXED_UPPER)):
        for number, key in enumerate(getattr(move, track)):
            where = f"key {number} of the {track} body"
            check_between(f"{where}: beats", key.beats, 1e-3, 1e4)
            check_one_of(f"{where}: anchor", str(key.anchor), ("left", "right", "None"))
            for channel, value in key.shape.items():
                check_one_of(f"{where}: channel", channel, channels)
                check_between(f"{where}: {channel}", value, -1e4, 1e4)


def perform(move: Move, bpm: float, frames: int, fps: float, name: str, style: Style = Style()) -> Motion:
    """The motion of a mean adult who starts standing at the origin, facing +Z, and performs a move at `bpm` beats per minute.

    The last shape is held if the move ends before the last frame. The postures are within the limits of `posture`, and no point
    is below the floor. Raises InputError for a move with a channel that is none, a key without length or another tempo.
    """
    check_type("move", move, Move)
    check_move(move)
    check_between("bpm", bpm, 1, 1000)
    check_between("frames", frames, 1, 10_000_000)
    if not isinstance(frames, Integral):
        raise InputError(f"frames={frames}: expected a whole number")
    check_between("fps", fps, 1, 1000)
    seconds = np.arange(frames) / fps
    postures = np.tile(STANDING, (frames, 1))
    for channel, values in _upper_angles(move.upper, bpm, seconds, style).items():
        postures[:, CHANNELS[channel]] = values

    track, heading, origin_m, feet_m, feet_yaw = _foot_plan(move.lower, 60.0 / bpm, style.sharpness, seconds)
    upright = np.clip(1.0 - track["drop"] / 0.3, 0.0, 1.0)
    beat = seconds * bpm / 60.0
    drop_m = track["drop"] + style.bounce_m * upright * (0.5 - 0.5 * np.cos(2 * np.pi * beat))

    for channel in ("hips_yaw", "hips_pitch", "hips_roll"):
        postures[:, CHANNELS[channel]] = track[channel]
    hips_in_frame = yaw_pitch_roll(*(np.deg2rad(track[f"hips_{a}"]) for a in ("yaw", "pitch", "roll")))
    hips = multiply(about(1, heading), hips_in_frame)
    root_m = _hips_position(origin_m, heading, track, drop_m, hips, feet_m)

    for side in (0, 1):
        postures[:, LEG_COLUMNS[side]] = _leg(side, hips, root_m, feet_m[side], feet_yaw[side], track)
    quats = rotations(postures)
    quats[:, 0] = multiply(about(1, heading), quats[:, 0])

    # Where hands, knees or seat would be below the floor, the whole body is lifted; the lift is smoothed over time.
    root_m[:, 1] += track["air"]
    lift = np.maximum(-height_above_floor(quats, root_m), 0.0)
    lift = gaussian_filter1d(maximum_filter1d(lift, 2 * round(0.12 * fps) + 1), 0.04 * fps, truncate=3.0)
    root_m[:, 1] += lift
    return Motion(quats, root_m.astype(np.float32), float(fps), name, LEG_M)


def _key_times(track: Sequence[Key], beat_s: float, sharpness: float) -> tuple[np.ndarray, list[int]]:
    """Times (seconds) and key numbers of the knots. Key -1 is the start; a key that is hit early has two knots."""
    times, shown, now = [0.0], [-1], 0.0
    for i, key in enumerate(track):
        length = key.beats * beat_s
        if key.sharp < 1.0:
            times.append(now + min(max(key.sharp / sharpness, 0.25), 0.95) * length)
            shown.append(i)
        now += length
        times.append(now)
        shown.append(i)
    return np.array(times), shown


def monotone(times: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The monotone cubic through (K, ...) values at (K,) times."""
    from scipy.interpolate import PchipInterpolator  # slow to import, and needed where motion is composed alone

    return PchipInterpolator(times, values)


def _upper_angles(track: Sequence[Key], bpm: float, seconds: np.ndarray, style: Style) -> dict[str, np.ndarray]:
    """Angles (T,) in degrees of every channel of trunk, head and arms at the given times."""
    times, shown = _key_times(track, 60.0 / bpm, style.sharpness)
    values = np.empty((len(times), len(RELAXED_UPPER)))
    values[0] = list(RELAXED_UPPER.values())
    speeds = np.array([next((v for part, v in _SPEED_LIMITS_DEG_S.items() if part in c), 400) for c in RELAXED_UPPER])
    for k in range(1, len(times)):
        shape = RELAXED_UPPER | dict(track[shown[k]].shape)
        max_step = speeds * (times[k] - times[k - 1]) / _PEAK_OVER_MEAN
        values[k] = values[k - 1] + np.clip(np.array(list(shape.values())) - values[k - 1], -max_step, max_step)
    curve = monotone(times, values)
    waves = np.outer(seconds, (0.23, 0.31, 0.41, 0.53, 0.61)) + np.array(style.phases)
    sway = style.unsteadiness_deg * np.sin(2 * np.pi * waves)
    out = {}
    for i, channel in enumerate(RELAXED_UPPER):
        lag = next((v for part, v in _LAGS.items() if part in channel), 0.0) * style.lag_s
        at = np.clip(seconds - lag, 0.0, times[-1])
        out[channel] = monotone(times, values[:, i])(at) if lag else curve(at)[:, i]
        out[channel] = out[channel] + sway[:, i % sway.shape[1]]
    return out


_SIDES = (("left", 1.0), ("right", -1.0))


def _rotated(points: np.ndarray, heading: float) -> np.ndarray:
    """Rotates points (..., 2), x and z, to the left by `heading` radians."""
    x, z, c, s = points[..., 0], points[..., 1], np.cos(heading), np.sin(heading)
    return np.stack([x * c + z * s, z * c - x * s], axis=-1)


def _placed(track: Sequence[Key], shown: list[int], shapes: list[dict[str, float]]) -> tuple[np.ndarray, ...]:
    """Of the dancer's frame at the knots, its heading (K,) in radians and its place (K, 2), x and z in metres; and of the feet
    their places (K, 2, 2) in metres and their yaw (K, 2) in radians.
    """
    heading, origin, feet, yaw = 0.0, np.zeros(2), [], []
    headings, origins = [], []
    for k, shape in enumerate(shapes):
        local = np.array([[s * shape[f"{side}_foot_x"], shape[f"{side}_foot_z"]] for side, s in _SIDES])
        if k and shown[k] != shown[k - 1]:
            key = track[shown[k]]
            heading += np.deg2rad(key.turn)
            if key.anchor is not None:
                side = ("left", "right").index(key.anchor)
                origin = feet[-1][side] - _rotated(local[side], heading)
        headings.append(heading)
        origins.append(origin)
        feet.append(origin + _rotated(local, heading))
        yaw.append([heading + s * np.deg2rad(shape[f"{side}_foot_yaw"]) for side, s in _SIDES])
    return np.array(headings), np.array(origins), np.array(feet), np.array(yaw)


def _foot_plan(
    track: Sequence[Key], beat_s: float, sharpness: float, seconds: np.ndarray
) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The lower track in the world at times (T,): its channels by name; heading (T,) in radians and place (T, 2), x and z in
    metres, of the dancer's frame; ankles (2, T, 3) in metres and their yaw (2, T) in radians.
    """
    times, shown = _key_times(track, beat_s, sharpness)
    shapes = [RELAXED_LOWER | (dict(track[i].shape) if i >= 0 else {}) for i in shown]
    keys = np.array([list(shape.values()) for shape in shapes])
    headings, origins, feet, yaw = _placed(track, shown, shapes)
    seconds = np.minimum(seconds, times[-1])
    n = len(RELAXED_LOWER)
    smooth = monotone(times, np.column_stack([keys, headings, origins, yaw]))(seconds)
    channels = dict(zip(RELAXED_LOWER, smooth.T, strict=False))
    k = np.clip(np.searchsorted(times, seconds, side="right") - 1, 0, len(times) - 2)
    u = (seconds - times[k]) / (times[k + 1] - times[k])

    distance = np.linalg.norm(np.diff(feet, axis=0), axis=-1)  # (K-1, 2)
    steps = distance > _MIN_STEP_M
    # Feet that the keys lift off the floor in an interval need no further lift for a step.
    key = dict(zip(RELAXED_LOWER, keys.T, strict=True))
    up = np.stack([np.maximum(key["air"], key[f"{side}_foot_y"]) > 0.03 for side, _ in _SIDES], axis=1)
    free = up[1:] | up[:-1]
    starts, ends = np.zeros_like(distance), np.ones_like(distance)
    # If both feet step between two keys, each has half of the time; the foot on the side of the motion steps first.
    shared = steps.all(axis=1) & ~free.any(axis=1)
    heading = smooth[np.searchsorted(seconds, times[:-1]).clip(max=len(seconds) - 1), n]
    across = np.diff(feet.mean(axis=1), axis=0)
    leftwards = across[:, 0] * np.cos(heading) - across[:, 1] * np.sin(heading)
    first = np.where(leftwards >= -1e-9, 0, 1)
    rows = np.flatnonzero(shared)
    ends[rows, first[rows]] = 0.5
    starts[rows, 1 - first[rows]] = 0.5

    ankles = np.empty((2, len(seconds), 3))
    for side, (name, _) in enumerate(_SIDES):
        w = np.clip((u - starts[k, side]) / (ends[k, side] - starts[k, side]), 0.0, 1.0)
        step = (feet[k + 1, side] - feet[k, side]) * (w * w * (3 - 2 * w))[:, None]
        height = np.where(steps & ~free, np.minimum(_LIFT_BASE_M + _LIFT_PER_M * distance, _MAX_LIFT_M), 0.0)
        lift = height[k, side] * np.sin(np.pi * w) ** 2
        # The ankle of a foot on its toes is higher.
        toes = _TOE_M * np.sin(np.deg2rad(np.maximum(channels[f"{name}_foot_pitch"], 0.0)))
        ankles[side, :, 0], ankles[side, :, 2] = (feet[k, side] + step).T
        ankles[side, :, 1] = ANKLE_M + lift + toes + channels[f"{name}_foot_y"]
        channels[f"{name}_foot_pitch"] = channels[f"{name}_foot_pitch"] + 200 * lift
    return channels, smooth[:, n], smooth[:, n + 1 : n + 3], ankles, smooth[:, n + 3 :].T


def _hips_position(origin_m, heading, track, drop_m, hips, feet_m) -> np.ndarray:
    """(T, 3) position of Hips: above the feet, shifted to the supporting foot, and low enough for both legs to reach."""
    root = np.empty((len(heading), 3))
    c, s = np.cos(heading), np.sin(heading)
    root[:, 0] = origin_m[:, 0] + track["hips_x"] * c + track["hips_z"] * s
    root[:, 2] = origin_m[:, 1] + track["hips_z"] * c - track["hips_x"] * s

    raised = np.clip((feet_m[:, :, 1] - ANKLE_M) / 0.10, 0.0, 1.0)
    support = raised[1] - raised[0]  # 1: only the left foot supports the body, -1: only the right foot
    right_to_left = feet_m[0][:, [0, 2]] - feet_m[1][:, [0, 2]]
    length = np.maximum(np.linalg.norm(right_to_left, axis=1, keepdims=True), 0.2)
    root[:, [0, 2]] += 0.05 * support[:, None] * right_to_left / length

    heights = [STANDING_HIPS_M - drop_m]
    for side in (0, 1):
        hip = rotate(hips, _HIP_JOINTS_M[side])
        distance2 = np.square(root[:, [0, 2]] + hip[:, [0, 2]] - feet_m[side][:, [0, 2]]).sum(axis=1)
        reach = np.sqrt(np.maximum((_REACH * LEG_M) ** 2 - distance2, 0.01))
        # A raised foot constrains the hips less: the inverse kinematics clips its position to the leg's reach.
        slack = 3.0 * np.maximum(feet_m[side][:, 1] - ANKLE_M - 0.12, 0.0)
        heights.append(feet_m[side][:, 1] + reach - hip[:, 1] + slack)
    lowest, softness_m = np.min(heights, axis=0), 0.006
    root[:, 1] = lowest - softness_m * np.log(np.exp((lowest - np.array(heights)) / softness_m).sum(axis=0))
    return root


def _leg(side, hips, root_m, ankle_m, yaw, track) -> np.ndarray:
    """Two-bone inverse kinematics: angles (T, 7) in degrees of the leg whose ankle is at `ankle_m`, with the foot's yaw."""
    name, sign = _SIDES[side]
    mirror = np.array([sign, 1.0, 1.0])
    to_hips = conjugate(hips)

    # In the frame of the hips, mirrored for the right leg, so that the following computes a left leg.
    hip = root_m + rotate(hips, _HIP_JOINTS_M[side])
    to_ankle = rotate(to_hips, ankle_m - hip) * mirror
    distance = np.linalg.norm(to_ankle, axis=1, keepdims=True)
    along = to_ankle / distance
    distance = np.clip(distance, abs(THIGH_M - SHIN_M) + 0.12, _REACH * LEG_M)

    # The knee lies in front of the line from hip to ankle, rotated outwards with the foot.
    front = rotate(hips, np.array([0.0, 0.0, 1.0]))
    hips_yaw = np.arctan2(front[:, 0], front[:, 2])
    upright = np.clip(2 * np.hypot(front[:, 0], front[:, 2]) - 0.8, 0.0, 1.0)
    outwards = sign * np.arctan2(np.sin(yaw - hips_yaw), np.cos(yaw - hips_yaw)) * upright
    outwards = np.clip(0.8 * outwards, -0.5, 0.8) + np.deg2rad(track[f"{name}_knee_out"])
    swing = np.stack([1.0 - along[:, 1], -along[:, 2], np.zeros(len(along)), along[:, 0]], axis=1)
    swing = swing / np.linalg.norm(swing, axis=1, keepdims=True)  # the smallest rotation from straight down to `along`
    forward = rotate(multiply(swing, about(1, outwards)), np.array([0.0, 0.0, 1.0]))

    near = (THIGH_M**2 - SHIN_M**2 + distance**2) / (2 * distance)
    thigh = (near * along + np.sqrt(np.maximum(THIGH_M**2 - near**2, 0.0)) * forward) / THIGH_M
    knee = np.pi - np.arccos(np.clip((THIGH_M**2 + SHIN_M**2 - distance[:, 0] ** 2) / (2 * THIGH_M * SHIN_M), -1, 1))

    abduct = np.arcsin(np.clip(thigh[:, 0], -1, 1))
    flex = np.arctan2(thigh[:, 2], -thigh[:, 1])
    unrotated = multiply(about(0, -flex), about(2, abduct))
    hinge = rotate(conjugate(unrotated), np.cross(-along, forward))
    rotation = np.arctan2(-hinge[:, 2], hinge[:, 0])

    # The orientation of the sole, given by the foot's yaw and pitch, in the frame of the shin.
    pitch = np.deg2rad(track[f"{name}_foot_pitch"])
    sole_up = rotate(multiply(about(1, yaw), about(0, pitch)), np.array([0.0, 1.0, 0.0]))
    shin = multiply(multiply(unrotated, about(1, rotation)), about(0, knee))
    sole_up = rotate(conjugate(shin), rotate(to_hips, sole_up) * mirror)
    invert = np.arcsin(np.clip(sole_up[:, 0], -1, 1))
    point = np.arctan2(sole_up[:, 2], sole_up[:, 1])
    toes = np.where(track[f"{name}_foot_y"] < 0.1, 0.8 * np.clip(pitch, 0.0, None), 0.0)
    return np.rad2deg(np.stack([flex, abduct, rotation, knee, point, invert, toes], axis=1))
