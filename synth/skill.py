"""How a learner dances what a teacher showed: a model of skill.

A learner is late, and unevenly so; moves smaller than the teacher, and each joint by another share; has joints that are
off by an angle which wanders slowly; and now and then forgets a move (and stands there), does another one of the dance
instead, or does it to the wrong side.

How strong each of these is, is the learner's `severity` times a number drawn for the learner and the fault: one is late but
exact, another in time but small. Neighbouring levels may change places therefore in a single fault; the numbers' geometric
mean is 1, so that over all faults together the learner of the better level is the better one, which experts can see.
"""

from dataclasses import dataclass, fields

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kpopnet.errors import InputError
from synth.motion.posture import STANDING, rotations
from synth.motion.skeleton import (
    JOINT_NAMES,
    NUM_JOINTS,
    Motion,
    conjugate,
    facing_front,
    height_above_floor,
    mirrored,
    multiply,
)
from synth.motion.splice import at_times

LEVELS = ("best", "good", "bad", "worst")
MISTAKES = ("forgotten", "swapped", "mirrored")

MISTAKE_S = (1.0, 2.4)
"""How long a mistake lasts: about a move."""

EDGE_S = 0.4
"""How long a learner takes into a mistake and out of it."""

WANDER_S = (2.0, 7.0)
"""Periods of the uneven timing."""

NOISE_S = 0.35
"""Width of the Gaussian over which a joint's error is correlated in time."""

STEADY_SHARE = 0.6
"""Of a joint's error, in standard deviations, what stays the same all along: a habit."""

GAINS = (0.2, 1.35)
_SHARES = {
    "Hips": 0.3, "LowerBack": 0.4, "Spine": 0.4, "Spine1": 0.4, "Neck": 0.3, "Neck1": 0.3, "Head": 0.4,
    "Shoulder": 0.3, "Arm": 1.0, "ForeArm": 1.0, "Hand": 0.5, "UpLeg": 0.5, "Leg": 0.4, "Foot": 0.3, "ToeBase": 0.0,
}  # fmt: skip
SHARES = np.array([_SHARES[name.removeprefix("Left").removeprefix("Right")] for name in JOINT_NAMES])
"""(23,) how much of the faults of posture shows in each joint."""


@dataclass(frozen=True)
class Strengths:
    """How strong a learner's faults are.

    Attributes:
        lag_s: mean delay.
        unevenness_s: standard deviation of the delay over time.
        damping: share of every movement's size that is missing.
        distortion: standard deviation over the joints of that share.
        noise_deg: standard deviation of the error of a joint with share 1.
        mistakes_per_minute: forgotten, swapped and mirrored moves.
    """

    lag_s: float
    unevenness_s: float
    damping: float
    distortion: float
    noise_deg: float
    mistakes_per_minute: float


AVERAGE = Strengths(lag_s=0.10, unevenness_s=0.08, damping=0.14, distortion=0.12, noise_deg=9.0, mistakes_per_minute=6.0)
"""Strengths at severity 1, between good and bad."""


@dataclass(frozen=True)
class SkillConfig:
    """How levels differ.

    Attributes:
        spacing: logarithm of the ratio of severities of neighbouring levels. The benchmark's difficulty, and the only
            number that was calibrated (`python -m synth.calibrate_skill`, docs/ledger.md): the smaller, the harder.
        spread: standard deviation of the logarithm of what a single fault of one learner is multiplied with. Chosen, not
            calibrated: with 0.35 a single fault decides the order more often than the level does, and experts were at one.
    """

    spacing: float = 0.5
    spread: float = 0.2

    def __post_init__(self) -> None:
        if not 0 <= self.spacing <= 3 or not 0 <= self.spread <= 3:
            raise InputError(f"skill.spacing={self.spacing} and skill.spread={self.spread} must lie in 0..3")

    def severity(self, level: int) -> float:
        """Of LEVELS[level]; 1 in the middle."""
        return float(np.exp(self.spacing * (level - (len(LEVELS) - 1) / 2)))


