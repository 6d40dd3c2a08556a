"""Families of procedural poses: broad sampling within anatomical limits, and families of difficult poses.

Motion capture covers little of the pose space, and least of all a dancer's difficult poses: upside down, on the floor,
limbs crossed. A family is a function of a random generator that returns the angles (see `posture`), in degrees, that
differ from standing. `FAMILIES` holds the families with their weights. Every pose faces +Z.
"""

from collections.abc import Callable, Sequence

import numpy as np

from synth.motion.limbs import (
    CLOSED_LEGS,
    OTHER_SIDE,
    REACHES,
    SIDES,
    Angles,
    arm_to,
    at_rest,
    both_arms,
    choose,
    closed_legs,
    drawn,
    everyday_arm,
    flat_footed,
    free_arm,
    hanging_arm,
    limb,
    mirrored,
    stance,
    trunk,
    uniform,
    upright,
)
from synth.motion.poses.floor_families import all_fours, handstand, kneel, lie, seat, sit
from synth.motion.posture import CHANNELS, LEG_ANGLES, LIMITS_DEG, angles, rotations
from synth.motion.skeleton import LEG_M, Poses, on_floor_m


def standing(generator: np.random.Generator) -> Angles:
    """Standing with zero, one or two limbs away from neutral, as in most recordings of exercises."""
    pose = upright(generator)
    draw = generator.random()
    if draw < 0.5:
        return pose
    draw = 2 * draw - 1
    first = choose(generator, SIDES)
    pose |= everyday_arm(generator, first)
    if draw < 0.3:  # the other arm is symmetric
        pose |= mirrored({f"{first}_{angle}": pose[f"{first}_{angle}"] for angle in ("raise", "plane", "twist", "elbow")})
    elif draw < 0.53:
        pose |= everyday_arm(generator, OTHER_SIDE[first])
    elif draw < 0.67:  # a leg is raised too
        side = choose(generator, SIDES)
        pose |= drawn(generator, side, flex=(-15, 70), knee=(0, 90), abduct=(0, 30))
    return pose


def _broad(generator: np.random.Generator, channel: str) -> float:
    """A random angle within the limits with a triangular distribution (the mean of two uniform draws)."""
    lowest, highest = LIMITS_DEG[channel]
    a, b = generator.random(2)
    return lowest + (highest - lowest) * (a + b) / 2


def broad(generator: np.random.Generator) -> Angles:
    """Any pose within the limits; each limb and the trunk is drawn independently."""
    pose = trunk(generator, 1.4) | free_arm(generator, "left") | free_arm(generator, "right")
    for side in SIDES:
        pose |= {f"{side}_{a}": _broad(generator, f"{side}_{a}") for a in ("flex", "abduct", "rotate", "point")}
        pose[f"{side}_knee"] = 150 * generator.random() ** 1.6
    pose["hips_pitch"] = uniform(generator, -15, 40)
    pose["hips_roll"] = 12 * generator.standard_normal()
    return pose


def free_arms(generator: np.random.Generator) -> Angles:
    return at_rest(generator, stance(generator) | trunk(generator, 0.7) | both_arms(generator))


def squat(generator: np.random.Generator) -> Angles:
    """Squats from slightly bent knees to sitting on the heels, narrow or wide."""
    depth = generator.random()
    pitch = uniform(generator, 0, 12 + 30 * depth)
    knee = 30 + 110 * depth
    lean = min(0.36 * knee, 28)
    abduct = uniform(generator, 3, 40)
    pose = trunk(generator, 0.6) | both_arms(generator) | {"hips_pitch": pitch}
    for side in SIDES:
        pose |= flat_footed(generator, side, knee - lean + pitch, knee, abduct, pitch)
        pose |= drawn(generator, side, rotate=(0, 10 + 0.8 * abduct), invert=abduct * (1 - depth))
    return pose


