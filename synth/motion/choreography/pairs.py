"""What two people do together: they cross, pass, hug, leave, enter and dance side by side.

A script gives each of the two a part: a dance of their own and where on the floor it starts. Both begin by stepping on the
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
STEPS = together(LOWER["march"], upper(Key(1, arms("hang"))))  # on the spot, with hanging arms
LEFT, RIGHT = turning(STEPS, 90), turning(STEPS, -90)
_SPOT = repeat(STEPS, 2)
_HUGGING = arms("front", plane=66, elbow=58, twist=10)
_SWING = arms((20, -70, 0, 10), (26, 80, 0, 22))  # arms while the left foot is in front


Place = tuple[float, float]  # (x, z) from the middle of a stage: x to the right in the image, z towards the camera, metres


class Part(NamedTuple):
    """One person of a film."""

    motion: Motion  # from the origin, facing the camera
    place_m: Place = (0.0, 0.0)  # of the start
    turn_rad: float = 0.0  # their turn to the left from facing the camera
    raised_m: float = 0.0  # height of what they lie on
    seated: bool = False  # whether they sit on a seat


Script = tuple[tuple[Move, Place], tuple[Move, Place]]  # what each of the two dances, and where they start


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


def crossing(generator: np.random.Generator, beats: float) -> Script:
    """They change places, one before the other."""
    half_gap, half = uniform(generator, *CROSSING_GAP_M) / 2, uniform(generator, 0.65, 0.85)
    way = concat(_SPOT, LEFT, walk(2 * half), RIGHT)
    first, second = (concat(part, _dance(generator, beats - way.beats)) for part in (way, mirror(way)))
    return (first, (-half, half_gap)), (second, (half, -half_gap))


def behind(generator: np.random.Generator, beats: float) -> Script:
    """One dances, the other walks past behind and back."""
    half_gap, half = uniform(generator, *CROSSING_GAP_M) / 2, uniform(generator, 0.65, 0.85)
    way = concat(_SPOT, LEFT, walk(2 * half), RIGHT, _SPOT, RIGHT, walk(2 * half), LEFT)
    passing = concat(way, _dance(generator, beats - way.beats))
    return (_dance(generator, beats), (0.0, half_gap)), (passing, (-half, -half_gap))


def hug(generator: np.random.Generator, beats: float) -> Script:
    """They walk up to each other, hug, and part."""
    half, close = uniform(generator, 0.75, 0.9), uniform(generator, *HUG_M) / 2
    embrace = upper(Key(2, _HUGGING), Key(4, _HUGGING), Key(2, arms("hang")))
    way = concat(_SPOT, LEFT, walk(half - close), embrace, walk(close - half), RIGHT)
    first, second = (concat(part, _dance(generator, beats - way.beats)) for part in (way, mirror(way)))
    return (first, (-half, 0.0)), (second, (half, 0.0))


def leaving(generator: np.random.Generator, beats: float) -> Script:
    """One dances, the other walks out of the image."""
    going = concat(_SPOT, _SPOT, LEFT, walk(uniform(generator, 1.9, 2.1)))
    depth_m = uniform(generator, -0.3, 0.3)
    return (_dance(generator, beats), (-0.45, 0.0)), (going, (0.4, depth_m))


def entering(generator: np.random.Generator, beats: float) -> Script:
    """One dances, the other walks into the image and dances too."""
    way_m = uniform(generator, 1.8, 2.0)
    coming = concat(RIGHT, walk(way_m), LEFT)
    coming = concat(coming, _dance(generator, beats - coming.beats))
    depth_m = uniform(generator, -0.3, 0.3)
    return (_dance(generator, beats), (-0.5, 0.0)), (coming, (0.5 + way_m, depth_m))


def side_by_side(generator: np.random.Generator, beats: float) -> Script:
    half, depth_m = uniform(generator, 0.6, 0.75), uniform(generator, -0.3, 0.3)
    return (_dance(generator, beats), (-half, 0.0)), (_dance(generator, beats), (half, depth_m))


SCRIPTS: dict[str, Callable[[np.random.Generator, float], Script]] = {
    one.__name__: one for one in (crossing, behind, hug, leaving, entering, side_by_side)
}
"""Kind of duet to a function that draws the two parts, of at least as many beats as given or with a last shape to hold."""

LEAVES_IMAGE = ("leaving", "entering")
"""Kinds of duets whose second person is outside the image at the end or at the start."""


def draw_duet(generator: np.random.Generator, kind: str, frames: int, fps: float) -> list[Part]:
    """The parts of two people in a kind of SCRIPTS, to the same music; half of the duets are mirrored."""
    bpm, mirrored = uniform(generator, *BPM), choose(generator, (False, True))
    parts = []
    for move, (x_m, z_m) in SCRIPTS[kind](generator, frames / fps * bpm / 60):
        motion = perform(mirror(move) if mirrored else move, bpm, frames, fps, kind, draw_style(generator))
        parts.append(Part(motion, (-x_m if mirrored else x_m, z_m)))
    return parts
