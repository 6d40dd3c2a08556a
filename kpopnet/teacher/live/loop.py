"""The process of a lesson: newest image, joints, score and messages, in real time and away from the server.

The server sends ("prepare", number, lesson, dance), ("go", seconds), ("pause",), ("resume", seconds), ("see", what a webcam
saw), ("stop",) and ("quit",). It gets the number of the lesson, a kind, its content as JSON, and a picture, the learner's
joints or None.
"""

import contextlib
import logging
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection

import numpy as np
from numba.core import event

from kpopnet.dance.joint_files.mediapipe import WEBCAM
from kpopnet.dance.noise.table import NOISE
from kpopnet.errors import InputError
from kpopnet.languages import Said, keyed
from kpopnet.pose import PersonPose, PoseEstimator
from kpopnet.runtime.parallel import end_with_parent
from kpopnet.skeleton import Joint
from kpopnet.sources.live import NewestImage
from kpopnet.teacher.library import SHOWN_BY, TaughtDance
from kpopnet.teacher.live.lesson import CameraOpener, DanceClock, Lesson
from kpopnet.teacher.live.score import Calibration, DanceTry, kept_formation, together
from kpopnet.teacher.live.webcam import NO_DEPTH_M, SeenPicture, WebcamCamera, WebcamEstimator
from kpopnet.teacher.live.words import rounded

log = logging.getLogger(__name__)

PICTURE_WIDTH = 160
NEAR_M, FAR_M = 0.5, 5.5
"""Range of depth that the picture shows."""

STEADY_FRAMES, STEADY_S = 5, 0.15
"""The estimator is ready when it took less than STEADY_S seconds for each of STEADY_FRAMES successive images."""

KERNELS = 60
"""About how many kernels are compiled where nothing is cached: for the progress bar."""

FRAME_PATIENCE_S, PICTURE_PATIENCE_S = 0.2, 0.02
"""How long a lesson waits for the next image or message; and for the thread that hands on a webcam's picture which has come."""

NOBODY_PATIENCE_S = 20.0
"""After this time the lesson is ready although no person is in view; the page says so."""

LOST_S = 3.0
"""How long the learner may be out of view before another person is taken for the learner."""

PEOPLE, BYSTANDERS = 2, 2
"""People whose joints are estimated, where no lesson says how many learn; and in a lesson, beside the learners."""

NEARER_M = 0.5
"""Before the dance begins, who stands nearer to the middle by this distance is the learner."""


def load_estimator(checkpoint: str | None, people: int = PEOPLE, mode: str = "realtime") -> PoseEstimator:
    """The estimator of a checkpoint: None is the package's network, or the tracker without one; "tracker" the tracker.

    `mode` is that of a network. Raises InputError if the checkpoint cannot be loaded.
    """
    if checkpoint != "tracker":
        try:
            return PoseEstimator.load(checkpoint, mode, people)
        except InputError as error:
            if checkpoint is not None:
                raise
            log.warning("%s; the tracker without a network estimates the joints, with larger errors", error)
    return PoseEstimator(None, "tracker", people)


def noise_of(estimator: PoseEstimator) -> str:
    """The name in `NOISE` of an estimator's known errors, or none."""
    name = getattr(estimator, "name", getattr(estimator, "mode", ""))
    if name == "best":  # which reads no later images in a lesson
        return SHOWN_BY
    return name if name in NOISE else "none"


def off_middle_m(person: PersonPose) -> float:
    """How far beside the camera's axis a person stands, metres."""
    return abs(float(np.nan_to_num(person.joints_camera_m[Joint.TORSO, 0], nan=99.0)))


class Learners:
    """Chooses the learners among the people in view, those nearest to the middle, and stays with them once the dance has begun.

    Who walks by then does not take over.
    """

    def __init__(self, count: int) -> None:
        self._known: list[tuple[int | None, float]] = [(None, 0.0)] * count  # the identity of each, and when it was seen last

    def choose(self, people: list[PersonPose], now: float, begun: bool) -> list[PersonPose | None]:
        """The pose of each learner in one image, at `now` seconds, None of one who is not there; no person is two of them."""
        poses = []
        for number, (identity, seen) in enumerate(self._known):
            others = {one for one, _ in self._known if one != identity}
            free = [person for person in people if person.identity not in others]
            pose = next((person for person in free if person.identity == identity), None)
            nearest = min(free, key=off_middle_m, default=None)
            if (pose is None and (identity is None or now - seen >= LOST_S)) or (
                pose is not None and nearest is not None and not begun and off_middle_m(pose) - off_middle_m(nearest) > NEARER_M
            ):
                pose = nearest
            if pose is not None:
                self._known[number] = pose.identity, now
            poses.append(pose)
        return poses

    def in_order(self, poses: list[PersonPose | None]) -> list[PersonPose | None]:
        """Counts them from the left, as they face the camera, if all are seen; their poses in that order."""
        seen = [pose for pose in poses if pose is not None]
        if len(seen) < len(poses):
            return poses
        order = np.argsort([-one.joints_camera_m[Joint.TORSO, 0] for one in seen], kind="stable").tolist()
        self._known = [self._known[place] for place in order]
        return [poses[place] for place in order]