def lunge(generator: np.random.Generator) -> Angles:
    """A long step to the front or to the side with the other leg stretched."""
    front, back = choose(generator, (SIDES, SIDES[::-1]))
    pitch = uniform(generator, -5, 25)
    pose = trunk(generator, 0.7) | both_arms(generator) | {"hips_pitch": pitch}
    bent = uniform(generator, 40, 100)
    if generator.random() < 0.6:
        pose |= flat_footed(generator, front, bent + pitch, bent, uniform(generator, 0, 15), pitch)
        knee = uniform(generator, 5, 75)
        pose |= drawn(generator, back, flex=(-28, -5), knee=knee, toes=30, point=10)
        return pose
    pose |= flat_footed(generator, front, 0.7 * bent + pitch, bent, uniform(generator, 15, 40), pitch)
    return pose | flat_footed(generator, back, pitch, uniform(generator, 0, 8), uniform(generator, 30, 62), pitch)


def kick(generator: np.random.Generator) -> Angles:
    """One leg raised to the front, to the side, in a round kick or with a bent knee; the trunk leans away."""
    kicking, standing_leg = choose(generator, (SIDES, SIDES[::-1]))
    away = -1.0 if kicking == "left" else 1.0
    height = 0.25 + 0.75 * (1 - generator.random() ** 2)
    pitch = -uniform(generator, 0, 28 * height)
    roll = away * uniform(generator, 0, 30 * height)
    # 0 is a front kick, 1 a side kick; round kicks lie between.
    sideways = choose(generator, (0.1, 0.1, 0.5, 0.95))
    pose = trunk(generator, 0.7) | both_arms(generator) | {"hips_pitch": pitch, "hips_roll": roll}
    pose |= flat_footed(generator, standing_leg, pitch, uniform(generator, 0, 25), abs(roll) * -0.8, pitch)
    flex, abduct = (1 - sideways**2) * (45 + 83 * height), sideways * (30 + 40 * height)
    pose |= drawn(generator, kicking, flex=flex, abduct=abduct, rotate=(-25, 40))
    return pose | drawn(generator, kicking, knee=(0, 20) if generator.random() < 0.75 else (40, 130), point=(-20, 45))


def bend_forward(generator: np.random.Generator) -> Angles:
    """Forward bends, up to hands on the floor; the arms hang or are in an everyday pose."""
    depth = generator.random()
    pitch, waist, chest = 15 + 75 * depth, 10 + 42 * depth, 5 + 22 * depth
    knee = uniform(generator, 0, 35)
    abduct = uniform(generator, 2, 28)
    pose = trunk(generator, 0.5) | {"hips_pitch": pitch, "waist_bend": waist, "chest_bend": chest}
    for side in SIDES:
        pose |= flat_footed(generator, side, pitch + knee / 2, knee, abduct, pitch)
        if generator.random() < 0.6:
            hang = (pitch + waist + chest) * uniform(generator, 0.55, 1.0)
            pose |= drawn(generator, side, raise_=hang, plane=(75, 95), elbow=12.0)
        else:
            pose |= everyday_arm(generator, side)
    return pose


def crossed_arms(generator: np.random.Generator) -> Angles:
    """Forearms or straight arms crossed in front of the body: folded, hugging, low, level or as punches across."""
    kind = choose(generator, ("folded", "hugging", "low", "level", "punch"))
    pose = stance(generator) | trunk(generator, 0.6)
    if generator.random() < 0.25:
        pose |= _low_base(generator)
    over, under = choose(generator, (SIDES, SIDES[::-1]))
    for side in SIDES:
        # One arm lies over the other: in front of it and a little higher.
        offset = 6.0 if side == over else 0.0
        if kind in ("folded", "hugging"):
            pose |= arm_to(side, "folded" if kind == "folded" else "opposite_shoulder")
            pose[f"{side}_raise"] += offset + uniform(generator, -4, 4)
            pose[f"{side}_elbow"] -= offset
        else:
            level = {"low": 32.0, "level": 82.0, "punch": 88.0}[kind]
            pose[f"{side}_raise"] = level + offset + uniform(generator, -6, 6)
            pose[f"{side}_plane"] = uniform(generator, 120, 134)
            pose[f"{side}_elbow"] = uniform(generator, 0, 22)
            pose[f"{side}_twist"] = uniform(generator, -30, 20)
    if kind == "punch" and generator.random() < 0.5:  # the other fist is drawn back or guards
        pose |= arm_to(under, "guard") if generator.random() < 0.5 else arm_to(under, "chest")
        pose["chest_twist"] = pose["waist_twist"] = -14.0 if over == "left" else 14.0
    return pose


