"""The finder's training: exact resuming, and a network that learns what a few images show."""

import shutil

import numpy as np
import pytest
import torch
from programs import run_program
from room_image_files import write_person_masks, write_room_images
from safetensors.torch import load_file

from kpopnet.data.canvas import STRIDE
from kpopnet.data.room_images import RoomImages
from kpopnet.errors import InputError
from kpopnet.finder.network import FinderNetwork
from kpopnet.skeleton import Joint
from kpopnet.training import distributed
from kpopnet.training.finder import (
    META,
    WEIGHTS,
    FinderRun,
    FinderTraining,
    LoadedImages,
    LoadedMasks,
    SceneViews,
    train_finder,
    validate,
    validate_masks,
)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("images")
    return {name: str(write_room_images(folder / name)) for name in ("train", "validation")}


def test_a_resumed_run_equals_an_uninterrupted_one(data, tmp_path):
    def settings(steps, resume=False):
        return FinderTraining(steps=steps, batch_size=2, validate_every=2, resume=resume)

    def trained(run, settings, **others):
        train_finder(settings, 0, data | others, tmp_path / run, threads=1, device="cpu")
        return (tmp_path / run / WEIGHTS).read_bytes()

    # The learning rate spans all steps, so half a run is one of as many steps that was stopped.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FinderRun, "save", _save_and_stop)
        with pytest.raises(KeyboardInterrupt):
            trained("halves", settings(4))
    images = str(write_room_images(tmp_path / "others"))
    for refused, others, message in (
        (settings(4), {}, "holds a run"),
        (settings(8, resume=True), {}, r"was begun with training\.steps=4, not 8; give it the same again"),
        (FinderTraining("masks", resume=True), {}, "its state does not fit training.part=masks"),
        (settings(4, resume=True), {"train": images}, "was begun with images=.*give it the same again"),
        (settings(4, resume=True), {"validation": data["train"]}, "same people and scenes as are .*benchmark.split=validation"),
    ):
        with pytest.raises(InputError, match=message):
            trained("halves", refused, **others)
    shutil.copytree(tmp_path / "halves", tmp_path / "other")
    (tmp_path / "other" / META).write_text("[]")
    with pytest.raises(InputError, match=r"finder\.json: expected an object"):
        trained("other", settings(4, resume=True))
    assert trained("halves", settings(4, resume=True)) == trained("whole", settings(4))


def test_weights_of_no_run_and_people_who_are_trained_on_are_refused(data, tmp_path):
    settings = FinderTraining(steps=2, batch_size=2)
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / WEIGHTS).write_bytes(b"of another training")
    with pytest.raises(InputError, match=r"kept: holds finder\.safetensors of no run; give another folder"):
        train_finder(settings, 0, data, tmp_path / "kept", threads=1, device="cpu")
    assert (tmp_path / "kept" / WEIGHTS).read_bytes() == b"of another training"
    other = write_room_images(tmp_path / "more" / "train", 4)  # other settings, the same people
    (other / "manifest.json").write_text((other / "manifest.json").read_text().replace('"hash": "train"', '"hash": "more"'))
    with pytest.raises(InputError, match=r"the same people and scenes as are trained on \(split train\)"):
        train_finder(settings, 0, data | {"validation": str(other)}, tmp_path / "new", threads=1, device="cpu")


def test_masks_that_are_missing_are_to_be_made_beside_the_room_images(data, tmp_path):
    with pytest.raises(InputError, match=r"no person masks .* benchmark=person_masks out=\S*/person_masks/train$"):
        train_finder(FinderTraining(part="masks"), 0, data, tmp_path / "run", threads=1, device="cpu")


def _save_and_stop(run, described, save=FinderRun.save):
    save(run, described)
    raise KeyboardInterrupt


@pytest.mark.parametrize("empty", ["train", "validation"])
@pytest.mark.parametrize(("part", "write"), [("finder", write_room_images), ("masks", write_person_masks)])
def test_files_without_an_image_are_refused(tmp_path, part, write, empty):
    data = {name: str(write(tmp_path / name, 0 if name == empty else 2)) for name in ("train", "validation")}
    with pytest.raises(InputError, match=rf"{empty}: expected at least one image"):
        train_finder(FinderTraining(part, steps=1, batch_size=2), 0, data, tmp_path / "run", threads=1, device="cpu")


