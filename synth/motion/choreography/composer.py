"""Composes dances from the vocabulary of moves: a motion source that needs no recordings.

A dance has a tempo, a dancer's style and the form of a pop song: verses and a recurring chorus, made of phrases of eight
counts. `dance(index, seed)` is a pure function.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from synth.motion.choreography.moves import Move, concat, mirror, repeat, scale, together, turning
from synth.motion.choreography.stage import Style, perform
from synth.motion.choreography.vocabulary import LOWER, UPPER, WHOLE
from synth.motion.limbs import choose, uniform
from synth.motion.skeleton import Motion, Poses, still

COUNTS = 8
BPM = (90.0, 140.0)  # range of a dance's tempo, beats per minute

# Steps with which a phrase may also turn in place.
_TURNING_GROOVES = ("bounce", "march", "twist_hips", "taps_out", "knee_lifts")

# Fills floor work up to whole phrases.
_REST = together(LOWER["bounce"], UPPER["hanging"])


def filled(move: Move, counts: float) -> Move:
    """Repeats a move to a length of about `counts` beats, at least once."""
    return repeat(move, max(round(counts / move.beats), 1))


def phrase(generator: np.random.Generator, amplitude: float) -> Move:
    """A random phrase of eight counts, or of sixteen where floor work needs them; `amplitude` scales the upper body."""
    if generator.random() < 0.24:
        move = choose(generator, tuple(WHOLE.values()))
        if move.beats <= COUNTS / 2 and generator.random() < 0.5:
            move = concat(move, mirror(move))
        rest = -move.beats % COUNTS
        return concat(move, filled(_REST, rest)) if rest else move
    feet = LOWER[choose(generator, tuple(LOWER))]
    if generator.random() < 0.12:
        feet = turning(filled(LOWER[choose(generator, _TURNING_GROOVES)], COUNTS), choose(generator, (-360.0, 360.0)))
    one, other = (UPPER[choose(generator, tuple(UPPER))] for _ in range(2))
    form = generator.random()
    if form < 0.45:
        arms = filled(one, COUNTS)
    elif form < 0.8 and one.beats < COUNTS and other.beats < COUNTS:
        arms = concat(filled(one, COUNTS / 2), filled(other, COUNTS / 2))
    else:
        arms = filled(other, COUNTS)
    move = scale(together(feet, arms), amplitude)
    return mirror(move) if generator.random() < 0.5 else move


def compose(generator: np.random.Generator, counts: float) -> Move:
    """A dance of at least `counts` counts: verses of new phrases alternate with a recurring chorus."""
    amplitude = uniform(generator, 0.8, 1.1)
    chorus = [phrase(generator, amplitude) for _ in range(2)]
    sections: list[Move] = []
    length = 0.0
    while length < counts:
        verse = [phrase(generator, amplitude) for _ in range(2 if generator.random() < 0.6 else 1)]
        refrain = [mirror(part) for part in chorus] if generator.random() < 0.3 else chorus
        section = concat(*verse, *refrain)
        sections.append(section)
        length += section.beats
    return concat(*sections)


def draw_style(generator: np.random.Generator) -> Style:
    return Style(
        sharpness=uniform(generator, 0.8, 1.5),
        bounce_m=uniform(generator, 0.0, 0.04),
        lag_s=uniform(generator, 0.01, 0.07),
        unsteadiness_deg=uniform(generator, 0.5, 2.0),
        phases=tuple(generator.random(5)),
    )


def tempo_bpm(index: int, seed: int = 0) -> float:
    """Beats per minute of `dance(index, seed)`, whose first beat is at time 0."""
    return uniform(np.random.default_rng([seed, index]), *BPM)


def dance(index: int, seed: int = 0, seconds: float = 20.0, fps: float = 30.0) -> Motion:
    """Dance number `index` of the collection `seed`: a motion of the mean adult that starts at the origin, standing, facing +Z.

    The moves do not depend on the frames per second; the height of the hips depends on them by up to 1.5 cm.
    """
    generator = np.random.default_rng([seed, index])
    bpm = uniform(generator, *BPM)
    style = draw_style(generator)
    move = compose(generator, seconds * bpm / 60.0)
    return perform(move, bpm, round(seconds * fps), fps, f"choreography:{seed}-{index}", style)


class Choreography:
    _STILLS_FPS = 10.0  # frame rate of the dances from which single poses are taken

    def __init__(self, dances: int, seed: int, seconds: float, fps: float) -> None:
        self._dances, self._seed, self._seconds, self._fps = dances, seed, seconds, fps
        self._slow = lru_cache(maxsize=None)(lambda i: dance(i, seed, seconds, self._STILLS_FPS))

    def __len__(self) -> int:
        return self._dances

    def motion(self, index: int) -> Motion:
        return dance(index, self._seed, self._seconds, self._fps)

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """A random frame of a random dance per generator."""
        dances = [self._slow(int(generator.random() * self._dances)) for generator in generators]
        frames = [int(generator.random() * len(motion)) for generator, motion in zip(generators, dances, strict=True)]
        return Poses.joined(list(map(still, dances, frames)))
