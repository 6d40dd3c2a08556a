"""The finder around a network that knows the answer, and bad input."""

import numpy as np
import pytest
import torch

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.finder.finder import PersonFinder, load_finder
from kpopnet.finder.network import FinderNetwork, Seen

CAMERA = Camera.centred(500.0, 640, 480)
TORSO_M = np.array((0.0, 0.0, 2.0), np.float32)


def scene(x0=280, x1=360):
    """A wall at 4 m and, before it, a person of a flat body at 2 m."""
    depth_m = np.full((CAMERA.height, CAMERA.width), 4.0, np.float32)
    depth_m[100:400, x0:x1] = 2.0
    return depth_m


class Knowing(torch.nn.Module):
    """Says that what is nearer than 3 m is a person, whose torso is straight ahead of the middle of these pixels."""

    def forward(self, image):
        z = torch.exp(image[:, 1, ::2, ::2]) * 2.5 * image[:, 0, ::2, ::2]
        person = (z > 0) & (z < 3)
        x, y = image[:, 3, ::2, ::2] * z, image[:, 4, ::2, ::2] * z
        middle = x[person].mean() if person.any() else torch.zeros(())
        votes = torch.stack([middle - x, -y, 2 - z], 1)
        logit = torch.where(person, 4.0, -4.0)
        return Seen(logit, votes, torch.full_like(logit, 3.0))


def test_a_person_is_cut_out_of_the_first_image_and_followed():
    finder = PersonFinder(CAMERA, Knowing())
    for k in range(0, 60, 10):
        depth_m = scene(280 + k, 360 + k)
        (human,) = finder.extract(depth_m)
        assert human.identity == 0 and (human.whole(CAMERA) == np.where(depth_m == 2, depth_m, 0)).mean() > 0.9995
        assert np.allclose(human.centre_m, (k / 500 * 2, 0, 2), atol=0.02)


def test_millimetres_are_taken_too():
    assert len(PersonFinder(CAMERA, Knowing()).extract((1000 * scene()).astype(np.uint16))) == 1


@pytest.mark.parametrize("depth_m", [np.zeros((480, 640), np.float32), np.full((480, 640), np.nan, np.float32), scene(0, 0)])
def test_where_there_is_no_person_none_is_found(depth_m):
    assert PersonFinder(CAMERA, Knowing()).extract(depth_m) == []


@pytest.mark.parametrize(
    "depth_m", [np.zeros((240, 320), np.float32), np.zeros((2, 480, 640), np.float32), np.zeros((480, 640), bool)]
)
def test_other_images_are_refused(depth_m):
    with pytest.raises(InputError, match="depth"):
        PersonFinder(CAMERA, Knowing()).extract(depth_m)


def test_weights_of_something_else_are_refused(tmp_path):
    (tmp_path / "finder.safetensors").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"finder\.safetensors: missing, damaged"):
        load_finder(tmp_path / "finder.safetensors")


def test_an_untrained_network_answers_for_any_image_without_error():
    torch.manual_seed(0)
    finder = PersonFinder(CAMERA, FinderNetwork().eval())
    for depth_m in (scene(), np.random.default_rng(0).uniform(0, 9, (480, 640)).astype(np.float32)):
        for human in finder.extract(depth_m):
            assert human.depth_m.any() and np.isfinite(human.centre_m).all()
