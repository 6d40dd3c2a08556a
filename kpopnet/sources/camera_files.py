"""Cameras from JSON files: our own, RealSense's and Azure Kinect's.

Ours:          {"fx": 365.0, "fy": 365.0, "cx": 255.5, "cy": 211.5, "width": 512, "height": 424}
RealSense:     {"width": 640, "height": 480, "ppx": 321.2, "ppy": 238.9, "fx": 387.1, "fy": 387.1, "coeffs": [...], ...},
               as `rs-enumerate-devices`, pyrealsense2 and many recorders write it, also inside "depth" or "depth_intrinsics"
Azure Kinect:  the calibration that a recording holds: {"CalibrationInformation": {"Cameras": [...]}}, whose intrinsics are
               relative to the size of the sensor's full image; the mode that was recorded is given with the file

Lens distortion is not modelled; a camera whose distortion shows is read with a warning.
"""

import logging
from pathlib import Path
from typing import Any

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import read_json

log = logging.getLogger(__name__)

INNER_R2, VISIBLE_DISTORTION = 0.25, 0.02
"""A lens that moves points at a distance of half the focal length from the centre by more than this share of it is reported."""

OURS = ("fx", "fy", "cx", "cy", "width", "height")
REALSENSE = ("fx", "fy", "ppx", "ppy", "width", "height")
NESTED = ("depth", "depth_intrinsics", "intrinsics", "camera")
"""Where recorders put a camera inside a larger file."""

AZURE_SENSOR_PX = 1024
AZURE_MODES = {(320, 288): (0.5, 192, 180), (640, 576): (1.0, 192, 180), (512, 512): (0.5, 0, 0), (1024, 1024): (1.0, 0, 0)}
"""Sizes of an Azure Kinect's depth images: the scale, and the first column and row on the sensor's 1024 x 1024 pixels. The
narrow modes are a part of it, the wide ones all of it (Azure Kinect Sensor SDK, MIT)."""


def read_camera(path: Path | str, width: int | None = None, height: int | None = None) -> Camera:
    """The camera of a JSON file of one of the kinds above, or a preset by its name in `kpopnet.camera.CAMERAS`.

    An Azure Kinect's calibration needs `width` and `height` of the recorded image in pixels.
    """
    if str(path) in CAMERAS:
        return CAMERAS[str(path)]
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file, and no preset; there are {', '.join(CAMERAS)}")
    content = read_json(Path(path))
    if isinstance(content, dict) and "CalibrationInformation" in content:
        return _azure_kinect(content, str(path), width, height)
    candidates = [content] + [content[name] for name in NESTED if isinstance(content, dict) and name in content]
    for found in candidates:
        for names in (OURS, REALSENSE):
            if isinstance(found, dict) and all(isinstance(found.get(name), int | float) for name in names):
                coefficients = found.get("coeffs", [])  # k1, k2, p1, p2, k3
                if isinstance(coefficients, list):
                    _warn_of_distortion([*coefficients[:2], *coefficients[4:5]], str(path))
                return Camera.from_numbers((float(found[name]) for name in names), str(path))
    raise InputError(
        f"{path}: no camera in it; expected JSON with numbers {', '.join(OURS)}, or RealSense's with ppx and ppy, or an Azure "
        "Kinect's CalibrationInformation"
    )


def _azure_kinect(content: dict[str, Any], where: str, width: int | None, height: int | None) -> Camera:
    if (width, height) not in AZURE_MODES:
        modes = ", ".join(f"{wide}x{high}" for wide, high in AZURE_MODES)
        raise InputError(
            f"{where}: an Azure Kinect's calibration serves all its modes; give the depth image's size, one of {modes}"
        )
    try:
        cameras = content["CalibrationInformation"]["Cameras"]
        depth = next(one for one in cameras if one["Purpose"] == "CALIBRATION_CameraPurposeDepth")
        numbers = [float(one) for one in depth["Intrinsics"]["ModelParameters"][:10]]
        cx, cy, fx, fy = (number * AZURE_SENSOR_PX for number in numbers[:4])
    except (KeyError, TypeError, ValueError, StopIteration) as error:
        raise InputError(
            f"{where}: expected a camera of purpose CALIBRATION_CameraPurposeDepth with Intrinsics.ModelParameters"
        ) from error
    _warn_of_distortion(numbers[4:10], where)
    scale, left, top = AZURE_MODES[width, height]
    # ModelParameters: cx, cy, fx, fy, k1, ... as fractions of the sensor's full image, whose pixel edges lie at whole numbers.
    return Camera.from_numbers(
        (fx * scale, fy * scale, (cx - left) * scale - 0.5, (cy - top) * scale - 0.5, width, height), where
    )


def _warn_of_distortion(radial: list[Any], where: str) -> None:
    """Warns where the radial coefficients k1, k2, k3 and, of a rational model, k4, k5, k6 move points visibly."""
    k = [float(one) if isinstance(one, int | float) else 0.0 for one in radial] + [0.0] * 6
    above = 1 + k[0] * INNER_R2 + k[1] * INNER_R2**2 + k[2] * INNER_R2**3
    below = 1 + k[3] * INNER_R2 + k[4] * INNER_R2**2 + k[5] * INNER_R2**3
    if abs(above / below - 1 if below else 1.0) > VISIBLE_DISTORTION:
        log.warning("%s: its lens distortion is not modelled: joints away from the image's centre will be off", where)
