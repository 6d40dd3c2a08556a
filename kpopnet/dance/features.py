"""Dance features: joint angles of a pose, independent of the person's size and position.

There are two: the paper's 22-D feature (section 3.1) and the 19-D feature of its reference [17], Raptis, Kirovski and Hoppe
2011. A new one is a function of joints to angles and an entry in `FEATURES`.

Both are angles of limbs in a torso frame (u, r, t): u points down the body, r from the right to the left shoulder (hip), and
t = u x r to the front. Assumptions where the two papers are silent:

- An inclination is the angle between a limb and its reference axis. An azimuth is the limb's signed rotation about that
  axis, by atan2, from r towards t. Differences of angles are wrapped (`kpopnet.dance.dtw`).
- An azimuth is undetermined where the limb is parallel to its axis. So each angle has a weight in 0..1: the sine of the
  inclination for an azimuth, 1 for most others. With these weights the difference of two directions is nearly the angle
  between them.
- [17] has one torso frame, from the principal axes of six joints of the torso (shoulders, neck, torso, hips). The sign of u
  is chosen so that it points from the neck to the hips, that of r so that it points to the left shoulder. Yaw, pitch and roll
  are measured between this frame and the camera's: 0 for a person who stands upright and faces the camera. A pitch near a
  right angle leaves yaw and roll undetermined, hence their weight is the cosine of the pitch.
- The 22-D feature splits the torso into two planes: one through the torso's centre and the shoulders, the other through the
  torso's centre and the hips. "The dot product between the upper and lower base axes" does not name the axes. The dot product
  of corresponding axes is the same for a twist to the left and to the right, and noise alone makes the angle large. Here the
  axes are those that are perpendicular in a straight posture: r against t (twist), r against u (lean) and t against u (bend),
  minus the right angle. Three more angles are the changes of these since the previous frame. Arms are measured in the upper
  frame, legs in the lower one.
- The second degree of [17] measures a forearm about the upper arm, and its azimuth from the projection of r perpendicular to
  the upper arm. An upper arm held sideways is parallel to r, and then the azimuth cannot tell whether the forearm points up or
  down. The 22-D feature instead rotates the frame along with the limb by the smallest rotation from a reference direction
  (`_TRANSPORT_REFERENCE`) whose opposite no limb reaches.
- The 22-D feature does not contain a rotation of the whole body, although the paper claims that it does: none of its angles is
  measured against anything outside the body. `dance22_turn` adds a 23rd: the rotation of the hips about their own axis within
  the last `TURN_WINDOW_S`. It needs neither the camera's heading nor a vertical.

The 22-D feature (with or without the turn) does not depend on the camera's pose or the person's size. [17] does not depend on
position and size, but its yaw, pitch and roll depend on the camera's heading: both dancers have to face their camera.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.dance.performance import confidences, poses
from kpopnet.dance.vectors import at, cross, dot, in_frame, norm, plus, times, unit
from kpopnet.errors import check_between, check_one_of
from kpopnet.skeleton import Joint

TURN_WINDOW_S = 0.5
"""Time over which the turn of the whole body is measured."""

LEAST_FPS = 2.0
"""At fewer frames per second no two of them lie within it."""

MIN_BONE_M = 0.01
"""A shorter bone has no direction: the angles that need it are missing."""

SEEN_CONFIDENCE = 0.3
"""A joint of this confidence or more counts as seen; below it, what the joint shows counts in proportion."""

TORSO_ANGLES = ("twist", "lean", "bend")

OF_EARLIER_FRAMES = ("twist_change", "lean_change", "bend_change", "turn")
"""Angles that are differences to earlier frames; 0 for a person who stands still."""

_FIRST_DEGREE = ("right_elbow", "left_elbow", "right_knee", "left_knee")
_SECOND_DEGREE = ("right_hand", "left_hand", "right_foot", "left_foot")
LIMB_ANGLES = tuple(f"{joint}_{angle}" for joint in _FIRST_DEGREE + _SECOND_DEGREE for angle in ("inclination", "azimuth"))
PROXIMAL = np.array([Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP])
MIDDLE = np.array([Joint[name.upper()] for name in _FIRST_DEGREE])
DISTAL = np.array([Joint[name.upper()] for name in _SECOND_DEGREE])
TORSO = np.int64(Joint.TORSO)  # of a plain number numba would make a type of its own
_TORSO = np.array([Joint.NECK, Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.TORSO, Joint.RIGHT_HIP, Joint.LEFT_HIP])

_TRANSPORT_REFERENCE = np.array([[0.3, -1, 1], [0.3, 1, 1], [1, 0, 1], [1, 0, 1]], float)
_TRANSPORT_REFERENCE /= np.linalg.norm(_TRANSPORT_REFERENCE, axis=1, keepdims=True)
"""(4, 3) unit direction along u, r, t from which a limb's frame is rotated: right arm, left arm, right leg, left leg."""


