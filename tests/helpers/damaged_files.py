"""Seeded damage to a valid file: a reader may accept the result or raise InputError, nothing else."""

import json
from collections.abc import Callable
from pathlib import Path

from kpopnet.errors import InputError

HOSTILE_JSON = (
    "[" * 100_000, "9" * 5000, "1e999", "-1e999", "NaN", "Infinity", "null", "true", "-1", "1e30", '"\\ud800"', '"\u0661"',
    "[]", "{}", '"${oc.env:HOME}"', "100000", '[["x"]]', '""',
)  # fmt: skip


def survives_hostile_json(path: Path, read: Callable[[], object]) -> None:
    """Reads a JSON file with every value in turn, two levels deep, replaced by each of HOSTILE_JSON, and with it missing."""
    text = path.read_text()
    for hostile in HOSTILE_JSON:
        path.write_text(hostile)
        is_refused(read)
    value = json.loads(text)
    for name in value:
        path.write_text(json.dumps({other: one for other, one in value.items() if other != name}))
        is_refused(read)
        inner = value[name] if isinstance(value[name], dict) else {}
        for holder, key in [(value, name), *((inner, key) for key in inner)]:
            kept, holder[key] = holder[key], "@"
            for hostile in HOSTILE_JSON:
                path.write_text(json.dumps(value).replace('"@"', hostile))
                is_refused(read)
            holder[key] = kept
    path.write_text(text)


def is_refused(read: Callable[[], object]) -> bool:
    """Whether reading raises an InputError; its message must be one line of bounded length."""
    message = ""
    try:
        read()
    except InputError as error:
        message = str(error)
    assert "\n" not in message and len(message) < 3000, message
    return bool(message)
