import pickle
from dataclasses import replace

import numpy as np
import pytest
from factories import CAMERA_HEIGHT_M, draw_room, write_shard

from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.skeleton import Joint
from synth.samples.observe import ExtractionConfig, FreezeConfig, Observer, freeze, observe_sample
from synth.sensor.model import SENSORS

PERFECT = ExtractionConfig(**dict.fromkeys(vars(ExtractionConfig()), 0))
IDEAL, KINECT = SENSORS["ideal"], SENSORS["kinect_v1"]
RIDGE = RidgeConfig()


@pytest.fixture(scope="module")
def shards(tmp_path_factory):
    folder = tmp_path_factory.mktemp("set")
    write_shard(folder, 0, 3)
    write_shard(folder, 1, 3, empty=(2,))
    return ShardedSet(folder)


@pytest.fixture(scope="module")
def clean(shards):
    return whole(shards)


def observed(shards, extraction=PERFECT, sensor=IDEAL, index=0, seed=0, **changes):
    sample = shards[index]
    rng, room = np.random.default_rng(seed), shards.room(index, sample.room)
    return observe_sample(replace(sample, **changes), room, shards.camera, sensor, extraction, rng)


def full_image(observation, camera):
    """The observation's depth, pasted into a full image."""
    x0, y0 = round(camera.cx - observation.camera.cx), round(camera.cy - observation.camera.cy)
    pasted = np.zeros((camera.height, camera.width), np.float32)
    pasted[y0 : y0 + observation.camera.height, x0 : x0 + observation.camera.width] = observation.depth_m
    return pasted


def whole(shards, seed=0, **failures):
    """What is seen of the first sample with some failures of the segmentation, as a full image."""
    return full_image(observed(shards, replace(PERFECT, **failures), seed=seed), shards.camera)


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
    first, elsewhere, other = (Observer(shards, KINECT, ExtractionConfig(), seed) for seed in (5, 5, 6))
    forwards = [first.observe(index, 2) for index in range(len(first))]
    elsewhere = pickle.loads(pickle.dumps(elsewhere))
    backwards = [elsewhere.observe(index, 2) for index in reversed(range(len(first)))][::-1]
    assert all(same(a, b) for a, b in zip(forwards, backwards, strict=True))
    assert not same(forwards[0], first.observe(0, 3)) and not same(forwards[0], other.observe(0, 2))


