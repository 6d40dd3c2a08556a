"""Calibrates the difficulty of `kpop_sim` with the baseline feature [17], without use of the paper's own feature.

    python -m synth.dances.calibrate                 the spacing of the levels at which [17] orders 86 of 100 dances
    python -m synth.dances.calibrate --seed 2        on other dances
    python -m synth.dances.calibrate --faults mixed --clips PACK    recorded dances, the second family of faults

In the paper the feature of [17] orders 86 of 100 K-Pop dances as the experts do. The spacing of the levels is chosen so that
it does the same here, on true joints of dances and people of the split `train`, never the benchmark's. A dance is in order if
strictly S1 > S2 > S3 > S4.
"""

import argparse
from dataclasses import replace
from functools import partial

import numpy as np
from tqdm import tqdm

from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.runtime.cpu import available_cores
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.runtime.parallel import in_processes
from synth.dances.simulate import DANCES, LEARNERS, KpopSim, KpopSimConfig, KpopSimSet
from synth.dances.skill import SkillConfig
from synth.dances.writer import times_s
from synth.motion import MotionConfig
from synth.samples.sampler import body_rotations

TARGET_FRACTION = 0.86
SPACINGS = {"skill": (0.4, 0.5, 0.6, 0.7, 0.85), "mixed": (0.2, 0.3, 0.4, 0.5, 0.65)}
"""By the family of faults."""

SCORER = "raptis"


def orders(index: int, config: KpopSimSet) -> list[bool]:
    """Whether the scores by [17] order the four learners of a dance by level, at each of SPACINGS.

    The learners and their positions are drawn once, at the set's own spacing, and reused at the other spacings. Their feet are
    not moved to the floor; the scores do not depend on that.

    Args:
        index: of the dance.
        config: of the dances.
    """
    maker, spacings = KpopSim(config), SPACINGS[config.benchmark.faults]
    makers = [KpopSim(replace(config, skill=SkillConfig(spacing=spacing))) for spacing in spacings]
    asset = maker.studio.scene.asset
    teacher = _performance(maker.teacher_joints_m(index))
    similarity = np.empty((len(spacings), len(LEARNERS)))
    for learner, level in enumerate(maker.levels(index)):
        planned = maker.take(index, learner)
        person, view, place_m = planned.take.played.person, planned.take.view, planned.take.place_m
        yaw_rad = planned.yaw_rad - np.arctan2(place_m[0], place_m[1])
        for number, other in enumerate(makers):
            _, _, motion, _ = other.skill(index, learner)
            local = body_rotations(asset, motion.quats, yaw_rad, np.zeros(2))
            joints_world_m = maker.studio.joints_world_m(person, local, np.broadcast_to(place_m, (len(local), 3)))
            performance = _performance(view.to_camera(joints_world_m))
            similarity[number, level] = score_dance(teacher, performance, SCORERS[SCORER]).similarity
    return (np.diff(similarity) < 0).all(axis=1).tolist()


def _performance(joints_m: np.ndarray) -> Performance:
    return Performance(joints_m, times_s(len(joints_m)))


def smallest_spacing(target: float, spacings: np.ndarray, fractions: np.ndarray) -> float:
    """The smallest spacing at which the target fraction of ordered dances is reached, by linear interpolation.

    The fraction does not approach 1: learners who do not face the camera stay in the wrong order at any spacing.

    Args:
        target: fraction of ordered dances.
        spacings: (N,) increasing.
        fractions: (N,) fraction of ordered dances at each spacing.

    Returns:
        The spacing; NaN if the target is not reached.
    """
    reached = np.flatnonzero(fractions >= target)
    if not len(reached):
        return float("nan")
    after = int(reached[0])
    before = max(after - 1, 0)
    return float(np.interp(target, fractions[[before, after]], spacings[[before, after]]))


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="seed of the dances")
    parser.add_argument("--faults", choices=SPACINGS, default="skill", help="family of the learners' faults: %(default)s")
    parser.add_argument("--clips", help="motion pack of recorded dances; by default dances are composed")
    parser.add_argument("--dances", type=int, default=DANCES)
    parser.add_argument("--processes", type=int, default=0, help="0 for all cores")
    given = parser.parse_args()
    motion = MotionConfig(source="clips", path=given.clips) if given.clips else MotionConfig(source="choreography")
    benchmark = KpopSimConfig(seed=given.seed, split="train", dances=given.dances, faults=given.faults)
    work = partial(orders, config=KpopSimSet(benchmark, motion=motion))
    spacings = SPACINGS[given.faults]
    counts = np.zeros(len(spacings), int)
    results = in_processes(work, list(range(given.dances)), given.processes or available_cores())
    for _, ordered in tqdm(results, "dances", given.dances):
        counts += ordered
    for spacing, count in zip(spacings, counts, strict=True):
        print(f"skill.spacing={spacing:.2f}: {SCORER} orders {count} of {given.dances}")
    chosen = smallest_spacing(TARGET_FRACTION, np.array(spacings), counts / given.dances)
    print(f"{100 * TARGET_FRACTION:.0f} of 100: skill.spacing={chosen:.3f}")


if __name__ == "__main__":
    main()
