"""Dance features: what a pose is made of, whoever dances and wherever the camera stands.

Two are here: the paper's 22-D feature (section 3.1) and the 19-D feature of its reference [17], Raptis, Kirovski and Hoppe
2011, which the paper compares with. Both are angles of limbs in a frame (u, r, t) of the torso: u runs down the body, r
from the right to the left shoulder (hip), t = u x r to the front. What the two papers leave open is settled so:

- An inclination is the angle between a limb and the axis it is measured from, an azimuth the limb's turn about that axis,
  signed, by atan2, from r towards t. Differences of angles are wrapped (`kpopnet.dance.dtw`).
- An azimuth says nothing where the limb lies along its axis. Each angle has a weight in 0..1: the sine of the inclination
  for an azimuth, 1 for most others. With it the difference of two directions is nearly the angle between them.
- [17] has one torso frame, from the principal axes of six joints of the torso (shoulders, neck, torso, hips); u is turned
  to point from the neck to the hips and r to the left shoulder. Yaw, pitch and roll are the frame's against the camera's:
  0 for a person who stands upright and faces it. Pitch near a right angle leaves yaw and roll undetermined, hence the
  pitch's cosine as their weight.
- The 22-D feature splits the torso in two planes: through the torso's centre and the shoulders, and through it and the hips.
  "The dot product between the upper and lower base axes" does not say of which. Of corresponding axes it gives the same for
  a twist to the left and to the right, and an angle that noise alone makes large. Taken here are the axes that are
  perpendicular when standing straight: r against t (twist), r against u (lean) and t against u (bend), less the right angle.
  Three more are their changes since the previous frame. Arms are measured in the upper frame, legs in the lower.
- The second degree of [17] measures a forearm about the upper arm, its azimuth from r as seen along the upper arm. Held
  sideways the upper arm lies along r, and nobody can say then whether the forearm points up or down. The 22-D feature
  carries the frame along with the limb instead, from a direction (`_CARRIED_FROM`) whose opposite no limb reaches, by the
  smallest rotation.
- The 22-D feature cannot see a turn of the whole body, although the paper says so: no angle in it is measured against
  anything outside the body. `heading=True` adds a 23rd: how far the hips have turned about their own axis within the last
  `TURN_S`. It needs neither the camera's heading nor a vertical.

The 22-D feature (and the turn) does not depend on where the camera stands, how it is turned or on the person's size. [17]
does not depend on place and size, but its yaw, pitch and roll follow the camera: both dancers have to be seen from the front.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

FEATURES = ("dance22", "raptis")

TURN_S = 0.5
LEAST_BONE_M = 0.01
"""What is shorter has no direction: the angles that need it are missing."""

_FIRST_DEGREE = ("right_elbow", "left_elbow", "right_knee", "left_knee")
_SECOND_DEGREE = ("right_hand", "left_hand", "right_foot", "left_foot")
_ROOTS = np.array([Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP])
_MIDDLES = np.array([Joint[name.upper()] for name in _FIRST_DEGREE])
_ENDS = np.array([Joint[name.upper()] for name in _SECOND_DEGREE])
_TORSO = np.array([Joint.NECK, Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.TORSO, Joint.RIGHT_HIP, Joint.LEFT_HIP])

_CARRIED_FROM = np.array([[0.3, -1, 1], [0.3, 1, 1], [1, 0, 1], [1, 0, 1]], float)  # along u, r, t
_CARRIED_FROM /= np.linalg.norm(_CARRIED_FROM, axis=1, keepdims=True)


class Features(NamedTuple):
    """Dance features of a sequence.

    Attributes:
        angles_rad: (T, D) float64, NaN where a joint that is needed is missing.
        weights: (T, D) float64 in 0..1, how much each angle says.
        sure: (T, D) float64, how sure the joints are that it is made of: the square of the least confidence, against the
            mean over those of the frame's angles of which anybody is sure at all; 0 for the others.
    """

    angles_rad: np.ndarray
    weights: np.ndarray
    sure: np.ndarray


def feature_names(feature: str, heading: bool = False) -> tuple[str, ...]:
    """What the D columns of a feature are.

    Raises:
        InputError: an unknown feature, or a heading asked of [17], which has its own.
    """
    if feature not in FEATURES:
        raise InputError(f"feature={feature} is not one of {', '.join(FEATURES)}")
    limbs = tuple(f"{joint}_{angle}" for joint in _FIRST_DEGREE + _SECOND_DEGREE for angle in ("inclination", "azimuth"))
    if feature == "raptis":
        if heading:
            raise InputError("heading=true: only dance22 lacks a heading; raptis has yaw, pitch and roll already")
        return ("yaw", "pitch", "roll", *limbs)
    torso = ("twist", "lean", "bend", "twist_change", "lean_change", "bend_change")
    return (*torso, *limbs, *(("turn",) if heading else ()))


class Angles(NamedTuple):
    """Angles (T, D) and their weights as in `Features`."""

    angles_rad: np.ndarray
    weights: np.ndarray


def dance_features(
    joints_m: np.ndarray, feature: str, fps: float, heading: bool = False, confidence: np.ndarray | None = None
) -> Features:
    """The features of a sequence of poses.

    Args:
        joints_m: (T, 15, 3) in any right-handed frame, NaN where missing; for [17] the camera's (x right, y down).
        feature: dance22, the paper's, or raptis, that of [17].
        fps: frames per second, evenly spaced.
        heading: adds the turn of the whole body to dance22.
        confidence: (T, 15) in 0..1 of each joint; by default all are sure.

    Returns:
        Features in the order of `feature_names`. Changes and turns of the first frames are missing.

    Raises:
        InputError: see `feature_names`.
    """
    feature_names(feature, heading)
    joints_m = np.asarray(joints_m, np.float64)
    if feature == "raptis":
        angles = raptis_features(joints_m)
    else:
        angles = dance22_features(joints_m, round(TURN_S * fps) if heading else None)
    if confidence is None:
        return Features(*angles, np.ones_like(angles.weights))
    return Features(*angles, _sure(confidence, feature_names(feature, heading)))


def _sure(confidence: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """(T, D) of (T, 15) confidence, see `Features`.

    For a limb's angles those of the limb alone: the torso's frame is told by six joints together.
    """
    first = np.minimum(confidence[:, _ROOTS], confidence[:, _MIDDLES])
    second = np.minimum(confidence[:, _MIDDLES], confidence[:, _ENDS])
    limbs = dict(zip(_FIRST_DEGREE + _SECOND_DEGREE, np.concatenate([first, second], axis=1).T, strict=True))
    torso = confidence[:, _TORSO].min(axis=1)
    sure = np.stack([limbs.get(name.rpartition("_")[0], torso) for name in names], axis=1) ** 2
    known = np.maximum((sure > 0).sum(axis=1), 1)
    return sure / np.maximum(sure.sum(axis=1) / known, 1e-9)[:, None]


def dance22_features(joints_m: np.ndarray, turn_frames: int | None = None) -> Angles:
    """The paper's 22-D feature of (T, 15, 3) joints; with `turn_frames` the turn within so many frames as a 23rd."""
    torso_m = joints_m[:, Joint.TORSO]
    right_shoulder_m, left_shoulder_m = joints_m[:, Joint.RIGHT_SHOULDER], joints_m[:, Joint.LEFT_SHOULDER]
    right_hip_m, left_hip_m = joints_m[:, Joint.RIGHT_HIP], joints_m[:, Joint.LEFT_HIP]
    upper = _plane_frame(torso_m - (right_shoulder_m + left_shoulder_m) / 2, left_shoulder_m - right_shoulder_m)
    lower = _plane_frame((right_hip_m + left_hip_m) / 2 - torso_m, left_hip_m - right_hip_m)
    between = upper @ lower.swapaxes(1, 2)  # (T, 3, 3), upper axis by lower axis
    bent = np.arcsin(np.clip(np.stack([between[:, 1, 2], between[:, 1, 0], between[:, 2, 0]], axis=1), -1, 1))
    changed = np.full_like(bent, np.nan)
    changed[1:] = bent[1:] - bent[:-1]
    torso = Angles(np.concatenate([bent, changed], axis=1), np.ones((len(bent), 6)))

    frames = np.stack([upper, upper, lower, lower], axis=1)
    parent, child = _limbs_in(frames, joints_m)
    parts = [torso, _inclination_and_azimuth(parent), _carried(parent, child)]
    if turn_frames is not None:
        parts.append(_turn(lower, turn_frames))
    return _joined(parts)


