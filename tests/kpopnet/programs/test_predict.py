"""The program `kpopnet predict`: a recording in; joints, pictures and a page out."""

import json
from dataclasses import astuple
from functools import partial

import cv2
import numpy as np
import pytest
from checkpoints import save_untrained
from extraction_scenes import CAMERA, compose, room, shifted, standing
from PIL import Image

from kpopnet.camera import CAMERAS
from kpopnet.programs.arguments import tell_assumed_rate
from kpopnet.programs.predict import draw
from kpopnet.skeleton import Joint
from kpopnet.sources import open_depth

FRAMES, CAMERA_WORDS = 8, ("--focal", CAMERA.fx)


def recording() -> np.ndarray:
    """(T, 120, 160) uint16 millimetres: a person walks through a room and waves."""
    images = [compose(room(), shifted(standing(arms_deg=-60.0 + 10 * (k % 4)), 2 * k - 10)) for k in range(FRAMES)]
    return np.rint(1000 * np.stack(images)).astype(np.uint16)


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    """An untrained network, whose joints lie somewhere on the person."""
    return save_untrained(tmp_path_factory.mktemp("run"))


@pytest.fixture
def predict(program, checkpoint, tmp_path):
    return partial(program, "predict", "--checkpoint", checkpoint, "--out", tmp_path / "out")


def test_joints_in_every_format_pictures_and_a_page(predict, tmp_path, monkeypatch):
    monkeypatch.setattr("kpopnet.viz.overlay.MOST_GIF_FRAMES", FRAMES // 2)
    np.save(tmp_path / "a.npy", recording())
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / ".overlay.mp4.elsewhere.1-0.tmp").write_bytes(b"of a run that was killed")
    printed = predict(tmp_path / "a.npy", *CAMERA_WORDS, "--format", "npz", "json", "csv", "bvh", "--gif", "--fps", 25)
    out = tmp_path / "out"
    names = {"joints.npz", "joints.json", "joints.csv", "joints.bvh", "overlay.png", "overlay.mp4", "overlay.gif", "view.html"}
    assert {path.name for path in out.iterdir()} == names and all(str(out / name) in printed for name in names)
    assert "person 1: in " in printed

    stored = np.load(out / "joints.npz")
    np.testing.assert_allclose(stored["times_s"], np.arange(FRAMES) / 25)
    assert np.nanmedian(stored["joints_m"][..., 2]) == pytest.approx(2.8, abs=0.3)  # where the person stands
    content = json.loads((out / "joints.json").read_text())["frames"]
    frame = int(np.argmax(stored["confidence"].sum(axis=1)))
    np.testing.assert_allclose(content[frame]["joints"]["head"][:3], stored["joints_m"][frame, Joint.HEAD], atol=1e-4)
    assert len((out / "joints.csv").read_text().splitlines()) == FRAMES + 1

    sheet = cv2.imread(str(out / "overlay.png"))
    assert sheet.shape[1] > 4 * 320 and sheet.std() > 20
    video = cv2.VideoCapture(str(out / "overlay.mp4"))
    assert (video.get(cv2.CAP_PROP_FRAME_COUNT), video.get(cv2.CAP_PROP_FPS)) == (FRAMES, 25)
    with Image.open(out / "overlay.gif") as gif:
        assert gif.n_frames == FRAMES // 2 and gif.info["duration"] == 2 * 1000 / 25  # every second one for twice the time
    assert "a.npy: 1 person, 8 images" in (out / "view.html").read_text()


def test_a_rate_that_is_guessed_is_told(tmp_path, capsys):
    np.save(tmp_path / "a.npy", recording())
    np.save(tmp_path / "one.npy", recording()[:1])  # of a single image it changes nothing
    for name, fps, told in (("a", None, "no frame rate: 30 images a second assumed"), ("a", 15.0, ""), ("one", None, "")):
        tell_assumed_rate(open_depth(tmp_path / f"{name}.npy", CAMERA, fps=fps))
        assert told in (printed := capsys.readouterr().err) and bool(printed) == bool(told)


def test_two_people_get_files_of_their_own(predict, tmp_path):
    left, right = standing(), standing(2.4, 20.0)
    images = [compose(room(), shifted(left, -40 + k), shifted(right, 40 - k)) for k in range(5)]
    np.save(tmp_path / "a.npy", np.rint(1000 * np.stack(images)).astype(np.uint16))
    printed = predict(tmp_path / "a.npy", *CAMERA_WORDS, "--people", 2, "--format", "npz")
    assert "person 2: in" in printed
    columns = [np.nanmean(np.load(tmp_path / "out" / name)["joints_m"][..., 0]) for name in ("joints.npz", "joints_2.npz")]
    assert abs(columns[0] - columns[1]) > 0.5
    assert "2 people" in (tmp_path / "out" / "view.html").read_text()


