"""The score of one try of a dance, image by image, the verdict on each move of four counts, and the result."""

import itertools
import math
import time
from dataclasses import replace

import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.dimensions.formation import formation
from kpopnet.dance.online import OnlineScore, OnlineScorer
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import OURS, Stretches, score_dance
from kpopnet.dance.timing import beat_latency_s
from kpopnet.dance.window import WINDOW_S
from kpopnet.dance.words.moments import at
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.pose import PersonPose
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.sources.live import Image
from kpopnet.teacher.library import MOVE_COUNTS, SEEN_AS, SHOWN_BY, TaughtDance
from kpopnet.teacher.live.lesson import CALIBRATION_BEAT_S, DanceClock, Lesson
from kpopnet.teacher.live.words import exchanged, latest_words, move_reason, rounded, try_result, where_to_stand

LEAST_S = 1.0
"""Least seconds of a lesson from which a move is scored; one that ends earlier is scored then."""

ROUNDING_S = 0.05
"""Seconds by which the last move may end after the last frame of the dance: nearly all cameras take the next one within."""

AFTER_END_S, AFTER_END_PATIENCE_S = 0.1, 0.6
"""Seconds for which a try goes on after the end of the dance: at least, and at most. The first image taken after the end, by
which the last move is judged, comes in between; a webcam's comes late."""

PRAISED_FROM = 90.0
"""A move with at least this score is praised: what differs in it may be the estimator's errors."""

WORDS_EVERY_S, WORDS_SHARE = 0.25, 0.1
"""The words are new after the first, in seconds, and later where they would take more than this share of the time: longer
dances take longer, and no image is scored meanwhile."""

BRIDGE_FPS, MAX_BRIDGE_S = 15.0, 0.5
"""A slow machine drops images. Between images less than MAX_BRIDGE_S seconds of the dance apart joints are interpolated at
BRIDGE_FPS; longer gaps stay gaps."""

CALIBRATION_SETTLED_S = 1.5 * CALIBRATION_BEAT_S
"""The first movement of a learner comes late."""