def draw_strengths(rng: np.random.Generator, level: int, config: SkillConfig) -> Strengths:
    """A learner of a level: over all faults together exactly as bad as the level is, see above."""
    names = [field.name for field in fields(Strengths)]
    own = config.spread * rng.standard_normal(len(names))
    factors = config.severity(level) * np.exp(own - own.mean())
    return Strengths(**{name: getattr(AVERAGE, name) * float(f) for name, f in zip(names, factors, strict=True)})


@dataclass(frozen=True)
class Mistake:
    """A move gone wrong: kind is one of MISTAKES; a swapped one shows what belongs `shift_s` seconds later or earlier."""

    kind: str
    start_s: float
    seconds: float
    shift_s: float


def draw_mistakes(rng: np.random.Generator, seconds: float, per_minute: float) -> list[Mistake]:
    """Mistakes that do not overlap, in a dance of so many seconds; none in its first second.

    There are as many as expected, to within one, less those that would overlap. A dance here is a stretch of a song; how many
    fall into a few seconds by chance would say more of it than of the dancer.
    """
    found: list[Mistake] = []
    for _ in range(int(per_minute * seconds / 60 + rng.random())):
        kind, length_s = MISTAKES[rng.integers(len(MISTAKES))], rng.uniform(*MISTAKE_S)
        start_s, other_s = rng.uniform(1.0, max(seconds - length_s, 1.0), 2).tolist()
        if all(start_s > m.start_s + m.seconds or start_s + length_s < m.start_s for m in found):
            found.append(Mistake(kind, start_s, length_s, other_s - start_s))
    return sorted(found, key=lambda mistake: mistake.start_s)


def learn(teacher: Motion, strengths: Strengths, rng: np.random.Generator) -> tuple[Motion, list[Mistake]]:
    """What the learner dances to the same music, as long as the teacher does, and the mistakes in it.

    Every joint stays within some degrees of what joints can do, since it lies between standing and the teacher's pose but
    for the noise. The feet are put on the floor as high as the teacher's; they may slide.
    """
    seconds = np.arange(len(teacher)) / teacher.fps
    length_s = seconds[-1]
    mistakes = draw_mistakes(rng, length_s, strengths.mistakes_per_minute)
    delay_s = strengths.lag_s + strengths.unevenness_s * _wander(rng, seconds)
    when_s = np.maximum.accumulate(np.clip(seconds - delay_s, 0, length_s))

    danced = at_times(teacher, when_s, teacher.fps)
    quats = danced.quats.astype(np.float64)
    for mistake in mistakes:
        wrong = _wrong_pose(teacher, danced.quats, when_s, mistake).astype(np.float64)
        # Hips keep the way they face: whoever does the wrong move still stands as the dance has it.
        wrong[:, 0] = multiply(_headings(danced.quats), facing_front(wrong)[:, 0])
        quats = _blended(quats, wrong, _window(seconds, mistake))

    gains = (1 - strengths.damping) * np.exp(strengths.distortion * rng.standard_normal(NUM_JOINTS))
    gains = 1 + np.minimum(SHARES / 0.4, 1) * (np.clip(gains, *GAINS) - 1)
    headings = _headings(quats)
    quats[:, 0] = facing_front(quats)[:, 0]
    quats = _resized(quats, gains)
    quats[:, 0] = multiply(headings, quats[:, 0])
    quats = multiply(quats, _noise(rng, len(quats), teacher.fps, strengths.noise_deg))

    root_m = danced.root_m.astype(np.float64)
    root_m[:, [0, 2]] = root_m[0, [0, 2]] + (1 - min(strengths.damping, 0.8)) * (root_m - root_m[0])[:, [0, 2]]
    hover_m = np.maximum(height_above_floor(danced.quats, danced.root_m), 0)
    root_m[:, 1] = hover_m - height_above_floor(quats, root_m * [1, 0, 1])
    moved = Motion(quats.astype(np.float32), root_m.astype(np.float32), teacher.fps, teacher.name, teacher.leg_m)
    return moved, mistakes


