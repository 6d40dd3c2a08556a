"""Tracking people of round cones with known joints and simulated people: moved, mirrored, occluded, absent and returning."""

from unittest.mock import Mock

import numpy as np
import pytest
from cone_people import PLACE_M, cone_body, cone_joints, error_m, filmed, tracked
from stand_ins import film_of

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import MIRROR, Joint
from kpopnet.tracker import tracker as module
from kpopnet.tracker.tracker import FLIP_STRIDE, MAX_STEP_M, VELOCITY_DAMPING, Tracker, _visible_m2
from synth.simulated.stand_ins import EvalSim, EvalSimConfig

CAMERA = CAMERAS["kinect_v1"]
LOST_FRAMES = 30
"""Without times of images, after which a person who is missing is lost."""


def dance(frames: int = 10) -> np.ndarray:
    """(T, 15, 3) a person who lowers and bends the arms, turns and steps aside; asymmetric in every frame."""
    x, y, z = PLACE_M
    return np.stack(
        [cone_joints(40 - 4 * t, 12 + t % 3, 5 * t, 10 + 1.5 * t, place_m=(x + 0.01 * t, y, z)) for t in range(frames)]
    )


@pytest.fixture(scope="module")
def dancer():
    joints = dance()
    return joints, filmed(joints, CAMERA)


@pytest.fixture(scope="module")
def simulated():
    """30 frames of a simulated dance: depth of the person, true joints, camera. It starts in the Y pose."""
    film = film_of(EvalSim(EvalSimConfig(seed=11), frames=(60, 60)), 0, frames=30)
    return np.where(film.person, film.depth_m, np.float32(0)), film.joints_camera_m.astype(np.float64), film.camera


def test_what_is_no_camera_start_or_image_is_refused() -> None:
    with pytest.raises(InputError, match="camera: expected a"):
        Tracker("kinect_v1")
    with pytest.raises(InputError, match="start=anyhow: expected one of"):
        Tracker(CAMERA, "anyhow")
    for wrong in (np.ones((240, 320), np.uint16), np.ones((240, 200)), [[1.0]], None):
        with pytest.raises(InputError, match="tracker: "):
            Tracker(CAMERA).track(wrong)


def test_a_simulated_person_is_tracked(simulated) -> None:
    depth, joints, camera = simulated
    found, _ = tracked(Tracker(camera), depth, joints[0])
    assert (error_m(found, joints) < 0.1).mean() > 0.7


def test_who_walks_away_from_a_slow_camera_is_followed() -> None:
    x, y, _ = PLACE_M
    joints = np.stack([cone_joints(-40, 12, 0, 10, place_m=(x, y, 1.3 + 0.4 * t)) for t in range(5)])
    found, _ = tracked(Tracker(CAMERA), filmed(joints, CAMERA), joints[0])  # at last a quarter of the pixels at first
    assert error_m(found, joints).mean(axis=1).max() < 0.05


def test_who_walks_before_five_images_a_second_is_followed_without_a_lag() -> None:
    joints = np.stack([cone_joints(-60, 4, place_m=(0, PLACE_M[1], 2.7 + 0.2 * t)) for t in range(5)])
    tracker = Tracker(CAMERA)
    tracker.start(joints[0])
    found = [tracker.track(image, t / 5)[0] for t, image in enumerate(filmed(joints, CAMERA))]
    assert error_m(np.array(found), joints).mean(axis=1).max() < 0.05


@pytest.mark.parametrize("exchanged", [[Joint.RIGHT_FOOT, Joint.LEFT_FOOT], list(Joint)], ids=["crossed shins", "mirrored"])
def test_exchanged_sides_are_corrected_while_standing_still(simulated, exchanged) -> None:
    depth, joints, camera = simulated
    tracker, lost = Tracker(camera), joints[0].copy()
    lost[exchanged] = joints[0][MIRROR[exchanged]]
    tracker.start(joints[0])
    tracker.track(depth[0])
    tracker.state = tracker.state._replace(joints_m=lost)
    for _ in range(4 * FLIP_STRIDE):
        found, _ = tracker.track(depth[0])
    assert (error_m(found, joints[0]) < 0.1).mean() > 0.9


def test_thickness_is_measured_after_fitting_the_standing_pose() -> None:
    joints = cone_joints(-66, 4)
    body = cone_body(joints)
    tracker = Tracker(CAMERA, "standing")
    for image in still(joints, 4):
        found, _ = tracker.track(image)
    # The errors are 15 and 36 mm if the thickness is measured with the average person's arm pose.
    off = np.abs(tracker.body.radii_m - body.radii_m)
    assert off.mean() < 0.008 and off.max() < 0.025
    assert error_m(found, joints).mean() < 0.04


