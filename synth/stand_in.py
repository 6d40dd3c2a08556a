"""Stand-ins for published benchmarks: simulated sequences of unseen people, which `stand_in_files` writes in the real bytes.

What all of them share is here; what each shows stands in its own module (`eval_sim`, `smmc10_sim`). Sequence k is a pure
function of the configuration and k. Nobody and nothing in it was ever in a training set: see `draw_stranger` and
`StandIn._rng`.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from synth.body import BodyConfig, Person, draw_stranger
from synth.film import Film, Shot, Studio, Take
from synth.motion import build_motion
from synth.motion.features import START_S, start_pose
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, follow, resampled
from synth.room import ViewConfig, draw_room, draw_view
from synth.simulated_set import SimulatedSet, is_faulty

BODY = BodyConfig()

FACING_DEG = 5.0
"""Standard deviation of the heading at the start."""

OVERLAP_M = (0.06, 0.03)
"""A motion is refused if two parts of the body lie deeper in each other, by the capsules in them, than the first, or than
when the person only stands there, and the second besides. The forearms of broad people lie 6 cm deep in their thighs then,
clothes and all, and it does not show."""

TRIES, ROOMS = 100, 8
"""Motions tried for a sequence, and rooms tried for each."""


@dataclass
class Which:
    """Which set of a stand-in.

    Attributes:
        name: of the benchmark.
        seed: other people, dances, rooms and noise.
        sequences: only the first so many, which are the same as in the whole.
    """

    whole: ClassVar[int] = 1
    name: str = ""
    seed: int = 0
    sequences: int = 1

    def __post_init__(self) -> None:
        if self.name != type(self).name:
            raise InputError(f"benchmark.name={self.name}: the set is called {type(self).name}")
        if not 0 <= self.seed < 2**32:
            raise InputError(f"benchmark.seed={self.seed} must lie in 0..{2**32 - 1}")
        if not 1 <= self.sequences <= self.whole:
            raise InputError(f"benchmark.sequences={self.sequences}: the set has {self.whole}; give a number from 1 on")


@dataclass(frozen=True)
class StandInSet(SimulatedSet, ABC):
    """The whole of what the sequences depend on. Attributes: frames: least and greatest length of a sequence."""

    counted: ClassVar[str] = "sequences"
    frames: tuple[int, int] = (100, 400)

    def kind(self, index: int) -> str:
        """What sequence `index` shows."""
        return "recorded" if self.motion.source == "clips" else self.composed_kind(index)

    @abstractmethod
    def composed_kind(self, index: int) -> str:
        """What sequence `index` shows where its motion is composed."""


class StandIn(ABC):
    """Makes the sequences; holds one compiled scene.

    Attributes:
        camera: that films.
        fps: frames a second.
        view: where the camera stands.
        subjects: what the people are called; they take turns, so the first few sequences show them all.
    """

    camera: ClassVar[Camera]
    fps: ClassVar[float]
    view: ClassVar[ViewConfig]
    subjects: ClassVar[tuple[str, ...]]

    def __init__(self, config: StandInSet) -> None:
        self.config = config
        self._recordings = build_motion(config.motion, "test") if config.motion.source == "clips" else None

    @classmethod
    @abstractmethod
    def sequence_name(cls, index: int) -> str:
        """As the file is called."""

    @abstractmethod
    def show(self, rng: np.random.Generator, index: int, seconds: float) -> Motion:
        """What sequence `index` shows after its start, of at least so many seconds."""

    @cached_property
    def studio(self) -> Studio:
        return Studio(self.camera, self.config.renderer)

    def _rng(self, kind: str, *numbers: int) -> np.random.Generator:
        """Chance for a person, a sequence or a frame's noise: its seed starts with the benchmark's name, as no other does."""
        which = self.config.benchmark
        return np.random.default_rng([*which.name.encode(), which.seed, ("person", "sequence", "noise").index(kind), *numbers])

    def subject(self, index: int) -> str:
        """Whom sequence `index` shows."""
        return self.subjects[index % len(self.subjects)]

    def person(self, subject: int) -> Person:
        return draw_stranger(self._rng("person", subject), BODY)

    def take(self, index: int) -> Take:
        """Sequence `index`, planned: who does what, and where.

        Raises:
            InputError: no motion of the source stays within a room and the picture.
        """
        person = self.person(index % len(self.subjects))
        for attempt in range(TRIES):
            rng = self._rng("sequence", index, attempt)
            motion = self._motion(rng, index, int(rng.integers(*self.config.frames, endpoint=True)))
            if is_faulty(motion):
                continue
            yaw_rad, curls_rad = np.radians(FACING_DEG) * rng.normal(), rng.uniform(0.0, 1.5, 2)
            played = self.studio.play(person, motion, yaw_rad, curls_rad)
            standing_m = played.overlap_m[: round(START_S * self.fps)].max()
            if played.overlap_m.max() > max(standing_m, OVERLAP_M[0]) + OVERLAP_M[1]:
                continue
            for _ in range(ROOMS):
                view, room = draw_view(rng, self.view), draw_room(rng)
                if (take := self.studio.place(rng, played, room, view)) is not None:
                    return take
        raise InputError(
            f"{self.sequence_name(index)}: none of {TRIES} motions drawn stays in the picture and clear of walls and "
            "furniture without faults; give recordings that stay within some 3 x 2 m, or take motion=choreography"
        )

    def _motion(self, rng: np.random.Generator, index: int, frames: int) -> Motion:
        motion = start_pose(rng, self.fps)
        while len(motion) < frames:
            left_s = (frames - len(motion)) / self.fps + 1
            motion = follow(motion, self._recorded(rng, left_s) if self._recordings else self.show(rng, index, left_s))
        return cut(motion, 0, frames)

    def _recorded(self, rng: np.random.Generator, seconds: float) -> Motion:
        """A stretch of a recording, of at most so many seconds."""
        motion = resampled(self._recordings.motion(int(rng.integers(len(self._recordings)))), self.fps)
        start = int(rng.integers(max(len(motion) - int(seconds * self.fps), 0) + 1))
        return cut(motion, start, start + int(seconds * self.fps))

    def shots(self, index: int, take: Take, frames: range) -> Iterator[Shot]:
        return self.studio.shots(take, self.config.sensor, lambda frame: self._rng("noise", index, frame), frames)

    def film(self, index: int, frames: int | None = None) -> Film:
        """Sequence `index` in memory, or its first frames: the same as in the file.

        Raises:
            InputError: see `take`.
        """
        take = self.take(index)
        count = len(take.played) if frames is None else min(frames, len(take.played))
        shots = list(self.shots(index, take, range(count)))
        return Film(
            name=self.sequence_name(index),
            identity=self.subject(index),
            fps=self.fps,
            camera=self.camera,
            depth_m=np.stack([shot.depth_m for shot in shots]),
            person=np.stack([shot.person for shot in shots]),
            joints_camera_m=np.stack([shot.joints_camera_m for shot in shots]),
            markers_camera_m=np.stack([shot.markers_camera_m for shot in shots]),
            markers_tracked=np.stack([shot.markers_tracked for shot in shots]),
            yaw_rad=np.array([shot.yaw_rad for shot in shots], np.float32),
            floor=take.view.floor().astype(np.float32),
            motion=take.played.motion.name,
        )