def test_it_trains_in_bfloat16_where_it_is_asked_to(data, tmp_path, monkeypatch):
    types, votes = [], FinderNetwork._features

    def watched(self, image):
        features = votes(self, image)
        types.append((self.training, features.dtype))
        return features

    monkeypatch.setattr(FinderNetwork, "_features", watched)
    monkeypatch.setattr(distributed, "TRIAL", "print(2)")
    for name, bfloat16 in (("half", True), ("plain", False)):
        train_finder(FinderTraining(steps=2, batch_size=2, bfloat16=bfloat16), 0, data, tmp_path / name, 1, "cpu")
    assert set(types) == {(True, torch.bfloat16), (True, torch.float32), (False, torch.float32)}
    half, plain = (load_file(tmp_path / name / WEIGHTS) for name in ("half", "plain"))
    assert all(one.dtype == plain[name].dtype for name, one in half.items())
    assert any(not torch.equal(one, plain[name]) for name, one in half.items())


def test_the_program_trains(data, tmp_path):
    given = ("--config-name", "finder", "out=run", *(f"data.{name}={folder}" for name, folder in data.items()), "threads=1",
             "training.steps=2", "training.batch_size=2")  # fmt: skip
    done = run_program("train.py", tmp_path, *given)
    assert done.returncode == 0 and "step 2 of 2: of the people's cells" in done.stderr + done.stdout, done.stderr
    assert (tmp_path / "run" / WEIGHTS).exists()
    # What is refused leaves the record of how the run was configured.
    for others, message in ((["seed=3"], "holds a run"), (["seed=3", "training.resume=true"], "was begun with seed=0, not 3")):
        refused = run_program("train.py", tmp_path, *given, *others)
        assert refused.returncode == 1 and message in refused.stderr, refused.stderr
        assert "seed=3" not in (tmp_path / "run" / ".hydra" / "overrides.yaml").read_text()


def test_the_masks_learn_whose_the_cells_are(tmp_path):
    """Where the finder has a person shifted; mirrored crops are their mirror images."""
    crops = LoadedMasks(write_person_masks(tmp_path / "crops"))
    plain, mirrored = (crops.batch(np.arange(4), np.full(4, one)) for one in (False, True))
    places = [0, 1, 2, 3, 5, 6]  # but for the place from left to right
    assert torch.equal(plain[0][:, places].flip(3), mirrored[0][:, places]) and torch.equal(plain[0][:, 4], mirrored[0][:, 4])
    assert not plain[1].weight[:, :, :2].any() and plain[1].person.sum() == 4 * 38 * 12
    run = FinderRun(FinderTraining(part="masks", steps=40, lr=5e-3), 0, tmp_path)
    first = validate_masks(run.network, crops, 8)
    for step in range(40):
        run.update(*crops.drawn(np.arange(step % 2, 8, 2), np.random.default_rng(step), 0.5))
    run.network.eval()
    last = validate_masks(run.network, crops, 8)
    assert last["loss"] < 0.5 * first["loss"] and last["intersection_over_union"] > max(0.8, first["intersection_over_union"])
    run.save({})
    with pytest.raises(InputError, match="not a finder of this version"):
        FinderRun(FinderTraining(start=str(tmp_path / WEIGHTS)), 1, tmp_path / "further")


def test_masks_are_trained(tmp_path, caplog):
    folders = {name: write_person_masks(tmp_path / name) for name in ("train", "validation")}
    with caplog.at_level("INFO"):
        train_finder(FinderTraining(part="masks", steps=2, batch_size=2), 0, folders, tmp_path / "run", 1, "cpu")
    assert "step 2 of 2: IoU" in caplog.text


