"""Pinhole camera without distortion, and conversion of depth images to metres."""

import math
import numbers
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kpopnet.errors import InputError, check_between

MM_PER_METRE = 1000.0

MAX_MEDIAN_DEPTH_M = 50.0
"""No depth camera measures most of its pixels farther away; a person at 0.05 m is nearer than any measures in millimetres."""

MIN_FARTHEST_M, FEW_PIXELS = 0.05, 20
"""An image of more than a few pixels, all of them nearer, was no measurement in millimetres. A few pixels tell no unit."""

UNMEASURED_M = 1e6
"""No camera measures this far, in millimetres either: what is stored there is not measured."""

MAX_IMAGE_PIXELS = 16_000_000
"""Cameras in files may have images of at most 16 megapixels."""

MOST_PIXELS, MOST_SIDE = 1280 * 720, 2048
"""Poses are estimated from every second pixel, or fewer, of larger images: networks and fits look at no more."""

MOST_OBLONG = 1.25
"""Pixels are taken for square up to this ratio of the focal lengths. Of 40 people before a camera of 1.5 the finder missed up
to 2 and found up to 8 twice, of 2 it missed up to 13."""

MIN_FOCAL_PX, MAX_FOCAL_PX, MAX_CENTRE_PX = 1e-2, 1e6, 1e8
"""Others leave the range of float32 with what is computed from them; no depth camera comes near."""


