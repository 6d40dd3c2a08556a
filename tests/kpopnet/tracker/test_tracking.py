"""Following a person: known ones of round cones and simulated ones, moved, mirrored, hidden, gone and back."""

import warnings

import numpy as np
import pytest
from cone_people import PLACE_M, cone_body, cone_joints, draw_cones
from hypothesis import given, settings
from hypothesis import strategies as st
from y_people import draw_y, y_joints

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint
from kpopnet.tracker.body import TORSO_JOINTS
from kpopnet.tracker.cells import cells_of
from kpopnet.tracker.fitted import SAID_WEIGHT
from kpopnet.tracker.fitting import fit
from kpopnet.tracker.model import HumanModel
from kpopnet.tracker.proposals import bent
from kpopnet.tracker.tracking import ENOUGH_GAIN, FRONT_EVERY, LAST_STEPS, Tracker, TrackerConfig, carried_on
from synth.eval_sim import EvalSim, EvalSimConfig, EvalSimSet

CAMERA = CAMERAS["kinect_v1"]
FRAMES = 10
EMPTY = np.zeros((CAMERA.height, CAMERA.width), np.float32)


def dance(frames: int = FRAMES) -> np.ndarray:
    """(T, 15, 3) somebody who lowers and bends the arms, turns and steps aside; not symmetric at any time."""
    x, y, z = PLACE_M
    return np.stack(
        [cone_joints(40 - 4 * t, 12 + t % 3, 5 * t, 10 + 1.5 * t, place_m=(x + 0.01 * t, y, z)) for t in range(frames)]
    )


def filmed(joints: np.ndarray) -> np.ndarray:
    body = cone_body(joints[0])
    return np.stack([draw_cones(pose, body, CAMERA) for pose in joints])


def followed(depth: np.ndarray, start: np.ndarray | None, camera=CAMERA, **kwargs) -> tuple[np.ndarray, np.ndarray]:
    """(T, 15, 3) joints and (T, 15) confidences."""
    tracker = Tracker(camera, TrackerConfig(**kwargs))
    if start is not None:
        tracker.start(start)
    joints, confidence = zip(*[tracker.track(image) for image in depth], strict=True)
    return np.array(joints), np.array(confidence)


def error_m(found: np.ndarray, joints: np.ndarray) -> np.ndarray:
    return np.linalg.norm(found - joints, axis=-1)


@pytest.fixture(scope="module")
def dancer():
    joints = dance()
    return joints, filmed(joints)


@pytest.fixture(scope="module")
def simulated():
    """50 frames of a simulated dance: depth of the person alone, and true joints. It starts in the Y pose."""
    film = EvalSim(EvalSimSet(EvalSimConfig(seed=11), frames=(60, 60))).film(0, frames=50)
    return np.where(film.person, film.depth_m, np.float32(0)), film.joints_camera_m.astype(np.float64), film.camera


# --- known people -------------------------------------------------------------------------------------------------


def test_a_person_of_cones_is_followed(dancer) -> None:
    joints, depth = dancer
    found, confidence = followed(depth, joints[0])
    error = error_m(found, joints)
    assert error.mean() < 0.03 and (error < 0.1).mean() > 0.97
    assert confidence.shape == (FRAMES, NUM_JOINTS) and (confidence >= 0).all() and (confidence <= 1).all()
    assert confidence.mean() > 0.6


def test_the_same_input_gives_the_same_output(dancer) -> None:
    joints, depth = dancer
    for kwargs in ({}, {"body": False}):
        first, second = (followed(depth, joints[0], **kwargs) for _ in range(2))
        for a, b in zip(first, second, strict=True):
            np.testing.assert_array_equal(a, b)


