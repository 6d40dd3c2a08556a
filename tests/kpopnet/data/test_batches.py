"""Batches are pure functions of seed and step; augmentation transforms crop and target; empty silhouettes are replaced."""

import multiprocessing
import os
import pickle
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import torch
from capsule_people import CapsulePeople

from kpopnet.data import batches as batches_module
from kpopnet.data.batches import AugmentConfig, CropBatches, EvenOrder, ShuffledOrder, batch_loader, occlude
from kpopnet.data.cube import Cube, person_centre
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.skeleton import Joint

MODEL = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])


def batches(count=40, augment=None, batch_size=8, seed=3, model=MODEL, **people):
    return CropBatches(CapsulePeople(count, **people), model, ShuffledOrder(count, batch_size, seed), seed, augment)


def same(first, second):
    return all(np.array_equal(np.asarray(a), np.asarray(b)) for a, b in zip(first, second, strict=True))


def keys_of(order, steps):
    return [key for step in range(steps) for key in order(step)]


def test_every_epoch_holds_every_sample_once_in_its_own_order_and_processes_share_a_batch():
    order = ShuffledOrder(num_samples=10, batch_size=4, seed=1)
    keys = keys_of(order, 5)  # two epochs
    assert Counter(keys) == Counter((index, epoch) for epoch in range(2) for index in range(10))
    assert [index for index, epoch in keys if epoch == 0] != [index for index, epoch in keys if epoch == 1]
    assert keys != keys_of(ShuffledOrder(10, 4, seed=2), 5)
    assert order(2) == [key for rank in range(4) for key in ShuffledOrder(10, 4, 1, rank, 4)(2)]
    even = EvenOrder(num_samples=100, batch_size=4, count=10)
    assert keys_of(even, 3) == [(10 * i, 0) for i in range(10)]


def test_a_batch_depends_only_on_seed_and_step():
    augment = AugmentConfig()
    assert same(batches(augment=augment)[7], pickle.loads(pickle.dumps(batches(augment=augment)))[7])
    assert not same(batches(augment=augment)[7], batches(augment=augment)[8])
    assert not same(batches(augment=augment)[7], batches(augment=augment, seed=4)[7])


def test_plain_crops_and_targets():
    data = batches()
    batch = data[0]
    for row, (index, epoch) in enumerate(data.order(0)):
        observation = data.source.observe(index, epoch)
        cube = Cube(person_centre(observation.depth_m, observation.camera), MODEL.half_size_m)
        np.testing.assert_allclose(cube.to_metres(batch.target[row]), observation.joints_camera_m, atol=1e-5)
        np.testing.assert_allclose(batch.offset_m[row], observation.joints_camera_m - cube.centre_m, atol=1e-6)
        np.testing.assert_array_equal(batch.cube_m[row], [*cube.centre_m, np.float32(MODEL.half_size_m)])


def test_augmentation_moves_crop_and_target_together():
    """The crop shows a body at the joints of every view: a test of the warp together with its targets."""
    data = batches(augment=AugmentConfig(occluder=0), model=ModelConfig(), batch_size=32)
    batch = data[0]
    inside = covered = 0
    for image, target in zip(batch.crop[:, 0], batch.target, strict=True):
        columns, rows = np.floor((target[:, :2].T + 1) * 48).astype(int)
        seen = (columns >= 0) & (columns < 96) & (rows >= 0) & (rows < 96)
        d = image[rows[seen], columns[seen]]
        inside += seen.sum()
        # The front of the joint's ball, or a nearer part of the body.
        covered += (d < target[seen, 2] + 0.02).sum()
    assert inside > 0.9 * 32 * 15
    assert covered > 0.97 * inside
    assert len({tuple(cube) for cube in batch.cube_m.round(5)}) == 32
    plain = batches(model=ModelConfig(), batch_size=32)[0]
    assert np.abs(batch.target - plain.target).max() > 0.3  # rotation and mirror do happen
    np.testing.assert_array_equal(batch.offset_m, plain.offset_m)


def test_each_observation_of_a_batch_is_seen_in_as_many_views_as_asked_for():
    one, four = (AugmentConfig(views=views) for views in (1, 4))
    alone, together = batches(augment=one)[3], batches(augment=four)[3]
    for name in ("crop", "target", "cube_m", "offset_m"):
        several = np.asarray(getattr(together, name)).reshape(8, 4, *getattr(alone, name).shape[1:])
        np.testing.assert_array_equal(several[:, 0], getattr(alone, name), err_msg=name)
        differ = [len(np.unique(row.reshape(4, -1), axis=0)) for row in several]
        assert differ == 8 * [1 if name == "offset_m" else 4], name
    # Shifted and scaled alone, each view says the same of where the joints are.
    still = AugmentConfig(views=3, mirror=0, rotation_deg=0, occluder=0)
    shifted = batches(augment=still)[0]
    joints_m = [
        Cube(cube_m[:3], cube_m[3]).to_metres(target) for cube_m, target in zip(shifted.cube_m, shifted.target, strict=True)
    ]
    np.testing.assert_allclose(joints_m, np.repeat(joints_m[::3], 3, axis=0), atol=1e-5)


