"""Random arms, trunks and legs in anatomical angles (see `posture`), the components of procedural poses and of dance moves.

Each function takes a random generator and returns the angles, in degrees, that differ from standing.
"""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Angles = dict[str, float]
Item = TypeVar("Item")
SIDES = ("left", "right")

REACHES = {  # place: raise, plane, twist and elbow that bring the mean adult's hand there
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
    """A uniform random number."""
    return lowest + (highest - lowest) * generator.random()


def choose(generator: np.random.Generator, items: Sequence[Item]) -> Item:
    """A uniformly random item."""
    return items[int(generator.random() * len(items))]


def arm_to(side: str, place: str) -> Angles:
    """An arm whose hand is at one of the places of `REACHES`."""
    return dict(zip((f"{side}_{a}" for a in ("raise", "plane", "twist", "elbow")), REACHES[place], strict=True))


def hanging_arm(generator: np.random.Generator, side: str) -> Angles:
    """A relaxed arm that hangs down."""
    a, b, c, d = generator.random(4)
    return {
        f"{side}_raise": 3 + 17 * a,
        f"{side}_plane": -40 + 100 * b,
        f"{side}_twist": -35 + 45 * c,
        f"{side}_elbow": 4 + 35 * d * d,
    }


BOTH_ARMS_REST, ONE_ARM_RESTS = 0.45, 0.2
"""Probabilities that someone who stands or dances with free arms lets both hang, or one. Of ITOP's standing people 33 and 15 %
do, and of a whole set about half as many, since other families move their arms."""


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
    return {
        f"{side}_raise": np.degrees(np.arccos(1 - 2 * up)),
        f"{side}_plane": -50 + 170 * plane,
        f"{side}_twist": -75 + 170 * (twist + twist_more) / 2,
        f"{side}_elbow": 145 * bend**1.5,
        f"{side}_pronate": -60 + 120 * pronate,
        f"{side}_wrist": -40 + 80 * wrist,
    }


def everyday_arm(generator: np.random.Generator, side: str) -> Angles:
    """An arm as in recordings of exercises and daily life: raised, waving, pointing, held to the chest."""
    kind = int(generator.random() * 6)
    if kind == 0:  # straight, raised between the side and the front
        return {
            f"{side}_raise": uniform(generator, 30, 175),
            f"{side}_plane": uniform(generator, -10, 100),
            f"{side}_elbow": uniform(generator, 0, 25),
        }
    if kind == 1:  # waving
        return {
            f"{side}_raise": uniform(generator, 60, 110),
            f"{side}_plane": uniform(generator, -5, 50),
            f"{side}_twist": uniform(generator, 60, 98),
            f"{side}_elbow": uniform(generator, 50, 120),
            f"{side}_pronate": uniform(generator, -40, 40),
        }
    if kind == 2:  # bent or held in front of the belly
        return {
            f"{side}_raise": uniform(generator, 5, 45),
            f"{side}_plane": uniform(generator, 0, 90),
            f"{side}_twist": uniform(generator, -50, 30),
            f"{side}_elbow": uniform(generator, 50, 140),
        }
    if kind == 3:  # swiping or throwing across the body
        return {
            f"{side}_raise": uniform(generator, 40, 110),
            f"{side}_plane": uniform(generator, 80, 130),
            f"{side}_twist": uniform(generator, -40, 20),
            f"{side}_elbow": uniform(generator, 5, 80),
        }
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


def neutral_trunk(generator: np.random.Generator) -> Angles:
    """A nearly upright trunk."""
    return trunk(generator, 0.3)


def flat_footed(generator: np.random.Generator, side: str, flex: float, knee: float, abduct: float, pitch: float) -> Angles:
    """A standing leg whose sole is nearly flat on the floor under hips that are pitched by `pitch`; angles in degrees."""
    return {
        f"{side}_flex": flex,
        f"{side}_knee": knee,
        f"{side}_abduct": abduct,
        f"{side}_rotate": uniform(generator, -3, 25),
        f"{side}_point": flex - knee - pitch,
        f"{side}_invert": abduct,
    }


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
