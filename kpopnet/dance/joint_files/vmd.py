"""MikuMikuDance's motions, .vmd: key frames of bones by their Japanese names, on the mean adult of this project.

Between two keys the later one's Bezier curves say how far each axis and the rotation have come. Legs follow the bones 足ＩＫ
and つま先ＩＫ where the file moves these and does not switch them off: in closed form, the knee bent about its own axis and the
thigh turned by the smallest rotation, where MikuMikuDance iterates. A model's arms hang STANCE_RAD below the horizontal; it is
20 units tall. The file's axes are left-handed: x the model's left, y up, z its back.
"""

import struct
import unicodedata
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.bones import (
    MEAN_ADULT_M,
    chain,
    joint_positions_m,
    skeleton_points,
    with_torso,
    world_rotations,
)
from kpopnet.dance.joint_files.points import NamedPoints
from kpopnet.errors import InputError
from kpopnet.rotations import rotate
from kpopnet.runtime.input_files import check_budget, expect, names_in, parsing, read_with

FPS = 30.0
UNIT_M = 1.693 / 20
"""Metres of a unit: the height of the mean adult is that of the usual model, 20 units."""

STANCE_RAD = np.deg2rad(35)
"""Models differ by some degrees from each other."""

_KEY = np.dtype([("bone", "S15"), ("frame", "<u4"), ("place", "<f4", 3), ("quat", "<f4", 4), ("curves", "u1", 64)])
_OTHER_BYTES = (23, 61, 28, 9)
"""Size of a key of the face, the camera, the light and the shadow, which follow the bones' in this order."""

_FLOOR_M = MEAN_ADULT_M["LeftFoot"][1] - 0.076
_TRUNK = {
    "全ての親": ("", (0, _FLOOR_M, 0)), "センター": ("全ての親", (0, _FLOOR_M + 8 * UNIT_M, 0)),
    "グルーブ": ("センター", "Hips"),
    "腰": ("グルーブ", "Hips"), "下半身": ("腰", "LowerBack"), "上半身": ("腰", "LowerBack"), "上半身2": ("上半身", "Spine"),
    "首": ("上半身2", "Neck"), "頭": ("首", "Head"),
}  # fmt: skip
_LIMBS = {
    "肩P": ("上半身2", "Shoulder"), "肩": ("肩P", "Shoulder"), "肩C": ("肩", "Arm"), "腕": ("肩C", "Arm"),
    "腕捩": ("腕", "ForeArm"), "ひじ": ("腕捩", "ForeArm"), "手捩": ("ひじ", "Hand"), "手首": ("手捩", "Hand"),
    "腰キャンセル": ("下半身", "UpLeg"), "足": ("腰キャンセル", "UpLeg"), "ひざ": ("足", "Leg"), "足首": ("ひざ", "Foot"),
    "つま先": ("足首", "ToeBase"), "足IK親": ("全ての親", "Sole"), "足IK": ("足IK親", "Foot"),
    "つま先IK": ("足IK", "ToeBase"),
}  # fmt: skip
_TREE = _TRUNK | {
    side + bone: (side + parent if parent in _LIMBS else parent, english + place)
    for side, english in (("左", "Left"), ("右", "Right"))
    for bone, (parent, place) in _LIMBS.items()
}
"""Bones of the usual models: the parent, and where on the mean adult they begin."""

_NAMES = tuple(_TREE)
_PARENTS = tuple(_NAMES.index(parent) if parent else -1 for parent, _ in _TREE.values())
_FOUND = {
    place: number for number, (_, place) in enumerate(_TREE.values()) if isinstance(place, str) and "IK" not in _NAMES[number]
}


def _rest_m() -> np.ndarray:
    """(J, 3) positions of the bones in the stance of a model."""
    places = dict(MEAN_ADULT_M)
    for side, down in (("Left", -STANCE_RAD), ("Right", STANCE_RAD)):
        for part in ("ForeArm", "Hand"):
            arm_m = MEAN_ADULT_M[f"{side}Arm"]
            places[side + part] = arm_m + Rotation.from_euler("z", down).apply(MEAN_ADULT_M[side + part] - arm_m)
        places[f"{side}Sole"] = np.array([MEAN_ADULT_M[f"{side}Foot"][0], _FLOOR_M, MEAN_ADULT_M[f"{side}Foot"][2]])
    return np.array([places[place] if isinstance(place, str) else place for _, place in _TREE.values()], float)


