"""The processes of lessons, as the server sees them."""

import contextlib
import time

from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.teacher.library import TaughtDance
from kpopnet.teacher.live.lesson import CameraOpener, Lesson
from kpopnet.teacher.live.loop import serve_lessons
from kpopnet.teacher.live.webcam import SeenPicture
from kpopnet.teacher.pages import Process

MOST = 2
"""Lessons at a time: each takes about a core."""

END_S = 1.0
"""How long the processes have to end by themselves, seconds."""


class LessonProcess(Process):
    """The process of one lesson after another."""

    def __init__(self, open_camera: CameraOpener, checkpoint: str | None) -> None:
        ended = "the process that watches you has ended; start the dance again"
        super().__init__(serve_lessons, (open_camera, checkpoint), "dance", ended)

    def prepare(self, lesson: Lesson, dance: TaughtDance) -> None:
        """Begins another lesson; messages of the one before are dropped."""
        self._number += 1
        self.clear()
        self.send("prepare", self._number, lesson, dance)

    def see(self, seen: SeenPicture) -> None:
        """Passes on what a webcam saw; drops it where the process is busy, as while it compiles."""
        if self._unsent.empty():
            self.send("see", seen)


class LessonProcesses:
    """Lends processes to pages and keeps them warm in between."""

    def __init__(self, open_camera: CameraOpener, checkpoint: str | None) -> None:
        self._given = open_camera, checkpoint
        self._idle: list[LessonProcess] = []
        self._busy: set[LessonProcess] = set()

    def keep_ready(self) -> None:
        """Starts a process, so that the first lesson need not wait for it."""
        self._idle.append(LessonProcess(*self._given))

    def borrow(self) -> LessonProcess:
        """A process, warm if there is one. Raises InputError if MOST lessons are going on."""
        self._idle = [process for process in self._idle if process.alive]
        if len(self._busy) >= MOST:
            raise InputError(Said("{count} dances are going on in other windows; close one of them", count=MOST))
        process = self._idle.pop() if self._idle else LessonProcess(*self._given)
        self._busy.add(process)
        return process

    def give_back(self, process: LessonProcess) -> None:
        self._busy.discard(process)
        try:
            process.send("stop")
        except InputError:
            process.end(time.monotonic())
        if process.alive:
            self._idle.append(process)

    def end(self) -> None:
        """Ends all processes within END_S."""
        processes, by_s = [*self._idle, *self._busy], time.monotonic() + END_S
        for process in processes:
            with contextlib.suppress(InputError):
                process.send("quit")
        for process in processes:
            process.end(by_s)
