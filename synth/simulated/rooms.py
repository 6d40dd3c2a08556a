"""`rooms`: simulated films and single images of any number of people in any room, before any camera.

465 sequences in five rounds: a film of every kind of scene (`synth.simulated.casts`), of 60 to 120 frames at 30 fps, and 80
single images (`synth.rooms.scene`) in each. Rooms have the furniture and clutter of benchmarks; surfaces may return nothing;
cameras differ in size, field of view, height, pitch and roll, and some move. Every sequence shows people of its own, in tops
and trousers that no training shows. The set imitates no published one.

`whole_px` are the pixels that a whole person would have without a border and with nothing before them, `seen_px` those that
show the person after the sensor.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.datasets.simulated import StoredSequence, read_sequence
from kpopnet.errors import InputError
from synth.body.shape import BodyConfig, Person
from synth.rooms.held_back import BENCHMARK_CLUTTER
from synth.rooms.images import measure_scene
from synth.rooms.scene import MOST_PEOPLE, RoomScenes
from synth.samples.sampler import SampleConfig
from synth.simulated.casts import CASTS, FPS
from synth.simulated.film import pixels_of_people
from synth.simulated.room_films import FILM_PX, RoomFilms, RoomTake, draw_take
from synth.simulated.sequences import TILES, People, Selection, frame_tile

SINGLE = "single_image"
ROUNDS, SINGLES_A_ROUND = 5, 80
KINDS = (*CASTS, *[SINGLE] * SINGLES_A_ROUND)
IMAGE_PX = (*FILM_PX, (512, 424), (1024, 1024))  # most (width, height) of the cameras of single images, pixels

SENSOR_SHARES = {"kinect_v1": 0.5, "kinect_2": 0.35, "swissranger": 0.15}
"""How many single images each sensor measures."""

IMAGE_ROWS = 4  # rows of single images in the contact sheet


@dataclass
class RoomsConfig(Selection):
    """Identity and size of the set. The first 13 sequences are a film of each kind.

    Attributes:
        seed: another seed gives other people, films, rooms and noise; single images take dances from the same hundred with any.
        kinds: of scenes to show, in turn.
        still_cameras: cameras that would move keep the pose that they have in the middle of the film: the same films otherwise,
            to compare with.
    """

    name: str = "rooms"
    sequences: int = ROUNDS * len(KINDS)
    kinds: list[str] = field(default_factory=lambda: list(dict.fromkeys(KINDS)))
    still_cameras: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.kinds or not set(self.kinds) <= set(KINDS):
            raise InputError(f"benchmark.kinds={self.kinds}: expected some of {', '.join(dict.fromkeys(KINDS))}")


@dataclass(frozen=True)
class Rooms(RoomFilms):
    generator: ClassVar[int] = 5
    benchmark: RoomsConfig = field(default_factory=RoomsConfig)
    frames: tuple[int, int] = (60, 120)

    about = "SIMULATED films and images of any number of people in rooms, no real person."
    names, most_people = "room_{:03d}", MOST_PEOPLE
    body, tries, nothing_fits = BodyConfig(), 60, "casts is in view and clear of the room"
    composed_only = "recordings know of no second person; take motion=choreography"
    camera, fps = CAMERAS["eval"], FPS  # the camera of some; each sequence has its own
    kinds: ClassVar[tuple[str, ...]] = KINDS

    def kind(self, index: int) -> str:
        kinds = [kind for kind in KINDS if kind in self.benchmark.kinds]
        return kinds[index % len(kinds)]

    def frames_per_part(self) -> float:
        kinds = [self.kind(index) for index in range(self.size)]
        return float(np.mean([1.0 if kind == SINGLE else sum(self.frames) / 2 for kind in kinds]))

    def scene_rng(self, stream: str, number: int) -> np.random.Generator:
        """The generator of a stream of single images; the streams of films are numbered by attempts."""
        return self._rng("sequence", number, self.tries, *stream.encode())

    def draw(self, rng: np.random.Generator, index: int, frames: int, people: People) -> RoomTake | None:
        take = draw_take(rng, self.kind(index), people, frames)
        if take is None or not self.benchmark.still_cameras:
            return take
        return replace(take, views=(take.view(len(take) // 2),))

    def sequence(self, index: int, on_frame: Callable[[], None]) -> StoredSequence:
        if self.kind(index) != SINGLE:
            return super().sequence(index, on_frame)
        rng = self._rng("sequence", index)
        clear = self._scenes[int(rng.integers(len(IMAGE_PX)))].draw_scene(8 * index)  # eight scenes show the same people
        depth_mm, labels = measure_scene(rng, clear, SENSOR_SHARES)
        seen_px = pixels_of_people(labels + np.uint8(1), len(clear.joints_camera_m))  # of films, the first person is 2
        whole_px = np.maximum(np.rint(clear.whole_px).astype(np.int32), seen_px)
        on_frame()
        shot = {"depth": depth_mm, "joints_m": clear.joints_camera_m, "whole_px": whole_px, "seen_px": seen_px}
        return self.stored(index, clear.camera, {name: array[None] for name, array in shot.items()})

    @cached_property
    def _scenes(self) -> list["BenchmarkScenes"]:
        return [BenchmarkScenes(self, most_px) for most_px in IMAGE_PX]

    def sheet_rows(self, paths: list[Path]) -> list[tuple[str, list[np.ndarray]]]:
        """A row for each of the first films of a kind, and rows of single images."""
        of_kind: dict[str, list[Path]] = {}
        for path in paths:
            of_kind.setdefault(self.kind(int(path.stem.removeprefix("room_"))), []).append(path)
        singles = of_kind.pop(SINGLE, [])[: IMAGE_ROWS * TILES]
        images = [frame_tile(read_sequence(path), 0, path.stem) for path in singles]
        rows = [self.sheet_row(films[0]) for films in of_kind.values()]
        return rows + [("single images", images[first : first + TILES]) for first in range(0, len(images), TILES)]


class BenchmarkScenes(RoomScenes):
    """The scenes of single images: people, clutter and seeds are the benchmark's."""

    def __init__(self, maker: Rooms, most_px: tuple[int, int]) -> None:
        super().__init__(SampleConfig(renderer="cpu"), maker.benchmark.seed, "test", most_px, BENCHMARK_CLUTTER)
        self._maker = maker

    def person(self, number: int) -> Person:
        return self._maker.person(number)

    def _rng(self, kind: str, index: int) -> np.random.Generator:
        return self._maker.scene_rng(kind, index)
