"""The pose estimator finds people, follows them, and weighs the network and the fit over time."""

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from capsule_people import CAMERA as CAPSULE_CAMERA
from capsule_people import draw_depth, draw_joints
from extraction_scenes import CAMERA as ROOM_CAMERA
from extraction_scenes import compose, room, shifted, standing

from kpopnet.camera import MOST_PIXELS, Camera
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Start
from kpopnet.finder.finder import FinderConfig, PersonFinder
from kpopnet.human import Human
from kpopnet.paper_extraction import PaperExtractionConfig, PaperExtractor
from kpopnet.paper_tracker.tracker import PaperTrackerEstimator
from kpopnet.pose import PoseEstimator
from kpopnet.pose.extraction import extract_person
from kpopnet.pose.person import SECOND_PASS_CONFIDENCE, DetectedPerson, PersonEstimator, Pose, detected
from kpopnet.sources import open_depth
from kpopnet.sources.source import TimedDepth
from kpopnet.tracker.estimator import TrackerEstimator, TrackerEstimatorConfig
from kpopnet.tracker.refine import FittedEstimator

CAMERA = Camera.centred(100.0, 80, 60)
POSE_M = np.random.default_rng(0).uniform(-0.5, 0.5, (15, 3)).astype(np.float32)
STILL_M = draw_joints(np.random.default_rng(1))


class Blob:
    """A detector whose joints are the silhouette's centre plus a fixed pose; it records what it was asked."""

    name = "blob"

    def __init__(self):
        self.asked = []

    def estimate(self, depth_m, camera):
        self.asked.append((depth_m.copy(), camera))
        found = Estimate.missing(len(depth_m))
        for frame, image_m in enumerate(depth_m):
            if image_m.any():
                found.joints_camera_m[frame] = camera.points(image_m)[image_m > 0].mean(axis=0) + POSE_M
                found.confidence[frame] = 0.5
        return found


def person(column, distance_m=2.0, camera=CAMERA):
    image = np.zeros((camera.height, camera.width), np.float32)
    image[15:45, column : column + 8] = distance_m
    return image


def test_in_a_segmented_recording_no_person_has_to_be_found():
    depth = np.stack([person(20), np.zeros((60, 80), np.float32), person(40)])
    (found,) = PoseEstimator(Blob()).estimate(depth, CAMERA, segmented=True)
    assert np.isfinite(found.joints_camera_m[[0, 2]]).all()
    assert np.isnan(found.joints_camera_m[1]).all()
    assert (found.confidence[1] == 0).all()


DOORS = {
    "update": lambda depth, camera: PoseEstimator(Blob()).update(depth, camera),
    "estimate": lambda depth, camera: PoseEstimator(Blob()).estimate(depth, camera),
    "segmented": lambda depth, camera: PoseEstimator(Blob()).estimate(depth, camera, segmented=True),
    "PersonEstimator": lambda depth, camera: PersonEstimator(Blob(), "best").estimate(depth, camera),
    "FittedEstimator": lambda depth, camera: FittedEstimator(Blob()).estimate(depth, camera),
    "TrackerEstimator": lambda depth, camera: TrackerEstimator().estimate(depth, camera),
    "PaperTrackerEstimator": lambda depth, camera: PaperTrackerEstimator().estimate(depth, camera),
    "PersonFinder": lambda depth, camera: PersonFinder(camera).extract(depth),
    "PaperExtractor": lambda depth, camera: PaperExtractor(camera).extract(depth),
    "extract_person": extract_person,
}
DEPTH = np.full((1, 60, 80), 2.0, np.float32)


@pytest.mark.parametrize("door", DOORS)
def test_wrong_types_are_one_line_at_every_door(door):
    for camera in (None, "kinect_v1", {"fx": 1}, (100.0, 100.0)):
        with pytest.raises(InputError, match="camera"):
            DOORS[door](DEPTH, camera)
    masked = np.ma.masked_equal(DEPTH, 2.0)
    for depth in (None, "depth", {}, 3, np.array(2.0), DEPTH[0, 0], DEPTH[None], masked, DEPTH.astype(object), DEPTH > 0):
        if not (door in ("update", "estimate", "segmented") and isinstance(depth, dict)):  # images one after another, none
            with pytest.raises(InputError) as refused:
                DOORS[door](depth, CAMERA)
            assert "\n" not in str(refused.value)


