"""Simulated sequences of unseen people; the motion of each set is defined in its own module.

No person, motion, room or noise of a benchmark is in a training set: its seeds are its own (`SetGenerator._rng`), its
people are near other adults and wear other kinds of tops and trousers (`draw_person`), its rooms have other furniture
(`DANCE_HALL`). docs/generating.md says what both show.
"""

from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.datasets.simulated import StoredSequence, read_sequence, write_sequence
from kpopnet.errors import InputError, check_between
from kpopnet.viz.drawing import TRUE, scene_tile, sheet
from synth.body.outfit import ClothesConfig
from synth.body.shape import BodyConfig, Person, draw_person
from synth.scene.room import ViewConfig
from synth.sensor.film_noise import FilmNoise
from synth.simulated.film import Played
from synth.simulated.generator import SetGenerator

BODY = BodyConfig(clothes=ClothesConfig(skirt=0.0, coat=0.0, hat=0.0, backpack=0.0, bag=0.0))
"""People as they come to a motion-capture session: markers are worn on trousers and tops. (The Y pose of a person in a skirt
or a coat is not found, because its test needs two legs: seen on `eval_sim` itself, and on a set with a training seed.)"""

HEADING_STD_DEG = 5.0  # standard deviation of the heading at the start

STANDING_PENETRATION_M, EXTRA_PENETRATION_M = 0.06, 0.03
"""A motion is rejected if two parts of the body, by their collision capsules, penetrate each other by more than the second
value beyond the greater of the first value and the person's penetration while standing. When broad people stand, their forearms
penetrate their thighs, with clothes, by 6 cm, which is not visible."""

PEOPLE_DRAWN = 3
"""How often the people of a sequence are drawn: a person of two metres has no room for a handstand in the image."""

TILES = 10
TILE_WIDTH_PX, TILE_PORTRAIT_PX = 240, 160

People = Callable[[int], Person]  # the people of a sequence by their number in it, each drawn once


@dataclass
class Selection:
    """Identity and size of a set; each set has its name and its greatest size as defaults.

    Attributes:
        name: name of the benchmark.
        seed: another seed gives other people, dances, rooms and noise.
        sequences: number of sequences to make; they are the first ones of the whole set.
        children: share of the people who are 6 to 12 years old; the others are adults.
    """

    name: str = ""
    seed: int = 0
    sequences: int = 1
    children: float = 0.0

    def __post_init__(self) -> None:
        check_between("benchmark.seed", self.seed, 0, 2**32 - 1)
        check_between("benchmark.sequences", self.sequences, 1, type(self).sequences)
        check_between("benchmark.children", self.children, 0, 1)


