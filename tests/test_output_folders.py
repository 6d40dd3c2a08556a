"""What programs do with the folders they write to, and with settings that cannot work, as a user runs them."""

import os
import signal
import subprocess
import sys
from subprocess import PIPE

import factories
import pytest
from programs import ROOT, run_program

from kpopnet.runtime import cpu
from kpopnet.runtime.folder_lock import LOCK_FILE, locked

SYNTH = ("-m", "synth", "renderer=cpu", "motion=poses", "splits.validation=0", "splits.test=0", "seed=5")
TWO_SHARDS = ("splits.train=40", "shard_size=20", "processes=1")
"""The first test makes the first one, so that numba's cache holds all kernels when the disk is full in another."""
TRAIN = (
    "train.py", "model.crop_px=32", "model.widths=[8,8,16,16]", "training.batch_size=4", "training.validate_every=2",
    "training.validation_samples=4", "training.steps=4", "workers=0", "threads=1", "device=cpu",
)  # fmt: skip


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("data")
    factories.write_shard(folder / "train", 0, 6)
    factories.write_shard(folder / "validation", 0, 4)
    return f"data.train={folder / 'train'}", f"data.validation={folder / 'validation'}"


def run(*words: str, most_bytes: int = -1) -> tuple[int, str]:
    """Exit code and standard error."""
    done = run_program(words[0], ROOT, *words[1:], most_bytes=most_bytes)
    return done.returncode, done.stderr


def refusal(*words: str, most_bytes: int = -1) -> str:
    """The one line with which a program ends, checked to be one."""
    code, errors = run(*words, most_bytes=most_bytes)
    lines = [line for line in errors.replace("\r", "\n").splitlines() if line.strip() and "/40 [" not in line]  # no progress
    assert code == 1 and lines[-1].startswith("error: ") and "Traceback" not in errors, errors
    assert len(lines) == 1 or all("compiling" in line or "kernel" in line for line in lines[:-1]), errors
    return lines[-1]


def test_two_generators_share_a_folder_by_ranges_and_not_otherwise(tmp_path):
    settings, folder = (*SYNTH, f"out={tmp_path}", *TWO_SHARDS), tmp_path / "train"
    with locked(folder, f"{LOCK_FILE}_1-2"):  # as one does that makes the second shard
        assert f"{folder}: another process writes there" in refusal(*settings, "shards=1:2")
        code, errors = run(*settings, "shards=0:1")
    assert code == 0 and (folder / "shard_00000.h5").exists(), errors


@pytest.mark.parametrize(
    "program",
    [
        (*TRAIN, "hydra.run.dir={}"),
        ("evaluate.py", "estimator=[tracker]", "hydra.run.dir={}"),
        ("train.py", "--config-name", "tree_walk", "out={}"),
        ("-m", "synth", "benchmark=eval_sim", "renderer=cpu", "out={}"),
    ],
    ids=["train", "evaluate", "tree_walk", "benchmark"],
)
def test_no_program_writes_where_another_process_does(tmp_path, program):
    with locked(tmp_path):
        line = refusal(*(word.format(tmp_path) for word in program))
    assert line.startswith(f"error: {tmp_path}: another process writes there"), line
    assert not list(tmp_path.iterdir())


def test_a_thousand_workers_are_bounded_and_a_line_says_so(monkeypatch, capsys):
    monkeypatch.setattr(cpu, "available_cores", lambda: 2)
    assert cpu.bounded_processes(1000, "workers") == 8
    assert capsys.readouterr().err == "workers=1000: takes 8, 4 for each core of this machine\n"
    assert cpu.bounded_processes(8) == 8 and not capsys.readouterr().err


def test_a_full_disk_ends_the_generator_with_one_line_and_it_goes_on_later(tmp_path):
    settings = (*SYNTH, f"out={tmp_path}", *TWO_SHARDS)
    line = refusal(*settings, most_bytes=20_000)
    assert str(tmp_path / "train" / "shard_0000") in line and "larger than a file may be here" in line
    assert not [path for path in (tmp_path / "train").iterdir() if path.suffix == ".tmp"]
    assert run(*settings)[0] == 0
    assert (tmp_path / "train" / "set.json").exists()


def test_a_full_disk_ends_a_training_with_one_line_and_it_goes_on_later(tmp_path, data):
    out = tmp_path / "run"
    code, errors = run(*TRAIN, *data, f"hydra.run.dir={out}", most_bytes=30_000)
    assert code == 1 and "Traceback" not in errors, errors
    assert errors.splitlines()[-1].startswith(f"error: {out}: the file is larger"), errors
    assert not (out / "last").exists()
    assert run(*TRAIN, *data, f"hydra.run.dir={out}")[0] == 0


def test_a_folder_that_cannot_be_made_or_a_setting_that_is_none_is_one_line(tmp_path, data):
    assert "+foo: there is no such setting" in refusal(*TRAIN, "+foo=1", f"hydra.run.dir={tmp_path / 'out'}")
    near = "error: traning.steps: there is no such setting; did you mean training.steps? --help lists them"
    assert refusal(*TRAIN, "traning.steps=1", f"hydra.run.dir={tmp_path / 'out'}") == near
    (tmp_path / "file").write_text("")
    assert "a part of this path is a file" in refusal(*TRAIN, *data, f"hydra.run.dir={tmp_path / 'file/run'}")
    assert "the name is too long" in refusal(*SYNTH, "splits.train=4", f"out={tmp_path / ('x' * 300)}")


PAUSE_AT_IMPORT = """
import os, sys, time

class Pause:
    def find_spec(self, name, path=None, target=None):
        if name == os.environ["PAUSE_AT"]:
            os.write(1, b"importing")
            time.sleep(60)

sys.meta_path.insert(0, Pause())
"""


def test_a_program_that_is_stopped_while_it_imports_says_one_line(tmp_path):
    (tmp_path / "sitecustomize.py").write_text(PAUSE_AT_IMPORT)
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}:{ROOT}", "PAUSE_AT": "numpy"}
    words = [sys.executable, "train.py", "--help"]
    process = subprocess.Popen(words, cwd=ROOT, stdout=PIPE, stderr=PIPE, text=True, env=environment)
    assert process.stdout.read(len("importing")) == "importing"  # the signal comes in the midst of the imports
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (130, "stopped\n")
