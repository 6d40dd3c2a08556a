"""Writes recorded joints to files that `kpopnet.dance.joint_files.reader` and other programs read.

A BVH file gets a skeleton of constant bones in MotionBuilder's names. Directions of limbs and trunk are those of the joints;
lengths of bones are their medians over the recording. How a limb turns about its own axis is not known: each bone is turned as
little as possible from its parent. BVH knows no missing joints: one that is missing is interpolated in time.
"""

import csv
import io
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.bvh import BvhFile, bvh_text
from kpopnet.dance.performance import Performance, check_dance, without_gaps
from kpopnet.errors import InputError
from kpopnet.rotations import conjugate, multiply, rotate
from kpopnet.runtime.atomic_write import write_whole
from kpopnet.runtime.input_files import MAX_JSON_BYTES, as_path
from kpopnet.skeleton import JOINT_NAMES, Joint

SUFFIXES = (".npz", ".json", ".csv", ".bvh")
DIGITS, CONFIDENCE_DIGITS = 4, 3
"""Decimals of metres and of confidence in files of text: a tenth of a millimetre, a thousandth."""

CM_PER_METRE = 100.0
LEFT, UP, DOWN = np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, -1.0, 0])
"""Directions in the axes of BVH files: x to the left of a person who faces z, y up."""

MIN_INTERVAL_S, MAX_INTERVAL_S = 0.001, 1.0
"""Of the frames of a BVH file, of which `kpopnet.dance.joint_files.bvh_motion` reads 1 to 1000 a second."""

HAND_CM, TOE_CM, CROWN_CM = 8.0, 8.0, 12.0
"""Lengths of the bones beyond the last joints, which only draw hands, feet and head."""


def write_performance(path: Path | str, performance: Performance) -> None:
    """Writes a recording; the ending of the file's name gives the format (docs/predicting.md).

    All formats but BVH keep the camera frame: metres, x right, y down, z forward.
    """
    path, _ = as_path(path), check_dance(performance, "the recording to write")
    writers: dict[str, Callable[[Performance], str | bytes]] = dict(zip(SUFFIXES, (_npz, _json, _csv, _bvh), strict=True))
    if (writer := writers.get(path.suffix.lower())) is None:
        raise InputError(f"{path}: expected a name that ends with {', '.join(SUFFIXES)}")
    content = writer(performance)
    content = content.encode() if isinstance(content, str) else content
    if path.suffix.lower() in (".json", ".csv") and (size := len(content)) > MAX_JSON_BYTES:
        raise InputError(f"{path}: {size:,} bytes, more than `kpopnet score` reads; write .npz, or parts of the recording")
    write_whole(path, content)


def _npz(performance: Performance) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(
        stream,
        joints_m=performance.joints_m.astype(np.float32),
        confidence=performance.confidence.astype(np.float32),
        times_s=performance.times_s,
        joint_names=np.array(JOINT_NAMES),
    )
    return stream.getvalue()


def _json(performance: Performance) -> str:
    """One line a frame."""
    lines = [json.dumps(frame, allow_nan=False) for frame in json_frames(performance)]
    frame = "camera: x right, y down, z forward"
    return '{"unit": "metre", "frame": "%s", "frames": [\n%s\n]}\n' % (frame, ",\n".join(lines))  # noqa: UP031 - of braces


def json_frames(performance: Performance) -> Iterator[dict]:
    """The frames for JSON: of each joint x, y, z and confidence, null where it is missing."""
    for time_s, joints, confidence in zip(*_rounded(performance), strict=True):
        named = {name: None if c == 0 else [*point, c] for name, point, c in zip(JOINT_NAMES, joints, confidence, strict=True)}
        yield {"time_s": time_s, "joints": named}


CSV_COLUMNS = ("time_s", *(f"{name}_{part}" for name in JOINT_NAMES for part in ("x", "y", "z", "confidence")))


def _csv(performance: Performance) -> str:
    """A header, then one line a frame."""
    stream = io.StringIO()
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow(CSV_COLUMNS)
    rows.writerows(csv_rows(performance))
    return stream.getvalue()


def csv_rows(performance: Performance) -> Iterator[list]:
    """The cells of CSV_COLUMNS of each frame, empty where a joint is missing."""
    for time_s, joints, confidence in zip(*_rounded(performance), strict=True):
        cells = [["", "", "", 0.0] if c == 0 else [*point, c] for point, c in zip(joints, confidence, strict=True)]
        yield [time_s, *(cell for four in cells for cell in four)]


def _rounded(performance: Performance) -> tuple[list, list, list]:
    """Times, joints and confidence as lists; a joint that was seen keeps a confidence above 0."""
    confidence = np.where(performance.confidence > 0, np.maximum(performance.confidence, 10.0**-CONFIDENCE_DIGITS), 0)
    return (
        np.round(performance.times_s, 6).tolist(),
        np.round(performance.joints_m, DIGITS).tolist(),
        np.round(confidence, CONFIDENCE_DIGITS).tolist(),
    )


