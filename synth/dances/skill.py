"""A model of skill: turns a teacher's motion into a learner's by adding errors.

A learner has a delay that varies over time. The movements are smaller than the teacher's, by a different factor for each joint.
Each joint has an angular error that drifts slowly. Sometimes a learner forgets a move (and stands still), performs another move
of the dance instead, or performs the move mirrored.

The strength of each kind of error is the learner's `severity` times a random factor for the learner and the kind of error: one
learner is late but exact, another is on time but makes small movements. So the order of neighbouring levels may be inverted in
a single kind of error. The geometric mean of a learner's factors is 1, so over all kinds of errors together the learner of the
better level is better, which experts can see.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kpopnet.rotations import conjugate, continuous, multiply, normalised, towards, turns
from synth.motion.posture import STANDING, rotations
from synth.motion.skeleton import JOINT_NAMES, NUM_JOINTS, Motion, facing_front, mirrored
from synth.motion.splice import as_high_as, at_times

LEVELS = ("best", "good", "bad", "worst")
MISTAKES = ("forgotten", "swapped", "mirrored")

MISTAKE_S = (1.0, 2.4)  # duration of a mistake: about one move
TRANSITION_S = 0.4  # into a mistake, and out of it
DRIFT_PERIOD_S = (2.0, 7.0)  # of the delay's variation
NOISE_CORRELATION_S = 0.35  # standard deviation of the Gaussian that correlates a joint's error in time
CONSTANT_FRACTION = 0.6  # standard deviation of the constant part of a joint's error, of that of the whole error
GAIN_RANGE = (0.2, 1.35)  # factor of a joint's movement

_SHARES = {
    "Hips": 0.3, "LowerBack": 0.4, "Spine": 0.4, "Spine1": 0.4, "Neck": 0.3, "Neck1": 0.3, "Head": 0.4,
    "Shoulder": 0.3, "Arm": 1.0, "ForeArm": 1.0, "Hand": 0.5, "UpLeg": 0.5, "Leg": 0.4, "Foot": 0.3, "ToeBase": 0.0,
}  # fmt: skip
SHARES = np.array([_SHARES[name.removeprefix("Left").removeprefix("Right")] for name in JOINT_NAMES])
"""(23,) factor of the posture errors of each joint."""


@dataclass(frozen=True)
class Strengths:
    lag_s: float  # mean delay, seconds
    unevenness_s: float  # standard deviation of the delay over time, seconds
    damping: float  # fraction by which every movement is smaller than the teacher's
    distortion: float  # standard deviation, over the joints, of the logarithm of a movement's factor
    noise_deg: float  # standard deviation of the angular error of a joint whose factor in SHARES is 1, degrees
    mistakes_per_minute: float  # rate of forgotten, swapped and mirrored moves


MEAN_STRENGTHS = Strengths(lag_s=0.10, unevenness_s=0.08, damping=0.14, distortion=0.12, noise_deg=9.0, mistakes_per_minute=6.0)
"""Strengths at severity 1, between the levels good and bad."""


@dataclass(frozen=True)
class SkillConfig:
    """Differences between and within levels.

    Attributes:
        spacing: logarithm of the ratio of severities of neighbouring levels. It determines the benchmark's difficulty and is
            the only number that was calibrated (`synth.dances.simulate.SPACING`, docs/ledger.md): smaller is harder.
        spread: standard deviation of the logarithm of the random factor of one kind of error of one learner. Chosen, not
            calibrated: with 0.35 a single kind of error decides the order more often than the level does, but the experts
            agreed with each other.
    """

    spacing: float = 0.5
    spread: float = 0.2

    def severity(self, level: int) -> float:
        """The severity of LEVELS[level]; 1 in the middle of the levels."""
        return float(np.exp(self.spacing * (level - (len(LEVELS) - 1) / 2)))


def draw_strengths(rng: np.random.Generator, level: int, config: SkillConfig) -> Strengths:
    """Draws the strengths of a learner; their geometric mean, relative to MEAN_STRENGTHS, is the severity of the level."""
    names = [field.name for field in fields(Strengths)]
    log_factors = config.spread * rng.standard_normal(len(names))
    factors = config.severity(level) * np.exp(log_factors - log_factors.mean())
    return Strengths(**{name: getattr(MEAN_STRENGTHS, name) * float(f) for name, f in zip(names, factors, strict=True)})


@dataclass(frozen=True)
class Mistake:
    """A wrong move, of a kind in MISTAKES."""

    kind: str
    start_s: float
    seconds: float
    shift_s: float  # a swapped move shows the teacher's motion this many seconds later, or earlier if negative


def draw_mistakes(rng: np.random.Generator, seconds: float, per_minute: float) -> list[Mistake]:
    """Draws mistakes that do not overlap, in order of time, for a dance of this length; none begins in the first second.

    Their number is the expected one, rounded up or down at random, minus those that would overlap. It has no other random
    part, because a dance here is a short part of a song: a random number of mistakes within a few seconds would depend more
    on the excerpt than on the dancer.
    """
    drawn: list[Mistake] = []
    for _ in range(int(per_minute * seconds / 60 + rng.random())):
        kind, length_s = MISTAKES[rng.integers(len(MISTAKES))], rng.uniform(*MISTAKE_S)
        start_s, other_s = rng.uniform(1.0, max(seconds - length_s, 1.0), 2).tolist()
        if all(start_s > m.start_s + m.seconds or start_s + length_s < m.start_s for m in drawn):
            drawn.append(Mistake(kind, start_s, length_s, other_s - start_s))
    return sorted(drawn, key=lambda mistake: mistake.start_s)


def learn(teacher: Motion, strengths: Strengths, rng: np.random.Generator) -> tuple[Motion, list[Mistake]]:
    """A learner's motion, made from a teacher's of the same length, and the mistakes in it.

    Each joint has a gain, within GAIN_RANGE: its angle from standing is the gain times the teacher's. With a gain above 1, or
    by the noise, it may exceed the joint's limits. The height of the learner above the floor equals the teacher's. The feet may
    slide.
    """
    seconds = np.arange(len(teacher)) / teacher.fps
    length_s = seconds[-1]
    mistakes = draw_mistakes(rng, length_s, strengths.mistakes_per_minute)
    delay_s = strengths.lag_s + strengths.unevenness_s * _drift(rng, seconds)
    source_s = np.maximum.accumulate(np.clip(seconds - delay_s, 0, length_s))

    danced = at_times(teacher, source_s, teacher.fps)
    quats = danced.quats.astype(np.float64)
    for mistake in mistakes:
        wrong = _wrong_pose(teacher, danced.quats, source_s, mistake).astype(np.float64)
        # The heading of the hips stays that of the correct motion: a wrong move is performed in the right direction.
        wrong[:, 0] = multiply(_headings(danced.quats), facing_front(wrong)[:, 0])
        quats = normalised(towards(quats, wrong, _mistake_weight(seconds, mistake)[:, None, None]))

    gains = (1 - strengths.damping) * np.exp(strengths.distortion * rng.standard_normal(NUM_JOINTS))
    gains = 1 + np.minimum(SHARES / 0.4, 1) * (np.clip(gains, *GAIN_RANGE) - 1)
    headings = _headings(quats)
    quats[:, 0] = facing_front(quats)[:, 0]
    quats = _scale_rotations(quats, gains)
    quats[:, 0] = multiply(headings, quats[:, 0])
    quats = multiply(quats, _noise(rng, len(quats), teacher.fps, strengths.noise_deg))

    root_m = danced.root_m.astype(np.float64)
    root_m[:, [0, 2]] = root_m[0, [0, 2]] + (1 - min(strengths.damping, 0.8)) * (root_m - root_m[0])[:, [0, 2]]
    root_m = as_high_as(danced, quats, root_m)
    return replace(teacher, quats=quats.astype(np.float32), root_m=root_m.astype(np.float32)), mistakes


def _drift(rng: np.random.Generator, seconds: np.ndarray) -> np.ndarray:
    """(T,) smooth random signal with mean 0 and standard deviation 1: a sum of four sines."""
    waves = 4
    cycles = seconds[:, None] / rng.uniform(*DRIFT_PERIOD_S, waves) + rng.random(waves)
    return np.sin(2 * np.pi * cycles).sum(axis=1) * np.sqrt(2 / waves)


def _wrong_pose(teacher: Motion, quats: np.ndarray, source_s: np.ndarray, mistake: Mistake) -> np.ndarray:
    """(T, 23, 4) pose that the mistake shows in each frame.

    Without mistakes the learner's motion is (T, 23, 4) `quats`, from the times (T,) `source_s` of the teacher's, seconds.
    """
    match mistake.kind:
        case "forgotten":
            return np.broadcast_to(rotations(STANDING[None])[0], quats.shape)
        case "swapped":
            return at_times(teacher, np.clip(source_s + mistake.shift_s, 0, source_s[-1]), teacher.fps).quats
        case "mirrored":
            return mirrored(quats)
    raise AssertionError(mistake.kind)


def _mistake_weight(seconds: np.ndarray, mistake: Mistake) -> np.ndarray:
    """(T,) weight of the mistake's pose: 0 before and after the mistake, 1 inside it, smooth in the transitions."""
    into = np.clip((seconds - mistake.start_s) / TRANSITION_S, 0, 1)
    out_of = np.clip((mistake.start_s + mistake.seconds - seconds) / TRANSITION_S, 0, 1)
    weight = np.minimum(into, out_of)
    return weight * weight * (3 - 2 * weight)


