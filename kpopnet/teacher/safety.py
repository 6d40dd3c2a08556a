"""What keeps strangers out: names of this server, origins, a token for other machines, and headers for the browser.

A page of another site can make the browser send requests here, and a name of its own may be made to point here (DNS rebinding).
So a request must name this server as its host and, if it says where it comes from, come from its own page.
"""

import hmac
import ipaddress
from urllib.parse import urlsplit

from aiohttp import web

COOKIE = "kpopnet_token"
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; media-src blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
LOOPBACK_NAMES = ("127.0.0.1", "localhost", "::1")


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches a server that listens at an address or name."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def guard(hosts: tuple[str, ...], token: str | None):
    """Makes the middleware that refuses requests of strangers.

    `hosts` are the names and addresses, without port, that mean this server. The token stands once in the address of a request
    and then in a cookie; a server of this machine alone has none.
    """

    @web.middleware
    async def middleware(request: web.Request, handler) -> web.StreamResponse:
        if refusal := _refusal(request, hosts, token):
            raise web.HTTPForbidden(text=f"{refusal}\n", headers=HEADERS)
        try:
            response = await handler(request)
        except web.HTTPException as error:
            error.headers.update(HEADERS)
            raise
        if not response.prepared:
            response.headers.update(HEADERS)
            if token is not None and "token" in request.query:
                response.set_cookie(COOKIE, token, httponly=True, samesite="Strict")
        return response

    return middleware


def _refusal(request: web.Request, hosts: tuple[str, ...], token: str | None) -> str:
    """Why a request is refused, "" if it is not."""
    host = request.headers.get("Host", "")
    try:
        name = (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        name = ""
    # With a token, any address of this machine will do: only names can be made to point here.
    if name not in hosts and not (token is not None and _is_address(name)):
        return "this server is not known by that name"
    origin, own = request.headers.get("Origin"), f"{request.scheme}://{host}".lower()
    if origin is not None and origin.lower() != own:
        return "a page of another site asks"
    if request.headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none"):
        return "a page of another site asks"
    given = request.query.get("token", request.cookies.get(COOKIE, ""))
    if token is not None and not hmac.compare_digest(given.encode(), token.encode()):
        return "open the address that the program printed, with its token"
    return ""
