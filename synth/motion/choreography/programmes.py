"""The motions of the simulated benchmarks, by kind and of any length; the kinds are those that the paper lists.

Moves are defined by foot positions and cannot represent a handstand, which is keyframed in the angles of `posture`.
"""

from collections.abc import Callable

import numpy as np

from synth.motion.choreography.composer import COUNTS, draw_style, filled, phrase
from synth.motion.choreography.moves import Key, Move, arms, both_sides, concat, feet, flow, mirror, together, turning
from synth.motion.choreography.stage import Style, monotone, perform
from synth.motion.choreography.vocabulary import LOWER, UPPER, WHOLE
from synth.motion.limbs import SIDES, Angles, choose, limb, uniform
from synth.motion.posture import CHANNELS, angles, rotations
from synth.motion.skeleton import LEG_M, Motion
from synth.motion.splice import cut, follow, planted

BPM = (80.0, 115.0)
TURN_SIDEWAYS_PROBABILITY, TURN_BACK_PROBABILITY = 0.25, 0.5
"""Probabilities, before the next part, of a turn to the side and of one from the side back to the front."""

Y_POSE_S = 0.7
_RAISE_S, _LOWER_S = 2.0, 1.0
START_S = Y_POSE_S + _LOWER_S
"""Length of `start_pose`, from the first frame in the Y pose to standing relaxed, seconds."""

_Y_ARMS = arms("high_side")
_Y_FEET = feet((0.22, 0.0), (0.22, 0.0))
_STEP = together(LOWER["march"], UPPER["hanging"])
_GROOVES = tuple(LOWER[name] for name in ("bounce", "side_steps", "march", "twist_hips", "taps_out"))


def start_pose(generator: np.random.Generator, fps: float) -> Motion:
    """The paper's Y pose (arms obliquely up, legs apart, facing the front) for Y_POSE_S, then the transition to standing."""
    keys = ((_RAISE_S, _Y_FEET, _Y_ARMS), (Y_POSE_S, _Y_FEET, _Y_ARMS), (_LOWER_S, {}, arms("hang")))
    move = Move(tuple(Key(beats, lower) for beats, lower, _ in keys), tuple(Key(beats, upper) for beats, _, upper in keys))
    style = Style(bounce_m=0.0, lag_s=0.0, unsteadiness_deg=0.5, phases=tuple(generator.random(5)))
    first, last = (round(seconds * fps) for seconds in (_RAISE_S, _RAISE_S + START_S))
    # At 60 beats per minute a beat lasts one second.
    return cut(perform(move, 60.0, last, fps, "y_pose", style), first, last)


def crossed_punches(generator: np.random.Generator) -> Move:
    punches = [UPPER[name] for name in ("crossed_punches", "cross_and_open", "punches_front", "fold_arms")]
    one, other = choose(generator, punches[:2]), choose(generator, punches)
    return together(choose(generator, _GROOVES), concat(filled(one, COUNTS / 2), filled(other, COUNTS / 2)))


def kicks(generator: np.random.Generator) -> Move:
    if generator.random() < 0.3:
        return choose(generator, (WHOLE["kick_and_punch"], WHOLE["fan_kick"]))
    legs = LOWER[choose(generator, ("front_kicks", "high_kicks", "side_kicks", "knee_lifts"))]
    return together(legs, choose(generator, (UPPER["guard_bob"], UPPER["hanging"], both_sides(UPPER["punches_front"]))))


def turns(generator: np.random.Generator) -> Move:
    upper = UPPER[choose(generator, ("hanging", "windmill", "frame_slide", "point_front", "swim"))]
    if generator.random() < 0.4:
        groove = together(filled(choose(generator, _GROOVES), COUNTS), filled(upper, COUNTS))
        return turning(groove, choose(generator, (-360.0, 360.0)))
    legs = filled(LOWER[choose(generator, ("step_turn", "pivot_half_turns", "spin"))], COUNTS / 2)
    return together(legs, filled(upper, COUNTS / 2))


def sitting(generator: np.random.Generator) -> Move:
    return concat(WHOLE["sit_and_rise"], filled(_STEP, -WHOLE["sit_and_rise"].beats % COUNTS))


def arms_only(generator: np.random.Generator) -> Move:
    """Arm moves with feet that do not move."""
    return filled(UPPER[choose(generator, tuple(UPPER))], COUNTS / 2)


def steps(generator: np.random.Generator) -> Move:
    return together(filled(choose(generator, _GROOVES), COUNTS), filled(UPPER[choose(generator, tuple(UPPER))], COUNTS))


