"""Seeded mutations of a file: of its bytes, of its text, of its JSON."""

import contextlib
import json
from typing import Any

import numpy as np

from fuzz.traps import EXPRESSION

HOSTILE_TEXTS = (
    "[" * 5000, "9" * 5000, "1e999", "-1e999", "NaN", "Infinity", "\x00", "\u0661\u0662", "\ud800", "../../x", "${oc.env:HOME}",
    "-1", "0", "1e30", "null", "true", "{}", "[]", '""', "a" * 10000, "1000000000", "%s%n", "\n", ",", '"', "\u202e",
    EXPRESSION, "\x1b[31mred", "\x1b]0;title\x07", "\x9b2J", "\x7f\x08", "-" * 100_000, "\r", "\u2028",
)  # fmt: skip

HOSTILE_VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 2**63, 10**30, 1e308, -1e-320, 3.5, "", "x", "\u0661", "../x", "${oc.env:HOME}", [], {}, [[]], [None],
    {"a": 1}, [1] * 1000, "a" * 5000, 100_000, EXPRESSION, "\x1b[31mred\n", "\ud800",
)  # fmt: skip


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """A mutation of a file's content, a function of the generator alone."""
    kinds = [flip_bytes, flip_bytes, truncate, splice, splice]
    with contextlib.suppress(UnicodeDecodeError):
        if b"\x00" not in data and data.decode("utf-8"):
            kinds += [insert_hostile_text] * 3
    with contextlib.suppress(ValueError):
        value = json.loads(data)
        if any(_places(value)):
            kinds += [lambda content, generator: mutate_json(value, generator)] * 6
    return kinds[int(rng.integers(len(kinds)))](data, rng)


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
    given = (bytes(length), b"\xff" * length, rng.bytes(length), data[source : source + length])[int(rng.integers(4))]
    return data[:start] + given + data[start + removed :]


def insert_hostile_text(data: bytes, rng: np.random.Generator) -> bytes:
    """Replaces a word, or inserts at a random place, something that parsers stumble over."""
    text = HOSTILE_TEXTS[int(rng.integers(len(HOSTILE_TEXTS)))].encode("utf-8", "surrogatepass")
    start = int(rng.integers(len(data)))
    end = start
    if rng.random() < 0.7:
        while end < len(data) and data[end : end + 1] not in b' ,:[]{}"\n\t':
            end += 1
    return data[:start] + text + data[end:]


def mutate_json(value: Any, rng: np.random.Generator) -> bytes:
    """Replaces, removes or renames one value at a random place of nested JSON."""
    value = json.loads(json.dumps(value))
    places = list(_places(value))
    holder, key = places[int(rng.integers(len(places)))]
    action = rng.random()
    if action < 0.15:
        del holder[key]
    elif action < 0.25 and isinstance(holder, dict):
        holder[f"{key}_"] = holder.pop(key)
    else:
        holder[key] = HOSTILE_VALUES[int(rng.integers(len(HOSTILE_VALUES)))]
    return json.dumps(value).encode()


def _places(value: Any):
    keys = value.keys() if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in list(keys)[:200]:
        yield value, key
        yield from _places(value[key])