def test_what_is_given_and_returned_is_not_kept(dancer) -> None:
    joints, depth = dancer
    tracker = Tracker(CAMERA)
    start, images = joints[0].copy(), depth.copy()
    tracker.start(start)
    found = []
    for image in images:
        pose, confidence = tracker.track(image)
        found.append(pose.copy())
        start[:] = pose[:] = confidence[:] = image[:] = 0
    np.testing.assert_array_equal(np.array(found), followed(depth, joints[0])[0])


def test_someone_simulated_is_followed_and_the_body_helps(simulated) -> None:
    depth, joints, camera = simulated
    within = {}
    for body in (True, False):
        found, _ = followed(depth, joints[0], camera, body=body)
        within[body] = (error_m(found, joints) < 0.1).mean()
    assert within[True] > 0.7 and within[True] > within[False]


def test_confidence_tells_good_joints_from_bad_ones(simulated) -> None:
    depth, joints, camera = simulated
    found, confidence = followed(depth, joints[0], camera, body=False)
    bad = error_m(found, joints) > 0.1
    assert bad.any() and confidence[bad].mean() < confidence[~bad].mean()


# --- ways back ----------------------------------------------------------------------------------------------------


def crossed_shins(joints: np.ndarray) -> np.ndarray:
    crossed = joints.copy()
    crossed[[Joint.RIGHT_FOOT, Joint.LEFT_FOOT]] = joints[[Joint.LEFT_FOOT, Joint.RIGHT_FOOT]]
    return crossed


def turned_round(joints: np.ndarray) -> np.ndarray:
    return joints[MIRROR]


@pytest.mark.parametrize("lost", [crossed_shins, turned_round])
def test_who_stands_still_is_found_again_though_left_and_right_were_exchanged(simulated, lost) -> None:
    depth, joints, camera = simulated
    tracker = Tracker(camera)
    tracker.start(joints[0])
    tracker.track(depth[0])
    tracker.joints_camera_m = lost(joints[0])
    for _ in range(4 * FRONT_EVERY):
        found, _ = tracker.track(depth[0])
    assert (error_m(found, joints[0]) < 0.1).mean() > 0.9


def test_one_look_does_not_turn_a_body_round_and_who_is_upside_down_is_left_alone(simulated, monkeypatch) -> None:
    depth, joints, camera = simulated
    cells = cells_of(depth[0], camera)
    # As if the other side always explained the picture better.
    for upright, looks in ((joints[0], 2), (joints[0] * (1, -1, 1), None)):
        tracker = Tracker(camera)
        tracker.start(joints[0])
        monkeypatch.setattr("kpopnet.tracker.tracking.misfit", lambda pose, *_, own=upright: 2.0 if pose is own else 1.0)
        changed = [tracker._front_or_back(upright, cells) is not upright for _ in range(4 * FRONT_EVERY)]
        assert np.flatnonzero(changed).tolist() == ([] if looks is None else [n * looks * FRONT_EVERY - 1 for n in (1, 2)])


@pytest.mark.parametrize("found", ["where it was", "by looking around", "by a detector"])
def test_what_speaks_for_the_other_side_is_forgotten_with_the_pose_it_was_about(dancer, found) -> None:
    joints, depth = dancer
    tracker = Tracker(CAMERA)
    tracker.start(joints[0])
    tracker.track(depth[0])
    if found != "where it was":
        tracker.joints_camera_m = bent(joints[0], np.radians(-60))
    if found == "by a detector":
        tracker.detector = OneAnswer(joints[0])
    tracker._other_side = ENOUGH_GAIN / 2
    pose, _ = tracker.track(depth[0])
    assert (error_m(pose, joints[0]) < 0.1).all()
    assert tracker._other_side == (ENOUGH_GAIN / 2 if found == "where it was" else 0)


# --- starts -------------------------------------------------------------------------------------------------------


