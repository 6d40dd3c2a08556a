"""Cameras from JSON files: our own, RealSense's and Azure Kinect's.

Ours:          {"fx": 365.0, "fy": 365.0, "cx": 255.5, "cy": 211.5, "width": 512, "height": 424}
RealSense:     {"width": 640, "height": 480, "ppx": 321.2, "ppy": 238.9, "fx": 387.1, "fy": 387.1, "coeffs": [...], ...},
               as `rs-enumerate-devices`, pyrealsense2 and many recorders write it, also inside "depth" or "depth_intrinsics"
Azure Kinect:  the calibration that a recording holds: {"CalibrationInformation": {"Cameras": [...]}}, whose intrinsics are
               relative to the size of the sensor's full image; the mode that was recorded is given with the file

`coeffs` are those of Brown-Conrady's model, k1, k2, p1, p2, k3 to k6; with "model": "kannala_brandt4", of a fisheye lens, k1 to
k4.
"""

import logging
from pathlib import Path
from typing import Any

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import as_path, expect, read_json
from kpopnet.sources.lenses import Lens, Optics

log = logging.getLogger(__name__)

OURS = ("fx", "fy", "cx", "cy", "width", "height")
REALSENSE = ("fx", "fy", "ppx", "ppy", "width", "height")
NESTED = ("depth", "depth_intrinsics", "intrinsics", "camera")
"""Where recorders put a camera inside a larger file."""

COEFFS = "coeffs, as [k1, k2, p1, p2, k3, ...]"

AZURE_SENSOR_PX = 1024
AZURE_MODES = {(320, 288): (0.5, 192, 180), (640, 576): (1.0, 192, 180), (512, 512): (0.5, 0, 0), (1024, 1024): (1.0, 0, 0)}
"""Sizes of an Azure Kinect's depth images: the scale, and the first column and row on the sensor's 1024 x 1024 pixels. The
narrow modes are a part of it, the wide ones all of it (Azure Kinect Sensor SDK, MIT)."""


OTHER_SIZES = {"kinect_v1": (640, 480), "azure_kinect": (320, 288)}
"""Of presets whose camera measures the same view with twice or half as many pixels a row, the size of those images."""

AZURE_LENSES = ("CALIBRATION_LensDistortionModelBrownConrady", "CALIBRATION_LensDistortionModelRational6KT")
"""The second, of early devices, differs by a factor of 2 in a term of p1 and p2, which moves no pixel visibly."""


def read_optics(path: Path | str, width: int | None = None, height: int | None = None) -> Optics:
    """The camera and lens of a JSON file of one of the kinds above, or a preset by its name in `kpopnet.camera.CAMERAS`.

    An Azure Kinect's calibration needs `width` and `height` of the recorded image in pixels; a preset is refused for
    others than its own, and those of OTHER_SIZES.
    """
    if (preset := CAMERAS.get(name := str(path))) is not None:
        size = (width or preset.width, height or preset.height)
        if size not in ((preset.width, preset.height), OTHER_SIZES.get(name)):
            raise InputError(
                f"camera {name}: expected the camera's {preset.width}x{preset.height} pixels, got {size[0]}x{size[1]}; "
                "give a file of intrinsics (--camera), or the horizontal field of view in degrees (--fov)"
            )
        return Optics(preset.resized(*size))
    if not as_path(path).is_file():
        raise InputError(f"{path}: no such file, and no preset; there are {', '.join(CAMERAS)}")
    return optics_in(read_json(Path(path)), str(path), width, height)


