"""How much memory a training takes, its data worker included."""

import contextlib
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig, write_shard

SHARDS, PER_SHARD, STEPS = 60, 20, 40
POLL_S = 0.25


def measure() -> dict[str, tuple[float, str, str]]:
    """train.py as it is, on more shards than a small set has; the most that all its processes hold together (Linux)."""
    if not Path("/proc/self/smaps_rollup").exists():
        return {}
    with tempfile.TemporaryDirectory() as folder:
        sample = SampleConfig(renderer="cpu", motion=MotionConfig(source="poses"))
        config = SetConfig(sample, 0, "train", SHARDS * PER_SHARD, PER_SHARD, None)
        for shard in range(SHARDS):
            write_shard(config, Path(folder, "set"), shard)
        command = [sys.executable, "train.py", f"data.train={folder}/set", f"data.validation={folder}/set"]
        command += [f"training.steps={STEPS}", f"hydra.run.dir={folder}/run", "device=cpu"]
        training = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        most_kb = 0
        while training.poll() is None:
            most_kb = max(most_kb, _held_kb(training.pid))
            time.sleep(POLL_S)
    if training.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {training.returncode}")
    against = f"{SHARDS} shards, one data worker, {SHARDS * PER_SHARD} validation crops"
    return {"train.memory_mb": (most_kb / 1024, "MB, all processes", against)}


def _held_kb(group: int) -> int:
    """The memory of all processes of a group, what they share counted once."""
    held = 0
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            if int((path / "stat").read_text().rpartition(")")[2].split()[2]) == group:
                rollup = (path / "smaps_rollup").read_text()
                held += int(next(line for line in rollup.splitlines() if line.startswith("Pss:")).split()[1])
    return held
