"""How fast samples are made, and by which renderer."""

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig, write_shard

Figures = dict[str, tuple[float, str, str]]
SAMPLES = 500  # a shard; the median over SHARDS of them counts, when the dances that a process composes are composed
SHARDS = 12
PICTURES = 300


def measure() -> Figures:
    with_gl = _in_process("with_gl")
    alone = _in_process("samples")
    plain = f"{with_gl['plain']:.0f} by a plain loop over mujoco.Renderer, drawing only" if with_gl else "no OpenGL here"
    figures: Figures = {
        "synth.samples_per_core_second": (alone["rate"], "samples/core-second", plain),
        "synth.memory_mb": (alone["late_mb"], "MB a process", f"{alone['early_mb']:.0f} MB after the first shard"),
    }
    if with_gl:
        what = f"{with_gl['gl_ms']:.2f} ms by MuJoCo's OpenGL in software ({with_gl['backend']}), same scene and poses"
        figures["synth.cpu_vs_gl"] = (with_gl["gl_ms"] / with_gl["cpu_ms"], "times as fast", what)
    return figures


def samples() -> dict:
    """Complete stored samples (person, pose, skin, render at 320x240, labels, file) per second of processor time."""
    sample = SampleConfig(renderer="cpu", motion=MotionConfig(source="mix"))
    config = SetConfig(sample, seed=0, split="train", count=SAMPLES * (SHARDS + 1), shard_size=SAMPLES, freeze=None)
    rates, memory_mb = [], []
    with tempfile.TemporaryDirectory() as folder:
        for shard in range(SHARDS + 1):
            start = time.process_time()
            write_shard(config, Path(folder), shard)
            rates.append(SAMPLES / (time.process_time() - start))
            memory_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    # The first one also compiles and opens things.
    return {"rate": statistics.median(rates[1:]), "early_mb": memory_mb[0], "late_mb": memory_mb[-1]}


def with_gl() -> dict:
    """One image by either renderer, and a loop over MuJoCo's own Renderer; milliseconds of processor time."""
    import mujoco
    import numpy as np

    from synth.samples.sampler import Sampler
    from synth.scene.render import CpuRenderer, GlRenderer

    sampler = Sampler(SampleConfig(renderer="cpu", motion=MotionConfig(source="mix")), 0, "train")
    scene = sampler.scene
    poses = []
    for _ in sampler.samples(0, 64):
        poses.append(scene.data.qpos.copy())

    def per_image_ms(draw) -> float:
        times = []
        for k in range(PICTURES):
            scene.data.qpos[:] = poses[k % len(poses)]
            mujoco.mj_kinematics(scene.model, scene.data)
            start = time.process_time()
            draw()
            times.append(1000 * (time.process_time() - start))
        return statistics.fmean(times)

    gl, cpu = GlRenderer(scene), CpuRenderer(scene)
    figures = {"cpu_ms": [], "gl_ms": []}
    for _ in range(4):  # in turn, so that a busy neighbour hits both
        figures["cpu_ms"].append(per_image_ms(cpu.person_m))
        figures["gl_ms"].append(per_image_ms(gl.person_m))
    gl.close()
    plain = mujoco.Renderer(scene.model, scene.camera.height, scene.camera.width)
    plain.enable_depth_rendering()

    def draw_plainly() -> np.ndarray:
        mujoco.mj_forward(scene.model, scene.data)
        plain.update_scene(scene.data, camera="camera")
        return plain.render()

    per_image_ms(draw_plainly)
    plain_ms = per_image_ms(draw_plainly)
    plain.close()
    return {name: statistics.median(values[1:]) for name, values in figures.items()} | {"plain": 1000 / plain_ms}


def _in_process(what: str) -> dict | None:
    """Runs one of the functions above in a process of its own, for its memory and for MuJoCo's choice of GL."""
    for backend in ("osmesa", "egl") if what == "with_gl" else ("",):
        environment = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
        if backend:
            environment |= {"MUJOCO_GL": backend, "LIBGL_ALWAYS_SOFTWARE": "1"}
        command = [sys.executable, "-m", "tests.speed.speed_synth", what]
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if run.returncode == 0:
            return json.loads(run.stdout.strip().splitlines()[-1]) | {"backend": backend}
        if what != "with_gl":
            raise RuntimeError(run.stderr)
    return None


if __name__ == "__main__":
    print(json.dumps({"samples": samples, "with_gl": with_gl}[sys.argv[1]]()))
