"""What the local servers share: the files of their pages, a user's mistakes as JSON, and where they listen."""

import argparse
import asyncio
import contextlib
import errno
import logging
import os
import shutil
import signal
import socket
import tempfile
import threading
import webbrowser
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import TextIO

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from kpopnet.errors import InputError
from kpopnet.languages import LANGUAGES, Said, keyed
from kpopnet.runtime.endings import OF_TERMINAL, is_of_the_disk, of_the_disk
from kpopnet.teacher.safety import HEADERS, LOOPBACK_NAMES, Keys, add_headers, forward_to, guard, is_loopback

PAGE = Path(__file__).parent / "page"
TEXT = "; charset=utf-8"
TYPES = {
    ".html": f"text/html{TEXT}", ".css": f"text/css{TEXT}", ".js": f"text/javascript{TEXT}", ".mjs": f"text/javascript{TEXT}",
    ".svg": f"image/svg+xml{TEXT}", ".LICENSE": f"text/plain{TEXT}", ".wasm": "application/wasm",
}  # fmt: skip

MOST_CONNECTIONS = 64
"""At a time, or a quarter of the files that this process may open; a browser opens up to seven for each page."""

BACKLOG = 24
"""Connections that are accepted at once: a few times as many more than MOST_CONNECTIONS may be open for a moment."""

IDLE_S, REFUSAL_S = 15.0, 1.0
"""How long a connection may say nothing, and how long one that was refused has to read why."""

UPLOAD_S = 60.0
"""Longest time that the body of a request, such as a file, may take to arrive."""

END_S = 2.5
"""Longest time from Ctrl-C to the program's end, of a program that has nothing to save."""


def page_app(index: str, hosts: tuple[str, ...], keys: Keys | None, max_bytes: int) -> web.Application:
    """An application that serves the page in the file `index`, and the files of all pages; `hosts` and `keys` as in
    `safety.guard`, `max_bytes` of a request.
    """

    def served_from(folder: Path) -> Callable[[web.Request], Awaitable[web.FileResponse]]:
        async def serve(request: web.Request) -> web.FileResponse:
            path = folder / request.match_info.get("name", index)
            if not path.is_file():
                raise web.HTTPNotFound(text="there is no such page\n")
            kind = TYPES.get(path.suffix, "application/octet-stream")
            return web.FileResponse(path, headers={"Content-Type": kind})

        return serve

    app = web.Application(middlewares=[guard(hosts, keys), _errors], client_max_size=max_bytes)
    app.on_response_prepare.append(add_headers)
    app.router.add_get("/", served_from(PAGE))
    app.router.add_get(f"/languages/{{name:(?:{'|'.join(LANGUAGES[1:])})\\.mjs}}", served_from(PAGE.parents[1] / "languages"))
    app.router.add_get(
        r"/page/{name:(?:vendor/(?:mediapipe/)?)?[a-z_]+\.(?:js|css|svg|LICENSE|wasm|data|tflite|binarypb)}", served_from(PAGE)
    )
    return app


async def sent(request: web.Request) -> bytes:
    """The body of a request."""
    try:
        return await asyncio.wait_for(request.read(), UPLOAD_S)
    except TimeoutError as error:
        raise web.HTTPRequestTimeout(text="the file did not arrive") from error


@web.middleware
async def _errors(request: web.Request, handler) -> web.StreamResponse:
    try:
        return await handler(request)
    except InputError as error:
        return web.json_response({"error": keyed(error.said)}, status=400)
    except web.RequestPayloadError:
        return web.json_response({"error": keyed(Said("the file is damaged"))}, status=400)
    except web.HTTPRequestEntityTooLarge:
        most = Said("the file is larger than {most} MB", most=f"{request.client_max_size / 1e6:g}")
        return web.json_response({"error": keyed(most)}, status=413)
    except OSError as error:
        if not is_of_the_disk(error):
            raise
        # The names of requests are a stranger's, the disk is this user's.
        return web.json_response({"error": of_the_disk(error)}, status=400 if error.errno == errno.ENAMETOOLONG else 507)


def host(
    make: Callable[[tuple[str, ...], Keys | None], web.Application],
    given: argparse.Namespace,
    greeting: str,
    out: TextIO | None = None,
    end_s: float = END_S,
) -> None:
    """Serves an application until the program is interrupted, and then ends within `end_s` seconds.

    `make` makes it from names of this server and keys, as in `safety.guard`; `given` is the command line with the words of
    `kpopnet.programs.arguments.add_address`. Prints `greeting` and the address to `out`, by default the standard output.
    Raises InputError if the port is taken.
    """
    keys = None if is_loopback(given.host) else Keys()
    app = make((*LOOPBACK_NAMES, given.host.lower()), keys)
    late = threading.Timer(end_s, os._exit, (0,))  # a thread that reads what a page sent would be waited for
    late.daemon = True
    try:
        asyncio.run(_serve(app, given, partial(print, greeting, file=out, flush=True), keys, late.start))
    except asyncio.CancelledError:
        pass  # interrupted
    finally:
        late.cancel()