def test_a_refused_image_or_time_leaves_nothing_behind():
    frames = walking(6)
    poses, fresh = PoseEstimator(Blob()), PoseEstimator(Blob())
    with pytest.raises(InputError):
        poses.estimate([*frames[3:], np.zeros((2, 2, 2), np.float32)], ROOM_CAMERA)
    for segmented in (False, True):
        with pytest.raises(InputError, match="time_s"):
            poses.estimate([TimedDepth(np.nan, frames[3])], ROOM_CAMERA, segmented=segmented)
    for frame in frames[:3]:
        for time_s in (np.nan, np.inf, "1"):
            with pytest.raises(InputError, match="time_s"):
                poses.update(frame, ROOM_CAMERA, time_s)
        found, expected = ([one.identity for one in each.update(frame, ROOM_CAMERA)] for each in (poses, fresh))
        assert found == expected


def test_a_hand_before_the_lens_ends_nothing_once_the_unit_is_known():
    frames, near = np.rint(1000 * np.stack(walking(3))).astype(np.uint16), np.full(walking(1)[0].shape, 40, np.uint16)
    poses = PoseEstimator(Blob())
    for frame in (frames[0], near, *frames[1:], near):
        poses.update(frame, ROOM_CAMERA)
    with pytest.raises(InputError, match="these look like metres"):
        poses.update(near, replace(ROOM_CAMERA, fx=ROOM_CAMERA.fx + 1))  # another camera
    poses.reset()
    with pytest.raises(InputError, match="these look like metres"):
        poses.update(near, ROOM_CAMERA)


@pytest.mark.parametrize("extraction", [FinderConfig(), PaperExtractionConfig()])
@pytest.mark.parametrize("far", [np.uint16(60000), np.float32(60)])
def test_a_covered_lens_whose_few_pixels_are_far_ends_nothing(extraction, far):
    frames = np.stack(walking(4))
    frames = np.rint(1000 * frames).astype(np.uint16) if far.dtype.kind == "u" else frames
    noise, everywhere = np.zeros_like(frames[0]), np.full_like(frames[0], far)
    noise[7, 9] = far
    poses = PoseEstimator(Blob(), extraction=extraction)
    for frame in (frames[0], noise, *frames[1:], noise):
        poses.update(frame, ROOM_CAMERA)
    if far.dtype.kind == "u":
        assert poses.update(everywhere, ROOM_CAMERA) == []
    else:
        garbage = np.where(np.arange(frames.shape[2]) < 9, np.float32(1e30), frames[0])
        assert poses.update(garbage, ROOM_CAMERA) is not None


def test_who_has_no_joint_is_not_reported():
    class Blind(Blob):
        def estimate(self, depth_m, camera):
            return Estimate.missing(len(depth_m))

    frames = np.stack(walking(4))
    poses = PoseEstimator(Blind())
    assert [poses.update(frame, ROOM_CAMERA) for frame in frames] == [[]] * 4
    assert poses.estimate(frames, ROOM_CAMERA) == []


def test_large_images_are_reduced_before_anything_looks_at_them():
    network, camera = Blob(), Camera.centred(3500.0, 4096, 4096)
    depth = np.zeros((4096, 4096), np.float32)
    depth[800:3400, 1600:2400] = 2.0
    PoseEstimator(network, "best").estimate(depth, camera, segmented=True)
    ((seen, theirs),) = network.asked
    assert seen.size <= MOST_PIXELS
    middle_m = camera.back_project([(1600 + 2399) / 2, (800 + 3399) / 2, 2.0])
    assert np.allclose(theirs.points(seen[0])[seen[0] > 0].mean(axis=0), middle_m, atol=0.002)


