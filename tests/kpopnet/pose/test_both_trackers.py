"""What both trackers do alike: slow people, starts, gaps, noise; inputs that are neither changed nor kept."""

import numpy as np
import pytest
from cone_people import PLACE_M, cone_body, cone_joints, draw_cones, error_m, filmed, tracked
from y_people import draw_y, y_joints

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.tracker import Tracker

CAMERA = CAMERAS["kinect_v1"]
EMPTY = np.zeros((CAMERA.height, CAMERA.width), np.float32)
REPAIRED = PaperTrackerConfig(repaired=True)
MAKERS = {
    "body": lambda model=None: Tracker(CAMERA, "y_pose", model),
    "printed": lambda model=None: PaperTracker(CAMERA, PaperTrackerConfig(), model),
    "repaired": lambda model=None: PaperTracker(CAMERA, REPAIRED, model),
}
each = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)


@pytest.fixture(scope="module")
def dancer():
    """(8, 15, 3) joints and depth of a person who slowly lowers the arms and turns."""
    joints = np.stack([cone_joints(40 - 2 * t, 12, 3 * t) for t in range(8)])
    return joints, filmed(joints, CAMERA)


@each
def test_a_slow_person_is_tracked_and_nothing_is_shared(dancer, make) -> None:
    joints, depth = dancer
    found, confidence = tracked(make(), depth, joints[0])
    if make is not MAKERS["printed"]:  # which drifts (docs/paper.md)
        assert (error_m(found, joints) < 0.1).mean() > 0.85
    assert confidence.shape == (8, NUM_JOINTS) and ((confidence > 0) & (confidence < 1)).all()
    tracker, start, images = make(), joints[0].copy(), depth.copy()
    tracker.start(start)
    for image, expected in zip(images, found, strict=True):
        pose, confidence = tracker.track(image)
        np.testing.assert_array_equal(pose, expected)
        start[:] = pose[:] = confidence[:] = image[:] = 0


@each
def test_it_waits_for_the_y_pose_and_measures_the_model_unless_one_is_given(make) -> None:
    joints, standing, tracker = y_joints(place_m=PLACE_M), cone_joints(-75, 4), make()
    for image in (EMPTY, draw_cones(standing, cone_body(standing), CAMERA)):
        pose, confidence = tracker.track(image)
        assert np.isnan(pose).all() and not confidence.any() and not tracker.started
    depth = draw_y(joints, CAMERA)
    pose, confidence = tracker.track(depth)
    assert tracker.started and error_m(pose, joints).mean() < (0.1 if make is MAKERS["printed"] else 0.06)
    assert tracker.model.left_upper_arm_m == pytest.approx(0.27, abs=0.06)
    known = HumanModel.from_joints(joints)
    given = make(known)
    given.track(depth)
    assert given.started and given.model is known


@each
def test_empty_frames_have_no_joints(dancer, make) -> None:
    joints, depth = dancer
    speck = EMPTY.copy()
    speck[100, 150] = 2.5
    found, confidence = tracked(make(), np.stack([EMPTY, depth[0], EMPTY, speck, depth[1]]), joints[0])
    assert np.isnan(found[[0, 2, 3]]).all() and not confidence[[0, 2, 3]].any() and np.isfinite(found[[1, 4]]).all()


@each
def test_noise_is_no_error(dancer, make) -> None:
    joints, depth = dancer
    rng = np.random.default_rng(9)
    garbage = rng.integers(0, 2**16, (2, *EMPTY.shape)).astype(np.float32) / 1000
    sparse = np.where(rng.random(EMPTY.shape) < 0.01, garbage[0], 0)
    sequence = np.stack([depth[0], *garbage, sparse, np.full_like(EMPTY, 65.535), np.full_like(EMPTY, 0.02)])
    found, confidence = tracked(make(), sequence, joints[0])
    assert np.isfinite(found).all() and (confidence >= 0).all() and (confidence <= 1).all()


@each
def test_incomplete_start_poses_are_refused(make) -> None:
    joints = cone_joints()
    joints[[Joint.NECK, Joint.LEFT_HAND]] = np.nan
    with pytest.raises(InputError, match="a pose with all joints; missing joints: neck, left_hand"):
        make().start(joints)
    with pytest.raises(InputError, match=r"\(15, 3\)"):
        make().start(joints[:3])