class Features(NamedTuple):
    """Dance features of a sequence."""

    angles_rad: np.ndarray  # (T, D) float64, NaN where a joint that the angle needs is missing
    weights: np.ndarray  # (T, D) float64 in 0..1, how well determined each angle is by the pose
    # (T, D) float64 in 0..1: the lowest confidence of the joints that define the angle; 0 where the angle is missing. Changes
    # and turns need earlier frames too: where only these are missing, the angle is NaN but as confident as the torso.
    confidence: np.ndarray
    joints_m: np.ndarray  # (T, 15, 3) float64, what they are features of, as for `dance_features`

    def at(self, rows: slice | np.ndarray) -> "Features":
        """The features of some of the frames."""
        return Features(*(array[rows] for array in self))


class Angles(NamedTuple):
    """(T, D) angles and their weights, as in `Features`."""

    angles_rad: np.ndarray
    weights: np.ndarray


class Feature(NamedTuple):
    """A dance feature."""

    # of the D angles. A name gives the part of the body and the joints whose confidence counts: SIDE_elbow_ANGLE and
    # SIDE_hand_ANGLE are an arm's, SIDE_knee_ANGLE and SIDE_foot_ANGLE a leg's, turn the body's, others the torso's.
    names: tuple[str, ...]
    # of (T, 15, 3) joints at uniform frames, NaN where missing, and their frames per second
    angles: Callable[[np.ndarray, float], Angles]
    history_s: float = 0.0  # how far back in time an angle looks, seconds; the frame before is always there

    def history_frames(self, fps: float) -> int:
        """Frames that an angle of the last of them is computed from."""
        return max(round(self.history_s * fps) + 1, 2)


def dance_features(joints_m: np.ndarray, feature: str, fps: float, confidence: np.ndarray | None = None) -> Features:
    """The features, one of FEATURES, of uniformly spaced poses; changes and turns of the first frames are missing.

    The (T, 15, 3) joints are in any right-handed frame, metres, NaN where missing; for [17] in the camera frame (x right, y
    down). The (T, 15) confidence in 0..1 is 1 for all by default. Raises InputError: another name or shape, or less than
    LEAST_FPS frames per second.
    """
    check_one_of("feature", feature, FEATURES)
    check_between("fps", fps, LEAST_FPS, 1000)
    joints_m = poses(joints_m)
    confidence = confidences(confidence, joints_m.shape[:2])
    names, compute, _ = FEATURES[feature]
    angles = compute(joints_m, fps)
    return Features(*angles, _angles_confidence(angles.angles_rad, confidence, names), joints_m)


