"""Recordings of Azure Kinect and Femto: the depth track, its mode and times, its calibration, and files that lack some."""

import json

import numpy as np
import pytest

pytest.importorskip("av", reason="the extra video is not installed")

from azure_kinect_files import FPS, LENS, MODES, START_US, calibration, write_azure_kinect

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.sources import open_depth

NARROW = (320, 288)


def images_mm(width: int, height: int, frames: int = 3) -> np.ndarray:
    """A wall that is flat, in front of it columns and rows: no two frames are equal."""
    images = np.full((frames, height, width), 3000, np.uint16) + np.arange(frames, dtype=np.uint16)[:, None, None]
    images[:, height // 3 : height // 2] = 1500
    images[:, :, width // 3 : width // 2] = 2000
    return images


@pytest.mark.parametrize("size", MODES)
def test_a_recording_tells_its_depth_camera_and_times(size, tmp_path):
    stored = images_mm(*size)
    source = open_depth(write_azure_kinect(tmp_path / "a.mkv", stored), in_child=size == NARROW)
    images = list(source.timed())
    for image, millimetres in zip(images, stored, strict=True):
        np.testing.assert_array_equal(image.depth_m, source.view.image(millimetres.astype(np.float32) / 1000))
        assert set(np.unique(image.depth_m)) <= {0, *np.unique(millimetres / np.float32(1000))}  # no infrared, no mixture
    np.testing.assert_allclose([image.time_s for image in images], START_US / 1e6 + np.arange(len(stored)) / FPS, atol=6e-4)
    assert source.fps == FPS and source.fps_is_known
    assert (source.camera.width, source.camera.height) == size


def test_the_calibration_is_what_the_makers_program_makes_of_it(tmp_path):
    """The published calibration of a device, and what the maker's kit printed for its narrow mode."""
    source = open_depth(write_azure_kinect(tmp_path / "a.mkv", images_mm(640, 576)))
    printed = Camera(503.927643, 503.978729, 332.064270, 325.880615, 640, 576)
    for name in ("fx", "fy", "cx", "cy"):
        assert getattr(source.stored, name) == pytest.approx(getattr(printed, name), abs=2e-6)
    straight = open_depth(
        write_azure_kinect(tmp_path / "b.mkv", images_mm(640, 576), attached=attachment([*LENS[:4], *[0] * 10]))
    )
    assert straight.camera == straight.stored != source.camera


def attachment(lens):
    return json.dumps(calibration(lens)).encode() + b"\0"  # as the maker's recorder ends it


@pytest.mark.parametrize(
    ("tracks", "names"), [(("DEPTH", "IR"), "title"), (("COLOR", "IR", "DEPTH"), "tag"), (("DEPTH",), "tag")]
)
def test_the_depth_track_is_found_by_title_or_tag_wherever_it_stands(tracks, names, tmp_path):
    stored = images_mm(*NARROW)
    source = open_depth(write_azure_kinect(tmp_path / "a.mkv", stored, tracks, names=names))
    np.testing.assert_array_equal(next(iter(source)), source.view.image(stored[0].astype(np.float32) / 1000))


def test_infrared_alone_and_tracks_without_names_are_no_depth(tmp_path):
    stored = images_mm(*NARROW)
    for name, tracks, names in (("ir.mkv", ("COLOR", "IR"), "title and tag"), ("unnamed.mkv", ("IR", "DEPTH"), "")):
        with pytest.raises(
            InputError, match=rf"{name}: .* tracks of 16-bit grey can be depth; expected one, or the title DEPTH"
        ):
            open_depth(write_azure_kinect(tmp_path / name, stored, tracks, names=names))
    with pytest.raises(InputError, match=r"colour\.mkv: its images are yuvj420p; expected 16-bit grey"):
        open_depth(write_azure_kinect(tmp_path / "colour.mkv", stored, ("COLOR",)))


def test_a_missing_or_damaged_calibration_is_told_and_a_camera_given_replaces_it(tmp_path):
    stored = images_mm(*NARROW)
    for name, attached, told in (
        ("none", None, "does not state its camera"),
        ("cut", attachment(LENS)[:300], r"calibration\.json: not valid JSON"),
        ("short", attachment(LENS[:10]), "14 numbers"),
        ("other", attachment(LENS).replace(b"BrownConrady", b"Theta"), r"ModelType: expected one of .* found .*Theta"),
        ("folded", attachment([*LENS[:4], -1e9, *[0] * 9]), "maps no image"),
    ):
        with pytest.raises(InputError, match=rf"{told}"):
            open_depth(write_azure_kinect(tmp_path / f"{name}.mkv", stored, attached=attached))
    with pytest.raises(InputError, match="one of 320x288, 640x576, 512x512, 1024x1024"):
        open_depth(write_azure_kinect(tmp_path / "size.mkv", images_mm(300, 200)))
    assert open_depth(tmp_path / "none.mkv", Camera.centred(250.0, *NARROW)).camera.fx == 250
