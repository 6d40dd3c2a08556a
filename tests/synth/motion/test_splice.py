"""Resampling, easing and joining motions, and the motions of the simulated benchmarks."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.rotations import about, multiply, rotate
from synth.motion.choreography.composer import dance
from synth.motion.choreography.programmes import FEATURES, show
from synth.motion.posture import angles, rotations
from synth.motion.skeleton import INDEX, LEG_M, Motion, forward_kinematics, height_above_floor
from synth.motion.splice import cut, eased, follow, heading, planted, resampled, turned_to_front

FPS = 30.0


def points(motion: Motion) -> np.ndarray:
    return forward_kinematics(motion.quats, motion.root_m)[0]


def speeds(motion: Motion) -> np.ndarray:
    """(T - 1,) speed of the fastest point, metres per second."""
    return np.linalg.norm(np.diff(points(motion), axis=0), axis=-1).max(axis=1) * motion.fps


def turning(seconds: float, fps: float) -> Motion:
    """The T-pose turning to the left at a constant 0.5 rad/s and translating along +Z."""
    times = np.arange(round(seconds * fps) + 1) / fps
    quats = np.zeros((len(times), 23, 4))
    quats[..., 0] = 1
    quats[:, 0] = about(1, 0.5 * times)
    root_m = np.stack([0 * times, 0.95 + 0 * times, 0.3 * times], axis=1)
    return Motion(quats.astype(np.float32), root_m.astype(np.float32), fps, "turning", LEG_M)


def test_resampling_keeps_the_pose_at_every_time():
    for source, wanted in ((60.0, 30.0), (25.0, 30.0)):
        found, expected = resampled(turning(2.0, source), wanted), turning(2.0, wanted)
        assert abs(len(found) - len(expected)) <= 1 and found.fps == wanted
        np.testing.assert_allclose(points(found)[:60], points(expected)[:60], atol=1e-4)


@settings(max_examples=12, deadline=None)
@given(one=st.integers(0, 500), other=st.integers(0, 500), start=st.integers(0, 100), stop=st.integers(120, 200))
def test_one_motion_follows_another_continuously(one, other, start, stop):
    first = cut(dance(one, 71, 8.0), 0, stop)
    second = cut(dance(other, 72, 8.0), start, 240)
    turned = multiply(about(1, np.array(1.3)), second.quats[:, 0].astype(np.float64)).astype(np.float32)
    second = Motion(
        np.concatenate([turned[:, None], second.quats[:, 1:]], axis=1), second.root_m + np.array([3, 0, 1]), FPS, "", LEG_M
    )
    joined = follow(first, second)
    end = len(eased(first, at_end=True)) - 1
    np.testing.assert_allclose(points(joined)[end], points(first)[-1], atol=0.02)
    fastest = max(speeds(first).max(), speeds(second).max())
    assert speeds(joined)[end - 1 : end + 1].max() < 0.1 * fastest + 0.05  # at rest in the seam
    # Hips, spine, shoulder and elbow may each rotate at up to 5 rad/s in the transition. A discontinuity would give about
    # 30 m/s.
    assert speeds(joined).max() < fastest + 8.0
    # After the transition it is the second motion, rotated and translated rigidly.
    tail, own = points(joined)[-1], points(second)[-1]
    between = np.linalg.norm(tail[:, None] - tail, axis=-1) - np.linalg.norm(own[:, None] - own, axis=-1)
    assert np.abs(between).max() < 1e-3
    assert abs(joined.root_m[-1, 1] - second.root_m[-1, 1]) < 1e-3


def test_the_second_motion_continues_in_the_last_heading_of_the_first():
    joined = follow(turning(2.0, FPS), turning(4.0, FPS))
    angle = 2 * np.arctan2(*heading(joined.quats[-1, 0].astype(float))[[2, 0]])
    assert angle == pytest.approx(1.0 + 2.0, abs=0.02)
    # The second motion translates in its initial heading, one radian to the left.
    seam = len(eased(turning(2.0, FPS), at_end=True)) - 1
    displacement = joined.root_m[-1] - joined.root_m[seam]
    np.testing.assert_allclose(displacement, 1.2 * np.array([np.sin(1.0), 0, np.cos(1.0)]), atol=0.02)


def test_a_motion_is_turned_to_the_front_as_a_rigid_body():
    motion = turning(2.0, FPS)  # by one radian to the left
    front = turned_to_front(motion)
    np.testing.assert_allclose(points(front), rotate(about(1, np.array(-0.5)), points(motion)), atol=1e-4)
    # From 135 degrees through the back to -135: the mean is the back.
    quats = motion.quats.copy()
    quats[:, 0] = about(1, np.radians(np.linspace(135, 225, len(motion))))
    front = turned_to_front(replace(motion, quats=quats))
    expected = about(1, np.radians(np.linspace(-45, 45, len(motion))))
    np.testing.assert_allclose(np.abs((front.quats[:, 0] * expected).sum(axis=1)), 1, atol=1e-6)  # q and -q are the same


@pytest.mark.parametrize("kind", [*FEATURES, "dance", "mixture", "handstand"])
def test_a_show_is_long_enough_with_plausible_speeds(kind):
    motion = show(np.random.default_rng(5), kind, 9.0, FPS)
    assert len(motion) >= 9.0 * FPS
    assert speeds(motion).max() < 16.0  # finger tips and toes
    assert height_above_floor(motion.quats, motion.root_m).min() > -0.02


def test_the_steps_of_a_motion_of_longer_legs_are_shortened():
    first, second = turning(2.0, FPS), turning(4.0, FPS)
    taller = replace(second, root_m=1.5 * second.root_m, leg_m=1.5 * second.leg_m)
    np.testing.assert_allclose(follow(first, taller).root_m, follow(first, second).root_m, atol=1e-5)


def test_who_dances_backwards_retraces_the_steps():
    quats = dance(3, 71, 4.0).quats.astype(np.float64)
    forwards, backwards = (planted(one, FPS, "", LEG_M).root_m for one in (quats, quats[::-1]))
    np.testing.assert_allclose(backwards - backwards[-1], (forwards - forwards[0])[::-1], atol=1e-5)


def test_a_motion_is_eased_into_rest_evenly():
    for motion, seam in ((eased(turning(2.0, FPS), at_end=True), -1), (eased(turning(2.0, FPS), at_start=True), 0)):
        assert len(motion) == 61 + 6
        slow, rest = np.split(np.diff(motion.root_m[:, 2])[:: -1 if seam else 1] * FPS, [12])
        np.testing.assert_allclose(slow, 0.3 * (np.arange(12) + 0.5) / 12, atol=1e-4)
        np.testing.assert_allclose(rest, 0.3, atol=1e-4)


def test_a_foot_on_the_floor_stays_where_it_is_while_the_other_swings():
    flex = np.linspace(35, 80, 31)
    quats = rotations(np.array([angles(left_flex=one, left_knee=0.5 * one) for one in flex])).astype(np.float64)
    foot = points(planted(quats, FPS, "", LEG_M))[:, INDEX["RightToeBase"]]
    assert np.linalg.norm(foot - foot[0], axis=1).max() < 0.01
