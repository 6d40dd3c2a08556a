"""Estimated joints, moved to the points of the body that the labels of a benchmark call by the same names.

Data sets define joints differently: the Kinect SDK's hips are closer together and higher than ours, its hands farther out.
Such a difference is nearly constant in axes that move with the body, so it is one offset per joint, in metres, in axes made
from the estimate's own joints:

- neck, head, shoulders, torso, hips: the axes of the torso, which are outward, down and front. Outward is the person's right
  for right joints and joints in the middle, and the left for left joints;
- elbows, hands, knees, feet: the torso's axes, turned by the smallest rotation that takes a direction of rest into the
  direction of the bone that ends at the joint.

Left and right joints share an offset, in axes that mirror each other; joints in the middle have none sideways. The offsets that
judge a person are fitted on the labels of all other people: what they take away is what the definitions differ by, and what the
estimator gets wrong in every person. So figures in the labels' definition stand beside the raw ones and not in their place.
"""

import numpy as np

from kpopnet.errors import InputError
from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint

BONE_ENDS = {
    Joint.RIGHT_ELBOW: Joint.RIGHT_SHOULDER,
    Joint.RIGHT_HAND: Joint.RIGHT_ELBOW,
    Joint.RIGHT_KNEE: Joint.RIGHT_HIP,
    Joint.RIGHT_FOOT: Joint.RIGHT_KNEE,
}
"""The right joints with axes of their own bone, and where that bone begins. The left ones mirror them."""

ARM_REST, LEG_REST = np.full(3, np.sqrt(1 / 3)), np.array([0.0, 1.0, 0.0])
"""Directions of rest (outward, down, front). The axes are undefined opposite to them, where no limb reaches: through the chest
to the other shoulder blade, and from the hip through the trunk."""

MIN_ONE_PLUS_COSINE = 1e-6
"""Bounds the rotation from rest to a direction opposite to it."""


def joint_axes(joints_m: np.ndarray) -> np.ndarray:
    """The axes in which each joint's offset is constant: rows outward, down and front of unit length.

    (N, 15, 3, 3), NaN where a joint that defines them is missing, of (N, 15, 3) estimated joints in any right-handed frame.
    """
    joints_m = joints_m.astype(np.float64)
    axes = np.repeat(torso_axes(joints_m)[:, None], NUM_JOINTS, axis=1)
    axes[:, [joint for joint in Joint if joint.name.startswith("LEFT_")], 0] *= -1
    for right_end, right_start in BONE_ENDS.items():
        rest = ARM_REST if right_end in (Joint.RIGHT_ELBOW, Joint.RIGHT_HAND) else LEG_REST
        for end, start in ((right_end, right_start), (MIRROR[right_end], MIRROR[right_start])):
            direction = np.einsum("nij,nj->ni", axes[:, end], _unit(joints_m[:, end] - joints_m[:, start]))
            axes[:, end] = _rotation_from(rest, direction).transpose(0, 2, 1) @ axes[:, end]
    return axes


def torso_axes(joints_m: np.ndarray) -> np.ndarray:
    """(N, 3, 3) rows: the torso's right, down and front."""
    down = _unit((joints_m[:, Joint.RIGHT_HIP] + joints_m[:, Joint.LEFT_HIP]) / 2 - joints_m[:, Joint.NECK])
    right = joints_m[:, [Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP]] - joints_m[:, [Joint.LEFT_SHOULDER, Joint.LEFT_HIP]]
    right = right.sum(axis=1)
    right = _unit(right - (right * down).sum(axis=-1, keepdims=True) * down)
    return np.stack([right, down, np.cross(right, down)], axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """(N, 3) vectors of length 1, NaN for those of length 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _rotation_from(rest: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(N, 3, 3) the smallest rotations that take a (3,) unit vector to (N, 3) unit vectors (Rodrigues)."""
    x, y, z = np.cross(rest, directions).T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    one_plus_cosine = np.maximum(1 + directions @ rest, MIN_ONE_PLUS_COSINE)
    return np.eye(3) + cross + cross @ cross / one_plus_cosine[:, None, None]


def fit_offsets(truth_m: np.ndarray, estimate_m: np.ndarray) -> np.ndarray:
    """(15, 3) median offset of the labels from the estimates, both (N, 15, 3) metres: outward, down and front.

    Medians, so that frames in which the estimate or the label is grossly wrong do not decide. 0 for a joint of which no frame
    has both.
    """
    offsets_m = np.einsum("njab,njb->nja", joint_axes(estimate_m), truth_m.astype(np.float64) - estimate_m)
    fitted_m = np.zeros((NUM_JOINTS, 3))
    for joint in range(NUM_JOINTS):
        both = offsets_m[:, [joint, MIRROR[joint]]].reshape(-1, 3)
        both = both[np.isfinite(both).all(axis=1)]
        if len(both):
            fitted_m[joint] = np.median(both, axis=0)
        if MIRROR[joint] == joint:
            fitted_m[joint, 0] = 0.0
    return fitted_m


def moved(estimate_m: np.ndarray, offsets_m: np.ndarray) -> np.ndarray:
    """(N, 15, 3) the estimates with (15, 3) offsets of `fit_offsets` added; unmoved where their axes are unknown."""
    shift_m = np.einsum("njab,ja->njb", joint_axes(estimate_m), offsets_m)
    return estimate_m + np.where(np.isfinite(shift_m), shift_m, 0.0)


def in_label_definition(truth_m: np.ndarray, estimate_m: np.ndarray, person: np.ndarray) -> np.ndarray:
    """(N, 15, 3) estimates of every person, moved by offsets fitted on the labels of all other people.

    `person` is who is seen in each frame (N,), at least two different people. Joints are in metres, NaN where unknown. Raises
    InputError for one person alone, who has no others.
    """
    people, person = np.unique(person), np.asarray(person)
    if len(people) < 2 or person.shape != (len(estimate_m),):
        raise InputError(f"person of shape {person.shape}: expected a name a frame, of two people or more")
    out = np.empty(estimate_m.shape)
    for one in people:
        own = person == one
        out[own] = moved(estimate_m[own], fit_offsets(truth_m[~own], estimate_m[~own]))
    return out
