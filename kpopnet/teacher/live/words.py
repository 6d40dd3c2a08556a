"""What the page shows in words: where to stand, what is going wrong just now, why a move is not better, and the result."""

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.feedback import AS_THE_TEACHERS, Feedback, feedback, moments_since
from kpopnet.dance.online import OnlineScore
from kpopnet.dance.scoring import DanceScore
from kpopnet.dance.timing import measured_latency_s
from kpopnet.dance.window import WINDOW_S
from kpopnet.dance.words.causes import CAUSES
from kpopnet.dance.words.moments import MIN_DELAY_S, Moment, at
from kpopnet.languages import Said
from kpopnet.pose import PersonPose
from kpopnet.skeleton import Joint
from kpopnet.teacher.library import About
from kpopnet.teacher.live.lesson import Lesson

NEAR_M, FAR_M = 1.2, 4.5
HIDDEN_CONFIDENCE = 0.2
MARGIN = 0.03
"""Fraction of the image's side within which a joint counts as at its edge."""

RECENT_S = 1.2
"""Age up to which a moment is shown during the dance, beyond the score's own."""

WORST = 3
"""Moments and faults in a result."""

MIN_FPS = 7.0
"""Images a second of the dance of which fewer cost more than a point: perfect dancing of true joints has 99.4 at 10, 98.6 at 7,
96 at 5."""

_FEET = [Joint.LEFT_FOOT, Joint.RIGHT_FOOT]


def where_to_stand(person: PersonPose | None, camera: Camera) -> str:
    """What the learner should change so that the camera sees them, "" if nothing."""
    if person is None or not np.isfinite(person.joints_camera_m).all(axis=1).any():
        return "no person seen"
    u, v, z = camera.project(person.joints_camera_m).T
    torso_m = float(np.nanmedian(z))
    if torso_m > FAR_M:
        return "come closer"
    if torso_m < NEAR_M:
        return "step back"
    bottom, top, head = camera.height * (1 - MARGIN), camera.height * MARGIN, np.nan_to_num(v[Joint.HEAD], nan=np.inf)
    feet_out = bool((np.nan_to_num(v[_FEET], nan=np.inf) > bottom).any())
    if feet_out and head < top + camera.height * 0.1:
        return "step back"
    if feet_out or person.confidence[_FEET].max() < HIDDEN_CONFIDENCE:
        return "your feet are hidden"
    if head < top:
        return "step back"
    left, right = camera.width * MARGIN, camera.width * (1 - MARGIN)
    if np.nanmin(u) < left:
        return "move to your left"  # the camera's left is the right of a person who faces it
    return "move to your right" if np.nanmax(u) > right else ""


def exchanged(name: str) -> str:
    """A name or a direction with left and right exchanged: the own one of a learner who is compared as in a mirror."""
    return re.sub(r"\b(left|right)\b", lambda side: "right" if side[0] == "left" else "left", name)


def own_sides(told: Any) -> Any:
    """The result of a score that compared as in a mirror, dicts and lists of texts and numbers, with left and right exchanged:
    the learner's own, as while they danced.
    """
    if isinstance(told, Said):  # "right" is a side in texts without gaps alone
        values = {name: own_sides(value) for name, value in told.values.items()}
        return Said(told.template if values else exchanged(told.template), **values)
    if isinstance(told, dict):
        return {exchanged(name): own_sides(value) for name, value in told.items()}
    if isinstance(told, list | tuple):
        return [own_sides(one) for one in told]
    if told == AS_THE_TEACHERS:
        return "compared as in a mirror: left and right are your own"
    return exchanged(told) if isinstance(told, str) else told


def in_words(moment: Moment, mirrored: bool = False) -> str:
    """A moment in few words: "left arm too low", "a little late". Left is the learner's own, of a `mirrored` score too."""
    if moment.part == "timing":
        return _delay_words(moment.delay_s)
    if moment.part == "phrase":
        return CAUSES[moment.direction]
    part, direction = (exchanged(one) if mirrored else one for one in (moment.part, moment.direction))
    return Said("{part} {direction}", part=_body_part(part), direction=Said(direction))


def _body_part(part: str) -> Said:
    return Said("body" if part in ("turning", "torso") else part)


def _delay_words(delay_s: float) -> str:
    """A delay in seconds, negative when early, as "late" or "a little early"."""
    much = "" if abs(delay_s) >= 2 * MIN_DELAY_S else "a little "
    return Said(f"{much}{'late' if delay_s > 0 else 'early'}")


def latest_words(score: DanceScore) -> str:
    """What is most wrong in the latest moments of a dance that goes on, "" if nothing is, by `OnlineScorer.score_so_far`."""
    now_s = float(score.windows.middle_s[-1])
    return next((in_words(one, score.mirrored) for one in moments_since(score, now_s - RECENT_S)), "")


