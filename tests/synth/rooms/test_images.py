"""`room_images`: files whole or not at all, the same whatever the number of processes, read back as they were made."""

import numpy as np
import pytest

from kpopnet.data.room_images import RoomImages
from synth.rooms.images import RoomImagesConfig, RoomImagesSet


class FewImages(RoomImagesSet):
    per_shard = 12


SET = FewImages(RoomImagesConfig(shards=2, split="validation"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rooms")
    SET.write(folder, processes=1)
    return folder


def test_images_are_read_back(folder):
    found = RoomImages(folder)
    assert len(found) == 24 and (folder / "contact_sheet.png").exists()
    people = 0
    for number in range(len(found)):
        image = found[number]
        known = np.isfinite(image.joints_m).all(axis=(1, 2))
        assert (known == (image.whole_px > 0)).mean() > 0.8  # a person may stand wholly outside the image
        assert not image.depth_mm[image.camera.height :].any() and not image.depth_mm[:, image.camera.width :].any()
        people += known.sum()
    assert people > 10


def test_who_would_draw_is_no_part_of_a_set_that_the_cpu_draws():
    config = RoomImagesConfig(shards=2, split="validation")
    assert FewImages(config, renderer="gl").hash == FewImages(config, renderer="cpu").hash == SET.hash
