"""What the stand-ins of benchmarks show, in the order in which the paper names it: motions of a kind, of any length."""

from collections.abc import Callable

import numpy as np

from synth.motion.choreography import COUNTS, draw_style, filled, phrase
from synth.motion.handstand import handstand
from synth.motion.limbs import between, pick
from synth.motion.moves import Key, Move, arms, both_sides, concat, feet, flow, mirror, together, turning
from synth.motion.skeleton import Motion
from synth.motion.splice import cut, follow
from synth.motion.stage import Style, perform
from synth.motion.vocabulary import LOWER, UPPER, WHOLE

BPM = (80.0, 115.0)
SIDEWAYS, BACK = 0.25, 0.5
"""Probability of a turn to the side before the next part, and of one back to the front from there."""

Y_POSE_S = 0.7
_INTO_Y_S, _OUT_OF_Y_S = 2.0, 1.0
START_S = Y_POSE_S + _OUT_OF_Y_S
"""How long `start_pose` takes, from its first frame to standing relaxed."""

_Y = arms("high_side")
_APART = feet((0.22, 0.0), (0.22, 0.0))
_STEP = together(LOWER["march"], UPPER["hanging"])
_GROOVES = tuple(LOWER[name] for name in ("bounce", "side_steps", "march", "twist_hips", "taps_out"))


def start_pose(generator: np.random.Generator, fps: float) -> Motion:
    """The paper's Y pose held for Y_POSE_S, then the way to standing: arms obliquely up, legs apart, facing the front."""
    keys = ((_INTO_Y_S, _APART, _Y), (Y_POSE_S, _APART, _Y), (_OUT_OF_Y_S, {}, arms("hang")))
    move = Move(tuple(Key(beats, lower) for beats, lower, _ in keys), tuple(Key(beats, upper) for beats, _, upper in keys))
    style = Style(bounce_m=0.0, lag_s=0.0, unsteadiness_deg=0.5, phases=tuple(generator.random(5)))
    first, last = (round(seconds * fps) for seconds in (_INTO_Y_S, _INTO_Y_S + START_S))
    # At 60 beats a minute a beat is a second.
    return cut(perform(move, 60.0, last, fps, "y_pose", style), first, last)


def _crossed_punches(generator: np.random.Generator) -> Move:
    punches = [UPPER[name] for name in ("crossed_punches", "cross_and_open", "punches_front", "fold_arms")]
    one, other = pick(generator, punches[:2]), pick(generator, punches)
    return together(pick(generator, _GROOVES), concat(filled(one, COUNTS / 2), filled(other, COUNTS / 2)))


def _kicks(generator: np.random.Generator) -> Move:
    if generator.random() < 0.3:
        return pick(generator, (WHOLE["kick_and_punch"], WHOLE["fan_kick"]))
    legs = LOWER[pick(generator, ("front_kicks", "high_kicks", "side_kicks", "knee_lifts"))]
    return together(legs, pick(generator, (UPPER["guard_bob"], UPPER["hanging"], both_sides(UPPER["punches_front"]))))


def _turns(generator: np.random.Generator) -> Move:
    upper = UPPER[pick(generator, ("hanging", "windmill", "frame_slide", "point_front", "swim"))]
    if generator.random() < 0.4:
        groove = together(filled(pick(generator, _GROOVES), COUNTS), filled(upper, COUNTS))
        return turning(groove, pick(generator, (-360.0, 360.0)))
    legs = filled(LOWER[pick(generator, ("step_turn", "pivot_half_turns", "spin"))], COUNTS / 2)
    return together(legs, filled(upper, COUNTS / 2))


def _sitting(generator: np.random.Generator) -> Move:
    return concat(WHOLE["sit_and_rise"], filled(_STEP, -WHOLE["sit_and_rise"].beats % COUNTS))


def _arms_alone(generator: np.random.Generator) -> Move:
    """Arms over feet that stand still."""
    return filled(UPPER[pick(generator, tuple(UPPER))], COUNTS / 2)


def _steps(generator: np.random.Generator) -> Move:
    return together(filled(pick(generator, _GROOVES), COUNTS), filled(UPPER[pick(generator, tuple(UPPER))], COUNTS))


