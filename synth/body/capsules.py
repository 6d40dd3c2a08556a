"""Collision capsules of a person for MuJoCo's self-collision test, and the pairs that may overlap."""

import numpy as np

from synth.body.asset import BodyAsset
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


class Capsules:
    """Fits the C capsules of `CAPSULES` to a person.

    Attributes:
        names: names of the C bones.
        bones: (C,) indices of the C bones.
    """

    def __init__(self, asset: BodyAsset) -> None:
        self.names = tuple(CAPSULES)
        self.bones = np.array([asset.bone(name) for name in CAPSULES])
        self._ends = np.array([asset.bone(end) for end, _ in CAPSULES.values()])
        self._shares = np.array([share for _, share in CAPSULES.values()])
        self._trunk = np.isin(self.names, TRUNK)
        self._head = self.names.index("Head")
        # A body part is the set of vertices whose largest skinning weight is that of its bone.
        parts = [np.flatnonzero(asset.weight_bones[:, 0] == bone) for bone in self.bones]
        assert all(len(part) for part in parts)
        self._vertices = np.concatenate(parts)
        self._counts = np.array([len(part) for part in parts])
        self._starts = np.cumsum(self._counts) - self._counts

    def fit(self, person: Person) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Radius (C,) and half length (C,), and centre (C, 3) and unit axis (C, 3) in the frame of each bone, metres."""
        part = person.bare_m[self._vertices].astype(float)
        middle = np.add.reduceat(part, self._starts) / self._counts[:, None]
        half = (np.maximum.reduceat(part, self._starts) - np.minimum.reduceat(part, self._starts)) / 2
        begin, end = person.heads_m[self.bones].astype(float), person.heads_m[self._ends].astype(float)
        # The spine runs along the back and the trunk is wide: the trunk's capsules lie across the body, through its middle.
        across = np.zeros_like(middle)
        across[:, 0] = np.maximum(half[:, 0] - half[:, 1], 0.01) * self._shares
        trunk = self._trunk[:, None]
        begin, end = np.where(trunk, middle - across, begin), np.where(trunk, middle + across, end)
        begin[self._head] = middle[self._head] - (0, 0, HEAD_HALF_LENGTH_M)
        end[self._head] = middle[self._head] + (0, 0, HEAD_HALF_LENGTH_M)

        axis = end - begin
        length = np.sqrt((axis**2).sum(1))
        axis /= length[:, None]
        capsule = np.repeat(np.arange(len(self.bones)), self._counts)
        radial = part - begin[capsule]
        radial -= (radial * axis[capsule]).sum(1, keepdims=True) * axis[capsule]
        distance = np.sqrt((radial**2).sum(1))
        radius = self._shares * np.add.reduceat(distance, self._starts) / self._counts
        to_bone = person.t_pose[self.bones]
        centre = np.einsum("cij,cj->ci", to_bone, (begin + end) / 2 - person.heads_m[self.bones])
        return radius, np.maximum((length - radius) / 2, 0.005), centre, np.einsum("cij,cj->ci", to_bone, axis)

    def may_touch(self, asset: BodyAsset) -> np.ndarray:
        """(C, C) bool: pairs with at most two joints between them, and pairs that are in contact in ordinary poses."""
        parents = asset.bone_parents
        may = np.array([[_joints_between(a, b, parents) <= 2 for b in self.bones] for a in self.bones])

        def allow(one: str, *others: str) -> None:
            for other in others:
                a, b = self.names.index(one), self.names.index(other)
                may[a, b] = may[b, a] = True

        for name in (*TRUNK, "Head"):
            allow(name, *TRUNK)
        for side in ("Left", "Right"):
            allow(f"{side}Arm", "Spine1", "Spine", "Head")
            allow(f"{side}UpLeg", *TRUNK, "LeftUpLeg", "RightUpLeg")
            allow(f"{side}Leg", "Hips")
        return may


def _joints_between(a: int, b: int, parents: np.ndarray) -> int:
    """Number of joints on the path from bone a to bone b in the bone tree."""
    to_root = [a], [b]
    for line in to_root:
        while parents[line[-1]] >= 0:
            line.append(int(parents[line[-1]]))
    common = next(bone for bone in to_root[0] if bone in to_root[1])
    return to_root[0].index(common) + to_root[1].index(common)
