"""`person_masks`: crops of scenes around those whom the finder finds, read back as they were made."""

import h5py
import numpy as np
import pytest

from kpopnet.data.person_masks import CROP_PX, OTHER, OWN, THEIRS, read_person_masks
from kpopnet.errors import InputError
from synth.rooms.masks import PersonMasksConfig, PersonMasksSet


class FewMasks(PersonMasksSet):
    per_shard = 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("masks")
    FewMasks(PersonMasksConfig(shards=2, split="train")).write(folder, processes=1)
    return folder


def test_crops_show_whose_pixels_the_finder_takes_and_whose_they_are(folder):
    found = read_person_masks(folder)
    assert len(found.labels) >= 6 and (folder / "contact_sheet.png").exists()
    assert found.depth_mm.shape == found.labels.shape == (len(found.centres_m), CROP_PX, CROP_PX)
    assert found.labels.max() < 8 and not ((found.labels & OWN > 0) & (found.labels & OTHER > 0)).any()
    own, theirs = found.labels & OWN > 0, found.labels & THEIRS > 0
    assert not (found.depth_mm == 0)[theirs].any(), "only what was measured shows a person"
    shared = (own & theirs).sum((1, 2)) / (own | theirs).sum((1, 2))
    assert np.median(shared) > 0.7 and (shared < 1).any()
    # The torso as the finder has it: its pixel's depth is about the cube's, for most.
    middles_mm = found.depth_mm[:, CROP_PX // 2, CROP_PX // 2]
    apart_m = np.abs(middles_mm / 1000 - found.centres_m[:, 2])[middles_mm > 0]
    assert np.median(apart_m) < 0.25


def test_a_file_is_made_again_alike_and_a_damaged_one_refused(folder, tmp_path):
    FewMasks(PersonMasksConfig(shards=2, split="train")).make(tmp_path, 1)
    with h5py.File(folder / "masks_00001.h5") as one, h5py.File(tmp_path / "masks_00001.h5") as other:
        for name in one:
            assert np.array_equal(one[name][()], other[name][()]), name
    (tmp_path / "manifest.json").write_bytes((folder / "manifest.json").read_bytes())
    with h5py.File(tmp_path / "masks_00001.h5", "a") as file:
        del file["labels"]
    with pytest.raises(InputError, match="labels"):
        read_person_masks(tmp_path)
    with pytest.raises(InputError, match=r"no person masks .* make some: python -m synth benchmark=person_masks"):
        read_person_masks(tmp_path / "none")
