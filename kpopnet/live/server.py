"""The local server of `kpopnet live`: a page, and a WebSocket over which every page sees the same and may give orders."""

import asyncio
import contextlib
import sys
import time
from collections.abc import AsyncIterator
from functools import partial
from typing import Any

from aiohttp import web

from kpopnet.errors import InputError
from kpopnet.live.loop import Watching, serve_watching
from kpopnet.runtime.input_files import check_fields
from kpopnet.teacher.hosting import page_app
from kpopnet.teacher.pages import UNKNOWN, Messages, Page, Process, add_pages
from kpopnet.teacher.safety import Keys

MAX_MESSAGE_BYTES = 1024
END_S, SAVE_S, LAST_S = 2.0, 120.0, 1.0
"""How long the process has to end, seconds, and where it has something to save: an hour of one person takes two seconds of a
core. How long its last words, which are on their way then, may take."""

ORDERS = ("record", "joints", "pause")


class Watch:
    """The process that watches, and the pages that look on."""

    def __init__(self, watching: Watching) -> None:
        self._watching, self._is_over = watching, False
        self._latest: dict[str, tuple] = {}
        self._pages: set[Messages] = set()

    async def running(self, _app: web.Application) -> AsyncIterator[None]:
        """Starts the process before the server, and ends it after; raises InputError where the source cannot be opened."""
        ended = "the process that watches you has ended; start the program again"
        self._process = Process(serve_watching, (self._watching,), "live", ended)
        self.order = self._process.send
        try:
            kind, content, attached = await self._process.next()
            if kind != "opened":
                raise InputError(content["text"])
            self._tell(kind, content, attached)
            passing_on = asyncio.create_task(self._pass_on())
            yield
        finally:
            self._is_over = True
            with contextlib.suppress(InputError):
                self.order("quit")
            _, state, _ = self._latest.get("state", ("", {}, None))
            patience_s = SAVE_S if state.get("keeping") or state.get("recording") else END_S
            await asyncio.to_thread(self._process.end, time.monotonic() + patience_s)
        await asyncio.wait([passing_on], timeout=LAST_S)
        passing_on.cancel()

    async def _pass_on(self) -> None:
        """Passes on what the process says until it has ended; what it says last, as where joints are, no page sees any more."""
        while (message := await self._process.next())[0] != "error":
            if message[0] == "said" and self._is_over:
                print(message[1]["text"], file=sys.stderr)
            self._tell(*message)
            self._process.want_frame()
        self._tell("state", {"paused": False, "ended": True} | message[1], None)

    def _tell(self, kind: str, content: dict, attached: Any) -> None:
        if kind != "said":
            self._latest[kind] = kind, content, attached
        if kind == "state" and content["ended"] and not self._is_over:  # who reads the stream alone sees no page
            print(content["text"], file=sys.stderr)
        for page in self._pages:
            page.put(kind, content, attached)

    def join(self, page: Messages) -> None:
        """A page that has just been opened sees what the others see."""
        for kind in sorted(self._latest, key=lambda one: one == "frame"):  # the picture last
            page.put(*self._latest[kind])
        self.order("watched", True)
        self._pages.add(page)

    def leave(self, page: Messages) -> None:
        self._pages.discard(page)
        if not self._pages:
            with contextlib.suppress(InputError):
                self.order("watched", False)


class WatchPage(Page):
    """A page, and what it has yet to see."""

    refusal = "said"

    def __init__(self, socket: web.WebSocketResponse, watch: Watch) -> None:
        super().__init__(socket)
        self._watch, self._waiting = watch, Messages()
        watch.join(self._waiting)
        self.hear(self._waiting)

    async def follow(self, what: str, message: dict) -> None:
        if what not in ORDERS:
            raise InputError(UNKNOWN)
        self._watch.order(what, check_fields(what, message, {"on": bool})["on"])

    def leave(self) -> None:
        self._watch.leave(self._waiting)
        self.hear(None)


def make_watch_app(watching: Watching, hosts: tuple[str, ...], keys: Keys | None = None) -> web.Application:
    """The server's application; `hosts` and `keys` as in `safety.guard`. docs/live.md lists the messages of pages."""
    app, watch = page_app("watch.html", hosts, keys, MAX_MESSAGE_BYTES), Watch(watching)
    app.cleanup_ctx.append(watch.running)
    add_pages(app, partial(WatchPage, watch=watch), MAX_MESSAGE_BYTES)
    return app