class DanceTry:
    """One try of a dance, from its first image on."""

    def __init__(self, lesson: Lesson, dance: TaughtDance, noise: str, clock: DanceClock) -> None:
        """Begins a try; `noise` is the name of the estimator's errors in `kpopnet.dance.noise.table.NOISE`."""
        self._lesson, self._about, self._clock = lesson, dance.about, clock
        self.begin_s, self.end_s = lesson.excerpt_s(len(dance.joints_m) / dance.fps)  # seconds of the dance
        taught = dance.performance
        if dance.seen is not None and noise == SHOWN_BY:
            taught, noise = dance.seen, SEEN_AS
        self._grades_network = noise == SEEN_AS
        self._config = scorer_config(lesson, noise)
        self._teacher = excerpt(taught, self.begin_s, self.end_s)
        self._scorer = OnlineScorer(self._teacher, self._config, self._about.free_s)
        # On the dance's clock, while the dance went on, whether the learner was seen or not.
        self._images, self._first_s, self._last_s = 0, 0.0, 0.0
        self._seen: list[tuple[float, np.ndarray, np.ndarray]] = []  # times without the latency, joints, confidence
        self._graded_m = np.full((NUM_JOINTS, 3), np.nan)  # the latest image's
        self._latest: OnlineScore | None = None
        self._words, self._words_due_s = "", -math.inf
        self._next_move = 1
        self._verdict: dict | None = None
        self._ages_ms: list[int] = []
        self._verdicts_ms: list[int] = []

    def compile(self) -> None:
        """Compiles the scorer's kernels: the teacher's own first seconds are scored, as if nothing in them were free."""
        scorer, frames = OnlineScorer(self._teacher, self._config), min(round((WINDOW_S + 1) * 30), len(self._teacher))
        for joints_m, time_s in zip(self._teacher.joints_m[:frames], self._teacher.times_s[:frames], strict=True):
            scorer.update(joints_m, float(time_s))
        if (score := scorer.score_so_far()) is not None:
            latest_words(score)

    @property
    def seen_s(self) -> float:
        """Up to where the dance was scored."""
        return self._seen[-1][0] + self._config.latency_s if self._seen else self.begin_s

    @property
    def is_over(self) -> bool:
        after_s = self._clock.dance_s(time.monotonic()) - self._config.latency_s - self.end_s
        was_shown = self._last_s > self.end_s + self._config.latency_s
        return after_s > self._lesson.speed * (AFTER_END_S if was_shown else AFTER_END_PATIENCE_S)

    def see(self, image: Image, person: PersonPose | None, camera: Camera) -> dict:
        """Adds an image to the score, if the dance is going on and the learner is there; what the page shows of it: joints in
        fractions of the picture, scores, words, and the time it was taken.
        """
        self._score(image, person)
        points = None
        if person is not None:
            uvz = camera.project(person.joints_camera_m) / [camera.width, camera.height, 1.0]
            points = [[rounded(value, 3) for value in point] for point in np.column_stack([uvz, person.confidence])]
        latest = self._latest if self._clock.running else None
        parts, own = (latest.parts if latest else {}), (exchanged if latest and latest.mirrored else str)
        age_s = time.monotonic() - image.taken
        self._ages_ms.append(round(1000 * age_s))
        return {
            "time_s": rounded(self._clock.dance_s(image.taken), 3) if self._clock.running else None,
            "joints": points,
            "guidance": where_to_stand(person, camera),
            "words": self._words if latest and not latest.similarity >= PRAISED_FROM else "",
            "total": rounded(latest.similarity, 3) if latest else None,
            "so_far": rounded(latest.so_far, 3) if latest else None,
            "delay_s": rounded(latest.delay_s, 3) if latest else None,
            "parts": {own(name): rounded(value, 3) for name, value in parts.items()},
            "taken_ms": round(1000 * (time.time() - age_s), 1),  # of the wall clock, as the page's
        }

    def _score(self, image: Image, person: PersonPose | None) -> None:
        time_s = self._clock.dance_s(image.taken)
        # A latency below 0, of who dances before the beat, begins the dance before its own begin.
        begin_s = self.begin_s + min(self._config.latency_s, 0.0)
        if not self._clock.running or time_s < begin_s or (self._seen and time_s <= self.seen_s):
            return
        self._first_s, self._last_s = self._first_s if self._images else time_s, time_s
        self._images += 1
        if person is None:
            return
        graded = person.network if self._grades_network and person.network else person
        joints_m, confidence = graded.joints_camera_m, np.clip(graded.confidence, 0, 1)
        for between_s, between_m in self._bridge(time_s, joints_m):
            self._scorer.update(between_m, between_s, confidence)
        self._seen.append((time_s - self._config.latency_s, person.joints_camera_m, np.clip(person.confidence, 0, 1)))
        self._graded_m = joints_m
        self._latest = self._scorer.update(joints_m, time_s, confidence)
        self._score_move()
        if self._latest is not None and time_s >= self._words_due_s:
            began = time.perf_counter()
            so_far = self._scorer.score_so_far()
            self._words = "" if so_far is None else latest_words(so_far)
            took_s = time.perf_counter() - began
            self._words_due_s = time_s + max(WORDS_EVERY_S, took_s / WORDS_SHARE) * self._lesson.speed

    def _bridge(self, time_s: float, joints_m: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """Times and joints on straight lines from the last image's to these, where some images were dropped in between."""
        if not self._seen:
            return []
        before_s, before_m = self.seen_s, self._graded_m
        gap_s = time_s - before_s
        steps = round(gap_s * BRIDGE_FPS) if gap_s < MAX_BRIDGE_S else 1
        shares = [step / steps for step in range(1, steps)]
        return [(before_s + share * gap_s, before_m + share * (joints_m - before_m)) for share in shares]

    def _score_move(self) -> None:
        """Scores the move that has just ended, once; between two ends, and where nothing is compared, there is no verdict.

        It is judged with the first image after its end: 0.05 s later the score is 0.1 points nearer to what it is in the end.
        """
        self._verdict = None
        move_s, ended_s = MOVE_COUNTS * self._about.beat_s, self._seen[-1][0]
        number = max(self._next_move, math.floor((ended_s - self.begin_s) / move_s))
        end_s = self.begin_s + number * move_s
        scored_s = max(end_s, self.begin_s + LEAST_S)
        if ended_s < scored_s or end_s > self.end_s + ROUNDING_S:
            return
        self._next_move = number + 1
        latest = self._scorer.preview(scored_s, LEAST_S)
        if latest is None or math.isnan(latest.similarity):
            return
        praised = latest.similarity >= PRAISED_FROM
        words = "" if praised else move_reason(latest, self._scorer.score_so_far(), end_s - move_s)
        self._verdict = {"number": number, "end_s": end_s, "total": rounded(latest.similarity, 3), "words": words}

    def next_verdict(self) -> dict | None:
        """The verdict on a move that has just ended, once.

        It holds the number of the move, from 1; end_s in the dance; total, 0 to 100 or None; the words why it is not more, ""
        for a good one; after_ms, milliseconds from the end of the move to now.
        """
        verdict, self._verdict = self._verdict, None
        if verdict is None:
            return None
        after_s = self._clock.dance_s(time.monotonic()) - self._config.latency_s - verdict["end_s"]
        self._verdicts_ms.append(round(1000 * after_s / self._lesson.speed))
        return verdict | {"after_ms": self._verdicts_ms[-1]}

    def finish(self, dropped: int) -> tuple[dict, dict[str, np.ndarray]]:
        """The result of the try, see `try_result`, and the learner's joints as `read_performance` reads them.

        `dropped` is the number of images that were not used.
        """
        try:
            score = self._scorer.finish()
        except InputError:  # no person was in view for a whole window
            score = None
        ages, verdicts = self._ages_ms or [0], self._verdicts_ms or [0]
        steps, watched_s = self._images - 1, self._last_s - self._first_s  # up to where the camera's images ended
        notes = {
            "frames": len(self._seen),
            "fps": rounded(steps / watched_s * self._lesson.speed, 3) if steps > 0 else None,
            "dropped": dropped,
            "age_ms_median": float(np.median(ages)),
            "age_ms_p95": float(np.percentile(ages, 95)),
            "verdict_ms_median": float(np.median(verdicts)),
            "verdict_ms_p95": float(np.percentile(verdicts, 95)),
        }
        return try_result(score, self._lesson, self._about, notes), self._recorded()

    def _recorded(self) -> dict[str, np.ndarray]:
        times_s, joints_m, confidence = zip(*self._seen, strict=True) if self._seen else ((), (), ())
        return {
            "times_s": np.array(times_s, np.float64),
            "joints_m": np.array(joints_m, np.float32).reshape(-1, NUM_JOINTS, 3),
            "confidence": np.array(confidence, np.float32).reshape(-1, NUM_JOINTS),
        }


class Calibration(DanceTry):
    """The guided step that measures the latency of a set-up: an arm on every beat of a metronome, and no score."""

    def compile(self) -> None:
        """Nothing needs to be compiled."""

    def _score(self, image: Image, person: PersonPose | None) -> None:
        time_s = self._clock.dance_s(image.taken)
        if self._clock.running and person is not None and time_s >= CALIBRATION_SETTLED_S:
            self._seen.append((time_s, person.joints_camera_m, person.confidence))

    def finish(self, dropped: int) -> tuple[dict, dict[str, np.ndarray]]:
        """The latency in seconds, None where the learner did not move on the beat; and no joints."""
        found = self._recorded()
        latency_s = rounded(beat_latency_s(found["joints_m"], found["times_s"], CALIBRATION_BEAT_S), 3)
        hint = "no arm moved with the ticks; raise one high at each tick, lower it in between, and try again"
        return {"total": None, "latency_s": latency_s, "hints": [hint] if latency_s is None else []}, {}


def together(members: list[dict[str, np.ndarray]], free_s: Stretches, speed: float) -> dict | None:
    """How alike learners danced, whoever the teacher was: 0 to 100, the mean over all pairs, each compared both ways.

    Also by how many seconds each danced after the first, where the dance went on at `speed` times its own. `members` are joints
    as of `DanceTry.finish`; the stretches `free_s` are not compared. None where two were not seen for a window at a time.
    """
    try:
        dances = [Performance(**one) for one in members]
        pairs = [score_dance(a, b, free_s=free_s) for a, b in itertools.permutations(dances, 2)]
    except InputError:
        return None
    delays_s = (one.windows.delay_s[np.isfinite(one.windows.delay_s)] for one in pairs[: len(dances) - 1])
    after_s = [rounded(np.median(delay_s) / speed, 2) if len(delay_s) else None for delay_s in delays_s]
    figures = {name: rounded(np.mean([getattr(one, name) for one in pairs])) for name in ("similarity", "timing", "posture")}
    return figures | {"after_s": [0.0, *after_s]}


def kept_formation(dancers: list[TaughtDance], members: list[dict[str, np.ndarray]]) -> dict | None:
    """How learners kept a group's formation, see `formation`, or why it is not graded; None where they were not seen together
    for long enough. `members` as for `together`.

    The group's first dancer says what is free.
    """
    try:
        learners = [Performance(**one) for one in members]
    except InputError:
        return None
    if (found := formation([one.performance for one in dancers], learners, dancers[0].about.free_s)) is None:
        return None
    if found.centred:
        text = "not graded: as recorded, the hips never move ({dancers})"
        return {"why_not": Said(text, dancers=[Said(name) for name in found.centred])}
    remarks = [
        {"member": member, "text": Said("{what} {when}", what=text, when=at([at_s]))} for member, at_s, text in found.remarks
    ]
    return {"similarity": rounded(found.similarity), "spread": rounded(found.spread, 2), "remarks": remarks}


def scorer_config(lesson: Lesson, noise: str) -> PartScorer:
    """The scorer of a lesson.

    As in a mirror, left is left. Who faces a teacher as on a stage may do the same or its mirror image: both are right.
    """
    mirrored = "false" if lesson.mirrored else "auto"
    return replace(OURS, mirrored=mirrored, latency_s=lesson.latency_s * lesson.speed, noise=noise)


def excerpt(dance: Performance, begin_s: float, end_s: float) -> Performance:
    """The part of a dance between two times, on the dance's own clock."""
    inside = (dance.times_s >= begin_s - 1e-6) & (dance.times_s <= end_s + 1e-6)
    return Performance(dance.joints_m[inside], dance.times_s[inside], dance.confidence[inside], dance.estimator)
