"""What keeps strangers out: names of this server, origins, a token for other machines, and headers for the browser.

A page of another site can make the browser send requests here, and a name of its own may be made to point here (DNS rebinding).
So a request must name this server as its host and, if it says where it comes from, come from its own page.
"""

import hmac
import ipaddress
import secrets
from urllib.parse import urlsplit

from aiohttp import web

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; style-src 'self'; "
        "img-src 'self' data: blob:; media-src blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-cache",
    "Server": "kpopnet",
}
LOOPBACK_NAMES = ("127.0.0.1", "localhost", "::1")


class Keys:
    """The secrets of a server that other machines reach.

    Attributes:
        token: stands in the printed address. Whoever opens that gets the cookie.
        once: does the same, one time: for the file that this machine's browser opens.
        cookie: its name, which servers on other ports of this machine do not share, and its value.
    """

    def __init__(self) -> None:
        self.token, self.once, value = (secrets.token_urlsafe(24) for _ in range(3))
        self.cookie = f"kpopnet_{secrets.token_hex(4)}", value

    def admit(self, token: str) -> bool:
        """Whether a token gets the cookie."""
        if _same(token, self.once):
            self.once = secrets.token_urlsafe(24)
            return True
        return _same(token, self.token)


def _same(given: str, secret: str) -> bool:
    return hmac.compare_digest(given.encode(errors="surrogateescape"), secret.encode())


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches a server that listens at an address or name."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


async def add_headers(_request: web.BaseRequest, response: web.StreamResponse) -> None:
    """For an application's `on_response_prepare`: errors, files and WebSockets get the headers too."""
    response.headers.update(HEADERS)


def guard(hosts: tuple[str, ...], keys: Keys | None):
    """Makes the middleware that refuses requests of strangers.

    `hosts` are the names and addresses, without port, that mean this server; a server of this machine alone has no keys.
    """

    @web.middleware
    async def middleware(request: web.Request, handler) -> web.StreamResponse:
        host = request.headers.get("Host", "")
        name = _host_name(host)
        # With keys, any address of this machine will do: only names can be made to point here.
        if name not in hosts and not (keys is not None and _is_address(name)):
            raise _refused("this server is not known by that name")
        if keys is not None and request.path == "/" and "token" in request.query:
            return _entrance(keys, request.query["token"])
        own = f"{request.scheme}://{host}".lower()
        site = request.headers.get("Sec-Fetch-Site", "same-origin")
        if request.headers.get("Origin", own).lower() != own or site not in ("same-origin", "none"):
            raise _refused("a page of another site asks")
        if keys is not None and not _same(request.cookies.get(keys.cookie[0], ""), keys.cookie[1]):
            raise _refused(NO_TOKEN)
        return await handler(request)

    return middleware


def _host_name(host: str) -> str:
    """The name or address of a `Host` header, "" for what is none."""
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _refused(why: str) -> web.HTTPForbidden:
    return web.HTTPForbidden(text=f"{why}\n")


NO_TOKEN = "open the address that the program printed, with its token"


def _entrance(keys: Keys, token: str) -> web.Response:
    """Exchanges a token for the cookie.

    A browser sends a strict cookie with what this server's own page opens only, not where a file or another site led it here:
    so this is a page, which goes on to the real one, and not a redirection.
    """
    if not keys.admit(token):
        raise _refused(NO_TOKEN)
    response = web.Response(text=forward_to("/"), content_type="text/html")
    response.set_cookie(*keys.cookie, httponly=True, samesite="Strict")
    return response


def forward_to(address: str) -> str:
    """A page that opens an address, which holds no quotes, in its place."""
    return f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0;url={address}"><title>kpopnet</title>\n'
