import dataclasses
import pickle

import numpy as np
import pytest
from factories import CAMERA_HEIGHT_M, draw_room, write_shard

from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.skeleton import Joint
from synth.samples.observe import (
    PERFECT,
    Background,
    ExtractionConfig,
    FreezeConfig,
    Observer,
    OtherSensors,
    freeze,
    observe_sample,
)
from synth.sensor.model import SENSORS

IDEAL, KINECT = SENSORS["ideal"], SENSORS["kinect_v1"]
RIDGE = RidgeConfig()


@pytest.fixture(scope="module")
def shards(tmp_path_factory):
    folder = tmp_path_factory.mktemp("set")
    write_shard(folder, 0, 3)
    write_shard(folder, 1, 3, empty=(2,))
    return ShardedSet(folder)


def seeded(i=0):
    return np.random.default_rng(i)


def observed(shards, extraction=PERFECT, sensor=IDEAL, index=0, seed=0):
    sample = shards[index]
    room = Background(*shards.room(index, sample.room))
    return observe_sample(sample, room, shards.camera, sensor, extraction, seeded(seed))


def full_image(observation, camera):
    """The observation's depth, pasted into a full image."""
    x0, y0 = round(camera.cx - observation.camera.cx), round(camera.cy - observation.camera.cy)
    whole = np.zeros((camera.height, camera.width), np.float32)
    whole[y0 : y0 + observation.camera.height, x0 : x0 + observation.camera.width] = observation.depth_m
    return whole


def same(a, b):
    return a.camera == b.camera and np.array_equal(a.depth_m, b.depth_m)


def test_without_noise_and_failures_the_observation_is_the_clean_depth(shards):
    for index in range(5):
        sample, seen = shards[index], observed(shards, index=index)
        assert np.array_equal(np.rint(full_image(seen, shards.camera) * 1000), sample.depth_mm)
        uv = seen.camera.project(seen.joints_camera_m[Joint.TORSO])
        assert seen.depth_m[round(uv[1]), round(uv[0])] > 0
        assert seen.depth_m.size < sample.depth_mm.size / 2


def test_an_observation_depends_only_on_seed_index_and_epoch(shards):
    def observer(seed):
        return Observer(shards, KINECT, ExtractionConfig(), seed)

    first = observer(5)
    forwards = [first.observe(index, 2) for index in range(len(first))]
    elsewhere = pickle.loads(pickle.dumps(observer(5)))
    backwards = [elsewhere.observe(index, 2) for index in reversed(range(len(first)))][::-1]
    assert all(same(a, b) for a, b in zip(forwards, backwards, strict=True))
    assert not same(forwards[0], first.observe(0, 3))
    assert not same(forwards[0], observer(6).observe(0, 2))


