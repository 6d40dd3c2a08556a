"""Recordings of every kind give the same metres, in bounded memory, and what is no depth is refused in one line."""

import json
import os
import sys
import tracemalloc
import zipfile
import zlib
from dataclasses import astuple
from pathlib import Path

import h5py
import numpy as np
import pytest
from damaged_files import is_refused
from depth_files import CAMERA, FPS, depth_mm, write_hdf5, write_npz, write_pngs, write_sent, write_video
from PIL import Image
from programs import ROOT

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from kpopnet.sources import chosen_camera, open_depth

MILLIMETRES = depth_mm()
METRES = MILLIMETRES.astype(np.float32) / 1000


def read(path, camera=None, **how):
    """All images of a recording, twice the same."""
    source = open_depth(path, camera, **how)
    first, again = np.stack(list(source)), np.stack(list(source))
    np.testing.assert_array_equal(first, again)
    assert first.dtype == np.float32 and source.frames in (None, len(first))
    return source, first


@pytest.mark.parametrize(("write", "name"), [(write_pngs, "images"), (write_npz, "a.npz"), (write_hdf5, "a.h5")])
def test_a_file_that_tells_its_camera_needs_nothing_else(write, name, tmp_path):
    path = write(tmp_path / name, MILLIMETRES)
    if name == "images":
        (path / "camera.json").write_text(json.dumps(vars(CAMERA)))
        (path / "._depth0.png").write_bytes(b"what macOS puts beside a file")
    source, images = read(path, in_child=name == "a.npz")
    np.testing.assert_array_equal(images, METRES)
    assert source.camera == CAMERA and source.frames == len(METRES)


def test_a_side_that_no_video_has_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.full((1, 300, 16_400), 2000, np.uint16))
    with pytest.raises(InputError, match=r"a\.npy.* 16400x300 pixels; expected sides of at most 16,384 pixels"):
        open_depth(tmp_path / "a.npy", Camera.centred(9000.0, 16_400, 300))


@pytest.mark.parametrize("shape", [(9000, 4), (2, 6000)])
def test_a_strip_is_refused(shape, tmp_path):
    np.save(tmp_path / "a.npy", np.full((3, *shape), 2000, np.uint16))
    with pytest.raises(InputError, match=r"a\.npy.* pixels; expected one side at most 64 times as long as the other"):
        open_depth(tmp_path / "a.npy", Camera.centred(140.0, *shape[::-1]))


def test_tiff_npy_and_single_images_take_the_camera_given(tmp_path):
    write_pngs(tmp_path / "tiffs", METRES, ".tif")
    np.save(tmp_path / "a.npy", MILLIMETRES.astype(">u2"))
    np.save(tmp_path / "one.npy", METRES[3])
    Image.fromarray(MILLIMETRES[3]).save(tmp_path / "one.png")
    for name, expected in (("tiffs", METRES), ("a.npy", METRES), ("one.npy", METRES[3:4]), ("one.png", METRES[3:4])):
        np.testing.assert_array_equal(read(tmp_path / name, CAMERA)[1], expected)


def test_an_array_in_the_order_of_fortran_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.asfortranarray(MILLIMETRES))
    with pytest.raises(InputError, match=r"a\.npy: stored in Fortran order; save it again"):
        list(open_depth(tmp_path / "a.npy", CAMERA))


@pytest.mark.parametrize(
    "names",
    [
        ("1700000000.0", "1700000000.25", "1700000000.5", "1700000000.75", "1700000001.0"),  # seconds since 1970
        ("84231.0", "84231.0333", "84231.0667", "84231.1", "84231.1333"),
        ("take 2, 9.95", "take 2, 9.9833", "take 2, 10.0167", "take 2, 10.05"),
        ("frame_1.8", "frame_1.9", "frame_1.10", "frame_1.11", "frame_2.1"),
        ("1.01", "1.02", "1.99", "1.100"),
        ("2026.5.9", "2026.5.10", "2026.11.1"),
    ],
)
def test_images_named_by_decimals_or_by_numbers_of_numbers_are_in_their_order(names, tmp_path):
    for name, image in zip(names, MILLIMETRES, strict=False):
        Image.fromarray(image).save(tmp_path / f"{name}.png")
    np.testing.assert_array_equal(read(tmp_path, CAMERA, key="*")[1], METRES[: len(names)])