def test_feet_are_cut_at_a_height_above_the_floor(shards, clean):
    def lowest_m(image_m):
        return (CAMERA_HEIGHT_M - shards.camera.points(image_m)[image_m > 0][:, 1]).min()

    images = [whole(shards, seed, feet_cut_m=0.3) for seed in range(20)]
    heights_m = [*map(lowest_m, images)]
    assert 0.2 < max(heights_m) <= 0.31 and min(heights_m) >= lowest_m(clean) - 1e-6
    upper = np.s_[: shards.camera.height // 2]
    assert np.array_equal(images[-1][upper], clean[upper])
    # Whichever way the floor's normal points, the camera is above it.
    (room_mm, floor), look = shards.room(0, shards[0].room), (shards.camera, IDEAL, replace(PERFECT, feet_cut_m=0.3))
    one, other = (observe_sample(shards[0], (room_mm, sign * floor), *look, np.random.default_rng(0)) for sign in (1, -1))
    assert same(one, other)


def test_erosion_and_dilation_change_the_silhouette_by_one_pixel(shards, clean):
    smaller, larger = whole(shards, erode=1.0), whole(shards, dilate=1.0)
    mask = np.pad(clean > 0, 1)
    neighbours = np.stack([mask[1:-1, 1:-1], mask[2:, 1:-1], mask[:-2, 1:-1], mask[1:-1, 2:], mask[1:-1, :-2]])
    assert np.array_equal(smaller > 0, neighbours.all(0))
    assert np.array_equal(larger > 0, neighbours.any(0))
    assert np.array_equal(larger[clean > 0], clean[clean > 0])
    assert larger.max() <= clean.max()


def test_attached_pieces_are_room_near_the_person(shards, clean):
    camera, room = shards.camera, draw_room(shards.camera)
    people = camera.points(clean)[clean > 0]
    added = 0
    for seed in range(12):
        image = whole(shards, seed, attached=1.0)
        extra = (image > 0) & (clean == 0)
        added += extra.any()
        assert np.allclose(image[extra], room[extra], atol=1e-3)
        for point in camera.points(image)[extra][::20]:
            assert np.linalg.norm(people - point, axis=1).min() < 0.3
    assert added >= 4


def test_what_is_measured_holds_an_attached_piece_at_the_nearest_pixel(shards):
    """A far pixel in the box, as of a wall between the legs, does not narrow it."""
    sample, camera = shards[0], shards.camera
    (x0, _, x1, _), depth_mm = sample.box, sample.depth_mm.copy()
    nearest_m = depth_mm[depth_mm > 0].min() / 1000
    depth_mm[tuple(np.argwhere(depth_mm)[0])] = 60000
    seen = observed(shards, replace(PERFECT, attached=1.0), depth_mm=depth_mm)
    left_px, reach_px = round(camera.cx - seen.camera.cx), 0.3 * camera.fx / nearest_m
    assert left_px <= max(x0 - reach_px, 0) and left_px + seen.camera.width >= min(x1 + reach_px, camera.width)


def test_a_missing_hand_is_removed_and_the_rest_remains(shards, clean):
    gone = []
    for seed in range(8):
        lost = (whole(shards, seed, hand_missing=1.0) == 0) & (clean > 0)
        assert 0 < lost.sum() < 0.1 * (clean > 0).sum()
        hands = shards.camera.project(shards[0].joints_camera_m[[Joint.RIGHT_HAND, Joint.LEFT_HAND]])
        gone.append([lost[round(v), round(u)] for u, v, _ in hands])
    assert np.sum(gone, axis=1).tolist() == [1] * 8 and np.sum(gone, axis=0).min() > 0


def test_frozen_images_equal_the_observation_and_are_returned_as_stored(shards, tmp_path):
    sample = shards[1]
    rng, look = np.random.default_rng(3), FreezeConfig(KINECT, ExtractionConfig(), RIDGE)
    depth_mm, ridge = freeze(sample, shards.room(1, sample.room), shards.camera, look, rng)
    seen_m = full_image(observed(shards, ExtractionConfig(), KINECT, index=1, seed=3), shards.camera)
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
    room_mm, floor = shards.room(0, sample.room)
    small_mm, rng = room_mm[:20, :30].copy(), np.random.default_rng(0)
    with pytest.raises(InputError, match=r"sample and room: an image of shape \(20, 30\), expected .* \(240, 320\)"):
        observe_sample(sample, (small_mm, floor), camera, KINECT, PERFECT, rng)
    with pytest.raises(InputError, match=r"the box .* is not within 320x240"):
        observed(shards, box=(0, 0, 321, 240))


def test_hair_that_returns_nothing_is_missing_in_all_images_of_a_person_and_above_the_face(shards, clean):
    head, neck = shards[0].joints_camera_m[[Joint.HEAD, Joint.NECK]]
    axis = (head - neck) / np.linalg.norm(head - neck)
    # The hairline belongs to the person, not to the image.
    lost, *others = [(whole(shards, seed, hair_missing=1.0) == 0) & (clean > 0) for seed in range(3)]
    assert all(np.array_equal(lost, other) for other in others)
    with_hair = [observed(shards, replace(PERFECT, hair_missing=0.5), body=body) for body in range(12)]
    assert 0 < sum(same(one, observed(shards)) for one in with_hair) < 12
    points = shards.camera.points(clean)[lost]
    assert lost.any() and ((points - head) @ axis).min() > 0.02
    assert np.linalg.norm(points - head, axis=1).max() < 0.35


def test_other_sensors_measure_their_share_and_only_that(shards):
    plain, some, other = (
        [Observer(shards, IDEAL, PERFECT, 3, others).observe(i, epoch).depth_m for epoch in range(8) for i in range(5)]
        for others in ({}, {"ideal": 0.0, "kinect_v1": 0.5}, {"kinect_v1": 1.0})
    )
    by_other = [not np.array_equal(found, expected) for found, expected in zip(some, plain, strict=True)]
    for found, expected, taken in zip(some, other, by_other, strict=True):
        assert not taken or np.array_equal(found, expected)
    assert abs(np.mean(by_other) - 0.5) < 4 * 0.5 / len(by_other) ** 0.5