def optics_in(content: Any, where: str, width: int | None = None, height: int | None = None) -> Optics:
    """The camera and lens in what such a file holds; see `read_optics`."""
    if isinstance(content, dict) and "CalibrationInformation" in content:
        return azure_kinect(content, where, width, height)
    candidates = [content] + [content[name] for name in NESTED if isinstance(content, dict) and name in content]
    for found in candidates:
        for names in (OURS, REALSENSE):
            if isinstance(found, dict) and all(isinstance(found.get(name), int | float) for name in names):
                camera = Camera.from_numbers((float(found[name]) for name in names), where)
                unread = [name for name in found if _names_a_lens(name) and _has_numbers(found[name])]
                expect("coeffs" in found or not unread, f"{where}: {', '.join(unread)}", f"a lens under {COEFFS}")
                return optics(camera, found.get("coeffs", []), str(found.get("model", "")), where)
    raise InputError(
        f"{where}: no camera in it; expected JSON with numbers {', '.join(OURS)}, or RealSense's with ppx and ppy, or an Azure "
        "Kinect's CalibrationInformation"
    )


def _names_a_lens(name: str) -> bool:
    return name.lower() in ("d", "k1") or name.lower().startswith("dist")


def _has_numbers(value: Any) -> bool:
    """Whether a value is a number other than 0, or has one in it."""
    if isinstance(value, list | dict):
        return any(map(_has_numbers, value.values() if isinstance(value, dict) else value))
    return isinstance(value, int | float) and value != 0


def optics(camera: Camera, coefficients: Any, model: str, where: str) -> Optics:
    """A camera with the lens of these coefficients in OpenCV's order; `model` is the name that RealSense or ROS give it."""
    is_fisheye = any(one in model.lower() for one in ("kannala", "equidistant", "fisheye"))
    most = 4 if is_fisheye else 8
    fits = isinstance(coefficients, list) and all(isinstance(one, int | float) for one in coefficients)
    expect(fits, f"{where}: coeffs", "a list of numbers; leave it out where no lens is known")
    expect(not any(coefficients[most:]), where, f"at most {most} lens coefficients that are not 0")
    lens = Lens(tuple(map(float, coefficients[:most])), is_fisheye)
    if not any(lens.coefficients):
        return Optics(camera)
    if any(one in model.lower() for one in ("inverse", "ftheta")):
        log.warning("%s: the lens model %s is not known: joints away from the image's centre may be off", where, model)
        return Optics(camera)
    return Optics(camera, lens)


def azure_kinect(content: Any, where: str, width: int | None, height: int | None) -> Optics:
    """The depth camera of an Azure Kinect's calibration in the mode of this image size."""
    if (width, height) not in AZURE_MODES:
        modes = ", ".join(f"{wide}x{high}" for wide, high in AZURE_MODES)
        raise InputError(
            f"{where}: an Azure Kinect's calibration serves all its modes; give the depth image's size, one of {modes}"
        )
    try:
        cameras = content["CalibrationInformation"]["Cameras"]
        depth = next(one for one in cameras if one["Purpose"] == "CALIBRATION_CameraPurposeDepth")
        numbers = [float(one) for one in depth["Intrinsics"]["ModelParameters"]]
        model = depth["Intrinsics"].get("ModelType", AZURE_LENSES[0])
        cx, cy, fx, fy = (number * AZURE_SENSOR_PX for number in numbers[:4])
        k1, k2, k3, k4, k5, k6, _, _, p2, p1 = numbers[4:14]
    except (KeyError, TypeError, ValueError, AttributeError, StopIteration) as error:
        raise InputError(
            f"{where}: expected a camera of purpose CALIBRATION_CameraPurposeDepth with 14 numbers Intrinsics.ModelParameters"
        ) from error
    expect(model in AZURE_LENSES, f"{where}: ModelType", f"one of {', '.join(AZURE_LENSES)}, found {model!s:.60}")
    scale, left, top = AZURE_MODES[width, height]
    # The numbers are fractions of the sensor's full image, whose pixel edges lie at whole numbers.
    camera = Camera.from_numbers(
        (fx * scale, fy * scale, (cx - left) * scale - 0.5, (cy - top) * scale - 0.5, width, height), where
    )
    return Optics(camera, Lens((k1, k2, p1, p2, k3, k4, k5, k6)))
