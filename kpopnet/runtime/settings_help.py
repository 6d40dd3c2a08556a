"""What each setting means, taken from the docstrings of the dataclasses that hold it: for --help and --cfg job."""

import dataclasses
import inspect
import re
import shutil
import textwrap
import types
import typing
from typing import Any

ATTRIBUTE = re.compile(r"^(?P<names>\w+(?:, \w+)*): (?P<text>.+)$", re.DOTALL)


def described_fields(schema: type) -> dict[str, str]:
    """The text of each name in the "Attributes:" section of a class and its bases, on one line each.

    The section's form is Google's: "name: text" or "name, name: text", continued on deeper lines, up to a blank line.
    """
    found: dict[str, str] = {}
    for one in reversed(schema.__mro__):
        _, section, text = inspect.cleandoc(one.__dict__.get("__doc__") or "").partition("Attributes:")
        if not section:
            continue
        lines = inspect.cleandoc("\n" + text.split("\n\n")[0]).splitlines()
        entries: list[str] = []
        for line in lines:
            if line.startswith(" ") and entries:
                entries[-1] += " " + line.strip()
            else:
                entries.append(line.strip())
        for entry in entries:
            if matched := ATTRIBUTE.match(entry):
                found |= dict.fromkeys(matched["names"].split(", "), matched["text"])
    return found


def settings(schema: type, prefix: str = "") -> dict[str, str]:
    """Every setting of a nested dataclass, by its dotted name, with what its docstring says; "" where it says nothing."""
    texts, types_ = described_fields(schema), typing.get_type_hints(schema)
    found: dict[str, str] = {}
    for one in dataclasses.fields(schema):
        name = f"{prefix}{one.name}"
        found[name] = texts.get(one.name, "")
        if (nested := nested_schema(types_[one.name])) is not None:
            found |= settings(nested, f"{name}.")
    return found


def nested_schema(annotation: Any) -> type | None:
    """The dataclass that an annotation names, alone or as "X | None"."""
    options = typing.get_args(annotation) if isinstance(annotation, types.UnionType) else (annotation,)
    return next((one for one in options if isinstance(one, type) and dataclasses.is_dataclass(one)), None)


def as_text(texts: dict[str, str]) -> str:
    """A paragraph for each setting: its name and its meaning, wrapped to the terminal."""
    width = min(max(map(len, texts)), 36) + 4
    columns = max(shutil.get_terminal_size((120, 24)).columns, width + 40)
    lines = []
    for name, text in texts.items():
        first = f"  {name}".ljust(width)
        lines.append(
            textwrap.fill(text, columns, initial_indent=first, subsequent_indent=" " * width) if text else first.rstrip()
        )
    return "\n".join(lines)


def with_comments(yaml: str, texts: dict[str, str]) -> str:
    """YAML of two-space indentation, each setting with its text as a comment behind it."""
    place: list[str] = []
    lines = []
    for line in yaml.splitlines():
        if matched := re.match(r"^( *)([\w]+):", line):
            depth = len(matched[1]) // 2
            place[depth:] = [matched[2]]
            if text := texts.get(".".join(place)):
                line = f"{line}  # {text}"
        lines.append(line)
    return "\n".join(lines)
