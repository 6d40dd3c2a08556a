"""Families of made poses on more than the feet: on the knees, seated, lying, on the hands (see `families`)."""

import numpy as np

from synth.motion.limbs import SIDES, Angles, arm_to, between, both_arms, everyday_arm, flat_footed, free_arm, pick, trunk


def kneel(generator: np.random.Generator) -> Angles:
    """On one knee, on both, or sitting on the heels."""
    pitch = between(generator, -8, 20)
    pose = trunk(generator, 0.7) | both_arms(generator) | {"hips_pitch": pitch}
    down, up = pick(generator, (SIDES, SIDES[::-1]))
    if generator.random() < 0.4:
        raised = between(generator, 75, 105)
        pose |= flat_footed(
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
    pose = trunk(generator, 0.7) | {"hips_pitch": pitch}
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
            pose |= everyday_arm(generator, side)
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
    pose = trunk(generator, 0.4)
    way = pick(generator, ("back", "belly", "side"))
    for side in SIDES:
        bend = generator.random() ** 2
        pose |= free_arm(generator, side)
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
    pose = trunk(generator, 0.4) | {"hips_pitch": 180 + 10 * generator.standard_normal(), "hips_yaw": 180.0}
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
    pose = trunk(generator, 0.5)
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
