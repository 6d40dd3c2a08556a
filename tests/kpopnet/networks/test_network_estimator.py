"""The network as an estimator: it gets the crops that it was trained on, and says when it is given a room for a person."""

from dataclasses import asdict

import numpy as np
import pytest
from capsule_people import CAMERA, CapsulePeople
from checkpoints import save_untrained
from factories import draw_room
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.camera import CAMERAS
from kpopnet.data.batches import AugmentConfig, CropBatches, EvenOrder, occlude
from kpopnet.data.cube import Cube, View, crop, person_centre
from kpopnet.networks import ModelConfig
from kpopnet.networks.estimator import CONFIDENCE_MARGIN, NetworkEstimator, fused, relative_sizes, run_upright, second_cube
from kpopnet.pose.person import detected
from kpopnet.programs.score import seeing_estimator
from kpopnet.ridge import RidgeConfig
from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint


@pytest.fixture(scope="module")
def estimator(tmp_path_factory) -> NetworkEstimator:
    return NetworkEstimator(save_untrained(tmp_path_factory.mktemp("run")))


@pytest.mark.parametrize("occluder", [0, 1])
def test_a_training_crop_is_the_crop_that_inference_makes_of_the_same_depth(tmp_path, monkeypatch, occluder):
    """Bit for bit in both channels, occluded or not: no ridge of covered parts shows through."""
    model, people, ridge = ModelConfig(input="depth_ridge", crop_px=32, widths=[8, 8, 8, 8]), CapsulePeople(6), RidgeConfig(0.6)
    estimator = NetworkEstimator(save_untrained(tmp_path, model, config={"ridge": asdict(ridge)}))

    occluded = []
    monkeypatch.setattr("kpopnet.data.batches.occlude", lambda *given: occluded.append(occlude(*given)) or occluded[-1])
    augment = AugmentConfig(mirror=0, rotation_deg=0, scale=0, jitter_m=0, occluder=occluder)
    trained_on = CropBatches(people, model, EvenOrder(6, 6, 6), 0, augment, ridge)[0].crop
    whole = [people.observe(index, 0).depth_m for index in range(6)]
    assert len(occluded) == 6 * occluder
    depth_m = np.stack(occluded or whole)

    seen = []
    predict = estimator.backend
    monkeypatch.setattr(estimator, "backend", lambda crops: seen.append(crops) or predict(crops))
    estimator.estimate(depth_m, CAMERA)
    np.testing.assert_array_equal(trained_on, seen[0])
    assert trained_on[:, 1].max() > 0.5
    if occluder:
        seen.clear()
        estimator.estimate(np.stack(whole), CAMERA)
        assert not np.array_equal(trained_on, seen[0])


ARROW = np.zeros((1, 32, 32), np.float32)
"""A crop whose upper half shows that the person is upright."""
ARROW[:, :16] = 1


def knowing_arrows(sure_by_turns):
    """A network that sees the person of every crop as ARROW turned counterclockwise by quarters, as sure of it as is given."""
    upright = np.random.default_rng(0).uniform(-0.3, 0.3, (NUM_JOINTS, 3)).astype(np.float32)
    upright[Joint.NECK, :2], upright[[Joint.LEFT_HIP, Joint.RIGHT_HIP], :2] = (0.1, -0.6), [(-0.1, 0.1), (0.1, 0.2)]

    def network(crops):
        turns = [next(k for k in range(4) if np.array_equal(np.rot90(ARROW, k, (1, 2)), crop)) for crop in crops]
        joints = [np.column_stack([upright[:, :2] @ View(-k * np.pi / 2).matrix().T, upright[:, 2]]) for k in turns]
        sure = np.array([sure_by_turns[k] for k in turns], np.float32)
        return np.stack(joints).astype(np.float32), np.repeat(sure[:, None], NUM_JOINTS, 1), sure

    return network


def turned(quarters):
    return np.stack([np.rot90(ARROW, k, (1, 2)) for k in quarters])


