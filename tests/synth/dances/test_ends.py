"""The ends of the scale: what a perfect learner and those who do not dance score on true joints."""

import numpy as np
import pytest

from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from synth.dances.ends import ENDS, end_motion
from synth.dances.simulate import KpopSim, KpopSimConfig
from synth.motion.skeleton import height_above_floor

MAKER = KpopSim(KpopSimConfig(seed=11, dances=1, split="train", faults="ends"), seconds=(4.0, 5.0))


@pytest.mark.parametrize("index", [0, 1])
def test_a_perfect_learner_scores_100_and_who_does_not_dance_next_to_nothing(index):
    teacher, person = MAKER.teacher_motion(index), MAKER._person(MAKER._rng("teacher", index))
    taught_m = MAKER.teacher_joints_m(index)
    scores = {}
    for end in ENDS:
        motion = end_motion(end, teacher, MAKER.teacher_motion(index + 50), np.random.default_rng(index))
        assert len(motion) == len(teacher)
        joints_m = MAKER.level_camera_joints_m(person, motion)
        dances = (Performance(one, np.arange(len(one)) / teacher.fps) for one in (taught_m, joints_m))
        scores[end] = score_dance(*dances).similarity
    assert scores.pop("perfect") > 99.9
    assert max(scores.values()) < 20, scores


def test_who_stands_and_waves_stands_on_the_floor():
    assert MAKER.level_names == ENDS
    teacher = MAKER.teacher_motion(0)
    for end in ("waving", "standing still"):
        motion = end_motion(end, teacher, teacher, np.random.default_rng(0))
        assert np.abs(height_above_floor(motion.quats, motion.root_m)).max() < 1e-4
        assert (np.ptp(motion.quats, axis=0).max() > 0.3) == (end == "waving")
