"""Helpers for tests of simulated benchmarks: true joints in the world, and the seeds of random generators."""

import numpy as np

from synth.simulated.film import Studio, Take

Seed = tuple[int, ...]


def joints_world_m(studio: Studio, take: Take) -> np.ndarray:
    """(T, 15, 3) true joints in metres in the world frame."""
    played = take.played
    return studio.joints_world_m(played.person, played.local, played.hips_m + take.place_m)


def recorded_seeds(monkeypatch) -> list[Seed]:
    """A list to which the seed of every generator that is created from now on is appended."""
    seeds: list[Seed] = []
    original = np.random.default_rng

    def record(seed):
        seeds.append(tuple(np.atleast_1d(seed).tolist()))
        return original(seed)

    monkeypatch.setattr(np.random, "default_rng", record)
    return seeds