def test_images_numbered_in_wide_digits_are_in_the_order_of_their_numbers(tmp_path):
    for name, image in zip(("２", "１０", "１１"), MILLIMETRES, strict=False):
        Image.fromarray(image).save(tmp_path / f"{name}.png")
    np.testing.assert_array_equal(read(tmp_path, CAMERA)[1], METRES[:3])


def test_names_that_may_be_decimals_are_refused(tmp_path):
    for name in ("1.8", "1.9", "1.11"):
        Image.fromarray(MILLIMETRES[0]).save(tmp_path / f"{name}.png")
    with pytest.raises(InputError, match=r"1\.8\.png or 1\.11\.png may be the earlier image.*equally many digits"):
        open_depth(tmp_path, CAMERA)


def test_a_pgm_of_any_greatest_value_keeps_its_millimetres(tmp_path):
    height, width = MILLIMETRES.shape[1:]
    for greatest in (10_000, 65_535):
        head = f"P5\n{width} {height}\n{greatest}\n".encode()
        (tmp_path / "a.pgm").write_bytes(head + MILLIMETRES[0].astype(">u2").tobytes())
        _, images = read(tmp_path / "a.pgm", CAMERA)
        np.testing.assert_array_equal(np.rint(1000 * images[0]), MILLIMETRES[0])


def test_a_lossless_video_keeps_every_millimetre_and_its_rate_and_a_damaged_one_is_refused(tmp_path, monkeypatch):
    pytest.importorskip("av", reason="the extra video is not installed")
    monkeypatch.chdir(write_video(tmp_path / "12:30.mkv", MILLIMETRES).parent)
    source, images = read(Path("12:30.mkv"), CAMERA)  # which is no address
    np.testing.assert_array_equal(images, METRES)
    assert source.fps == FPS and source.fps_is_known
    np.testing.assert_allclose([image.time_s for image in source.timed()], np.arange(len(METRES)) / FPS, atol=1e-3)
    write_video(tmp_path / "grey.mkv", MILLIMETRES, pixels="gray")
    with pytest.raises(InputError, match=r"grey\.mkv: its images are gray; expected 16-bit grey"):
        open_depth(tmp_path / "grey.mkv", CAMERA)
    path = write_video(tmp_path / "a.mkv", np.random.default_rng(0).integers(1000, 4000, (6, 48, 64), np.uint16))
    content = bytearray(path.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 8] = b"\xff" * 8
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.mkv: frame [1-5]: damaged"):
        list(open_depth(path, CAMERA))
    (tmp_path / "list.mkv").write_text("#EXTM3U\nfile:///etc/passwd\n")
    assert is_refused(lambda: open_depth(tmp_path / "list.mkv", CAMERA))


@pytest.mark.parametrize(
    ("name", "extra"), [("a.mkv", "video"), ("a.bag", "realsense"), ("a.mcap", "ros"), ("a.r3d", "record3d")]
)
def test_a_missing_library_is_named_with_the_command_that_installs_it(name, extra, tmp_path, monkeypatch):
    for module in ("av", "pyrealsense2", "rosbags", "lzfse"):
        monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).write_bytes(bytes(100))
    with pytest.raises(InputError, match=rf'needs .*: pip install -e "{ROOT}\[{extra}\]"|extra {extra}'):
        open_depth(tmp_path / name)


def test_times_come_from_the_file_or_the_rate_and_a_given_rate_replaces_both(tmp_path):
    times_s = 10 + np.cumsum(np.linspace(0.03, 0.05, len(METRES)))
    path = write_npz(tmp_path / "a.npz", MILLIMETRES, times_s=times_s)
    np.testing.assert_allclose([image.time_s for image in open_depth(path).timed()], times_s)
    assert open_depth(path).fps == pytest.approx(25, rel=0.05)
    np.testing.assert_allclose([image.time_s for image in open_depth(path, fps=50).timed()], np.arange(len(METRES)) / 50)
    assert not open_depth(write_npz(tmp_path / "b.npz", MILLIMETRES)).fps_is_known
    assert open_depth(write_npz(tmp_path / "c.npz", MILLIMETRES, fps=60)).fps == 60
    with pytest.raises(InputError, match="5000 images a second; expected 1 to 1000"):
        open_depth(write_npz(tmp_path / "c.npz", MILLIMETRES, fps=5000))
    with pytest.raises(InputError, match=r"0\.03 images a second; expected 1 to 1000, by its own times in seconds.*--fps"):
        open_depth(write_npz(tmp_path / "c.npz", MILLIMETRES, times_s=np.arange(len(METRES)) / 0.03))
    path = write_npz(tmp_path / "d.npz", MILLIMETRES, times_s=np.append(times_s[:-1], times_s[3]))
    with pytest.raises(InputError, match=r"frame 11: taken at .* after one at"):
        list(open_depth(path))