def _wander(rng: np.random.Generator, seconds: np.ndarray) -> np.ndarray:
    """(T,) smooth chance with mean 0 and standard deviation 1."""
    waves = 4
    turns = seconds[:, None] / rng.uniform(*WANDER_S, waves) + rng.random(waves)
    return np.sin(2 * np.pi * turns).sum(axis=1) * np.sqrt(2 / waves)


def _wrong_pose(teacher: Motion, quats: np.ndarray, when_s: np.ndarray, mistake: Mistake) -> np.ndarray:
    """(T, 23, 4) what a mistake of that kind shows in each frame."""
    match mistake.kind:
        case "forgotten":
            return np.broadcast_to(rotations(STANDING[None])[0], quats.shape)
        case "swapped":
            return at_times(teacher, np.clip(when_s + mistake.shift_s, 0, when_s[-1]), teacher.fps).quats
        case "mirrored":
            return mirrored(quats)
    raise AssertionError(mistake.kind)


def _window(seconds: np.ndarray, mistake: Mistake) -> np.ndarray:
    """(T,) how far the learner is in the mistake: 0 before and after, 1 in it."""
    into = np.clip((seconds - mistake.start_s) / EDGE_S, 0, 1)
    out_of = np.clip((mistake.start_s + mistake.seconds - seconds) / EDGE_S, 0, 1)
    share = np.minimum(into, out_of)
    return share * share * (3 - 2 * share)


def _headings(quats: np.ndarray) -> np.ndarray:
    """(T, 4) the turn about the vertical of the hips in (T, 23, 4)."""
    return multiply(quats[:, 0].astype(np.float64), conjugate(facing_front(quats)[:, 0].astype(np.float64)))


def _blended(quats: np.ndarray, others: np.ndarray, share: np.ndarray) -> np.ndarray:
    """From the first rotations (share 0) to the second (share 1), (T,) shares."""
    others = np.where((quats * others).sum(axis=-1, keepdims=True) < 0, -others, others)
    mixed = quats + share[:, None, None] * (others - quats)
    return mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)


def _resized(quats: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Every joint's turn away from standing made larger or smaller by its (23,) gain."""
    rest = rotations(STANDING[None]).astype(np.float64)
    away = multiply(conjugate(rest), quats)
    # A turn beyond 180 degrees must not jump to its counterpart: signs follow from frame to frame.
    away[0] *= np.where(away[0, :, :1] < 0, -1, 1)
    turns = np.sign((away[1:] * away[:-1]).sum(axis=-1, keepdims=True))
    away[1:] *= np.cumprod(np.where(turns < 0, -1, 1), axis=0)
    sine = np.linalg.norm(away[..., 1:], axis=-1, keepdims=True)
    half = gains[:, None] * np.arctan2(sine, away[..., :1])
    axis = away[..., 1:] / np.maximum(sine, 1e-9)
    return multiply(rest, np.concatenate([np.cos(half), np.sin(half) * axis], axis=-1))


def _noise(rng: np.random.Generator, frames: int, fps: float, degrees: float) -> np.ndarray:
    """(T, 23, 4) small rotations: a habit, and a slow wander around it."""
    habit = rng.standard_normal((1, NUM_JOINTS, 3))
    wander = gaussian_filter1d(rng.standard_normal((frames, NUM_JOINTS, 3)), NOISE_S * fps, axis=0, mode="wrap")
    wander *= np.sqrt(2 * np.sqrt(np.pi) * NOISE_S * fps)  # a filtered deviation is that much smaller than 1
    off = STEADY_SHARE * habit + np.sqrt(1 - STEADY_SHARE**2) * wander
    off *= np.radians(degrees) * SHARES[:, None] / np.sqrt(3)
    angle = np.linalg.norm(off, axis=-1, keepdims=True)
    axis = off / np.maximum(angle, 1e-9)
    return np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * axis], axis=-1)
