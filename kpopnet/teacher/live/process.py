"""The processes that watch, as a server sees them: it talks to them without waiting."""

import asyncio
import contextlib
import multiprocessing
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.teacher.library import TaughtDance
from kpopnet.teacher.live.lesson import CameraOpener, Lesson
from kpopnet.teacher.live.loop import serve_lessons
from kpopnet.teacher.live.webcam import Seen

MOST = 2
"""Lessons at a time: each takes about a core."""

MOST_UNSENT = 100
"""Messages that wait for a process which takes none."""

END_S = 1.0
"""How long the processes have to end by themselves, seconds."""


class Messages:
    """Messages in order: kind, content, and what is attached. Of the images ("frame", ...) only the newest is kept, until the
    page wants it, so that none waits at a page that draws slowly.
    """

    def __init__(self) -> None:
        self._arrived = asyncio.Event()
        self.clear()

    def clear(self) -> None:
        self._kept: list[tuple[str, dict, Any]] = []
        self._frame_wanted = True

    def put(self, kind: str, content: dict, attached: Any) -> None:
        if kind != "verdict":  # a newer frame, or a message after which an older one says what no longer holds
            self._kept = [one for one in self._kept if one[0] != "frame"]
        self._kept.append((kind, content, attached))
        self._arrived.set()

    async def next(self) -> tuple[str, dict, Any]:
        """The next message. After a frame none until `want_frame`."""
        while True:
            for place, (kind, *_) in enumerate(self._kept):
                if kind != "frame" or self._frame_wanted:
                    self._frame_wanted &= kind != "frame"
                    return self._kept.pop(place)
            self._arrived.clear()
            await self._arrived.wait()

    def want_frame(self) -> None:
        """The page has drawn the last frame: the newest may follow."""
        self._frame_wanted = True
        self._arrived.set()


class Process(Messages):
    """One process and what it says."""

    def __init__(self, work: Callable[..., None], given: tuple, name: str) -> None:
        """Starts a function of a module with one end of a pipe and what it is `given`.

        It sends (number, kind, content, attached); those of another than the current number are dropped.
        """
        super().__init__()
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._process = context.Process(target=work, args=(other, *given), daemon=True, name=name)
        self._process.start()
        other.close()
        self._name, self._number = name, 0
        self._loop = asyncio.get_running_loop()
        self._unsent: queue.Queue[tuple] = queue.Queue(MOST_UNSENT)
        for passed_on in (self._listen, self._pass_on):
            threading.Thread(target=passed_on, daemon=True, name=f"{name} {passed_on.__name__}").start()

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def send(self, *message: Any) -> None:
        """Sends a message of `loop`, such as ("go", 2.0), without waiting. Raises InputError if the process takes none."""
        try:
            self._unsent.put_nowait(message)
        except queue.Full as error:
            raise InputError("the process that watches you does not answer; close this page and open it again") from error

    def end(self, by_s: float) -> None:
        """Ends the process, which was told "quit", at a moment of `time.monotonic` at the latest."""
        self._process.join(max(by_s - time.monotonic(), 0))
        self._process.kill()  # also one that is frozen
        self._process.join()

    def _pass_on(self) -> None:
        with contextlib.suppress(OSError):  # the listener notices that the process has ended
            while True:
                self._connection.send(self._unsent.get())

    def _listen(self) -> None:
        try:
            while True:
                self._hand_over(*self._connection.recv())
        except (EOFError, OSError):
            text = f"the process that watches you has ended; start the {self._name} again"
            self._hand_over(self._number, "error", {"text": text}, None)

    def _hand_over(self, number: int, *message: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(self._put_current, number, *message)

    def _put_current(self, number: int, *message: Any) -> None:
        if number == self._number:
            self.put(*message)


class LessonProcess(Process):
    """The process of one lesson after another."""

    def __init__(self, open_camera: CameraOpener, checkpoint: str | None) -> None:
        super().__init__(serve_lessons, (open_camera, checkpoint), "dance")

    def prepare(self, lesson: Lesson, dance: TaughtDance) -> None:
        """Begins another lesson; messages of the one before are dropped."""
        self._number += 1
        self.clear()
        self.send("prepare", self._number, lesson, dance)

    def see(self, seen: Seen) -> None:
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
