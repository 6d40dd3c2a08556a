"""Recordings as Azure Kinect's and Femto's recorders write them, byte for byte where a reader looks, made with PyAV.

Tracks COLOR, IR and DEPTH with their tags, 16-bit grey, big-endian, as b16g in Matroska's mode for Video for Windows, times in
the middle of a second, and the calibration as an attachment: the file format's page, and what ffprobe says of real recordings.
"""

import json
import re
import struct
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

MODES = {(320, 288): "NFOV_2X2BINNED", (640, 576): "NFOV_UNBINNED", (512, 512): "WFOV_2X2BINNED", (1024, 1024): "WFOV_UNBINNED"}

LENS = [
    *(0.5122697949409485, 0.49451231956481934, 0.4921168386936188, 0.4921667277812958),
    *(3.1305770874023438, 2.324939012527466, 0.1304156482219696, 3.458651542663574, 3.350114583969116, 0.6629416346549988),
    *(0.0, 0.0, -0.0000511557373101823, 0.00008132171933539212),
]
"""A device's own calibration, as people publish it: cx, cy, fx, fy, k1 to k6, codx, cody, p2, p1."""

FPS, START_US = 30, 33_333


def calibration(lens: Sequence[float] = LENS) -> dict:
    def camera(purpose: str, parameters: Sequence[float]) -> dict:
        model = {"ModelParameterCount": 14, "ModelType": "CALIBRATION_LensDistortionModelBrownConrady"}
        return {
            "Intrinsics": model | {"ModelParameters": list(parameters)}, "Location": "CALIBRATION_CameraLocationD0",
            "Purpose": f"CALIBRATION_CameraPurpose{purpose}", "MetricRadius": 1.7399, "SensorWidth": 1024, "SensorHeight": 1024,
        }  # fmt: skip

    return {"CalibrationInformation": {"Cameras": [camera("PhotoVideo", [9.0] * 14), camera("Depth", lens)]}}


def write_azure_kinect(
    path: Path,
    images: np.ndarray,
    tracks: Sequence[str] = ("COLOR", "IR", "DEPTH"),
    attached: bytes | None = json.dumps(calibration()).encode(),
    names: str = "title and tag",
) -> Path:
    """Writes (T, H, W) uint16 millimetres; the infrared track holds other numbers. `names` says how tracks are marked."""
    import av

    height, width = images.shape[1:]
    modes = {"COLOR": "MJPG_720P", "IR": "ACTIVE", "DEPTH": MODES.get((width, height), "NFOV_UNBINNED")}
    with av.open(str(path), "w", format="matroska", options={"allow_raw_vfw": "1"}) as file:
        file.metadata.update({"title": "Azure Kinect", "K4A_DEVICE_SERIAL_NUMBER": "001119204312", "K4A_DEPTH_DELAY_NS": "0"})
        streams = []
        for track in tracks:
            stream = file.add_stream("mjpeg" if track == "COLOR" else "rawvideo", rate=FPS)
            stream.width, stream.height = (64, 48) if track == "COLOR" else (width, height)
            stream.pix_fmt = "yuvj420p" if track == "COLOR" else "gray16be"
            if "title" in names:
                stream.metadata["title"] = track
            if "tag" in names:
                stream.metadata[f"K4A_{track}_MODE"] = modes[track]
                stream.metadata[f"K4A_{track}_TRACK"] = str(714354825252198240 + len(streams))
            streams.append((track, stream))
        if attached is not None:
            file.metadata["K4A_CALIBRATION_FILE"] = "calibration.json"
            file.add_attachment("calibration.json", "application/octet-stream", attached)
        for number, image in enumerate(images):
            for track, stream in streams:
                shown = {"DEPTH": image, "IR": 7 + image // 3, "COLOR": np.zeros((48, 64), np.uint16)}[track]
                frame = av.VideoFrame.from_ndarray(shown, format="gray16le").reformat(format=stream.pix_fmt)
                frame.pts, frame.time_base = START_US + number * 1_000_000 // FPS, Fraction(1, 1_000_000)
                file.mux(stream.encode(frame))
        for _, stream in streams:
            file.mux(stream.encode())
    # FFmpeg does not write the four letters of b16g into the header of a bitmap, as the recorders do.
    header = re.escape(struct.pack("<IiiHHI", 40, width, -height, 1, 16, 0))
    written = struct.pack("<IiiHH", 40, width, height, 1, 16) + b"b16g"
    path.write_bytes(re.sub(header, lambda _: written, path.read_bytes()))
    return path
