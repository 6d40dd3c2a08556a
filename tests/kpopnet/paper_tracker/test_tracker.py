"""The paper's tracker over a simulated dance, printed and repaired, and as an estimator."""

from dataclasses import replace

import numpy as np
import pytest
from cone_people import error_m
from stand_ins import film_of

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig, PaperTrackerEstimator
from synth.simulated.stand_ins import EvalSim, EvalSimConfig

PRINTED, REPAIRED = PaperTrackerConfig(), PaperTrackerConfig(repaired=True)


@pytest.fixture(scope="module")
def simulated():
    """60 frames of a simulated dance: depth of the person, true joints, camera. It starts in the Y pose."""
    film = film_of(EvalSim(EvalSimConfig(seed=11), frames=(60, 60)), 0)
    return np.where(film.person, film.depth_m, np.float32(0)), film.joints_camera_m.astype(np.float64), film.camera


def test_a_simulated_dance_is_tracked_better_with_the_repairs_and_wrong_joints_are_less_confident(simulated) -> None:
    depth, joints, camera = simulated
    within = {}
    for config in (PRINTED, REPAIRED):
        tracker = PaperTracker(camera, config)
        tracker.start(joints[0])
        found, confidence = map(np.array, zip(*(tracker.track(image) for image in depth), strict=True))
        right = error_m(found, joints) < 0.1
        within[config] = right.mean()
        if config == PRINTED:
            assert confidence[~right].mean() < confidence[right].mean()
    assert within[REPAIRED] > 0.7 and within[REPAIRED] > within[PRINTED] + 0.2


def test_only_label_is_given_the_true_pose_and_waits_for_it(simulated) -> None:
    assert PaperTrackerEstimator(PaperTrackerConfig(start="label")).starts_from_label
    assert not PaperTrackerEstimator().starts_from_label
    depth, _, camera = simulated
    for config, starts in ((REPAIRED, True), (replace(REPAIRED, start="label"), False)):
        tracker = PaperTracker(camera, config)
        for image in depth:  # from the Y pose on
            tracker.track(image)
        assert tracker.started == starts


@pytest.mark.parametrize("settings", [{"epsilon_r": 0.5}, {"sufficient": 3}, {"lost": "carried"}])
def test_settings_that_the_repaired_tracker_would_not_use_are_refused(settings):
    PaperTrackerConfig(**settings)
    with pytest.raises(InputError, match="repaired takes epsilon_r, sufficient and lost from"):
        PaperTrackerConfig(repaired=True, **settings)


def test_what_is_no_camera_setting_or_image_is_refused():
    camera = CAMERAS["kinect_v1"]
    for mistaken, message in (
        (lambda: PaperTracker("kinect_v1"), "camera: expected a"),
        (lambda: PaperTracker(camera, "ridge"), r"config: expected a kpopnet\.paper_tracker\.tracker\.PaperTrackerConfig"),
        (lambda: PaperTracker(camera).track(np.ones((240, 200))), r"paper tracker: an image of shape \(240, 200\)"),
        (lambda: PaperTracker(camera).track(np.ones((240, 320), np.uint16)), "paper tracker: expected floating-point metres"),
        (lambda: PaperTracker(camera).start("standing"), "paper tracker: expected .* joints, found 'standing'"),
        (lambda: PaperTrackerConfig(r_m="0.1"), r"estimator\.paper_tracker\.r_m='0\.1': expected a number"),
    ):
        with pytest.raises(InputError, match=message):
            mistaken()