def always(joints: np.ndarray) -> Mock:
    """A detector that always returns the same joints."""
    return Mock(**{"estimate.return_value": Estimate(joints[None].astype(np.float32), np.ones((1, 15), np.float32))})


def test_a_detector_is_queried_at_high_cost_and_accepted_if_it_fits(dancer) -> None:
    joints, depth = dancer
    lost = joints[0].copy()
    lost[:, :2] = joints[0][:, :2] @ np.array([(0, 1), (-1, 0)])  # lying on the side
    right, wrong, gap = always(joints[0]), always(lost), always(np.full_like(lost, np.nan))
    found = {}
    for detector in (right, wrong, gap):
        tracker = Tracker(CAMERA, model=HumanModel.from_joints(joints[0]), detector=detector)
        tracker.start(lost)
        found[detector] = tracker.track(depth[0])[0]
        detector.estimate.assert_called_once()
    assert error_m(found[right], joints[0]).mean() < 0.04
    np.testing.assert_array_equal(found[wrong], found[gap])
    idle = always(lost)
    tracker = Tracker(CAMERA, detector=idle)
    tracker.start(joints[0])
    for image in depth[:3]:
        tracker.track(image)
    idle.estimate.assert_not_called()


def still(joints: np.ndarray, frames: int) -> np.ndarray:
    """(T, H, W) metres of a person who stands still."""
    return np.repeat(filmed(joints[None], CAMERA), frames, axis=0)


def empty(frames: int) -> np.ndarray:
    return np.zeros((frames, CAMERA.height, CAMERA.width), np.float32)


@pytest.mark.parametrize(("right", "down"), [(3, 0), (-4, 2)])
def test_shifting_image_and_camera_keeps_the_joints(dancer, right: int, down: int) -> None:
    """Shifted by whole grid cells, with the person inside the image: the same points up to rounding."""
    joints, depth = dancer
    side_px = int(build_depth_grid(depth[0], CAMERA).intrinsics[4])
    by_x, by_y = side_px * right, side_px * down
    moved = np.roll(depth[:5], (by_y, by_x), axis=(1, 2))
    camera = CAMERA.cropped(-by_x, -by_y, CAMERA.width, CAMERA.height)
    found, _ = tracked(Tracker(camera), moved, joints[0])
    np.testing.assert_allclose(found, tracked(Tracker(CAMERA), depth[:5], joints[0])[0], atol=1e-6)


def test_a_mirrored_image_gives_mirrored_joints(dancer) -> None:
    """Not exact: a cell's middle column may be another one in the mirror image; and right is processed first."""
    joints, depth = dancer
    mirror = np.array((-1, 1, 1))
    mirrored, _ = tracked(Tracker(CAMERA.mirrored()), np.ascontiguousarray(depth[..., ::-1]), (joints[0] * mirror)[MIRROR])
    plain, _ = tracked(Tracker(CAMERA), depth, joints[0])
    difference = error_m((mirrored * mirror)[:, MIRROR], plain)
    assert difference.mean() < 0.02 and np.quantile(difference, 0.95) < 0.06


@pytest.mark.parametrize("away", [0, 12], ids=["images missing", "hidden"])
@pytest.mark.parametrize("aside_m", [0.5, 0.7, 1.2])
def test_who_comes_back_out_of_reach_of_the_last_pose_is_tracked_there(aside_m: float, away: int) -> None:
    """Also when the next person takes their place: points too far from every part move nothing, whatever the confidence."""
    first = cone_joints(-50, 8, place_m=(-0.6, 0, PLACE_M[2]))
    back = first + np.array((aside_m, 0, 0))
    sequence = np.concatenate([still(first, 6), empty(away), still(back, 6)])
    found, confidence = tracked(Tracker(CAMERA), sequence, first)
    errors_m = error_m(found[-6:], back).mean(axis=-1)
    assert errors_m.max() < 0.05 and confidence[-1].mean() > 0.8


def test_who_comes_after_a_second_without_a_person_is_found_anew() -> None:
    """A sensor that fails, or a person who leaves: the next start is looked for as the first one was."""
    first = cone_joints(-66, 4)
    second = first + np.array((-1.2, 0, 0.4))
    tracker = Tracker(CAMERA, "standing")
    sequence = np.concatenate([still(first, 3), empty(LOST_FRAMES), still(second, 3)])
    found = np.array([tracker.track(image)[0] for image in sequence])
    assert np.isnan(found[3:-3]).all()
    assert error_m(found[2], first).mean() < 0.05 and error_m(found[-1], second).mean() < 0.05
    given, _ = tracked(Tracker(CAMERA, "label"), np.concatenate([sequence[:-3], sequence[:3]]), first)
    assert np.isfinite(given[-3:]).all(), "a start that was given is not found again: it is kept"
    tracker = Tracker(CAMERA, "standing")
    for image in empty(LOST_FRAMES):
        tracker.track(image)
    tracker.start(first)
    tracker.track(image)
    assert tracker.started, "the images before the start do not count"


