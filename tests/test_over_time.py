"""The tools that make films for networks over time and train these: through the programs."""

import json
import re

import numpy as np
import pytest
import torch
from programs import run_program

from kpopnet.networks.over_time import Measured
from kpopnet.skeleton import Joint
from tools.over_time import loss_of, report


def write_film(folder, number, noise_m=0.03, frames=64):
    """A pose at rest, measured with noise."""
    rng = np.random.default_rng(number)
    true_m = np.tile(rng.uniform(-0.5, 0.5, (15, 3)) + np.array([0, 0, 3]), (frames, 1, 1))
    film = {"true_m": true_m, "times_s": np.arange(frames) / 30, "hidden": np.zeros((frames, 15), bool)}
    for mode in ("realtime", "best"):
        joints = (true_m + noise_m * rng.standard_normal(true_m.shape) for _ in range(2))
        values = (*joints, *(rng.uniform(0.6, 1.0, (frames, 15)) for _ in range(2)))
        film |= {f"{mode}_{name}": value for name, value in zip(Measured._fields, values, strict=True)}
    folder.mkdir(exist_ok=True)
    np.savez(folder / f"film_{number:05d}.npz", **film)


def test_the_interval_of_a_difference_counts_the_films_that_show_it(capsys):
    none = [(0.0, 0)] * 5

    def difference(new, old):
        report({name: [{"cm": film} for film in films] for name, films in (("new", new), ("old", old))}, "new", "old")
        return capsys.readouterr().out.splitlines()[1].partition("difference ")[2]

    few = difference([(float(value), 1) for value in range(5)], [(0.0, 1)] * 5)
    mean, low, high = map(float, re.fullmatch(r"(.*) \((.*) to (.*)\)", few).groups())
    # Student's interval is 3.9 wide, plain percentiles 2.4.
    assert mean == 2 and 3.2 < high - low < 4
    assert difference([(20.0, 2), (30.0, 1), *none], [(4.0, 2), (5.0, 1), *none]) == "+13.67"
    assert difference(none, none) == "+nan"


def test_directions_that_stay_off_cost_more_than_those_that_change():
    """A score of a dance averages changing errors out, and grades lasting ones."""
    true_m = torch.from_numpy(np.random.default_rng(0).uniform(-0.5, 0.5, (1, 1, 15, 3))).repeat(1, 16, 1, 1)
    error_m = torch.zeros(1, 16, 15, 3)
    error_m[:, :, Joint.LEFT_HAND] = 0.02
    changing_m = error_m * torch.tensor([1.0, -1.0]).repeat(8)[:, None, None]
    unsure, apart_s = torch.zeros(1, 16, 15), torch.full((1, 16), 9.0)  # too far apart for the error of speeds
    lasting, changing, none = (float(loss_of(true_m + one, unsure, true_m, apart_s)) for one in (error_m, changing_m, 0))
    assert lasting - none > 2 * (changing - none) > 0


@pytest.mark.parametrize("form", [(), ("--future",)], ids=["causal", "future"])
def test_a_short_training_steadies_a_person_at_rest_and_repeats(tmp_path, form):
    for number in range(6):
        write_film(tmp_path / "films", number)
        write_film(tmp_path / "fresh", 100 + number)
    arguments = ("films", "--fresh", "fresh", *form, "--epochs", 12, "--out")
    first = run_program("tools/over_time.py", tmp_path, *arguments, "net.safetensors")
    assert first.returncode == 0, first.stderr
    both, over_time = re.search(r"core at rest, mm RMS: mean of both ([\d.]+), over time ([\d.]+);", first.stdout).groups()
    # The mean of two measurements of 30 mm in each of three axes, over ten frames.
    np.testing.assert_allclose(float(both), 1000 * 0.03 * np.sqrt(3 / 2 * 0.9), rtol=0.1)
    assert float(over_time) < 0.8 * float(both)
    trained = (tmp_path / "net.safetensors").read_bytes()
    if form:
        run_program("tools/over_time.py", tmp_path, *arguments, "again.safetensors")
        assert (tmp_path / "again.safetensors").read_bytes() == trained
    else:
        again = run_program("tools/over_time.py", tmp_path, *arguments, "net.safetensors")
        assert again.stdout == first.stdout and "epoch" not in again.stderr  # what is there is measured, not trained again
        other = run_program("tools/over_time.py", tmp_path, *arguments, "net.safetensors", "--future")
        assert other.returncode == 1 and "net.safetensors: is of the causal form" in other.stderr
        (tmp_path / "fresh/film_00100.npz").write_bytes(b"cut")
        torn = run_program("tools/over_time.py", tmp_path, *arguments, "net.safetensors")
        assert torn.returncode == 1 and "film_00100.npz: not a readable film" in torn.stderr


@pytest.mark.parametrize(
    ("program", "none", "film"),
    [
        ("tools/over_time_films.py", ("--films", 0), "film_00000.npz"),
        ("tools/graded_learners.py", ("--dances", 0), "dance_000_perfect_0.npz"),
    ],
)
def test_films_of_another_network_or_seed_are_not_taken_for_finished(tmp_path, program, none, film):
    """`none`: what makes no film."""
    assert run_program(program, tmp_path, "films", *none).returncode == 0
    (tmp_path / "films" / film).touch()
    manifest = tmp_path / "films" / "manifest.json"
    made_with = json.loads(manifest.read_text())
    for name in ("weights", "seed"):
        manifest.write_text(json.dumps(made_with | {name: 5}))
        other = run_program(program, tmp_path, "films", *none)
        assert other.returncode == 1 and f"films: holds files made with {name}=5" in other.stderr
