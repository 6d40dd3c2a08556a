"""Sends the depth of an Azure Kinect to kpopnet.

Written from the documentation of pyk4a 1.5 and never run with a camera: say so if yours does not work. Microsoft's Azure Kinect
SDK, whose depth engine is not free software, has to be installed as Microsoft says; then

    pip install pyk4a
    python examples/feed_azure_kinect.py | kpopnet teach --live -
"""

import json
import os
import struct


def main() -> None:
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the library prints goes to standard error, not into the depth
    from pyk4a import CalibrationType, ColorResolution, Config, DepthMode, PyK4A  # pyright: ignore[reportMissingImports]

    mode = {"color_resolution": ColorResolution.OFF, "depth_mode": DepthMode.NFOV_UNBINNED}
    kinect = PyK4A(Config(**mode, synchronized_images_only=False))
    kinect.start()
    (fx, _, cx), (_, fy, cy), _ = kinect.calibration.get_camera_matrix(CalibrationType.DEPTH).tolist()
    header = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "width": 640, "height": 576, "dtype": "uint16", "unit_m": 0.001}
    header["coeffs"] = kinect.calibration.get_distortion_coefficients(CalibrationType.DEPTH).tolist()
    output.write(json.dumps(header).encode() + b"\n")
    while True:
        capture = kinect.get_capture()
        if capture.depth is not None:
            depth = capture.depth.astype("<u2").tobytes()
            output.write(struct.pack("<dQ", capture.depth_system_timestamp_nsec / 1e9, len(depth)) + depth)
            output.flush()


if __name__ == "__main__":
    main()
