"""Single made poses for training stills: broad sampling within anatomical limits, and families of hard poses.

Motion capture alone covers little of the pose space, and least of what a dancer's hardest moments look like: upside
down, on the floor, limbs crossed. A family is a function of a generator that returns the angles (see `posture`) in
which its pose differs from standing; `FAMILIES` holds them with their weights. Every pose faces +Z.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from synth.motion.posture import CHANNELS, LIMITS_DEG, angles, limited, rotations
from synth.motion.skeleton import LEG_M, Poses, height_above_floor

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


def _broad(generator: np.random.Generator, channel: str) -> float:
    """Anywhere within the limits, more often in the middle (the mean of two uniform draws)."""
    lowest, highest = LIMITS_DEG[channel]
    a, b = generator.random(2)
    return lowest + (highest - lowest) * (a + b) / 2


# Parts of the body ------------------------------


def arm_to(side: str, place: str) -> Angles:
    """The arm that reaches one of the `REACHES`."""
    return dict(zip((f"{side}_{a}" for a in ("raise", "plane", "twist", "elbow")), REACHES[place], strict=True))


def _hanging(generator: np.random.Generator, side: str) -> Angles:
    a, b, c, d = generator.random(4)
    return {
        f"{side}_raise": 3 + 17 * a,
        f"{side}_plane": -40 + 100 * b,
        f"{side}_twist": -35 + 45 * c,
        f"{side}_elbow": 4 + 35 * d * d,
    }


def _free_arm(generator: np.random.Generator, side: str) -> Angles:
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


def _everyday_arm(generator: np.random.Generator, side: str) -> Angles:
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
    return _free_arm(generator, side)


def _arms(generator: np.random.Generator) -> Angles:
    """Both arms, as people hold them: alike, opposite in height, or each its own; free or everyday."""
    one = pick(generator, (_free_arm, _everyday_arm, _hanging))
    left = one(generator, "left")
    chance = generator.random()
    if chance < 0.3:
        right = {
            name.replace("left_", "right_"): value + 6 * (generator.random() - 0.5) for name, value in left.items()
        }
    else:
        right = pick(generator, (_free_arm, _everyday_arm, _hanging))(generator, "right")
    return left | right


def _trunk(generator: np.random.Generator, amount: float = 1.0) -> Angles:
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


def _neutral_trunk(generator: np.random.Generator) -> Angles:
    return _trunk(generator, 0.3)


def _flat(generator: np.random.Generator, side: str, flex: float, knee: float, spread: float, pitch: float) -> Angles:
    """A standing leg whose sole is nearly flat on the floor, the hips being pitched."""
    return {
        f"{side}_flex": flex,
        f"{side}_knee": knee,
        f"{side}_spread": spread,
        f"{side}_rotate": between(generator, -3, 25),
        f"{side}_point": flex - knee - pitch,
        f"{side}_invert": spread,
    }


def _stance(generator: np.random.Generator) -> Angles:
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
        legs |= _flat(generator, side, step + knee / 2, knee, wide + sign * roll, legs["hips_pitch"])
    return legs


# Families ------------------------------


def standing(generator: np.random.Generator) -> Angles:
    """Standing neutrally with no, one or two limbs moving: what recordings of exercises mostly show."""
    pose = _stance(generator) | _neutral_trunk(generator)
    for side in SIDES:
        pose |= _hanging(generator, side)
    chance = generator.random()
    if chance < 0.15:
        return pose
    first = pick(generator, SIDES)
    pose |= _everyday_arm(generator, first)
    if chance < 0.40:  # the other arm does the same
        other = "right" if first == "left" else "left"
        pose |= {c.replace(first, other): v for c, v in pose.items() if c.startswith(first) and c in _ARM_CHANNELS}
    elif chance < 0.60:
        pose |= _everyday_arm(generator, "right" if first == "left" else "left")
    elif chance < 0.72:  # a leg moves too
        side = pick(generator, SIDES)
        pose |= {
            f"{side}_flex": between(generator, -15, 70),
            f"{side}_knee": between(generator, 0, 90),
            f"{side}_spread": between(generator, 0, 30),
        }
    return pose


_ARM_CHANNELS = frozenset(c for c in CHANNELS if c.endswith(("raise", "plane", "twist", "elbow")) and "_" in c)


def broad(generator: np.random.Generator) -> Angles:
    """Anything within the limits, limbs and trunk each drawn as a whole."""
    pose = _trunk(generator, 1.4) | _free_arm(generator, "left") | _free_arm(generator, "right")
    for side in SIDES:
        pose |= {f"{side}_{a}": _broad(generator, f"{side}_{a}") for a in ("flex", "spread", "rotate", "point")}
        pose[f"{side}_knee"] = 150 * generator.random() ** 1.6
    pose["hips_pitch"] = between(generator, -15, 40)
    pose["hips_roll"] = 12 * generator.standard_normal()
    return pose


def free_arms(generator: np.random.Generator) -> Angles:
    """Upright, the arms anywhere."""
    return _stance(generator) | _trunk(generator, 0.7) | _arms(generator)


def squat(generator: np.random.Generator) -> Angles:
    """From soft knees down to the heels, narrow or wide."""
    depth = generator.random()
    pitch = between(generator, 0, 12 + 30 * depth)
    knee = 30 + 110 * depth
    lean = min(0.36 * knee, 28)
    spread = between(generator, 3, 40)
    pose = _trunk(generator, 0.6) | _arms(generator) | {"hips_pitch": pitch}
    for side in SIDES:
        pose |= _flat(generator, side, knee - lean + pitch, knee, spread, pitch)
        pose |= {f"{side}_rotate": between(generator, 0, 10 + 0.8 * spread), f"{side}_invert": spread * (1 - depth)}
    return pose


def lunge(generator: np.random.Generator) -> Angles:
    """A long step to the front or to the side, the other leg stretched."""
    front, back = pick(generator, (SIDES, SIDES[::-1]))
    pitch = between(generator, -5, 25)
    pose = _trunk(generator, 0.7) | _arms(generator) | {"hips_pitch": pitch}
    bent = between(generator, 40, 100)
    if generator.random() < 0.6:
        pose |= _flat(generator, front, bent + pitch, bent, between(generator, 0, 15), pitch)
        knee = between(generator, 5, 75)
        pose |= {
            f"{back}_flex": between(generator, -28, -5),
            f"{back}_knee": knee,
            f"{back}_toes": 30,
            f"{back}_point": 10,
        }
        return pose
    pose |= _flat(generator, front, 0.7 * bent + pitch, bent, between(generator, 15, 40), pitch)
    return pose | _flat(generator, back, pitch, between(generator, 0, 8), between(generator, 30, 62), pitch)


def kick(generator: np.random.Generator) -> Angles:
    """One leg high: to the front, to the side, round or chambered; the trunk leans away."""
    kicking, standing_leg = pick(generator, (SIDES, SIDES[::-1]))
    away = -1.0 if kicking == "left" else 1.0
    height = 0.25 + 0.75 * (1 - generator.random() ** 2)
    pitch = -between(generator, 0, 28 * height)
    roll = away * between(generator, 0, 30 * height)
    # 0 goes to the front, 1 to the side, round kicks between.
    sideways = pick(generator, (0.1, 0.1, 0.5, 0.95))
    pose = _trunk(generator, 0.7) | _arms(generator) | {"hips_pitch": pitch, "hips_roll": roll}
    pose |= _flat(generator, standing_leg, pitch, between(generator, 0, 25), abs(roll) * -0.8, pitch)
    return pose | {
        f"{kicking}_flex": (1 - sideways**2) * (45 + 83 * height),
        f"{kicking}_spread": sideways * (30 + 40 * height),
        f"{kicking}_rotate": between(generator, -25, 40),
        f"{kicking}_knee": between(generator, 0, 20) if generator.random() < 0.75 else between(generator, 40, 130),
        f"{kicking}_point": between(generator, -20, 45),
    }


def bend_forward(generator: np.random.Generator) -> Angles:
    """Bowing until the hands reach the floor; the arms hang, reach out or hold on."""
    depth = generator.random()
    pitch, waist, chest = 15 + 75 * depth, 10 + 42 * depth, 5 + 22 * depth
    knee = between(generator, 0, 35)
    spread = between(generator, 2, 28)
    pose = _trunk(generator, 0.5) | {"hips_pitch": pitch, "waist_bend": waist, "chest_bend": chest}
    for side in SIDES:
        pose |= _flat(generator, side, pitch + knee / 2, knee, spread, pitch)
        if generator.random() < 0.6:
            hang = (pitch + waist + chest) * between(generator, 0.55, 1.0)
            pose |= {f"{side}_raise": hang, f"{side}_plane": between(generator, 75, 95), f"{side}_elbow": 12.0}
        else:
            pose |= _everyday_arm(generator, side)
    return pose


def kneel(generator: np.random.Generator) -> Angles:
    """On one knee, on both, or sitting on the heels."""
    pitch = between(generator, -8, 20)
    pose = _trunk(generator, 0.7) | _arms(generator) | {"hips_pitch": pitch}
    down, up = pick(generator, (SIDES, SIDES[::-1]))
    if generator.random() < 0.4:
        raised = between(generator, 75, 105)
        pose |= _flat(
            generator, up, raised + pitch, raised + between(generator, -10, 15), between(generator, 0, 30), pitch
        )
        pose |= _kneeling(
            down, between(generator, -10, 15), pitch, between(generator, 0, 12), toes=generator.random() < 0.5
        )
        return pose
    low, spread = 90 * generator.random(), between(generator, 0, 25)
    for side in SIDES:
        pose |= _kneeling(side, low, pitch, spread, toes=False)
    return pose


def _kneeling(side: str, thigh: float, pitch: float, spread: float, *, toes: bool) -> Angles:
    """A shin on the floor, the thigh `thigh` degrees in front of the vertical."""
    ankle = {f"{side}_point": -20.0, f"{side}_toes": 45.0} if toes else {f"{side}_point": 48.0}
    return ankle | {f"{side}_flex": thigh + pitch, f"{side}_knee": 88.0 + thigh, f"{side}_spread": spread}


def sit(generator: np.random.Generator) -> Angles:
    """On the floor: legs straight, drawn up, crossed, straddled, or each its own way."""
    arrangement = pick(generator, (*_SITTING_LEGS, "mixed"))
    # With the knees drawn up the pelvis rolls back, and the waist bends to keep the chest upright.
    pitch = between(generator, -42, -26) if arrangement in ("drawn_up", "mixed") else between(generator, -25, 2)
    pose = _trunk(generator, 0.7) | {"hips_pitch": pitch}
    pose["waist_bend"] -= between(generator, 0.0, 0.9) * pitch
    for side in SIDES:
        own = pick(generator, tuple(_SITTING_LEGS)) if arrangement == "mixed" else arrangement
        pose |= _sitting_leg(generator, side, own, pitch)
    arms = generator.random()
    for side in SIDES:
        if arms < 0.3:  # leaning back on the hands
            pose |= {
                f"{side}_raise": between(generator, 30, 58) - 0.4 * pitch,
                f"{side}_plane": between(generator, -90, -50),
                f"{side}_twist": between(generator, 0, 60),
                f"{side}_elbow": between(generator, 0, 20),
            }
        elif arms < 0.55:  # on or around the knees
            pose |= {
                f"{side}_raise": between(generator, 40, 80),
                f"{side}_plane": between(generator, 70, 105),
                f"{side}_twist": between(generator, -40, 10),
                f"{side}_elbow": between(generator, 5, 90),
            }
        elif arms < 0.7:
            pose |= arm_to(side, "thigh")
        else:
            pose |= _everyday_arm(generator, side)
    return pose


_SITTING_LEGS = {  # ranges of knee, spread and rotate
    "straight": ((0, 20), (0, 12), (0, 10)),
    "straddled": ((0, 25), (28, 65), (10, 30)),
    "drawn_up": ((70, 122), (0, 22), (-5, 20)),
    "crossed": ((110, 145), (38, 64), (50, 61)),
}


def _sitting_leg(generator: np.random.Generator, side: str, arrangement: str, pitch: float) -> Angles:
    knee, spread, rotate = (between(generator, *limits) for limits in _SITTING_LEGS[arrangement])
    # Thigh and shin are nearly equally long: with half the knee's bend above the level the heel is on the floor.
    flex = between(generator, 114, 126) if arrangement == "crossed" else 90 + knee / 2 + between(generator, 0, 4)
    return {
        f"{side}_flex": flex + pitch,
        f"{side}_spread": spread,
        f"{side}_rotate": rotate,
        f"{side}_knee": knee,
        f"{side}_point": between(generator, -10, 40),
    }


def lie(generator: np.random.Generator) -> Angles:
    """On the back, the belly or a side; what lies on the floor stays in its plane."""
    pose = _trunk(generator, 0.4)
    way = pick(generator, ("back", "belly", "side"))
    for side in SIDES:
        bend = generator.random() ** 2
        pose |= _free_arm(generator, side)
        pose |= {f"{side}_rotate": between(generator, 0, 35), f"{side}_point": between(generator, 0, 45)}
        if way == "belly":
            pose |= {f"{side}_plane": between(generator, -8, 4), f"{side}_twist": between(generator, 75, 98)}
            pose |= {f"{side}_flex": between(generator, -6, 2), f"{side}_knee": 100 * bend, f"{side}_point": 45.0}
            pose |= {f"{side}_spread": between(generator, 0, 30), f"{side}_pronate": 0.0}
        elif way == "back":
            pose |= {f"{side}_plane": between(generator, 0, 120), f"{side}_twist": between(generator, -20, 60)}
            pose |= {f"{side}_flex": (45 + 65 * generator.random()) * bend, f"{side}_knee": 130 * bend}
            pose |= {f"{side}_spread": between(generator, 0, 30)}
        else:
            pose |= {f"{side}_plane": between(generator, 60, 100), f"{side}_twist": between(generator, -20, 20)}
            pose |= {f"{side}_flex": 100 * bend, f"{side}_knee": 130 * generator.random() * bend, f"{side}_rotate": 0.0}
    if way == "side":
        return pose | {"hips_roll": pick(generator, (-1, 1)) * between(generator, 80, 98)}
    return pose | {"hips_pitch": between(generator, -96, -86) if way == "back" else between(generator, 86, 94)}


def handstand(generator: np.random.Generator) -> Angles:
    """Upside down on the hands or the forearms: legs together, split, straddled, bent; straight or arched."""
    pose = _trunk(generator, 0.4) | {"hips_pitch": 180 + 10 * generator.standard_normal(), "hips_yaw": 180.0}
    pose |= {"hips_roll": 6 * generator.standard_normal(), "head_bend": between(generator, -45, 5)}
    on_forearms = generator.random() < 0.15
    for side in SIDES:
        pose |= {f"{side}_raise": between(generator, 160, 178), f"{side}_plane": between(generator, 10, 90)}
        pose |= {f"{side}_elbow": 95.0 if on_forearms else between(generator, 0, 15), f"{side}_wrist": -65.0}
        pose |= {f"{side}_twist": between(generator, -10, 20), f"{side}_shrug": 12.0}
        pose |= {f"{side}_knee": 5.0, f"{side}_point": between(generator, 10, 50), f"{side}_spread": 4.0}
    legs = pick(generator, ("together", "split", "straddled", "bent", "free"))
    if legs == "split":
        front, back = pick(generator, (SIDES, SIDES[::-1]))
        pose |= {f"{front}_flex": between(generator, 25, 95), f"{back}_flex": between(generator, -28, 0)}
        pose |= {f"{back}_knee": between(generator, 0, 80)}
    elif legs == "straddled":
        pose |= {f"{side}_spread": between(generator, 30, 65) for side in SIDES}
    elif legs == "bent":
        knee = between(generator, 50, 130)
        pose |= {f"{side}_knee": knee for side in SIDES} | {
            f"{side}_flex": between(generator, -20, 90) for side in SIDES
        }
    elif legs == "free":
        for side in SIDES:
            pose |= {f"{side}_flex": between(generator, -25, 80), f"{side}_knee": between(generator, 0, 120)}
            pose |= {f"{side}_spread": between(generator, 0, 45)}
    return pose


def all_fours(generator: np.random.Generator) -> Angles:
    """Hands on the floor under the shoulders: on the knees, in a push-up, or as a bridge with the belly up."""
    way = pick(generator, ("knees", "push_up", "push_up", "bridge"))
    pose = _trunk(generator, 0.5)
    elbow = between(generator, 0, 20) if generator.random() < 0.6 else between(generator, 20, 100)
    if way == "bridge":
        pitch = -between(generator, 82, 100)
        pose |= {"hips_pitch": pitch}
        for side in SIDES:
            pose |= {f"{side}_flex": 85 + pitch, f"{side}_knee": 85.0, f"{side}_spread": between(generator, 0, 15)}
            pose |= {f"{side}_raise": 60.0, f"{side}_plane": -88.0, f"{side}_twist": 30.0, f"{side}_elbow": 4.0}
        return pose
    pitch = between(generator, 66, 82) if way == "push_up" else between(generator, 75, 95)
    pose |= {"hips_pitch": pitch, "head_bend": between(generator, -45, 10)}
    for side in SIDES:
        pose |= {f"{side}_raise": pitch + 0.4 * elbow - 8, f"{side}_plane": between(generator, 70, 92)}
        pose |= {f"{side}_elbow": elbow, f"{side}_wrist": -60.0, f"{side}_spread": between(generator, 0, 12)}
        if way == "push_up":
            pose |= {f"{side}_flex": between(generator, -5, 8), f"{side}_knee": 4.0, f"{side}_toes": 40.0}
            pose |= {f"{side}_point": -20.0}
        else:
            pose |= {f"{side}_flex": pitch, f"{side}_knee": 90.0, f"{side}_point": 45.0}
    return pose


def crossed_arms(generator: np.random.Generator) -> Angles:
    """Forearms or straight arms crossed before the chest, low, high or in a double punch across."""
    kind = pick(generator, ("folded", "hugging", "low", "level", "punch"))
    pose = _stance(generator) | _trunk(generator, 0.6)
    if generator.random() < 0.25:
        pose |= _low_base(generator)
    over, under = pick(generator, (SIDES, SIDES[::-1]))
    for side in SIDES:
        # One arm lies over the other: nearer to the front, and a little higher.
        nearer = 6.0 if side == over else 0.0
        if kind in ("folded", "hugging"):
            pose |= arm_to(side, "folded" if kind == "folded" else "opposite_shoulder")
            pose[f"{side}_raise"] += nearer + between(generator, -4, 4)
            pose[f"{side}_elbow"] -= nearer
        else:
            level = {"low": 32.0, "level": 82.0, "punch": 88.0}[kind]
            pose[f"{side}_raise"] = level + nearer + between(generator, -6, 6)
            pose[f"{side}_plane"] = between(generator, 120, 134)
            pose[f"{side}_elbow"] = between(generator, 0, 22)
            pose[f"{side}_twist"] = between(generator, -30, 20)
    if kind == "punch" and generator.random() < 0.5:  # the other fist is drawn back or guards
        pose |= arm_to(under, "guard") if generator.random() < 0.5 else arm_to(under, "chest")
        pose["chest_twist"] = pose["waist_twist"] = -14.0 if over == "left" else 14.0
    return pose


def touching(generator: np.random.Generator) -> Angles:
    """Hands on or near the head, the face, the hips, behind the back, and so on."""
    pose = _stance(generator) | _trunk(generator, 0.5)
    first = pick(generator, tuple(REACHES))
    second = first if generator.random() < 0.5 else pick(generator, tuple(REACHES))
    if generator.random() < 0.25:
        pose |= _low_base(generator)
    pose |= arm_to("left", first) | (
        arm_to("right", second) if generator.random() < 0.8 else _hanging(generator, "right")
    )
    return pose if generator.random() < 0.5 else _mirrored(pose)


def dancing(generator: np.random.Generator) -> Angles:
    """Body lines as in dance: hips out against the shoulders, weight on one leg, arms in long lines or sharp angles."""
    side = 1.0 if generator.random() < 0.5 else -1.0
    sway = side * between(generator, 4, 14)
    pose = _trunk(generator, 0.5)
    pose |= {"hips_roll": sway, "waist_side": -1.3 * sway, "chest_side": between(generator, -0.6, 0.6) * sway}
    pose |= {"hips_pitch": between(generator, -4, 12), "chest_bend": between(generator, -16, 20)}
    pose |= {"chest_twist": between(generator, -24, 24), "head_twist": between(generator, -50, 50)}
    wide = 3 + 25 * generator.random() ** 2
    for name, sign in (("left", 1), ("right", -1)):
        loaded = sign * sway > 0
        knee = between(generator, 0, 35) if loaded else between(generator, 15, 70)
        flex = knee * between(generator, 0.4, 0.75) + pose["hips_pitch"]
        pose |= _flat(generator, name, flex, knee, wide + sign * sway, pose["hips_pitch"])
        if not loaded and generator.random() < 0.5:  # the free foot on its toes
            pose |= {f"{name}_point": 30.0, f"{name}_toes": 30.0}
    line = pick(generator, ("long", "angles", "mixed"))
    for name in SIDES:
        if line == "long" or (line == "mixed" and name == "left"):
            pose |= _free_arm(generator, name) | {f"{name}_elbow": between(generator, 0, 25)}
        else:
            pose |= _free_arm(generator, name) | {f"{name}_elbow": between(generator, 75, 145)}
    return pose


def _low_base(generator: np.random.Generator) -> Angles:
    """Legs and hips of another family, for arms that also happen there."""
    base = pick(generator, (squat, lunge, kneel, sit))(generator)
    return {c: v for c, v in base.items() if c.startswith("hips") or c in _LEG_CHANNELS}


_LEG_CHANNELS = frozenset(
    f"{side}_{a}" for side in SIDES for a in ("flex", "spread", "rotate", "knee", "point", "invert", "toes")
)


def _mirrored(pose: Angles) -> Angles:
    swapped = {}
    for channel, value in pose.items():
        if channel.startswith(SIDES):
            channel = channel.replace("left", "\0").replace("right", "left").replace("\0", "right")
        elif channel.endswith(("side", "twist", "roll", "yaw")):
            value = -value
        swapped[channel] = value
    return swapped


FAMILIES: dict[str, tuple[float, Callable[[np.random.Generator], Angles]]] = {
    "standing": (16.0, standing),
    "free_arms": (13.0, free_arms),
    "broad": (16.0, broad),
    "dancing": (10.0, dancing),
    "touching": (7.0, touching),
    "crossed_arms": (7.0, crossed_arms),
    "kick": (6.0, kick),
    "squat": (4.0, squat),
    "lunge": (4.0, lunge),
    "bend_forward": (4.0, bend_forward),
    "kneel": (4.0, kneel),
    "sit": (5.0, sit),
    "lie": (2.5, lie),
    "all_fours": (2.5, all_fours),
    "handstand": (3.0, handstand),
}
"""Name to (weight, family). The weights are relative."""

# Every angle also trembles a little, so that no pose of a table is ever met twice.
_JITTER_DEG = 2.5


class MadePoses:
    """Draws families by weight and turns their angles into poses on the floor."""

    def __init__(self, families: dict[str, tuple[float, Callable[[np.random.Generator], Angles]]] = FAMILIES) -> None:
        self._names = tuple(families)
        self._families = tuple(family for _, family in families.values())
        weights = np.array([weight for weight, _ in families.values()])
        self._thresholds = (np.cumsum(weights) / weights.sum())[:-1]

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """One pose for each generator; pose k depends on generator k alone."""
        chosen = [int(np.searchsorted(self._thresholds, g.random(), side="right")) for g in generators]
        return self._made(chosen, generators)

    def family(self, name: str, generators: Sequence[np.random.Generator]) -> Poses:
        """One pose of the named family for each generator."""
        return self._made([self._names.index(name)] * len(generators), generators)

    def _made(self, chosen: list[int], generators: Sequence[np.random.Generator]) -> Poses:
        postures = np.empty((len(chosen), len(CHANNELS)))
        for row, family, generator in zip(postures, chosen, generators, strict=True):
            row[:] = angles(**self._families[family](generator))
            row += _JITTER_DEG * generator.standard_normal(len(row))
        quats = rotations(limited(postures))
        root_m = np.zeros((len(quats), 3), np.float32)
        root_m[:, 1] = -height_above_floor(quats, root_m)
        names = [f"pose:{self._names[family]}" for family in chosen]
        return Poses(quats, root_m, np.full(len(quats), LEG_M, np.float32), names)
