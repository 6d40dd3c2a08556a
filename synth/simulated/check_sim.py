"""`check_sim`: simulated films of the script of `kpopnet check` (`kpopnet.datasets.check_script`), before every camera.

A film lasts a minute, at 30 frames per second. Five people, three rooms: sequence k shows person p = k // C % 5 in room p % 3
before camera k % C of C. A person comes in from the side, stands still, turns once around, raises both hands, sits down on a
seat that stands there, leaves, and comes back. `whole_px` and `seen_px` are as in `rooms`.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.datasets.check_script import END_S, SCRIPT, step_s
from kpopnet.errors import InputError
from synth.motion.choreography.moves import Key, Move, arms, concat, lower, mirror, repeat, together, turning, upper
from synth.motion.choreography.pairs import LEFT, RIGHT, STEPS, walk
from synth.motion.choreography.stage import Style, perform
from synth.motion.skeleton import LEG_M
from synth.scene.props import seat_under
from synth.scene.room import DANCE_HALL, Room, View, ViewConfig, draw_room, draw_view
from synth.sensor.model import SENSORS
from synth.simulated.film import ROOM_BOXES, Studio, collides
from synth.simulated.room_films import SENSOR_OF_CAMERA, Actor, RoomFilms, RoomTake, room_meshes
from synth.simulated.sequences import Selection

PEOPLE, ROOMS, FPS = 5, 3, 30.0
NEAREST_M, HALF_HEIGHT_M = 2.4, 1.38
"""Least distance of the place to stand from the camera, and least half of the height that the image shows there."""

BESIDE_M = 0.65  # how far outside the image the person waits

STAGE_M, SEAT_M = ((-3.4, 3.4), (2.0, 3.7)), ((-0.4, 0.4), (3.7, 4.4))
"""Ranges of x and y that walls and furniture leave free: where people walk, and where their seat is; metres."""

LEAST_BOXES, ROOM_TRIES = 4, 20000  # of furniture in a room; rooms tried
VIEW = ViewConfig(height_m=(0.9, 1.3), aim_m=(0.95, 1.1), roll_deg=1.0)
SWAY_DEG = 0.2  # amplitude of the sway of a person who stands still
BPM = 120.0  # two steps a second, a usual cadence of walking
STEP_BACK_M = 0.35  # how far the feet of the sitting person are behind the place where they stood
SIT_KEYS = {"hips_z": -0.40, "drop": 0.43, "hips_pitch": -4.0}
SAT_S = (36.2, 39.0)  # between these seconds the person sits still


@dataclass
class CheckSimConfig(Selection):
    """Identity and size of the set.

    Attributes:
        sequences: number of films, at most five before each camera, of another person each.
        cameras: presets, before which the films are made in turn.
    """

    name: str = "check_sim"
    sequences: int = PEOPLE * len(SENSOR_OF_CAMERA)
    cameras: list[str] = field(default_factory=lambda: list(SENSOR_OF_CAMERA))

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.cameras or not set(self.cameras) <= set(SENSOR_OF_CAMERA):
            raise InputError(f"benchmark.cameras={self.cameras}: expected some of {', '.join(SENSOR_OF_CAMERA)}")
        if self.children:
            raise InputError(f"benchmark.children={self.children}: the script's chair and its times are for adults")
        self.sequences = min(self.sequences, PEOPLE * len(self.cameras))  # further ones would be the same films again


@dataclass(frozen=True)
class CheckSim(RoomFilms):
    benchmark: CheckSimConfig = field(default_factory=CheckSimConfig)
    frames: tuple[int, int] = (round(END_S * FPS), round(END_S * FPS))

    about = "SIMULATED films of the script of `kpopnet check`, no real person."
    names = "check_{:02d}"
    composed_only = "no recording follows the script; take motion=choreography"
    camera, fps = CAMERAS["kinect_v1"], FPS  # the camera of some
    kinds: ClassVar[tuple[str, ...]] = tuple(SENSOR_OF_CAMERA)
    tiles = 20

    def kind(self, index: int) -> str:
        return self.benchmark.cameras[index % len(self.benchmark.cameras)]

    def first_person(self, index: int) -> int:
        return index // len(self.benchmark.cameras) % PEOPLE

    def take(self, index: int) -> RoomTake:
        """Puts the person of sequence `index`, their seat and the room before the camera."""
        name, number = self.kind(index), self.first_person(index)
        camera, rng = CAMERAS[name], self._rng("sequence", number)
        studio, person, (room, view) = Studio(camera, "cpu"), self.person(number), self._room(number % ROOMS)
        y_m = max(NEAREST_M, HALF_HEIGHT_M * 2 * camera.fy / camera.height)
        style = Style(bounce_m=0.0, lag_s=0.04, unsteadiness_deg=SWAY_DEG, phases=tuple(rng.random(5)))
        from_left = bool(rng.random() < 0.5)
        start_m = y_m * camera.width / (2 * camera.fx) + BESIDE_M
        way_m = start_m * LEG_M / person.leg_m  # of the mean adult, whose steps become the person's
        motion = perform(check_minute(way_m, from_left), BPM, self.frames[0], FPS, name, style)
        played = studio.play(person, motion, 0.0, rng.uniform(0.0, 1.0, 2))
        place_m = np.array([-start_m if from_left else start_m, y_m, 0.0])
        sat = round(sum(SAT_S) / 2 * FPS)
        studio.pose(played, sat, place_m)
        seat = seat_under(rng, studio.scene, studio.renderer.vertices_world_m())
        if seat is None:
            raise InputError(f"{self.sequence_name(index)}: no seat fits under the person")
        surroundings = (*room_meshes(room), seat)
        return RoomTake(len(played), camera, SENSORS[SENSOR_OF_CAMERA[name]], (view,), surroundings, (Actor(played, place_m),))

    def _room(self, number: int) -> tuple[Room, View]:
        """One of the rooms, with the pose of its camera: wide enough to wait beside any camera's view."""
        rng = self._rng("sequence", PEOPLE + number)
        view, (left_m, right_m), far_m = draw_view(rng, VIEW), STAGE_M[0], SEAT_M[1][1]
        grids = [np.meshgrid(*(np.arange(*one, 0.1) for one in part), (0.1, 1.0)) for part in (STAGE_M, SEAT_M)]
        free_m = np.concatenate([np.stack(grid, axis=-1).reshape(-1, 3) for grid in grids])
        for _ in range(ROOM_TRIES):
            room = draw_room(rng, DANCE_HALL)
            back, left, right = room.clear_m()
            furnished = len(room.centres_m) >= ROOM_BOXES + LEAST_BOXES
            if furnished and left < left_m and right > right_m and back > far_m and not collides(room, free_m):
                return room, view
        raise InputError(f"{self.benchmark.name}: none of {ROOM_TRIES} rooms has a free stage; choose another seed")


