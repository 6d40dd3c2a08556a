"""Helpers for tests of simulated benchmarks: true joints in the world, and the seeds of random generators."""

import numpy as np

from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig, Sampler
from synth.sensor.film_noise import HOLE_FRAMES
from synth.simulated.film import Studio, Take

Seed = tuple[int, ...]


def joints_world_m(studio: Studio, take: Take) -> np.ndarray:
    """(T, 15, 3) true joints in metres in the world frame."""
    scene, joints = studio.scene, []
    scene.set_person(scene.fit(take.played.person))
    for local, hips_m in zip(take.played.local, take.played.hips_m, strict=True):
        scene.pose(local, hips_m + take.place_m)
        joints.append(scene.joints_world_m())
    return np.array(joints)


def recorded_seeds(monkeypatch) -> list[Seed]:
    """A list to which the seed of every generator that is created from now on is appended."""
    seeds: list[Seed] = []
    original = np.random.default_rng

    def record(seed):
        seeds.append(tuple(np.atleast_1d(seed).tolist()))
        return original(seed)

    monkeypatch.setattr(np.random, "default_rng", record)
    return seeds


def draw_presets(splits: tuple[str, ...]) -> None:
    """Draws a few samples of every kind of training set."""
    for split in splits:
        for source in ("mix", "choreography"):
            sampler = Sampler(SampleConfig(renderer="cpu", motion=MotionConfig(source=source)), 0, split)
            list(sampler.samples(0, 3))


def assert_own_seeds(maker, name: bytes, monkeypatch) -> None:
    """Checks a film's seeds: they begin with the benchmark's name, none occurs in a preset, all differ but of common holes."""
    seeds, own = recorded_seeds(monkeypatch), tuple(name)
    maker.film(0, frames=2)
    assert len(seeds) >= 4 and all(seed[: len(own)] == own for seed in seeds)
    assert len(seeds) - len(set(seeds)) == HOLE_FRAMES - 1  # holes that both frames show
    seeds.clear()
    draw_presets(("train", "validation", "test"))
    # A shorter seed equals one padded with zeros; the third and fourth letters of the name are not zero.
    assert len(seeds) > 20 and all(len(seed) <= 4 and seed[2:4] != own[2:4] for seed in seeds)
