"""Collision capsules of a person for MuJoCo's self-collision test, and the pairs that may overlap."""

import numpy as np
from scipy.sparse.csgraph import shortest_path

from synth.body.asset import load_body
from synth.body.shape import Person

_LIMBS = {
    "Arm": ("ForeArm", 0.8),
    "ForeArm": ("Hand", 0.8),
    "Hand": ("HandFinger1", 0.6),
    "UpLeg": ("Leg", 0.75),
    "Leg": ("Foot", 0.75),
    "Foot": ("ToeBase", 0.7),
}
CAPSULES = {
    "Hips": ("LowerBack", 0.8),
    "LowerBack": ("Spine", 0.8),
    "Spine": ("Spine1", 0.8),
    "Spine1": ("Neck", 0.8),
    "Head": ("Head", 0.8),
    **{side + bone: (side + end, share) for side in ("Left", "Right") for bone, (end, share) in _LIMBS.items()},
}
"""Bone: the bone whose head is the capsule's far end, and the radius as a fraction of the body part's mean radius. The capsules
are thin enough that touching clothes and flesh are no collision."""

TRUNK = ("Hips", "LowerBack", "Spine", "Spine1")
HEAD_HALF_LENGTH_M = 0.04


_ASSET = load_body()
BONES = np.array([_ASSET.bone(name) for name in CAPSULES])
"""(C,) bone of each capsule."""

_NAMES = tuple(CAPSULES)
_ENDS = np.array([_ASSET.bone(end) for end, _ in CAPSULES.values()])
_SHARES = np.array([share for _, share in CAPSULES.values()])
_IS_TRUNK, _HEAD = np.isin(_NAMES, TRUNK)[:, None], _NAMES.index("Head")
# A body part is the set of vertices whose largest skinning weight is that of its bone.
_PARTS = [np.flatnonzero(_ASSET.weight_bones[:, 0] == bone) for bone in BONES]
_COUNTS = np.array([len(part) for part in _PARTS])
_STARTS = np.cumsum(_COUNTS) - _COUNTS


def fit_capsules(person: Person) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Radius (C,) and half length (C,), and centre (C, 3) and unit axis (C, 3) in the frame of each bone, metres."""
    part = person.bare_m[np.concatenate(_PARTS)].astype(float)
    middle = np.add.reduceat(part, _STARTS) / _COUNTS[:, None]
    half = (np.maximum.reduceat(part, _STARTS) - np.minimum.reduceat(part, _STARTS)) / 2
    begin, end = person.heads_m[BONES].astype(float), person.heads_m[_ENDS].astype(float)
    # The spine runs along the back and the trunk is wide: the trunk's capsules lie across the body, through its middle.
    across = np.zeros_like(middle)
    across[:, 0] = np.maximum(half[:, 0] - half[:, 1], 0.01) * _SHARES
    begin, end = np.where(_IS_TRUNK, middle - across, begin), np.where(_IS_TRUNK, middle + across, end)
    begin[_HEAD] = middle[_HEAD] - (0, 0, HEAD_HALF_LENGTH_M)
    end[_HEAD] = middle[_HEAD] + (0, 0, HEAD_HALF_LENGTH_M)

    axis = end - begin
    length = np.sqrt((axis**2).sum(1))
    axis /= length[:, None]
    capsule = np.repeat(np.arange(len(BONES)), _COUNTS)
    radial = part - begin[capsule]
    radial -= (radial * axis[capsule]).sum(1, keepdims=True) * axis[capsule]
    distance = np.sqrt((radial**2).sum(1))
    radius = _SHARES * np.add.reduceat(distance, _STARTS) / _COUNTS
    to_bone = person.t_pose[BONES]
    centre = np.einsum("cij,cj->ci", to_bone, (begin + end) / 2 - person.heads_m[BONES])
    return radius, np.maximum((length - radius) / 2, 0.005), centre, np.einsum("cij,cj->ci", to_bone, axis)


def may_touch() -> np.ndarray:
    """(C, C) bool: pairs with at most two joints between them, and pairs that are in contact in ordinary poses."""
    tree = np.zeros((len(_ASSET.bone_names),) * 2)
    tree[np.arange(1, len(tree)), _ASSET.bone_parents[1:]] = 1
    may = shortest_path(tree, directed=False)[np.ix_(BONES, BONES)] <= 2
    allowed = [(name, *TRUNK) for name in (*TRUNK, "Head")]
    for side in ("Left", "Right"):
        allowed.append((f"{side}Arm", "Spine1", "Spine", "Head"))
        allowed.append((f"{side}UpLeg", *TRUNK, "LeftUpLeg", "RightUpLeg"))
        allowed.append((f"{side}Leg", "Hips"))
    for one, *others in allowed:
        a, b = _NAMES.index(one), [_NAMES.index(other) for other in others]
        may[a, b] = may[b, a] = True
    return may
