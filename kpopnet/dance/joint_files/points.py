"""Recorded 3D points with names, of COCO, Kinect, ImperialDance or our own, as the fifteen joints of a performance.

The torso is that of the file, where it names one, else the mean of shoulders and hips, as in the paper (section 2.3). The unit
(metres, centimetres or millimetres) and the vertical axis (y or z, up or down) are inferred from the dancer's trunk. The whole
sequence is rotated about the vertical axis so that the dancer faces the camera on average over the first twentieth of the
frames.
"""

import re
from collections.abc import Collection, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.dance.performance import MAX_COORDINATE, Performance, check_rate, with_derived_torso
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import as_path, check_fields, expect, names_in, read_json
from kpopnet.skeleton import NUM_JOINTS, Joint

CAMERA_DISTANCE_M, CAMERA_HEIGHT_M = 2.5, 1.0
"""Position of the virtual level camera of motion-capture joints: distance to the dancer's start, and height above the floor."""

COCO_NAMES = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
    "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle",
)  # fmt: skip
"""The keypoints in COCO's order."""

MEDIAPIPE_NAMES = (
    "nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer", "left_ear",
    "right_ear", "mouth_left", "mouth_right", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist",
    "right_wrist", "left_pinky", "right_pinky", "left_index", "right_index", "left_thumb", "right_thumb", "left_hip",
    "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "left_heel", "right_heel", "left_foot_index",
    "right_foot_index",
)  # fmt: skip
"""MediaPipe's pose landmarks in their order."""

IMPERIAL_NAMES = (
    "right_knee", "right_toe", "right_hip", "left_hip", "left_foot", "right_clavicle", "left_hand", "right_hand", "left_elbow",
    "left_clavicle", "right_foot", "neck", "left_knee", "chest", "head", "left_toe", "abdomen", "right_shoulder",
    "left_shoulder", "pelvis", "right_elbow",
)  # fmt: skip
"""ImperialDance's points in their order. Its files name them by the segment that begins there: RShin, RToe, RThigh ..."""

_POINTS = {
    Joint.HEAD: (("head",), ("leftear", "rightear"), ("nose",)),
    Joint.NECK: (("neck",), ("shouldercenter",), ("spineshoulder",)),
    Joint.TORSO: (("torso",), ("spinemid",), ("spinenavel",), ("spinenaval",)),
} | {
    Joint[f"{side.upper()}_{part}"]: tuple(tuple(side + word for word in words) for words in alternatives)
    for part, alternatives in {
        "SHOULDER": (("shoulder",), ("sjc",)),
        "ELBOW": (("elbow",), ("ejc",)),
        "HAND": (("hand",), ("wrist", "index", "pinky"), ("wrist",), ("wjc",)),
        "HIP": (("hip",), ("hjc",)),
        "KNEE": (("knee",), ("kjc",)),
        "FOOT": (("ankle", "foot"), ("ankle", "footindex"), ("ankle",), ("foot",), ("ajc",)),
    }.items()
    for side in ("right", "left")
}
"""Points whose mean is a joint, by their plain names, the best choice first: names of our own, COCO, ImperialDance, Kinect v1,
v2 and Azure, and of joint centres as Vicon's and OpenSim's models write them (LHJC). Our hand is the middle of the palm, our
foot lies half-way from the ankle to the toes."""

_SIDED = "shoulder|elbow|wrist|hand|hip|knee|ankle|foot|ear|[sewhka]jc"

NECK_FRACTION_TO_EARS = 0.37
"""Position of the neck on the line from the middle of the shoulders (0) to the middle of the ears (1), on synth's mean adult;
the trackers' neck fractions end at the head joint."""

OPTIONAL = {Joint.HEAD, Joint.NECK, Joint.TORSO}
"""Joints that a recording may lack."""

_SHOULDERS, _HIPS = [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER], [Joint.RIGHT_HIP, Joint.LEFT_HIP]

_UNITS_M, _TRUNK_RANGE_M = (1.0, 0.01, 0.001), (0.25, 0.9)