def raptis_features(joints_m: np.ndarray) -> Angles:
    """The 19-D feature of [17] of (T, 15, 3) joints in the camera frame."""
    frame = _principal_frame(joints_m)
    u, r, t = frame[:, 0], frame[:, 1], frame[:, 2]
    angles = np.stack(
        [np.arctan2(t[:, 0], -t[:, 2]), np.arcsin(np.clip(t[:, 1], -1, 1)), np.arctan2(r[:, 1], u[:, 1])], axis=1
    )
    level = np.sqrt(np.clip(1 - t[:, 1] ** 2, 0, 1))
    torso = Angles(angles, np.stack([level, np.ones(len(level)), level], axis=1))

    parent, child = _limbs_in(np.repeat(frame[:, None], 4, axis=1), joints_m)
    # r seen along the limb, and what completes it to a frame.
    along = parent[..., 1:2]
    r_seen = np.array([0.0, 1.0, 0.0]) - along * parent
    length = np.linalg.norm(r_seen, axis=-1, keepdims=True)
    r_seen = r_seen / np.maximum(length, 1e-9)
    child = np.stack([(child * axis).sum(axis=-1) for axis in (parent, r_seen, _cross(parent, r_seen))], axis=-1)
    second = _inclination_and_azimuth(child, azimuth_weight=length[..., 0])
    return _joined([torso, _inclination_and_azimuth(parent), second])