def _angles_confidence(angles_rad: np.ndarray, confidence: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """(T, D) `Features.confidence` of angles from the (T, 15) confidence of the joints.

    For a limb's angles only the limb's own joints count: the torso frame is estimated from six joints together.
    """
    lowest = confidence[:, _joints_of(names)].min(axis=2)
    is_now = np.array([name not in OF_EARLIER_FRAMES for name in names])
    missing = np.isnan(angles_rad)
    missing[:, ~is_now] = np.isnan(angles_rad[:, :1])  # the first angle is of the torso now
    return np.where(missing, 0.0, lowest)


@cache
def _joints_of(names: tuple[str, ...]) -> np.ndarray:
    """(D, 6) the joints whose confidence counts for each angle, some more than once: the neck is in the torso of [17] alone."""
    torso = _TORSO if "yaw" in names else _TORSO[1:]
    ends = np.concatenate([np.stack([PROXIMAL, MIDDLE], axis=1), np.stack([MIDDLE, DISTAL], axis=1)])
    limbs: dict[str, np.ndarray] = dict(zip(_FIRST_DEGREE + _SECOND_DEGREE, ends, strict=True))
    return np.array([np.resize(limbs.get(name.rpartition("_")[0], torso), len(_TORSO)) for name in names])


def dance22_features(joints_m: np.ndarray, turn_frames: int | None = None) -> Angles:
    """The paper's 22-D feature of (T, 15, 3) joints; with a 23rd angle, the turn of the body within `turn_frames`, if given.

    Raises InputError for another shape.
    """
    angles = Angles(*_dance22(poses(joints_m), turn_frames or 1))
    return angles if turn_frames else Angles(*(np.ascontiguousarray(array[:, :-1]) for array in angles))


@njit(cache=True)
def _dance22(joints_m, turn_frames):
    """(T, 23) angles and weights, see `dance22_features`."""
    angles_rad, weights = np.full((len(joints_m), 23), np.nan), np.ones((len(joints_m), 23))
    for frame in range(len(joints_m)):
        upper, lower = torso_frame(joints_m[frame], 0), torso_frame(joints_m[frame], 2)
        # The first degree of the torso: how far axes that are perpendicular in a straight posture are from it.
        for angle, cosine in enumerate((dot(upper[1], lower[2]), dot(upper[1], lower[0]), dot(upper[2], lower[0]))):
            angles_rad[frame, angle] = math.asin(max(min(cosine, 1.0), -1.0))
            if frame > 0:
                angles_rad[frame, 3 + angle] = angles_rad[frame, angle] - angles_rad[frame - 1, angle]
        for limb in range(4):
            parent, child = limb_in(upper if limb < 2 else lower, joints_m[frame], limb)
            child, least_weight = _about(at(_TRANSPORT_REFERENCE, limb), parent, child)
            _write_direction(parent, 1.0, angles_rad[frame], weights[frame], 6 + 2 * limb)
            _write_direction(child, least_weight, angles_rad[frame], weights[frame], 14 + 2 * limb)
        if frame >= turn_frames:
            before = torso_frame(joints_m[frame - turn_frames], 2)
            angles_rad[frame, 22] = math.atan2(dot(lower[1], before[2]), dot(lower[1], before[1]))
    return angles_rad, weights


@njit(cache=True)
def limb_directions(joints_m):
    """(T, 4, 6) unit directions of upper and lower limb in the torso's frames: right arm, left arm, right leg, left leg."""
    directions = np.empty((len(joints_m), 4, 6))
    for frame in range(len(joints_m)):
        for limb in range(4):
            parent, child = limb_in(torso_frame(joints_m[frame], limb), joints_m[frame], limb)
            for axis in range(3):
                directions[frame, limb, axis], directions[frame, limb, 3 + axis] = parent[axis], child[axis]
    return directions


def raptis_features(joints_m: np.ndarray) -> Angles:
    """The 19-D feature of [17] from (T, 15, 3) joints in the camera frame; raises InputError for another shape."""
    joints_m = poses(joints_m)
    return Angles(*_raptis(joints_m, _principal_frame(joints_m)))


@njit(cache=True)
def _raptis(joints_m, frames):
    """(T, 19) angles and weights, see `raptis_features`, of joints and the (T, 3, 3) frames of the torso."""
    angles_rad, weights = np.full((len(joints_m), 19), np.nan), np.ones((len(joints_m), 19))
    for frame in range(len(joints_m)):
        u, r, t = at(frames[frame], 0), at(frames[frame], 1), at(frames[frame], 2)
        angles_rad[frame, 0] = math.atan2(t[0], -t[2])
        angles_rad[frame, 1] = math.asin(max(min(t[1], 1.0), -1.0))
        angles_rad[frame, 2] = math.atan2(r[1], u[1])
        weights[frame, 0] = weights[frame, 2] = math.sqrt(max(min(1 - t[1] ** 2, 1.0), 0.0))
        for limb in range(4):
            parent, child = limb_in((u, r, t), joints_m[frame], limb)
            # r projected perpendicular to the upper limb; the cross product completes the frame.
            r_projected = plus((0.0, 1.0, 0.0), parent, -parent[1])
            length = norm(r_projected)
            r_projected = times(r_projected, 1 / max(length, 1e-9))
            child = dot(child, parent), dot(child, r_projected), dot(child, cross(parent, r_projected))
            _write_direction(parent, 1.0, angles_rad[frame], weights[frame], 3 + 2 * limb)
            _write_direction(child, length, angles_rad[frame], weights[frame], 11 + 2 * limb)
    return angles_rad, weights


@njit(cache=True)
def torso_frame(joints_m, limb):
    """The axes u, r, t of the plane through the torso's centre and the shoulders, for an arm, or the hips, for a leg; NaN where
    there is none.
    """
    torso_m, first = at(joints_m, TORSO), limb // 2 * 2
    right_m, left_m = at(joints_m, PROXIMAL[first]), at(joints_m, PROXIMAL[first + 1])
    down = plus(torso_m, plus(right_m, left_m, 1.0), -0.5)
    r = unit(plus(left_m, right_m, -1.0), MIN_BONE_M)
    t = unit(cross(down, r) if limb < 2 else cross(r, down), MIN_BONE_M)
    return cross(r, t), r, t


@njit(cache=True)
def limb_in(frame, joints_m, limb):
    """The unit directions of an upper and a lower limb in a frame of axes u, r, t; NaN where the bone is too short."""
    proximal_m, middle_m, distal_m = at(joints_m, PROXIMAL[limb]), at(joints_m, MIDDLE[limb]), at(joints_m, DISTAL[limb])
    parent, child = unit(plus(middle_m, proximal_m, -1.0), MIN_BONE_M), unit(plus(distal_m, middle_m, -1.0), MIN_BONE_M)
    return in_frame(frame, parent), in_frame(frame, child)


@njit(cache=True)
def _about(start, parent, child):
    """A lower limb's direction in the frame that goes along with the upper limb from the direction `start`, and how well its
    azimuth is determined, 0..1: not at all where the upper limb points the opposite way.
    """
    cosine, both = dot(start, parent), plus(start, parent, 1.0)
    # `back` is the child's direction after the smallest rotation that maps the parent's direction to `start`.
    back = plus(child, both, -dot(both, child) / max(1 + cosine, 1e-9))
    back = plus(back, start, 2 * dot(parent, child))
    r = plus((0.0, 1.0, 0.0), start, -start[1])
    r = times(r, 1 / norm(r))
    return (dot(back, start), dot(back, r), dot(back, cross(start, r))), max(min(1 + cosine, 1.0), 0.0)


@njit(cache=True)
def _write_direction(direction, azimuth_weight, angles_rad, weights, angle):
    """Writes inclination and azimuth of a unit direction, whose first coordinate is along the reference axis, and weights."""
    sine = math.hypot(direction[1], direction[2])
    angles_rad[angle], angles_rad[angle + 1] = math.atan2(sine, direction[0]), math.atan2(direction[2], direction[1])
    weights[angle + 1] = sine * azimuth_weight


def _principal_frame(joints_m: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rows u, r, t of the torso's principal axes."""
    torso_m = joints_m[:, _TORSO]
    centred_m = torso_m - torso_m.mean(axis=1, keepdims=True)
    valid = np.isfinite(centred_m).all(axis=(1, 2))
    _, axes = np.linalg.eigh(centred_m[valid].swapaxes(1, 2) @ centred_m[valid])
    u, r = np.full((2, len(joints_m), 3), np.nan)
    u[valid], r[valid] = axes[..., 2], axes[..., 1]
    down = (joints_m[:, Joint.RIGHT_HIP] + joints_m[:, Joint.LEFT_HIP]) / 2 - joints_m[:, Joint.NECK]
    leftwards = joints_m[:, Joint.LEFT_SHOULDER] - joints_m[:, Joint.RIGHT_SHOULDER]
    # A torso whose joints lie on a line or in a point has no frame.
    degenerate = np.linalg.norm(np.cross(down, leftwards), axis=1) < MIN_BONE_M**2
    u = np.where((u * down).sum(axis=1, keepdims=True) < 0, -u, u)
    r = np.where((r * leftwards).sum(axis=1, keepdims=True) < 0, -r, r)
    frame = np.stack([u, r, np.cross(u, r)], axis=1)
    frame[degenerate] = np.nan
    return frame


FEATURES = {
    "dance22": Feature((*TORSO_ANGLES, *OF_EARLIER_FRAMES[:3], *LIMB_ANGLES), lambda joints_m, fps: dance22_features(joints_m)),
    "dance22_turn": Feature(
        (*TORSO_ANGLES, *OF_EARLIER_FRAMES[:3], *LIMB_ANGLES, "turn"),
        lambda joints_m, fps: dance22_features(joints_m, round(TURN_WINDOW_S * fps)),
        TURN_WINDOW_S,
    ),
    "raptis": Feature(("yaw", "pitch", "roll", *LIMB_ANGLES), lambda joints_m, fps: raptis_features(joints_m)),
}
"""By name. Each is scored by the paper's scorer (`kpopnet.dance.scoring.SCORERS`); `dance22_turn` by ours."""