def test_wrong_settings_are_refused_by_name():
    for wrong in ({"mode": "fast"}, {"people": 17}, {"people": 1.5}, {"extraction": "finder"}, {"extraction": FinderConfig}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            PoseEstimator(Blob(), **wrong)


@pytest.mark.parametrize("wrong", [None, "outputs/train/RUN/best", Blob])
def test_what_is_no_network_is_refused_at_once(wrong):
    wrapped = PoseEstimator, FittedEstimator, lambda one: PersonEstimator(one, "best"), lambda one: TrackerEstimator(NAMED, one)
    for wrap in wrapped:
        with pytest.raises(InputError, match=r"expected an estimator|give detector="):
            wrap(wrong)


NAMED = TrackerEstimatorConfig(network="outputs/train/RUN/best")


def test_mistaken_arguments_of_estimators_are_one_line():
    start = Start(-1, POSE_M)
    for mistaken, message in (
        (lambda: PoseEstimator(Blob()).estimate("dance.npz", CAMERA), r"got str; kpopnet\.sources\.open_depth opens"),
        (lambda: PoseEstimator(Blob()).update(DEPTH[0], CAMERA, ""), "time_s='': expected a number"),
        (lambda: PoseEstimator.load("net", mode="tracker"), "checkpoint net: the mode tracker uses no network"),
        (lambda: PoseEstimator.load(3), "expected the path of a file or folder, got 3"),
        (lambda: TrackerEstimator("standing"), "config: expected a .*TrackerEstimatorConfig, got 'standing'"),
        (lambda: PaperTrackerEstimator("y_pose"), "config: expected a .*PaperTrackerConfig, got 'y_pose'"),
        (lambda: TrackerEstimator().estimate(DEPTH, CAMERA, POSE_M), r"start: expected a kpopnet\.estimator\.Start"),
        (lambda: PaperTrackerEstimator().estimate(DEPTH, CAMERA, start), "start: .* with a frame from 0 on"),
        (lambda: PersonEstimator(Blob(), "best", 0), "fps=0: expected a number in 1..1000"),
        (lambda: extract_person(DEPTH, CAMERA, fps=0), "fps=0: expected a number in 1..1000"),
        (lambda: extract_person(DEPTH, CAMERA, "finder"), "extraction: expected a .*FinderConfig or .*, got 'finder'"),
    ):
        with pytest.raises(InputError, match=message):
            mistaken()


def test_two_people_of_a_room_are_followed_in_their_identities():
    steps = range(24)
    frames = [room()] * 3 + [compose(room(), shifted(standing(2.6), t - 45), shifted(standing(3.2), 45 - t)) for t in steps]
    two = PoseEstimator(Blob(), people=2).estimate(frames, ROOM_CAMERA)
    assert len(two) == 2
    centres = [one.joints_camera_m[-1].mean(axis=0) - POSE_M.mean(axis=0) for one in two]
    assert np.allclose(sorted(float(centre[2]) for centre in centres), [2.5, 3.1], atol=0.15)
    for one in two:
        seen = np.isfinite(one.joints_camera_m).all(axis=(1, 2))
        moved_m = np.linalg.norm(np.diff(one.joints_camera_m[seen].mean(axis=1), axis=0), axis=-1)
        assert moved_m.max() < 0.15, "no person jumps to the other's place"
    (main,) = PoseEstimator(Blob(), people=1).estimate(frames, ROOM_CAMERA)
    np.testing.assert_array_equal(main.joints_camera_m, two[0].joints_camera_m)


def walking(images):
    """Images of one person who walks to the right."""
    return [compose(room(), shifted(standing(), 3 * t - 20)) for t in range(images)]


def test_online_equals_a_recording_in_realtime_mode():
    frames = walking(12)
    online = PoseEstimator(Blob())
    poses = [online.update(frame, ROOM_CAMERA) for frame in frames]
    (whole,) = PoseEstimator(Blob()).estimate(np.stack(frames), ROOM_CAMERA)
    for frame, people in enumerate(poses):
        np.testing.assert_array_equal(people[0].joints_camera_m, whole.joints_camera_m[frame])


def test_online_what_the_network_alone_sees_comes_with_each_person():
    network = Blob()
    (person,) = PoseEstimator(network).update(walking(1)[0], ROOM_CAMERA)
    alone = network.estimate(*network.asked[-1])
    np.testing.assert_array_equal(person.network.joints_camera_m, alone.joints_camera_m[0])
    np.testing.assert_array_equal(person.network.confidence, alone.confidence[0])
    assert (person.joints_camera_m != person.network.joints_camera_m).any()  # which the fit has moved
    (tracked,) = PoseEstimator(None, "tracker").update(walking(1)[0], ROOM_CAMERA)
    assert tracked.network is None


def test_a_person_is_found_in_a_single_image_whatever_their_arms_do():
    for image in (standing(2.4, arms_deg=80), standing(3.0, arms_deg=0, turned=True), standing()):
        (one,) = PoseEstimator(Blob()).estimate(compose(room(), image), ROOM_CAMERA)
        assert np.isfinite(one.joints_camera_m).all()


def test_an_empty_room_gives_an_empty_list_and_a_warning(caplog):
    assert PoseEstimator(Blob()).estimate(np.full((3, 60, 80), 3.0, np.float32), CAMERA) == []
    assert (
        "no person was found in 3 image(s)" in caplog.text and "is 3.00 m away in the median: is its unit right?" in caplog.text
    )
    assert PoseEstimator(Blob()).estimate(np.zeros((3, 60, 80), np.uint16), CAMERA) == []
    assert "The last image measures nothing. For depth that shows nothing but one person: segmented=True" in caplog.text
    caplog.clear()
    assert PoseEstimator(Blob()).estimate(np.zeros((3, 60, 80), np.uint16), CAMERA, segmented=True) == []
    assert "no person was found in 3 image(s)" in caplog.text and "segmented=True" not in caplog.text
    near = np.full((3, 60, 80), 3.0, np.float32)
    near[2] = 0.04  # a hand before the lens, once the unit is known
    assert PoseEstimator(Blob()).estimate(near, CAMERA) == [] and "is 0.04 m away in the median" in caplog.text


def test_realtime_asks_the_network_to_look_thoroughly_where_it_is_unsure_and_best_everywhere():
    asked = []

    def judge(images, sure):
        asked.append(sure)
        return Estimate.missing(len(images)), None

    network = SimpleNamespace(judge=judge, estimate=judge, name="judge")
    for mode in ("realtime", "best"):
        detected(network, mode, [(person(20), CAMERA)])
    assert asked == [SECOND_PASS_CONFIDENCE, 1.0]


class Jittery:
    """A detector of a person who stands still, with a new error of 2 cm in every image."""

    name = "jittery"

    def __init__(self):
        self.rng = np.random.default_rng(0)

    def estimate(self, depth_m, camera):
        error_m = 0.02 * self.rng.standard_normal((len(depth_m), *STILL_M.shape))
        return Estimate((STILL_M + error_m).astype(np.float32), np.full(error_m.shape[:2], 0.95, np.float32))


def test_the_frames_before_steady_a_person_at_rest_and_those_after_more_so():
    depth, spread_m = np.stack([draw_depth(STILL_M)] * 40), {}
    for mode in ("network", "realtime", "best"):
        network = Jittery()
        estimator = network if mode == "network" else PersonEstimator(network, mode)
        spread_m[mode] = estimator.estimate(depth, CAPSULE_CAMERA).joints_camera_m[10:].std(axis=0).mean()
    assert spread_m["best"] < spread_m["realtime"] < 0.7 * spread_m["network"]


def test_whoever_is_beyond_the_number_of_people_is_missed_meanwhile(monkeypatch):
    missed = []
    monkeypatch.setattr(DetectedPerson, "miss", lambda self, time_s: missed.append(time_s))
    first, second = (Human(number, (0, 0, 80, 60), person(column), np.zeros(3)) for number, column in enumerate((20, 50)))
    shown = iter([[second], [first, second], [second]])
    finder = SimpleNamespace(camera=CAMERA, extract=lambda depth_m, time_s: next(shown))
    monkeypatch.setattr("kpopnet.pose.estimator.build_extractor", lambda *_: finder)
    estimator = PoseEstimator(Blob(), people=1)
    seen = [[one.identity for one in estimator.update(person(20), CAMERA)] for _ in range(3)]
    assert seen == [[1], [0], [1]] and len(missed) == 2  # the second, then the first


def test_what_the_network_saw_for_the_finder_is_not_computed_again(monkeypatch):
    network, given = Blob(), []

    def extract(depth_m, time_s):
        human = Human(0, (0, 0, 80, 60), depth_m, np.zeros(3))
        given.extend(looker([human]) if looker else [None])
        return [replace(human, look=given[-1])]

    def build(camera, settings, asked):
        nonlocal looker
        looker = asked
        return SimpleNamespace(camera=CAMERA, extract=extract)

    looker = None
    monkeypatch.setattr("kpopnet.pose.estimator.build_extractor", build)
    assert len(PoseEstimator(network).update(person(20), CAMERA)) == 1
    assert len(network.asked) == 1 and given[0].person_logit is None
    PoseEstimator(None, "tracker").update(person(20), CAMERA)
    assert looker is None  # the tracker asks no network


def test_only_best_sees_the_future_and_both_take_the_times_of_the_images():
    depth = np.stack([person(20 + t) for t in range(12)])
    for mode in ("realtime", "best"):
        whole, start = (PersonEstimator(Jittery(), mode).estimate(one, CAMERA).joints_camera_m for one in (depth, depth[:8]))
        assert np.array_equal(whole[:8], start) is (mode == "realtime")
        slow, quick = (
            PoseEstimator(Jittery(), mode).estimate(depth, CAMERA, fps, segmented=True)[0].joints_camera_m for fps in (10, 60)
        )
        assert not np.allclose(slow, quick)


def test_a_recording_is_estimated_at_its_own_times(tmp_path):
    depth_mm = np.stack([1000 * person(20 + 5 * number) for number in range(5)]).astype(np.uint16)
    np.savez(tmp_path / "depth.npz", depth_mm=depth_mm, times_s=[0, 0.033, 0.067, 0.9, 0.933])
    source = open_depth(tmp_path / "depth.npz", CAMERA)
    given = [source, list(source.timed())]
    one, other = (PoseEstimator(Jittery()).estimate(depth, CAMERA, segmented=True)[0] for depth in given)
    np.testing.assert_array_equal(one.joints_camera_m, other.joints_camera_m)


def test_a_used_estimator_goes_to_another_process_and_begins_anew_there():
    estimator = PoseEstimator.load(mode="tracker", people=2)
    depth_m = compose(standing(), room())
    estimator.update(depth_m, ROOM_CAMERA)
    copied = pickle.loads(pickle.dumps(estimator))
    assert copied.people == 2 and copied.mode == "tracker"
    np.testing.assert_equal(
        copied.update(depth_m, ROOM_CAMERA), PoseEstimator.load(mode="tracker", people=2).update(depth_m, ROOM_CAMERA)
    )


def test_in_a_segmented_recording_who_comes_after_long_is_measured_anew():
    detected, bodies = DetectedPerson(CAMERA, Blob(), "realtime"), []
    for time_s, image in (
        (0.0, person(30)),
        (9.0, 0 * person(30)),
        (18.0, 0 * person(30)),
        (19.0, person(30)),
        (20.0, person(30)),
    ):
        detected.update(image, CAMERA, time_s)
        bodies.append(detected._body)
    assert bodies[0] is bodies[2] is not bodies[3] is bodies[4]


def test_who_is_found_again_after_long_is_measured_anew():
    detected, human = DetectedPerson(CAMERA, Blob(), "realtime"), Human(0, (0, 0, 80, 60), person(30), np.zeros(3))
    bodies = []
    for time_s in (0.0, 9.0, 19.5, 20.0):
        detected.see(human, time_s)
        bodies.append(detected._body)
    assert bodies[0] is bodies[1] is not bodies[2] is bodies[3]


def test_the_first_of_a_recordings_people_is_who_is_seen_longest():
    frames = [compose(room(), shifted(standing(2.6), -45)) for _ in range(12)]
    frames = [compose(one, shifted(standing(3.2), 45)) if 4 <= t < 8 else one for t, one in enumerate(frames)]
    first, second = PoseEstimator(Blob(), people=2).estimate(frames, ROOM_CAMERA)
    seen = [np.isfinite(one.joints_camera_m).all(axis=(1, 2)).sum() for one in (first, second)]
    assert seen[0] > seen[1]
    (main,) = PoseEstimator(Blob(), people=1).estimate(frames, ROOM_CAMERA)
    assert main.identity == first.identity


def test_the_main_person_is_the_one_seen_in_most_images(monkeypatch):
    estimator = PoseEstimator(Blob())
    pose, found = Pose(POSE_M, np.ones(15, np.float32)), iter([(0,), (0, 1), (1,), (1, 2), (2,)])
    monkeypatch.setattr(estimator, "_found", lambda *image: dict.fromkeys(next(found), pose))
    (person,) = estimator.estimate(np.zeros((5, 60, 80), np.uint16), CAMERA)
    assert person.identity == 1 and person.confidence.any(axis=1).tolist() == [False, True, True, True, False]
