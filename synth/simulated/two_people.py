"""`two_people`: simulated films of two people in one room, before a Kinect v1.

24 sequences of 260 to 320 frames at 30 fps, four of each kind of scene: they cross, one passes behind the other and back, they
hug, one leaves the image, one enters it, they dance side by side (`synth.motion.choreography.pairs`). No person is in
two sequences, or in a training set. People do not penetrate each other, but for those who hug: their distance is the same
whatever their size. It imitates no published set.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from kpopnet.camera import CAMERAS, Camera
from synth.motion.choreography.pairs import LEAVES_IMAGE, SCRIPTS, Part, draw_duet
from synth.samples.layers import millimetres
from synth.scene.room import DANCE_HALL, ViewConfig, draw_room, draw_view
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated.film import (
    CleanFrame,
    Played,
    Studio,
    Take,
    are_apart,
    measure_surfaces,
    nearest_surfaces,
    on_stage,
    pixels_of_people,
)
from synth.simulated.sequences import HEADING_STD_DEG, People, Selection, SequenceGenerator, penetrates_itself

FPS = 30.0
CAMERA = CAMERAS["eval"]

ROOM_TRIES, PLACES = 16, 12  # rooms tried for a scene, and places in each room

STAGE_M = ((-0.25, 0.25), (2.3, 3.6))
"""Ranges of the middle of the stage: to the right of the camera, and from it; metres."""


@dataclass
class TwoPeopleConfig(Selection):
    """Identity and size of the set. Its first six sequences show one scene of each kind."""

    name: str = "two_people"
    sequences: int = 24


@dataclass(frozen=True)
class Duet:
    """Two takes in one room before one camera, with the same number of frames."""

    takes: tuple[Take, Take]

    def __len__(self) -> int:
        return len(self.takes[0])


@dataclass(frozen=True)
class TwoPeople(SequenceGenerator):
    """Makes the sequences; holds a compiled scene for each of the two."""

    benchmark: TwoPeopleConfig = field(default_factory=TwoPeopleConfig)
    sensor: SensorConfig = SENSORS["kinect_v1"]
    frames: tuple[int, int] = (260, 320)

    about = "SIMULATED films of two people, no real person."
    names, most_people = "pair_{:02d}", 2
    composed_only = "recordings know of no second person; take motion=choreography"
    camera, fps = CAMERA, FPS
    view = ViewConfig(height_m=(0.9, 1.7), aim_m=(0.85, 1.15))
    kinds = tuple(SCRIPTS)
    tries, nothing_fits = 100, "scenes stays inside a room and the image"

    @cached_property
    def studios(self) -> tuple[Studio, Studio]:
        return Studio(CAMERA, self.renderer), Studio(CAMERA, self.renderer)

    def draw(self, rng: np.random.Generator, index: int, frames: int, people: People) -> Duet | None:
        kind, cast = self.kind(index), []
        parts = draw_duet(rng, kind, frames, FPS)
        for number, (studio, part) in enumerate(zip(self.studios, parts, strict=True)):
            yaw_rad, curls_rad = np.radians(HEADING_STD_DEG) * rng.normal(), rng.uniform(0.0, 1.5, 2)
            cast.append(studio.play(people(number), part.motion, 0.0 if kind == "hug" else yaw_rad, curls_rad))
        if any(penetrates_itself(played, round(FPS)) for played in cast):
            return None
        joints_m = (
            studio.joints_world_m(played.person, played.local, played.hips_m + on_stage(part.place_m, 0.0))
            for studio, played, part in zip(self.studios, cast, parts, strict=True)
        )
        if kind != "hug" and not are_apart([*joints_m]):
            return None
        return self._place(rng, cast, parts, kind in LEAVES_IMAGE)

    def _place(self, rng: np.random.Generator, cast: list[Played], parts: list[Part], leaves: bool) -> Duet | None:
        """Searches a place in a room where both are seen whole, but for the second where they leave the image."""
        for _ in range(ROOM_TRIES):
            view, room = draw_view(rng, self.view), draw_room(rng, DANCE_HALL)
            rooms_m = [studio.furnish(room, view) for studio in self.studios]
            for _ in range(PLACES):
                x_m, y_m = (rng.uniform(*bounds) for bounds in STAGE_M)
                yaw_rad = -np.arctan2(x_m, y_m)  # what was played towards the camera still faces it
                takes = [
                    Take(played.turned(yaw_rad), room, view, on_stage(part.place_m, yaw_rad) + np.array((x_m, y_m, 0.0)))
                    for played, part in zip(cast, parts, strict=True)
                ]
                shown = zip(self.studios, takes, (True, not leaves), strict=True)
                if all(not inside or studio.in_image(take) for studio, take, inside in shown) and all(
                    studio.is_clear(take, room_m) for studio, take, room_m in zip(self.studios, takes, rooms_m, strict=True)
                ):
                    return Duet((takes[0], takes[1]))
        return None

    def shots(self, index: int, take: Duet, frames: range) -> Iterator[dict[str, np.ndarray]]:
        noise = self.noise(index)
        rendered = (studio.render(one, frames) for studio, one in zip(self.studios, take.takes, strict=True))
        return (measure(pair, self.camera, self.sensor, noise) for pair in zip(*rendered, strict=True))


def measure(
    pair: tuple[CleanFrame, CleanFrame], camera: Camera, sensor: SensorConfig, noise: FilmNoise
) -> dict[str, np.ndarray]:
    """Puts two people, each rendered alone in the same room, into one image, and applies the sensor model.

    `seen_px` are the pixels that show each of them before the sensor's noise.
    """
    room_m, joints_m = pair[0].room_m, np.stack([clean.joints_camera_m for clean in pair])
    surfaces = nearest_surfaces(room_m, [clean.person_m for clean in pair])
    depth_m, _ = measure_surfaces(surfaces, pair[0].number, joints_m, camera, sensor, noise)
    alone = [nearest_surfaces(room_m, [clean.person_m])[1] for clean in pair]
    alone_px = np.concatenate([pixels_of_people(labels, 1) for labels in alone])
    seen_px = pixels_of_people(surfaces[1], len(pair))
    return {"depth": millimetres(depth_m), "joints_m": joints_m, "alone_px": alone_px, "seen_px": seen_px}
