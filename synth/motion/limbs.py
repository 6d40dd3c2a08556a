"""Random arms, trunks and legs in anatomical angles (see `posture`), the components of procedural poses and of dance moves.

Each function takes a random generator and returns the angles, in degrees, that differ from standing.
"""

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

Angles = dict[str, float]
Item = TypeVar("Item")
SIDES = ("left", "right")
OTHER_SIDE = {"left": "right", "right": "left"}

Reach = tuple[float, float, float, float]  # raise, plane, twist and elbow of an arm

REACHES: dict[str, Reach] = {  # place: what brings the mean adult's hand there
    "head_top": (130, 5, 92, 132),
    "back_of_head": (133, 30, 97, 142),
    "ear": (101, 54, 78, 146),
    "mouth": (78, 53, 12, 143),
    "brow": (105, 43, 47, 133),
    "opposite_shoulder": (75, 105, -17, 117),
    "chest": (60, 33, -40, 136),
    "belly": (29, 8, -60, 99),
    "hip": (47, -17, -75, 90),
    "small_of_back": (61, -86, -78, 90),
    "folded": (66, 101, -55, 92),
    "guard": (60, 35, 5, 128),
    "thigh": (18, 15, -58, 40),
}


def uniform(generator: np.random.Generator, lowest: float, highest: float) -> float:
    return lowest + (highest - lowest) * generator.random()


def choose(generator: np.random.Generator, items: Sequence[Item]) -> Item:
    return items[int(generator.random() * len(items))]


def limb(side: str, **angles: float) -> Angles:
    """Angles of an arm or a leg by their names without the side; `raise_` stands for raise, a word of Python."""
    return {f"{side}_{name.rstrip('_')}": value for name, value in angles.items()}


def drawn(generator: np.random.Generator, side: str, **angles: float | tuple[float, float]) -> Angles:
    """Angles of an arm or a leg as in `limb`, of which those given as a range are drawn uniformly from it, in their order."""
    return limb(side, **{name: uniform(generator, *one) if isinstance(one, tuple) else one for name, one in angles.items()})


def mirrored(shape: Mapping[str, float]) -> Angles:
    """Angles, or channels of a dance move's shape, with left and right swapped."""
    swapped = {}
    for channel, value in shape.items():
        part, _, name = channel.partition("_")
        if part in SIDES:
            swapped[f"{OTHER_SIDE[part]}_{name}"] = value
        else:
            swapped[channel] = -value if name in ("x", "side", "twist", "roll", "yaw") else value
    return swapped


def arm(side: str, reach: Reach) -> Angles:
    return limb(side, **dict(zip(("raise", "plane", "twist", "elbow"), reach, strict=True)))


def arm_to(side: str, place: str) -> Angles:
    """An arm whose hand is at one of the places of `REACHES`."""
    return arm(side, REACHES[place])


def hanging_arm(generator: np.random.Generator, side: str) -> Angles:
    a, b, c, d = generator.random(4)
    return limb(side, raise_=3 + 17 * a, plane=-40 + 100 * b, twist=-35 + 45 * c, elbow=4 + 35 * d * d)


BOTH_ARMS_REST, ONE_ARM_RESTS = 0.45, 0.2
"""Probabilities that someone who stands or dances with free arms lets both hang, or one. Of ITOP's standing people 33 and 15 %
do. Of a set as it is made 21 % of those who stand or have free arms let both hang, for 58 % of such poses are drawn again:
their forearms touch their thighs (`synth.body.capsules`)."""


def at_rest(generator: np.random.Generator, pose: Angles) -> Angles:
    """The pose with both arms hanging, with one, or with none, by chance."""
    draw = generator.random()
    one = (choose(generator, SIDES),) if draw < BOTH_ARMS_REST + ONE_ARM_RESTS else ()
    for side in SIDES if draw < BOTH_ARMS_REST else one:
        moved = {channel: angle for channel, angle in pose.items() if channel not in _ARM_OF[side]}
        pose = moved | hanging_arm(generator, side)
    return pose


_ARM_OF = {side: {f"{side}_{a}" for a in ("raise", "plane", "twist", "elbow", "pronate", "wrist")} for side in SIDES}


def free_arm(generator: np.random.Generator, side: str) -> Angles:
    """An arm in a random direction within the limits, uniform in area over the sphere, with any elbow flexion."""
    up, plane, twist, twist_more, bend, pronate, wrist = generator.random(7)
    return limb(
        side,
        raise_=np.degrees(np.arccos(1 - 2 * up)),
        plane=-50 + 170 * plane,
        twist=-75 + 170 * (twist + twist_more) / 2,
        elbow=145 * bend**1.5,
        pronate=-60 + 120 * pronate,
        wrist=-40 + 80 * wrist,
    )


