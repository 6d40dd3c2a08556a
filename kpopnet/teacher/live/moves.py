"""The verdict on each move of four counts, as soon as it has been danced, and its reason in words."""

import math
from typing import NamedTuple

from kpopnet.dance.feedback import MIN_DELAY_S, feedback
from kpopnet.dance.online import OnlineScore, OnlineScorer
from kpopnet.dance.scoring import DanceScore
from kpopnet.teacher.live.guidance import delay_words, in_words

COUNTS = 4
WAIT_S = 0.05
"""A move is judged when an image has come that was taken so long after its end, by a clock on the wall: the smoothing of the
joints needs a few images after it."""

LEAST_S = 1.0
"""A move that ends earlier in a lesson is judged then: from less nothing can be said."""

ROUNDING_S = 0.02
"""The last move may end so long after the last frame of the dance."""

PRAISED_FROM = 90.0
"""A move with at least this score is praised: what differs in it may be the estimator's errors."""


class MoveVerdict(NamedTuple):
    """What is said of a move.

    Attributes:
        number: of the move, from 1.
        end_s: where in the dance it ends, seconds.
        total: its score, 0 to 100; None where nothing can be said.
        words: why it is not more, "" for a good one.
    """

    number: int
    end_s: float
    total: float | None
    words: str


class Moves:
    """The moves of a lesson, in order, each judged once."""

    def __init__(self, begin_s: float, end_s: float, beat_s: float) -> None:
        """Cuts an excerpt into moves.

        Args:
            begin_s: start of the excerpt, seconds of the dance.
            end_s: its end.
            beat_s: duration of a count.
        """
        self._begin_s, self._end_s, self._move_s = begin_s, end_s, COUNTS * beat_s
        self._number = 1

    def judged(self, scorer: OnlineScorer, now_s: float, speed: float) -> MoveVerdict | None:
        """The verdict on the move that has just ended, None between two ends.

        Args:
            scorer: of the lesson.
            now_s: where in the dance the newest image was taken.
            speed: of the dance.
        """
        ended_s = now_s - WAIT_S * speed
        number = max(self._number, math.floor((ended_s - self._begin_s) / self._move_s))
        end_s = self._begin_s + number * self._move_s
        if ended_s < max(end_s, self._begin_s + LEAST_S) or end_s > self._end_s + ROUNDING_S:
            return None
        latest = scorer.preview(max(end_s, self._begin_s + LEAST_S), LEAST_S)
        self._number = number + 1
        if latest is None:
            return None
        known = latest.similarity == latest.similarity
        praised = known and latest.similarity >= PRAISED_FROM
        words = "" if praised else _reason(latest, scorer.score_so_far(), end_s - self._move_s)
        return MoveVerdict(number, end_s, latest.similarity if known else None, words)


def _reason(latest: OnlineScore, so_far: DanceScore | None, start_s: float) -> str:
    """What cost most in a move that began at `start_s`: the delay, a moment of `kpopnet.dance.feedback`, or else a part."""
    if abs(latest.delay_s) >= MIN_DELAY_S and latest.timing < latest.posture:
        return delay_words(latest.delay_s)
    moments = [one for phrase in feedback(so_far).phrases for one in phrase.moments] if so_far is not None else []
    during = [one for one in moments if one.end_s > start_s and one.part in latest.parts]
    if during:
        return in_words(max(during, key=lambda one: one.cost))
    worst = min(latest.parts, key=lambda part: latest.parts[part], default="")
    return f"{'body' if worst in ('torso', 'turning') else worst} not as shown" if worst else "nobody there"
