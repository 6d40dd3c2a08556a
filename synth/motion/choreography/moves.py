"""Data types and combinators for dance moves; `vocabulary` holds the moves.

A move has two parallel tracks of equal length: `lower` (hips and feet) and `upper` (trunk, head and arms). A track is a
sequence of keys. A key is a target shape and the number of beats in which it is reached. A shape names only the channels
that differ from standing relaxed. Moves are combined by `concat`, `repeat`, `mirror`, `both_sides`, `scale`, `turning`,
and `together`, which combines the upper track of one move with the lower track of another.

Upper shapes are angles of `posture`, in degrees. Lower shapes are in the dancer's own frame, which turns and travels with
the dancer, in metres and degrees on the mean adult:

    hips_x (left), hips_z (front), drop (below standing), hips_pitch, hips_roll, hips_yaw; air (height of a jump);
    {left,right}_foot_x (outwards from the middle), _foot_z (front), _foot_y (up), _foot_yaw (outwards),
    _foot_pitch (toes down), _knee_out (rotation of the knee outwards).

`stage` places the feet. A foot whose position on the floor differs between two keys takes a step. `anchor` names the foot
that keeps its position while the dancer's frame moves; without an anchor the frame does not move.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce
from numbers import Integral

from kpopnet.errors import InputError, check_one_of
from synth.motion import limbs
from synth.motion.limbs import OTHER_SIDE, Reach, mirrored
from synth.motion.posture import CHANNELS, LEG_ANGLES, STANDING

Shape = Mapping[str, float]

LEG_CHANNELS = ("foot_x", "foot_z", "foot_y", "foot_yaw", "foot_pitch", "knee_out")
RELAXED_LOWER = dict.fromkeys(("hips_x", "hips_z", "drop", "hips_pitch", "hips_roll", "hips_yaw", "air"), 0.0)
RELAXED_LOWER |= {
    f"{side}_{name}": {"foot_x": 0.12, "foot_yaw": 8.0}.get(name, 0.0) for side in ("left", "right") for name in LEG_CHANNELS
}
RELAXED_UPPER: dict[str, float] = {
    channel: float(STANDING[i])
    for channel, i in CHANNELS.items()
    if not channel.startswith("hips") and not channel.endswith(LEG_ANGLES)
}


@dataclass(frozen=True)
class Key:
    beats: float  # beats after the previous key
    shape: Shape  # channels that differ from standing relaxed
    # fraction of the beats in which the movement takes place; the shape is held for the rest. A small value is a hard hit.
    sharp: float = 1.0
    anchor: str | None = None  # foot that keeps its position on the floor while the dancer's frame moves: left, right or None
    turn: float = 0.0  # rotation of the dancer's frame to the left during the key, degrees


@dataclass(frozen=True)
class Move:
    """Two parallel tracks of equal length in beats; raises InputError for others."""

    lower: tuple[Key, ...]  # keys of hips and feet
    upper: tuple[Key, ...]  # keys of trunk, head and arms

    def __post_init__(self) -> None:
        lower, upper = (sum(key.beats for key in track) for track in (self.lower, self.upper))
        if not abs(lower - upper) < 1e-9:
            raise InputError(f"a move of {lower:g} beats of the lower and {upper:g} of the upper body: expected as many")

    @property
    def beats(self) -> float:
        return sum(key.beats for key in self.lower)


def concat(*moves: Move) -> Move:
    return reduce(lambda a, b: Move(a.lower + b.lower, a.upper + b.upper), moves)


def repeat(move: Move, times: int) -> Move:
    if not isinstance(times, Integral) or times < 1:
        raise InputError(f"a move repeated {times!r:.80} times: expected a whole number of times, one or more")
    return concat(*[move] * times)


def both_sides(move: Move) -> Move:
    """The move, then its mirror image."""
    return concat(move, mirror(move))


def mirror(move: Move) -> Move:
    """The move with left and right swapped. Mirroring twice gives the original move."""
    return Move(tuple(_mirrored(key) for key in move.lower), tuple(_mirrored(key) for key in move.upper))


def _mirrored(key: Key) -> Key:
    return replace(key, shape=mirrored(key.shape), anchor=OTHER_SIDE.get(key.anchor), turn=-key.turn)


def scale(move: Move, amplitude: float) -> Move:
    """Scales the upper body's deviation from standing relaxed. The lower track does not change."""
    keys = (
        replace(key, shape={c: RELAXED_UPPER[c] + amplitude * (v - RELAXED_UPPER[c]) for c, v in key.shape.items()})
        for key in move.upper
    )
    return Move(move.lower, tuple(keys))


