"""Opens a recording of depth of any known kind."""

import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import astuple
from functools import partial
from pathlib import Path

from kpopnet.camera import CAMERAS, Camera, check_camera
from kpopnet.errors import InputError, check_number
from kpopnet.runtime.input_files import as_path
from kpopnet.runtime.untrusted import iterate_in_child, read_in_child
from kpopnet.sources import arrays, folders, images, phones, ros, stream, video
from kpopnet.sources.camera_files import read_optics
from kpopnet.sources.lenses import Lens, Optics
from kpopnet.sources.source import DepthSource, Recording, StoredImage, check_size

DEFAULT_FPS = 30.0

CameraOfSize = Callable[[int, int], Camera | Optics]
"""Makes a camera for images of a width and a height, as `functools.partial(Camera.from_fov, 58.0)` does."""

WITH_NAMES = {
    ".npz": arrays.read_npz_depth,
    **dict.fromkeys((".h5", ".hdf5"), arrays.read_hdf5),
    **dict.fromkeys(ros.SUFFIXES, ros.read_bag),
}
"""Readers of files that hold several things by name."""

READERS = {
    **dict.fromkeys(images.SUFFIXES, lambda path: images.read_images([path])),
    ".npy": arrays.read_npy,
    **dict.fromkeys(video.CONTAINERS, video.read_video),
    ".r3d": phones.read_record3d,
    ".depth": stream.read_recording,
}
"""Readers of files that hold one recording of depth."""

ZED = "the ZED SDK exports it (https://github.com/stereolabs/zed-sdk/tree/master/recording/export/svo)"
CONVERTERS = {
    ".oni": "pyonitool --extractdepth FOLDER (https://pypi.org/project/pyoni)",
    ".xef": "open the clip in Kinect2Viewer on Windows (https://github.com/UnaNancyOwen/Kinect2Viewer)",
    ".svo": ZED,
    ".svo2": ZED,
}
"""What makes images of recordings that only their makers' libraries read."""


def chosen_camera(
    given: str | None = None, fov_deg: float | None = None, focal_px: float | None = None
) -> Camera | CameraOfSize | None:
    """The camera that a command line names, for `open_depth`; None where it names none.

    It is a preset of `kpopnet.camera.CAMERAS`, a file of intrinsics (`camera_files`), the horizontal field of view in degrees,
    or the focal length in pixels.
    """
    if sum(one is not None for one in (given, fov_deg, focal_px)) > 1:
        raise InputError("the camera is given twice; give one of --camera, --fov and --focal")
    if given is not None:
        return partial(read_optics, given)
    if fov_deg is not None:
        return partial(Camera.from_fov, fov_deg)
    return None if focal_px is None else partial(Camera.centred, focal_px)


def open_depth(
    path: Path | str,
    camera: Camera | CameraOfSize | None = None,
    fps: float | None = None,
    key: str | None = None,
    in_child: bool = False,
    rotate_deg: int = 0,
    depth_scale: float | None = None,
) -> DepthSource:
    """Opens a recording of depth; docs/predicting.md says what each kind of file holds.

    Args:
        path: a folder of images, in the layout of a known data set or app or in none, or a file: .png, .tif, .npz, .npy, .h5,
            .mkv, .avi, .bag, .db3, .mcap, .r3d, .depth.
        camera: of the images, or a function of their width and height; None takes the file's.
        fps: the true number of images per second; None takes the file's times or rate, else DEFAULT_FPS.
        key: name of the array or topic in a file that holds several; of a folder, a pattern of names, such as "depth_*.png".
        in_child: whether a process with limits of time and memory reads it: damaged or hostile files of a stranger may crash
            the libraries that parse them. Its start takes half a second.
        rotate_deg: by how much the images are turned clockwise to be upright: 0, 90, 180 or 270.
        depth_scale: how many of the stored numbers make a metre, as 5000 in the TUM data set; None takes what the recording
            states, else 1000 for integers and 1 for floating-point numbers.
    """
    path = as_path(path)
    for name, number in (("fps", fps), ("depth_scale", depth_scale)):
        if number is not None:
            check_number(name, number)
    if not isinstance(key, str | None):
        raise InputError(f"key={key!r:.80}: expected the name of an array or topic, or a pattern of names")
    recording = _described(path, key, in_child)
    check_size(str(path), recording.width, recording.height, recording.frames)
    stated = recording.fps if fps is None else fps
    if stated is not None and not 1 <= stated <= 1000:
        cause = ", by its own times in seconds, or its own rate; --fps overrides them" if fps is None else ""
        raise InputError(f"{path}: {stated:g} images a second; expected 1 to 1000{cause}")
    if depth_scale is not None and not 0 < depth_scale < math.inf:
        raise InputError(f"{path}: {depth_scale:g} units a metre; expected a positive number, such as 1000 for millimetres")
    if depth_scale is not None and path.suffix.lower() == ".depth":
        raise InputError(f"{path}: its first line states the unit of its depth; leave --depth-scale out")
    chosen = camera if camera is not None else recording.camera and Optics(recording.camera, recording.lens)
    if chosen is None:
        raise InputError(
            f"{path}: does not state its camera; give a preset ({', '.join(CAMERAS)}) or a file of intrinsics (--camera), "
            "the horizontal field of view in degrees (--fov), or the focal length in pixels (--focal)"
        )
    found = chosen(recording.width, recording.height) if callable(chosen) else chosen
    known = found if isinstance(found, Optics) else Optics(found)
    check_camera(known.camera)
    view = known.view().rotated(rotate_deg)
    given = stated or DEFAULT_FPS, stated is not None, recording.frames, recording.images
    units = recording.units_per_m if depth_scale is None else depth_scale
    return DepthSource(str(path), known.camera, view, *given, file_times=fps is None, units_per_m=units)


def _described(path: Path, key: str | None, in_child: bool) -> Recording:
    if not in_child:
        return _read(path, key)
    stated = read_in_child(_without_images, path, key)
    camera = None if stated["camera"] is None else Camera.from_numbers(stated["camera"], f"{path}: camera")
    lens = None if stated["lens"] is None else Lens(*stated["lens"])

    def images() -> Iterator[StoredImage]:
        return (StoredImage(*image) for image in iterate_in_child(_images, path, key))

    return Recording(**stated | {"images": images, "camera": camera, "lens": lens})


def _without_images(path: Path, key: str | None) -> dict:
    found = _read(path, key)
    return found._asdict() | {"images": None, "camera": None if found.camera is None else astuple(found.camera)}


def _images(path: Path, key: str | None) -> Iterator[StoredImage]:
    logging.disable()  # this process is a child: its warnings were told with what the recording states
    return _read(path, key).images()


def _read(path: Path, key: str | None) -> Recording:
    suffix = path.suffix.lower()
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if path.is_dir():
        return folders.read_folder(path, key)
    if suffix in CONVERTERS:
        raise InputError(f"{path}: recordings of this kind are not read; convert it to 16-bit PNG: {CONVERTERS[suffix]}")
    if suffix in WITH_NAMES:
        return WITH_NAMES[suffix](path, key)
    if suffix not in READERS:
        raise InputError(
            f"{path}: expected a folder of 16-bit images, or a file that ends with {', '.join([*READERS, *WITH_NAMES])}"
        )
    if key is not None:
        raise InputError(f"{path}: holds one recording of depth, and no arrays by name such as {key}")
    return READERS[suffix](path)
