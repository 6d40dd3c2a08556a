"""Algorithm 2 on whole frames of people with known joints."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones, error_m

from kpopnet.camera import CAMERAS
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.algorithm2 import MIN_CANDIDATES, TRUNK, Frame, State, frame_of, structure_of, track_frame
from kpopnet.paper_tracker.repairs import LOST_FRAMES, WIDER
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig
from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.skeleton import NUM_JOINTS, PAPER_JOINTS, Joint

CAMERA = CAMERAS["kinect_v1"]
SOURCES = ("ridge", "depth")
PRINTED, REPAIRED = PaperTrackerConfig(), PaperTrackerConfig(repaired=True)


def seen(depth: np.ndarray, camera=CAMERA) -> Frame:
    return frame_of(depth, ridge_data(depth, RidgeConfig()), camera)


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
def person():
    joints = cone_joints(yaw_deg=8)
    return joints, draw_cones(joints, cone_body(joints), CAMERA)


@pytest.mark.parametrize("candidates", SOURCES)
def test_a_still_person_stays(person, candidates: str) -> None:
    joints, depth = person
    frame, config = seen(depth), PaperTrackerConfig(candidates)
    first, support = track(frame, joints, config=config)
    assert (support[[joint for joint in PAPER_JOINTS if joint != Joint.TORSO]] >= MIN_CANDIDATES).mean() > 0.8
    found = first
    for _ in range(10):
        found, _ = track(frame, joints, found, config=config)
    # The torso has the largest error: one depth represents belly and chest.
    error = error_m(found, joints)
    assert error.mean() < 0.05 and error.max() < 0.11
    # Converged: the remaining motion is that of candidates entering and leaving.
    again, _ = track(frame, joints, found, config=config)
    assert error_m(again, found).max() < 0.02


def test_the_search_is_centred_at_the_extrapolated_joint(person) -> None:
    """Eq. (3): a person 18 cm from the last pose is found with its velocity and not without, nor where it is switched off."""
    joints, depth = person
    frame, step = seen(depth), np.tile((0.18, 0.0, 0.0), (NUM_JOINTS, 1))
    still, _ = track(frame, joints)
    with_velocity, velocity_support = track(frame, joints, joints - step, step)
    without_velocity, support = track(frame, joints, joints - step)
    np.testing.assert_allclose(with_velocity, still, atol=1e-9)
    assert velocity_support.sum() > 1.5 * support.sum()
    assert error_m(without_velocity, joints).mean() > 0.08 > 0.05 > error_m(with_velocity, joints).mean()
    switched_off, _ = track(frame, joints, joints - step, step, config=REPAIRED)
    assert error_m(switched_off, with_velocity).max() > 0.1, "the repaired tracker has no velocity in Eq. (3)"


@pytest.mark.parametrize("candidates", SOURCES)
def test_candidates_beyond_r_are_ignored(person, candidates: str) -> None:
    """Eqs. (4) and (12)."""
    joints, depth = person
    found, support = track(seen(depth), joints, config=PaperTrackerConfig(candidates, r_m=0.06))
    known = support > 0
    known[Joint.NECK] = False
    assert known.any() and (error_m(found, joints)[known] <= 0.06 + 1e-9).all()


def test_joints_are_the_mean_of_their_valid_candidates(person) -> None:
    """Eq. (11), for the head, by numpy."""
    joints, depth = person
    frame, structure = seen(depth), structure_of(HumanModel.from_joints(joints))
    found, support = track(frame, joints)
    inside = frame.ridge_m * (1 + structure.depth_m[0] / np.linalg.norm(frame.ridge_m, axis=1))[:, None]
    near = inside[np.linalg.norm(inside - joints[Joint.HEAD], axis=1) <= 0.11]
    to_torso = np.linalg.norm(near - joints[Joint.TORSO], axis=1)
    valid = near[np.abs(to_torso - np.linalg.norm(joints[Joint.HEAD] - joints[Joint.TORSO])) <= 0.05]
    assert len(valid) == support[Joint.HEAD] >= MIN_CANDIDATES
    np.testing.assert_allclose(found[Joint.HEAD], valid.mean(0), atol=1e-9)


def without_ridge(frame: Frame, dropped: np.ndarray) -> Frame:
    return frame._replace(ridge_m=frame.ridge_m[~dropped], ridge_cell=frame.ridge_cell[~dropped])


def test_raw_depth_replaces_insufficient_ridge_data(person) -> None:
    joints, depth = person
    frame = seen(depth)
    head = np.linalg.norm(frame.ridge_m - joints[Joint.HEAD], axis=1) < 0.3
    assert head.sum() > MIN_CANDIDATES
    head[np.flatnonzero(head)[: MIN_CANDIDATES - 1]] = False  # too few are left
    by_depth, depth_support = track(frame, joints, config=PaperTrackerConfig("depth"))
    found, support = track(without_ridge(frame, head), joints)
    np.testing.assert_array_equal(found[Joint.HEAD], by_depth[Joint.HEAD])
    assert support[Joint.HEAD] == depth_support[Joint.HEAD] > MIN_CANDIDATES
    none = without_ridge(frame, np.ones(len(frame.ridge_m), bool))
    for a, b in zip(track(none, joints), (by_depth, depth_support), strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_repaired_trunk_is_taken_from_raw_depth_alone(person) -> None:
    joints, depth = person
    raw = PaperTrackerConfig("depth", repaired=True)
    found, printed, by_depth = (track(seen(depth), joints, config=config)[0] for config in (REPAIRED, PRINTED, raw))
    np.testing.assert_array_equal(found[list(TRUNK)], by_depth[list(TRUNK)])
    assert not np.array_equal(printed[list(TRUNK)], by_depth[list(TRUNK)])
    legs = [Joint.RIGHT_KNEE, Joint.LEFT_KNEE, Joint.RIGHT_FOOT, Joint.LEFT_FOOT]
    assert not np.array_equal(found[legs], by_depth[legs]), "legs stay on the ridge"


def test_an_unseen_joint_moves_with_its_parent(person) -> None:
    joints, depth = person
    depth = depth.copy()
    u, v, _ = CAMERA.project(joints[Joint.LEFT_HAND])
    depth[np.linalg.norm(CAMERA.points(depth) - joints[Joint.LEFT_HAND], axis=-1) < 0.3] = 0  # from the elbow on
    assert depth[round(v), round(u)] == 0
    before = joints - (0.03, 0, 0)
    found, support = track(seen(depth), joints, before)
    assert support[Joint.LEFT_HAND] == 0
    moved = found - before
    np.testing.assert_allclose(moved[Joint.LEFT_HAND], moved[Joint.LEFT_ELBOW], atol=1e-12)


def test_a_lost_joint_is_searched_farther_after_some_frames(person) -> None:
    joints, depth = person
    frame, config = seen(depth), REPAIRED
    before = joints.copy()
    before[Joint.LEFT_HAND] += np.array((0.0, 0.19, 0.0))  # beyond r_j and within twice r_j
    assert 0.11 + 0.05 < 0.19 < WIDER * 0.11
    for lost, settings in ((LOST_FRAMES, config), (LOST_FRAMES + 1, PRINTED)):
        assert track(frame, joints, before, lost=lost, config=settings)[1][Joint.LEFT_HAND] <= MIN_CANDIDATES
    found, support = track(frame, joints, before, lost=LOST_FRAMES + 1, config=config)
    assert support[Joint.LEFT_HAND] >= MIN_CANDIDATES
    assert error_m(found, joints)[Joint.LEFT_HAND] < 0.1


def test_frames_without_candidates_are_counted_and_stop_the_velocity(person) -> None:
    joints, depth = person
    tracker = PaperTracker(CAMERA)
    tracker.start(joints)
    state = tracker.state
    for frames in (1, 2):
        state, support = track_frame(seen(np.zeros_like(depth)), state, tracker.plan())
        assert not support.any() and (state.lost == frames).all() and not state.velocity.any()
    state, support = track_frame(seen(depth), state, tracker.plan())
    assert not state.lost[support > 0].any() and (state.lost[support == 0] == 3).all()


def test_the_points_lie_on_the_surface(person) -> None:
    _, depth = person
    ridge = ridge_data(depth, RidgeConfig())
    frame, surface_m = frame_of(depth, ridge, CAMERA), CAMERA.points(depth)
    np.testing.assert_allclose(frame.ridge_m, surface_m[ridge], atol=1e-5)
    nearest = np.linalg.norm(frame.raw_m[:, None] - surface_m[depth > 0][None], axis=-1).min(axis=1)
    assert nearest.max() < 1e-5
    # Each of the ridge data lies in its cell.
    inside = frame.ridge_cell >= 0
    assert inside.mean() > 0.95
    assert np.median(np.linalg.norm(frame.ridge_m - frame.raw_m[frame.ridge_cell], axis=1)[inside]) < 0.02
