"""The local server of `kpopnet live`: a page, and a WebSocket over which every page sees the same and may give orders."""

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator

from aiohttp import WSCloseCode, WSMsgType, web

from kpopnet.errors import InputError
from kpopnet.live.loop import Watching, serve_watching
from kpopnet.runtime.input_files import check_fields, parse_json
from kpopnet.teacher.hosting import now_ms, packed_frame, page_app
from kpopnet.teacher.live.process import Process
from kpopnet.teacher.safety import Keys

MAX_MESSAGE_BYTES = 1024
MOST_PAGES = 16
PATIENCE_S = 30.0
"""Interval of the pings that show whether a page is still there, seconds."""

END_S, SAVE_S = 2.0, 20.0
"""How long the process has to end, seconds, and where it has something to save: an hour of two people takes some seconds."""

ORDERS = ("record", "joints", "pause")


Frame = tuple[dict, bytes]
"""What a page shows of an image, and the picture of its depth."""


class Page:
    """What one page has yet to see: of the frames the newest only, when it has drawn the one before."""

    def __init__(self) -> None:
        self._kept: list[dict] = []
        self._frame: Frame | None = None
        self._wanted = True
        self._heard_ms: tuple[float, float] | None = None
        self._arrived = asyncio.Event()

    def offer(self, message: dict | Frame) -> None:
        if isinstance(message, tuple):
            self._frame = message
        else:
            self._kept.append(message)
        self._arrived.set()

    def drawn(self, page_ms: float) -> None:
        """The page has drawn the last frame, at a time of its own clock."""
        self._heard_ms, self._wanted = (page_ms, now_ms()), True
        self._arrived.set()

    async def send_to(self, socket: web.WebSocketResponse) -> None:
        """Sends what comes until the page has gone."""
        with contextlib.suppress(ConnectionError):
            while True:
                await self._arrived.wait()
                self._arrived.clear()
                while self._kept:
                    await socket.send_str(json.dumps(self._kept.pop(0), allow_nan=False))
                if self._frame is not None and self._wanted:
                    (content, attached), self._frame, self._wanted = self._frame, None, False
                    await socket.send_bytes(packed_frame(content, self._heard_ms, attached))


class Watch:
    """The process that watches, and the pages that look on."""

    def __init__(self, watching: Watching) -> None:
        self._watching = watching
        self._latest: dict[str, dict] = {}
        self._frame: Frame | None = None
        self.pages: dict[Page, web.WebSocketResponse] = {}

    async def running(self, _app: web.Application) -> AsyncIterator[None]:
        """Starts the process before the server, and ends it after; raises InputError where the source cannot be opened."""
        self._process = Process(serve_watching, (self._watching,), "program")
        try:
            kind, content, _ = await self._process.next()
            if kind != "opened":
                raise InputError(content["text"])
            self._tell(kind, content)
            passing_on = asyncio.create_task(self._pass_on())
            yield
            passing_on.cancel()
        finally:
            with contextlib.suppress(InputError):
                self._process.send("quit")
            state = self._latest.get("state", {})
            patience_s = SAVE_S if state.get("keeping") or state.get("recording") else END_S
            await asyncio.to_thread(self._process.end, time.monotonic() + patience_s)

    async def end(self, _app: web.Application) -> None:
        """Closes the pages."""
        await asyncio.gather(*(socket.close(code=WSCloseCode.GOING_AWAY) for socket in list(self.pages.values())))

    async def _pass_on(self) -> None:
        while True:
            kind, content, attached = await self._process.next()
            if kind == "frame":
                self._process.want_frame()
                self._frame = content, attached
                for page in self.pages:
                    page.offer(self._frame)
            else:
                self._tell("state" if kind == "error" else kind, {"paused": False, "ended": True} | content)

    def _tell(self, kind: str, content: dict) -> None:
        message = {"kind": kind} | content
        if kind != "said":
            self._latest[kind] = message
        for page in self.pages:
            page.offer(message)

    def join(self, socket: web.WebSocketResponse) -> Page:
        """A page that has just been opened sees what the others see."""
        page = Page()
        for message in self._latest.values():
            page.offer(message)
        if self._frame is not None:
            page.offer(self._frame)
        self.pages[page] = socket
        self._process.send("watched", True)
        return page

    def leave(self, page: Page) -> None:
        self.pages.pop(page, None)
        if not self.pages:
            with contextlib.suppress(InputError):
                self._process.send("watched", False)

    def follow(self, page: Page, text: str) -> None:
        """Does what a page asks; raises InputError if it asks wrongly."""
        where = "the page's message"
        message = parse_json(text, where)
        if isinstance(message, dict) and message.get("do") == "drawn":
            return page.drawn(check_fields(where, message, {"do": str, "page_ms": float})["page_ms"])
        order = check_fields(where, message, {"do": str, "on": bool})
        if order["do"] not in ORDERS:
            raise InputError("the page asks for something unknown; reload it")
        return self._process.send(order["do"], order["on"])


WATCH: web.AppKey[Watch] = web.AppKey("watch", Watch)
routes = web.RouteTableDef()


def make_watch_app(watching: Watching, hosts: tuple[str, ...], keys: Keys | None = None) -> web.Application:
    """The server's application; `hosts` and `keys` as in `safety.guard`."""
    app = page_app("watch.html", hosts, keys, MAX_MESSAGE_BYTES)
    app[WATCH] = watch = Watch(watching)
    app.cleanup_ctx.append(watch.running)
    app.on_shutdown.append(watch.end)
    app.add_routes(routes)
    return app


@routes.get("/live")
async def live(request: web.Request) -> web.WebSocketResponse:
    """What a page sees and asks for; docs/live.md lists the messages."""
    watch = request.app[WATCH]
    if len(watch.pages) >= MOST_PAGES:
        raise web.HTTPServiceUnavailable(text=f"{MOST_PAGES} windows are open; close one of them\n")
    socket = web.WebSocketResponse(max_msg_size=MAX_MESSAGE_BYTES, heartbeat=PATIENCE_S)
    await socket.prepare(request)
    page = watch.join(socket)
    sending = asyncio.create_task(page.send_to(socket))
    try:
        async for message in socket:
            if message.type is not WSMsgType.TEXT:
                break
            try:
                watch.follow(page, message.data)
            except InputError as error:
                page.offer({"kind": "said", "text": str(error)})
    finally:
        watch.leave(page)
        sending.cancel()
    return socket
