"""Families of made poses: broad sampling within anatomical limits, and families of hard poses.

Motion capture alone covers little of the pose space, and least of what a dancer's hardest moments look like: upside
down, on the floor, limbs crossed. A family is a function of a generator that returns the angles (see `posture`) in
which its pose differs from standing; `FAMILIES` holds them with their weights. Every pose faces +Z.
"""

from collections.abc import Callable

import numpy as np

from synth.motion.floor_families import all_fours, handstand, kneel, lie, sit
from synth.motion.limbs import (
    REACHES,
    SIDES,
    Angles,
    arm_to,
    between,
    both_arms,
    everyday_arm,
    flat_footed,
    free_arm,
    hanging_arm,
    neutral_trunk,
    pick,
    stance,
    trunk,
)
from synth.motion.posture import CHANNELS, LIMITS_DEG


def standing(generator: np.random.Generator) -> Angles:
    """Standing neutrally with no, one or two limbs moving: what recordings of exercises mostly show."""
    pose = stance(generator) | neutral_trunk(generator)
    for side in SIDES:
        pose |= hanging_arm(generator, side)
    chance = generator.random()
    if chance < 0.15:
        return pose
    first = pick(generator, SIDES)
    pose |= everyday_arm(generator, first)
    if chance < 0.40:  # the other arm does the same
        other = "right" if first == "left" else "left"
        pose |= {c.replace(first, other): v for c, v in pose.items() if c.startswith(first) and c in _ARM_CHANNELS}
    elif chance < 0.60:
        pose |= everyday_arm(generator, "right" if first == "left" else "left")
    elif chance < 0.72:  # a leg moves too
        side = pick(generator, SIDES)
        pose |= {
            f"{side}_flex": between(generator, -15, 70),
            f"{side}_knee": between(generator, 0, 90),
            f"{side}_spread": between(generator, 0, 30),
        }
    return pose


_ARM_CHANNELS = frozenset(c for c in CHANNELS if c.endswith(("raise", "plane", "twist", "elbow")) and "_" in c)


def _broad(generator: np.random.Generator, channel: str) -> float:
    """Anywhere within the limits, more often in the middle (the mean of two uniform draws)."""
    lowest, highest = LIMITS_DEG[channel]
    a, b = generator.random(2)
    return lowest + (highest - lowest) * (a + b) / 2


def broad(generator: np.random.Generator) -> Angles:
    """Anything within the limits, limbs and trunk each drawn as a whole."""
    pose = trunk(generator, 1.4) | free_arm(generator, "left") | free_arm(generator, "right")
    for side in SIDES:
        pose |= {f"{side}_{a}": _broad(generator, f"{side}_{a}") for a in ("flex", "spread", "rotate", "point")}
        pose[f"{side}_knee"] = 150 * generator.random() ** 1.6
    pose["hips_pitch"] = between(generator, -15, 40)
    pose["hips_roll"] = 12 * generator.standard_normal()
    return pose


def free_arms(generator: np.random.Generator) -> Angles:
    """Upright, the arms anywhere."""
    return stance(generator) | trunk(generator, 0.7) | both_arms(generator)


def squat(generator: np.random.Generator) -> Angles:
    """From soft knees down to the heels, narrow or wide."""
    depth = generator.random()
    pitch = between(generator, 0, 12 + 30 * depth)
    knee = 30 + 110 * depth
    lean = min(0.36 * knee, 28)
    spread = between(generator, 3, 40)
    pose = trunk(generator, 0.6) | both_arms(generator) | {"hips_pitch": pitch}
    for side in SIDES:
        pose |= flat_footed(generator, side, knee - lean + pitch, knee, spread, pitch)
        pose |= {f"{side}_rotate": between(generator, 0, 10 + 0.8 * spread), f"{side}_invert": spread * (1 - depth)}
    return pose


def lunge(generator: np.random.Generator) -> Angles:
    """A long step to the front or to the side, the other leg stretched."""
    front, back = pick(generator, (SIDES, SIDES[::-1]))
    pitch = between(generator, -5, 25)
    pose = trunk(generator, 0.7) | both_arms(generator) | {"hips_pitch": pitch}
    bent = between(generator, 40, 100)
    if generator.random() < 0.6:
        pose |= flat_footed(generator, front, bent + pitch, bent, between(generator, 0, 15), pitch)
        knee = between(generator, 5, 75)
        pose |= {
            f"{back}_flex": between(generator, -28, -5),
            f"{back}_knee": knee,
            f"{back}_toes": 30,
            f"{back}_point": 10,
        }
        return pose
    pose |= flat_footed(generator, front, 0.7 * bent + pitch, bent, between(generator, 15, 40), pitch)
    return pose | flat_footed(generator, back, pitch, between(generator, 0, 8), between(generator, 30, 62), pitch)


