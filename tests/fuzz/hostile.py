"""What hostile files aim at (code that runs, files elsewhere, memory, the terminal), and mutations of bytes, text and JSON."""

import contextlib
import functools
import json
import os
import signal
import sys
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.errors import InputError

SECRET = 4.321
"""Every number in files that lie outside of what is read, in metres; such depth is 4321 mm."""

BOMB_PX = 9_400
"""Side of a square image of zeros: more than twice `kpopnet.camera.MAX_IMAGE_PIXELS` and just below Pillow's own limit."""

ANY, TELLS, NEVER, WILD = "any", "tells", "never", "wild"
"""What a mutation demands: nothing; that its content is refused or has not changed, because the format's checksums tell; that
it is refused; nothing, and not even that a library whose structures were changed takes little memory, or gives none of it."""

CANARY = "canary"
"""A folder that only code hidden in a file makes, in the working folder of the reader."""

EXPRESSION = f"__import__('os').mkdir({CANARY!r})"
"""Python that makes it."""


class Maker:
    """An object whose pickle makes the canary when it is loaded."""

    def __reduce__(self):
        return os.mkdir, (CANARY,)


@functools.cache
def packed_zeros(count: int) -> bytes:
    """That many zeros, compressed by zlib to a thousandth."""
    packer = zlib.compressobj(1)
    block = bytes(1 << 20)
    parts = [packer.compress(block[: min(len(block), count - start)]) for start in range(0, count, len(block))]
    return b"".join([*parts, packer.flush()])


DEED_BYTES = 2_000_000_000
"""The memory that the reader of deeds may take."""


def perform(path: Path) -> str:
    """Does what a file says: what a parser may do on hostile bytes, to the process that reads for us."""
    match deed := json.loads(path.read_text())["do"]:
        case "hang":
            while True:
                pass
        case "sleep":
            time.sleep(60)
        case "swell":
            np.empty(DEED_BYTES, np.uint8)
        case "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        case "exit" | "leave":
            (os._exit if deed == "exit" else sys.exit)(0)
        case "raise":
            raise KeyError("first line\nsecond \x1b[31mline")
        case "refuse":
            raise InputError(f"{path}: \x1b[31mline\nbreak \ud800")
        case "print":
            os.write(1, b"a library that prints\n" * 1000)
    return deed


# --- mutations ------------------------------------------------------------------------------------------------------------

HOSTILE_TEXTS = (
    "[" * 5000, "9" * 5000, "1e999", "-1e999", "NaN", "Infinity", "\x00", "\u0661\u0662", "\ud800", "../../x", "${oc.env:HOME}",
    "-1", "0", "1e30", "null", "true", "{}", "[]", '""', "a" * 10000, "1000000000", "%s%n", "\n", ",", '"', "\u202e",
    EXPRESSION, "\x1b[31mred", "\x1b]0;title\x07", "\x9b2J", "\x7f\x08", "-" * 100_000, "\r", "\u2028",
)  # fmt: skip

HOSTILE_VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 2**63, 10**30, 1e308, -1e-320, 3.5, "", "x", "\u0661", "../x", "${oc.env:HOME}", [], {}, [[]], [None],
    {"a": 1}, [1] * 1000, "a" * 5000, 100_000, EXPRESSION, "\x1b[31mred\n", "\ud800",
)  # fmt: skip


def pick(rng: np.random.Generator, choices):
    """One of some choices, which may be of any types."""
    return choices[int(rng.integers(len(choices)))]


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """A mutation of a file's content, a function of the generator alone."""
    kinds = [flip_bytes, flip_bytes, truncate, splice, splice]
    with contextlib.suppress(UnicodeDecodeError):
        if b"\x00" not in data and data.decode("utf-8"):
            kinds += [insert_hostile_text] * 3
    with contextlib.suppress(ValueError):
        value = json.loads(data)
        if any(_places(value)):
            kinds += [lambda _, generator: mutate_json(value, generator)] * 6
    return pick(rng, kinds)(data, rng)


def flip_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Changes one to eight bytes; half of the time near the beginning, where headers are."""
    changed = bytearray(data)
    limit = len(data) if rng.random() < 0.5 else min(len(data), 2048)
    for _ in range(int(rng.integers(1, 9))):
        changed[int(rng.integers(limit))] = int(rng.integers(256))
    return bytes(changed)


def truncate(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: int(rng.integers(len(data)))]


def splice(data: bytes, rng: np.random.Generator) -> bytes:
    """Replaces up to 64 bytes by up to 64 of zeros, ones, noise, or another part of the file."""
    start, source = (int(place) for place in rng.integers(len(data), size=2))
    removed, length = (int(count) for count in rng.integers(65, size=2))
    given = pick(rng, (bytes(length), b"\xff" * length, rng.bytes(length), data[source : source + length]))
    return data[:start] + given + data[start + removed :]


def insert_hostile_text(data: bytes, rng: np.random.Generator) -> bytes:
    """Replaces a word, or inserts at a random place, something that parsers stumble over."""
    text = pick(rng, HOSTILE_TEXTS).encode("utf-8", "surrogatepass")
    start = end = int(rng.integers(len(data)))
    if rng.random() < 0.7:
        while end < len(data) and data[end : end + 1] not in b' ,:[]{}"\n\t':
            end += 1
    return data[:start] + text + data[end:]


def mutate_json(value: Any, rng: np.random.Generator) -> bytes:
    """Replaces, removes or renames one value at a random place of nested JSON."""
    holder, key = pick(rng, list(_places(value)))
    action = rng.random()
    if action < 0.15:
        del holder[key]
    elif action < 0.25 and isinstance(holder, dict):
        holder[f"{key}_"] = holder.pop(key)
    else:
        holder[key] = pick(rng, HOSTILE_VALUES)
    return json.dumps(value).encode()


def _places(value: Any):
    keys = value.keys() if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in list(keys)[:200]:
        yield value, key
        yield from _places(value[key])