def _limbs_in(frames: np.ndarray, joints_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 4, 3) unit directions along (u, r, t) of the four upper limbs and of the four lower ones."""
    middle_m = joints_m[:, _MIDDLES]
    parent, child = _unit(middle_m - joints_m[:, _ROOTS]), _unit(joints_m[:, _ENDS] - middle_m)
    return (frames @ parent[..., None])[..., 0], (frames @ child[..., None])[..., 0]


def _inclination_and_azimuth(directions: np.ndarray, azimuth_weight: np.ndarray | float = 1.0) -> Angles:
    """Of (T, 4, 3) unit directions along an axis and two perpendicular ones: (T, 8), limb by limb."""
    sine = np.hypot(directions[..., 1], directions[..., 2])
    angles = np.stack([np.arctan2(sine, directions[..., 0]), np.arctan2(directions[..., 2], directions[..., 1])], axis=-1)
    weights = np.stack([np.ones_like(sine), sine * azimuth_weight], axis=-1)
    return Angles(angles.reshape(len(angles), 8), weights.reshape(len(angles), 8))


def _carried(parent: np.ndarray, child: np.ndarray) -> Angles:
    """Second degree of the 22-D feature: (T, 4, 3) directions in the torso's frame, the child's about the parent's."""
    start = _CARRIED_FROM  # (4, 3)
    cosine = (start * parent).sum(axis=-1, keepdims=True)
    # The smallest rotation that takes the parent back to `start` takes the child to this.
    both = start + parent
    back = child - both * ((both * child).sum(axis=-1, keepdims=True) / np.maximum(1 + cosine, 1e-9))
    back = back + 2 * start * (parent * child).sum(axis=-1, keepdims=True)
    r = np.array([0.0, 1.0, 0.0]) - start[:, 1:2] * start
    r /= np.linalg.norm(r, axis=-1, keepdims=True)
    seen = np.stack([(back * axis).sum(axis=-1) for axis in (start, r, _cross(start, r))], axis=-1)
    return _inclination_and_azimuth(seen, azimuth_weight=np.clip(1 + cosine[..., 0], 0, 1))


def _turn(frame: np.ndarray, frames: int) -> Angles:
    """(T, 1) how far a (T, 3, 3) frame has turned about its u since `frames` ago."""
    angle = np.full((len(frame), 1), np.nan)
    r, before = frame[frames:, 1], frame[: max(len(frame) - frames, 0)]
    angle[frames:, 0] = np.arctan2((r * before[:, 2]).sum(axis=-1), (r * before[:, 1]).sum(axis=-1))
    return Angles(angle, np.ones_like(angle))


def _plane_frame(down: np.ndarray, leftwards: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rows u, r, t of the plane through two directions (T, 3); NaN where they do not span one."""
    r = _unit(leftwards)
    t = _unit(_cross(down, r))
    return np.stack([_cross(r, t), r, t], axis=1)


def _principal_frame(joints_m: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rows u, r, t of the torso's principal axes."""
    torso_m = joints_m[:, _TORSO]
    spread_m = torso_m - torso_m.mean(axis=1, keepdims=True)
    known = np.isfinite(spread_m).all(axis=(1, 2))
    _, axes = np.linalg.eigh(spread_m[known].swapaxes(1, 2) @ spread_m[known])
    u, r = np.full((2, len(joints_m), 3), np.nan)
    u[known], r[known] = axes[..., 2], axes[..., 1]
    down = (joints_m[:, Joint.RIGHT_HIP] + joints_m[:, Joint.LEFT_HIP]) / 2 - joints_m[:, Joint.NECK]
    leftwards = joints_m[:, Joint.LEFT_SHOULDER] - joints_m[:, Joint.RIGHT_SHOULDER]
    # A torso that is a line, or a point, has no frame.
    flat = np.linalg.norm(_cross(down, leftwards), axis=1) < LEAST_BONE_M**2
    u = np.where((u * down).sum(axis=1, keepdims=True) < 0, -u, u)
    r = np.where((r * leftwards).sum(axis=1, keepdims=True) < 0, -r, r)
    frame = np.stack([u, r, _cross(u, r)], axis=1)
    frame[flat] = np.nan
    return frame


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of length 1, NaN where they have none."""
    length = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    return vectors / np.where(length < LEAST_BONE_M, np.nan, length)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The cross product of (..., 3), without the checks that make numpy's slow for single frames."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def _joined(parts: list[Angles]) -> Angles:
    return Angles(*(np.concatenate(arrays, axis=1) for arrays in zip(*parts, strict=True)))