_SWINGS = (
    flow(  # forehand
        1,
        arms("low_front", "back", chest_twist=-24, waist_twist=-14, head_twist=12),
        arms("low_side", "across", chest_twist=24, waist_twist=14, head_twist=-12),
    ),
    flow(  # serve
        1,
        arms("high_front", "goalpost", chest_bend=-14, chest_twist=-16),
        arms("low_side", "low_across", waist_bend=18, chest_bend=12, chest_twist=22),
    ),
    flow(  # with both hands
        1,
        arms("high_across", "high_side", right_elbow=40, chest_twist=-26, waist_twist=-12),
        arms("side", "low_across", chest_twist=26, waist_twist=14, waist_bend=10),
    ),
)


def swings(generator: np.random.Generator) -> Move:
    """Swings as with a racket or a bat, with steps."""
    swing = choose(generator, _SWINGS)
    return together(LOWER[choose(generator, ("bounce", "lunges", "taps_front"))], filled(swing, COUNTS / 2))


FEATURES: dict[str, Callable[[np.random.Generator], Move]] = {
    one.__name__: one for one in (crossed_punches, kicks, turns, sitting)
}
"""Kind of motion to a function that draws a move of this kind. A mixture draws from these kinds."""

DRILLS = FEATURES | {"arms": arms_only, "steps": steps, "swings": swings}
"""The kinds of `drill`."""


def show(generator: np.random.Generator, kind: str, seconds: float, fps: float) -> Motion:
    """A motion of at least `seconds` seconds that starts and ends standing.

    The kind is one of FEATURES (two of its moves alternate with one phrase of a dance), `dance` (only phrases of a dance),
    `mixture` (moves of all kinds) or `handstand` (one handstand, then a dance).
    """
    bpm, style, amplitude = uniform(generator, *BPM), draw_style(generator), uniform(generator, 0.8, 1.1)
    if kind == "handstand":
        turned = turning(filled(_STEP, COUNTS / 2), choose(generator, (0.0, 0.0, -1.0, 1.0)) * uniform(generator, 50.0, 100.0))
        opening = _to_the_end(turned, bpm, fps, "steps", style)
        opening = follow(opening, handstand(generator, uniform(generator, 6.0, 7.5), fps))
        rest_s = seconds - len(opening) / fps
        return follow(opening, show(generator, "dance", rest_s, fps)) if rest_s > 0 else opening
    parts: list[Move] = []
    heading_deg = 0.0
    while sum(part.beats for part in parts) < seconds * bpm / 60:
        # Turns, so that every kind of motion also occurs in side view.
        if generator.random() < (TURN_BACK_PROBABILITY if heading_deg else TURN_SIDEWAYS_PROBABILITY):
            degrees = -heading_deg if heading_deg else choose(generator, (-1.0, 1.0)) * uniform(generator, 50.0, 100.0)
            parts.append(turning(filled(_STEP, COUNTS / 2), degrees))
            heading_deg += degrees
        name = choose(generator, tuple(FEATURES)) if kind == "mixture" else kind
        featured = name in FEATURES and len(parts) % 3 != 2
        part = FEATURES[name](generator) if featured else phrase(generator, amplitude)
        parts.append(mirror(part) if generator.random() < 0.5 else part)
    return _to_the_end(concat(*parts), bpm, fps, kind, style)


def drill(
    generator: np.random.Generator, kinds: tuple[str, ...], bpm: tuple[float, float], seconds: float, fps: float
) -> Motion:
    """A motion of at least `seconds` seconds that starts and ends standing, of moves of these kinds of DRILLS.

    The tempo lies between the two of `bpm`, beats per minute.
    """
    tempo, style = uniform(generator, *bpm), draw_style(generator)
    parts: list[Move] = []
    while sum(part.beats for part in parts) < seconds * tempo / 60:
        part = DRILLS[choose(generator, kinds)](generator)
        parts.append(mirror(part) if generator.random() < 0.5 else part)
    return _to_the_end(concat(*parts), tempo, fps, "-".join(kinds), style)


def _to_the_end(move: Move, bpm: float, fps: float, name: str, style: Style) -> Motion:
    """The whole of a move, at a tempo in beats per minute."""
    return perform(move, bpm, round(move.beats * 60 / bpm * fps) + 1, fps, name, style)


