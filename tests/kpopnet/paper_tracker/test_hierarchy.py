"""Algorithm 2 on whole frames of people with known joints."""

import itertools

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones, error_m

from kpopnet.camera import CAMERAS
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.algorithm2 import TRUNK, Frame, State, track_frame
from kpopnet.paper_tracker.repairs import LOST_FRAMES, SUFFICIENT, WIDER
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig, on_surface
from kpopnet.skeleton import NUM_JOINTS, Joint

CAMERA = CAMERAS["kinect_v1"]
PRINTED, REPAIRED = PaperTrackerConfig(), PaperTrackerConfig(repaired=True)


def seen(depth: np.ndarray, config=PRINTED) -> Frame:
    return PaperTracker(CAMERA, config).frame(depth)


def track(frame: Frame, model_joints: np.ndarray, previous=None, velocity=None, lost=0, config=PRINTED):
    """(15, 3) joints and (15,) support after one frame."""
    previous = model_joints if previous is None else previous
    velocity = np.zeros((NUM_JOINTS, 3)) if velocity is None else velocity
    tracker = PaperTracker(CAMERA, config, HumanModel.from_joints(model_joints))
    tracker.start(previous)
    tracker.state = State(previous, velocity, np.full(NUM_JOINTS, lost))
    state, support = track_frame(frame, tracker.state, tracker.plan())
    return state.joints, support


@pytest.fixture(scope="module")
def inside():
    """True joints, and the depth of a person."""
    joints = cone_joints(yaw_deg=8)
    return joints, draw_cones(joints, cone_body(joints), CAMERA)


@pytest.fixture(scope="module")
def person(inside):
    """The same with the joints on the surface, where the printed ones lie."""
    return on_surface(*inside, CAMERA), inside[1]


def test_the_steps_lead_away_from_people_who_do_not_move_unless_repaired() -> None:
    """The paper's tracker drifts in one and the same picture (docs/paper.md)."""
    within = {PRINTED: [], REPAIRED: []}
    for yaw_deg, config in itertools.product((-20, -8, 8), within):
        joints = cone_joints(40, yaw_deg=yaw_deg)
        depth = draw_cones(joints, cone_body(joints), CAMERA)
        tracker = PaperTracker(CAMERA, config)
        tracker.start(joints)
        for _ in range(30):
            found, _ = tracker.track(depth)
        within[config].append((error_m(found, joints if config.repaired else on_surface(joints, depth, CAMERA)) < 0.1).mean())
    assert min(within[REPAIRED]) > 0.9 and np.mean(within[PRINTED]) < 0.8


def test_the_search_is_centred_at_the_extrapolated_joint(person) -> None:
    """Eq. (3): a person 18 cm from the last pose is found with its velocity and not without; repaired, there is none."""
    joints, depth = person
    frame, step = seen(depth), np.tile((0.18, 0.0, 0.0), (NUM_JOINTS, 1))
    still, _ = track(frame, joints)
    with_velocity, velocity_support = track(frame, joints, joints - step, step)
    without_velocity, support = track(frame, joints, joints - step)
    np.testing.assert_allclose(with_velocity, still, atol=1e-9)
    assert velocity_support.sum() > 1.5 * support.sum()
    assert error_m(without_velocity, joints).mean() > 0.08 > 0.05 > error_m(with_velocity, joints).mean()
    repaired = [track(seen(depth, REPAIRED), joints, joints - step, step * moving, config=REPAIRED)[0] for moving in (0, 1)]
    np.testing.assert_array_equal(*repaired)


@pytest.mark.parametrize("candidates", ["ridge", "depth"])
@pytest.mark.parametrize("r_m", [0.06, 0.11])
def test_joints_are_the_mean_of_their_valid_candidates(person, candidates: str, r_m: float) -> None:
    """Eqs. (4), (11) and (12), for the head, by numpy."""
    joints, depth = person
    frame = seen(depth)
    found, support = track(frame, joints, config=PaperTrackerConfig(candidates, r_m))
    points = frame.ridge_m if candidates == "ridge" else frame.raw_m
    near = points[np.linalg.norm(points - joints[Joint.HEAD], axis=1) <= r_m]
    to_torso = np.linalg.norm(near - joints[Joint.TORSO], axis=1)
    valid = near[np.abs(to_torso - np.linalg.norm(joints[Joint.HEAD] - joints[Joint.TORSO])) <= 0.05]
    assert len(valid) == support[Joint.HEAD] > 0
    np.testing.assert_allclose(found[Joint.HEAD], valid.mean(0), atol=1e-9)


