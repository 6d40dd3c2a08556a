"""How fast samples are made, and by which renderer."""

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco

from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig, Sampler
from synth.samples.writer import SetConfig, write_shard
from synth.scene.render import CpuRenderer, GlRenderer
from tests.speed.common import Figures, timed

SAMPLES = 500  # a shard; the median over SHARDS of them counts, when the dances that a process composes are composed
SHARDS = 12
PICTURES = 300
SAMPLE = SampleConfig(renderer="cpu", motion=MotionConfig(source="mix"))


def measure() -> Figures:
    made = _in_process("samples", {})
    against = f"{made['early_mb']:.0f} MB after the first shard"
    figures: Figures = {
        "synth.samples_per_core_second": (made["rate"], "samples/core-second", "complete stored samples"),
        "synth.memory_mb": (made["late_mb"], "MB a process", against),
    }
    for backend in ("osmesa", "egl"):
        drawn = _in_process("with_gl", {"MUJOCO_GL": backend, "LIBGL_ALWAYS_SOFTWARE": "1"})
        if drawn:
            what = f"{drawn['gl_ms']:.2f} ms by MuJoCo's OpenGL in software ({backend}), same scene and poses"
            figures["synth.cpu_vs_gl"] = (drawn["gl_ms"] / drawn["cpu_ms"], "times as fast", what)
            break
    return figures


def samples() -> dict:
    """Complete stored samples (person, pose, skin, render at 320x240, labels, file) per second of processor time."""
    config = SetConfig(SAMPLE, seed=0, split="train", count=SAMPLES * (SHARDS + 1), shard_size=SAMPLES, freeze=None)
    rates, memory_mb = [], []
    with tempfile.TemporaryDirectory() as folder:
        for shard in range(SHARDS + 1):
            rates.append(1000 * SAMPLES / timed(write_shard, config, Path(folder), shard)[0])
            memory_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    # The first one also compiles and opens things.
    return {"rate": statistics.median(rates[1:]), "early_mb": memory_mb[0], "late_mb": memory_mb[-1]}


def with_gl() -> dict:
    """One image by either renderer, milliseconds of processor time."""
    sampler = Sampler(SAMPLE, 0, "train")
    scene = sampler.scene
    poses = [scene.data.qpos.copy() for _ in sampler.samples(0, 64)]
    renderers = {"gl_ms": GlRenderer(scene), "cpu_ms": CpuRenderer(scene)}
    figures: dict[str, list[float]] = {name: [] for name in renderers}
    for _ in range(4):  # in turn, so that a busy neighbour hits both
        for name, renderer in renderers.items():
            times = []
            for k in range(PICTURES):
                scene.data.qpos[:] = poses[k % len(poses)]
                mujoco.mj_kinematics(scene.model, scene.data)
                times.append(timed(renderer.person_m)[0])
            figures[name].append(statistics.fmean(times))
    renderers["gl_ms"].close()
    return {name: statistics.median(values[1:]) for name, values in figures.items()}


def _in_process(what: str, changed: dict[str, str]) -> dict:
    """Runs one of the functions above in a process of its own, for its memory and MuJoCo's choice of GL; {} without a GL."""
    environment = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"} | changed
    command = [sys.executable, "-m", "tests.speed.speed_synth", what]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode and what == "samples":
        raise RuntimeError(run.stderr)
    return {} if run.returncode else json.loads(run.stdout.strip().splitlines()[-1])


if __name__ == "__main__":
    print(json.dumps({"samples": samples, "with_gl": with_gl}[sys.argv[1]]()))