def test_a_hand_before_the_lens_ends_no_recording(tmp_path):
    near = MILLIMETRES.copy()
    near[3] = np.where(np.arange(near[3].size).reshape(near[3].shape) < 100, 40, 0)
    far = near / np.float32(1000)
    far[4] = 51  # another room, through a window
    for images in (near, far):
        np.save(tmp_path / "a.npy", images)
        assert read(tmp_path / "a.npy", CAMERA)[1][3].max() == np.float32(0.04)
    np.save(tmp_path / "a.npy", near[3:])  # it tells no unit
    with pytest.raises(InputError, match="these look like metres"):
        list(open_depth(tmp_path / "a.npy", CAMERA))


def test_the_largest_of_16_bits_is_not_measured_in_any_unit(tmp_path):
    stored = np.where(MILLIMETRES == 0, np.uint16(65535), MILLIMETRES)
    np.save(tmp_path / "a.npy", stored)
    np.save(tmp_path / "b.npy", stored.astype(">u2"))
    write_sent(tmp_path / "c.depth", stored, unit_m=0.0002)
    for name, units_per_m, stated in (("a.npy", 1000, {"depth_scale": 1000}), ("b.npy", 1000, {}), ("c.depth", 5000, {})):
        _, images = read(tmp_path / name, CAMERA, **stated)
        np.testing.assert_allclose(images, MILLIMETRES / np.float32(units_per_m), rtol=1e-6)


