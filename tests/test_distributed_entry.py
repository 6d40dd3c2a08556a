"""Training by several processes: one of them is killed, the others end, and the same run is resumed to the same weights."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from factories import write_shard
from programs import ROOT, run_program

SETTINGS = (
    "data.train=train", "data.validation=validation", "model.crop_px=32", "model.widths=[8,8,16,16]", "training.steps=60",
    "training.batch_size=4", "training.validate_every=20", "training.validation_samples=4", "workers=0", "threads=1",
    "device=cpu",
)  # fmt: skip
TORCHRUN = sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("distributed")
    write_shard(folder / "train", 0, 12)
    write_shard(folder / "validation", 0, 4)
    return folder


def complete(place: Path, *settings: str) -> None:
    done = run_program("train.py", place, *settings, processes=2)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
def test_a_killed_process_ends_the_others_and_the_run_resumes_to_the_same_weights(place):
    complete(place, *SETTINGS, "hydra.run.dir=whole")

    with subprocess.Popen(
        [*TORCHRUN, str(ROOT / "train.py"), *SETTINGS, "hydra.run.dir=killed"], cwd=place,
        env=os.environ | {"OMP_NUM_THREADS": "1"}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as launcher:  # fmt: skip
        deadline = time.monotonic() + 120
        while not (place / "killed" / "last").exists():
            assert launcher.poll() is None and time.monotonic() < deadline
            time.sleep(0.02)
        children = Path(f"/proc/{launcher.pid}/task/{launcher.pid}/children").read_text()
        ranks = [int(rank) for rank in children.split()]
        os.kill(ranks[-1], signal.SIGKILL)
        assert launcher.wait(timeout=60) != 0
    deadline = time.monotonic() + 5
    while any(Path(f"/proc/{rank}").exists() for rank in ranks) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(Path(f"/proc/{rank}").exists() for rank in ranks)

    complete(place, "training.resume=killed/last")
    weights = [(place / run / "last" / "model.safetensors").read_bytes() for run in ("whole", "killed")]
    assert weights[0] == weights[1]
    assert (place / "whole" / "train.log").read_text().count("step 60 of 60") == 1  # the first process alone writes
    assert not (place / "outputs").exists()