def test_it_waits_for_the_y_pose(dancer) -> None:
    depth = dancer[1]
    y = y_joints(place_m=PLACE_M)
    tracker = Tracker(CAMERA)
    assert not tracker.started
    for image in (EMPTY, depth[-1]):
        pose, confidence = tracker.track(image)
        assert np.isnan(pose).all() and not confidence.any() and not tracker.started
    pose, confidence = tracker.track(draw_y(y, CAMERA))
    assert tracker.started and tracker.model.left_upper_arm_m == pytest.approx(0.27, abs=0.06)
    assert error_m(pose, y).mean() < 0.06 and (confidence > 0).all()


def test_a_simulated_person_starts_by_themselves(simulated) -> None:
    depth, joints, camera = simulated
    found, _ = followed(depth, None, camera)
    begun = np.isfinite(found).all(axis=(1, 2))
    first = int(begun.argmax())
    assert begun[first:].all() and np.isnan(found[:first]).all() and first < 30
    assert (error_m(found, joints)[first:] < 0.1).mean() > 0.6


def test_thickness_is_that_of_the_person_though_they_stand_otherwise_than_the_average_one() -> None:
    joints = cone_joints(-66, 4)
    body = cone_body(joints)
    tracker = Tracker(CAMERA, standing=True)
    for _ in range(4):
        found, _ = tracker.track(draw_cones(joints, body, CAMERA))
    # 15 and 36 mm if thickness is taken with the arms where the average person has them.
    off = np.abs(tracker.body.radii_m - body.radii_m)
    assert off.mean() < 0.008 and off.max() < 0.025
    assert error_m(found, joints).mean() < 0.035


def test_a_model_that_was_saved_is_kept(dancer, tmp_path) -> None:
    joints, depth = dancer
    HumanModel.from_joints(joints[0]).save(tmp_path / "person.json")
    model = HumanModel.load(tmp_path / "person.json")
    tracker = Tracker(CAMERA, model=model)
    # Started from a pose with wrong lengths the limbs still come out as long as the model's.
    middle = joints[0].mean(0)
    tracker.start(middle + 1.08 * (joints[0] - middle))
    found = np.array([tracker.track(image)[0] for image in depth])
    assert tracker.model == model
    upper = np.linalg.norm(found[:, Joint.LEFT_ELBOW] - found[:, Joint.LEFT_SHOULDER], axis=1)
    np.testing.assert_allclose(upper, model.left_upper_arm_m, atol=0.02)
    assert error_m(found[-1], joints[-1]).mean() < 0.04


def test_a_tracker_started_again_on_somebody_farther_away_follows_them_at_once(dancer) -> None:
    joints, depth = dancer
    far = joints[:2] + np.array((0, 0, 2.5))
    images = filmed(far)
    again = Tracker(CAMERA)
    again.start(joints[0])
    again.track(depth[0])
    first = Tracker(CAMERA, model=again.model)
    for tracker in (again, first):
        tracker.start(far[0])
    for image in images:
        np.testing.assert_array_equal(again.track(image)[0], first.track(image)[0])


def test_a_pose_with_gaps_is_no_start() -> None:
    joints = cone_joints()
    joints[Joint.NECK] = np.nan
    with pytest.raises(InputError, match="without gaps"):
        Tracker(CAMERA).start(joints)
    joints[Joint.LEFT_HAND] = np.nan
    with pytest.raises(InputError, match="left_hand"):
        Tracker(CAMERA).start(joints)
    with pytest.raises(InputError, match=r"\(15, 3\)"):
        Tracker(CAMERA).start(joints[:3])


class OneAnswer:
    """A detector that always says the same, and notes that it was asked."""

    def __init__(self, joints: np.ndarray) -> None:
        self.joints, self.asked = joints, 0

    def estimate(self, depth_m, camera):
        self.asked += 1
        assert depth_m.shape == (1, camera.height, camera.width)
        return type("Estimate", (), {"joints_camera_m": self.joints[None].astype(np.float32)})


