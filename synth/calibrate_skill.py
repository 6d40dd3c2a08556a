"""Sets the difficulty of `kpop_sim`, before anybody looks at what the paper's own feature makes of it.

    python -m synth.calibrate_skill                 the spacing of the levels at which [17] orders 86 of 100 dances
    python -m synth.calibrate_skill --seed 2        on other dances

In the paper the feature of [17] orders 86 of 100 K-Pop dances as the experts do. So is the stand-in made: on dances and
people of the split `train`, never the benchmark's, true joints, strictly S1 > S2 > S3 > S4.
"""

import argparse
from dataclasses import replace
from functools import partial

import numpy as np
from tqdm import tqdm

from kpopnet.benchmarks.spread import spread
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.entry import user_errors
from kpopnet.machine import cores_at_hand
from synth.kpop_files import times_s
from synth.kpop_sim import DANCES, LEARNERS, KpopSim, KpopSimConfig, KpopSimSet
from synth.sample import on_body
from synth.skill import SkillConfig

WANTED = 0.86
SPACINGS = (0.4, 0.5, 0.6, 0.7, 0.85)
SCORER = "raptis"


def orders(index: int, seed: int) -> list[bool]:
    """Whether [17] orders the four learners of a dance as their levels are, at each of SPACINGS.

    Who they are and where they stand is drawn once, at the set's own spacing; the feet need not be put on the floor for that.
    """
    config = KpopSimSet(KpopSimConfig(seed=seed, split="train"))
    maker = KpopSim(config)
    skilled = [KpopSim(replace(config, skill=SkillConfig(spacing=spacing))) for spacing in SPACINGS]
    scene = maker.studio.scene
    teacher = _performance(maker.teacher_joints_m(index))
    similarity = np.empty((len(SPACINGS), len(LEARNERS)))
    for learner, level in enumerate(maker.levels(index)):
        planned = maker.take(index, learner)
        person, view, place_m = planned.take.played.person, planned.take.view, planned.take.place_m
        scene.dress(scene.fit(person))
        yaw_rad = planned.yaw_rad - np.arctan2(place_m[0], place_m[1])
        for number, other in enumerate(skilled):
            _, _, motion, _ = other.skill(index, learner)
            joints = []
            for local in on_body(scene.asset, motion.quats, yaw_rad, np.zeros(2)):
                scene.pose(local, place_m)
                joints.append(scene.joints_world_m())
            learnt = _performance(view.to_camera(np.array(joints)))
            similarity[number, level] = score_dance(teacher, learnt, SCORERS[SCORER]).similarity
    return (np.diff(similarity) < 0).all(axis=1).tolist()


def _performance(joints_m: np.ndarray) -> Performance:
    return Performance(joints_m, times_s(len(joints_m)))


def spacing_of(share: float, spacings: np.ndarray, shares: np.ndarray) -> float:
    """The least spacing at which that share is reached, linearly between (N,) growing spacings; NaN where it is not.

    The share does not grow to 1: learners who stand askew stay wrong however far apart the levels are.
    """
    reached = np.flatnonzero(shares >= share)
    if not len(reached):
        return float("nan")
    after = int(reached[0])
    before = max(after - 1, 0)
    return float(np.interp(share, shares[[before, after]], spacings[[before, after]]))


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="of the calibration's dances")
    parser.add_argument("--dances", type=int, default=DANCES)
    parser.add_argument("--processes", type=int, default=0, help="0 takes every core")
    given = parser.parse_args()
    counts = np.zeros(len(SPACINGS), int)
    work = partial(orders, seed=given.seed)
    found = spread(work, list(range(given.dances)), given.processes or cores_at_hand())
    for _, ordered in tqdm(found, "dances", given.dances):
        counts += ordered
    for spacing, count in zip(SPACINGS, counts, strict=True):
        print(f"skill.spacing={spacing:.2f}: {SCORER} orders {count} of {given.dances}")
    chosen = spacing_of(WANTED, np.array(SPACINGS), counts / given.dances)
    print(f"{100 * WANTED:.0f} of 100: skill.spacing={chosen:.3f}")


if __name__ == "__main__":
    main()