def taught_to(lesson: Lesson, dance: TaughtDance) -> list[int]:
    """Whom of the dancers each learner dances: neighbours from `lesson.dancer` on; the last one twice if there are too few."""
    last = len(dance.dancers) - 1
    begin = max(min(lesson.dancer, last + 1 - lesson.people), 0)
    return [min(begin + learner, last) for learner in range(lesson.people)]


class CompiledKernels(event.Listener):
    """Counts the kernels that this process has compiled."""

    def __init__(self) -> None:
        self.count = 0
        event.register("numba:compile", self)

    def on_start(self, event: event.Event) -> None:
        self.count += 1

    def on_end(self, event: event.Event) -> None:
        pass


def serve_lessons(connection: Connection, open_camera: CameraOpener, checkpoint: str | None) -> None:
    """Holds one lesson after another until the other end says so, or closes; the estimator stays warm."""
    end_with_parent()
    with contextlib.suppress(EOFError, BrokenPipeError, KeyboardInterrupt):
        kernels, estimator = CompiledKernels(), load_estimator(checkpoint, mode="best")  # two passes for everybody
        while (message := connection.recv())[0] != "quit":
            if message[0] != "prepare":
                continue  # of a lesson that has ended
            _, number, lesson, dance = message
            dance = dance if checkpoint is None else dance.without_seen()

            def tell(kind: str, content: dict, attached: object = None, number: int = number) -> None:
                connection.send((number, kind, keyed(content), attached))

            try:
                tell("preparing", {"fraction": 0.0, "text": "opening the camera"})
                running = RunningLesson(lesson, dance, open_camera, estimator, tell)
                with contextlib.closing(running):
                    if running.warm(kernels, connection):
                        running.hold(connection)
            except InputError as error:
                tell("error", {"text": error.said})


