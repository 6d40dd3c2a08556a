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

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kpopnet.skeleton import Joint

TURN_WINDOW_S = 0.5
"""Time over which the turn of the whole body is measured."""

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
    down). The (T, 15) confidence in 0..1 is 1 for all by default.
    """
    joints_m = np.asarray(joints_m, np.float64)
    names, compute, _ = FEATURES[feature]
    angles = compute(joints_m, fps)
    if confidence is None:
        confidence = np.ones(joints_m.shape[:2])
    return Features(*angles, _angles_confidence(angles.angles_rad, confidence, names), joints_m)


def _angles_confidence(angles_rad: np.ndarray, confidence: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """(T, D) `Features.confidence` of angles from the (T, 15) confidence of the joints.

    For a limb's angles only the limb's own joints count: the torso frame is estimated from six joints together.
    """
    first = np.minimum(confidence[:, PROXIMAL], confidence[:, MIDDLE])
    second = np.minimum(confidence[:, MIDDLE], confidence[:, DISTAL])
    limbs: dict[str, np.ndarray] = dict(
        zip(_FIRST_DEGREE + _SECOND_DEGREE, np.concatenate([first, second], axis=1).T, strict=True)
    )
    torso = confidence[:, _TORSO].min(axis=1)
    lowest = np.stack([limbs[limb] if (limb := name.rpartition("_")[0]) in limbs else torso for name in names], axis=1)
    is_now = np.array([name not in OF_EARLIER_FRAMES for name in names])
    missing = np.isnan(angles_rad)
    missing[:, ~is_now] = np.isnan(angles_rad[:, :1])  # the first angle is of the torso now
    return np.where(missing, 0.0, lowest)


def dance22_features(joints_m: np.ndarray, turn_frames: int | None = None) -> Angles:
    """The paper's 22-D feature of (T, 15, 3) joints; with a 23rd angle, the turn of the body within `turn_frames`, if given."""
    upper, lower = _torso_frames(joints_m)
    between = upper @ lower.swapaxes(1, 2)  # (T, 3, 3), upper axis by lower axis
    tilt = np.arcsin(np.clip(np.stack([between[:, 1, 2], between[:, 1, 0], between[:, 2, 0]], axis=1), -1, 1))
    change = np.full_like(tilt, np.nan)
    change[1:] = tilt[1:] - tilt[:-1]
    torso = Angles(np.concatenate([tilt, change], axis=1), np.ones((len(tilt), 6)))

    parent, child = _limbs_in(np.stack([upper, upper, lower, lower], axis=1), joints_m)
    parts = [torso, _inclination_and_azimuth(parent), _child_angles(parent, child)]
    if turn_frames is not None:
        parts.append(_heading_change(lower, turn_frames))
    return _concatenate(parts)


def limb_directions(joints_m: np.ndarray) -> np.ndarray:
    """(T, 4, 6) unit directions of upper and lower limb in the torso's frames: right arm, left arm, right leg, left leg."""
    upper, lower = _torso_frames(joints_m)
    return np.concatenate(_limbs_in(np.stack([upper, upper, lower, lower], axis=1), joints_m), axis=2)


def _torso_frames(joints_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 3, 3) frames of the planes through the torso's centre and the shoulders, and through it and the hips."""
    torso_m = joints_m[:, Joint.TORSO]
    right_shoulder_m, left_shoulder_m = joints_m[:, Joint.RIGHT_SHOULDER], joints_m[:, Joint.LEFT_SHOULDER]
    right_hip_m, left_hip_m = joints_m[:, Joint.RIGHT_HIP], joints_m[:, Joint.LEFT_HIP]
    upper = _plane_frame(torso_m - (right_shoulder_m + left_shoulder_m) / 2, left_shoulder_m - right_shoulder_m)
    return upper, _plane_frame((right_hip_m + left_hip_m) / 2 - torso_m, left_hip_m - right_hip_m)