def test_a_detector_is_asked_in_doubt_only_and_believed_only_if_it_fits(dancer) -> None:
    joints, depth = dancer
    lost = joints[0].copy()
    lost[:, :2] = joints[0][:, :2] @ np.array([(0, 1), (-1, 0)])  # lying on the side
    right, wrong, gap = OneAnswer(joints[0]), OneAnswer(lost), OneAnswer(np.full_like(lost, np.nan))
    found = {}
    for detector in (right, wrong, gap):
        tracker = Tracker(CAMERA, model=HumanModel.from_joints(joints[0]), detector=detector)
        tracker.start(lost)
        found[detector] = tracker.track(depth[0])[0]
        assert detector.asked == 1
    assert error_m(found[right], joints[0]).mean() < 0.04
    np.testing.assert_array_equal(found[wrong], found[gap])
    sure = OneAnswer(lost)
    tracker = Tracker(CAMERA, detector=sure)
    tracker.start(joints[0])
    for image in depth[:3]:
        tracker.track(image)
    assert sure.asked == 0


def test_a_detector_is_believed_though_it_explains_the_picture_a_little_worse(dancer, monkeypatch) -> None:
    joints, depth = dancer
    monkeypatch.setattr("kpopnet.tracker.tracking.ASK", 0.0)
    near = joints[0] + (0.02, 0, 0)
    tracker = Tracker(CAMERA, detector=OneAnswer(near))
    tracker.start(joints[0])
    found, _ = tracker.track(depth[0])
    cells = cells_of(depth[0], CAMERA)
    said = fit(near.astype(np.float32), cells, tracker.body, LAST_STEPS, start_weight=SAID_WEIGHT)
    np.testing.assert_array_equal(found, said)


# --- what must not matter -----------------------------------------------------------------------------------------


@given(st.integers(-4, 4), st.integers(-2, 2))
@settings(max_examples=5, deadline=None)
def test_a_picture_moved_with_its_camera_shows_the_same_person(dancer, right: int, down: int) -> None:
    """By whole cells, and with the person in the picture: the very same points, up to rounding."""
    joints, depth = dancer
    by_x, by_y = 4 * right, 4 * down
    moved = np.roll(depth[:5], (by_y, by_x), axis=(1, 2))
    camera = CAMERA.cropped(-by_x, -by_y, CAMERA.width, CAMERA.height)
    found, _ = followed(moved, joints[0], camera)
    np.testing.assert_allclose(found, followed(depth[:5], joints[0])[0], atol=1e-6)


@given(st.integers(-40, 40))
@settings(max_examples=5, deadline=None)
def test_who_dances_elsewhere_along_the_picture_dances_the_same(dancer, pixels: int) -> None:
    """Moved by whole pixels at the place's depth. Not exact: nearer and farther points move by other parts of a pixel, a
    perspective view shows more of one side, and cells of four pixels hold other points. All that within the sampling: a
    cell is 4.5 cm wide there."""
    joints, depth = dancer
    by = np.array((pixels * PLACE_M[2] / CAMERA.fx, 0, 0))
    moved, _ = followed(filmed(joints[:6] + by), joints[0] + by)
    still, _ = followed(depth[:6], joints[0])
    difference = error_m(moved - by, still)
    assert difference.mean() < 0.02 and difference.max() < 0.06


@pytest.mark.parametrize(("body", "frames"), [(True, FRAMES), (False, 3)])
def test_a_mirrored_picture_shows_the_mirrored_person(dancer, body: bool, frames: int) -> None:
    """Not exact: of a cell's four columns the third is looked at, in the mirror the second; and right comes before left.

    Without the body a joint is lost here sooner, there later; until then the same holds.
    """
    joints, depth = dancer[0], dancer[1][:frames]
    mirror = np.array((-1, 1, 1))
    mirrored, _ = followed(np.ascontiguousarray(depth[..., ::-1]), (joints[0] * mirror)[MIRROR], CAMERA.mirrored(), body=body)
    plain, _ = followed(depth, joints[0], body=body)
    difference = error_m((mirrored * mirror)[:, MIRROR], plain)
    assert difference.mean() < 0.02 and np.quantile(difference, 0.95) < 0.06