_TO_Y_UP = {
    (1, True): np.diag([1.0, 1.0, 1.0]),
    (1, False): np.diag([1.0, -1.0, -1.0]),
    (2, True): np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    (2, False): np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Rotations to y up from the axis that is vertical, 1 for y and 2 for z, and whether it points up."""


class NamedPoints(NamedTuple):
    """A recording of P named points; None for what the file does not state."""

    names: Sequence[str]
    points: np.ndarray  # (T, P, 3) in metres, centimetres or millimetres, y or z up or down; NaN where missing
    times_s: np.ndarray | None = None  # (T,) seconds
    confidence: np.ndarray | None = None  # (T, P) in 0..1; None for 1
    fps: float | None = None
    image: np.ndarray | None = None  # (T, P, 2) where the points are in a picture, shares of its width and height
    places: dict[Joint, list[int]] | None = None  # the points whose mean is each joint, if not those that the names tell


def named_performances(group: Sequence[tuple[NamedPoints, str]], fps: float | None = None) -> list[Performance]:
    """The fifteen joints of dancers recorded in one frame: all before one level camera, which the first faces at first.

    Each recording stands with its name for messages; `fps` is the true rate of those that state none or a wrong one.
    """
    found, (first, _) = [], named_joints(*group[0])
    for recorded, source in group:
        joints, confidence = named_joints(recorded, source)
        times_s = frame_times_s(len(joints), recorded.times_s, recorded.fps, fps, source)
        found.append(checked_performance(_before_level_camera_m(joints, first, source), times_s, confidence, source))
    return found


def named_joints(recorded: NamedPoints, source: str) -> tuple[np.ndarray, np.ndarray]:
    """The (T, 15, 3) joints of a recording, in its unit and frame, and their (T, 15) confidence, that of the least sure point.

    Raises InputError, which names the recording as `source`, where a joint has no point.
    """
    places = recorded.places or _joint_places(recorded.names, source)
    points = np.where(np.isfinite(recorded.points), recorded.points, np.nan)
    joints = np.full((len(points), NUM_JOINTS, 3), np.nan)
    confidence = np.ones((len(points), NUM_JOINTS))
    for joint, columns in places.items():
        joints[:, joint] = points[:, columns].mean(axis=1)
        if recorded.confidence is not None:
            confidence[:, joint] = recorded.confidence[:, columns].min(axis=1)
    if Joint.NECK not in places:
        middle = joints[:, _SHOULDERS].mean(axis=1)
        joints[:, Joint.NECK] = middle + NECK_FRACTION_TO_EARS * (joints[:, Joint.HEAD] - middle)
        confidence[:, Joint.NECK] = confidence[:, [*_SHOULDERS, Joint.HEAD]].min(axis=1)
    if not np.isfinite(joints[:, Joint.TORSO]).any():
        joints, confidence = with_derived_torso(joints, confidence)
    return joints, confidence


def _joint_places(names: Sequence[str], source: str, known_already: Collection[Joint] = ()) -> dict[Joint, list[int]]:
    """Indices of the points whose mean is each joint, but for those that are known already."""
    by_name: dict[str, int] = {}
    for number, name in enumerate(names):
        by_name.setdefault(plain_name(name), number)
    found: dict[Joint, list[int]] = {}
    for joint, alternatives in _POINTS.items():
        if joint in known_already:
            continue
        known = next((words for words in alternatives if all(word in by_name for word in words)), None)
        if known:
            found[joint] = [by_name[word] for word in known]
    used = {plain_name(names[number]) for numbers in found.values() for number in numbers}
    subjects = {name.rpartition(":")[0].strip() for name in names if ":" in name and plain_name(name) in used}
    if len(subjects) > 1:
        raise InputError(
            f"{source}: points of {names_in(sorted(subjects))}; expected one person: give each a file of their own"
        )
    needed = _POINTS.keys() - {*OPTIONAL, *known_already, *found}
    missing = [joint.name.lower() for joint in _POINTS if joint in needed]
    if missing:
        raise InputError(
            f"{source}: no point for {', '.join(missing)}; it names {names_in(names) or 'none'}. Expected the names of "
            "COCO, of a Kinect, of joint centres or of kpopnet.skeleton.Joint, or --joint-map"
        )
    return found


def with_joint_map(recorded: NamedPoints, joint_map: Path | str, source: str) -> NamedPoints:
    """A recording with places of joints: each the mean of the points that a JSON file gives for it, by name or number.

    Joints that the map leaves out are found by the recording's own names, and all are where it has none of the map's points.
    Raises InputError if it has only some of them, or the map is wrong.
    """
    given, where = read_json(as_path(joint_map)), str(joint_map)
    check_fields(where, given, {})
    known = [joint.name.lower() for joint in _POINTS]
    expect(
        bool(given) and given.keys() <= set(known), where, f"an object of {', '.join(known)}, found {names_in(given) or 'none'}"
    )
    points = {joint: [str(one) for one in (words if isinstance(words, list) else [words])] for joint, words in given.items()}
    for joint, words in points.items():
        expect(bool(words), where, f"a point, or more, for {joint}")
    wanted, own = {word for words in points.values() for word in words}, [name.strip() for name in recorded.names]
    missing = [word for word in sorted(wanted) if word not in own]
    if len(missing) == len(wanted):
        return recorded
    expect(not missing, source, f"the points {names_in(missing)} of {where}; it names {names_in(own)}")
    places = {Joint[joint.upper()]: [own.index(word) for word in words] for joint, words in points.items()}
    return recorded._replace(places=places | _joint_places(recorded.names, source, places))


@lru_cache(maxsize=1024)
def plain_name(name: str) -> str:
    """A name without case, separators and subject, its side in front: WRIST_LEFT, LeftWrist and ann:lWrist are leftwrist."""
    words = re.sub(r"[^a-z0-9]", "", name[:100].rsplit(":", maxsplit=1)[-1].lower())
    if match := re.fullmatch(rf"(left|right|l|r)({_SIDED})|({_SIDED})(left|right|l|r)", words):
        side = match[1] or match[4]
        return {"l": "left", "r": "right"}.get(side, side) + (match[2] or match[3])
    return words


def frame_times_s(
    frames: int, times_s: np.ndarray | None, stated_fps: float | None, fps: float | None, source: str
) -> np.ndarray:
    """(T,) times of a recording's frames in seconds: those of the file, or of the stated rate.

    With a true rate `fps` those of the file are stretched to it in the median; they begin where they did.
    """
    if fps is None and times_s is not None:
        return times_s
    rate = stated_fps if fps is None else fps
    if rate is None:
        raise InputError(
            f"{source}: states neither times nor a frame rate; give its frames per second (--teacher-fps or --learner-fps of "
            "kpopnet score, --fps of kpopnet convert and of kpopnet teach add)"
        )
    if not 1 <= rate <= 1000:
        raise InputError(f"{source}: {rate:g} frames a second; expected 1 to 1000")
    if times_s is not None and len(times_s) > 1 and (step_s := np.median(np.diff(times_s))) > 0:
        return times_s[0] + (times_s - times_s[0]) / (rate * step_s)
    return np.arange(frames) / rate


def checked_performance(
    joints_m: np.ndarray, times_s: np.ndarray, confidence: np.ndarray | None, source: str, estimator: str = "none"
) -> Performance:
    """A performance of a rate that can be compared, each of whose joints, but for head and neck, which the paper's feature does
    not use, is seen somewhere.
    """
    try:
        performance = check_rate(Performance(joints_m, times_s, confidence, estimator))
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    unseen = [joint.name.lower() for joint in performance.unseen_joints if joint not in (Joint.HEAD, Joint.NECK)]
    if unseen:
        raise InputError(f"{source}: {', '.join(unseen)} missing in every frame; expected each joint in some")
    return performance


def unit_m(joints: np.ndarray, source: str) -> float:
    """The unit in metres of (T, 15, 3) joints, by the median length of their trunks; 1 if no trunk is whole."""
    trunk = _trunks(joints)
    lengths = np.linalg.norm(trunk[np.isfinite(trunk).all(axis=1)], axis=1)
    if not len(lengths):
        return 1.0
    length = float(np.median(lengths))
    unit = next((unit for unit in _UNITS_M if _TRUNK_RANGE_M[0] < unit * length < _TRUNK_RANGE_M[1]), None)
    if unit is None:
        raise InputError(
            f"{source}: hips and shoulders are {length:g} apart, which is not a person's trunk in metres, centimetres or "
            "millimetres"
        )
    return unit


def _trunks(joints: np.ndarray) -> np.ndarray:
    """(T, 3) vectors from the middle of the hips to the middle of the shoulders of (T, 15, 3) joints."""
    return joints[:, _SHOULDERS].mean(axis=1) - joints[:, _HIPS].mean(axis=1)


def upright(joints: np.ndarray, source: str) -> tuple[float, np.ndarray]:
    """The unit in metres of (T, 15, 3) joints, and the (3, 3) matrix that they are multiplied by, on its left, to be y up.

    They are in metres, centimetres or millimetres, in a right-handed frame whose y or z points up or down.
    """
    trunk = _trunks(checked_size(joints, source))
    valid = np.isfinite(trunk.sum(axis=1))
    if not valid.any():
        raise InputError(f"{source}: no frame has both shoulders and both hips")
    mean = trunk[valid].mean(axis=0)
    axis = 1 + int(abs(mean[2]) > abs(mean[1]))
    if abs(mean[axis]) < 0.5 * np.median(np.linalg.norm(trunk[valid], axis=1)):
        raise InputError(f"{source}: neither y nor z points up or down along the dancer's trunk")
    return unit_m(joints, source), _TO_Y_UP[axis, bool(mean[axis] > 0)].T


def checked_size(joints: np.ndarray, source: str) -> np.ndarray:
    """The joints; raises InputError if one is too far away."""
    largest = np.max(np.abs(joints), initial=0, where=np.isfinite(joints))
    if not largest <= MAX_COORDINATE:
        raise InputError(f"{source}: a coordinate of {largest:g}; expected at most {MAX_COORDINATE:g} millimetres")
    return joints


def _before_level_camera_m(joints: np.ndarray, first: np.ndarray, source: str) -> np.ndarray:
    """(T, 15, 3) float32 joints in metres before a level camera (x right, y down, z forward).

    The (T, 15, 3) given ones are in metres, centimetres or millimetres, in a right-handed frame whose y or z points up or down.
    The camera stands before the dancer whose joints are the `first` ones, in the same unit and frame.
    """
    unit, to_y_up = upright(first, source)
    if unit_m(checked_size(joints, source), source) != unit:
        raise InputError(f"{source}: in another unit than the first dancer's file; dancers of a group share one frame")
    first_m, joints_m = first * unit @ to_y_up, joints * unit @ to_y_up

    hips_m = first_m[:, _HIPS].mean(axis=1)
    valid = np.isfinite(_trunks(first).sum(axis=1))
    begin = np.flatnonzero(valid)[: max(len(valid) // 20, 1)]
    side = (first_m[:, Joint.LEFT_HIP] - first_m[:, Joint.RIGHT_HIP])[begin].mean(axis=0)
    origin = np.array([*hips_m[begin[0], [0]], np.nanmin(first_m[..., 1]), *hips_m[begin[0], [2]]])
    # The left hip has to be on the camera's right: the camera's x axis is along `side`, y down, z away from the camera.
    angle = np.arctan2(side[2], side[0])
    cos, sin = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(joints_m - origin, -1, 0)
    before_m = np.stack([cos * x + sin * z, CAMERA_HEIGHT_M - y, CAMERA_DISTANCE_M - (cos * z - sin * x)], axis=-1)
    return before_m.astype(np.float32)
