"""The paper's tracker over sequences: start, slow motion, gaps, noise, settings; and as an estimator."""

import numpy as np
import pytest
from cone_people import PLACE_M, cone_body, cone_joints, draw_cones
from y_people import draw_y, y_joints

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig, PaperTrackerEstimator
from kpopnet.skeleton import NUM_JOINTS, Joint
from synth.simulated.eval_sim import EvalSim, EvalSimConfig

CAMERA = CAMERAS["kinect_v1"]
EMPTY = np.zeros((CAMERA.height, CAMERA.width), np.float32)
PRINTED, REPAIRED = PaperTrackerConfig(), PaperTrackerConfig(repaired=True)
BOTH = pytest.mark.parametrize("config", [PRINTED, REPAIRED], ids=["printed", "repaired"])


def tracked(depth: np.ndarray, start: np.ndarray | None, config=PRINTED, camera=CAMERA) -> tuple[np.ndarray, np.ndarray]:
    """(T, 15, 3) joints and (T, 15) confidences."""
    tracker = PaperTracker(camera, config)
    if start is not None:
        tracker.start(start)
    joints, confidence = zip(*[tracker.track(image) for image in depth], strict=True)
    return np.array(joints), np.array(confidence)


def error_m(found: np.ndarray, joints: np.ndarray) -> np.ndarray:
    return np.linalg.norm(found - joints, axis=-1)


@pytest.fixture(scope="module")
def dancer():
    """(8, 15, 3) joints and depth of a person who slowly lowers the arms."""
    joints = np.stack([cone_joints(40 - 2 * t, 12, 3 * t) for t in range(8)])
    body = cone_body(joints[0])
    return joints, np.stack([draw_cones(pose, body, CAMERA) for pose in joints])


@pytest.fixture(scope="module")
def simulated():
    """60 frames of a simulated dance: depth of the person, true joints, camera. It starts in the Y pose."""
    film = EvalSim(EvalSimConfig(seed=11), frames=(60, 60)).film(0)
    return np.where(film.person, film.depth_m, np.float32(0)), film.joints_camera_m.astype(np.float64), film.camera


@BOTH
def test_a_slow_person_is_tracked(dancer, config) -> None:
    joints, depth = dancer
    found, confidence = tracked(depth, joints[0], config)
    assert (error_m(found, joints) < 0.1).mean() > 0.85
    assert confidence.shape == (8, NUM_JOINTS) and ((confidence > 0) & (confidence < 1)).all()


def test_shoulders_that_slid_along_their_line_come_back_with_the_repairs_only(simulated) -> None:
    """Both 8 cm aside in a still picture: nothing in Eq. (6) pulls them back."""
    depth, joints, camera = simulated
    shoulders, error = [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER], {}
    slid = joints[0].copy()
    slid[shoulders, 0] += 0.08
    for config in (PRINTED, REPAIRED):
        tracker = PaperTracker(camera, config, HumanModel.from_joints(joints[0]))
        tracker.start(slid)
        for _ in range(30):
            found, _ = tracker.track(depth[0])
        error[config] = error_m(found, joints[0])[shoulders]
    assert error[REPAIRED].max() < 0.1 < error[PRINTED].min()


def test_a_simulated_dance_is_tracked_better_with_the_repairs(simulated) -> None:
    depth, joints, camera = simulated
    within = [(error_m(tracked(depth, joints[0], config, camera)[0], joints) < 0.1).mean() for config in (PRINTED, REPAIRED)]
    assert within[1] > 0.7 and within[1] > within[0] + 0.2


def test_confidence_is_lower_for_wrong_joints(simulated) -> None:
    depth, joints, camera = simulated
    found, confidence = tracked(depth, joints[0], PRINTED, camera)
    bad = error_m(found, joints) > 0.1
    assert bad.any() and confidence[bad].mean() < confidence[~bad].mean()


