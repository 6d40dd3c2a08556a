"""Opens a recording of depth of any known kind."""

from collections.abc import Callable
from pathlib import Path

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from kpopnet.sources.source import DEFAULT_FPS, DepthSource, Recording

CameraOfSize = Callable[[int, int], Camera]
"""Makes a camera for images of a width and a height, as `functools.partial(Camera.from_fov, 58.0)` does."""


def open_depth(
    path: Path | str, camera: Camera | CameraOfSize | None = None, fps: float | None = None, key: str | None = None
) -> DepthSource:
    """Opens a recording of depth; docs/predicting.md says what each kind of file holds.

    Args:
        path: a folder of 16-bit PNG or TIFF images, or a file: .png, .tif, .npz, .npy, .h5, .mkv, .avi, .bag.
        camera: of the images, or a function of their width and height; None takes the file's.
        fps: the true number of images per second; None takes the file's times or rate, else DEFAULT_FPS.
        key: name of the array in a file that holds several; of a folder, a pattern of names, such as "depth_*.png".

    Raises:
        InputError: the file is of no known kind, is missing or damaged, holds no depth, or does not tell its camera.
    """
    path = Path(path)
    if fps is not None and not 1 <= fps <= 1000:
        raise InputError(f"{path}: {fps:g} images a second; expected 1 to 1000")
    recording = _reader(path)(path, key)
    if camera is None:
        camera = recording.camera
    if camera is None:
        raise InputError(
            f"{path}: does not tell its camera; give a preset ({', '.join(CAMERAS)}) or a file of intrinsics (--camera), "
            "the horizontal field of view in degrees (--fov), or the focal length in pixels (--focal)"
        )
    if not isinstance(camera, Camera):
        camera = camera(recording.width, recording.height)
    stated = recording.fps if fps is None else fps
    return DepthSource(
        str(path), camera, stated or DEFAULT_FPS, stated is not None, recording.frames, recording.images, file_times=fps is None
    )


def _reader(path: Path) -> Callable[[Path, str | None], Recording]:
    """The reader of a file or folder by its name."""
    if path.is_dir():
        from kpopnet.sources.images import read_folder

        return read_folder
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: expected a folder of 16-bit PNG or TIFF images, or a file that ends with {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    match suffix:
        case ".npz" | ".npy":
            from kpopnet.sources.arrays import read_npy, read_npz_depth

            return read_npz_depth if suffix == ".npz" else read_npy
        case ".h5" | ".hdf5":
            from kpopnet.sources.hdf5 import read_hdf5

            return read_hdf5
        case ".mkv" | ".avi":
            from kpopnet.sources.video import read_video

            return read_video
        case ".bag":
            from kpopnet.sources.realsense import read_bag

            return read_bag
        case _:
            from kpopnet.sources.images import read_image

            return read_image


SUFFIXES = (".png", ".tif", ".tiff", ".npz", ".npy", ".h5", ".hdf5", ".mkv", ".avi", ".bag")
