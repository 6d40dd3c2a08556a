"""Families of poses that touch the floor or a chair: kneeling, sitting, lying, on hands (see `families`)."""

import numpy as np

from synth.motion.limbs import (
    SIDES,
    Angles,
    arm_to,
    both_arms,
    choose,
    drawn,
    everyday_arm,
    flat_footed,
    free_arm,
    limb,
    trunk,
    uniform,
)


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
