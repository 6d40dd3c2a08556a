"""Folders: bags of ROS 2, recordings of Stray Scanner, and images in the layout of a data set that is known, or in none.

TUM RGB-D  depth.txt lists times and images of 5000 units per metre (https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats)
ScanNet    depth/*.png and intrinsic/intrinsic_depth.txt, or frame-*.depth.* and _info.txt (https://github.com/ScanNet/ScanNet)
NTU RGB+D  MDepth-*.png or Depth-*.png of a Kinect v2, in millimetres (https://github.com/shahroudy/NTURGB-D)
"""

import math
import re
from pathlib import Path, PurePosixPath

from kpopnet.camera import CAMERAS, Camera
from kpopnet.runtime.input_files import expect, parse_numbers, parsing, read_text
from kpopnet.sources import phones, ros
from kpopnet.sources.images import CAMERA_FILE, images_in, read_images
from kpopnet.sources.images import read_folder as read_image_folder
from kpopnet.sources.source import Recording

TUM_INDEX, TUM_UNITS_PER_M = "depth.txt", 5000.0
TUM_NAME, TUM_CAMERA = "rgbd_dataset_freiburg", Camera(525.0, 525.0, 319.5, 239.5, 640, 480)
"""How the data set's own folders are called, and the camera that it recommends for their depth."""

SCANNET_INFO, SCANNET_CAMERAS = "_info.txt", ("intrinsic/intrinsic_depth.txt", "intrinsic_depth.txt")
SCANNET_MATRIX, SCANNET_UNITS = "m_calibrationDepthIntrinsic", "m_depthShift"

NTU_NAME = re.compile(r"M?Depth-[0-9]{8}\.png")
NTU_CAMERA, NTU_FPS = CAMERAS["kinect_2"], 30.0
"""Nominal: the data set states the model of its camera, not its intrinsics."""


def read_folder(folder: Path, key: str | None) -> Recording:
    """A folder of one of these kinds; with `key`, a pattern of names, the images of any."""
    if (folder / ros.METADATA).is_file():
        return ros.read_bag(folder, key)
    if key is None:
        for layout in (phones.read_stray, _tum, _scannet):
            if (found := layout(folder)) is not None:
                return found
    found = read_image_folder(folder, key)
    is_ntu = NTU_NAME.match(images_in(folder, key or "*")[0].name) and found.width == NTU_CAMERA.width
    return found._replace(camera=found.camera or NTU_CAMERA, fps=NTU_FPS) if is_ntu else found


def _tum(folder: Path) -> Recording | None:
    index = folder / TUM_INDEX
    if not index.is_file():
        return None
    paths, times_s = [], []
    for number, line in enumerate(read_text(index).splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        time, name = (*line.split(maxsplit=1), "")[:2]
        where, place = f"{index}: line {number}", PurePosixPath(name.strip())
        with parsing(where, "expected a time in seconds and the path of an image"):
            times_s.append(float(time))
        expect(math.isfinite(times_s[-1]), where, "a finite time in seconds")
        expect(bool(name) and not place.is_absolute() and ".." not in place.parts, where, "the path of an image in this folder")
        paths.append(folder / place)
    expect(bool(paths), str(index), "lines of a time and an image's path")
    found = read_images(paths, folder / CAMERA_FILE, [time_s - times_s[0] for time_s in times_s])
    stated = TUM_CAMERA if folder.resolve().name.startswith(TUM_NAME) else None
    return found._replace(camera=found.camera or stated, units_per_m=TUM_UNITS_PER_M)


def _scannet(folder: Path) -> Recording | None:
    info, files = folder / SCANNET_INFO, [folder / name for name in SCANNET_CAMERAS if (folder / name).is_file()]
    if paths := images_in(folder, "frame-*.depth.*"):
        lines = [line.partition("=") for line in read_text(info).splitlines()] if info.is_file() else []
        stated = {name.strip(): value for name, _, value in lines}
        matrix, units = stated.get(SCANNET_MATRIX), stated.get(SCANNET_UNITS)
    elif files and (paths := images_in(folder / "depth", "*")):
        info, matrix, units = files[0], read_text(files[0]), None
    else:
        return None
    found = read_images(paths, folder / CAMERA_FILE)
    if matrix is not None and found.camera is None:
        numbers = parse_numbers(matrix, f"{info}: the intrinsic matrix", 16)
        four = (numbers[place] for place in (0, 5, 2, 6))
        found = found._replace(camera=Camera.from_numbers((*four, found.width, found.height), str(info)))
    scale = None if units is None else parse_numbers(units, f"{info}: {SCANNET_UNITS}", 1)[0]
    expect(scale is None or scale > 0, str(info), f"a positive {SCANNET_UNITS}")
    return found._replace(units_per_m=scale)
