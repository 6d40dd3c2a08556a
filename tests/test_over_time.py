"""tools/over_time.py: a training and its figures through the program."""

import re

import numpy as np
from programs import run_program

from kpopnet.networks.over_time import Measured


def write_film(folder, number, noise_m=0.03, frames=64):
    """A pose at rest, measured with noise."""
    rng = np.random.default_rng(number)
    true_m = np.tile(rng.uniform(-0.5, 0.5, (15, 3)) + np.array([0, 0, 3]), (frames, 1, 1))
    film = {"true_m": true_m, "times_s": np.arange(frames) / 30, "hidden": np.zeros((frames, 15), bool)}
    for prefix in ("", "mirror_"):
        joints = (true_m + noise_m * rng.standard_normal(true_m.shape) for _ in range(2))
        values = (*joints, *(rng.uniform(0.6, 1.0, (frames, 15)) for _ in range(2)))
        film |= {prefix + name: value for name, value in zip(Measured._fields, values, strict=True)}
    folder.mkdir(exist_ok=True)
    np.savez(folder / f"film_{number:05d}.npz", **film)


def test_a_short_training_steadies_a_person_at_rest(tmp_path):
    for number in range(6):
        write_film(tmp_path / "films", number)
        write_film(tmp_path / "fresh", 100 + number)
    arguments = ("films", "--fresh", "fresh", "--out", "net.safetensors", "--epochs", 12)
    first = run_program("tools/over_time.py", tmp_path, *arguments)
    assert first.returncode == 0, first.stderr
    both, over_time = re.search(r"core at rest, mm RMS: mean of both ([\d.]+), over time ([\d.]+);", first.stdout).groups()
    # The mean of two measurements of 30 mm in each of three axes, over ten frames.
    np.testing.assert_allclose(float(both), 1000 * 0.03 * np.sqrt(3 / 2 * 0.9), rtol=0.1)
    assert float(over_time) < 0.8 * float(both)
    again = run_program("tools/over_time.py", tmp_path, *arguments)
    assert again.stdout == first.stdout  # the weights that are there are measured, not trained again
