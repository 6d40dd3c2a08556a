"""Sends depth to kpopnet from a program of your own: replace `images` by your camera. It needs numpy alone, and no kpopnet.

    python examples/feed_pipe.py recording.npz | kpopnet teach --live -
    python examples/feed_pipe.py recording.npz --port 5005      then: kpopnet teach --live tcp:127.0.0.1:5005
    python examples/feed_pipe.py recording.npz > recording.depth      then: kpopnet predict recording.depth

recording.npz stands for the camera here: `depth_mm` (T, H, W) uint16 millimetres, 0 where nothing was measured, `camera` (fx,
fy, cx, cy, width, height) and `fps`. What is sent: docs/predicting.md.
"""

import argparse
import contextlib
import json
import socket
import struct
import time
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np


def images(recording) -> Iterator[np.ndarray]:
    """The depth of a camera, image by image, as it is measured."""
    for depth_mm in recording["depth_mm"]:
        yield depth_mm
        time.sleep(1 / float(recording["fps"]))


def send(recording, file: BinaryIO) -> None:
    """Sends the first line, and then every image with the time at which it was taken."""
    camera = dict(zip(("fx", "fy", "cx", "cy", "width", "height"), recording["camera"].tolist(), strict=True))
    file.write(json.dumps({**camera, "dtype": "uint16", "unit_m": 0.001}).encode() + b"\n")
    for depth_mm in images(recording):
        file.write(struct.pack("<dQ", time.monotonic(), depth_mm.nbytes) + depth_mm.astype("<u2").tobytes())
        file.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", help="what stands for the camera")
    parser.add_argument("--port", type=int, help="of this machine, where kpopnet connects; by default standard output")
    given = parser.parse_args()
    recording = dict(np.load(given.recording))
    if missing := {"depth_mm", "camera", "fps"} - set(recording):
        raise SystemExit(f"error: {given.recording}: lacks {', '.join(sorted(missing))}")
    if given.port is None:
        with contextlib.suppress(BrokenPipeError), open(1, "wb", closefd=False) as file:  # until kpopnet ends
            send(recording, file)
        return
    with socket.create_server(("127.0.0.1", given.port)) as server:
        while True:  # kpopnet connects when it needs images, and again after each interruption
            connection, _ = server.accept()
            with contextlib.suppress(ConnectionError), connection, connection.makefile("wb") as file:
                send(recording, file)


if __name__ == "__main__":
    main()
