"""Maps from our joints to the ids of joints or markers in a file. They are settings, since no map is published."""

from collections.abc import Mapping
from typing import Any

from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES


def checked_map(joints: Mapping[str, Any]) -> dict[str, list[int]]:
    """Validates a joint map.

    Args:
        joints: id, list of ids or None by the joint's name.

    Returns:
        List of ids by the joint's name, without joints that have none.

    Raises:
        InputError: an unknown joint, an id that is not an integer, or two joints with the same ids.
    """
    ids: dict[str, list[int]] = {}
    for name, given in joints.items():
        if name not in JOINT_NAMES:
            raise InputError(f"benchmark.joints: {name} is not a joint; the joints are {', '.join(JOINT_NAMES)}")
        if given is None:
            continue
        numbers = given if isinstance(given, list) else [given]
        if not numbers or not all(isinstance(number, int) and not isinstance(number, bool) for number in numbers):
            raise InputError(f"benchmark.joints: {name} is {given!r}; expected the joint's id, or a list of ids")
        ids[name] = numbers
    owners: dict[tuple[int, ...], str] = {}
    for name, numbers in ids.items():
        other = owners.setdefault(tuple(sorted(numbers)), name)
        if other != name:
            raise InputError(f"benchmark.joints: {other} and {name} both have id {numbers}; one of them is wrong")
    return ids


def describe_map(joint_ids: Mapping[str, list[int]]) -> str:
    """A joint map as text."""
    return "Joint map: " + (", ".join(f"{name}: {ids}" for name, ids in joint_ids.items()) or "empty")


def describe_skipped(skipped: Mapping[str, int]) -> str:
    """`PointSequence.skipped` as text, at most twenty kinds."""
    listed = [f"{count} {what}" for what, count in skipped.items()]
    return "; ".join(listed[:20] + ([f"{len(listed) - 20} more kinds"] if len(listed) > 20 else []))
