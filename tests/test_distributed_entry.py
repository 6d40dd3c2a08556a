"""Training by several processes: one of them is killed, the others end, and the same run is resumed to the same weights."""

import os
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from factories import write_shard
from programs import run_program, starter

SETTINGS = (
    "data.train=train", "data.validation=validation", "model.crop_px=32", "model.widths=[8,8,16,16]", "training.steps=24",
    "training.batch_size=4", "training.validate_every=8", "training.validation_samples=4", "workers=0", "threads=1",
    "device=cpu",
)  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
def test_a_killed_process_ends_the_other_and_the_run_resumes_to_the_same_weights(tmp_path):
    write_shard(tmp_path / "train", 0, 12)
    write_shard(tmp_path / "validation", 0, 4)
    whole = run_program("train.py", tmp_path, *SETTINGS, "hydra.run.dir=whole", processes=2)
    assert whole.returncode == 0 and "Warning" not in whole.stderr, whole.stderr

    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(run_program, "train.py", tmp_path, *SETTINGS, "hydra.run.dir=killed", processes=2)
        deadline = time.monotonic() + 120
        while not (tmp_path / "killed" / "last").exists():
            assert not running.done() and time.monotonic() < deadline
            time.sleep(0.02)
        ranks = Path(f"/proc/{starter().pid}/task/{starter().pid}/children").read_text().split()
        os.kill(int(ranks[-1]), signal.SIGKILL)
        assert len(ranks) == 2 and running.result(60).returncode != 0  # which it has when both have ended

    resumed = run_program("train.py", tmp_path, "training.resume=killed/last", processes=2)
    assert resumed.returncode == 0, resumed.stderr
    weights = [(tmp_path / run / "last" / "model.safetensors").read_bytes() for run in ("whole", "killed")]
    assert weights[0] == weights[1]
    assert (tmp_path / "whole" / "train.log").read_text().count("step 24 of 24") == 1  # the first process alone writes
    assert not (tmp_path / "outputs").exists()
