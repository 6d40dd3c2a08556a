"""A page and its server over a WebSocket: what both say, one window after the other."""

import asyncio
import contextlib
import json
import struct
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

SOCKETS: web.AppKey[set[web.WebSocketResponse]] = web.AppKey("sockets", set)


class Page:
    """What a server says to one page, and what becomes of what the page says."""

    refusal = "error"
    """Kind of the message that tells the page what it asked for wrongly."""

    def __init__(self, socket: web.WebSocketResponse) -> None:
        self._socket = socket
        self._heard_ms: tuple[float, float] | None = None

    async def tell(self, message: dict) -> None:
        with contextlib.suppress(ConnectionError):
            await self._socket.send_str(json.dumps(message, allow_nan=False))

    async def show(self, content: dict, picture: bytes) -> None:
        """Sends what the page draws of an image, with two times of one moment, the page's and ours: so it knows our clock."""
        content = {"kind": "frame"} | content | {"sent_ms": _now_ms(), "heard_ms": self._heard_ms}
        text = json.dumps(content, allow_nan=False).encode()
        with contextlib.suppress(ConnectionError):
            await self._socket.send_bytes(struct.pack("<I", len(text)) + text + picture)

    def drawn(self, message: dict) -> None:
        """The page has drawn the last image, at a time of its own clock."""
        self._heard_ms = check_fields("drawn", message, {"page_ms": float})["page_ms"], _now_ms()

    def follow(self, message: Any) -> None:
        """Does what the page asks. Raises InputError if it asks wrongly."""
        raise NotImplementedError

    def leave(self) -> None:
        """The page has gone."""
        raise NotImplementedError


def _now_ms() -> float:
    """The wall clock, as the page's, in milliseconds."""
    return round(1000 * time.time(), 1)


async def converse(request: web.Request, open_page: Callable[..., Page], most_bytes: int) -> web.WebSocketResponse:
    """Opens a page with its socket, and follows its messages, of at most this number of bytes, until it leaves."""
    sockets = request.app[SOCKETS]
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
            try:
                page.follow(parse_json(message.data, "the page's message"))
            except InputError as error:
                await page.tell({"kind": page.refusal, "text": keyed(error.said)})
    finally:
        sockets.discard(socket)
        page.leave()
    return socket


async def close_pages(app: web.Application) -> None:
    """For an application's `on_shutdown`."""
    await asyncio.gather(*(socket.close(code=WSCloseCode.GOING_AWAY) for socket in set(app[SOCKETS])))
