"""Pages and the processes behind them: what they say to each other, over a WebSocket and through a pipe."""

import asyncio
import contextlib
import json
import multiprocessing
import queue
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from kpopnet.errors import InputError
from kpopnet.languages import keyed
from kpopnet.runtime.input_files import check_fields, parse_json

MOST_PAGES = 16
"""WebSockets at a time: other connections must be left for what the pages ask for."""

PATIENCE_S = 30.0
"""Interval of the pings that show whether a page is still there, seconds."""

UNKNOWN = "the page asks for something unknown; reload it"

MOST_UNSENT = 100
"""Messages that wait for a process which takes none."""


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

    def __init__(self, work: Callable[..., None], given: tuple, name: str, ended: str) -> None:
        """Starts a function of a module with one end of a pipe and what it is `given`; `ended` is its last message, an error.

        It sends (number, kind, content, attached); those of another than the current number are dropped.
        """
        super().__init__()
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._process = context.Process(target=work, args=(other, *given), daemon=True, name=name)
        self._process.start()
        other.close()
        self._ended, self._number = ended, 0
        self._loop = asyncio.get_running_loop()
        self._unsent: queue.Queue[tuple] = queue.Queue(MOST_UNSENT)
        for passed_on in (self._listen, self._pass_on):
            threading.Thread(target=passed_on, daemon=True, name=f"{name} {passed_on.__name__}").start()

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def send(self, *message: Any) -> None:
        """Sends a message, such as ("go", 2.0), without waiting. Raises InputError if the process takes none."""
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
            self._hand_over(self._number, "error", {"text": self._ended}, None)
            with contextlib.suppress(queue.Full):
                self._unsent.put_nowait(("quit",))  # with which `_pass_on` ends

    def _hand_over(self, number: int, *message: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(self._put_current, number, *message)

    def _put_current(self, number: int, *message: Any) -> None:
        if number == self._number:
            self.put(*message)


class Page:
    """What a server says to one page, and what becomes of what the page says."""

    refusal = "error"
    """Kind of the message that tells the page what it asked for wrongly."""

    def __init__(self, socket: web.WebSocketResponse) -> None:
        self._socket = socket
        self._heard_ms: tuple[float, float] | None = None
        self._messages: Messages | None = None
        self._passing_on: asyncio.Task | None = None

    def hear(self, messages: Messages | None) -> None:
        """Passes these messages on to the page, in place of those before."""
        if self._passing_on is not None:
            self._passing_on.cancel()
        self._messages, self._passing_on = messages, messages and asyncio.create_task(self._pass_on(messages))

    async def _pass_on(self, messages: Messages) -> None:
        while True:
            kind, content, attached = await messages.next()
            if kind == "frame":
                await self._show(content, attached)
            elif (told := await self.told(kind, content, attached)) is not None:
                await self._tell({"kind": kind} | told)

    async def told(self, kind: str, content: dict, attached: Any) -> dict | None:
        """What the page is told of a message, None for nothing."""
        return content

    async def _tell(self, message: dict) -> None:
        with contextlib.suppress(ConnectionError):
            await self._socket.send_str(json.dumps(message, allow_nan=False))

    async def _show(self, content: dict, picture: bytes) -> None:
        """Sends what the page draws of an image, with two times of one moment, the page's and ours: so it knows our clock."""
        content = {"kind": "frame"} | content | {"sent_ms": _now_ms(), "heard_ms": self._heard_ms}
        text = json.dumps(content, allow_nan=False).encode()
        with contextlib.suppress(ConnectionError):
            await self._socket.send_bytes(struct.pack("<I", len(text)) + text + picture)

    async def do(self, text: str) -> None:
        """Does what the page asks, or tells it what it asked for wrongly."""
        try:
            message = parse_json(text, "the page's message")
            what = check_fields("the page's message", message, {"do": str})["do"]
            if what == "drawn":  # the last image, at a time of the page's own clock
                self._heard_ms = check_fields(what, message, {"page_ms": float})["page_ms"], _now_ms()
                if self._messages is not None:
                    self._messages.want_frame()
            else:
                await self.follow(what, message)
        except InputError as error:
            await self._tell({"kind": self.refusal, "text": keyed(error.said)})

    async def follow(self, what: str, message: dict) -> None:
        """Does what the page asks. Raises InputError if it asks wrongly."""
        raise NotImplementedError

    def leave(self) -> None:
        """The page has gone."""
        raise NotImplementedError


def _now_ms() -> float:
    """The wall clock, as the page's, in milliseconds."""
    return round(1000 * time.time(), 1)


def add_pages(app: web.Application, open_page: Callable[[web.WebSocketResponse], Page], most_bytes: int) -> None:
    """Adds /live, where each page opens with a socket and is followed until it leaves; of messages of `most_bytes` at most."""
    sockets: set[web.WebSocketResponse] = set()

    async def live(request: web.Request) -> web.WebSocketResponse:
        if len(sockets) >= MOST_PAGES:
            raise web.HTTPServiceUnavailable(text=f"{MOST_PAGES} windows are open; close one of them\n")
        socket = web.WebSocketResponse(max_msg_size=most_bytes, heartbeat=PATIENCE_S)
        await socket.prepare(request)
        page = open_page(socket)
        sockets.add(socket)
        try:
            async for message in socket:
                if message.type is not WSMsgType.TEXT:
                    break
                await page.do(message.data)
        finally:
            sockets.discard(socket)
            page.leave()
        return socket

    async def close(_app: web.Application) -> None:
        await asyncio.gather(*(socket.close(code=WSCloseCode.GOING_AWAY) for socket in set(sockets)))

    app.router.add_get("/live", live)
    app.on_shutdown.append(close)