def test_a_person_who_is_not_upright_is_seen_upright():
    crops = turned((0, 1, 2, 3, 2))
    network = knowing_arrows([0.9, 0.5, 0.6, 0.7])
    expected = network(crops)
    joints, confidence, person = run_upright(network, crops)
    np.testing.assert_allclose(joints, expected[0], atol=1e-6)  # where they are in the crop as it is
    assert np.allclose(confidence, 0.9)
    np.testing.assert_array_equal(person, expected[2])


def test_only_a_network_that_is_surer_of_the_upright_person_is_believed():
    asked, crops = [], turned(range(4))
    network = knowing_arrows([0.5, 0.5 - 2 * CONFIDENCE_MARGIN, 0.5 - 0.5 * CONFIDENCE_MARGIN, 0.8])

    def unlike(some):
        """Puts joints of its second answer elsewhere."""
        asked.append(len(some))
        joints, sure, person = network(some)
        return joints + np.float32(len(asked) - 1), sure, person

    joints, confidence, _ = run_upright(unlike, crops)
    assert asked == [4, 3]
    np.testing.assert_allclose(confidence[:, 0], [0.5, 0.5, 0.5 - 0.5 * CONFIDENCE_MARGIN, 0.8], atol=1e-6)
    as_they_are = network(crops)[0]
    np.testing.assert_allclose(joints[[0, 2, 3]], as_they_are[[0, 2, 3]], atol=1e-6)
    assert np.abs(joints[1] - as_they_are[1]).min() > 0.5


def test_who_is_upright_is_looked_at_once_and_a_network_need_not_judge_nor_see_depth_alone():
    network, asked = knowing_arrows([0.9, 0.5, 0.5, 0.5]), []

    def of_the_second_channel(crops):
        asked.append(len(crops))
        return *network(crops[:, 1:])[:2], None

    upright = turned((0, 0))
    two_channels = np.concatenate([1 - upright, upright], axis=1)
    assert run_upright(of_the_second_channel, two_channels)[2] is None and asked == [2]
    lying = turned((1, 0))
    _, confidence, _ = run_upright(of_the_second_channel, np.concatenate([1 - lying, lying], axis=1))
    assert asked == [2, 2, 1] and np.allclose(confidence, 0.9)


def answering(estimator, monkeypatch, answers):
    """The crops that the estimator asks its backend about, whose answers are (joints in cube units, confidence), one a crop;
    the logit that it is a person is the number of the crop."""
    crops, answers = [], iter(answers)

    def backend(asked):
        crops.extend(asked)
        joints, sure = zip(*(next(answers) for _ in asked), strict=True)
        return np.float32(joints), np.float32(sure), np.arange(len(crops) - len(asked), len(crops), dtype=np.float32)

    monkeypatch.setattr(estimator, "backend", backend)
    return crops


def standing(cube, share=1.0):
    """(15, 3) joints of an adult who stands in the middle of the cube, or of another share of their size, in cube units."""
    lengths = np.linspace(-0.6, 0.6, NUM_JOINTS)  # of no particular person, but upright
    joints_m = np.column_stack([np.arange(NUM_JOINTS) % 2 / 10, lengths, np.zeros(NUM_JOINTS)])
    return cube.to_uvd(joints_m * share / relative_sizes(joints_m) + cube.centre_m)


SURELY, HARDLY = np.full(NUM_JOINTS, 0.95), np.linspace(0.3, 0.6, NUM_JOINTS)


