"""A floor under the accuracy of the networks that ship: a wrong crop, camera, joint order or weight file falls through it.

The bounds lie several standard errors below what the networks had when they were set: simulated 91 % within 10 cm, real 84 %;
of people among clutter 87 % found, 94 % of those found right.
"""

import numpy as np
import pytest
from programs import ROOT, run_program, tool
from real_data import UTD_MHAD

from kpopnet.data.canvas import CANVAS
from kpopnet.data.room_images import RoomImage
from kpopnet.datasets.protocol import Benchmark, BenchmarkConfig
from kpopnet.datasets.synthetic import SyntheticBenchmark
from kpopnet.datasets.utd_mhad import UtdMhadBenchmark, UtdMhadConfig
from kpopnet.finder.finder import LEAST_ALONE, PersonFinder, open_finder
from kpopnet.finder.people import certainty
from kpopnet.networks.estimator import NetworkEstimator
from synth.rooms.images import measure_scene
from synth.rooms.scene import RoomScenes
from synth.samples.sampler import SampleConfig

fit_finder = tool("fit_finder")

WITH_A_BENCH = ("a25_s1_t1",)
"""Sequences in which the removal of the background left pieces of a bench, which are not the person's."""


def errors_m(benchmark: Benchmark, names: list[str], every: int) -> np.ndarray:
    """Errors of all joints in every n-th frame of some sequences, metres."""
    network, found = NetworkEstimator(), []
    for name in names:
        sequence = benchmark.read(name)
        joints_m = network.estimate(sequence.depth_m[::every], sequence.camera).joints_camera_m
        found.append(np.linalg.norm(joints_m - sequence.joints_camera_m[::every], axis=-1).ravel())
    return np.concatenate(found)


def test_on_single_images_of_other_people(tmp_path):
    settings = "splits={train: 0, validation: 0, test: 100}", "seed=7", "processes=1", f"out={tmp_path}"
    assert run_program("-m", ROOT, "synth", *settings).returncode == 0
    benchmark = SyntheticBenchmark(BenchmarkConfig("synthetic", str(tmp_path / "test")))
    error_m = errors_m(benchmark, benchmark.sequence_names(), 1)
    assert len(error_m) == 100 * 15
    assert (error_m < 0.1).mean() > 0.86 and error_m.mean() < 0.065


@pytest.mark.skipif(not UTD_MHAD.exists(), reason=f"no real depth in {UTD_MHAD}")
def test_on_real_people():
    benchmark = UtdMhadBenchmark(UtdMhadConfig(path=str(UTD_MHAD)))
    error_m = errors_m(benchmark, benchmark.sequence_names()[::4], 5)
    known_m = error_m[np.isfinite(error_m)]
    assert len(known_m) > 3000
    assert (known_m < 0.1).mean() > 0.8 and known_m.mean() < 0.075


def test_people_are_found_among_clutter():
    drawn = RoomScenes(SampleConfig(renderer="cpu"), 11, "test", CANVAS)
    network = open_finder()
    found = wanted = false = 0
    for index in range(60):
        clear = drawn.draw_scene(index)
        measured = measure_scene(drawn.sensor_rng(index), clear)
        image = RoomImage(measured.depth_mm, measured.labels, clear.camera, clear.joints_camera_m, clear.whole_px)
        people = fit_finder.people_of(network, image)
        right, counts, present = fit_finder.judged(image, people)
        sure = certainty(people) >= LEAST_ALONE
        found, false, wanted = found + (sure & right).sum(), false + (sure & counts & ~right).sum(), wanted + present
    assert wanted > 45 and found > 0.75 * wanted and false < 0.2 * found


@pytest.mark.skipif(not UTD_MHAD.exists(), reason=f"no real depth in {UTD_MHAD}")
def test_a_real_person_whose_background_was_removed_is_found_whole():
    benchmark = UtdMhadBenchmark(UtdMhadConfig(path=str(UTD_MHAD)))
    for name in benchmark.sequence_names()[::12]:
        sequence = benchmark.read(name)
        finder = PersonFinder(sequence.camera)
        for depth_m in sequence.depth_m[::20]:
            (human,) = finder.extract(depth_m)
            kept = (human.whole(sequence.camera) > 0).sum() / (depth_m > 0).sum()
            assert kept > (0.9 if name in WITH_A_BENCH else 0.97), name
