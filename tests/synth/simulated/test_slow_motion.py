"""tools/slow_motion.py: the same dance at the same place, four times as long."""

import importlib.util

import numpy as np
import pytest
from programs import ROOT

from synth.simulated.eval_sim import EvalSim, EvalSimConfig

SPEC = importlib.util.spec_from_file_location("slow_motion", ROOT / "tools" / "slow_motion.py")
slow_motion = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(slow_motion)


@pytest.fixture(scope="module")
def takes():
    maker = slow_motion.SlowEvalSim(EvalSimConfig(seed=11), frames=(60, 60), times=4, filmed=90)
    return EvalSim.take(maker, 0), maker.take(0)


def test_every_fourth_frame_is_one_of_the_dance(takes) -> None:
    usual, slow = takes
    assert len(usual.played) == 60 and len(slow.played) == 90, "cut after the frames that are filmed"
    np.testing.assert_allclose(slow.played.hips_m[::4], usual.played.hips_m[:23], atol=1e-9)
    same = (slow.played.local[::4] * usual.played.local[:23]).sum(axis=-1)
    np.testing.assert_allclose(np.abs(same), 1, atol=1e-6)
    np.testing.assert_array_equal(slow.place_m, usual.place_m)
