"""What the local servers share: the files of their pages, a user's mistakes as JSON, and where they listen."""

import argparse
import secrets
import webbrowser
from collections.abc import Awaitable, Callable
from pathlib import Path

from aiohttp import web

from kpopnet.errors import InputError
from kpopnet.teacher.safety import LOOPBACK_NAMES, guard, is_loopback

PAGE = Path(__file__).parent / "page"
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml", ".LICENSE": "text/plain"}


def page_app(index: str, hosts: tuple[str, ...], token: str | None, max_bytes: int) -> web.Application:
    """An application that serves a page and the files of all pages.

    Args:
        index: file of the page.
        hosts: as in `safety.guard`.
        token: as in `safety.guard`.
        max_bytes: of a request.
    """

    async def page(request: web.Request) -> web.Response:
        path = PAGE / (request.match_info.get("name", index))
        if not path.is_file():
            raise web.HTTPNotFound(text="there is no such page\n")
        return web.Response(body=path.read_bytes(), content_type=TYPES[path.suffix], charset="utf-8")

    app = web.Application(middlewares=[guard(hosts, token), _errors], client_max_size=max_bytes)
    app.router.add_get("/", page)
    app.router.add_get(r"/page/{name:(?:vendor/)?[a-z_]+\.(?:js|css|svg|LICENSE)}", page)
    return app


@web.middleware
async def _errors(request: web.Request, handler) -> web.StreamResponse:
    try:
        return await handler(request)
    except InputError as error:
        return web.json_response({"error": str(error)}, status=400)


def host(
    make: Callable[[tuple[str, ...], str | None], web.Application],
    given: argparse.Namespace,
    greeting: str,
    *at_start: Callable[[web.Application], Awaitable[None]],
) -> None:
    """Serves an application until the program is interrupted.

    Args:
        make: from names of this server and a token, as in `safety.guard`.
        given: the command line with the words of `kpopnet.programs.arguments.add_address`.
        greeting: printed before the address.
        at_start: awaited before.

    Raises:
        InputError: the port is taken.
    """
    token = None if is_loopback(given.host) else secrets.token_urlsafe(24)
    app = make((*LOOPBACK_NAMES, given.host.lower()), token)
    shown = "127.0.0.1" if given.host in ("0.0.0.0", "::") else given.host
    shown = f"[{shown}]" if ":" in shown else shown

    async def announce(app: web.Application) -> None:
        address = f"http://{shown}:{given.port}/" + (f"?token={token}" if token else "")
        print(f"{greeting} {address}   (Ctrl+C ends)", flush=True)
        if not given.no_browser:
            webbrowser.open(address)

    app.on_startup.extend([*at_start, announce])
    try:
        web.run_app(app, host=given.host, port=given.port, print=None, access_log=None, handle_signals=True)
    except OSError as error:
        place = f"--port {given.port}: cannot listen on {given.host}"
        raise InputError(f"{place} ({error.strerror}); choose another port") from error