@pytest.mark.parametrize("batch", [1, 2, 32])
def test_who_is_seen_surely_is_looked_at_once_others_and_children_twice_and_at_best_all(estimator, monkeypatch, batch):
    """Whatever the batch, and with no person in the first image."""
    monkeypatch.setattr("kpopnet.networks.estimator.BATCH", batch)
    people = CapsulePeople(3)
    images = [(people.observe(index, 0).depth_m, CAMERA) for index in range(3)]
    cubes = [Cube(person_centre(*image), estimator.model.half_size_m) for image in images]
    first = [(standing(cubes[0]), SURELY), (standing(cubes[1]), HARDLY), (standing(cubes[2], 0.8), SURELY)]
    for sure, twice in ((0.9, [1, 2]), (1.0, [0, 1, 2])):
        order = [rows for start in range(0, 3, batch) for rows in (range(start, min(start + batch, 3)),)]
        looks = [(row, number) for rows in order for number in (0, 1) for row in rows if number == 0 or row in twice]
        crops = answering(estimator, monkeypatch, [first[row] for row, _ in looks])
        (_, confidence), person_logit = estimator.judge([(np.zeros_like(images[0][0]), CAMERA), *images], sure)
        assert len(crops) == len(looks) and person_logit[0] == -np.inf and not confidence[0].any()
        for row in range(3):
            opinions = [number for number, (of, _) in enumerate(looks) if of == row]
            assert person_logit[row + 1] == np.mean(opinions)
            once = first[row][1].astype(np.float32)
            expected = (once + once[MIRROR]) / 2 if row in twice else once
            np.testing.assert_allclose(confidence[row + 1], expected, atol=1e-6)
        again_of = [(row, crop) for (row, number), crop in zip(looks, crops, strict=True) if number]
        for row, seen in again_of:
            again = second_cube(cubes[row], cubes[row].to_metres(first[row][0].astype(np.float32)))
            np.testing.assert_array_equal(seen[..., ::-1], crop(*images[row], again, estimator.model.crop_px))
            assert again.half_size_m == pytest.approx(estimator.model.half_size_m * (0.8 if row == 2 else 1))


