"""What tests of all simulated benchmarks ask: where joints truly are, and what chance is drawn from."""

import numpy as np

from synth.film import Studio, Take
from synth.motion import MotionConfig
from synth.sample import SampleConfig, Sampler

Seed = tuple[int, ...]


def joints_world_m(studio: Studio, take: Take) -> np.ndarray:
    """(T, 15, 3) true joints in the world."""
    scene, joints = studio.scene, []
    scene.dress(scene.fit(take.played.person))
    for local, hips_m in zip(take.played.local, take.played.hips_m, strict=True):
        scene.pose(local, hips_m + take.place_m)
        joints.append(scene.joints_world_m())
    return np.array(joints)


def recorded_seeds(monkeypatch) -> list[Seed]:
    """A list that gets the seed of every generator that is made from now on."""
    seeds: list[Seed] = []
    original = np.random.default_rng

    def recorded(seed):
        seeds.append(tuple(np.atleast_1d(seed).tolist()))
        return original(seed)

    monkeypatch.setattr(np.random, "default_rng", recorded)
    return seeds


def draw_presets(splits: tuple[str, ...]) -> None:
    """A few samples of every kind that training sets are made of."""
    for split in splits:
        for source in ("mix", "choreography"):
            sampler = Sampler(SampleConfig(renderer="cpu", motion=MotionConfig(source=source)), 0, split)
            list(sampler.samples(0, 3))


def assert_own_seeds(maker, name: bytes, monkeypatch) -> None:
    """A film's generators are all different, and none is a preset's: their seeds begin with the benchmark's name."""
    seeds, own = recorded_seeds(monkeypatch), tuple(name)
    maker.film(0, frames=2)
    assert len(seeds) >= 4 and all(seed[: len(own)] == own for seed in seeds)
    assert len(set(seeds)) == len(seeds)
    seeds.clear()
    draw_presets(("train", "validation", "test"))
    # A shorter seed is the same as one filled up with zeros; the name's third and fourth letters are none.
    assert len(seeds) > 20 and all(len(seed) <= 4 and seed[2:4] != own[2:4] for seed in seeds)
