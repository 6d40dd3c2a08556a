"""HDF5 files that are damaged at random, or on purpose: only an InputError or a result comes out, in bounded time."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path

import h5py
import numpy as np
import pytest
from factories import write_shard
from itop_files import write_itop

from kpopnet.camera import Camera
from kpopnet.dance.performance import Performance
from kpopnet.data.shards import ShardedSet
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.datasets.dances.writer import PackedDepth, write_labels, write_learner, write_teacher
from kpopnet.datasets.itop import ItopBenchmark, ItopConfig
from kpopnet.errors import InputError
from kpopnet.runtime import hdf5_probe
from kpopnet.runtime.hdf5_files import Attribute, Hdf5Schema, StoredArray, check_hdf5, open_hdf5, read_rows, stored_array

CAMERA = Camera.centred(50.0, 64, 48)
SCHEMA = Hdf5Schema("a test", {"a": StoredArray("f", ("N",))}, {"note": Attribute("U", required=False)})
CASES, LIMIT_S = 150, 240


def shard(folder: Path) -> Path:
    return write_shard(folder, camera=CAMERA, kind="frozen")


def read_shard(folder: Path) -> None:
    shards = ShardedSet(folder)
    for index in range(len(shards)):
        shards.room(index, shards[index].room)
    shards.column("body")


def itop(folder: Path) -> Path:
    rng = np.random.default_rng(0)
    ids = ["00_00001", "00_00002", "01_00003"]
    write_itop(folder, ids, rng.uniform(1, 4, (3, 240, 320)), rng.normal(size=(3, 15, 3)))
    return folder / f"ITOP_side_test_{'labels' if folder.name.endswith('labels') else 'depth_map'}.h5"


def read_itop(folder: Path) -> None:
    benchmark = ItopBenchmark(ItopConfig(path=str(folder)))
    for name in benchmark.sequence_names():
        benchmark.read(name)


def dance(folder: Path) -> Path:
    rng = np.random.default_rng(0)
    times_s, joints_m = np.arange(6) / 30, rng.normal(size=(6, 15, 3)).astype(np.float32)
    depth = PackedDepth(CAMERA)
    for _ in range(6):
        depth.add(rng.uniform(1, 2, (40, 60)).astype(np.float32))
    write_teacher(folder / "mama", Performance(joints_m, times_s))
    for name in ("jin", "ann"):
        write_learner(folder / "mama", name, times_s, joints_m, depth, {"level": "best"})
    write_labels(folder / "mama", ["jin", "ann"])
    return folder / "mama" / "jin.h5"


def read_dance(folder: Path) -> None:
    for learner in KpopSet(folder).dance("mama").learners:
        _ = learner.about, learner.depth_key, learner.joints(), learner.depth()


FORMATS: dict[str, tuple[Callable[[Path], Path], Callable[[Path], None]]] = {
    "shard": (shard, read_shard),
    "itop": (itop, read_itop),
    "itop_labels": (itop, read_itop),
    "dance": (dance, read_dance),
}


def damaged(whole: bytes, structure: int, rng: np.random.Generator) -> bytes:
    """The bytes of a file with some flipped, most of them among its structures, or cut off."""
    data = bytearray(whole)
    kind = rng.integers(8)
    if kind == 0:
        return bytes(data[: rng.integers(len(data))])
    if kind == 1:
        start = int(rng.integers(structure))
        data[start : start + 8] = rng.choice([bytes(8), b"\xff" * 8, b"\xff" * 7 + b"\x7f", b"\0\0\0\x40\0\0\0\0"])
        return bytes(data)
    for _ in range(1 if kind < 5 else rng.integers(2, 40)):
        data[rng.integers(structure if rng.random() < 0.8 else len(data))] ^= 1 << int(rng.integers(8))
    return bytes(data)


def fuzz(name: str, folder: Path, cases: int) -> None:
    """Prints the outcome of every case; ends with an exception where something other than an InputError comes out."""
    hdf5_probe.LIMIT_S = 1.5
    write, read = FORMATS[name]
    path = write(folder)
    read(folder)
    whole = path.read_bytes()
    stored = sorted(at for at, byte in enumerate(whole[:20_000]) if byte)
    for case in range(cases):
        path.write_bytes(damaged(whole, min(stored[-1], 12_000), np.random.default_rng([17, case])))
        try:
            read(folder)
            message = None
        except InputError as error:
            message = str(error)
        assert message is None or ("\n" not in message and path.name in message), message
        print(case, "refused" if message else "accepted", flush=True)


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files_give_an_input_error_or_a_result(name, tmp_path):
    code = f"import sys; sys.path[:0] = {sys.path!r}; import test_hdf5_files as one; from pathlib import Path; "
    code += f"one.fuzz({name!r}, Path({str(tmp_path / name)!r}), {CASES})"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parent)}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=LIMIT_S, env=environment
    )
    lines = done.stdout.splitlines()
    assert done.returncode == 0, (lines[-1:], done.stderr[-3000:])
    assert len(lines) == CASES and sum("refused" in line for line in lines) > CASES / 4


def write_one(path: Path, **arrays) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values
    return path


def test_the_child_is_kept_and_another_one_replaces_it(tmp_path):
    path = write_one(tmp_path / "x.h5", a=np.zeros(3))
    check_hdf5(path, SCHEMA)
    first = hdf5_probe._child.pid
    hdf5_probe.describe(path)
    assert hdf5_probe._child.pid == first
    os.kill(first, signal.SIGKILL)
    assert hdf5_probe.describe(path)["members"]["a"]["shape"] == [3]
    assert hdf5_probe._child.pid != first


def test_a_file_that_takes_too_long_is_refused_and_the_next_one_is_read(tmp_path, monkeypatch):
    path = write_one(tmp_path / "x.h5", a=np.zeros(3))
    hdf5_probe.describe(path)
    os.kill(hdf5_probe._child.pid, signal.SIGSTOP)
    monkeypatch.setattr(hdf5_probe, "LIMIT_S", 0.3)
    before = time.monotonic()
    with pytest.raises(InputError, match=r"x\.h5: damaged HDF5 \(reading its structure took longer than 0\.3 s\)"):
        hdf5_probe.describe(path)
    assert time.monotonic() - before < 5
    monkeypatch.undo()
    hdf5_probe.describe(path)


def test_the_child_ends_with_its_parent(tmp_path):
    path = write_one(tmp_path / "x.h5", a=np.zeros(3))
    code = "import sys, os; from pathlib import Path; from kpopnet.runtime import hdf5_probe; "
    code += "hdf5_probe.describe(Path(sys.argv[1])); print(hdf5_probe._child.pid, flush=True); os.kill(os.getpid(), 9)"
    done = subprocess.run([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True)
    child = Path(f"/proc/{int(done.stdout)}/stat")
    for _ in range(100):
        if not child.exists() or child.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("the child is still there after 5 s")


def test_a_forked_process_starts_a_child_of_its_own(tmp_path):
    path = write_one(tmp_path / "x.h5", a=np.zeros(3))
    code = (
        "import sys, os; from pathlib import Path; from kpopnet.runtime import hdf5_probe as p; path = Path(sys.argv[1]); "
        "p.describe(path); first = p._child.pid; pid = os.fork(); p.describe(path); same = p._child.pid == first; "
        "pid or os._exit(int(same)); sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) or int(not same))"
    )
    assert subprocess.run([sys.executable, "-c", code, str(path)], timeout=60).returncode == 0


def test_names_that_are_hard_to_pass_on(tmp_path):
    for name in ("a\nb.h5", "\udcff.h5", "${oc.env:HOME}.h5", "é.h5"):
        path = write_one(tmp_path / "plain.h5", a=np.zeros(3)).rename(tmp_path / name)
        assert check_hdf5(path, SCHEMA).shape("a") == (3,)
    for name in ("x\0.h5", "x" * 300, "missing.h5"):
        with pytest.raises(InputError, match=r"cannot be read|no such file"):
            check_hdf5(tmp_path / name, SCHEMA)
    with pytest.raises(InputError, match="no such file"):
        check_hdf5(tmp_path, SCHEMA)
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(InputError, match="no such file"):
        check_hdf5(tmp_path / "fifo", SCHEMA)


def test_a_changed_file_is_described_again(tmp_path):
    path = tmp_path / "x.h5"
    for length in range(1, 6):
        write_one(path, a=np.zeros(length))
        assert check_hdf5(path, SCHEMA).shape("a") == (length,)
    os.utime(path, (0, 0))
    first = check_hdf5(path, SCHEMA)
    assert check_hdf5(path, SCHEMA).members is first.members or time.time() - path.stat().st_ctime < 1


def test_rows_equal_those_of_h5py(tmp_path):
    rng = np.random.default_rng(0)
    packings = ({}, {"compression": 1}, {"compression": 4, "shuffle": True}, {"shuffle": True, "fletcher32": True})
    layouts = (((7, 5, 6), (1, 5, 6)), ((7, 5, 6), (3, 2, 4)), ((10,), (4,)), ((5, 4), (5, 4)))
    for dtype, packing, (shape, chunks) in product(("u1", ">u2", "<u2", "f4", ">f8", "S6", "?"), packings, layouts):
        values = rng.integers(0, 250, shape).astype(dtype)
        with h5py.File(tmp_path / "x.h5", "w") as file:
            data = file.create_dataset("a", shape, dtype, chunks=chunks, fillvalue=values[0].flat[0], **packing)
            data[2:] = values[2:]
        with h5py.File(tmp_path / "x.h5") as file:
            for start, stop in ((0, None), (1, 2), (3, 5), (2, 2), (0, 1)):
                expected, found = file["a"][start:stop], read_rows(file["a"], start, stop)
                np.testing.assert_array_equal(found, expected)
                assert found.dtype == expected.dtype.newbyteorder("=") and found.dtype.isnative and found.flags.writeable
            with pytest.raises(ValueError, match="rows"):
                read_rows(file["a"], 4, shape[0] + 1)


def test_other_filters_and_number_formats_are_refused(tmp_path):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=np.zeros(8), chunks=(4,), compression="lzf")
    with pytest.raises(InputError, match=r"a: packed with HDF5's filters \[32000\], expected gzip and shuffle"):
        check_hdf5(path, SCHEMA)
    unusual = h5py.h5t.IEEE_F32LE.copy()
    unusual.set_fields(31, 20, 11, 0, 20)
    with h5py.File(path, "w") as file:
        h5py.h5d.create(file.id, b"a", unusual, h5py.h5s.create_simple((4,)))
    with pytest.raises(InputError, match="a cannot be read"):
        check_hdf5(path, SCHEMA)
    for values in (np.zeros(3, [("x", "f4")]), np.array([b"a", b"bc"], object)):
        write_one(path, a=values)
        with pytest.raises(InputError, match=r"x\.h5: a: (type|values of variable length)"):
            check_hdf5(path, SCHEMA)


def test_texts_that_share_one_place_are_counted_each(tmp_path, monkeypatch):
    schema = Hdf5Schema("a test", {"a": StoredArray("T", ("N",))})
    path = write_one(tmp_path / "x.h5", a=["x" * 1000] * 2000)
    monkeypatch.setenv("KPOPNET_FILE_BUDGET_GB", "0.001")
    with pytest.raises(InputError, match=r"a \(2000,\) .* GB of memory"):
        check_hdf5(path, schema)
    monkeypatch.undo()
    with open_hdf5(path, schema) as file:
        assert len(read_rows(stored_array(file, "a"))) == 2000


def test_attributes_of_any_kind_are_described(tmp_path):
    path = write_one(tmp_path / "x.h5", a=np.zeros(3))
    with h5py.File(path, "a") as file:
        file.attrs.update({"note": b"\xff", "empty": h5py.Empty("f"), "many": np.zeros(6000), "pair": np.zeros(1, "f4,i4")})
        file.attrs["nan"] = np.nan
        file.attrs["bytes"] = np.array([b"a", b"b"])
        file.attrs["reference"] = file["a"].ref
    with pytest.raises(InputError, match="attribute note: not UTF-8 text"):
        check_hdf5(path, SCHEMA)
    with h5py.File(path, "a") as file:
        file.attrs["note"] = "fine"
    found = check_hdf5(path, SCHEMA).attributes
    assert found["note"] == "fine" and found["bytes"] == ["a", "b"] and found["many"] is None and found["nan"] != found["nan"]
    json.dumps(found)