def test_the_camera_comes_from_a_preset_a_file_an_angle_or_a_focal_length(tmp_path):
    np.save(tmp_path / "a.npy", np.full((2, 240, 320), 2000, np.uint16))
    (tmp_path / "camera.json").write_text(json.dumps(vars(CAMERAS["eval"])))
    for given, expected in (
        (chosen_camera("kinect_v1"), CAMERAS["kinect_v1"]),
        (chosen_camera(str(tmp_path / "camera.json")), CAMERAS["eval"]),
        (chosen_camera(fov_deg=58.0), Camera.from_fov(58.0, 320, 240)),
        (chosen_camera(focal_px=300.0), Camera.centred(300.0, 320, 240)),
    ):
        assert open_depth(tmp_path / "a.npy", given).camera == expected
    with pytest.raises(InputError, match=r"does not state its camera.*kinect_v1.*--camera.*--fov.*--focal"):
        open_depth(tmp_path / "a.npy", chosen_camera())
    with pytest.raises(InputError, match="given twice"):
        chosen_camera("eval", 58.0)
    with pytest.raises(InputError, match=r"expected the path of a file or folder, got Camera\(fx="):
        open_depth(tmp_path / "a.npy", chosen_camera(CAMERAS["eval"]))
    with pytest.raises(InputError, match="key=0: expected the name of an array or topic"):
        open_depth(tmp_path, CAMERAS["eval"], key=0)
    np.save(tmp_path / "large.npy", np.full((2, 480, 640), 2000, np.uint16))
    assert open_depth(tmp_path / "large.npy", chosen_camera("kinect_v1")).camera == Camera.centred(571.26, 640, 480)
    with pytest.raises(InputError, match=r"camera realsense: expected the camera's 848x480 pixels, got 640x480.*--fov"):
        open_depth(tmp_path / "large.npy", chosen_camera("realsense"))
    with pytest.raises(InputError, match=r"frame 0: expected the camera's 512x424 pixels, got 320x240"):
        list(open_depth(tmp_path / "a.npy", CAMERAS["kinect_2"]))
    matrix = [[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]
    for intrinsics in (matrix, astuple(CAMERA)[:4]):
        np.savez(tmp_path / "b.npz", depth=MILLIMETRES, intrinsics=intrinsics)
        assert open_depth(tmp_path / "b.npz").camera == CAMERA
    np.savez(tmp_path / "b.npz", depth=MILLIMETRES, intrinsics=np.transpose(matrix))
    with pytest.raises(InputError, match=r"b\.npz: intrinsics: camera matrix .* expected \[\[fx, 0, cx\]"):
        open_depth(tmp_path / "b.npz")


def test_the_array_is_the_named_one_the_known_one_or_the_only_one(tmp_path):
    other = np.ones((len(METRES), 48, 64), np.float32)
    notes = np.array({"subject": 3}, object)
    np.savez(tmp_path / "a.npz", depth_m=METRES, infrared=other, joints=np.zeros((12, 15, 3)), notes=notes)
    np.testing.assert_array_equal(read(tmp_path / "a.npz", CAMERA)[1], METRES)
    np.testing.assert_array_equal(read(tmp_path / "a.npz", CAMERA, key="infrared")[1], other)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["data"], file["is_valid"] = METRES.astype(np.float16), np.zeros(12)
        file["second/depth"], file["second/times_s"] = other, np.arange(13) / 20  # as a writer leaves it that is killed
        file["elsewhere"] = h5py.ExternalLink("c.h5", "depth")
    np.testing.assert_allclose(read(tmp_path / "b.h5", CAMERA, key="data")[1], METRES, rtol=1e-3)
    source, images = read(tmp_path / "b.h5", CAMERA, key="second/depth")
    np.testing.assert_array_equal(images, other)
    assert source.fps == pytest.approx(20)
    with pytest.raises(InputError, match=r"no array elsewhere .* it holds data \(12, 48, 64\)"):
        open_depth(tmp_path / "b.h5", CAMERA, key="elsewhere")
    (tmp_path / "raw").write_bytes(METRES.tobytes())
    with h5py.File(tmp_path / "outside.h5", "w") as file:
        file.create_dataset("depth", METRES.shape, "f4", external=[(str(tmp_path / "raw"), 0, METRES.nbytes)])
    with pytest.raises(InputError, match=r"outside\.h5: depth lies in another file"):
        open_depth(tmp_path / "outside.h5", CAMERA)
    np.savez(tmp_path / "c.npz", one=METRES, two=other)
    with pytest.raises(InputError, match=r"several arrays could be depth.*one \(12, 48, 64\), two"):
        open_depth(tmp_path / "c.npz", CAMERA)
    np.savez(tmp_path / "d.npz", joints=np.zeros((12, 15, 3)))
    with pytest.raises(InputError, match=r"no array of shape \(frames, height, width\)"):
        open_depth(tmp_path / "d.npz", CAMERA)


def test_images_that_are_no_depth_are_refused_and_a_pattern_leaves_them_out(tmp_path):
    folder = write_pngs(tmp_path / "images", MILLIMETRES)
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(folder / "colour0.png")
    np.testing.assert_array_equal(read(folder, CAMERA, key="depth*.png")[1], METRES)
    with pytest.raises(InputError, match=r"colour0\.png: an image of Pillow's mode RGB; expected depth"):
        list(open_depth(folder, CAMERA, key="*"))
    with pytest.raises(InputError, match=r"2 kinds of names \(colour#, depth#; .*--key"):
        open_depth(folder, CAMERA)
    with pytest.raises(InputError, match="no image named infrared"):
        open_depth(folder, CAMERA, key="infrared*")
    with pytest.raises(InputError, match=r"no image named \* in it; .*a folder in it is meant: images"):
        open_depth(tmp_path, CAMERA)
    Image.fromarray(MILLIMETRES[0, :40]).save(folder / "depth5.png")
    with pytest.raises(InputError, match=r"depth5\.png: expected the camera's 64x48 pixels, got 64x40"):
        list(open_depth(folder, CAMERA, key="depth*.png"))
    whole = (folder / "depth7.png").read_bytes()
    end = whole.index(b"IEND") - 8  # of the pixels: their checksums follow, zlib's and that of PNG
    for damaged in (whole[: len(whole) // 2], whole[: end - 8] + bytes([whole[end - 8] ^ 1]) + whole[end - 7 :]):
        (folder / "depth5.png").write_bytes(damaged)
        with pytest.raises(InputError, match=r"depth5\.png: not a PNG, TIFF or PGM image, or damaged"):
            list(open_depth(folder, CAMERA, key="depth*.png"))
    first, *others = map(Image.fromarray, MILLIMETRES)
    first.save(tmp_path / "stack.tif", save_all=True, append_images=others)
    with pytest.raises(InputError, match=rf"stack\.tif: {len(METRES)} images in one file"):
        open_depth(tmp_path / "stack.tif", CAMERA)
    write_pngs(tmp_path / "tiffs", MILLIMETRES.astype(np.float32), ".tif")
    with pytest.raises(InputError, match=r"depth0\.tif: half of the measured pixels.*look like millimetres"):
        list(open_depth(tmp_path / "tiffs", CAMERA))


def test_a_file_that_is_cut_while_it_is_read_is_refused(tmp_path):
    """A memory map of it would end the whole process."""
    np.save(tmp_path / "a.npy", np.full((9, *MILLIMETRES.shape[1:]), 2000, np.uint16))
    images = iter(open_depth(tmp_path / "a.npy", CAMERA))
    next(images)
    os.truncate(tmp_path / "a.npy", 3 * MILLIMETRES[0].nbytes)
    with pytest.raises(InputError, match=r"a\.npy, frame 2: expected .* truncated"):
        list(images)


def test_an_image_or_an_array_that_claims_too_much_is_refused_before_memory_is_taken(tmp_path, monkeypatch):
    Image.new("I;16", (64, 48)).save(tmp_path / "a.png")
    content = bytearray((tmp_path / "a.png").read_bytes())
    content[16:24] = (40_000).to_bytes(4, "big") * 2
    content[29:33] = zlib.crc32(bytes(content[12:29])).to_bytes(4, "big")
    (tmp_path / "a.png").write_bytes(content)
    header = b"\x93NUMPY\x01\x00v\x00" + b"{'descr': '<u2', 'fortran_order': False, 'shape': (9, 40000, 40000), }"
    header = header.ljust(127) + b"\n"
    (tmp_path / "b.npy").write_bytes(header)
    with zipfile.ZipFile(tmp_path / "c.npz", "w") as archive:
        archive.writestr("depth.npy", header)
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file.create_dataset("depth", (9, 40_000, 40_000), "u2", chunks=(1, 40_000, 40_000))
    with h5py.File(tmp_path / "e.h5", "w") as file:  # whose images are small, but are unpacked together
        file.create_dataset("depth", (9000, 48, 64), "f8", chunks=(9000, 48, 64), compression="gzip")
    monkeypatch.setenv("KPOPNET_FILE_BUDGET_GB", "0.1")
    tracemalloc.start()
    for name in ("a.png", "b.npy", "c.npz", "d.h5", "e.h5"):
        assert is_refused(lambda name=name: list(open_depth(tmp_path / name, CAMERA))), name
    assert tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()


def test_a_recording_that_does_not_end_is_refused(tmp_path, monkeypatch):
    np.save(tmp_path / "a.npy", MILLIMETRES)
    source = open_depth(tmp_path / "a.npy", CAMERA)
    monkeypatch.setattr("kpopnet.sources.source.MAX_FRAMES", 3)
    with pytest.raises(InputError, match=r"a\.npy: more than 3 images; cut it into parts"):
        list(source)


@pytest.mark.parametrize(("write", "name"), [(write_npz, "a.npz"), (write_hdf5, "a.h5")])
def test_a_long_recording_is_never_in_memory_whole(write, name, tmp_path):
    images = np.full((400, 240, 320), 2000, np.uint16)  # 61 MB
    source = open_depth(write(tmp_path / name, images), CAMERAS["kinect_v1"])
    tracemalloc.start()
    assert sum(1 for _ in source) == 400
    assert tracemalloc.get_traced_memory()[1] < 8e6
    tracemalloc.stop()


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("missing", "no such file or folder"),
        ("notes.txt", "expected a folder of"),
        ("a.oni", "are not read; convert it to 16-bit PNG: .*pyoni"),
    ],
)
def test_a_path_of_no_known_kind_is_refused(name, told, tmp_path):
    if name != "missing":
        (tmp_path / name).write_text("notes")
    with pytest.raises(InputError, match=f"{name}: .*{told}"):
        open_depth(tmp_path / name, CAMERA)


def test_mistaken_arguments_of_opening_are_one_line(tmp_path):
    np.save(path := tmp_path / "a.npy", np.full((2, 240, 320), 2000, np.uint16))
    for camera in ("kinect_v1", {"fx": 1}, np.eye(3), lambda width, height: None):
        with pytest.raises(InputError, match=r"camera: expected a kpopnet\.camera\.Camera, such as CAMERAS"):
            open_depth(path, camera, rotate_deg=90)
    for wrong in ({"fps": "30"}, {"depth_scale": "1000"}):
        with pytest.raises(InputError, match=f"{next(iter(wrong))}='.*': expected a number"):
            open_depth(path, CAMERAS["kinect_v1"], **wrong)
    with pytest.raises(InputError, match="expected the path of a file or folder, got None"):
        open_depth(None, CAMERA)
