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


# --- On the floor or a chair -----------------------------------------------------------------------------------------------


def kneel(generator: np.random.Generator) -> Angles:
    """Kneeling on one knee, on both knees, or sitting on the heels."""
    pitch = uniform(generator, -8, 20)
    pose = trunk(generator, 0.7) | both_arms(generator) | {"hips_pitch": pitch}
    down, up = choose(generator, (SIDES, SIDES[::-1]))
    if generator.random() < 0.4:
        raised = uniform(generator, 75, 105)
        pose |= flat_footed(
            generator, up, raised + pitch, raised + uniform(generator, -10, 15), uniform(generator, 0, 30), pitch
        )
        pose |= _kneeling(down, uniform(generator, -10, 15), pitch, uniform(generator, 0, 12), toes=generator.random() < 0.5)
        return pose
    low, abduct = 90 * generator.random(), uniform(generator, 0, 25)
    for side in SIDES:
        pose |= _kneeling(side, low, pitch, abduct, toes=False)
    return pose


def _kneeling(side: str, thigh: float, pitch: float, abduct: float, *, toes: bool) -> Angles:
    """A leg with the shin on the floor and the thigh `thigh` degrees in front of the vertical."""
    ankle = limb(side, point=-20.0, toes=45.0) if toes else limb(side, point=48.0)
    return ankle | limb(side, flex=thigh + pitch, knee=88.0 + thigh, abduct=abduct)


def sit(generator: np.random.Generator) -> Angles:
    """Sitting on the floor: legs straight, drawn up, crossed, straddled, or different for each side."""
    arrangement = choose(generator, (*_SITTING_LEGS, "mixed"))
    # With drawn-up knees the pelvis tilts backwards, and the waist bends forward to keep the chest upright.
    pitch = uniform(generator, -42, -26) if arrangement in ("drawn_up", "mixed") else uniform(generator, -25, 2)
    pose = trunk(generator, 0.7) | {"hips_pitch": pitch}
    pose["waist_bend"] -= uniform(generator, 0.0, 0.9) * pitch
    for side in SIDES:
        own = choose(generator, tuple(_SITTING_LEGS)) if arrangement == "mixed" else arrangement
        pose |= _sitting_leg(generator, side, own, pitch)
    arms = generator.random()
    for side in SIDES:
        if arms < 0.3:  # hands on the floor behind the back
            pose |= drawn(generator, side, raise_=(30, 58), plane=(-90, -50), twist=(0, 60), elbow=(0, 20))
            pose[f"{side}_raise"] -= 0.4 * pitch
        elif arms < 0.55:  # hands on or around the knees
            pose |= drawn(generator, side, raise_=(40, 80), plane=(70, 105), twist=(-40, 10), elbow=(5, 90))
        elif arms < 0.7:
            pose |= arm_to(side, "thigh")
        else:
            pose |= everyday_arm(generator, side)
    return pose


def seat(generator: np.random.Generator) -> Angles:
    """Sitting on a chair, leaning back or forward, and half-way up from it; the soles are on the floor."""
    pitch = uniform(generator, -22, 35)
    pose = trunk(generator, 0.5) | {"hips_pitch": pitch}
    thigh = uniform(generator, 72, 98)  # from the vertical
    abduct, apart = uniform(generator, -2, 22), generator.random() < 0.3
    for side in SIDES:
        own = uniform(generator, -2, 22) if apart else abduct
        shin = uniform(generator, -12, 18)  # the foot before or behind the knee
        pose |= flat_footed(generator, side, thigh + pitch, thigh + shin, own, pitch)
        pose |= arm_to(side, "thigh") if generator.random() < 0.35 else everyday_arm(generator, side)
    return pose


_SITTING_LEGS = {  # ranges of knee, abduct and rotate
    "straight": ((0, 20), (0, 12), (0, 10)),
    "straddled": ((0, 25), (28, 65), (10, 30)),
    "drawn_up": ((70, 122), (0, 22), (-5, 20)),
    "crossed": ((110, 145), (38, 64), (50, 61)),
}


def _sitting_leg(generator: np.random.Generator, side: str, arrangement: str, pitch: float) -> Angles:
    """A leg of a sitting pose whose hips are pitched by `pitch` degrees."""
    knee, abduct, rotate = (uniform(generator, *limits) for limits in _SITTING_LEGS[arrangement])
    # Thigh and shin have nearly equal lengths: the heel is on the floor if the thigh rises by half the knee's flexion.
    flex = uniform(generator, 114, 126) if arrangement == "crossed" else 90 + knee / 2 + uniform(generator, 0, 4)
    return drawn(generator, side, flex=flex + pitch, abduct=abduct, rotate=rotate, knee=knee, point=(-10, 40))


