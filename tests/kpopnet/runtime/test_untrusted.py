"""A stranger's file harms the child that reads it, and nothing else."""

import io
import logging
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from programs import ended

from kpopnet.errors import InputError
from kpopnet.runtime.untrusted import iterate_in_child, read_in_child, received, send


def powers(path: Path, count: int, power: int) -> dict[str, np.ndarray]:
    print("a library that prints")
    logging.getLogger("kpopnet.somewhere").warning("%s: \x1b[2J of an unknown unit", path.name)
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


def unpack_in_parent(path: Path) -> object:
    return Trap()


def open_many(path: Path) -> list[int]:
    return [os.open("/dev/null", os.O_RDONLY) for _ in range(1000)]


class Trap:
    """Runs code where it is unpickled."""

    def __reduce__(self):
        return os.mkdir, ("trapped",)


def garble(path: Path) -> None:
    raise KeyError("first line\nsecond line")


def standard_input(path: Path) -> bool:
    with path.open("rb") as file:
        return os.path.sameopenfile(0, file.fileno())


def test_the_reader_s_standard_input_is_not_the_pipe_that_is_watched() -> None:
    """On Windows libraries that look at one as they load would wait for it."""
    assert read_in_child(standard_input, os.devnull) is True


def test_the_reader_runs_in_another_process_and_its_result_and_warnings_come_back(caplog) -> None:
    result = read_in_child(powers, "some/file.bvh", 5, 3)
    assert list(result) == ["file.bvh"] and result["file.bvh"].tolist() == [0, 1, 8, 27, 64]
    assert caplog.messages == [r"file.bvh: \x1b[2J of an unknown unit"]


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
    [
        (crash, "crashed"),
        (open_many, "OSError: .*Too many open files"),
        (unpack_in_parent, "TypeError"),
        (stop, "longer than"),
        (swell, "memory"),
        (garble, r"KeyError: '?first line"),
    ],
)
def test_whatever_happens_in_the_child_is_one_error(reader, reason: str) -> None:
    with pytest.raises(InputError, match=rf"^a\.bvh: cannot be read \(.*{reason}"):
        read_in_child(reader, "a.bvh", seconds=0.5, memory_bytes=2_000_000_000)


def test_values_cross_as_they_are_and_nothing_is_unpickled(tmp_path, monkeypatch) -> None:
    value = {"a": None, "b": (True, -3, 0.5, float("inf"), "\x1b[2J\ud800"), "": ((), {})}
    arrays = np.arange(6, dtype=">i2").reshape(2, 3), np.array(["x", "yz"]), np.zeros((0, 4)), np.array([[True]])
    stream = io.BytesIO()
    send((value, arrays, np.float32(0.25)), stream)
    stream.seek(0)
    again, theirs, scalar = received(stream)
    assert again == value and scalar == np.float32(0.25) and theirs[0].flags.writeable
    assert all(np.array_equal(one, other) and one.dtype == other.dtype for one, other in zip(arrays, theirs, strict=True))
    monkeypatch.chdir(tmp_path)
    objects = np.array([Trap()], dtype=object)
    header = b'{"array": "|O", "shape": [1]}'
    for hostile in (pickle.dumps(Trap()), len(header).to_bytes(8, "little") + header + objects.tobytes(), b"\xff" * 40):
        with pytest.raises((ValueError, EOFError)):
            received(io.BytesIO(hostile))
    assert not list(tmp_path.iterdir())


READ = """
import sys, time
from pathlib import Path
from kpopnet.runtime.untrusted import read_in_child
sys.path.insert(0, {folder!r})
import reader
read_in_child(reader.spin, "a.bvh", {told!r})
"""


def test_the_child_ends_with_a_parent_that_is_killed(tmp_path) -> None:
    told = tmp_path / "child"
    (tmp_path / "reader.py").write_text(
        "import os\ndef spin(path, told):\n    open(told + '_', 'w').write(str(os.getpid())); os.rename(told + '_', told)\n"
        "    while True: pass\n"
    )
    with subprocess.Popen([sys.executable, "-c", READ.format(folder=str(tmp_path), told=str(told))]) as parent:
        while not told.exists():
            assert parent.poll() is None
            time.sleep(0.05)
        parent.kill()
    assert ended(int(told.read_text()))
