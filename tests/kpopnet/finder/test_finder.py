"""The finder around a network that knows the answer, and bad input."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from kpopnet.camera import Camera
from kpopnet.data.canvas import reduced
from kpopnet.data.person_masks import OWN
from kpopnet.errors import InputError
from kpopnet.finder import finder as finder_module
from kpopnet.finder.finder import FinderConfig, PersonFinder, cells_of
from kpopnet.finder.network import CellsOfImage, Seen
from kpopnet.finder.people import TOGETHER
from kpopnet.human import Look

CAMERA = Camera.centred(500.0, 640, 480)


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
        return Seen(logit, votes)


def test_people_come_in_the_order_in_which_they_were_first_found(monkeypatch):
    """Of whom the camera sees most may change; the first ones are those who get joints."""
    places_m = np.array([[0.0, 0, 2], [1.0, 0, 2]], np.float32)
    boxes = np.array([[0, 0, 5, 5], [10, 10, 15, 15]])
    order = iter([[0, 1], [1, 0]])

    def candidates(*given: object) -> SimpleNamespace:
        return SimpleNamespace(centres_m=places_m[next(order)], certainty=np.array([0.9, 0.9]), cells=None)

    monkeypatch.setattr(finder_module, "candidates_in", candidates)
    monkeypatch.setattr(finder_module, "refine_masks", lambda *given: (np.zeros((480, 640), np.uint8), boxes))
    finder = PersonFinder(CAMERA)
    for _ in range(2):
        found = finder.extract(scene())
        assert [human.identity for human in found] == [0, 1]
        np.testing.assert_array_equal([human.centre_m for human in found], places_m)


def run_by_torch(network):
    finder = CellsOfImage(network)
    with torch.inference_mode():
        return lambda *given: tuple(one.detach().numpy() for one in finder(*map(torch.from_numpy, given)))


def look(person_logit):
    return Look(np.zeros((15, 3), np.float32), np.ones(15, np.float32), person_logit)


@pytest.fixture
def knowing(monkeypatch):
    """A finder of images of CAMERA around a network that knows the answer."""
    monkeypatch.setattr(finder_module, "open_finder", lambda _: run_by_torch(Knowing()))
    monkeypatch.setattr(finder_module, "open_masks", lambda: lambda _, owner, __: np.float32(owner[:, ::2, ::2] == OWN))
    return PersonFinder(CAMERA, FinderConfig("known"))


def test_a_person_is_cut_out_of_the_first_image_and_followed(knowing):
    for k in range(0, 60, 10):
        depth_m = scene(280 + k, 360 + k)
        (human,) = knowing.extract(depth_m)
        assert human.identity == 0 and (human.whole(CAMERA) == np.where(depth_m == 2, depth_m, 0)).mean() > 0.9995
        assert np.allclose(human.centre_m, (k / 500 * 2, 0, 2), atol=0.02)


def test_a_closer_look_decides_who_is_new_and_takes_part_in_who_is_followed(knowing):
    """What a network saw comes with the human; one that does not judge leaves the finder alone."""
    logits, seen = (None, -9.0, 9.0, 0.0, -1.0, -9.0), []
    for person_logit in logits:
        knowing.looker = lambda humans, logit=person_logit: [look(logit)] * len(humans)
        seen.append(knowing.extract(scene()))
        assert all(human.look.person_logit is person_logit for human in seen[-1])
    assert [len(found) for found in seen] == [1, 0, 1, 1, 1, 0]
    nine, zero, doubtful = (found[0].certainty for found in seen[2:5])
    assert doubtful < zero < nine
    fresh = PersonFinder(CAMERA, FinderConfig("known"), lambda humans: [look(-5.0)] * len(humans))
    assert fresh.extract(scene()) == []  # doubtful, where no person was before


@pytest.mark.parametrize("depth_m", [np.zeros((480, 640), np.float32), np.full((480, 640), np.nan, np.float32), scene(0, 0)])
def test_where_there_is_no_person_none_is_found(knowing, depth_m):
    assert knowing.extract(depth_m) == []


@pytest.mark.parametrize(("shape", "dtype"), [((240, 320), np.float32), ((2, 480, 640), np.float32), ((480, 640), bool)])
def test_other_images_are_refused(knowing, shape, dtype):
    with pytest.raises(InputError, match="depth"):
        knowing.extract(np.zeros(shape, dtype))


def test_settings_and_times_of_another_type_are_refused(knowing):
    with pytest.raises(InputError, match=r"extraction: expected a kpopnet\.finder\.finder\.FinderConfig, got 'finder'"):
        PersonFinder(CAMERA, "finder")
    for wrong in (float("nan"), float("inf"), "0.1"):
        with pytest.raises(InputError, match="time_s="):
            knowing.extract(scene(), wrong)


def test_weights_of_something_else_are_refused(tmp_path):
    (tmp_path / "mine.safetensors").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"mine\.safetensors: missing, damaged"):
        PersonFinder(CAMERA, FinderConfig(str(tmp_path / "mine.safetensors")))


def logit_of(together, alone):
    """What a network says of a person so that both together are as certain, where the finder alone is `alone`."""
    constant, of_finder, of_network = TOGETHER
    return (np.log(together / (1 - together)) - constant - of_finder * np.log(alone / (1 - alone))) / of_network


def test_a_new_person_needs_more_certainty_than_one_who_is_followed_and_was_certain_just_now(knowing):
    (first,) = knowing.extract(scene())

    def found(finder, together, time_s):
        finder.looker = lambda humans: [look(logit_of(together, first.certainty))] * len(humans)
        return [round(human.certainty, 3) for human in finder.extract(scene(), time_s)]

    fresh = PersonFinder(CAMERA, FinderConfig("known"))
    assert found(fresh, 0.85, 10.0) == [] and found(fresh, 0.95, 10.1) == [0.95]
    assert found(fresh, 0.25, 10.2) == [0.25] and found(fresh, 0.15, 10.3) == []
    assert found(fresh, 0.25, 10.4) == [0.25] and found(fresh, 0.25, 15.0) == []
    assert found(PersonFinder(CAMERA, FinderConfig("known", 0.8)), 0.85, 10.0) == [0.85]


def test_the_cells_of_a_person_have_the_surface_that_the_camera_sees():
    cells = cells_of(run_by_torch(Knowing()), reduced(scene(), CAMERA))
    assert cells.area_m2[cells.probability > 0.5].sum() == pytest.approx(80 * 300 * (2 / 500) ** 2, rel=0.02)