@dataclass(frozen=True)
class SequenceGenerator(SetGenerator):
    """Makes the sequences of a set, of one person or of several."""

    part, finished_files, unfinished_files = "sequence", "*.h5", ".*.h5.*.tmp"

    about: ClassVar[str]  # what the set is,
    truth: ClassVar[str] = "synthetic truth"  # and the origin of its true joints, for the reader of a report
    kinds: ClassVar[tuple[str, ...]]  # sequence k shows kinds[k % len(kinds)]
    fps: ClassVar[float]
    view: ClassVar[ViewConfig]  # distribution of the camera's pose
    tiles: ClassVar[int] = TILES  # frames of a sequence in the contact sheet
    names: ClassVar[str]  # format of the name of a sequence, by its numbers from 0 and from 1
    most_people: ClassVar[int] = 1  # in a sequence
    body: ClassVar[BodyConfig] = BODY
    people_of: ClassVar[str] = "benchmark"  # the split of its people, see `draw_person`
    tries: ClassVar[int]  # how often a sequence is drawn with the same people, until something fits,
    nothing_fits: ClassVar[str]  # and what the error says if nothing does: "none of 300 ..."
    marker_names: ClassVar[tuple[str, ...]] = ()

    frames: tuple[int, int] = (100, 400)  # least and greatest length of a sequence, frames

    @classmethod
    def sequence_name(cls, index: int) -> str:
        """The name of sequence `index`, and of its file without the suffix."""
        return cls.names.format(index, index + 1)

    def take(self, index: int) -> Any:
        """Draws people, motion, room and view of sequence `index`; its length is the number of frames.

        It has a `camera` where that is not the set's. Raises InputError if nothing fits.
        """
        for redrawn in range(PEOPLE_DRAWN):
            people = cache(lambda number, redrawn=redrawn: self.person(self.first_person(index) + number, redrawn))
            for attempt in range(self.tries):
                rng = self._rng("sequence", index, redrawn * self.tries + attempt)
                take = self.draw(rng, index, int(rng.integers(*self.frames, endpoint=True)), people)
                if take is not None:
                    return take
        raise InputError(f"{self.sequence_name(index)}: none of {PEOPLE_DRAWN * self.tries} {self.nothing_fits}")

    def draw(self, rng: np.random.Generator, index: int, frames: int, people: People) -> Any:
        """Draws what `take` returns, where a set does not override that; None if it does not fit."""
        raise NotImplementedError

    @abstractmethod
    def shots(self, index: int, take: Any, frames: range) -> Iterator[dict[str, np.ndarray]]:
        """Renders and measures frames of sequence `index`: of each the arrays of a `StoredSequence`, without the axis of time.

        A frame is the same whichever others are made.
        """

    def first_person(self, index: int) -> int:
        """The number of the first person of sequence `index`; the others follow. Files number those who are shown."""
        return index * self.most_people

    def sequence(self, index: int, on_frame: Callable[[], None]) -> StoredSequence:
        """Makes sequence `index` and calls `on_frame` after each frame."""
        take, arrays = self.take(index), {}
        for number, shot in enumerate(self.shots(index, take, range(len(take)))):
            for name, value in shot.items():
                arrays.setdefault(name, np.empty((len(take), *value.shape), value.dtype))[number] = value
            on_frame()
        return self.stored(index, getattr(take, "camera", self.camera), arrays)

    def stored(self, index: int, camera: Camera, arrays: dict[str, Any]) -> StoredSequence:
        """Sequence `index` with the arrays of a `StoredSequence`."""
        people = tuple(f"person {self.first_person(index) + number}" for number in range(arrays["joints_m"].shape[1]))
        name, kind = self.sequence_name(index), self.kind(index)
        return StoredSequence(name, kind, self.fps, camera, people, marker_names=self.marker_names, **arrays)

    def kind(self, index: int) -> str:
        return "recorded" if self.motion.source == "clips" else self.kinds[index % len(self.kinds)]

    def noise(self, index: int) -> FilmNoise:
        return FilmNoise(self._seed("noise", index))

    def person(self, subject: int, redrawn: int = 0) -> Person:
        """Person `subject` of the benchmark, or who is drawn in their place where nothing fits them: 1 the next, 2 the last."""
        rng, body = self._rng("person", subject, *([redrawn] if redrawn else [])), self.body
        return draw_person(rng, replace(body, children=self.benchmark.children), self.people_of)

    def manifest_entries(self) -> dict:
        share, about = self.benchmark.children, self.about
        if share:
            about += f" Of its people {100 * share:g} % are children of 6 to 12 years."
        return {"benchmark": self.benchmark.name, "about": about, "truth": self.truth}

    def frames_per_part(self) -> float:
        return sum(self.frames) / 2

    def path(self, folder: Path, index: int) -> Path:
        return folder / f"{self.sequence_name(index)}.h5"

    def make(self, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
        write_sequence(folder, self.sequence(index, on_frame))

    def contact_sheet(self, folder: Path, manifest: dict) -> np.ndarray:
        """RGB image: a row for each sequence, frames at even distances, with the true skeletons."""
        paths = [self.path(folder, index) for index in range(manifest["sequences"])]
        rows = self.sheet_rows([path for path in paths if path.exists()])
        return sheet(rows, (TRUE,), f"SIMULATED, {manifest['benchmark']}, seed {manifest['seed']}: depth and true joints")

    def sheet_rows(self, paths: list[Path]) -> list[tuple[str, list[np.ndarray]]]:
        """The rows of the contact sheet, from the files of the set."""
        return [self.sheet_row(path) for path in paths]

    def sheet_row(self, path: Path) -> tuple[str, list[np.ndarray]]:
        frames = len(read_sequence(path, ()).joints_m)
        numbers = np.unique(np.linspace(0, frames - 1, self.tiles).astype(int)).tolist()
        stored = read_sequence(path, numbers)
        stored = replace(stored, joints_m=stored.joints_m[numbers])
        tiles = [frame_tile(stored, at, f"frame {number}") for at, number in enumerate(numbers)]
        return f"{path.stem}: {stored.kind}, {frames} frames", tiles


def frame_tile(stored: StoredSequence, number: int, caption: str) -> np.ndarray:
    """RGB image of one frame with the true skeletons and a caption."""
    camera = stored.camera
    width_px = TILE_WIDTH_PX if camera.width >= camera.height else TILE_PORTRAIT_PX
    skeletons = ((person_m, TRUE) for person_m in stored.joints_m[number])
    return scene_tile(depth_in_metres(stored.depth[number]), camera, skeletons, width_px, (caption,))


def penetrates_itself(played: Played, standing_frames: int) -> bool:
    """Whether parts of the body penetrate each other more than while standing, in the first `standing_frames` frames."""
    standing_m = played.penetration_m[:standing_frames].max()
    return bool(played.penetration_m.max() > max(standing_m, STANDING_PENETRATION_M) + EXTRA_PENETRATION_M)
