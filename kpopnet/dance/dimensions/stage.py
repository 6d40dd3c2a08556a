"""Where the body is and how it stands in the room: place, height, lean and facing.

The paper's features are angles of the body about itself (section 3.1): dancing on the spot, leaving out the jumps and lying on
the floor score as if they were right. Compared here are, at the frames that the windows matched in time:

- place: of the hips on the floor, in lengths of the body, so that a child's steps may be shorter;
- height: of the hips, likewise: jumps, level changes, lying down;
- lean: the direction from the hips to the neck, against gravity;
- facing: the heading of hips and shoulders.

Where the two cameras stand is not known. So the learner's stage is laid onto the teacher's where the dance begins: place,
height and heading agree on average over the first START_S in which both are seen. A camera's tilt is not known either: the
vertical of a dance is the median direction from feet to neck, if that lies within MAX_TILT of the camera's. A lean that lasts
for most of a dance is therefore taken for the camera's, and a leg that is lifted for most of it tilts the vertical a little.
Joints about the hips, as MediaPipe's world landmarks are, do not know where they are: place and height are then not graded.

A figure is the skill score of `kpopnet.dance.parts`: the mean of exp(-(error / scale)^2) above that of a person who stays as
the teacher is on average. The similarity of the dance does not contain it. Head and feet are not graded: the head is one joint,
and a foot is a point without a direction.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from kpopnet.dance.features import MIN_BONE_M
from kpopnet.dance.performance import poses
from kpopnet.dance.window import FPS, WINDOW_FRAMES
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.skeleton import Joint

START_S = 2.0
"""What both stages have in common, seconds from the begin: a window."""

MAX_TILT = math.radians(60)
"""Of a camera: they are mounted at up to 50 degrees (`synth.rooms`), and a body that lies is at 90."""

MAX_STAYING = 0.5
"""Greatest score of staying that is taken off. Where the teacher stays, a learner who is 20 cm off loses 60 points of place."""

LEAST_KNOWN = 0.1
"""Fraction of the teacher's frames that has to be compared."""

LEAST_LEVEL = 0.5
"""Fraction of the width of hips and shoulders that has to be level: a body on its side has no heading."""

CENTRED_M, TRUNK, LEAST_CENTRED_FRAMES = 0.005, 0.03, 2 * WINDOW_FRAMES
"""Joints are about the hips if in four seconds or more these stay within CENTRED_M and the unit direction of the trunk does not
stay within TRUNK (root mean squares). Errors of joints by 1 cm move the trunk of a person who stands still by up to 0.022; 40
composed dances move it by 0.05 or more, and no four seconds of them are so."""

OF_THE_ROOM = ("place", "height")
"""The dimensions that such joints do not have."""

LEAST_S = 0.3
"""Shorter errors are not mentioned, seconds; a jump takes longer."""