# --- bad pictures -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("body", [True, False])
def test_where_nobody_is_nothing_is_found(dancer, body: bool) -> None:
    joints, depth = dancer
    speck = EMPTY.copy()
    speck[100, 150] = 2.5
    sequence = np.stack([EMPTY, depth[0], EMPTY, speck, depth[1]])
    found, confidence = followed(sequence, joints[0], body=body)
    empty = [0, 2, 3]
    assert np.isnan(found[empty]).all() and not confidence[empty].any()
    assert np.isfinite(found[[1, 4]]).all()


def test_who_leaves_and_comes_back_is_found_again(dancer) -> None:
    joints, depth = dancer
    for by_m in (0.0, 0.7):
        back = joints[4:] + np.array((by_m, 0, 0))
        sequence = np.concatenate([depth[:4], np.repeat(EMPTY[None], 10, axis=0), filmed(back)])
        found, confidence = followed(sequence, joints[0])
        assert np.isnan(found[4:14]).all() and not confidence[4:14].any()
        assert np.isfinite(found[14:]).all()
        assert error_m(found[-1], back[-1]).mean() < 0.05


@pytest.mark.parametrize("half", ["left", "right", "top", "bottom"])
def test_half_of_the_picture_without_measurement_is_got_over(dancer, half: str) -> None:
    """While it lasts the body huddles in what is seen, since the tracker cannot tell what is not measured from nobody."""
    joints, depth = dancer
    lost = {"left": np.s_[:, :160], "right": np.s_[:, 160:], "top": np.s_[:120], "bottom": np.s_[120:]}[half]
    sequence = depth.copy()
    for image in sequence[3:6]:
        image[lost] = 0
    found, confidence = followed(sequence, joints[0])
    assert np.isfinite(found).all() and np.isfinite(confidence).all()
    assert error_m(found[2], joints[2]).mean() < 0.04 and error_m(found[-1], joints[-1]).mean() < 0.05


@pytest.mark.parametrize("body", [True, False])
def test_garbage_is_survived(dancer, body: bool) -> None:
    joints, depth = dancer
    rng = np.random.default_rng(9)
    garbage = rng.integers(0, 2**16, (2, *EMPTY.shape)).astype(np.float32) / 1000
    sparse = np.where(rng.random(EMPTY.shape) < 0.01, garbage[0], 0)
    flat = np.full_like(EMPTY, 65.535)
    close = np.full_like(EMPTY, 0.001)
    sequence = np.stack([depth[0], *garbage, sparse, flat, close])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found, confidence = followed(sequence, joints[0], body=body)
    assert np.isfinite(found).all() and (confidence >= 0).all() and (confidence <= 1).all()


def test_no_kind_of_picture_starts_a_tracker_by_mistake() -> None:
    rng = np.random.default_rng(9)
    garbage = rng.integers(0, 2**16, EMPTY.shape).astype(np.float32) / 1000
    found, _ = followed(np.stack([garbage, np.full_like(EMPTY, 2.0), EMPTY]), None)
    assert np.isnan(found).all()


def test_a_body_that_turned_and_moved_is_expected_to_go_on_so() -> None:
    angle, way = 0.2, np.array((0.03, 0.0, -0.02))
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    poses = [cone_joints(elevation_deg=20)]
    middles = [poses[0][list(TORSO_JOINTS)].mean(axis=0)]
    for _ in range(2):
        poses.append((poses[-1] - middles[-1]) @ turn.T + middles[-1] + way)
        middles.append(middles[-1] + way)
    np.testing.assert_allclose(carried_on(poses[1], poses[1] - poses[0]), poses[2], atol=1e-9)
    np.testing.assert_allclose(carried_on(poses[1], np.zeros_like(poses[1])), poses[1], atol=1e-9)