def test_an_empty_room_is_told_and_shown_and_no_file_of_another_recording_stays(predict, tmp_path, caplog):
    np.save(tmp_path / "a.npy", np.rint(1000 * np.stack([room()] * 4)).astype(np.uint16))
    (tmp_path / "out").mkdir()
    for name in ("joints.npz", "joints_2.csv", "joints_16.bvh", "overlay.gif", "joints_mine.npz", "depth.npz"):
        (tmp_path / "out" / name).touch()
    error = predict(tmp_path / "a.npy", *CAMERA_WORDS, fails=True)
    assert "a.npy: no person was found; look at" in error and "--segmented" not in error
    assert "no person was found in 4 image(s)" in caplog.text and "--segmented" in caplog.text  # why, told once
    written = {"overlay.png", "overlay.mp4", "view.html"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == written | {"joints_mine.npz", "depth.npz"}


def test_joints_are_kept_where_the_pictures_cannot_be_made(predict, tmp_path):
    np.save(tmp_path / "a.npy", recording())
    (tmp_path / "out" / "overlay.png").mkdir(parents=True)
    (tmp_path / "out" / "view.html").touch()  # of another recording
    predict(tmp_path / "a.npy", *CAMERA_WORDS, "--format", "npz", fails=True)
    assert not (tmp_path / "out" / "view.html").exists()
    assert np.load(tmp_path / "out" / "joints.npz")["joints_m"].shape == (FRAMES, 15, 3)


def test_segmented_depth_needs_nobody_to_be_found_and_the_files_camera_is_used(predict, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("kpopnet.programs.predict.tell_assumed_rate", lambda source: asked.append(source.fps_is_known))
    images = np.zeros((2, 240, 320), np.uint16)
    images[:, 60:200, 140:180] = 2500
    np.savez(tmp_path / "a.npz", depth=images, camera=astuple(CAMERAS["kinect_v1"]))
    assert "person 1: in 2 of 2 images" in predict(tmp_path / "a.npz", "--segmented") and asked == [False]


def test_times_since_1970_become_times_since_the_first_image(predict, tmp_path):
    known = {"depth": recording()[:3], "camera": astuple(CAMERA)}
    for start_s, first_s in ((1.7e9, 0.0), (84231.5, 84231.5)):
        np.savez(tmp_path / "a.npz", times_s=start_s + np.arange(3) / 32, **known)
        predict(tmp_path / "a.npz", "--segmented")
        np.testing.assert_array_equal(np.load(tmp_path / "out" / "joints.npz")["times_s"], first_s + np.arange(3) / 32)


def test_what_comes_before_damage_is_written_and_the_damage_is_told(predict, tmp_path):
    folder = tmp_path / "film"
    folder.mkdir()
    for number, image in enumerate(recording()[:5]):
        cv2.imwrite(str(folder / f"{number}.png"), image)
    last = folder / "4.png"
    last.write_bytes(last.read_bytes()[:-200])  # its recorder was stopped
    error = predict(folder, *CAMERA_WORDS, "--format", "npz", fails=True)
    assert "4.png: not a PNG" in error and "written is what the 4 images before it show" in error
    assert np.load(tmp_path / "out" / "joints.npz")["joints_m"].shape == (4, 15, 3)
    assert cv2.VideoCapture(str(tmp_path / "out" / "overlay.mp4")).get(cv2.CAP_PROP_FRAME_COUNT) == 4
    (folder / "0.png").write_bytes(b"")
    assert "0.png" in predict(folder, *CAMERA_WORDS, fails=True)


def test_of_a_recording_that_turns_out_too_long_what_fits_is_written(predict, tmp_path, monkeypatch):
    monkeypatch.setattr("kpopnet.programs.predict.MAX_DURATION_S", 1.0)
    times_s = np.append(np.arange(4) / 30, 1.5)
    np.savez(tmp_path / "a.npz", depth=recording()[:5], camera=astuple(CAMERA), times_s=times_s)
    error = predict(tmp_path / "a.npz", "--segmented", "--format", "npz", fails=True)
    assert "an image at 1.5 s; expected times" in error and "written is what the 4 images before it show" in error
    np.testing.assert_array_equal(np.load(tmp_path / "out" / "joints.npz")["times_s"], times_s[:4])
    assert "--segmented is for depth that shows one person" in predict(
        tmp_path / "a.npz", "--segmented", "--people", 2, fails=True
    )


def test_a_recording_that_goes_on_is_shown_as_far_as_it_was_read(tmp_path):
    np.savez(tmp_path / "a.npz", depth=recording(), camera=astuple(CAMERA))
    draw(open_depth(tmp_path / "a.npz"), [], np.arange(5) / 30, tmp_path, gif=False)
    assert cv2.VideoCapture(str(tmp_path / "overlay.mp4")).get(cv2.CAP_PROP_FRAME_COUNT) == 5


def test_mistakes_are_one_line(predict, tmp_path):
    np.save(tmp_path / "a.npy", recording()[:2])
    assert "does not state its camera" in predict(tmp_path / "a.npy", fails=True)
    assert "expected the camera's 320x240 pixels" in predict(tmp_path / "a.npy", "--camera", "kinect_v1", fails=True)
    assert "given twice" in predict(tmp_path / "a.npy", "--fov", 60, "--focal", 140, fails=True)
    assert "people=0" in predict(tmp_path / "a.npy", *CAMERA_WORDS, "--people", 0, fails=True)
    np.save(tmp_path / "long.npy", np.zeros((8000, 4, 4), np.uint16))
    assert "last more than 7200 s" in predict(tmp_path / "long.npy", *CAMERA_WORDS, "--fps", 1, fails=True)
    np.save(tmp_path / "wrong.npy", 1000 * np.ones((2, *room().shape), np.float32))
    assert "look like millimetres" in predict(tmp_path / "wrong.npy", *CAMERA_WORDS, fails=True)
    assert not list((tmp_path / "out").glob("*"))
