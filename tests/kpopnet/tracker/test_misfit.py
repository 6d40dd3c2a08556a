"""What a pose pays for: people of round cones, whose truth is known, and bodies that no one has."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints
from fitted_people import moved, person  # noqa: F401
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.skeleton import MIRROR, Joint
from kpopnet.tracker.body import BARRED, BARRED_OF, LIMB_PARTS, LIMBS, PARTS
from kpopnet.tracker.cones import axes_of, extend, frame_of
from kpopnet.tracker.misfit import HABIT_WEIGHT, HABITS, HABITS_OF, misfit, overlap, unusual


def test_the_truth_fits_best(person) -> None:  # noqa: F811
    joints, body, cells = person
    least = misfit(joints, cells, body)
    assert least < 2e-4
    for seed in range(20):
        assert misfit(moved(joints, seed), cells, body) > least
        assert misfit(moved(joints, seed, 0.1, 0.2), cells, body) > 3 * least
    # One limb in a wrong place is enough.
    for _, _, end in LIMBS:
        for way in np.eye(3):
            wrong = joints.copy()
            wrong[end] += 0.15 * way
            assert misfit(wrong, cells, body) > least


def test_a_body_before_what_was_measured_or_outside_of_it_does_not_fit(person) -> None:  # noqa: F811
    joints, body, cells = person
    for way in ((0, 0, -0.3), (0.4, 0, 0), (0, 0, 0.5)):
        assert misfit(joints + way, cells, body) > 10 * misfit(joints, cells, body)


def strange(joints: np.ndarray) -> float:
    """What all habits cost."""
    return unusual(joints, frame_of(joints)[2], 0, len(HABITS))


def facing(knees_m: float, head_m: float, thighs_m: float = 0.0, hands_m: float = 0.0) -> np.ndarray:
    """Standing, facing the camera, with knees, head, thighs and hands so far in front (to smaller z)."""
    joints = cone_joints(spread_deg=0, elevation_deg=-60)
    for side in ("RIGHT", "LEFT"):
        hip, knee, foot = (Joint[f"{side}_{joint}"] for joint in ("HIP", "KNEE", "FOOT"))
        joints[knee, :2] = (joints[hip] + joints[foot])[:2] / 2
        joints[knee, 2] = joints[hip, 2] - thighs_m
        joints[foot, 2] = 2 * (joints[knee, 2] + knees_m) - joints[hip, 2]
        joints[Joint[f"{side}_HAND"], 2] = joints[Joint[f"{side}_SHOULDER"], 2] - hands_m
    joints[Joint.HEAD, 2] = joints[Joint.NECK, 2] - head_m
    return joints


@given(st.floats(0, 0.2), st.floats(0.04, 0.1), st.floats(0, 0.3), st.floats(0, 0.4), st.floats(-np.pi, np.pi))
@settings(deadline=None)
def test_what_bodies_do_costs_nothing_wherever_they_face(knees, head, thighs, hands, yaw) -> None:
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    assert strange(facing(knees, head, thighs, hands) @ turn.T) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("joints", "joint", "short_m", "both"),
    [
        (facing(-0.1, 0.05, thighs_m=0.1), Joint.RIGHT_KNEE, 0.1, True),
        (facing(0.0, -0.02), Joint.HEAD, 0.06, False),
        (facing(0.05, 0.05, thighs_m=0.05, hands_m=-0.2), Joint.RIGHT_HAND, 0.2, True),
    ],
)
def test_what_bodies_do_not_do_costs_its_square(joints, joint: Joint, short_m: float, both: bool) -> None:
    weight = HABIT_WEIGHT[np.flatnonzero(HABITS[:, 0] == joint)[0]]
    assert strange(joints) == pytest.approx((2 if both else 1) * weight * short_m**2, rel=0.05)


def test_somebody_who_is_taken_for_their_own_back_is_unusual() -> None:
    assert strange(facing(0.1, 0.06, 0.1, 0.2)) < 1e-9 < 1e-4 < strange(facing(0.1, 0.06, 0.1, 0.2)[MIRROR])


def test_limbs_may_not_lie_in_the_trunk() -> None:
    for elevation_deg in (-75, 0, 60):
        joints = cone_joints(elevation_deg=elevation_deg)
        body = cone_body(joints)
        assert overlap(axes_of(extend(joints, body.places_m), PARTS, body.radii_m), 0, len(BARRED), np.inf) < 1e-6
        folded = joints.copy()
        folded[Joint.LEFT_HAND] = joints[Joint.TORSO]
        axes = axes_of(extend(folded, body.places_m), PARTS, body.radii_m)
        everywhere = overlap(axes, 0, len(BARRED), np.inf)
        assert everywhere > 1e-4
        assert overlap(axes, *BARRED_OF[1], np.inf) == pytest.approx(everywhere) and overlap(axes, *BARRED_OF[0], np.inf) < 1e-6


def test_every_limb_has_its_habits_and_bars() -> None:
    for limb, (first, last) in enumerate(HABITS_OF):
        assert set(HABITS[first:last].ravel()) <= set(LIMBS[limb]) and last > first
    assert HABITS[HABITS_OF[-1, 1] :, 0].tolist() == [Joint.HEAD]
    assert BARRED_OF[0, 0] == 0 and BARRED_OF[-1, 1] == len(BARRED) and (BARRED_OF[1:, 0] == BARRED_OF[:-1, 1]).all()
    for limb, (first, last) in enumerate(BARRED_OF):
        assert (BARRED[first:last, 0] == LIMB_PARTS[limb, 1]).all()
        assert not (PARTS[BARRED[first:last, 1]] == LIMBS[limb, 0]).any()