@dataclass(frozen=True)
class Camera:
    """Focal lengths, principal point and image size in pixels. Camera frame: x right, y down, z forward, metres.

    Pixel centres lie at integer coordinates, so a centred camera has cx = (width-1)/2 and cy = (height-1)/2.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    def __post_init__(self) -> None:
        _check_size(self.width, self.height)
        for name in ("width", "height"):
            object.__setattr__(self, name, int(getattr(self, name)))  # those of numpy overflow
        for name in ("fx", "fy"):
            check_between(f"a camera's {name}", getattr(self, name), MIN_FOCAL_PX, MAX_FOCAL_PX)
        for name in ("cx", "cy"):
            check_between(f"a camera's {name}", getattr(self, name), -MAX_CENTRE_PX, MAX_CENTRE_PX)

    @classmethod
    def from_numbers(cls, numbers: Iterable[float], where: str) -> "Camera":
        """A camera from fx, fy, cx, cy, width, height as a file stores them, for `where` in messages.

        Raises InputError if they are no camera with an image of whole pixels, at most MAX_IMAGE_PIXELS.
        """
        fx, fy, cx, cy, width, height = numbers
        if not (0 < width * height <= MAX_IMAGE_PIXELS and width > 0 and width == int(width) and height == int(height)):
            expected = f"whole numbers of at least 1, and at most {MAX_IMAGE_PIXELS:,} pixels"
            raise InputError(f"{where}: an image of {width} x {height} pixels, expected {expected}")
        try:
            return cls(fx, fy, cx, cy, int(width), int(height))
        except InputError as error:
            raise InputError(f"{where}: {error}") from error

    @classmethod
    def centred(cls, focal_px: float, width: int, height: int) -> "Camera":
        """A camera with square pixels whose principal point is the image centre."""
        _check_size(width, height)
        return cls(focal_px, focal_px, (width - 1) / 2, (height - 1) / 2, width, height)

    @classmethod
    def from_fov(cls, horizontal_deg: float, width: int, height: int) -> "Camera":
        """A camera with square pixels whose image spans 1 to 179 degrees from its left edge to its right, as in data sheets."""
        _check_size(width, height)
        if not isinstance(horizontal_deg, numbers.Real) or not 1 <= horizontal_deg <= 179:
            raise InputError(f"a field of view of {horizontal_deg!r} degrees: expected the horizontal angle, 1 to 179")
        return cls.centred(width / (2 * math.tan(math.radians(horizontal_deg) / 2)), width, height)

    @classmethod
    def from_intrinsics(cls, matrix: np.ndarray, width: int, height: int) -> "Camera":
        """A camera from its (3, 3) matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels, as OpenCV, ROS and ARKit write it.

        Raises InputError for a matrix of another shape, transposed, with skew, or in other units.
        """
        try:
            given = np.asarray(matrix, dtype=np.float64)
        except (TypeError, ValueError):
            given = np.empty(0)
        if given.shape != (3, 3) or not np.allclose(given[[0, 1, 2, 2, 2], [1, 0, 0, 1, 2]], [0, 0, 0, 0, 1]):
            raise InputError(f"camera matrix {matrix!s:.120}: expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels")
        fx, fy, cx, cy = given[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
        return cls(fx, fy, cx, cy, width, height)

    def project(self, points_camera_m: np.ndarray) -> np.ndarray:
        """Projects (..., 3) points in metres to (..., 3) u, v in pixels and z in metres. Points with z = 0 give inf or NaN.

        Raises InputError for another shape or type.
        """
        points = _triples("points", points_camera_m)
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([self.fx * x / z + self.cx, self.fy * y / z + self.cy, z], axis=-1)

    def back_project(self, uvz: np.ndarray) -> np.ndarray:
        """Converts (..., 3) u, v in pixels and z in metres to (..., 3) points in metres: the inverse of `project`."""
        uvz = _triples("u, v, z", uvz)
        u, v, z = uvz[..., 0], uvz[..., 1], uvz[..., 2]
        return np.stack([(u - self.cx) * z / self.fx, (v - self.cy) * z / self.fy, z], axis=-1)

    def points(self, depth_m: np.ndarray) -> np.ndarray:
        """Converts (H, W) depth in metres to (H, W, 3) points in metres; pixels without a measurement give (0, 0, 0).

        Raises InputError as `check_metres`.
        """
        check_metres("depth image", self, depth_m)
        v, u = np.mgrid[: depth_m.shape[0], : depth_m.shape[1]].astype(np.float32)
        return self.back_project(np.stack([u, v, depth_m], axis=-1))

    def cropped(self, x0: int, y0: int, width: int, height: int) -> "Camera":
        """The camera of the sub-image of this size whose first pixel is (x0, y0)."""
        return Camera(self.fx, self.fy, self.cx - x0, self.cy - y0, width, height)

    def resized(self, width: int, height: int) -> "Camera":
        """The camera of the image resized: the edges of its pixels stay edges."""
        x, y = width / self.width, height / self.height
        return Camera(self.fx * x, self.fy * y, (self.cx + 0.5) * x - 0.5, (self.cy + 0.5) * y - 0.5, width, height)

    def mirrored(self) -> "Camera":
        """The camera of the image flipped left to right."""
        return Camera(self.fx, self.fy, self.width - 1 - self.cx, self.cy, self.width, self.height)

    def turned(self) -> "Camera":
        """The camera of the image turned clockwise by a right angle."""
        return Camera(self.fy, self.fx, self.height - 1 - self.cy, self.cx, self.height, self.width)


def _check_size(width: int, height: int) -> None:
    if not all(isinstance(side, numbers.Integral) and side > 0 for side in (width, height)):
        raise InputError(f"a camera's image must have whole pixels, at least one, not {width!r}x{height!r}")


CAMERAS = {
    "eval": Camera.centred(285.7, 320, 240),
    "kinect_v1": Camera.centred(285.63, 320, 240),
    "smmc10": Camera.centred(204.795, 144, 176),
    "kinect_2": Camera.centred(365.0, 512, 424),
    "azure_kinect": Camera.centred(504.0, 640, 576),
    "realsense": Camera.centred(433.0, 848, 480),
}
"""Presets with nominal intrinsics: EVAL and Kinect v1 (320x240), SMMC-10's SwissRanger in portrait orientation, Kinect 2, Azure
Kinect (narrow field of view, not binned) and RealSense D435 (58 degrees of height, from its data sheet)."""


def measured(stored: np.ndarray) -> np.ndarray:
    """Depth as it is stored, in any unit, as float32: the largest of 16 unsigned bits, of either byte order, becomes 0."""
    depth = stored.astype(np.float32)
    if stored.dtype.kind == "u" and stored.dtype.itemsize == 2:
        depth[stored == np.iinfo(np.uint16).max] = 0
    return depth


def depth_in_metres(
    depth: np.ndarray, camera: Camera | None = None, *, where: str = "depth image", unit_known: bool = False
) -> np.ndarray:
    """Converts depth given by a user, an (H, W) image or a (T, H, W) sequence, to float32 metres, 0 where nothing was measured.

    Unsigned integers are millimetres, the largest of 16 bits not measured; floating point is metres, negative and non-finite
    values, and those of UNMEASURED_M or more, not measured. With a camera the depth must have its image size. Raises
    InputError, for `where`, the depth's name (a file, a frame): wrong type, number of dimensions or size; no camera; or numbers
    that look like those of the other unit, unless that is known, as from images before it or from a camera, before which a hand
    may be held.
    """
    if camera is not None:
        check_camera(camera)
    if isinstance(depth, np.ma.MaskedArray):
        raise InputError(f"{where}: a masked array; give 0 where nothing was measured, as depth.filled(0) does")
    if not isinstance(depth, np.ndarray):
        raise InputError(f"{where}: expected a numpy array, got {type(depth).__name__}")
    if depth.ndim not in (2, 3):
        raise InputError(f"{where}: expected shape (H, W) or (T, H, W), got {depth.shape}")
    if depth.dtype.kind == "u" and depth.dtype.itemsize > 1:
        depth_m = measured(depth) / np.float32(MM_PER_METRE)
        if (
            not unit_known
            and 0 < (farthest_m := depth_m.max(initial=0)) < MIN_FARTHEST_M
            and np.count_nonzero(depth_m) > FEW_PIXELS
        ):
            raise InputError(
                f"{where}: nothing is farther away than {1000 * farthest_m:.0f} mm: these look like metres; integers are "
                "millimetres, so multiply by 1000, or convert it with .astype(np.float32)"
            )
    elif depth.dtype.kind == "f":
        with np.errstate(over="ignore"):  # infinite as float32: not measured
            depth_m = np.maximum(depth, 0, dtype=np.float32, casting="same_kind")
        if not (farthest_m := depth_m.max(initial=0)) < UNMEASURED_M:  # nor is NaN, if there is one
            depth_m[~(depth_m < UNMEASURED_M)] = 0
            farthest_m = depth_m.max(initial=0)
        if (
            not unit_known
            and farthest_m > MAX_MEDIAN_DEPTH_M
            and np.count_nonzero(depth_m) > FEW_PIXELS
            and (median := np.median(depth_m[depth_m > 0])) > MAX_MEDIAN_DEPTH_M
        ):
            raise InputError(
                f"{where}: half of the measured pixels are {median:g} m or farther away: these look like millimetres "
                "or centimetres; floating-point depth is metres, so divide it by 1000 or 100, or convert millimetres with "
                ".astype(np.uint16)"
            )
    else:
        advice = "convert it, for instance with .astype(np.uint16)"
        if depth.dtype == np.uint8:
            advice = "a picture of depth in 256 shades holds no distances: record the camera's own 16 bits"
        raise InputError(f"{where}: expected uint16 millimetres or floating-point metres, got {depth.dtype}; {advice}")
    if camera is not None and depth.shape[-2:] != (camera.height, camera.width):
        raise InputError(
            f"{where}: expected the camera's {camera.width}x{camera.height} pixels, got {depth.shape[-1]}x{depth.shape[-2]}"
        )
    return depth_m


def check_camera(camera: object) -> None:
    """Raises InputError for anything but a camera."""
    if not isinstance(camera, Camera):
        made = "CAMERAS['kinect_2'] or Camera.from_fov(70.6, 512, 424)"
        raise InputError(f"camera: expected a kpopnet.camera.Camera, such as {made}, got {type(camera).__name__}")


def _triples(what: str, given: ArrayLike) -> np.ndarray:
    triples = np.asarray(given)
    if triples.shape[-1:] != (3,) or triples.dtype.kind not in "fiu":
        raise InputError(f"{what} of shape {triples.shape}, {triples.dtype}: expected (..., 3) numbers")
    return triples


def check_metres(where: str, camera: Camera, depth_m: object) -> None:
    """Raises InputError, for `where`, for anything but one (H, W) image of the camera in floating-point metres."""
    check_camera(camera)
    if not isinstance(depth_m, np.ndarray) or depth_m.dtype not in (np.float32, np.float64):
        found = depth_m.dtype if isinstance(depth_m, np.ndarray) else type(depth_m).__name__
        raise InputError(
            f"{where}: expected floating-point metres of 32 or 64 bits, got {found}; kpopnet.camera.depth_in_metres converts"
        )
    check_images(where, camera, depth_m)


def check_images(where: str, camera: Camera, *images: np.ndarray) -> None:
    """Raises InputError if an (H, W) image, for `where`, has not the camera's size: compiled code would read beyond its end."""
    size = camera.height, camera.width
    for image in images:
        if image.shape != size:
            raise InputError(f"{where}: an image of shape {image.shape}, expected the camera's (height, width) = {size}")


