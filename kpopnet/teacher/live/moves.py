"""The verdict on each move of four counts, as soon as it has been danced, and its reason in words."""

from collections.abc import Callable
from typing import NamedTuple

from kpopnet.dance.feedback import MIN_DELAY_S, feedback
from kpopnet.dance.online import OnlineScore
from kpopnet.dance.scoring import DanceScore
from kpopnet.teacher.live.guidance import delay_words, in_words

COUNTS = 4
EARLY_S = 0.07
"""A move is judged by the window of the score that ends so long before the move does: the scorer knows a window
`OnlineScorer.lag_s` after its end."""

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

    def judged(self, latest: OnlineScore, so_far: Callable[[], DanceScore | None]) -> MoveVerdict | None:
        """The verdict on the move that has just ended, None between two ends.

        Args:
            latest: the score of the latest window.
            so_far: computes the score of the dance so far; asked only when a move has ended.
        """
        end_s = self._begin_s + self._number * self._move_s
        if latest.time_s < end_s - EARLY_S or end_s > self._end_s + EARLY_S:
            return None
        number = self._number + int((latest.time_s - end_s + EARLY_S) / self._move_s)  # nobody was there meanwhile
        end_s += (number - self._number) * self._move_s
        self._number = number + 1
        known = latest.similarity == latest.similarity
        words = "" if known and latest.similarity >= PRAISED_FROM else _reason(latest, so_far(), end_s - self._move_s)
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