def _headings(quats: np.ndarray) -> np.ndarray:
    """(T, 4) rotation about the vertical axis of the hips in (T, 23, 4) rotations."""
    return multiply(quats[:, 0].astype(np.float64), conjugate(facing_front(quats)[:, 0].astype(np.float64)))


def _scale_rotations(quats: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Multiplies the angle of every joint's rotation relative to the standing pose by its (23,) gain."""
    rest = rotations(STANDING[None]).astype(np.float64)
    relative = multiply(conjugate(rest), quats)
    # Quaternion signs are continuous from frame to frame, so that a rotation beyond 180 degrees does not flip.
    relative[0] *= np.where(relative[0, :, :1] < 0, -1, 1)
    relative = continuous(relative)
    sine = np.linalg.norm(relative[..., 1:], axis=-1, keepdims=True)
    half = gains[:, None] * np.arctan2(sine, relative[..., :1])
    axis = relative[..., 1:] / np.maximum(sine, 1e-9)
    return multiply(rest, np.concatenate([np.cos(half), np.sin(half) * axis], axis=-1))


def _noise(rng: np.random.Generator, frames: int, fps: float, degrees: float) -> np.ndarray:
    """(T, 23, 4) small rotations: a constant error and a slow drift around it; `degrees` is their standard deviation."""
    constant = rng.standard_normal((1, NUM_JOINTS, 3))
    drift = gaussian_filter1d(rng.standard_normal((frames, NUM_JOINTS, 3)), NOISE_CORRELATION_S * fps, axis=0, mode="wrap")
    drift *= np.sqrt(2 * np.sqrt(np.pi) * NOISE_CORRELATION_S * fps)  # restores the standard deviation 1 after filtering
    rotation = CONSTANT_FRACTION * constant + np.sqrt(1 - CONSTANT_FRACTION**2) * drift
    return turns(rotation * (np.radians(degrees) * SHARES[:, None] / np.sqrt(3)))