async def _serve(app: web.Application, given: argparse.Namespace, greet: Callable, keys: Keys | None, ends: Callable) -> None:
    """Serves until this task is cancelled, which a signal does once, also while a camera opens; `ends` is called then."""
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    assert task is not None
    logger = logging.getLogger(__name__)
    logger.addFilter(_Once())
    loop.set_exception_handler(lambda _, told: logger.error(told["message"], exc_info=told.get("exception")))
    for number in (*OF_TERMINAL, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as `nohup` has it
            with contextlib.suppress(NotImplementedError):  # not on every system; there Ctrl-C cancels this task
                loop.add_signal_handler(number, lambda: task.cancelling() or task.cancel())
    runner = web.AppRunner(app, access_log=None, logger=logger, keepalive_timeout=IDLE_S, shutdown_timeout=END_S / 5)
    folder = tempfile.mkdtemp(prefix="kpopnet-")  # which only this user can read
    try:
        await runner.setup()
        runner.server.request_handler = _refusing_headers(runner.server.request_handler)
        try:
            server = await loop.create_server(_Limited(runner.server), given.host, given.port, backlog=BACKLOG)
        except OSError as error:
            # From Python 3.13 on an address that none of the machine's interfaces has is an error without a number.
            if isinstance(error, socket.gaierror) or error.errno in (errno.EADDRNOTAVAIL, None):
                raise InputError(f"--host {given.host}: no address of this machine ({error.strerror or error})") from error
            place = f"--port {given.port}: cannot listen on {given.host}"
            raise InputError(f"{place} ({error.strerror}); choose another port") from error
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(given.host, given.host)  # a server listens at one kind of address
        host = f"[{host}]" if ":" in host else host
        address = f"http://{host}:{server.sockets[0].getsockname()[1]}/"
        greet(f"{address}{f'?token={keys.token}' if keys else ''}   (Ctrl+C ends)")
        if not given.no_browser:
            if keys:  # every user of the machine sees what a browser is given: a file leads to the address with the secret
                page = Path(folder, "open.html")
                page.write_text(forward_to(f"{address}?token={keys.once}"), encoding="utf-8")
                address = page.as_uri()
            # Of some browsers it waits for the end, of others up to 5 s; meanwhile they want the page.
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        try:
            await asyncio.Event().wait()
        finally:
            server.close()
    except asyncio.CancelledError:
        ends()
        raise
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        await runner.cleanup()


def _refusing_headers(handler: Callable) -> Callable:
    """Answers 400 to headers that are no text and 417 to an `Expect` that is not HTTP's.

    aiohttp repeats some of them in its own answers, and fails where they are no text: a 500.
    """

    async def handle(request: web.Request) -> web.StreamResponse:
        if any("\udc80" <= letter <= "\udcff" for value in request.headers.values() for letter in value):
            return web.Response(status=400, text="a header is no text\n", headers=HEADERS)
        if request.headers.get("Expect", "100-continue").lower() != "100-continue":
            return web.Response(status=417, text="Expect: only 100-continue is known\n", headers=HEADERS)
        return await handler(request)

    return handle


class _Once(logging.Filter):
    """Lets each error through once, so that no stranger fills a disk, and none about a request that is no HTTP, or a page that
    has gone: of that asyncio makes an error on Windows.
    """

    def __init__(self) -> None:
        super().__init__()
        self._told: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        error = record.exc_info[1] if record.exc_info else None
        text = f"{record.msg} {type(error).__name__}"
        new = text not in self._told and not isinstance(error, HttpProcessingError | ConnectionError)
        self._told.add(text)
        return new


class _Limited:
    """Answers each new connection: by the server, or beyond the limit by a line that says so."""

    def __init__(self, server: web.Server) -> None:
        self._server, self._refused, self._most = server, set(), MOST_CONNECTIONS
        with contextlib.suppress(ImportError):  # not on every system
            import resource

            self._most = min(MOST_CONNECTIONS, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 4)

    def __call__(self) -> asyncio.BaseProtocol:
        return self._server() if len(self._server.connections) < self._most else _Refusal(self._refused)


TOO_MANY = "too many connections; close other windows of this page, and load it again"


class _Refusal(asyncio.Protocol):
    def __init__(self, refused: set) -> None:
        self._refused = refused

    def connection_made(self, transport: asyncio.Transport) -> None:
        if len(self._refused) >= BACKLOG:
            transport.abort()
            return
        self._refused.add(self)
        text = f"{TOO_MANY}\n".encode()
        head = f"HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nContent-Length: {len(text)}\r\n"
        transport.write(head.encode() + b"Retry-After: 5\r\nConnection: close\r\n\r\n" + text)
        asyncio.get_running_loop().call_later(REFUSAL_S, transport.abort)  # closed at once, the line might not arrive

    def connection_lost(self, exc: Exception | None) -> None:
        self._refused.discard(self)