def test_a_view_shows_the_same_scene_to_another_camera(data):
    """What a cell of a view shows lies where the image has it, turned with the camera, to half a pixel; and so do torsos."""
    images, rows = LoadedImages(data["train"]), np.arange(8)
    views = SceneViews.drawn(np.random.default_rng(3), images.cameras[rows], share=0.75)
    scaled = np.linalg.norm(views.to_image[:, :, 0], axis=1)
    assert (np.linalg.det(views.to_view) < 0).any() and (np.abs(scaled - 1) > 0.1).any() and (scaled == 1).any()
    assert np.abs(views.to_view[:, 0, 1]).max() > 0.1
    plain, seen = (images.batch(rows, given) for given in (None, views))
    plain_input, view_input = (given[0].numpy() for given in (plain, seen))
    vote_m, shows_person = seen[1].vote_m.numpy(), seen[1].person.numpy() > 0
    for row, camera in enumerate(images.cameras):
        measured, log_depth, _, *rays = view_input[row, :, ::STRIDE, ::STRIDE]
        assert measured.mean() > 0.3
        fx, fy, cx, cy, width, height = camera
        x, y = views.to_view[row].T @ np.reshape(rays, (2, -1))  # turned back
        column, line = np.rint(x * fx + cx).astype(int), np.rint(y * fy + cy).astype(int)
        inside = (column >= 0) & (line >= 0) & (column < width) & (line < height)
        there, here = plain_input[row][:, line[inside], column[inside]], np.array([measured.ravel(), log_depth.ravel()])
        np.testing.assert_allclose(here[:, inside], there[:2], atol=1e-5)
        assert not here[:, ~inside].any()
        of_person = (measured > 0) & shows_person[row]
        points_m = np.array([*rays, np.ones_like(measured)]) * 2.5 * np.exp(log_depth)
        torsos_m = (points_m + vote_m[row])[:, of_person].T
        turned = np.eye(3)
        turned[:2, :2] = views.to_view[row]
        expected_m = turned @ RoomImages(data["train"])[row].joints_m[0, Joint.TORSO]
        np.testing.assert_allclose(torsos_m, np.broadcast_to(expected_m, torsos_m.shape), atol=1e-4)


def test_as_many_images_as_asked_for_are_seen_anew_each_around_a_place_of_its_own():
    cameras = np.tile(np.float32([120, 120, 79.5, 59.5, 160, 120]), (2000, 1))
    for share in (0.0, 0.3, 1.0):
        views = SceneViews.drawn(np.random.default_rng(0), cameras, share)
        scaled = np.linalg.norm(views.to_image[:, :, 0], axis=1)
        for changed in (scaled != 1, views.to_view[:, 0, 1] != 0, views.principal_px[:, 0] != np.float32(79.5)):
            assert abs(changed.mean() - share) < 0.04
        assert abs((np.linalg.det(views.to_view) < 0).mean() - 0.5) < 0.04
        # The middle of the view within the image, or that of the image within the view.
        middle_px = np.einsum("nij,nj->ni", views.to_image, np.float32([79.5, 59.5]) - views.principal_px) + cameras[:, 2:4]
        off_px = np.abs(middle_px - [79.5, 59.5]) - np.abs(1 - scaled)[:, None] * [79.5, 59.5]
        assert off_px.max() < 1e-3 and (share == 0 or np.ptp(middle_px[:, 0]) > 40)


def test_it_learns_which_cells_show_a_person_and_where_the_torso_is(data, tmp_path):
    images, run = LoadedImages(data["train"]), FinderRun(FinderTraining(steps=40, lr=5e-3), 0, tmp_path)
    first = validate(run.network, images, 8)
    for step in range(40):
        run.update(*images.batch(np.arange(step % 2, 8, 2)))
    run.network.eval()
    last = validate(run.network, images, 8)
    assert last["loss"] < 0.5 * first["loss"] and last["vote_error_cm"] < min(20, first["vote_error_cm"])
    run.save({})
    further = FinderRun(FinderTraining(start=str(tmp_path / WEIGHTS)), 1, tmp_path / "further")
    for name, value in further.network.state_dict().items():
        assert torch.equal(value, run.average.state_dict()[name])
