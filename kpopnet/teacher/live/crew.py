"""The stages that serve lessons, each in a process of its own; the server talks to them without waiting."""

import asyncio
import contextlib
import multiprocessing
import threading
from typing import Any

from kpopnet.errors import InputError
from kpopnet.teacher.library import TaughtDance
from kpopnet.teacher.live.lesson import Lesson
from kpopnet.teacher.live.stage import Settings, run_stage

MOST = 2
"""Lessons at a time: each takes about a core."""

END_S = 5.0


class Member:
    """One stage and its messages: ("frame", ...) are replaced by newer ones, all others are kept in order."""

    def __init__(self, settings: Settings) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._process = context.Process(target=run_stage, args=(other, settings), daemon=True, name="stage")
        self._process.start()
        other.close()
        self._number = 0
        self._kept: list[tuple] = []
        self._frame: tuple | None = None
        self._loop = asyncio.get_running_loop()
        self._arrived = asyncio.Event()
        threading.Thread(target=self._listen, daemon=True, name="stage listener").start()

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def prepare(self, lesson: Lesson, dance: TaughtDance) -> None:
        """Begins another lesson; what is still said of the one before is forgotten."""
        self._number += 1
        self._kept.clear()
        self._frame = None
        self._send("prepare", self._number, lesson, dance)

    def go(self, in_s: float) -> None:
        self._send("go", in_s)

    def resume(self, in_s: float) -> None:
        """Goes on with a dance that stood still because the camera was away."""
        self._send("resume", in_s)

    def stop(self) -> None:
        """Ends the lesson."""
        self._send("stop")

    async def next(self) -> tuple[str, dict, Any]:
        """The next message: kind, content, and a picture or the learner's arrays."""
        while not self._kept and self._frame is None:
            self._arrived.clear()
            await self._arrived.wait()
        if self._kept:
            return self._kept.pop(0)
        frame, self._frame = self._frame, None
        assert frame is not None
        return frame

    def end(self) -> None:
        """Ends the process."""
        self._send("quit")
        self._process.join(END_S)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(END_S)

    def _send(self, *message: Any) -> None:
        with contextlib.suppress(OSError):  # the listener tells that the process has ended
            self._connection.send(message)

    def _listen(self) -> None:
        try:
            while True:
                self._hand_over(*self._connection.recv())
        except (EOFError, OSError):
            text = "the process that watches you has ended; start the dance again"
            self._hand_over(self._number, "error", {"text": text}, None)

    def _hand_over(self, number: int, *message: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(self._keep, number, message)

    def _keep(self, number: int, message: tuple) -> None:
        if number != self._number:
            return
        if message[0] == "frame":
            self._frame = message
        else:
            self._kept.append(message)
        self._arrived.set()


class Crew:
    """Lends stages to lessons and keeps them warm in between."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._idle: list[Member] = []
        self._busy: set[Member] = set()

    def keep_ready(self) -> None:
        """Starts a stage, so that the first lesson need not wait for it."""
        self._idle.append(Member(self._settings))

    def borrow(self) -> Member:
        """A stage, warm if there is one.

        Raises:
            InputError: MOST lessons are going on.
        """
        self._idle = [member for member in self._idle if member.alive]
        if len(self._busy) >= MOST:
            raise InputError(f"{MOST} dances are going on in other windows; close one of them")
        member = self._idle.pop() if self._idle else Member(self._settings)
        self._busy.add(member)
        return member

    def give_back(self, member: Member) -> None:
        member.stop()
        self._busy.discard(member)
        if member.alive:
            self._idle.append(member)

    def end(self) -> None:
        for member in [*self._idle, *self._busy]:
            member.end()
