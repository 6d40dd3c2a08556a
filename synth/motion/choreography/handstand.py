"""The handstand: onto the hands, up, held with several leg shapes, and back to standing.

The moves of `moves` are defined by foot positions and cannot represent a handstand, so this motion is keyframed in the
angles of `posture`. The hands, like the feet before and after, keep their position on the floor (`splice.planted`).
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from synth.motion.limbs import SIDES, Angles, choose, limb, uniform
from synth.motion.posture import angles, limited, rotations
from synth.motion.skeleton import LEG_M, Motion
from synth.motion.splice import planted


def handstand(generator: np.random.Generator, seconds: float, fps: float) -> Motion:
    """One handstand, from standing to standing, of about as many seconds.

    The time left by getting up and down, at least 0.8 s, is held upside down.
    """
    leading, other = choose(generator, (SIDES, SIDES[::-1]))
    hold_s = max(seconds - 4.0 * (pace := uniform(generator, 1.1, 1.4)), 0.8)
    shapes = [_legs(generator, leading, other) for _ in range(1 + int(hold_s / 1.2))]
    lean = uniform(generator, -5, 5)
    keys: list[tuple[float, Angles]] = [
        (0.0, {}),
        (0.5 * pace, _both(raise_=150, plane=75, elbow=5)),
        (0.7 * pace, _bent(leading, other)),
        (0.45 * pace, _kick(leading, other)),
        (0.45 * pace, _inverted(lean) | shapes[0]),
        *((hold_s / len(shapes), _inverted(lean) | shape) for shape in (*shapes[1:], _TOGETHER)),
        (0.5 * pace, _kick(leading, other)),
        (0.6 * pace, _bent(leading, other)),
        (0.8 * pace, {}),
    ]
    times = np.cumsum([length for length, _ in keys])
    curve = PchipInterpolator(times, np.array([angles(**shape) for _, shape in keys]))
    postures = curve(np.arange(int(times[-1] * fps) + 1) / fps)
    return planted(rotations(limited(postures)), fps, "handstand", LEG_M)


def _both(**angles: float) -> Angles:
    return limb("left", **angles) | limb("right", **angles)


def _bent(leading: str, other: str) -> Angles:
    """Both hands and both feet on the floor; the leading leg's knee is bent more."""
    pose = _both(raise_=126, plane=88, elbow=5, wrist=-40)
    pose |= {"hips_pitch": 78.0, "waist_bend": 42.0, "chest_bend": 20.0, "head_bend": -30.0}
    for side, knee in ((leading, 48.0), (other, 30.0)):
        flex = 78.0 + knee / 2
        pose |= limb(side, flex=flex, knee=knee, point=flex - knee - 78.0)
    return pose


def _kick(leading: str, other: str) -> Angles:
    """The weight on the hands, one leg swung up, the other leg just off the floor."""
    pose = _both(raise_=166, plane=80, elbow=5, wrist=-60, point=30)
    pose |= {"hips_pitch": 138.0, "waist_bend": 20.0, "chest_bend": 8.0, "head_bend": -35.0}
    return pose | limb(other, flex=-10, knee=12) | limb(leading, flex=62, knee=28)


def _inverted(lean: float) -> Angles:
    """Upside down, without the legs; `lean` tilts the body forward, degrees."""
    return _both(raise_=174, plane=60, elbow=5, wrist=-65, shrug=12) | {"hips_pitch": 180.0 + lean, "head_bend": -30.0}


_TOGETHER = _both(flex=0, abduct=4, point=40)


def _legs(generator: np.random.Generator, leading: str, other: str) -> Angles:
    """A random shape of the legs upside down: together, split, straddled or bent."""
    shape = choose(generator, ("together", "split", "straddled", "bent"))
    if shape == "split":
        return _TOGETHER | {f"{leading}_flex": uniform(generator, 25, 70), f"{other}_flex": uniform(generator, -25, -5)}
    if shape == "straddled":
        return _TOGETHER | {f"{side}_abduct": uniform(generator, 25, 45) for side in SIDES}
    if shape == "bent":
        return _TOGETHER | {f"{side}_knee": uniform(generator, 40, 100) for side in SIDES}
    return _TOGETHER