def everyday_arm(generator: np.random.Generator, side: str) -> Angles:
    """An arm as in recordings of exercises and daily life: raised, waving, pointing, held to the chest."""
    kind = int(generator.random() * 6)
    if kind == 0:  # straight, raised between the side and the front
        return drawn(generator, side, raise_=(30, 175), plane=(-10, 100), elbow=(0, 25))
    if kind == 1:  # waving
        return drawn(generator, side, raise_=(60, 110), plane=(-5, 50), twist=(60, 98), elbow=(50, 120), pronate=(-40, 40))
    if kind == 2:  # bent or held in front of the belly
        return drawn(generator, side, raise_=(5, 45), plane=(0, 90), twist=(-50, 30), elbow=(50, 140))
    if kind == 3:  # swiping or throwing across the body
        return drawn(generator, side, raise_=(40, 110), plane=(80, 130), twist=(-40, 20), elbow=(5, 80))
    if kind == 4:
        return arm_to(side, choose(generator, tuple(REACHES)))
    return free_arm(generator, side)


def both_arms(generator: np.random.Generator) -> Angles:
    """Both arms: nearly symmetric or independent; each free, everyday or hanging."""
    one = choose(generator, (free_arm, everyday_arm, hanging_arm))
    left = one(generator, "left")
    draw = generator.random()
    if draw < 0.3:
        right = {name.replace("left_", "right_"): value + 6 * (generator.random() - 0.5) for name, value in left.items()}
    else:
        right = choose(generator, (free_arm, everyday_arm, hanging_arm))(generator, "right")
    return left | right


def trunk(generator: np.random.Generator, amount: float = 1.0) -> Angles:
    """A random bend shared by waist and chest, with a head that partly compensates it; `amount` scales all angles."""
    bend, side, twist, chest, head_bend, head_side, head_twist = amount * generator.standard_normal(7)
    return {
        "waist_bend": 5 + 13 * bend,
        "chest_bend": 3 + 9 * bend + 4 * chest,
        "waist_side": 9 * side,
        "chest_side": 7 * side - 4 * chest,
        "waist_twist": 8 * twist,
        "chest_twist": 11 * twist,
        "head_bend": -6 * bend + 14 * head_bend,
        "head_side": -5 * side + 9 * head_side,
        "head_twist": -8 * twist + 22 * head_twist,
    }


def flat_footed(generator: np.random.Generator, side: str, flex: float, knee: float, abduct: float, pitch: float) -> Angles:
    """A standing leg whose sole is nearly flat on the floor under hips that are pitched by `pitch`; angles in degrees."""
    point = flex - knee - pitch
    return drawn(generator, side, flex=flex, knee=knee, abduct=abduct, rotate=(-3, 25), point=point, invert=abduct)


CLOSED_LEGS = 0.5
"""Probability that someone who stands upright has closed legs. Of the 4,863 people of ITOP's test set 46 % stand with less
than 20 cm between the feet."""

_HIP_TO_MIDDLE_M, _HIP_TO_ANKLE_M = 0.113, 0.81
"""Of the mean body: half the distance of the hip joints, and the length of a leg."""


def closed_legs(generator: np.random.Generator) -> float:
    """The abduction, degrees, of both legs that leaves 4 to 15 cm between the ankles; it is negative.

    The feet are 3 cm farther apart, since the toes point outwards.
    """
    ankles_m = uniform(generator, 0.04, 0.15)
    return float(np.degrees(np.arcsin((ankles_m / 2 - _HIP_TO_MIDDLE_M) / _HIP_TO_ANKLE_M)))


def stance(generator: np.random.Generator) -> Angles:
    """Upright on both feet: closed, wide or striding, with the weight on one leg or on both."""
    closed = generator.random() < CLOSED_LEGS
    wide = closed_legs(generator) if closed else 2 + 20 * generator.random() ** 4
    strides = not closed and generator.random() < 0.5
    stride = (14 if strides else 2) * generator.standard_normal()
    soft = 18 * generator.random() ** 2
    roll = 4 * generator.standard_normal() if generator.random() < 0.4 else 0.0
    legs = {"hips_roll": roll, "hips_pitch": uniform(generator, -3, 6)}
    for side, sign in (("left", 1), ("right", -1)):
        step = sign * stride
        # Hips rolled to the left load the left leg: its knee stays straight and the other knee flexes.
        knee = soft + max(-step, 0.0) + max(-sign * roll, 0.0) * 2
        legs |= flat_footed(generator, side, step + knee / 2, knee, wide + sign * roll, legs["hips_pitch"])
    return legs


def upright(generator: np.random.Generator) -> Angles:
    """Standing with hanging arms."""
    return stance(generator) | trunk(generator, 0.3) | hanging_arm(generator, "left") | hanging_arm(generator, "right")