def turning(move: Move, degrees: float) -> Move:
    """The move while the dancer turns to the left by `degrees` in total, evenly over its beats."""
    keys = (replace(key, turn=key.turn + degrees * key.beats / move.beats) for key in move.lower)
    return Move(tuple(keys), move.upper)


def together(lower: Move, upper: Move) -> Move:
    """Combines the lower track of one move with the upper track of another. The shorter one is repeated.

    Raises InputError if it does not fit into the other a whole number of times.
    """
    longest, shortest = max(lower.beats, upper.beats), min(lower.beats, upper.beats)
    if not shortest > 0 or abs(longest / shortest - round(longest / shortest)) >= 1e-9:
        raise InputError(f"moves of {lower.beats:g} and {upper.beats:g} beats together: expected one to fit into the other")
    return Move(lower.lower * round(longest / lower.beats), upper.upper * round(longest / upper.beats))


_ARMS: dict[str, Reach] = {
    "hang": (8, 0, 0, 12),
    "back": (38, -70, -10, 15),
    "side": (90, 0, 0, 4),
    "low_side": (48, 5, 0, 8),
    "high_side": (135, 5, 10, 6),
    "front": (88, 90, 0, 5),
    "low_front": (45, 85, 0, 15),
    "high_front": (140, 75, 0, 6),
    "up": (172, 40, 10, 5),
    "across": (84, 130, -10, 8),
    "low_across": (36, 130, -10, 12),
    "high_across": (128, 118, 0, 12),
    "goalpost": (92, 0, 88, 92),
    "scarecrow": (88, 5, -75, 90),
    "frame": (80, 60, 10, 95),
    "bent_up": (60, 40, 60, 140),
    "loaded": (42, -45, 10, 115),
    "pull": (70, -20, 0, 130),
}

_OF_BOTH_SIDES = (*LEG_CHANNELS, "raise", "plane", "twist", "elbow", "pronate", "wrist", "shrug")
Place = tuple[float, float]  # of a foot: metres outwards from the middle, and in front


def _sided(channels: Mapping[str, float]) -> dict[str, float]:
    """The channels, with those of a limb that name no side given to both."""
    sided = {}
    for name, value in channels.items():
        sided |= {f"{side}_{name}": value for side in ("left", "right")} if name in _OF_BOTH_SIDES else {name: value}
    return sided


def _arm(side: str, reach: str | Reach) -> dict[str, float]:
    """An arm in a direction of `_ARMS`, at a place on the body (`limbs.REACHES`), or with its own angles."""
    if isinstance(reach, str):
        check_one_of(f"{side} arm", reach, known := limbs.REACHES | _ARMS)
        reach = known[reach]
    return limbs.arm(side, reach)


def arms(left: str | Reach, right: str | Reach | None = None, **changes: float) -> dict[str, float]:
    """The shape of both arms (the same for both if only one is given), with other angles of arms, trunk and head.

    An arm's angle that names no side is of both arms: `arms("side", elbow=30)`.
    """
    return _arm("left", left) | _arm("right", left if right is None else right) | _sided(changes)


def feet(left: Place | None = None, right: Place | None = None, **changes: float) -> dict[str, float]:
    """The places of the feet, with other channels of the lower body.

    A leg's channel that names no side is of both legs: `feet(foot_pitch=30)`.
    """
    places = {"left": left, "right": right}
    shape = {f"{side}_foot_{axis}": place[k] for side, place in places.items() if place for k, axis in enumerate("xz")}
    return shape | _sided(changes)


def step(
    beats: float,
    left: Place | None = None,
    right: Place | None = None,
    *,
    sharp: float = 1.0,
    anchor: str | None = None,
    turn: float = 0.0,
    **changes: float,
) -> Key:
    """A key of the lower track, with the shape of `feet`; standing relaxed if none is given."""
    return Key(beats, feet(left, right, **changes), sharp, anchor, turn)


def upper(*keys: Key) -> Move:
    """A move of the upper body with feet that do not move."""
    return Move((Key(sum(key.beats for key in keys), {}),), keys)


def lower(*keys: Key) -> Move:
    """A move of the lower body with relaxed arms."""
    return Move(keys, (Key(sum(key.beats for key in keys), {}),))


def hits(beats: float, *shapes: Shape, sharp: float = 0.6) -> Move:
    """A sequence of upper shapes, one every `beats` beats, each reached early and held."""
    return upper(*(Key(beats, shape, sharp) for shape in shapes))


def flow(beats: float, *shapes: Shape) -> Move:
    """A sequence of upper shapes, one every `beats` beats, without holds."""
    return upper(*(Key(beats, shape) for shape in shapes))