class Dimension(NamedTuple):
    """What is graded."""

    scale: float  # error at which the similarity has fallen to 1/e: lengths of the body, of an adult 1.35 m, or radians
    mentioned: float  # smaller errors are not mentioned
    words: tuple[tuple[str, str], ...]  # of each component of the error, where it is negative and where it is positive
    is_direction: bool = False  # whether it is a unit direction instead of a place

    def error(self, danced: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """(T, C) differences of (T, .) places or directions; those of directions are angles."""
        if not self.is_direction:
            return danced - goal
        between = np.arctan2(np.linalg.norm(danced - goal, axis=1), np.linalg.norm(danced + goal, axis=1)) * 2
        if len(self.words) == 1:
            side = goal[:, 0] * danced[:, 1] - goal[:, 1] * danced[:, 0]
            return np.copysign(between, side)[:, None]
        level = (danced - goal)[:, [0, 2]]
        return level * (between / np.maximum(np.linalg.norm(level, axis=1), 1e-9))[:, None]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """The mean of the known ones of (T, .) places or directions, NaN if there are none."""
        known = values[np.isfinite(values).all(axis=1)]
        mean = known.sum(axis=0) / (len(known) or math.nan)
        return mean / max(np.linalg.norm(mean), 1e-9) if self.is_direction else mean

    def similarity(self, error: np.ndarray) -> np.ndarray:
        """(K,) similarities in 0..1 of the known ones of (T, C) errors."""
        squared = (error**2).sum(axis=1)
        return np.exp(-squared[np.isfinite(squared)] / self.scale**2)


DIMENSIONS = {
    "place": Dimension(0.25, 0.25, (("too far right", "too far left"), ("too far back", "too far forward"))),
    "height": Dimension(0.08, 0.08, (("too low", "too high"),)),
    "lean": Dimension(
        math.radians(35),
        math.radians(20),
        (("leaning to the right", "leaning to the left"), ("leaning back", "leaning forward")),
        True,
    ),
    "facing": Dimension(math.radians(60), math.radians(40), (("turned to the right", "turned to the left"),), True),
}


class Stance(NamedTuple):
    """How a dancer stands, frame by frame; NaN where joints are missing."""

    hips_m: np.ndarray  # (T, 3) middle of the hips: right, down and away of a level camera
    trunk: np.ndarray  # (T, 3) unit direction from the hips to the neck: to the dancer's left, up, to the front
    heading: np.ndarray  # (T,) angle about the vertical, radians; it grows when the dancer turns left
    length_m: float  # median of the body's length from neck to feet

    @property
    def known(self) -> np.ndarray:
        """(T,) whether place and heading are known."""
        return np.isfinite(self.hips_m[:, 0]) & np.isfinite(self.heading)

    @property
    def is_centred(self) -> bool:
        """Whether the hips never move but the trunk does: no person dances so, the joints are about the hips."""
        known = np.isfinite(self.hips_m[:, 0]) & np.isfinite(self.trunk[:, 0])
        if known.sum() < LEAST_CENTRED_FRAMES:
            return False
        hips_m, trunk = (float(np.linalg.norm(one[known].std(axis=0))) for one in (self.hips_m, self.trunk))
        return hips_m < CENTRED_M and trunk > TRUNK

    def on_stage(self, begin: np.ndarray, front: float) -> dict[str, np.ndarray]:
        """(T, C) by dimension, on a stage whose middle is the mean place at the frames `begin`, and its front in radians.

        Place to the left and forward, height up, in lengths of the body; lean and facing as unit directions.
        """
        moved = (self.hips_m - self.hips_m[begin].mean(axis=0)) / self.length_m
        place = np.stack(_left_and_front(moved, np.full(len(moved), front)), axis=1)
        facing = np.stack([np.cos(self.heading - front), np.sin(self.heading - front)], axis=1)
        return {"place": place, "height": -moved[:, 1:2], "lean": self.trunk, "facing": facing}


class StageScore(NamedTuple):
    """How a learner moves on the stage."""

    figures: dict[str, float]  # by the name of one of `DIMENSIONS`, 0 to 100; without those of which too little is known
    # by dimension, (T, C) learner minus teacher at the learner's frames, in the units of `Dimension.scale`; NaN where unknown.
    # Empty where nothing is known.
    errors: dict[str, np.ndarray]
    length_m: float  # of the learner's body, from neck to feet
    centred: tuple[str, ...] = ()  # of teacher and learner, whose joints are about the hips: OF_THE_ROOM is then not graded

    def remarks(self) -> Iterator[tuple[float, Said]]:
        """The greatest error of each dimension, if worth words: seconds after the first frame, "0.8 m too far left"."""
        for name, errors in self.errors.items():
            dimension = DIMENSIONS[name]
            size = np.nan_to_num(np.linalg.norm(errors, axis=1))
            long = [run for run in runs(size >= dimension.mentioned) if run.stop - run.start >= LEAST_S * FPS]
            if long:
                run = max(long, key=lambda one: size[one].sum())
                component = int(np.median(abs(errors[run]), axis=0).argmax())
                words = dimension.words[component][int(np.median(errors[run, component]) > 0)]
                amount = float(np.median(size[run]))  # errors of both signs must not cancel each other
                degrees, metres = f"{math.degrees(amount):.0f}", f"{amount * self.length_m:.1f}"
                shown = Said("{degrees}°", degrees=degrees) if dimension.is_direction else Said("{metres} m", metres=metres)
                yield run.start / FPS, Said("{amount} {word}", amount=shown, word=Said(words))


def stage_score(teacher_m: np.ndarray, learner_m: np.ndarray, delay_s: np.ndarray) -> StageScore:
    """Grades a learner on the stage, from (T, 15, 3) joints of both and the learner's (T,) delay as the windows matched it.

    Joints are in metres in the camera frame, FPS frames a second on one clock, NaN where missing. Raises InputError for
    other shapes.
    """
    teacher_m, learner_m = poses(teacher_m), poses(learner_m)
    if not np.shape(delay_s) == teacher_m.shape[:1] == learner_m.shape[:1]:
        lengths = f"{len(teacher_m)} and {len(learner_m)} frames with delays of shape {np.shape(delay_s)}"
        raise InputError(f"{lengths}: expected as many of teacher and learner, and a delay for each")
    teacher, learner = stance(teacher_m), stance(learner_m)
    frames = np.arange(len(delay_s))
    matched = np.clip(np.rint(frames - delay_s * FPS).astype(int), 0, len(frames) - 1)
    centred = tuple(name for name, one in (("teacher", teacher), ("learner", learner)) if one.is_centred)
    begin = np.flatnonzero(teacher.known[matched] & learner.known)[: round(START_S * FPS)]
    if not len(begin):
        return StageScore({}, {}, learner.length_m, centred)
    # Over a turn a mean heading is ill-conditioned, the mean difference is not.
    front = _mean_angle(teacher.heading[matched[begin]])
    turned = _mean_angle(learner.heading[begin] - teacher.heading[matched[begin]])
    taught, danced = teacher.on_stage(matched[begin], front), learner.on_stage(begin, front + turned)
    figures, errors = {}, {}
    for name, dimension in DIMENSIONS.items():
        if centred and name in OF_THE_ROOM:
            continue
        goal = taught[name][matched]
        errors[name] = dimension.error(danced[name], goal)
        compared = dimension.similarity(errors[name])
        staying = dimension.similarity(dimension.error(np.broadcast_to(dimension.mean(goal), goal.shape), goal))
        if len(compared) > LEAST_KNOWN * len(staying):
            figures[name] = figure(compared, staying)
    return StageScore(figures, errors, learner.length_m, centred)


def _mean_angle(angles: np.ndarray) -> float:
    return math.atan2(np.sin(angles).mean(), np.cos(angles).mean())


def runs(flags: np.ndarray) -> list[slice]:
    """The runs of true values of (N,) flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags, [0]])))
    return [slice(*run) for run in edges.reshape(-1, 2).tolist()]


def figure(compared: np.ndarray, staying: np.ndarray) -> float:
    """The skill score, 0 to 100, of similarities in 0..1, above those of a person who stays as the teacher is on average."""
    lost = min(float(staying.mean()), MAX_STAYING)
    return 100 * max((float(compared.mean()) - lost) / (1 - lost), 0.0)


def stance(joints_m: np.ndarray, level: np.ndarray | None = None) -> Stance:
    """The stance of (T, 15, 3) joints in metres in the camera frame, levelled by a (3, 3) rotation, by default the dancer's."""
    level = levelling([joints_m]) if level is None else level
    hips_m, neck_m = joints_m[:, _HIPS].mean(axis=1), joints_m[:, Joint.NECK]
    across_m = joints_m[:, [Joint.LEFT_HIP, Joint.LEFT_SHOULDER]] - joints_m[:, [Joint.RIGHT_HIP, Joint.RIGHT_SHOULDER]]
    hips_m, trunk_m, left_m = hips_m @ level.T, (neck_m - hips_m) @ level.T, across_m.mean(axis=1) @ level.T
    is_level = np.hypot(left_m[:, 0], left_m[:, 2]) > LEAST_LEVEL * np.linalg.norm(left_m, axis=1)
    heading = np.where(is_level, np.arctan2(left_m[:, 2], left_m[:, 0]), np.nan)
    to_left, to_front = _left_and_front(trunk_m, _held(heading))
    lengths_m = np.linalg.norm(trunk_m, axis=1)
    trunk = np.stack([to_left, -trunk_m[:, 1], to_front], axis=1)
    trunk /= np.where(lengths_m < MIN_BONE_M, math.nan, lengths_m)[:, None]
    bones_m = [np.linalg.norm(joints_m[:, end] - joints_m[:, begin], axis=2).mean(axis=1) for begin, end in _LEGS]
    return Stance(hips_m, trunk, heading, sum(_median(one) for one in (lengths_m, *bones_m)))


_HIPS, _FEET = [Joint.LEFT_HIP, Joint.RIGHT_HIP], [Joint.LEFT_FOOT, Joint.RIGHT_FOOT]
_KNEES = [Joint.LEFT_KNEE, Joint.RIGHT_KNEE]
_LEGS = (_HIPS, _KNEES), (_KNEES, _FEET)


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def levelling(dancers_m: Sequence[np.ndarray]) -> np.ndarray:
    """(3, 3) rotation of the camera frame after which the direction from dancers' feet to necks points up in the median, if it
    did nearly before, from the (T, 15, 3) joints of each in metres.
    """
    up_m = np.concatenate([joints_m[:, Joint.NECK] - joints_m[:, _FEET].mean(axis=1) for joints_m in dancers_m])
    lengths_m = np.linalg.norm(up_m, axis=1)
    known = lengths_m >= MIN_BONE_M  # false for NaN
    up = np.median(up_m[known] / lengths_m[known, None], axis=0) if known.any() else np.zeros(3)
    if -up[1] <= math.cos(MAX_TILT) * np.linalg.norm(up):
        return np.eye(3)
    x, y, z = up / np.linalg.norm(up)
    # The smallest rotation from (x, y, z) to (0, -1, 0).
    skew = np.array([[0, x, 0], [-x, 0, -z], [0, z, 0]])
    return np.eye(3) + skew + skew @ skew / (1 - y)


def _left_and_front(vectors: np.ndarray, heading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T,) components of (T, 3) vectors to the left and to the front of (T,) headings."""
    (x, _, z), cosine, sine = vectors.T, np.cos(heading), np.sin(heading)
    return x * cosine + z * sine, x * sine - z * cosine


def _held(heading: np.ndarray) -> np.ndarray:
    """(T,) headings whose gaps are closed; a body on its side keeps the heading that it had."""
    known = np.flatnonzero(np.isfinite(heading))
    return np.interp(np.arange(len(heading)), known, np.unwrap(heading[known])) if len(known) else heading
