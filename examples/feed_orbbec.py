"""Sends the depth of an Orbbec camera (Femto, Gemini, Astra 2) to kpopnet.

Written from the maker's documentation and never run with a camera: say so if yours does not work. Orbbec's library cannot share
an environment with kpopnet's extra video; it needs one of its own:

    python -m venv orbbec && orbbec/bin/pip install pyorbbecsdk2
    orbbec/bin/python examples/feed_orbbec.py | kpopnet teach --live -
"""

import json
import os
import struct

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def main() -> None:
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the library prints goes to standard error, not into the depth
    from pyorbbecsdk import Config, OBSensorType, Pipeline  # pyright: ignore[reportMissingImports]

    pipeline, config = Pipeline(), Config()
    profile = pipeline.get_stream_profile_list(OBSensorType.DEPTH_SENSOR).get_default_video_stream_profile()
    config.enable_stream(profile)
    pipeline.start(config)
    camera, lens, line = profile.get_intrinsic(), profile.get_distortion(), b""
    model = str(lens.model).rpartition(".")[2].lower()
    names = ("k1", "k2", "k3", "k4") if "kannala" in model else COEFFICIENTS
    while True:
        frames = pipeline.wait_for_frames(1000)
        frame = frames.get_depth_frame() if frames else None
        if frame is None:
            continue
        if not line:
            header = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy", "width", "height")}
            header |= {"coeffs": [getattr(lens, name) for name in names], "model": model}
            header |= {"dtype": "uint16", "unit_m": frame.get_depth_scale() / 1000}
            line = json.dumps(header).encode() + b"\n"
            output.write(line)
        depth = bytes(frame.get_data())
        output.write(struct.pack("<dQ", float("nan"), len(depth)) + depth)
        output.flush()


if __name__ == "__main__":
    main()
