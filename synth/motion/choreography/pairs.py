"""What two people do together: they cross, pass, hug, leave, enter and dance side by side.

A script gives each of the two a role: a dance of their own and where on the floor it starts. Both begin by stepping on the
spot, facing the camera, and end with a dance of steps on the spot.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from synth.motion.choreography.composer import draw_style
from synth.motion.choreography.moves import Key, Move, arms, concat, feet, flow, lower, mirror, repeat, together, turning, upper
from synth.motion.choreography.programmes import DRILLS
from synth.motion.choreography.stage import perform
from synth.motion.choreography.vocabulary import LOWER
from synth.motion.limbs import choose, uniform
from synth.motion.skeleton import Motion

BPM = (95.0, 115.0)
STRIDE_M = 0.55  # usual length of a step

CROSSING_GAP_M = (0.55, 1.3)
"""Range of the distance, along the camera's axis, between the ways of two people who cross."""

HUG_M = (0.36, 0.46)  # range of the distance between the trunks of people who hug
_STEPS = together(LOWER["march"], upper(Key(1, arms("hang"))))
_SPOT = repeat(_STEPS, 2)
_LEFT, _RIGHT = turning(_STEPS, 90), turning(_STEPS, -90)
_HUGGING = arms("front", plane=66, elbow=58, twist=10)
_SWING = arms((20, -70, 0, 10), (26, 80, 0, 22))  # arms while the left foot is in front


class Part(NamedTuple):
    """What one of the two dances, from facing the camera."""

    move: Move  # their moves
    # (x, z) of the start from the middle of the stage: x to the right in the image, z towards the camera, metres
    place_m: tuple[float, float]


class Role(NamedTuple):
    """The same as a motion that starts at the origin."""

    motion: Motion
    place_m: tuple[float, float]


def walk(distance_m: float) -> Move:
    """A walk straight ahead, or backwards where the distance is negative, with a beat a step and arms that swing."""
    steps = max(1, round(abs(distance_m) / STRIDE_M))
    half = distance_m / steps / 2
    legs = lower(Key(1, feet((0.09, half), (0.09, -half), drop=0.03), anchor="right"))
    step = together(legs, flow(0.5, _SWING, arms("hang")))
    closing = lower(Key(1, {}, anchor="right" if steps % 2 == 0 else "left"))
    return concat(*(mirror(step) if number % 2 else step for number in range(steps)), closing)


def _dance(generator: np.random.Generator, beats: float) -> Move:
    """Steps and arm moves on the spot, of at least as many beats."""
    parts = [_SPOT]
    while sum(part.beats for part in parts) < beats:
        parts.append(DRILLS["steps"](generator))
    return concat(*parts)


def _crossing(generator: np.random.Generator, beats: float) -> tuple[Part, Part]:
    """They change places, one before the other."""
    half_gap, half = uniform(generator, *CROSSING_GAP_M) / 2, uniform(generator, 0.65, 0.85)
    way = concat(_SPOT, _LEFT, walk(2 * half), _RIGHT)
    first, second = (concat(part, _dance(generator, beats - way.beats)) for part in (way, mirror(way)))
    return Part(first, (-half, half_gap)), Part(second, (half, -half_gap))


def _behind(generator: np.random.Generator, beats: float) -> tuple[Part, Part]:
    """One dances, the other walks past behind and back."""
    half_gap, half = uniform(generator, *CROSSING_GAP_M) / 2, uniform(generator, 0.65, 0.85)
    way = concat(_SPOT, _LEFT, walk(2 * half), _RIGHT, _SPOT, _RIGHT, walk(2 * half), _LEFT)
    passing = concat(way, _dance(generator, beats - way.beats))
    return Part(_dance(generator, beats), (0.0, half_gap)), Part(passing, (-half, -half_gap))


def _hug(generator: np.random.Generator, beats: float) -> tuple[Part, Part]:
    """They walk up to each other, hug, and part."""
    half, close = uniform(generator, 0.75, 0.9), uniform(generator, *HUG_M) / 2
    embrace = upper(Key(2, _HUGGING), Key(4, _HUGGING), Key(2, arms("hang")))
    way = concat(_SPOT, _LEFT, walk(half - close), embrace, walk(close - half), _RIGHT)
    first, second = (concat(part, _dance(generator, beats - way.beats)) for part in (way, mirror(way)))
    return Part(first, (-half, 0.0)), Part(second, (half, 0.0))


def _leaving(generator: np.random.Generator, beats: float) -> tuple[Part, Part]:
    """One dances, the other walks out of the image."""
    going = concat(_SPOT, _SPOT, _LEFT, walk(uniform(generator, 1.9, 2.1)))
    depth_m = uniform(generator, -0.3, 0.3)
    return Part(_dance(generator, beats), (-0.45, 0.0)), Part(going, (0.4, depth_m))


def _entering(generator: np.random.Generator, beats: float) -> tuple[Part, Part]:
    """One dances, the other walks into the image and dances too."""
    way_m = uniform(generator, 1.8, 2.0)
    coming = concat(_RIGHT, walk(way_m), _LEFT)
    coming = concat(coming, _dance(generator, beats - coming.beats))
    depth_m = uniform(generator, -0.3, 0.3)
    return Part(_dance(generator, beats), (-0.5, 0.0)), Part(coming, (0.5 + way_m, depth_m))


def _side_by_side(generator: np.random.Generator, beats: float) -> tuple[Part, Part]:
    half, depth_m = uniform(generator, 0.6, 0.75), uniform(generator, -0.3, 0.3)
    return Part(_dance(generator, beats), (-half, 0.0)), Part(_dance(generator, beats), (half, depth_m))


SCRIPTS: dict[str, Callable[[np.random.Generator, float], tuple[Part, Part]]] = {
    "crossing": _crossing,
    "behind": _behind,
    "hug": _hug,
    "leaving": _leaving,
    "entering": _entering,
    "side_by_side": _side_by_side,
}
"""Kind of duet to a function that draws the two parts, of at least as many beats as given or with a last shape to hold."""

LEAVES_IMAGE = ("leaving", "entering")
"""Kinds of duets whose second person is outside the image at the end or at the start."""


def draw_duet(generator: np.random.Generator, kind: str, frames: int, fps: float) -> tuple[Role, Role]:
    """The roles of two people in a kind of SCRIPTS, to the same music; half of the duets are mirrored."""
    bpm, mirrored = uniform(generator, *BPM), choose(generator, (False, True))
    roles = []
    for part in SCRIPTS[kind](generator, frames / fps * bpm / 60):
        (x_m, z_m), move = part.place_m, mirror(part.move) if mirrored else part.move
        motion = perform(move, bpm, frames, fps, kind, draw_style(generator))
        roles.append(Role(motion, (-x_m if mirrored else x_m, z_m)))
    return roles[0], roles[1]
