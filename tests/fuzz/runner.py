"""Runs mutated files through their readers, in a child process with limits of memory and time."""

import shutil
import tempfile
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError
from kpopnet.runtime.untrusted import iterate_in_child

TIME_LIMIT_S = 30.0
ACCEPTED, REFUSED = "accepted", "refused"


def fuzz(name: str, cases: range, seed: int) -> tuple[Counter, list[tuple[int, str]]]:
    """Reads mutated files of one format: number of cases by outcome, and (case, what happened) of what should not happen.

    Case k is a function of the format's name, the seed and k, so that a fault can be repeated alone.
    """
    outcomes, faults, left = Counter(), [], list(cases)
    while left:
        try:
            for outcome, message in iterate_in_child(read_cases, name, left, seed, seconds=TIME_LIMIT_S):
                case = left.pop(0)
                outcomes[outcome] += 1
                if outcome not in (ACCEPTED, REFUSED):
                    faults.append((case, f"{outcome}: {message}"))
        except InputError as error:  # the child hung or died; the next one begins with the next case
            outcomes["hang or crash"] += 1
            faults.append((left.pop(0), str(error)))
    return outcomes, faults


def read_cases(name: Path, cases: list[int], seed: int) -> Iterator[tuple[str, str]]:
    """Yields (outcome, message) of each case. In the child."""
    from fuzz.formats import FORMATS
    from fuzz.mutations import mutate_file

    warnings.simplefilter("ignore")  # files may be read with warnings
    form = FORMATS[str(name)]
    with tempfile.TemporaryDirectory() as temporary:
        valid, mutated = Path(temporary) / "valid", Path(temporary) / "mutated"
        valid.mkdir()
        form.make(valid)
        form.read(valid)
        for case in cases:
            rng = np.random.default_rng([zlib.crc32(str(name).encode()), seed, case])
            shutil.rmtree(mutated, ignore_errors=True)
            shutil.copytree(valid, mutated)
            targets = sorted({path for pattern in form.files for path in mutated.glob(pattern)})
            mutate_file(targets[int(rng.integers(len(targets)))], rng)
            yield _outcome(form, mutated)


def _outcome(form, folder: Path) -> tuple[str, str]:
    try:
        form.read(folder)
    except InputError as error:
        message = str(error)
        if "\n" in message:
            return "message of several lines", message
        if any("\ud800" <= character <= "\udfff" for character in message):
            return "message that cannot be printed", repr(message)
        return REFUSED, message
    except Exception as error:
        return type(error).__name__, " ".join(str(error).split())[:300]
    return ACCEPTED, ""