def test_feet_are_cut_at_a_height_above_the_floor(shards):
    cut = dataclasses.replace(PERFECT, feet_cut_m=0.3)
    camera, lowest = shards.camera, []
    for seed in range(20):
        whole = full_image(observed(shards, cut, seed=seed), camera)
        points = camera.points(whole)[whole > 0]
        lowest.append((CAMERA_HEIGHT_M - points[:, 1]).min())
    clean = full_image(observed(shards), camera)
    bare = (CAMERA_HEIGHT_M - camera.points(clean)[clean > 0][:, 1]).min()
    assert 0.2 < max(lowest) <= 0.31 and min(lowest) >= bare - 1e-6
    upper = np.s_[: camera.height // 2]
    assert np.array_equal(whole[upper], clean[upper])


def test_erosion_and_dilation_change_the_silhouette_by_one_pixel(shards):
    camera = shards.camera
    clean = full_image(observed(shards), camera)
    smaller = full_image(observed(shards, dataclasses.replace(PERFECT, erode=1.0)), camera)
    larger = full_image(observed(shards, dataclasses.replace(PERFECT, dilate=1.0)), camera)
    mask = np.pad(clean > 0, 1)
    neighbours = np.stack([mask[1:-1, 1:-1], mask[2:, 1:-1], mask[:-2, 1:-1], mask[1:-1, 2:], mask[1:-1, :-2]])
    assert np.array_equal(smaller > 0, neighbours.all(0))
    assert np.array_equal(larger > 0, neighbours.any(0))
    assert np.array_equal(larger[clean > 0], clean[clean > 0])
    assert larger.max() <= clean.max()


def test_attached_pieces_are_room_near_the_person(shards):
    attach = dataclasses.replace(PERFECT, attached=1.0)
    camera, room = shards.camera, draw_room(shards.camera)
    clean = full_image(observed(shards), camera)
    people = camera.points(clean)[clean > 0]
    added = 0
    for seed in range(12):
        whole = full_image(observed(shards, attach, seed=seed), camera)
        extra = (whole > 0) & (clean == 0)
        added += extra.any()
        assert np.allclose(whole[extra], room[extra], atol=1e-3)
        for point in camera.points(whole)[extra][::20]:
            assert np.linalg.norm(people - point, axis=1).min() < 0.3
    assert added >= 4


def test_what_is_measured_holds_an_attached_piece_at_the_nearest_pixel(shards):
    """A far pixel in the box, as of a wall between the legs, does not narrow it."""
    sample, camera = shards[0], shards.camera
    (x0, _, x1, _), depth_mm = sample.box, sample.depth_mm.copy()
    nearest_m = depth_mm[depth_mm > 0].min() / 1000
    depth_mm[tuple(np.argwhere(depth_mm)[0])] = 60000
    room, attach = Background(*shards.room(0, sample.room)), dataclasses.replace(PERFECT, attached=1.0)
    seen = observe_sample(dataclasses.replace(sample, depth_mm=depth_mm), room, camera, IDEAL, attach, seeded())
    left_px, reach_px = round(camera.cx - seen.camera.cx), 0.3 * camera.fx / nearest_m
    assert left_px <= max(x0 - reach_px, 0) and left_px + seen.camera.width >= min(x1 + reach_px, camera.width)


def test_a_missing_hand_is_removed_and_the_rest_remains(shards):
    missing = dataclasses.replace(PERFECT, hand_missing=1.0)
    clean = full_image(observed(shards), shards.camera)
    gone = []
    for seed in range(8):
        lost = (full_image(observed(shards, missing, seed=seed), shards.camera) == 0) & (clean > 0)
        assert 0 < lost.sum() < 0.1 * (clean > 0).sum()
        hands = shards.camera.project(shards[0].joints_camera_m[[Joint.RIGHT_HAND, Joint.LEFT_HAND]])
        gone.append([lost[round(v), round(u)] for u, v, _ in hands])
    assert np.sum(gone, axis=1).tolist() == [1] * 8 and np.sum(gone, axis=0).min() > 0


def test_frozen_images_equal_the_observation_and_are_returned_as_stored(shards, tmp_path):
    sample = shards[1]
    room = Background(*shards.room(1, sample.room))
    depth_mm, ridge = freeze(sample, room, shards.camera, FreezeConfig(KINECT, ExtractionConfig(), RIDGE), seeded(3))
    seen_m = full_image(observe_sample(sample, room, shards.camera, KINECT, ExtractionConfig(), seeded(3)), shards.camera)
    assert depth_mm.dtype == np.uint16 and np.array_equal(depth_mm, np.rint(seen_m * 1000))
    assert ridge.dtype == np.uint8 and np.array_equal(ridge, np.rint(ridge_probability(seen_m, RIDGE) * 255))
    assert ridge[depth_mm == 0].max() == 0 and ridge.max() == 255

    write_shard(tmp_path, 0, 2, empty=(1,), kind="frozen")
    frozen = ShardedSet(tmp_path)
    observer = Observer(frozen, KINECT, ExtractionConfig(), 0)
    seen = observer.observe(0, 4)
    assert np.array_equal(np.rint(full_image(seen, frozen.camera) * 1000), frozen[0].depth_mm)
    assert same(seen, observer.observe(0, 5)) and not observer.observe(1, 0).depth_m.any()


def test_a_room_smaller_than_the_frame_and_a_box_outside_it_are_refused(shards):
    """A compiled function would read beyond the room's end, and give foreign memory as depth."""
    sample, camera = shards[0], shards.camera
    room = Background(*shards.room(0, sample.room))
    small = Background(room.depth_mm[:20, :30].copy(), room.floor)
    for wrong_sample, wrong_room, message in (
        (sample, small, r"sample and room: an image of shape \(20, 30\), expected .* \(240, 320\)"),
        (dataclasses.replace(sample, box=(0, 0, 321, 240)), room, "the box .* is not within 320x240"),
    ):
        with pytest.raises(InputError, match=message):
            observe_sample(wrong_sample, wrong_room, camera, KINECT, PERFECT, seeded())


def test_hair_that_returns_nothing_is_missing_in_all_images_of_a_person_and_above_the_face(shards):
    camera = shards.camera
    missing = dataclasses.replace(PERFECT, hair_missing=1.0)
    sample = shards[0]
    head, neck = sample.joints_camera_m[[Joint.HEAD, Joint.NECK]]
    axis = (head - neck) / np.linalg.norm(head - neck)
    clean = full_image(observed(shards), camera)
    lost = (full_image(observed(shards, missing), camera) == 0) & (clean > 0)
    points = camera.points(clean)[lost]
    assert lost.any() and ((points - head) @ axis).min() > 0.02
    assert np.linalg.norm(points - head, axis=1).max() < 0.35
    for seed in range(1, 3):  # the hairline belongs to the person, not to the image
        assert np.array_equal(lost, (full_image(observed(shards, missing, seed=seed), camera) == 0) & (clean > 0))


def test_other_sensors_measure_their_share_and_only_that(shards):
    plain, some, other = (
        [Observer(shards, IDEAL, PERFECT, 3, others).observe(i, epoch).depth_m for epoch in range(8) for i in range(5)]
        for others in (OtherSensors(), OtherSensors(kinect_v1=0.5), OtherSensors(kinect_v1=1.0))
    )
    by_other = [not np.array_equal(found, expected) for found, expected in zip(some, plain, strict=True)]
    for found, expected, taken in zip(some, other, by_other, strict=True):
        assert not taken or np.array_equal(found, expected)
    assert abs(np.mean(by_other) - 0.5) < 4 * 0.5 / len(by_other) ** 0.5