class OfManySizes(CapsulePeople):
    """Each image cut on the left and above by another number of pixels."""

    def observe(self, index, epoch):
        seen, cut = super().observe(index, epoch), index % 7
        camera = seen.camera.cropped(cut, 2 * cut, seen.camera.width - cut, seen.camera.height - 2 * cut)
        return replace(seen, depth_m=seen.depth_m[2 * cut :, cut:], camera=camera)


@pytest.mark.parametrize(
    "augment", [AugmentConfig(views=3), AugmentConfig(any_rotation=1, scale=0.9, jitter_m=0.5, occluder=1)]
)
def test_crops_taken_from_patches_are_those_of_the_twin(augment):
    """Far outside the images too, which are of many sizes, where the twin reads nothing."""
    whole = replace(batches(augment=augment), source=OfManySizes(40))
    one, other = (torch.utils.data.default_convert(data[5]) for data in (whole, replace(whole, patches=True)))
    np.testing.assert_array_equal(other.crop.crops(torch.device("cpu")), one.crop)
    for name in ("target", "cube_m", "offset_m", "skipped"):
        np.testing.assert_array_equal(getattr(other, name), getattr(one, name), err_msg=name)


def test_any_rotation_turns_its_share_of_people_by_any_angle():
    still = AugmentConfig(mirror=0, rotation_deg=10, scale=0, jitter_m=0, occluder=0)

    def trunks(augment):
        targets = np.asarray(batches(count=100, augment=augment, batch_size=100)[0].target)
        return (targets[:, Joint.NECK] - targets[:, Joint.TORSO])[:, :2] @ [1, 1j]

    for share in (0.0, 0.5):
        turned_deg = np.angle(trunks(replace(still, any_rotation=share)) / trunks(None), deg=True)
        assert abs(np.mean(np.abs(turned_deg) > 10.01) - share * 170 / 180) < 0.1


def test_occluders_are_ellipses_of_5_to_15_cm_on_the_person():
    seen = CapsulePeople(1).observe(0, 0)
    cut = occlude(np.random.default_rng(0), seen.depth_m, seen.camera)
    gone = (cut == 0) & (seen.depth_m > 0)
    assert gone.any() and np.array_equal(cut[~gone], seen.depth_m[~gone])
    wall_m = np.full_like(seen.depth_m, 2.8)  # shows the whole ellipse
    holes = [occlude(np.random.default_rng(index), wall_m, seen.camera) == 0 for index in range(40)]
    for hole in holes:
        points_m = seen.camera.points(wall_m)[hole]
        assert 0.06 < np.ptp(points_m[:, :2], axis=0).max() < 0.34  # twice a half-axis, and pixels of 2 cm
    area_cm2 = 1e4 * np.mean([hole.sum() for hole in holes]) * (2.8 / seen.camera.fx) ** 2
    np.testing.assert_allclose(area_cm2, np.pi * 10 * 10, rtol=0.25)  # half-axes are independent, 10 cm on average


def test_an_empty_silhouette_is_replaced_by_the_next_observation_and_counted():
    people = CapsulePeople(4, empty=(1, 2))
    batch = CropBatches(people, MODEL, EvenOrder(4, 4, 4), 0, None)[0]
    assert batch.skipped == 3  # 1 twice (2 is empty too), and 2 once
    np.testing.assert_array_equal(batch.target[1], batch.target[3])
    np.testing.assert_array_equal(batch.target[2], batch.target[3])
    assert not np.array_equal(batch.target[0], batch.target[3])
    with pytest.raises(InputError, match="empty silhouettes in a row"):
        CropBatches(CapsulePeople(3, empty=(0, 1, 2)), MODEL, EvenOrder(3, 3, 3), 0, None)[0]


def test_workers_start_where_there_is_nothing_but_spawn_and_no_niceness(monkeypatch):
    monkeypatch.setattr(multiprocessing, "get_all_start_methods", lambda: ["spawn"])  # as on Windows
    assert batch_loader(batches(), 0, 2, workers=1).multiprocessing_context.get_start_method() == "spawn"
    for module, name in ((torch, "set_num_threads"), (batches_module.cv2, "setNumThreads")):
        monkeypatch.setattr(module, name, lambda count: None)
    monkeypatch.setattr(batches_module, "keep_freed_memory", lambda: None)
    monkeypatch.delattr(os, "nice", raising=False)
    batches_module._init_worker(0)