_FOREHAND = flow(
    1,
    arms("low_front", "back", chest_twist=-24, waist_twist=-14, head_twist=12),
    arms("low_side", "across", chest_twist=24, waist_twist=14, head_twist=-12),
)
_SERVE = flow(
    1,
    arms("high_front", "goalpost", chest_bend=-14, chest_twist=-16),
    arms("low_side", "low_across", waist_bend=18, chest_bend=12, chest_twist=22),
)
_BOTH_HANDS = flow(
    1,
    arms("high_across", "high_side", chest_twist=-26, waist_twist=-12) | {"right_elbow": 40},
    arms("side", "low_across", chest_twist=26, waist_twist=14, waist_bend=10),
)


def _swings(generator: np.random.Generator) -> Move:
    """As with a racket or a bat, stepping into it."""
    swing = pick(generator, (_FOREHAND, _SERVE, _BOTH_HANDS))
    return together(LOWER[pick(generator, ("bounce", "lunges", "taps_front"))], filled(swing, COUNTS / 2))


FEATURES: dict[str, Callable[[np.random.Generator], Move]] = {
    "crossed_punches": _crossed_punches,
    "kicks": _kicks,
    "turns": _turns,
    "sitting": _sitting,
}
"""Moves by the kind of motion that they make, those of which a mixture is made."""

DRILLS: dict[str, Callable[[np.random.Generator], Move]] = FEATURES | {
    "arms": _arms_alone,
    "steps": _steps,
    "swings": _swings,
}
"""Moves of every kind."""


def show(generator: np.random.Generator, kind: str, seconds: float, fps: float) -> Motion:
    """A motion of at least so many seconds that starts and ends standing.

    Args:
        generator: the only source of chance.
        kind: one of FEATURES: two of its moves, a phrase of any dance, and so on; `dance`: nothing but phrases of dance;
            `mixture`: moves of all kinds; `handstand`: one handstand, then a dance.
        seconds: least length.
        fps: frames per second.
    """
    bpm, style, amplitude = between(generator, *BPM), draw_style(generator), between(generator, 0.8, 1.1)
    if kind == "handstand":
        steps = turning(filled(_STEP, COUNTS / 2), pick(generator, (0.0, 0.0, -1.0, 1.0)) * between(generator, 50.0, 100.0))
        opening = perform(steps, bpm, round(steps.beats * 60 / bpm * fps) + 1, fps, "steps", style)
        opening = follow(opening, handstand(generator, between(generator, 6.0, 7.5), fps))
        rest_s = seconds - len(opening) / fps
        return follow(opening, show(generator, "dance", rest_s, fps)) if rest_s > 0 else opening
    parts: list[Move] = []
    aside_deg = 0.0
    while sum(part.beats for part in parts) < seconds * bpm / 60:
        # Everything is seen from the side too.
        if generator.random() < (BACK if aside_deg else SIDEWAYS):
            degrees = -aside_deg if aside_deg else pick(generator, (-1.0, 1.0)) * between(generator, 50.0, 100.0)
            parts.append(turning(filled(_STEP, COUNTS / 2), degrees))
            aside_deg += degrees
        name = pick(generator, tuple(FEATURES)) if kind == "mixture" else kind
        featured = name in FEATURES and len(parts) % 3 != 2
        part = FEATURES[name](generator) if featured else phrase(generator, amplitude)
        parts.append(mirror(part) if generator.random() < 0.5 else part)
    frames = round(sum(part.beats for part in parts) * 60 / bpm * fps) + 1
    return perform(concat(*parts), bpm, frames, fps, kind, style)


def drill(
    generator: np.random.Generator, kinds: tuple[str, ...], bpm: tuple[float, float], seconds: float, fps: float
) -> Motion:
    """A motion of at least so many seconds that starts and ends standing and shows nothing but moves of some kinds.

    Args:
        generator: the only source of chance.
        kinds: of DRILLS, each as often as any other.
        bpm: least and greatest tempo, in beats per minute.
        seconds: least length.
        fps: frames per second.
    """
    tempo, style = between(generator, *bpm), draw_style(generator)
    parts: list[Move] = []
    while sum(part.beats for part in parts) < seconds * tempo / 60:
        part = DRILLS[pick(generator, kinds)](generator)
        parts.append(mirror(part) if generator.random() < 0.5 else part)
    frames = round(sum(part.beats for part in parts) * 60 / tempo * fps) + 1
    return perform(concat(*parts), tempo, frames, fps, "-".join(kinds), style)
