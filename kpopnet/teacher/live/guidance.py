"""Sentences for the learner: where to stand, and what is going wrong just now."""

import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.feedback import MIN_DELAY_S, Moment, feedback
from kpopnet.dance.scoring import DanceScore
from kpopnet.skeleton import Joint

NEAR_M, FAR_M = 1.2, 4.5
HIDDEN_CONFIDENCE = 0.2
MARGIN = 0.03
"""Fraction of the image's side within which a joint counts as at its edge."""

RECENT_S = 1.2
"""Age up to which a moment is told during the dance, beyond the score's own."""

_FEET = [Joint.LEFT_FOOT, Joint.RIGHT_FOOT]
_ABOVE = [Joint.HEAD]


def where_to_stand(joints_camera_m: np.ndarray | None, confidence: np.ndarray | None, camera: Camera) -> str:
    """What the learner should change so that the camera sees them, "" if nothing.

    Args:
        joints_camera_m: (15, 3) metres, or None if nobody is seen.
        confidence: (15,) in 0..1.
        camera: the camera.
    """
    if joints_camera_m is None or confidence is None or not np.isfinite(joints_camera_m).all(axis=1).any():
        return "nobody there"
    u, v, z = camera.project(joints_camera_m).T
    torso_m = float(np.nanmedian(z))
    if torso_m > FAR_M:
        return "come closer"
    if torso_m < NEAR_M:
        return "step back"
    bottom, top = camera.height * (1 - MARGIN), camera.height * MARGIN
    feet_out = bool((np.nan_to_num(v[_FEET], nan=np.inf) > bottom).any())
    if feet_out and np.nan_to_num(v[_ABOVE], nan=np.inf).min() < top + camera.height * 0.1:
        return "step back"
    if feet_out or confidence[_FEET].max() < HIDDEN_CONFIDENCE:
        return "your feet are hidden"
    if np.nan_to_num(v[_ABOVE], nan=np.inf).min() < top:
        return "step back"
    left, right = camera.width * MARGIN, camera.width * (1 - MARGIN)
    if np.nanmin(u) < left:
        return "move to your left"  # the camera's left is the right of a person who faces it
    return "move to your right" if np.nanmax(u) > right else ""


def in_words(moment: Moment) -> str:
    """A moment in few words: "left arm too low", "a little late"."""
    if moment.part == "timing":
        return delay_words(moment.delay_s)
    subject = moment.part if moment.part not in ("turning", "torso") else "body"
    return f"{subject} {moment.direction}"


def delay_words(delay_s: float) -> str:
    """A delay in seconds, negative when early, as "late" or "a little early"."""
    much = "" if abs(delay_s) >= 2 * MIN_DELAY_S else "a little "
    return f"{much}{'late' if delay_s > 0 else 'early'}"


def latest_words(score: DanceScore) -> str:
    """What is most wrong in the latest moments of a dance that goes on, "" if nothing is.

    Args:
        score: of `OnlineScorer.score_so_far`.
    """
    config = score.config
    now_s = float(score.windows.start_s[-1]) + (config.window_frames - 1) / 2 / config.fps
    moments = {one.text: one for phrase in feedback(score).phrases for one in phrase.moments if one.end_s >= now_s - RECENT_S}
    return in_words(max(moments.values(), key=lambda one: one.cost)) if moments else ""