def handstand(generator: np.random.Generator, seconds: float, fps: float) -> Motion:
    """Onto the hands, up, held with several shapes of the legs for at least 0.8 s, and back to standing, in about these
    seconds.

    The hands, like the feet before and after, keep their position on the floor.
    """
    leading, other = choose(generator, (SIDES, SIDES[::-1]))
    hold_s = max(seconds - 4.0 * (pace := uniform(generator, 1.1, 1.4)), 0.8)
    shapes = [_legs(generator, leading, other) for _ in range(1 + int(hold_s / 1.2))]
    lean = uniform(generator, -5, 5)
    keys: list[tuple[float, Angles]] = [
        (0.0, {}),
        (0.5 * pace, _both(raise_=150, plane=75, elbow=5)),
        (0.7 * pace, _bent(leading, other)),
        (0.45 * pace, _kick(leading, other)),
        (0.45 * pace, _inverted(lean) | shapes[0]),
        *((hold_s / len(shapes), _inverted(lean) | shape) for shape in (*shapes[1:], _TOGETHER)),
        (0.5 * pace, _kick(leading, other)),
        (0.6 * pace, _bent(leading, other)),
        (0.8 * pace, {}),
    ]
    times = np.cumsum([length for length, _ in keys])
    postures = np.array([angles(**shape) for _, shape in keys])
    return _between(times, postures, int(times[-1] * fps) + 1, fps, "handstand")


def _between(times: np.ndarray, postures: np.ndarray, frames: int, fps: float, name: str) -> Motion:
    """The motion through (K, channels) postures at (K,) times, seconds, with feet or hands that keep their place."""
    return planted(rotations(monotone(times, postures)(np.arange(frames) / fps)), fps, name, LEG_M)


def _both(**angles: float) -> Angles:
    return limb("left", **angles) | limb("right", **angles)


def _bent(leading: str, other: str) -> Angles:
    """Both hands and both feet on the floor; the leading leg's knee is bent more."""
    pose = _both(raise_=126, plane=88, elbow=5, wrist=-40)
    pose |= {"hips_pitch": 78.0, "waist_bend": 42.0, "chest_bend": 20.0, "head_bend": -30.0}
    for side, knee in ((leading, 48.0), (other, 30.0)):
        flex = 78.0 + knee / 2
        pose |= limb(side, flex=flex, knee=knee, point=flex - knee - 78.0)
    return pose


def _kick(leading: str, other: str) -> Angles:
    """The weight on the hands, one leg swung up, the other leg just off the floor."""
    pose = _both(raise_=166, plane=80, elbow=5, wrist=-60, point=30)
    pose |= {"hips_pitch": 138.0, "waist_bend": 20.0, "chest_bend": 8.0, "head_bend": -35.0}
    return pose | limb(other, flex=-10, knee=12) | limb(leading, flex=62, knee=28)


def _inverted(lean: float) -> Angles:
    """Upside down, without the legs; `lean` tilts the body forward, degrees."""
    return _both(raise_=174, plane=60, elbow=5, wrist=-65, shrug=12) | {"hips_pitch": 180.0 + lean, "head_bend": -30.0}


_TOGETHER = _both(flex=0, abduct=4, point=40)


def _legs(generator: np.random.Generator, leading: str, other: str) -> Angles:
    """A random shape of the legs upside down: together, split, straddled or bent."""
    shape = choose(generator, ("together", "split", "straddled", "bent"))
    if shape == "split":
        return _TOGETHER | {f"{leading}_flex": uniform(generator, 25, 70), f"{other}_flex": uniform(generator, -25, -5)}
    if shape == "straddled":
        return _TOGETHER | {f"{side}_abduct": uniform(generator, 25, 45) for side in SIDES}
    if shape == "bent":
        return _TOGETHER | {f"{side}_knee": uniform(generator, 40, 100) for side in SIDES}
    return _TOGETHER


def held(generator: np.random.Generator, pose: Angles, frames: int, fps: float, unrest_deg: float) -> Motion:
    """A pose that is held, while the angles of head and arms wander with a standard deviation of `unrest_deg` degrees."""
    times = np.arange(0, frames / fps + 2 * _UNREST_S, _UNREST_S)
    keys = np.tile(angles(**pose), (len(times), 1))
    keys[:, _RESTLESS] += unrest_deg * generator.standard_normal((len(times), len(_RESTLESS)))
    return _between(times, keys, frames, fps, "held")


_UNREST_S = 0.8
_RESTLESS = [
    number
    for name, number in CHANNELS.items()
    if name.startswith("head") or name.endswith(("_raise", "_plane", "_elbow", "left_twist", "right_twist"))
]