class RunningLesson:
    """One lesson: as many tries of its dance as the page asks for."""

    def __init__(
        self, lesson: Lesson, dance: TaughtDance, open_camera: CameraOpener, estimator: PoseEstimator, tell: Callable[..., None]
    ) -> None:
        self._webcam = WebcamCamera() if lesson.source == WEBCAM else None
        self._lesson, self._dance, self._tell = lesson, dance, tell
        self._estimator = WebcamEstimator() if self._webcam else estimator
        if self._webcam and lesson.people > 1:
            raise InputError(Said("a webcam follows one learner; several need a depth camera"))
        self._estimator.people = lesson.people + BYSTANDERS
        self._taught, self._learners = taught_to(lesson, dance), Learners(lesson.people)
        self._clock, self._away = DanceClock(lesson.from_s, lesson.speed), ""
        self._tries = self._new_tries()
        camera = self._webcam or open_camera(lesson, dance, self._clock)
        self._camera, self.images = camera.camera, NewestImage(camera)
        self._patience_s = PICTURE_PATIENCE_S if self._webcam else FRAME_PATIENCE_S
        self._estimator.reset()

    def close(self) -> None:
        """Lets go of the camera; of a webcam the thread that reads it waits for what the page sends, of a recording for the
        moment of the dance to which the next image belongs.
        """
        self._clock.stop()
        if self._webcam:
            self._webcam.keep(SeenPicture(None, time.monotonic()))
        self.images.close()

    @property
    def _seen_s(self) -> float:
        """Up to where the dance was scored."""
        return max(one.seen_s for one in self._tries)

    def _new_tries(self) -> list[DanceTry]:
        kind, how = Calibration if self._lesson.calibrate else DanceTry, (noise_of(self._estimator), self._clock)
        return [kind(replace(self._lesson, dancer=dancer), self._dance.dancers[dancer], *how) for dancer in self._taught]

    def warm(self, kernels: CompiledKernels, connection: Connection) -> bool:
        """Compiles everything that the lesson needs, with progress, until poses come in real time.

        Returns whether the lesson goes on.
        """
        self._tries[0].compile()
        steady, began = 0, time.monotonic()
        while steady < STEADY_FRAMES and time.monotonic() - began < NOBODY_PATIENCE_S + kernels.count:
            if not self._follow(connection):
                return False
            image = self.images.fetch(self._patience_s)
            if image is None:
                if self.images.ended:
                    raise InputError(self.images.error or "the recording ended before the dance began")
                if self.images.away:
                    began = time.monotonic()
                    self._tell("preparing", {"fraction": 0.0, "text": self.images.away})
                continue
            before = time.monotonic()
            people = self._estimator.update(image.depth_m, self._camera, image.taken)
            steady = steady + 1 if people and time.monotonic() - before < STEADY_S else 0
            text = "preparing the scorer for this machine, once" if kernels.count else "looking for you"
            self._tell("preparing", {"fraction": min(kernels.count / KERNELS, 0.9), "text": text})
        return True

    def hold(self, connection: Connection) -> None:
        """Follows the server's messages until the lesson ends, and handles each image."""
        size = {"width": self._camera.width, "height": self._camera.height}
        self._tell("ready", size | {"from_s": self._tries[0].begin_s, "to_s": self._tries[0].end_s})
        while self._follow(connection):
            self._step()

    def _follow(self, connection: Connection) -> bool:
        """Does what the server has sent; returns whether the lesson goes on. A webcam's pictures are sent: it waits for one."""
        patience_s = FRAME_PATIENCE_S if self._webcam else 0.0
        while connection.poll(patience_s):
            patience_s, (kind, *words) = 0.0, connection.recv()
            if kind == "go":
                self._tries = self._new_tries()
                self._clock.start(*words)
            elif kind == "pause" and self._clock.running:
                self._clock.pause(self._seen_s)
                self._tell("paused", {"from_s": self._clock.paused_s})
            elif kind == "resume":
                self._clock.resume(*words)
            elif kind == "see" and self._webcam:
                self._webcam.keep(*words)
            elif kind in ("stop", "quit"):
                return False
        return True

    def _step(self) -> None:
        """One image: pose, score, and what the page shows of it."""
        images, clock = self.images, self._clock
        image = images.fetch(self._patience_s)
        self._follow_away(images.away)
        if image is not None:
            people = self._estimator.update(image.depth_m, self._camera, image.taken)
            poses = self._learners.choose(people, image.taken, begun=not clock.stopped)
            if self._dance.others and clock.stopped:
                poses = self._learners.in_order(poses)
            shown = [one.see(image, pose, self._camera) for one, pose in zip(self._tries, poses, strict=True)]
            content = shown[0] | {"dropped": images.dropped, "others": shown[1:]}
            if self._lesson.record and poses[0] is not None:
                self._tell("joints", {"taken_ms": content["taken_ms"], "joints": as_rows(poses[0])})
            self._tell("frame", content, picture(NO_DEPTH_M if self._webcam else image.depth_m))
        for member, one in enumerate(self._tries):
            if (verdict := one.next_verdict()) is not None:
                self._tell("verdict", verdict | {"member": member})
        if (clock.running and self._tries[0].is_over) or (images.ended and not clock.stopped):  # also in a pause
            clock.stop()
            (result, arrays), *others = [one.finish(images.dropped) for one in self._tries]
            for other, of_other in others:
                self._tell("member", other | {"who": ""}, of_other)
            common = self._in_common([arrays, *(one for _, one in others)]) if others else {}
            self._tell("done", result | common, arrays)
        elif images.ended:
            raise InputError(images.error or "the recording of depth has ended")

    def _in_common(self, members: list[dict[str, np.ndarray]]) -> dict:
        """What several learners have in common: the formation of a group, else how alike they danced the one dance."""
        if len(set(self._taught)) < len(members):
            return {"together": together(members, self._dance.about.free_s, self._lesson.speed)}
        return {"formation": kept_formation([self._dance.dancers[dancer] for dancer in self._taught], members)}

    def _follow_away(self, away: str) -> None:
        """While the camera is away the dance stands still where the learner was seen last; the page asks to resume it."""
        if away and (self._clock.running or not self._away):  # also a dance that began while it was away
            if self._clock.running:
                self._clock.pause(self._seen_s)
            self._tell("away", {"text": away})
        elif self._away and not away:
            self._tell("back", {"from_s": self._clock.paused_s})
        self._away = away


def as_rows(pose: PersonPose) -> list[list[float | None]]:
    """For each joint x, y and z in metres in the camera's frame, and its confidence, as JSON; null where it is missing."""
    return [[rounded(value, 4) for value in row] for row in np.column_stack([pose.joints_camera_m, pose.confidence])]


def picture(depth_m: np.ndarray, most_wide: int = PICTURE_WIDTH) -> bytes:
    """A small picture of (H, W) depth: width and height as two uint16, then a byte a pixel, 0 not measured, 1 near, 255 far."""
    stride = max(1, round(max(depth_m.shape) / most_wide))
    small = depth_m[::stride, ::stride]
    shade = 1 + np.clip((small - NEAR_M) / (FAR_M - NEAR_M), 0, 1) * 254
    pixels = np.where(small > 0, shade, 0).astype(np.uint8)
    return np.array(pixels.shape[::-1], "<u2").tobytes() + pixels.tobytes()