@pytest.mark.parametrize(
    ("fps", "missing", "lost"), [(30, 29, False), (30, 30, True), (10, 9, False), (10, 10, True), (60, 59, False)]
)
def test_a_person_is_lost_after_a_second_by_the_times_of_the_images(fps: float, missing: int, lost: bool) -> None:
    tracker, times_s = Tracker(CAMERA, "standing"), 1.7e9 + np.arange(100) / fps
    tracker.start(cone_joints(-66, 4))
    tracker.track(still(cone_joints(-66, 4), 1)[0], times_s[0])
    for time_s in times_s[1 : 1 + missing]:
        tracker.miss(time_s)
    assert tracker.started != lost
    tracker.miss(0.0)
    assert tracker.started != lost, "a clock that is put back tells nothing"
    for time_s in times_s[:70] - times_s[0]:
        tracker.miss(time_s)
    assert not tracker.started, "and from there on it goes on"


def test_after_seconds_without_an_image_a_start_is_looked_for_and_the_pose_is_not_kept() -> None:
    standing = cone_joints(-66, 4)
    middle, lying = standing.mean(axis=0), standing.copy()
    lying[:, :2] = (standing - middle)[:, :2] @ np.array([(0, 1), (-1, 0)]) + middle[:2]
    (before,), (after,) = still(lying, 1), still(standing, 1)
    errors_m = []
    for missed, stall_s in ((False, 0.0), (False, 3.0), (True, 1.8)):
        tracker = Tracker(CAMERA)
        tracker.start(lying)
        for k in range(3):
            tracker.track(before, k / 30)
        if missed:
            tracker.miss(3 / 30 + 0.9)
        errors_m.append(error_m(tracker.track(after, 3 / 30 + stall_s)[0], standing).mean())
    assert errors_m[0] > 0.3 and max(errors_m[1:]) < 0.02


@pytest.mark.parametrize("lost", [np.s_[:, :160], np.s_[:120]], ids=["left", "top"])
def test_tracking_recovers_from_a_half_image_dropout(dancer, lost) -> None:
    joints, depth = dancer
    sequence = depth.copy()
    for image in sequence[3:6]:
        image[lost] = 0
    found, confidence = tracked(Tracker(CAMERA), sequence, joints[0])
    assert np.isfinite(found).all() and np.isfinite(confidence).all()
    assert error_m(found[-1], joints[-1]).mean() < 0.05


def test_who_stays_half_hidden_and_moves_is_followed_again_after_a_while():
    x, y, z = PLACE_M
    steps_m = 0.03 * np.maximum(np.arange(20) - 3, 0)
    joints = np.stack([cone_joints(-50, 8, place_m=(x + step_m, y, z)) for step_m in steps_m])
    depth = filmed(joints, CAMERA)
    depth[3:, 120:] = 0  # from here on a table hides all below
    found, _ = tracked(Tracker(CAMERA), depth, joints[0])
    upper = slice(0, 4)
    assert error_m(found[-1:, upper], joints[-1:, upper]).mean() < 0.12


def test_the_visible_area_is_the_same_at_any_distance():
    areas_m2 = []
    for z in (1.5, 3.0):
        image = np.zeros((240, 320), np.float32)
        (u0, v0, _), (u1, v1, _) = CAMERA.project(np.array([(-0.2, -0.5, z), (0.2, 0.5, z)]))
        image[round(v0) : round(v1), round(u0) : round(u1)] = z
        areas_m2.append(_visible_m2(build_depth_grid(image, CAMERA)))
    assert areas_m2 == pytest.approx([0.4, 0.4], rel=0.08)


def test_the_next_pose_is_expected_ahead_of_the_last_step(monkeypatch):
    expected, best_fit = [], module._best_fit

    def watched(candidates, expected_m, *rest):
        expected.append(expected_m)
        return best_fit(candidates, expected_m, *rest)

    monkeypatch.setattr(module, "_best_fit", watched)
    x, y, z = PLACE_M
    joints = np.stack([cone_joints(-50, 8, place_m=(x + 0.05 * t, y, z)) for t in range(4)])
    found, _ = tracked(Tracker(CAMERA), filmed(joints, CAMERA), joints[0])
    step_m = np.clip(found[2] - found[1], -MAX_STEP_M, MAX_STEP_M)
    np.testing.assert_allclose(expected[3], found[2] + VELOCITY_DAMPING * step_m, atol=1e-6)


def test_the_trackers_confidence_is_about_the_share_of_joints_within_10_cm(simulated):
    depth, joints, camera = simulated
    found, confidence = tracked(Tracker(camera), depth, joints[0])
    within = (error_m(found, joints) < 0.1).mean()
    assert confidence.mean() == pytest.approx(within, abs=0.12)
