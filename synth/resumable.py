"""The loop of every generator: makes the files of a set that are missing, in parallel, with a progress bar.

Each file appears whole or not at all (kpopnet.runtime.atomic_write), so a run that was killed resumes by making the rest.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from kpopnet.errors import InputError
from kpopnet.runtime.parallel import WorkerDiedError, in_processes


def make_missing(
    make: Callable[[int, Callable[[], None]], object],
    numbers: Sequence[int],
    is_finished: Callable[[int], bool],
    folder: Path,
    noun: str,
    unit: str,
    per_item: Callable[[int], float],
    processes: int,
) -> None:
    """Makes the items of some numbers that are not finished, into a folder, which is made if it is missing.

    `make`, picklable if there are several processes, is called with an item's number and a function to call after each unit. An
    item is called a `noun`, such as "shard"; the progress bar counts a `unit`, such as "frame", of which `per_item` are
    expected of each item. Raises InputError if a worker process died; finished items stay.
    """
    folder.mkdir(parents=True, exist_ok=True)
    missing = [number for number in numbers if not is_finished(number)]
    if len(missing) < len(numbers):
        print(f"{folder}: {len(numbers) - len(missing)} of {len(numbers)} {noun}s are there already")
    total = round(sum(map(per_item, missing)))
    # In a log file a line every 15 seconds instead of a bar that moves.
    interval_s = 0.2 if sys.stderr.isatty() else 15.0
    with tqdm(total=total, unit=unit, desc=folder.name, smoothing=0.05, mininterval=interval_s) as bar:
        try:
            for _ in in_processes(make, missing, processes, bar.update):
                pass
        except WorkerDiedError as error:
            raise InputError(f"{folder}: {error}; finished {noun}s are kept: run the same command again") from error
        bar.total = bar.n


MOST_NAMED = 5


def differences(found: Any, wanted: dict) -> str:
    """The first MOST_NAMED settings in which what was found, data of any kind, differs: "sample.renderer=gl, not cpu"."""
    return "; ".join(_differences(found, wanted, "")[:MOST_NAMED])


def _differences(found: Any, wanted: Any, name: str) -> list[str]:
    if isinstance(found, dict) and isinstance(wanted, dict):
        names = sorted({*found, *wanted})
        return [one for key in names for one in _differences(found.get(key), wanted.get(key), f"{name}.{key}".lstrip("."))]
    return [] if found == wanted else [f"{name or 'settings'}={found!s:.60}, not {wanted!s:.60}"]