def _bvh(performance: Performance) -> str:
    """Centimetres, y up, the camera's side in front, at the median frame rate: BVH knows one interval only."""
    for joint in performance.unseen_joints:
        raise InputError(f"{joint.name.lower()} is missing in every frame; BVH, unlike the other formats, needs it in some")
    points_cm = without_gaps(performance.joints_m, performance.times_s) * [1, -1, -1] * CM_PER_METRE
    bones, root_cm = skeleton(points_cm)
    names = list(bones)
    parents = [names.index(bone.parent) if bone.parent else -1 for bone in bones.values()]
    worlds = np.stack([bone.world for bone in bones.values()], axis=1)
    local = np.concatenate([worlds[:, :1], multiply(conjugate(worlds[:, parents[1:]]), worlds[:, 1:])], axis=1)
    times_s = performance.times_s
    interval_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 1 / 30
    if not MIN_INTERVAL_S <= round(interval_s, 8) <= MAX_INTERVAL_S:  # as the text has it
        raise InputError(
            f"frames are {interval_s:g} s apart, in the median; BVH, unlike the other formats, needs one interval for all, of "
            f"{MIN_INTERVAL_S:g} to {MAX_INTERVAL_S:g} s"
        )
    even_s = times_s[0] + interval_s * np.arange(round((times_s[-1] - times_s[0]) / interval_s) + 1)
    nearest = np.rint(np.interp(even_s, times_s, np.arange(len(times_s)))).astype(int)
    offsets_cm, ends_cm = np.array([(bone.offset_cm, bone.end_cm) for bone in bones.values()]).swapaxes(0, 1)
    return bvh_text(BvhFile(names, parents, offsets_cm, local[nearest], root_cm[nearest], 1 / interval_s), ends_cm)


class PosedBone(NamedTuple):
    """A bone over T frames: parent's name, (3,) offset from it, (T, 4) world rotations, (3,) end if no joint follows."""

    parent: str
    offset_cm: np.ndarray
    world: np.ndarray
    end_cm: np.ndarray = CROWN_CM * UP


def skeleton(points_cm: np.ndarray) -> tuple[dict[str, PosedBone], np.ndarray]:
    """The bones by name, parents before children, and (T, 3) places of the root, in centimetres.

    From (T, 15, 3) points in centimetres, none missing, in the axes of BVH files: x right in the image, y up, z to the camera.
    Raises InputError for points that lie in one place.
    """
    at: Mapping[str, np.ndarray] = {joint.name.lower(): points_cm[:, joint] for joint in Joint}
    hips, chest = (at["left_hip"] + at["right_hip"]) / 2, (at["left_shoulder"] + at["right_shoulder"]) / 2
    pelvis = _facing(at["left_hip"] - at["right_hip"], chest - hips)
    thorax = _facing(at["left_shoulder"] - at["right_shoulder"], chest - hips)
    # The neck's place in the thorax is constant, so that the head's direction from it is exact and its place nearly so.
    neck_cm = np.median(rotate(conjugate(thorax), at["neck"] - chest), axis=0)
    neck_at = chest + rotate(thorax, neck_cm)
    neck = _turned(thorax, UP, at["head"] - neck_at)
    bones = {
        "Hips": PosedBone("", np.zeros(3), pelvis),
        "Spine": PosedBone("Hips", np.zeros(3), _turned(pelvis, UP, chest - hips)),
        "Spine1": PosedBone("Spine", UP * _length(chest - hips), thorax),
        "Neck": PosedBone("Spine1", neck_cm, neck),
        "Head": PosedBone("Neck", UP * _length(at["head"] - neck_at), neck),
    }
    limbs = (
        (("shoulder", "elbow", "hand"), ("Arm", "ForeArm", "Hand"), "Spine1", thorax, HAND_CM),
        (("hip", "knee", "foot"), ("UpLeg", "Leg", "Foot"), "Hips", pelvis, TOE_CM),
    )
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for joints, names, parent, base, end_cm in limbs:
            first, second, third = (at[f"{side.lower()}_{joint}"] for joint in joints)
            half_cm = _length(at[f"left_{joints[0]}"] - at[f"right_{joints[0]}"]) / 2
            rest = sign * LEFT if parent == "Spine1" else DOWN  # direction of the limb in the rest pose
            upper = _turned(base, rest, second - first)
            lower = _turned(upper, rest, third - second)
            bones[side + names[0]] = PosedBone(parent, sign * half_cm * LEFT, upper)
            bones[side + names[1]] = PosedBone(side + names[0], rest * _length(second - first), lower)
            bones[side + names[2]] = PosedBone(side + names[1], rest * _length(third - second), lower, end_cm * rest)
    return bones, hips


def _length(vectors: np.ndarray) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=-1)))


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; where one is (nearly) zero, the last that is not."""
    lengths = np.linalg.norm(vectors, axis=-1)
    good = lengths > 1e-6
    if not good.any():
        raise InputError("hips or shoulders, or two joints of a limb, lie in one point in every frame: no skeleton for BVH")
    last = np.maximum.accumulate(np.where(good, np.arange(len(good)), -1))
    last = np.where(last < 0, np.argmax(good), last)
    return vectors[last] / lengths[last, None]


def _facing(left: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(T, 4) rotations whose x axis points to the left exactly, and whose y axis is as near to `up` as that allows."""
    x = _unit(left)
    z = _unit(np.cross(x, up))
    axes = np.stack([x, np.cross(z, x), z], axis=-1)
    return Rotation.from_matrix(axes).as_quat(scalar_first=True)


def _turned(base: np.ndarray, rest: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(T, 4) world rotations that take `rest` to a direction, turned as little as possible from those of the parent."""
    start, end = rotate(base, np.broadcast_to(rest, direction.shape)), _unit(direction)
    cosine = np.einsum("ti,ti->t", start, end)
    swing = np.concatenate([1 + cosine[:, None], np.cross(start, end)], axis=1)
    opposite = cosine < -1 + 1e-9
    if opposite.any():  # half a turn about any axis across the limb
        across = np.cross(start[opposite], np.where(np.abs(start[opposite, :1]) < 0.9, LEFT, UP))
        swing[opposite] = np.concatenate([np.zeros((len(across), 1)), across], axis=1)
    return multiply(swing / np.linalg.norm(swing, axis=1, keepdims=True), base)
