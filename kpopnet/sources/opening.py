"""Opens a recording of depth of any known kind."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from kpopnet.sources.camera_files import read_camera
from kpopnet.sources.source import DEFAULT_FPS, DepthSource, Recording

CameraOfSize = Callable[[int, int], Camera]
"""Makes a camera for images of a width and a height, as `functools.partial(Camera.from_fov, 58.0)` does."""


def chosen_camera(
    given: str | None = None, fov_deg: float | None = None, focal_px: float | None = None
) -> Camera | CameraOfSize | None:
    """The camera that a command line names in one of three ways, for `open_depth`.

    Args:
        given: a preset of `kpopnet.camera.CAMERAS`, or a file of intrinsics (`camera_files`).
        fov_deg: horizontal field of view in degrees.
        focal_px: focal length in pixels.

    Returns:
        None where it names none.

    Raises:
        InputError: it names more than one; a focal length that is not positive.
    """
    if sum(one is not None for one in (given, fov_deg, focal_px)) > 1:
        raise InputError("the camera is given twice; give one of --camera, --fov and --focal")
    if given is not None:
        return CAMERAS.get(given) or partial(read_camera, given)
    if fov_deg is not None:
        return partial(Camera.from_fov, fov_deg)
    return None if focal_px is None else partial(Camera.centred, focal_px)


def open_depth(
    path: Path | str, camera: Camera | CameraOfSize | None = None, fps: float | None = None, key: str | None = None
) -> DepthSource:
    """Opens a recording of depth; docs/predicting.md says what each kind of file holds.

    Args:
        path: a folder of 16-bit PNG or TIFF images, or a file: .png, .tif, .npz, .npy, .h5, .mkv, .avi, .bag, .db3.
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
        raise InputError(
            f"{path}: expected a folder of 16-bit PNG or TIFF images, or a file that ends with {', '.join(SUFFIXES)}"
        )
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
        case ".bag" | ".db3":
            from kpopnet.sources.realsense import read_bag

            return read_bag
        case _:
            from kpopnet.sources.images import read_image

            return read_image


SUFFIXES = (".png", ".tif", ".tiff", ".npz", ".npy", ".h5", ".hdf5", ".mkv", ".avi", ".bag", ".db3")
