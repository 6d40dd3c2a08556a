"""Recorded points with names, of COCO, of Kinect or our own, as the fifteen joints of a performance."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kpopnet.dance.joint_files.joint_sets import NECK_FRACTION_TO_EARS, before_level_camera_m
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import names_in
from kpopnet.skeleton import NUM_JOINTS, Joint

COCO_NAMES = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
    "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle",
)  # fmt: skip
"""The keypoints in COCO's order."""

_LIMB_POINTS = {
    "SHOULDER": (("shoulder",),),
    "ELBOW": (("elbow",),),
    "HAND": (("hand",), ("wrist",)),
    "HIP": (("hip",),),
    "KNEE": (("knee",),),
    "FOOT": (("ankle", "foot"), ("ankle",), ("foot",)),
}
"""Points of one side whose mean is a joint, the best choice first. Our hand is the middle of the palm, our foot lies half-way
from the ankle to the toes."""

_MIDDLE_POINTS = {
    Joint.HEAD: (("head",), ("leftear", "rightear"), ("nose",)),
    Joint.NECK: (("neck",), ("shouldercenter",), ("spineshoulder",)),
}
"""The same for head and neck: those of our own names, COCO, Kinect v2 and Azure Kinect, and Kinect v1."""


class NamedPoints(NamedTuple):
    """A recording of points.

    Attributes:
        names: names of the P points.
        points: (T, P, 3) in metres, centimetres or millimetres, y or z up or down; NaN where missing.
        times_s: (T,) seconds; None where the file states none.
        confidence: (T, P) in 0..1; None for 1.
        fps: frames per second; None where the file states none.
    """

    names: Sequence[str]
    points: np.ndarray
    times_s: np.ndarray | None = None
    confidence: np.ndarray | None = None
    fps: float | None = None


def named_performance(recorded: NamedPoints, source: str, fps: float | None = None) -> Performance:
    """The fifteen joints of a recording, in the frame of a level camera that the dancer faces at first.

    Args:
        recorded: the points.
        source: name of the recording, for messages.
        fps: the true frame rate of a recording that states none or a wrong one.

    Raises:
        InputError: a joint of a limb has no point, the points are no upright person, or times and rate are missing.
    """
    places = _joint_places(recorded.names, source)
    joints = np.full((len(recorded.points), NUM_JOINTS, 3), np.nan)
    confidence = np.ones((len(recorded.points), NUM_JOINTS))
    for joint, columns in places.items():
        joints[:, joint] = recorded.points[:, columns].mean(axis=1)
        if recorded.confidence is not None:
            confidence[:, joint] = recorded.confidence[:, columns].min(axis=1)
    shoulders = [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]
    if Joint.NECK not in places:
        middle = joints[:, shoulders].mean(axis=1)
        joints[:, Joint.NECK] = middle + NECK_FRACTION_TO_EARS * (joints[:, Joint.HEAD] - middle)
        confidence[:, Joint.NECK] = confidence[:, [*shoulders, Joint.HEAD]].min(axis=1)
    confidence[:, Joint.TORSO] = confidence[:, [*shoulders, Joint.RIGHT_HIP, Joint.LEFT_HIP]].min(axis=1)
    times_s = frame_times_s(len(joints), recorded.times_s, recorded.fps, fps, source)
    return checked_performance(before_level_camera_m(joints, source), times_s, confidence, source)


def _joint_places(names: Sequence[str], source: str) -> dict[Joint, list[int]]:
    """Indices of the points whose mean is each joint.

    Raises:
        InputError: a limb's joint has none.
    """
    by_name: dict[str, int] = {}
    for number, name in enumerate(names):
        by_name.setdefault(plain_name(name), number)
    choices = dict(_MIDDLE_POINTS)
    for part, alternatives in _LIMB_POINTS.items():
        for side in ("right", "left"):
            choices[Joint[f"{side.upper()}_{part}"]] = tuple(tuple(side + word for word in one) for one in alternatives)
    found = {}
    for joint, alternatives in choices.items():
        known = next((words for words in alternatives if all(word in by_name for word in words)), None)
        if known:
            found[joint] = [by_name[word] for word in known]
    missing = [joint.name.lower() for joint in choices if joint not in found and joint not in _MIDDLE_POINTS]
    if missing:
        raise InputError(
            f"{source}: no point for {', '.join(missing)}; it names {names_in(names) or 'none'}. Expected the names of "
            "COCO, of a Kinect, or of kpopnet.skeleton.Joint"
        )
    return found


def plain_name(name: str) -> str:
    """A name without case and separators, its side in front: WRIST_LEFT, LeftWrist and lWrist are leftwrist."""
    words = re.sub(r"[^a-z0-9]", "", name[:100].lower())
    parts = "shoulder|elbow|wrist|hand|hip|knee|ankle|foot|ear"
    if match := re.fullmatch(rf"(left|right|l|r)({parts})|({parts})(left|right|l|r)", words):
        side = match[1] or match[4]
        return {"l": "left", "r": "right"}.get(side, side) + (match[2] or match[3])
    return words


def frame_times_s(
    frames: int, times_s: np.ndarray | None, stated_fps: float | None, fps: float | None, source: str
) -> np.ndarray:
    """(T,) times of a recording's frames in seconds.

    Args:
        frames: their number.
        times_s: as the file states them, or None.
        stated_fps: frames per second as the file states them, or None.
        fps: the true frame rate, which overrides both, or None.
        source: name of the recording, for messages.

    Raises:
        InputError: all three are None, or the rate is not 1 to 1000.
    """
    if fps is None and times_s is not None:
        return times_s
    rate = stated_fps if fps is None else fps
    if rate is None:
        raise InputError(f"{source}: states neither times nor a frame rate; give its frames per second")
    if not 1 <= rate <= 1000:
        raise InputError(f"{source}: {rate:g} frames a second; expected 1 to 1000")
    return np.arange(frames) / rate


def checked_performance(joints_m: np.ndarray, times_s: np.ndarray, confidence: np.ndarray | None, source: str) -> Performance:
    """A performance all of whose joints, but for head and neck, which the paper's feature does not use, are seen somewhere.

    Raises:
        InputError: one is missing throughout, or arrays do not fit together; the message begins with the source.
    """
    try:
        performance = Performance(joints_m, times_s, confidence)
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    unseen = [joint for joint in performance.unseen_joints if joint not in (Joint.HEAD, Joint.NECK)]
    if unseen:
        raise InputError(
            f"{source}: {', '.join(joint.name.lower() for joint in unseen)} missing in every frame; expected each joint in some"
        )
    return performance