def _rest(beats: float) -> Move:
    return upper(Key(beats, arms("hang")))


def _sitting(beats: float) -> Move:
    """Steps back, sits down, stays for `beats`, stands up and steps forward."""
    leaning = {"hips_z": -0.2, "drop": 0.16, "hips_pitch": 26.0}
    legs = lower(Key(1.5, leaning), Key(2, SIT_KEYS), Key(beats, SIT_KEYS), Key(1.5, leaning), Key(1.5, {}))
    hands = arms((24, 70, 0, 40), waist_bend=4)
    trunk = upper(Key(1.5, arms("low_front", waist_bend=16)), Key(2, hands), Key(beats, hands),
                  Key(1.5, arms("low_front", waist_bend=16)), Key(1.5, arms("hang")))  # fmt: skip
    return concat(walk(-STEP_BACK_M), together(legs, trunk), walk(STEP_BACK_M))


def check_minute(way_m: float, from_left: bool) -> Move:
    """The script, danced at BPM; the person comes from `way_m` metres to the right or left, and goes back there."""
    come, leave = concat(RIGHT, walk(way_m), LEFT), concat(LEFT, walk(way_m), turning(repeat(STEPS, 2), 180))
    raised = upper(Key(2, arms("up")), Key(3, arms("up")), Key(2, arms("hang")))
    parts = {
        "empty room": _rest(1), "come in": come, "stand still": _rest(1), "turn": turning(repeat(STEPS, 6), 360),
        "raise hands": raised, "sit": _sitting(7), "leave": leave, "come back": concat(walk(way_m), LEFT),
    }  # fmt: skip
    timed = []
    for step in SCRIPT:
        start_s, end_s = step_s(step.name)
        left = (end_s - start_s) * BPM / 60 - parts[step.name].beats
        assert left >= 0, f"{step.name} lasts {left:g} beats less than it takes"
        timed += [parts[step.name], *([_rest(left)] if left else [])]
    move = concat(*timed)
    assert abs(move.beats - END_S * BPM / 60) < 1e-9, move.beats
    return mirror(move) if from_left else move