def without_ridge(frame: Frame, dropped: np.ndarray) -> Frame:
    return frame._replace(ridge_m=frame.ridge_m[~dropped], ridge_cell=frame.ridge_cell[~dropped])


def test_raw_depth_replaces_insufficient_ridge_data(person) -> None:
    joints, depth = person
    frame, config = seen(depth), PaperTrackerConfig(sufficient=4)
    head = np.linalg.norm(frame.ridge_m - joints[Joint.HEAD], axis=1) < 0.3
    assert head.sum() > 4
    head[np.flatnonzero(head)[:3]] = False  # too few are left
    by_depth, depth_support = track(frame, joints, config=PaperTrackerConfig("depth", sufficient=4))
    found, support = track(without_ridge(frame, head), joints, config=config)
    np.testing.assert_array_equal(found[Joint.HEAD], by_depth[Joint.HEAD])
    assert support[Joint.HEAD] == depth_support[Joint.HEAD] > 4
    none = without_ridge(frame, np.ones(len(frame.ridge_m), bool))
    for a, b in zip(track(none, joints, config=config), (by_depth, depth_support), strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_repaired_trunk_is_taken_from_raw_depth_alone(inside) -> None:
    joints, depth = inside
    raw = PaperTrackerConfig("depth", repaired=True)
    found, by_depth = (track(seen(depth, config), joints, config=config)[0] for config in (REPAIRED, raw))
    np.testing.assert_array_equal(found[list(TRUNK)], by_depth[list(TRUNK)])
    legs = [Joint.RIGHT_KNEE, Joint.LEFT_KNEE, Joint.RIGHT_FOOT, Joint.LEFT_FOOT]
    assert not np.array_equal(found[legs], by_depth[legs]), "legs stay on the ridge"


def test_a_joint_without_candidates_is_where_the_setting_says(inside) -> None:
    """Beyond the paper, which does not say; repaired, it moves with its parent."""
    joints, depth = inside
    depth = depth.copy()
    u, v, _ = CAMERA.project(joints[Joint.LEFT_HAND])
    depth[np.linalg.norm(CAMERA.points(depth) - joints[Joint.LEFT_HAND], axis=-1) < 0.3] = 0  # from the elbow on
    assert depth[round(v), round(u)] == 0
    before, step = joints - (0.03, 0, 0), np.tile((0.01, 0.0, 0.0), (NUM_JOINTS, 1))
    for config in (*(PaperTrackerConfig(lost=lost) for lost in ("predicted", "stays", "carried")), REPAIRED):
        found, support = track(seen(depth, config), joints, before, step, config=config)
        assert support[Joint.LEFT_HAND] == 0
        moved = found - before
        lost = "carried" if config.repaired else config.lost
        expected = {"predicted": step[0], "stays": np.zeros(3), "carried": moved[Joint.LEFT_ELBOW]}[lost]
        np.testing.assert_allclose(moved[Joint.LEFT_HAND], expected, atol=1e-12)


def test_a_lost_joint_is_searched_farther_after_some_frames(inside) -> None:
    joints, depth = inside
    frame = seen(depth, REPAIRED)
    before = joints.copy()
    before[Joint.LEFT_HAND] += np.array((0.0, 0.19, 0.0))  # beyond r_j and within twice r_j
    assert 0.11 + 0.05 < 0.19 < WIDER * 0.11
    assert track(frame, joints, before, lost=LOST_FRAMES, config=REPAIRED)[1][Joint.LEFT_HAND] <= SUFFICIENT
    found, support = track(frame, joints, before, lost=LOST_FRAMES + 1, config=REPAIRED)
    assert support[Joint.LEFT_HAND] >= SUFFICIENT
    assert error_m(found, joints)[Joint.LEFT_HAND] < 0.1


def test_a_given_pose_is_moved_to_the_surface_as_printed(inside) -> None:
    joints, depth = inside
    tracker, surface_m = PaperTracker(CAMERA), on_surface(*inside, CAMERA)
    tracker.start(joints)
    tracker.track(depth)
    assert tracker.model == HumanModel.from_joints(surface_m)
    before_m = np.linalg.norm(joints, axis=1) - np.linalg.norm(surface_m, axis=1)
    assert (before_m >= 0).all() and 0.04 < before_m[Joint.HEAD] < 0.2
    np.testing.assert_allclose(np.cross(joints, surface_m), 0, atol=1e-9)  # along the rays
    known = PaperTracker(CAMERA, PRINTED, HumanModel.from_joints(joints))
    known.start(joints)
    known.track(depth)
    assert known.model == HumanModel.from_joints(joints)