def read_vmd(path: Path) -> NamedPoints:
    """The joints of a motion, metres, y up; raises InputError if it is damaged or moves no arms, as a camera's."""
    with parsing(path, "not a readable .vmd file"):
        keys, switches = _read(path)
        if missing := [name for name in ("左腕", "右腕") if name not in keys]:
            raise InputError(f"{path}: no keys of the bones {', '.join(missing)}; it moves {names_in(keys) or 'no bones'}")
        frames = int(max(key["frame"][-1] for key in keys.values())) + 1
        check_budget(path, frames * len(_NAMES) * 250, f"{frames} frames of {len(_NAMES)} bones")
        quats, places_m = np.zeros((frames, len(_NAMES), 4)), np.zeros((frames, len(_NAMES), 3))
        quats[..., 0] = 1
        for bone, name in enumerate(_NAMES):
            if name in keys:
                quats[:, bone], places_m[:, bone] = _sampled(keys[name], frames)
        for side in "左右":  # 肩P moves the shoulder without turning the arm, 腰 the hip without the leg: these take it back
            for cancel, turned in ((side + "肩C", side + "肩P"), (side + "腰キャンセル", "腰")):
                quats[:, _NAMES.index(cancel)] = quats[:, _NAMES.index(turned)] * [1, -1, -1, -1]
        rotated, (found, rest_m, parents) = world_rotations(quats, _PARENTS), with_torso(_FOUND, _rest_m(), _PARENTS)
        positions_m = joint_positions_m(rotated, places_m[:, 0], rest_m, parents)
        for bone, parent in enumerate(_PARENTS[1:], 1):  # by what a bone moves itself, all below it move
            below = [one for one in range(bone, len(parents)) if bone in chain(one, parents)]
            positions_m[:, below] += rotate(rotated[:, parent], places_m[:, bone])[:, None]
        for side in "左右":
            moved = side + "足IK" in keys or side + "足" not in keys
            on = np.full(frames, moved)
            for frame, switched_on in sorted(switches.get(side + "足IK", [])):
                on[frame:] = moved and switched_on
            _follow(side, positions_m, rotated, rest_m, on)
        return skeleton_points(found, positions_m, fps=FPS)


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, list[tuple[int, bool]]]]:
    """The keys of each bone in the order of time, in 32-bit numbers, and when each IK is switched on and off."""
    data, place = read_with(Path.read_bytes, path, "cannot be read"), 0

    def take(form: str) -> tuple:
        nonlocal place
        expect(place + struct.calcsize(form) <= len(data), str(path), f"more than {len(data)} bytes; the file is truncated")
        place += struct.calcsize(form)
        return struct.unpack_from(form, data, place - struct.calcsize(form))

    (magic,) = take("<30s")
    expect(magic[:21] == b"Vocaloid Motion Data ", str(path), 'a motion that begins with "Vocaloid Motion Data"')
    take("<10s" if magic[21:25] == b"file" else "<20s")
    (count,) = take("<I")
    start = place
    take(f"<{count * _KEY.itemsize}x")
    stored = np.frombuffer(data, _KEY, count, start)
    fits = (np.abs(stored["place"]) < 1e5).all() and (np.abs(stored["quat"]) < 1e5).all()
    expect(bool(fits), str(path), "keys of numbers below 100000")
    raw, number = np.unique(stored["bone"], return_inverse=True)
    names = np.array([_text(one) for one in raw], object)[number]  # what follows the end of a name is of no meaning
    keys: dict[str, np.ndarray] = {}
    for name in dict.fromkeys(names):
        own = stored[names == name]
        keys[name] = own[len(own) - 1 - np.unique(own["frame"][::-1], return_index=True)[1]]  # the last of a frame
    for size in _OTHER_BYTES:
        if place == len(data):
            return keys, {}
        (count,) = take("<I")
        take(f"<{count * size}x")
    switches: dict[str, list[tuple[int, bool]]] = {}
    for _ in range(take("<I")[0] if place < len(data) else 0):
        frame, _, count = take("<IBI")
        for _ in range(count):
            name, on = take("<20sB")
            switches.setdefault(_text(name), []).append((frame, bool(on)))
    return keys, switches


