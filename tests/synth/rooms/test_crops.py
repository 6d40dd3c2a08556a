"""`person_crops`: what the finder cuts out, read back as it was made, and added to the samples of a training."""

import shutil

import h5py
import numpy as np
import pytest
from factories import write_shard

from kpopnet.data.person_crops import PersonCrops
from kpopnet.errors import InputError
from kpopnet.programs.train import DataConfig, NetworkTrainingConfig
from kpopnet.skeleton import Joint
from synth.rooms.crops import PersonCropsConfig, PersonCropsSet


class FewCrops(PersonCropsSet):
    per_shard = 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crops")
    for split in ("train", "validation"):
        FewCrops(PersonCropsConfig(shards=2, split=split)).write(folder / split, processes=1)
    return folder


def test_crops_show_the_person_whose_joints_they_have(folder):
    found = PersonCrops(folder / "train")
    assert len(found) >= 6 and (folder / "train" / "contact_sheet.png").exists()
    near, shown = [], []
    for index in range(len(found)):
        crop = found.observe(index, 0)
        assert crop.depth_m.shape == (crop.camera.height, crop.camera.width) and crop.visible.dtype == bool
        points_m = crop.camera.points(crop.depth_m)[crop.depth_m > 0]
        distance_m = np.linalg.norm(points_m[:, None] - crop.joints_camera_m[crop.visible], axis=-1)
        near.append(np.median(distance_m.min(axis=0)) if crop.visible.any() else 0.0)
        assert np.linalg.norm(points_m - crop.joints_camera_m[Joint.TORSO], axis=-1).min() < 1.5
        shown.append(crop.visible.mean())
    assert np.median(near) < 0.15  # joints lie inside the body
    assert np.median(shown) > 0.6, "most joints of those who are found are visible"


def test_a_file_is_made_again_alike(folder, tmp_path):
    FewCrops(PersonCropsConfig(shards=2, split="train")).make(tmp_path, 1)
    with h5py.File(folder / "train" / "crops_00001.h5") as one, h5py.File(tmp_path / "crops_00001.h5") as other:
        for name in one:
            assert np.array_equal(one[name][()], other[name][()]), name


def test_a_damaged_file_is_refused(folder, tmp_path):
    for name in ("manifest.json", "crops_00000.h5"):
        (tmp_path / name).write_bytes((folder / "train" / name).read_bytes())
    with h5py.File(tmp_path / "crops_00000.h5", "a") as file:
        file["cameras"][0, 4] += 1
    with pytest.raises(InputError, match="starts: expected the cameras' sizes added up"):
        PersonCrops(tmp_path)


def test_a_training_sees_them_after_its_samples(folder, tmp_path):
    for name, count in (("train", 6), ("validation", 4)):
        write_shard(tmp_path / name, 0, count)
    data = DataConfig(*(str(tmp_path / name) for name in ("train", "validation")))
    source, validation, known = NetworkTrainingConfig(data=data, crops=str(folder)).observed()
    own = PersonCrops(folder / "train")
    assert len(source) == 6 + len(own) and len(validation) > 4 and known["crops/train"]["samples"] == len(own)
    np.testing.assert_array_equal(source.observe(6, 3).depth_m, own.observe(0, 0).depth_m)
    often, once, _ = NetworkTrainingConfig(data=data, crops=str(folder), crops_repeated=3).observed()
    assert len(often) == 6 + 3 * len(own) and len(once) == len(validation)
    with pytest.raises(InputError, match="no person crops"):
        NetworkTrainingConfig(data=data, crops=str(tmp_path)).observed()
    shutil.copytree(data.train, tmp_path / "copy")
    for same in ("validation/../train", "copy"):
        with pytest.raises(InputError, match=f"{same}: the same people and scenes as are trained on"):
            NetworkTrainingConfig(data=DataConfig(data.train, f"{tmp_path}/{same}")).observed()
    with pytest.raises(InputError, match="crops_repeated=2: there are no crops; give crops=FOLDER"):
        NetworkTrainingConfig(crops_repeated=2)
    with pytest.raises(InputError, match="crops_repeated=0"):
        NetworkTrainingConfig(crops_repeated=0)