def touching(generator: np.random.Generator) -> Angles:
    """Hands on or near the body, at the places of `limbs.REACHES`."""
    pose = stance(generator) | trunk(generator, 0.5)
    first = choose(generator, tuple(REACHES))
    second = first if generator.random() < 0.5 else choose(generator, tuple(REACHES))
    if generator.random() < 0.25:
        pose |= _low_base(generator)
    pose |= arm_to("left", first) | (arm_to("right", second) if generator.random() < 0.8 else hanging_arm(generator, "right"))
    return pose if generator.random() < 0.5 else mirrored(pose)


def dancing(generator: np.random.Generator) -> Angles:
    """Dance poses: hips shifted against the shoulders, weight on one leg, arms straight or with sharply bent elbows."""
    side = 1.0 if generator.random() < 0.5 else -1.0
    sway = side * uniform(generator, 4, 14)
    pose = trunk(generator, 0.5)
    pose |= {"hips_roll": sway, "waist_side": -1.3 * sway, "chest_side": uniform(generator, -0.6, 0.6) * sway}
    pose |= {"hips_pitch": uniform(generator, -4, 12), "chest_bend": uniform(generator, -16, 20)}
    pose |= {"chest_twist": uniform(generator, -24, 24), "head_twist": uniform(generator, -50, 50)}
    wide = closed_legs(generator) if generator.random() < CLOSED_LEGS else 3 + 25 * generator.random() ** 2
    for name, sign in (("left", 1), ("right", -1)):
        loaded = sign * sway > 0
        knee = uniform(generator, 0, 35) if loaded else uniform(generator, 15, 70)
        flex = knee * uniform(generator, 0.4, 0.75) + pose["hips_pitch"]
        pose |= flat_footed(generator, name, flex, knee, wide + sign * sway, pose["hips_pitch"])
        if not loaded and generator.random() < 0.5:  # the unloaded foot is on its toes
            pose |= limb(name, point=30.0, toes=30.0)
    line = choose(generator, ("long", "angles", "mixed"))
    for name in SIDES:
        if line == "long" or (line == "mixed" and name == "left"):
            pose |= free_arm(generator, name) | drawn(generator, name, elbow=(0, 25))
        else:
            pose |= free_arm(generator, name) | drawn(generator, name, elbow=(75, 145))
    return at_rest(generator, pose)


def _low_base(generator: np.random.Generator) -> Angles:
    """Legs and hips of a squat, lunge, kneeling or sitting pose, to be combined with other arms."""
    base = choose(generator, (squat, lunge, kneel, sit))(generator)
    return {c: v for c, v in base.items() if c.startswith("hips") or c.endswith(LEG_ANGLES)}


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
    "seat": (4.0, seat),
    "lie": (2.5, lie),
    "all_fours": (2.5, all_fours),
    "handstand": (3.0, handstand),
}
"""Name to (relative weight, family)."""

_JITTER_DEG = 2.5  # standard deviation of the noise added to every angle, so that no tabulated pose occurs twice


class ProceduralPoses:
    def __init__(self, families: dict[str, tuple[float, Callable[[np.random.Generator], Angles]]] = FAMILIES) -> None:
        self._names = tuple(families)
        self._families = tuple(family for _, family in families.values())
        weights = np.array([weight for weight, _ in families.values()])
        self._thresholds = (np.cumsum(weights) / weights.sum())[:-1]

    def poses(self, generators: Sequence[np.random.Generator]) -> Poses:
        """Draws one pose per generator; pose k depends only on generator k."""
        chosen = [int(np.searchsorted(self._thresholds, g.random(), side="right")) for g in generators]
        return self._build(chosen, generators)

    def family(self, name: str, generators: Sequence[np.random.Generator]) -> Poses:
        return self._build([self._names.index(name)] * len(generators), generators)

    def _build(self, chosen: list[int], generators: Sequence[np.random.Generator]) -> Poses:
        postures = np.empty((len(chosen), len(CHANNELS)))
        for row, family, generator in zip(postures, chosen, generators, strict=True):
            row[:] = angles(**self._families[family](generator))
            row += _JITTER_DEG * generator.standard_normal(len(row))
        quats = rotations(postures)
        names = [f"pose:{self._names[family]}" for family in chosen]
        return Poses(quats, on_floor_m(quats), np.full(len(quats), LEG_M, np.float32), names)