def kick(generator: np.random.Generator) -> Angles:
    """One leg high: to the front, to the side, round or chambered; the trunk leans away."""
    kicking, standing_leg = pick(generator, (SIDES, SIDES[::-1]))
    away = -1.0 if kicking == "left" else 1.0
    height = 0.25 + 0.75 * (1 - generator.random() ** 2)
    pitch = -between(generator, 0, 28 * height)
    roll = away * between(generator, 0, 30 * height)
    # 0 goes to the front, 1 to the side, round kicks between.
    sideways = pick(generator, (0.1, 0.1, 0.5, 0.95))
    pose = trunk(generator, 0.7) | both_arms(generator) | {"hips_pitch": pitch, "hips_roll": roll}
    pose |= flat_footed(generator, standing_leg, pitch, between(generator, 0, 25), abs(roll) * -0.8, pitch)
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
    pose = trunk(generator, 0.5) | {"hips_pitch": pitch, "waist_bend": waist, "chest_bend": chest}
    for side in SIDES:
        pose |= flat_footed(generator, side, pitch + knee / 2, knee, spread, pitch)
        if generator.random() < 0.6:
            hang = (pitch + waist + chest) * between(generator, 0.55, 1.0)
            pose |= {f"{side}_raise": hang, f"{side}_plane": between(generator, 75, 95), f"{side}_elbow": 12.0}
        else:
            pose |= everyday_arm(generator, side)
    return pose


def crossed_arms(generator: np.random.Generator) -> Angles:
    """Forearms or straight arms crossed before the chest, low, high or in a double punch across."""
    kind = pick(generator, ("folded", "hugging", "low", "level", "punch"))
    pose = stance(generator) | trunk(generator, 0.6)
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
    pose = stance(generator) | trunk(generator, 0.5)
    first = pick(generator, tuple(REACHES))
    second = first if generator.random() < 0.5 else pick(generator, tuple(REACHES))
    if generator.random() < 0.25:
        pose |= _low_base(generator)
    pose |= arm_to("left", first) | (
        arm_to("right", second) if generator.random() < 0.8 else hanging_arm(generator, "right")
    )
    return pose if generator.random() < 0.5 else _mirrored(pose)


def dancing(generator: np.random.Generator) -> Angles:
    """Body lines as in dance: hips out against the shoulders, weight on one leg, arms in long lines or sharp angles."""
    side = 1.0 if generator.random() < 0.5 else -1.0
    sway = side * between(generator, 4, 14)
    pose = trunk(generator, 0.5)
    pose |= {"hips_roll": sway, "waist_side": -1.3 * sway, "chest_side": between(generator, -0.6, 0.6) * sway}
    pose |= {"hips_pitch": between(generator, -4, 12), "chest_bend": between(generator, -16, 20)}
    pose |= {"chest_twist": between(generator, -24, 24), "head_twist": between(generator, -50, 50)}
    wide = 3 + 25 * generator.random() ** 2
    for name, sign in (("left", 1), ("right", -1)):
        loaded = sign * sway > 0
        knee = between(generator, 0, 35) if loaded else between(generator, 15, 70)
        flex = knee * between(generator, 0.4, 0.75) + pose["hips_pitch"]
        pose |= flat_footed(generator, name, flex, knee, wide + sign * sway, pose["hips_pitch"])
        if not loaded and generator.random() < 0.5:  # the free foot on its toes
            pose |= {f"{name}_point": 30.0, f"{name}_toes": 30.0}
    line = pick(generator, ("long", "angles", "mixed"))
    for name in SIDES:
        if line == "long" or (line == "mixed" and name == "left"):
            pose |= free_arm(generator, name) | {f"{name}_elbow": between(generator, 0, 25)}
        else:
            pose |= free_arm(generator, name) | {f"{name}_elbow": between(generator, 75, 145)}
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
