"""Helpers for tests of simulated benchmarks: films, true joints in the world, and the seeds of random generators."""

from types import SimpleNamespace

import numpy as np

from synth.simulated.film import Studio, Take
from synth.simulated.room_films import Actor
from synth.simulated.stand_ins import StandIn

Seed = tuple[int, ...]


def film_of(maker: StandIn, index: int, frames: int | None = None) -> SimpleNamespace:
    """The first frames of a sequence, or all: its camera, and the arrays of `Studio.shots` with a first axis of T frames."""
    take = maker.take(index)
    shots = list(maker.studio.shots(take, maker.sensor, maker.noise(index), range(len(take))[:frames]))
    return SimpleNamespace(camera=maker.camera, **{name: np.array([shot[name] for shot in shots]) for name in shots[0]})


def joints_world_m(studio: Studio, take: Take | Actor) -> np.ndarray:
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