def move_reason(latest: OnlineScore, so_far: DanceScore | None, start_s: float) -> str:
    """What cost most in a move that began at `start_s`: the delay, a moment of `kpopnet.dance.feedback`, or else a part."""
    if abs(latest.delay_s) >= MIN_DELAY_S and latest.timing < latest.posture:
        return _delay_words(latest.delay_s)
    moments = moments_since(so_far, start_s) if so_far is not None else ()
    during = [one for one in moments if one.part in latest.parts or one.part == "phrase"]
    if during:
        return in_words(during[0], latest.mirrored)
    worst = min(latest.parts, key=lambda part: latest.parts[part], default="")
    own = exchanged(worst) if latest.mirrored else worst
    return Said("{part} not as shown", part=_body_part(own)) if worst else Said("no person seen")


def try_result(score: DanceScore | None, lesson: Lesson, about: About, notes: dict) -> dict:
    """The result of a try as JSON of finite numbers and null: total, timing, posture, parts, phrases, worst moments, course.

    The score is None where no person was seen long enough. The notes, such as frames per second, are kept with it.
    """
    head = {
        "dance": lesson.dance, "name": about.name, "source": lesson.source, "skill": lesson.skill, "fault": lesson.fault,
        "speed": lesson.speed, "from_s": lesson.from_s, "to_s": lesson.to_s, "mirrored": lesson.mirrored, "who": lesson.who,
        "dancer": lesson.dancer, "taken_off_s": lesson.latency_s, "notes": notes,
    }  # fmt: skip
    if score is not None and score.all_free:
        return head | {"total": None, "hints": ["all of this is free: nothing was compared"]}
    if score is None or math.isnan(score.similarity):
        return head | {"total": None, "hints": ["no person was seen dancing; stand in the picture from head to feet"]}
    slow = "only {fps} images a second were scored, which costs points: this machine is busy with other things"
    told = score_result(score, feedback(score, about.beat_s), about.weights, about.beat_s)
    if score.mirrored:
        told = own_sides(told)
    if told["latency_s"] is not None:  # of the set-up, in real seconds like `Lesson.latency_s`
        told["latency_s"] = rounded(told["latency_s"] / lesson.speed)
    if notes["fps"] and notes["fps"] / lesson.speed < MIN_FPS:
        told["hints"] = [Said(slow, fps=f"{notes['fps']:.0f}"), *told["hints"]]
    return head | told


def score_result(score: DanceScore, found: Feedback, weights: Mapping[str, float], beat_s: float | None) -> dict:
    """What the page of a result shows of a score, as JSON of finite numbers and null.

    The total is the similarity, or has the weights of `DanceScore.total`, where a figure of theirs is known; `beat_s` is a beat
    of the music in seconds, if there is one.
    """
    windows, beats_s = score.windows, score.beats_s(beat_s)
    counted = score.counted(weights, beats_s)
    unknown = [Said("what the total is made of could not be measured here")] if weights and not counted else []
    return {
        "total": rounded(score.total(counted, beats_s) if counted else score.similarity),
        "weights": counted,
        "counted": {name: rounded(score.figures(beats_s)[name]) for name in counted},
        "uncertainty": None if counted else rounded(score.uncertainty),
        "free": {name: rounded(value) for name, value in score.free(beats_s).items()},
        "timing": rounded(score.timing),
        "posture": rounded(score.posture),
        "parts": {name: rounded(value) for name, value in score.parts.items()},
        "coverage": {name: rounded(value) for name, value in score.coverage.items()},
        "phrases": [
            {"start_s": rounded(one.start_s), "end_s": rounded(one.end_s), "total": rounded(one.similarity),
             "unseen": list(one.unseen), "moments": [_moment(moment) for moment in one.moments]}
            for one in found.phrases
        ],
        "worst": [_moment(moment) for moment in found.moments[:WORST]],
        "faults": [one.text for one in found.faults[:WORST]],
        "hints": [*unknown, *found.hints],
        "praise": list(found.praise),
        "stage": {name: rounded(value) for name, value in score.stage.figures.items()},
        "on_stage": [Said("{what} {when}", what=text, when=at([at_s])) for at_s, text in score.stage_remarks()],
        "latency_s": rounded(measured_latency_s(windows.delay_s, windows.posture, windows.weight)),
        "course": {
            "time_s": _column(windows.start_s + WINDOW_S / 2), "total": _column(windows.similarity),
            "timing": _column(windows.timing), "posture": _column(windows.posture), "delay_s": _column(windows.delay_s),
            "parts": {name: _column(values) for name, values in windows.parts.items() if name in score.parts},
        },
    }  # fmt: skip


def _moment(moment: Moment) -> dict:
    return {
        "start_s": rounded(moment.start_s), "end_s": rounded(moment.end_s), "part": moment.part, "words": in_words(moment),
        "text": moment.text, "degrees": rounded(moment.degrees), "delay_s": rounded(moment.delay_s),
    }  # fmt: skip


def rounded(value: float | None, digits: int = 3) -> float | None:
    """A number for JSON; None where it is missing or not finite. One digit would be rounded twice: 47.46 to 48."""
    return round(float(value), digits) if value is not None and math.isfinite(value) else None


def _column(values: np.ndarray) -> list[float | None]:
    return [rounded(value) for value in values]
