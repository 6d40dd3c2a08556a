"""Random requests to a local server: what no page sends, much of it no HTTP."""

import asyncio
import contextlib
import random
from urllib.parse import quote_from_bytes

SERVER_ERRORS = {500, 501, 502, 504}
"""Statuses that nothing a stranger sends may have; 503 says that all connections are taken."""

METHODS = ("GET", "GET", "GET", "POST", "POST", "PUT", "HEAD", "OPTIONS", "DELETE", "TRACE", "CONNECT", "get", "G\xe9T", "")
PATHS = (
    "/", "/page/app.js", "/page/{}.js", "/page/{}", "/page/vendor/{}.LICENSE", "/live", "/api/offer", "/api/dances",
    "/api/dances?file={}.bvh&title={}", "/api/recordings?title={}", "/api/dances/{}", "/api/dances/{}/preview", "/api/body",
    "/api/history/{}",
    "/api/tries/{}/{}.json", "/api/tries/{}/{}.csv", "/api/tries/{}/{}.bvh", "/api/tries/{}/{}.mp4", "/api/tries/{}/{}/film",
    "/api/tries/{}/{}/movement", "/api/pair?rater={}", "/api/answer", "/?token={}", "/{}", "{}", "*", "http://evil.example/{}",
)  # fmt: skip
WORDS = (
    b"dance_001", b"dance_000", b"own_001", b"20260101-000000-000", b"..", b".", b"", b"%", b"%00", b"\0", b"\xed\xa0\x80",
    b"\xff", b"a" * 300, b"-1", b"../../etc/passwd", b"..%2f..%2f", b"{}", b"'\"<b>", "\u202e\U0001f57a".encode(), b"\r\n\r\n",
)  # fmt: skip
HEADERS = (
    b"Cookie: kpopnet_token=\xff\xfe", b'Cookie: "=;;=\\303', b"Cookie: $Version=1; =", b"Origin: null", b"Origin: \xff",
    b"Sec-Fetch-Site: cross-site", b"Content-Length: -1", b"Content-Length: 5", b"Content-Length: 99999999999999999999",
    b"Transfer-Encoding: chunked", b"Transfer-Encoding: gzip, chunked", b"Content-Encoding: gzip", b"Content-Encoding: deflate",
    b"Content-Encoding: br", b"Content-Type: text/plain; charset=\xff", b"Content-Type: application/json; charset=nothing",
    b"Expect: 100-continue", b"Expect: 200-maybe", b"Range: bytes=-9-", b"Range: bytes=5-1", b"If-Range: \xff",
    b"If-Modified-Since: yesterday", b"If-None-Match: *", b"Upgrade: websocket", b"Connection: Upgrade", b"Connection: \xff",
    b"Sec-WebSocket-Key: " + b"A" * 22 + b"==", b"Sec-WebSocket-Version: 13", b"Sec-WebSocket-Version: x", b": no name",
    b"Accept: text/html", b"Accept-Encoding: gzip;q=\xff", b"X: " + b"y" * 9000, b"Authorization: token \xff", b" folded",
)  # fmt: skip
BODIES = (
    b"", b"{}", b"[]", b"x", b'{"rater": "eve", "done": 0, "choice": "left"}', b'{"rater": "\\ud800"}', b"[" * 500,
    b"\xff" * 100, b"5\r\nhello\r\n0\r\n\r\n", b"zz\r\n", b"\x1f\x8b\x08\0", b'{"do": "prepare", "lesson": {"dance": "../x"}}',
    b"\x81\xfe\xff\xff", b"\x81\x85abcd\0\0\0\0\0", b"\x88\x82abcd\x62\x61",
)  # fmt: skip


def random_request(rng: random.Random) -> bytes:
    """One request, with `Connection: close`; most name this server as their host."""
    path = rng.choice(PATHS).split("{}")
    words = [rng.choice(WORDS) if rng.random() < 0.9 else rng.randbytes(rng.randrange(9)) for _ in path[1:]]
    safe = "/.%" if rng.random() < 0.5 else ""
    place = path[0].encode() + b"".join(
        (quote_from_bytes(word, safe).encode() if rng.random() < 0.9 else word) + after.encode()
        for word, after in zip(words, path[1:], strict=True)
    )
    body = rng.choice(BODIES) if rng.random() < 0.5 else b""
    headers = rng.sample(HEADERS, rng.choice((0, 0, 0, 1, 1, 2, 4)))
    headers += [b"Host: 127.0.0.1"] if rng.random() < 0.97 else [b"Host: " + rng.choice(WORDS)]
    if rng.random() < 0.5:
        headers.append(b"Content-Length: %d" % len(body))
    version = b"HTTP/1.1" if rng.random() < 0.98 else rng.choice((b"HTTP/1.0", b"HTTP/9.9", b""))
    rng.shuffle(headers)
    start = b" ".join((rng.choice(METHODS).encode("latin-1"), place, version))
    raw = b"\r\n".join([start, *headers, b"Connection: close", b"", body])
    if rng.random() < 0.03:
        cut = rng.randrange(len(raw))
        raw = raw[:cut] + rng.randbytes(3) + raw[cut + rng.randrange(9) :]
    return raw


async def status_of(port: int, raw: bytes, patience_s: float = 0.5) -> int:
    """The status that a server on this machine answers; 0 where it closes the connection, or waits for more."""
    try:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
    except ConnectionError:
        return 0
    try:
        writer.write(raw)
        line = await asyncio.wait_for(reader.readline(), patience_s)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(reader.read(), 0.05)
        return int(line.split()[1]) if line.startswith(b"HTTP/") else 0
    except (TimeoutError, ConnectionError):
        return 0
    finally:
        writer.transport.abort()