def lie(generator: np.random.Generator) -> Angles:
    """Lying on the back, the belly or a side; limbs in contact with the floor stay in its plane."""
    pose = trunk(generator, 0.4)
    kind = choose(generator, ("back", "belly", "side"))
    for side in SIDES:
        bend = generator.random() ** 2
        pose |= free_arm(generator, side)
        pose |= drawn(generator, side, rotate=(0, 35), point=(0, 45))
        if kind == "belly":
            pose |= drawn(
                generator, side, plane=(-8, 4), twist=(75, 98), flex=(-6, 2), knee=100 * bend, point=45, abduct=(0, 30)
            )
            pose[f"{side}_pronate"] = 0.0
        elif kind == "back":
            pose |= drawn(generator, side, plane=(0, 120), twist=(-20, 60))
            pose |= limb(side, flex=(45 + 65 * generator.random()) * bend, knee=130 * bend)
            pose |= drawn(generator, side, abduct=(0, 30))
        else:
            pose |= drawn(generator, side, plane=(60, 100), twist=(-20, 20))
            pose |= limb(side, flex=100 * bend, knee=130 * generator.random() * bend, rotate=0.0)
    if kind == "side":
        return pose | {"hips_roll": choose(generator, (-1, 1)) * uniform(generator, 80, 98)}
    return pose | {"hips_pitch": uniform(generator, -96, -86) if kind == "back" else uniform(generator, 86, 94)}


def handstand(generator: np.random.Generator) -> Angles:
    """Handstands on hands or forearms: legs together, split, straddled, bent or free; body straight or arched."""
    pose = trunk(generator, 0.4) | {"hips_pitch": 180 + 10 * generator.standard_normal(), "hips_yaw": 180.0}
    pose |= {"hips_roll": 6 * generator.standard_normal(), "head_bend": uniform(generator, -45, 5)}
    on_forearms = generator.random() < 0.15
    for side in SIDES:
        pose |= drawn(generator, side, raise_=(160, 178), plane=(10, 90))
        pose |= limb(side, elbow=95.0 if on_forearms else uniform(generator, 0, 15), wrist=-65.0)
        pose |= drawn(generator, side, twist=(-10, 20), shrug=12.0, knee=5.0, point=(10, 50), abduct=4.0)
    legs = choose(generator, ("together", "split", "straddled", "bent", "free"))
    if legs == "split":
        front, back = choose(generator, (SIDES, SIDES[::-1]))
        pose |= {f"{front}_flex": uniform(generator, 25, 95), f"{back}_flex": uniform(generator, -28, 0)}
        pose |= drawn(generator, back, knee=(0, 80))
    elif legs == "straddled":
        pose |= {f"{side}_abduct": uniform(generator, 30, 65) for side in SIDES}
    elif legs == "bent":
        knee = uniform(generator, 50, 130)
        pose |= {f"{side}_knee": knee for side in SIDES} | {f"{side}_flex": uniform(generator, -20, 90) for side in SIDES}
    elif legs == "free":
        for side in SIDES:
            pose |= drawn(generator, side, flex=(-25, 80), knee=(0, 120), abduct=(0, 45))
    return pose


def all_fours(generator: np.random.Generator) -> Angles:
    """Hands on the floor below the shoulders: on the knees, in a push-up, or in a bridge with the belly up."""
    kind = choose(generator, ("knees", "push_up", "push_up", "bridge"))
    pose = trunk(generator, 0.5)
    elbow = uniform(generator, 0, 20) if generator.random() < 0.6 else uniform(generator, 20, 100)
    if kind == "bridge":
        pitch = -uniform(generator, 82, 100)
        pose |= {"hips_pitch": pitch}
        for side in SIDES:
            pose |= drawn(generator, side, flex=85 + pitch, knee=85.0, abduct=(0, 15))
            pose |= limb(side, raise_=60.0, plane=-88.0, twist=30.0, elbow=4.0)
        return pose
    pitch = uniform(generator, 66, 82) if kind == "push_up" else uniform(generator, 75, 95)
    pose |= {"hips_pitch": pitch, "head_bend": uniform(generator, -45, 10)}
    for side in SIDES:
        lift = pitch + 0.4 * elbow - 8
        pose |= drawn(generator, side, raise_=lift, plane=(70, 92), elbow=elbow, wrist=-60.0, abduct=(0, 12))
        if kind == "push_up":
            pose |= drawn(generator, side, flex=(-5, 8), knee=4.0, toes=40.0, point=-20.0)
        else:
            pose |= limb(side, flex=pitch, knee=90.0, point=45.0)
    return pose


# --- Arms -------------------------------------------------------------------------------------------------------------------


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


_WEIGHTS: dict[Callable[[np.random.Generator], Angles], float] = {
    standing: 16.0, free_arms: 13.0, broad: 16.0, dancing: 10.0, touching: 7.0, crossed_arms: 7.0, kick: 6.0, squat: 4.0,
    lunge: 4.0, bend_forward: 4.0, kneel: 4.0, sit: 5.0, seat: 4.0, lie: 2.5, all_fours: 2.5, handstand: 3.0,
}  # fmt: skip
FAMILIES = {family.__name__: (weight, family) for family, weight in _WEIGHTS.items()}
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