def _text(name: bytes) -> str:
    return unicodedata.normalize("NFKC", name.split(b"\0")[0].decode("cp932", errors="replace"))


def _sampled(keys: np.ndarray, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """(T, 4) rotations, w first, and (T, 3) metres of a bone, right-handed with z in front."""
    times = np.clip(np.arange(frames), keys["frame"][0], keys["frame"][-1])
    after = np.searchsorted(keys["frame"], times)
    before = np.maximum(after - 1, 0)
    span = np.maximum(keys["frame"][after].astype(float) - keys["frame"][before], 1)
    x = np.where(after == before, 0, (times - keys["frame"][before]) / span)[:, None]
    # x1, y1, x2, y2, each of x, y, z and the rotation. Of the first row newer programs overwrite bytes 2 and 3; the second
    # row repeats all but byte 0.
    curves = keys["curves"][:, [0, *range(16, 31)]].reshape(-1, 4, 4)[after] / 127
    low, high = np.zeros((frames, 4)), np.ones((frames, 4))
    for _ in range(24):
        t = (low + high) / 2
        less = 3 * t * (1 - t) ** 2 * curves[:, 0] + 3 * t**2 * (1 - t) * curves[:, 2] + t**3 < x
        low, high = np.where(less, t, low), np.where(less, high, t)
    y = 3 * low * (1 - low) ** 2 * curves[:, 1] + 3 * low**2 * (1 - low) * curves[:, 3] + low**3
    first, last = (Rotation.from_quat(keys["quat"][one] * [-1.0, -1, 1, 1]) for one in (before, after))
    quats = first * Rotation.from_rotvec(y[:, 3:] * (first.inv() * last).as_rotvec())
    places = keys["place"][before] + y[:, :3] * (keys["place"][after] - keys["place"][before])
    return quats.as_quat(scalar_first=True), UNIT_M * places * [1, 1, -1]


def _follow(side: str, positions_m: np.ndarray, rotated: np.ndarray, rest_m: np.ndarray, on: np.ndarray) -> None:
    """Moves knee, ankle and toes of (T, J, 3) positions to where the IK bones are, in the frames where they are on."""
    hip, knee, ankle, toe, goal, toe_goal = (
        _NAMES.index(side + bone) for bone in ("足", "ひざ", "足首", "つま先", "足IK", "つま先IK")
    )
    thigh, shin, foot = (float(np.linalg.norm(rest_m[a] - rest_m[b])) for a, b in ((hip, knee), (knee, ankle), (ankle, toe)))
    way_m = positions_m[:, goal] - positions_m[:, hip]
    far_m = np.linalg.norm(way_m, axis=-1).clip(abs(thigh - shin) + 1e-6, thigh + shin - 1e-6)
    cos = (far_m**2 - thigh**2 - shin**2) / (2 * thigh * shin)
    straight = np.zeros_like(way_m)
    straight[:, 1] = -1
    bent_m = thigh * straight + shin * np.stack([0 * cos, -cos, -np.sqrt(1 - cos**2)], axis=-1)
    way, was = _unit(way_m), _unit(rotate(rotated[:, hip], bent_m))
    axis = np.cross(was, way)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    turn = Rotation.from_rotvec(axis / np.maximum(sine, 1e-9) * np.arctan2(sine, (was * way).sum(axis=-1, keepdims=True)))
    knee_m = positions_m[:, hip] + thigh * turn.apply(rotate(rotated[:, hip], straight))
    ankle_m = positions_m[:, hip] + far_m[:, None] * way
    toe_m = ankle_m + foot * _unit(positions_m[:, toe_goal] - ankle_m)
    for bone, place_m in ((knee, knee_m), (ankle, ankle_m), (toe, toe_m)):
        positions_m[on, bone] = place_m[on]


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