def subsampled(depth_m: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera]:
    """(..., H, W) depth to estimate from, and its camera: of images above MOST_PIXELS the middle pixel of every square.

    Where pixels are higher than wide, or wider than high, by more than MOST_OBLONG, the others are left out first: networks and
    fits know people by pixels that are square.
    """
    depth_m, camera = _with_square_pixels(depth_m, camera)
    apart = math.ceil(max(math.sqrt(camera.width * camera.height / MOST_PIXELS), *(np.array(depth_m.shape[-2:]) / MOST_SIDE)))
    if apart == 1:
        return depth_m, camera
    y, x = min(apart // 2, camera.height - 1), min(apart // 2, camera.width - 1)
    fewer_m = np.ascontiguousarray(depth_m[..., y::apart, x::apart])
    middle = (camera.cx - x) / apart, (camera.cy - y) / apart
    return fewer_m, Camera(camera.fx / apart, camera.fy / apart, *middle, fewer_m.shape[-1], fewer_m.shape[-2])


def _with_square_pixels(depth_m: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera]:
    """(..., H, W) depth with the nearest of every 1.5 rows, say, where the focal length is 1.5 times that of the columns."""
    apart = max(camera.fx / camera.fy, 1.0), max(camera.fy / camera.fx, 1.0)
    if max(apart) <= MOST_OBLONG:
        return depth_m, camera
    sizes = [max(math.ceil(size / step - 0.5), 1) for size, step in zip((camera.width, camera.height), apart, strict=True)]
    columns, rows = (((np.arange(size) + 0.5) * step).astype(int) for size, step in zip(sizes, apart, strict=True))
    columns, rows = columns.clip(max=camera.width - 1), rows.clip(max=camera.height - 1)  # one pixel may stand for all
    cx, cy = ((at - (step - 1) / 2) / step for at, step in zip((camera.cx, camera.cy), apart, strict=True))
    square_m = np.ascontiguousarray(depth_m[..., rows, :][..., columns])
    return square_m, Camera(camera.fx / apart[0], camera.fy / apart[1], cx, cy, sizes[0], sizes[1])


def tells_unit(depth_m: np.ndarray) -> bool:
    """Whether an image that `depth_in_metres` has converted measured enough to tell the unit of those that follow."""
    return bool(np.count_nonzero(depth_m) > FEW_PIXELS)


def image_in_metres(depth: np.ndarray, camera: Camera, unit_known: bool = False) -> np.ndarray:
    """`depth_in_metres` of one (H, W) image; raises InputError for a sequence, too."""
    depth_m = depth_in_metres(depth, camera, unit_known=unit_known)
    if depth_m.ndim != 2:
        raise InputError(f"depth image: expected shape (H, W), got {depth_m.shape}; pass one image per call")
    return depth_m


def sequence_in_metres(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """`depth_in_metres` of a (T, H, W) sequence."""
    check_camera(camera)
    depth_m = depth_in_metres(depth, camera, where="depth sequence")
    if depth_m.ndim != 3:
        raise InputError(f"depth sequence: expected shape (T, H, W), got {depth_m.shape}; add a leading axis")
    return depth_m
