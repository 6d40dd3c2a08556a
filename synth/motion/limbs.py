"""Parts of the body in anatomical angles (see `posture`): what made poses, and some moves of dances, are put together from.

A part is a function of a generator that returns the angles in which it differs from standing.
"""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Angles = dict[str, float]
Thing = TypeVar("Thing")
SIDES = ("left", "right")

REACHES = {  # raise, plane, twist, elbow that bring the hand of the mean adult there
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


def between(generator: np.random.Generator, lowest: float, highest: float) -> float:
    """A uniform draw."""
    return lowest + (highest - lowest) * generator.random()


def pick(generator: np.random.Generator, things: Sequence[Thing]) -> Thing:
    """One of several things, all alike likely."""
    return things[int(generator.random() * len(things))]


def arm_to(side: str, place: str) -> Angles:
    """The arm that reaches one of the `REACHES`."""
    return dict(zip((f"{side}_{a}" for a in ("raise", "plane", "twist", "elbow")), REACHES[place], strict=True))


def hanging_arm(generator: np.random.Generator, side: str) -> Angles:
    a, b, c, d = generator.random(4)
    return {
        f"{side}_raise": 3 + 17 * a,
        f"{side}_plane": -40 + 100 * b,
        f"{side}_twist": -35 + 45 * c,
        f"{side}_elbow": 4 + 35 * d * d,
    }


def free_arm(generator: np.random.Generator, side: str) -> Angles:
    """Any direction alike likely within the limits, bent or straight."""
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
    """What one arm does in recordings of exercises and daily life: raised, waving, pointing, lifted to the chest."""
    kind = int(generator.random() * 6)
    if kind == 0:  # straight and raised somewhere between the side and the front
        return {
            f"{side}_raise": between(generator, 30, 175),
            f"{side}_plane": between(generator, -10, 100),
            f"{side}_elbow": between(generator, 0, 25),
        }
    if kind == 1:  # waving
        return {
            f"{side}_raise": between(generator, 60, 110),
            f"{side}_plane": between(generator, -5, 50),
            f"{side}_twist": between(generator, 60, 98),
            f"{side}_elbow": between(generator, 50, 120),
            f"{side}_pronate": between(generator, -40, 40),
        }
    if kind == 2:  # curled or held out before the belly
        return {
            f"{side}_raise": between(generator, 5, 45),
            f"{side}_plane": between(generator, 0, 90),
            f"{side}_twist": between(generator, -50, 30),
            f"{side}_elbow": between(generator, 50, 140),
        }
    if kind == 3:  # swiping or throwing across the body
        return {
            f"{side}_raise": between(generator, 40, 110),
            f"{side}_plane": between(generator, 80, 130),
            f"{side}_twist": between(generator, -40, 20),
            f"{side}_elbow": between(generator, 5, 80),
        }
    if kind == 4:
        return arm_to(side, pick(generator, tuple(REACHES)))
    return free_arm(generator, side)


def both_arms(generator: np.random.Generator) -> Angles:
    """Both arms, as people hold them: alike, opposite in height, or each its own; free or everyday."""
    one = pick(generator, (free_arm, everyday_arm, hanging_arm))
    left = one(generator, "left")
    chance = generator.random()
    if chance < 0.3:
        right = {
            name.replace("left_", "right_"): value + 6 * (generator.random() - 0.5) for name, value in left.items()
        }
    else:
        right = pick(generator, (free_arm, everyday_arm, hanging_arm))(generator, "right")
    return left | right


def trunk(generator: np.random.Generator, amount: float = 1.0) -> Angles:
    """A bend that runs through waist and chest together, and a head that partly follows."""
    bend, side, twist, own, head_bend, head_side, head_twist = amount * generator.standard_normal(7)
    return {
        "waist_bend": 5 + 13 * bend,
        "chest_bend": 3 + 9 * bend + 4 * own,
        "waist_side": 9 * side,
        "chest_side": 7 * side - 4 * own,
        "waist_twist": 8 * twist,
        "chest_twist": 11 * twist,
        "head_bend": -6 * bend + 14 * head_bend,
        "head_side": -5 * side + 9 * head_side,
        "head_twist": -8 * twist + 22 * head_twist,
    }


def neutral_trunk(generator: np.random.Generator) -> Angles:
    return trunk(generator, 0.3)


def flat_footed(generator: np.random.Generator, side: str, flex: float, knee: float, spread: float, pitch: float) -> Angles:
    """A standing leg whose sole is nearly flat on the floor, the hips being pitched."""
    return {
        f"{side}_flex": flex,
        f"{side}_knee": knee,
        f"{side}_spread": spread,
        f"{side}_rotate": between(generator, -3, 25),
        f"{side}_point": flex - knee - pitch,
        f"{side}_invert": spread,
    }


def stance(generator: np.random.Generator) -> Angles:
    """Upright on both feet: together, wide or striding, the weight on one leg or on both."""
    wide = 2 + 20 * generator.random() ** 4
    stride = 14 * generator.standard_normal() if generator.random() < 0.35 else 2 * generator.standard_normal()
    soft = 18 * generator.random() ** 2
    roll = 4 * generator.standard_normal() if generator.random() < 0.4 else 0.0
    legs = {"hips_roll": roll, "hips_pitch": between(generator, -3, 6)}
    for side, sign in (("left", 1), ("right", -1)):
        step = sign * stride
        # The hips rolled to the left load the left leg: its knee stays straight, the other one gives.
        knee = soft + max(-step, 0.0) + max(-sign * roll, 0.0) * 2
        legs |= flat_footed(generator, side, step + knee / 2, knee, wide + sign * roll, legs["hips_pitch"])
    return legs
