"""Which of a file's joints or markers is which joint of ours: a setting, because nobody has published it."""

from collections.abc import Mapping
from typing import Any

from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES


def checked_map(joints: Mapping[str, Any]) -> dict[str, list[int]]:
    """Ids by the joint's name, in lists, of the joints that have any.

    Raises:
        InputError: a name that no joint has, an id that is no number, or one that two joints share.
    """
    ids: dict[str, list[int]] = {}
    for name, given in joints.items():
        if name not in JOINT_NAMES:
            raise InputError(f"benchmark.joints: {name} is no joint; the joints are {', '.join(JOINT_NAMES)}")
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
    return "The map: " + (", ".join(f"{name}: {ids}" for name, ids in joint_ids.items()) or "empty")


def describe_skipped(skipped: Mapping[str, int]) -> str:
    return "; ".join(f"{count} {what}" for what, count in skipped.items())