def test_both_looks_are_at_the_same_person_whose_left_stays_left(estimator, monkeypatch):
    """A network that sees joints in the middle of each half of a silhouette sees them there again, wherever the cube and
    however large it is: within two pixels of the crop."""
    image = CapsulePeople(1).observe(0, 0).depth_m

    def halves(crops):
        joints = np.zeros((len(crops), NUM_JOINTS, 3), np.float32)
        for row, (measured,) in enumerate(crops < 1):
            at = (np.argwhere(measured)[:, ::-1] + 0.5) * 2 / measured.shape[0] - 1
            order = np.argsort(at[:, 0])
            joints[row, :, :2] = np.median(at, axis=0)
            for joint in Joint:
                if joint.name.startswith(("RIGHT", "LEFT")):
                    half = order[: len(order) // 2] if joint.name.startswith("RIGHT") else order[len(order) // 2 :]
                    joints[row, joint, :2] = at[half].mean(axis=0)
        return joints, np.full((len(crops), NUM_JOINTS), 0.5, np.float32), None

    monkeypatch.setattr(estimator, "backend", halves)
    once_m, twice_m = (estimator.judge([(image, CAMERA)], sure)[0].joints_camera_m[0] for sure in (0.4, 1.0))
    monkeypatch.setattr("kpopnet.networks.estimator.CHILD_SIZE", 0.0)
    plain_m = estimator.judge([(image, CAMERA)], 0.4)[0].joints_camera_m[0]
    pixel_m = 2 * estimator.model.half_size_m / estimator.model.crop_px
    assert np.abs(once_m - plain_m)[:, :2].max() < 2 * pixel_m and np.abs(twice_m - plain_m)[:, :2].max() < 2 * pixel_m
    assert plain_m[Joint.LEFT_HAND, 0] - plain_m[Joint.RIGHT_HAND, 0] > 4 * pixel_m  # 36 cm


def test_the_second_cube_lies_where_the_joints_are_and_is_as_large_as_the_person():
    cube = Cube(np.float32([0.2, -0.1, 2.0]), 1.15)
    adult_m = cube.to_metres(standing(cube))
    hidden_legs_m = adult_m + np.float32([0, 0.4, 0.1])  # the silhouette's centre lies 40 cm above that of the joints
    again = second_cube(cube, hidden_legs_m)
    middle_m = (cube.centre_m + hidden_legs_m.mean(axis=0) - [0, 0, 0.1]) / 2
    np.testing.assert_allclose(again.centre_m, middle_m, atol=1e-6)
    assert again.half_size_m == cube.half_size_m
    for share, expected in ((0.86, 1), (0.84, 0.84), (0.7, 0.7), (0.3, 0.6)):
        child_m = cube.to_metres(standing(cube, share))
        assert second_cube(cube, child_m).half_size_m == pytest.approx(expected * cube.half_size_m)
    astray_m = adult_m - np.float32([0, 0, 8])  # behind the camera
    assert second_cube(cube, astray_m).centre_m[2] == pytest.approx(1.0)


@given(arrays(np.float32, (2, 3, NUM_JOINTS), elements=st.floats(0, 1, width=32)))
def test_joints_of_two_looks_are_weighed_by_the_odds_that_they_are_right(sure):
    """Each for itself: 2 to 1 of each other, the same of the same, neither ever certain, and always between both."""
    here, there = np.zeros((3, NUM_JOINTS, 3)), np.ones((3, NUM_JOINTS, 3))
    joints_m, confidence = fused(here, sure[0], there, sure[1])
    np.testing.assert_allclose(confidence, sure.mean(axis=0), atol=1e-6)
    assert (joints_m > 0).all() and (joints_m < 1).all()
    surer = np.sign(sure.clip(0.001, 0.999)[1] - sure.clip(0.001, 0.999)[0])
    assert (np.sign(joints_m - 0.5) * surer[..., None] >= 0).all()
    sure[0], sure[1] = 0.5, 2 / 3
    np.testing.assert_allclose(fused(here, sure[0], there, sure[1])[0], 2 / 3, atol=1e-6)


@pytest.mark.parametrize("mode", ["realtime", "best"])
def test_people_of_an_image_are_looked_at_at_once_as_one_by_one(mode, monkeypatch):
    """Of cameras of their own; one whose silhouette is too small is not judged, and does not disturb the others."""
    network = NetworkEstimator()  # the package's judges
    people = CapsulePeople(3)
    images = [(people.observe(index, 0).depth_m, CAMERA) for index in range(3)]
    images[1] = images[1][0][10:, 20:], CAMERA.cropped(20, 10, CAMERA.width - 20, CAMERA.height - 10)
    images.insert(1, (np.zeros_like(images[0][0]), CAMERA))
    asked, predict = [], network.backend
    monkeypatch.setattr(network, "backend", lambda crops: asked.append(len(crops)) or predict(crops))
    together = detected(network, mode, images)
    assert asked[0] == 3
    for image, found in zip(images, together, strict=True):
        (alone,) = detected(network, mode, [image])
        np.testing.assert_allclose(found.joints_camera_m, alone.joints_camera_m, atol=1e-5)
        np.testing.assert_allclose(found.confidence, alone.confidence, atol=1e-5)
        assert (found.person_logit is None) == (alone.person_logit is None) == (not image[0].any())
        assert found.person_logit is None or found.person_logit == pytest.approx(alone.person_logit, abs=1e-4)
    assert detected(network, mode, []) == []


def test_a_room_is_reported_once(estimator, caplog):
    camera = CAMERAS["kinect_v1"]
    room_m = np.repeat(draw_room(camera)[None], 3, axis=0)
    for _ in range(2):
        estimator.estimate(room_m, camera)
    (record,) = caplog.records
    assert "shows a whole room" in record.message and "extract_person" in record.message


def test_a_teacher_is_seen_by_the_network_as_lessons_see_learners():
    """In two passes over everybody, however many images there are."""
    people, network = CapsulePeople(3), NetworkEstimator()
    images = [(people.observe(index, 0).depth_m, CAMERA) for index in range(3)]
    seen = seeing_estimator("network").estimate(np.stack([depth_m for depth_m, _ in images]), CAMERA)
    learners = detected(network, "best", images)
    np.testing.assert_allclose(seen.joints_camera_m, [one.joints_camera_m for one in learners], atol=1e-5)
