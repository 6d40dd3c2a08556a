"""Who does what in the films of `rooms`: for each kind of scene the people, their motions, and where they start.

A part is one person's motion, played towards the camera but for a turn, from a place on a stage that is put before the camera.
"""

from collections.abc import Callable

import numpy as np

from synth.motion.choreography.pairs import Part, draw_duet
from synth.motion.choreography.programmes import drill, held, show
from synth.motion.limbs import SIDES, choose, drawn, stance, uniform
from synth.motion.poses import kneel, lie, seat, sit, squat, standing
from synth.motion.skeleton import Motion
from synth.motion.splice import cut
from synth.rooms.scene import MOST_PEOPLE
from synth.simulated.generator import random_excerpt

FPS = 30.0
BPM = (80.0, 120.0)
CROWD_M, APART_M = (1.3, 0.9), 0.75
"""Half the size of the stage on which a crowd starts, and the least distance between their starts."""

DUET_FRAMES, CLOSEST_M = 300, 0.05
"""Length of a duet, of which a film shows the frames about the closest approach: those within 5 cm of the least distance."""


def _any_turn(rng: np.random.Generator) -> float:
    return uniform(rng, -np.pi, np.pi)


def _near_front(rng: np.random.Generator) -> float:
    return np.radians(35) * rng.standard_normal()


def _still(rng: np.random.Generator, frames: int) -> Motion:
    return held(rng, standing(rng), frames, FPS, 1.0)


def _dancing(rng: np.random.Generator, frames: int) -> Motion:
    kind = choose(rng, ("dance", "dance", "crossed_punches", "kicks", "turns", "mixture"))
    return random_excerpt(rng, show(rng, kind, 2 * frames / FPS, FPS), frames)


def _on_the_spot(rng: np.random.Generator, frames: int) -> Motion:
    return random_excerpt(rng, drill(rng, ("arms", "steps"), BPM, 2 * frames / FPS, FPS), frames)


def _sitting(rng: np.random.Generator, frames: int) -> list[Part]:
    """On the floor or on a seat, alone or two beside each other."""
    parts = []
    for x_m in choose(rng, ((0.0,), (-0.6, 0.6))):
        on_seat = choose(rng, (True, True, False))
        motion = held(rng, (seat if on_seat else sit)(rng), frames, FPS, 8.0)
        parts.append(Part(motion, (x_m, uniform(rng, -0.3, 0.3)), 2 * _near_front(rng), seated=on_seat))
    return parts


def _lying(rng: np.random.Generator, frames: int) -> list[Part]:
    raised_m = choose(rng, (0.0, 0.0, uniform(rng, 0.1, 0.6)))
    return [Part(held(rng, lie(rng), frames, FPS, 4.0), turn_rad=_any_turn(rng), raised_m=raised_m)]


def _behind_furniture(rng: np.random.Generator, frames: int) -> list[Part]:
    return [Part(_on_the_spot(rng, frames), (x_m, 0.0), _near_front(rng)) for x_m in choose(rng, ((0.0,), (0.0,), (-0.5, 0.5)))]


def _crowd(rng: np.random.Generator, frames: int) -> list[Part]:
    parts: list[Part] = []
    for _ in range(int(rng.integers(3, MOST_PEOPLE + 1))):
        places_m = [(uniform(rng, -CROWD_M[0], CROWD_M[0]), uniform(rng, -CROWD_M[1], CROWD_M[1])) for _ in range(20)]
        free = [place for place in places_m if all(np.hypot(*np.subtract(place, part.place_m)) > APART_M for part in parts)]
        if free:
            low = choose(rng, (squat, kneel))
            draw = rng.random()
            motion = _still(rng, frames) if draw < 0.4 else _on_the_spot(rng, frames)
            parts.append(Part(held(rng, low(rng), frames, FPS, 4.0) if draw > 0.85 else motion, free[0], _any_turn(rng)))
    return parts


def _duet(rng: np.random.Generator, kind: str, frames: int) -> list[Part]:
    """The frames of a duet about the closest approach: beside each other in the image, or for a hug in the room."""
    parts = draw_duet(rng, kind, DUET_FRAMES, FPS)
    way_m = np.array([part.motion.root_m[:, [0, 2]] + part.place_m for part in parts])
    apart_m = np.abs(way_m[0] - way_m[1])
    apart_m = np.hypot(*apart_m.T) if kind == "hug" else apart_m[:, 0]
    closest = np.median(np.flatnonzero(apart_m < apart_m.min() + CLOSEST_M))
    start = int(np.clip(closest - uniform(rng, 0.3, 0.7) * frames, 0, DUET_FRAMES - frames))
    return [
        Part(cut(part.motion, start, start + frames), (float(one[start, 0]), float(one[start, 1])))
        for part, one in zip(parts, way_m, strict=True)
    ]


def _side_arms_up(rng: np.random.Generator, frames: int) -> list[Part]:
    pose = stance(rng)
    for side in SIDES:
        pose |= drawn(rng, side, raise_=(110, 178), plane=(20, 95), elbow=(0, 40))
    turn_rad = choose(rng, (-1, 1)) * np.radians(uniform(rng, 70, 110))
    return [Part(held(rng, pose, frames, FPS, 2.0), turn_rad=turn_rad)]


def _one_or_two(rng: np.random.Generator, frames: int) -> list[Part]:
    places_m = choose(rng, ((0.0,), (-0.7, 0.7)))
    motions = (_dancing, _on_the_spot, _still)
    return [Part(choose(rng, motions)(rng, frames), (x_m, uniform(rng, -0.4, 0.4)), 2 * _near_front(rng)) for x_m in places_m]


CASTS: dict[str, Callable[[np.random.Generator, int], list[Part]]] = {
    "alone_still": lambda rng, frames: [Part(_still(rng, frames), turn_rad=_any_turn(rng))],
    "alone_moving": lambda rng, frames: [Part(_dancing(rng, frames), turn_rad=_near_front(rng))],
    "sitting": _sitting,
    "lying": _lying,
    "behind_furniture": _behind_furniture,
    "crowd": _crowd,
    "crossing": lambda rng, frames: _duet(rng, "crossing", frames),
    "hug": lambda rng, frames: _duet(rng, "hug", frames),
    "one_behind_the_other": lambda rng, frames: _duet(rng, "behind", frames),
    "side_view_arms_up": _side_arms_up,
    "ceiling_camera": _one_or_two,
    "moving_camera": _one_or_two,
    "empty_room": lambda rng, frames: [],
}
"""Kind of scene to a function that draws its parts, all of the given number of frames."""
