"""The exception for invalid input of a user, and the checks that settings share."""

import numbers
from collections.abc import Iterable

MAX_SEED = 2**64 - 1


class InputError(ValueError):
    """A file, an array or a setting is invalid.

    The message names the file, frame or setting, what was found there, what was expected, and what to do. It is one line that
    can be printed: line breaks, half characters and commands to a terminal, which what is quoted may hold, are escaped.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)

    @property
    def said(self) -> str:
        """The message as a page is told it: one that is `kpopnet.languages.Said` can be worded there."""
        return self.args[0] if type(self.args[0]) is not str else str(self)

    def __str__(self) -> str:
        return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in str(self.args[0]))


def check_seed(name: str, seed: int) -> None:
    """Raises InputError unless a seed fits into 64 bits without a sign, as torch and HDF5 need it."""
    if not isinstance(seed, numbers.Integral) or not 0 <= seed <= MAX_SEED:
        raise InputError(f"{name}={seed!r:.80} must be a whole number, 0 or more, at most {MAX_SEED}")


def check_number(name: str, value: float) -> None:
    """Raises InputError for what is no number."""
    if not isinstance(value, numbers.Real):
        raise InputError(f"{name}={value!r:.80}: expected a number")


def check_between(name: str, value: float, low: float, high: float) -> None:
    """Raises InputError unless low <= value <= high; NaN, and what is no number, is refused."""
    check_number(name, value)
    if not low <= value <= high:
        raise InputError(f"{name}={value}: expected a number in {low:g}..{high:g}")


def check_one_of(name: str, value: str, known: Iterable[str]) -> None:
    """Raises InputError unless the value is one of those that are known, which the message lists."""
    if value not in (known := tuple(known)):
        raise InputError(f"{name}={value}: expected one of {', '.join(known)}")


def check_type(name: str, given: object, *kinds: type) -> None:
    """Raises InputError for what is of none of some types."""
    if type(given) not in kinds:
        expected = " or ".join(f"{kind.__module__}.{kind.__name__}" for kind in kinds)
        raise InputError(f"{name}: expected a {expected}, got {given!r:.80}")


def check_range(name: str, given: tuple[float, float], low: float, high: float) -> None:
    """Raises InputError unless `given` is two numbers, low <= first <= second <= high; NaN is refused."""
    if len(given) != 2 or not low <= given[0] <= given[1] <= high:
        raise InputError(f"{name}={list(given)}: expected two numbers, the first not above the second, in {low:g}..{high:g}")
