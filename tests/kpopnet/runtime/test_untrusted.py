"""A stranger's file harms the child that reads it, and nothing else."""

import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from kpopnet.errors import InputError
from kpopnet.runtime.untrusted import iterate_in_child, read_in_child


def powers(path: Path, count: int, power: int) -> dict[str, np.ndarray]:
    print("a library that prints")
    return {path.name: np.arange(count) ** power}


def numbers(path: Path, count: int) -> Iterator[tuple[int, int]]:
    for number in range(count):
        yield number, os.getpid()
    raise InputError(f"{path}: frame {count}: damaged")


def crash(path: Path) -> None:
    os._exit(1)


def stop(path: Path) -> None:
    time.sleep(60)


def swell(path: Path) -> None:
    np.zeros(400_000_000)  # 3.2 GB of address space


def garble(path: Path) -> None:
    raise KeyError("first line\nsecond line")


def test_the_reader_runs_in_another_process_and_its_result_comes_back() -> None:
    result = read_in_child(powers, "some/file.bvh", 5, 3)
    assert list(result) == ["file.bvh"] and result["file.bvh"].tolist() == [0, 1, 8, 27, 64]


def test_items_come_one_by_one_and_the_child_ends_with_the_loop() -> None:
    items = iterate_in_child(numbers, "a.h5", 3)
    number, child = next(items)
    assert (number, child != os.getpid()) == (0, True)
    assert [next(items)[0], next(items)[0]] == [1, 2]
    with pytest.raises(InputError, match=r"a\.h5: frame 3: damaged"):
        next(items)
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


@pytest.mark.parametrize(
    ("reader", "reason"),
    [(crash, "crashed"), (stop, "longer than"), (swell, "memory"), (garble, r"KeyError: '?first line")],
)
def test_whatever_happens_in_the_child_is_one_error(reader, reason: str) -> None:
    with pytest.raises(InputError, match=rf"^a\.bvh: cannot be read \(.*{reason}"):
        read_in_child(reader, "a.bvh", seconds=0.5, memory_bytes=2_000_000_000)