def raptis_features(joints_m: np.ndarray) -> Angles:
    """The 19-D feature of [17] from (T, 15, 3) joints in the camera frame."""
    frame = _principal_frame(joints_m)
    u, r, t = frame[:, 0], frame[:, 1], frame[:, 2]
    angles = np.stack([np.arctan2(t[:, 0], -t[:, 2]), np.arcsin(np.clip(t[:, 1], -1, 1)), np.arctan2(r[:, 1], u[:, 1])], axis=1)
    pitch_cosine = np.sqrt(np.clip(1 - t[:, 1] ** 2, 0, 1))
    torso = Angles(angles, np.stack([pitch_cosine, np.ones(len(pitch_cosine)), pitch_cosine], axis=1))

    parent, child = _limbs_in(np.repeat(frame[:, None], 4, axis=1), joints_m)
    # r projected perpendicular to the upper limb; the cross product completes the frame.
    along = parent[..., 1:2]
    r_projected = np.array([0.0, 1.0, 0.0]) - along * parent
    length = np.linalg.norm(r_projected, axis=-1, keepdims=True)
    r_projected = r_projected / np.maximum(length, 1e-9)
    child = np.stack([(child * axis).sum(axis=-1) for axis in (parent, r_projected, _cross(parent, r_projected))], axis=-1)
    second = _inclination_and_azimuth(child, azimuth_weight=length[..., 0])
    return _concatenate([torso, _inclination_and_azimuth(parent), second])


def _limbs_in(frames: np.ndarray, joints_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 4, 3) unit directions of the four upper limbs, and of the four lower ones, in (T, 4, 3, 3) frames of rows u, r, t."""
    middle_m = joints_m[:, MIDDLE]
    parent, child = _unit(middle_m - joints_m[:, PROXIMAL]), _unit(joints_m[:, DISTAL] - middle_m)
    return (frames @ parent[..., None])[..., 0], (frames @ child[..., None])[..., 0]


def _inclination_and_azimuth(directions: np.ndarray, azimuth_weight: np.ndarray | float = 1.0) -> Angles:
    """(T, 8) angles, limb by limb, of (T, 4, 3) unit directions; the first coordinate is along the reference axis."""
    sine = np.hypot(directions[..., 1], directions[..., 2])
    angles = np.stack([np.arctan2(sine, directions[..., 0]), np.arctan2(directions[..., 2], directions[..., 1])], axis=-1)
    weights = np.stack([np.ones_like(sine), sine * azimuth_weight], axis=-1)
    return Angles(angles.reshape(len(angles), 8), weights.reshape(len(angles), 8))


def _child_angles(parent: np.ndarray, child: np.ndarray) -> Angles:
    """Second degree of the 22-D feature: angles of lower limbs about upper limbs, (T, 4, 3) directions in the torso frame."""
    start = _TRANSPORT_REFERENCE  # (4, 3)
    cosine = (start * parent).sum(axis=-1, keepdims=True)
    # `back` is the child's direction after the smallest rotation that maps the parent's direction to `start`.
    both = start + parent
    back = child - both * ((both * child).sum(axis=-1, keepdims=True) / np.maximum(1 + cosine, 1e-9))
    back = back + 2 * start * (parent * child).sum(axis=-1, keepdims=True)
    r = np.array([0.0, 1.0, 0.0]) - start[:, 1:2] * start
    r /= np.linalg.norm(r, axis=-1, keepdims=True)
    local = np.stack([(back * axis).sum(axis=-1) for axis in (start, r, _cross(start, r))], axis=-1)
    return _inclination_and_azimuth(local, azimuth_weight=np.clip(1 + cosine[..., 0], 0, 1))


def _heading_change(frame: np.ndarray, frames: int) -> Angles:
    """(T, 1) rotation of a (T, 3, 3) torso frame about its u axis within the last `frames` frames."""
    angle = np.full((len(frame), 1), np.nan)
    r, before = frame[frames:, 1], frame[: max(len(frame) - frames, 0)]
    angle[frames:, 0] = np.arctan2((r * before[:, 2]).sum(axis=-1), (r * before[:, 1]).sum(axis=-1))
    return Angles(angle, np.ones_like(angle))


def _plane_frame(down: np.ndarray, leftwards: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rows u, r, t of the plane spanned by two (T, 3) directions; NaN where they are parallel."""
    r = _unit(leftwards)
    t = _unit(_cross(down, r))
    return np.stack([_cross(r, t), r, t], axis=1)


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
    degenerate = np.linalg.norm(_cross(down, leftwards), axis=1) < MIN_BONE_M**2
    u = np.where((u * down).sum(axis=1, keepdims=True) < 0, -u, u)
    r = np.where((r * leftwards).sum(axis=1, keepdims=True) < 0, -r, r)
    frame = np.stack([u, r, _cross(u, r)], axis=1)
    frame[degenerate] = np.nan
    return frame


def _unit(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors normalised to length 1; NaN where they are shorter than MIN_BONE_M."""
    length = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    return vectors / np.where(length < MIN_BONE_M, np.nan, length)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The cross product of (..., 3) vectors, without the checks that make numpy's slow for single frames."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def _concatenate(parts: list[Angles]) -> Angles:
    return Angles(*(np.concatenate(arrays, axis=1) for arrays in zip(*parts, strict=True)))


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