def test_it_waits_for_the_y_pose_and_measures_the_model() -> None:
    joints = y_joints(place_m=PLACE_M)
    standing = cone_joints(-75, 4)
    depth = np.stack([EMPTY, draw_cones(standing, cone_body(standing), CAMERA), *[draw_y(joints, CAMERA)] * 2])
    tracker = PaperTracker(CAMERA, REPAIRED)
    assert np.isnan(tracker.track(depth[0])[0]).all() and np.isnan(tracker.track(depth[1])[0]).all() and not tracker.started
    found = [tracker.track(image)[0] for image in depth[2:]]
    assert tracker.started and error_m(np.array(found), joints).mean() < 0.06
    assert tracker.model.shoulder_to_shoulder_m == pytest.approx(0.33, abs=0.06)
    # A model that is given is not measured again.
    known = HumanModel.from_joints(joints)
    given = PaperTracker(CAMERA, REPAIRED, known)
    given.track(depth[2])
    assert given.started and given.model is known


def test_the_same_input_gives_the_same_output_and_shares_nothing(dancer) -> None:
    joints, depth = dancer
    start, images = joints[0].copy(), depth.copy()
    tracker, found = PaperTracker(CAMERA, REPAIRED), []
    tracker.start(start)
    for image in images:
        pose, confidence = tracker.track(image)
        found.append(pose.copy())
        start[:] = pose[:] = confidence[:] = image[:] = 0
    np.testing.assert_array_equal(np.array(found), tracked(depth, joints[0], REPAIRED)[0])


@BOTH
def test_empty_frames_have_no_joints(dancer, config) -> None:
    joints, depth = dancer
    speck = EMPTY.copy()
    speck[100, 150] = 2.5
    found, confidence = tracked(np.stack([EMPTY, depth[0], EMPTY, speck, depth[1]]), joints[0], config)
    empty = [0, 2, 3]
    assert np.isnan(found[empty]).all() and not confidence[empty].any()
    assert np.isfinite(found[[1, 4]]).all()


@BOTH
def test_noise_is_no_error(dancer, config) -> None:
    joints, depth = dancer
    rng = np.random.default_rng(9)
    garbage = rng.integers(0, 2**16, (2, *EMPTY.shape)).astype(np.float32) / 1000
    sparse = np.where(rng.random(EMPTY.shape) < 0.01, garbage[0], 0)
    sequence = np.stack([depth[0], *garbage, sparse, np.full_like(EMPTY, 65.535), np.full_like(EMPTY, 0.02)])
    found, confidence = tracked(sequence, joints[0], config)
    assert np.isfinite(found).all() and (confidence >= 0).all() and (confidence <= 1).all()


# --- the estimator ------------------------------------------------------------------------------------------------


def test_a_sequence_without_the_y_pose_is_reported(dancer, caplog) -> None:
    depth = np.repeat(dancer[1][-1:, ::-1], 40, axis=0).copy()  # upside down
    assert np.isnan(PaperTrackerEstimator().estimate(depth, CAMERA).joints_camera_m).all()
    assert "in 40 of them, which show something, no person took the Y pose" in caplog.text


def test_only_label_is_given_the_true_pose() -> None:
    assert PaperTrackerEstimator(PaperTrackerConfig(start="label")).starts_from_label
    assert not PaperTrackerEstimator().starts_from_label
    with pytest.raises(InputError, match="start=standing: expected one of y_pose, label"):
        PaperTrackerConfig(start="standing")


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"candidates": "skin"}, "candidates=skin: expected ridge or depth"),
        ({"r_m": 110}, "r_m in 0..2 m"),
        ({"r_m": 0}, "found 0, 0.05 and 0.7"),
        ({"epsilon_m": np.nan}, "epsilon_m"),
        ({"straightness": 1.0}, "straightness in 0..1"),
    ],
)
def test_settings_in_other_units_are_refused(settings: dict, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        PaperTrackerConfig(**settings)
