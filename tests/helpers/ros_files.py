"""Bags of ROS, written by rosbags' own writers: images of depth, compressed or not, infrared, and the camera beside them."""

import io
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from depth_files import CAMERA, FPS
from PIL import Image

TOPIC = "/camera/depth/image_raw"
REALSENSE_TOPIC = "/device_0/sensor_0/Depth_0/image/data"
START_S = 1_700_000_000

QUANT_A, QUANT_B = 10_100.0, -1009.0
"""Numbers of inverse depth that compressed_depth_image_transport writes for depth up to 10 m."""


def png(image: np.ndarray) -> bytes:
    packed = io.BytesIO()
    Image.fromarray(image).save(packed, "PNG")
    return packed.getvalue()


class Messages:
    """Makes messages of ROS 1 or 2 and packs them."""

    def __init__(self, is_ros1: bool) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
        names = {name.rpartition("/")[2]: kind for name, kind in self.store.types.items() if name != "std_msgs/msg/Time"}
        self.types, self.is_ros1 = SimpleNamespace(**names), is_ros1

    def pack(self, message: Any) -> bytes:
        return bytes((self.store.serialize_ros1 if self.is_ros1 else self.store.serialize_cdr)(message, message.__msgtype__))

    def header(self, number: int) -> Any:
        stamp = self.types.Time(sec=START_S, nanosec=round(number * 1e9 / FPS))
        return self.types.Header(stamp=stamp, frame_id="depth", **({"seq": number} if self.is_ros1 else {}))

    def image(self, kind: str, depth_mm: np.ndarray, number: int) -> Any:
        header = self.header(number)
        if "compressed" in kind:
            inverse = np.where(depth_mm, QUANT_A / np.maximum(depth_mm / 1000, 1e-3) + QUANT_B, 0).round().astype(np.uint16)
            data = struct.pack("<iff", 0, QUANT_A, QUANT_B) + png(inverse if kind.startswith("32FC1") else depth_mm)
            return self.types.CompressedImage(header=header, format=kind, data=np.frombuffer(data, np.uint8))
        stored = {"32FC1": depth_mm.astype(np.float32) / 1000, "8UC1": depth_mm.astype(np.uint8)}.get(kind, depth_mm)
        rows = np.pad(stored.view(np.uint8), ((0, 0), (0, 8)))  # rows may be longer than their pixels
        size = {"height": depth_mm.shape[0], "width": depth_mm.shape[1], "step": rows.shape[1]}
        return self.types.Image(header=header, encoding=kind, is_bigendian=0, data=rows.ravel(), **size)

    def camera_info(self, model: str, coefficients: Sequence[float], projection: Sequence[float]) -> Any:
        k = [CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1]
        named = {"D": coefficients, "K": k, "R": np.eye(3).ravel(), "P": projection}
        arrays = {name if self.is_ros1 else name.lower(): np.array(value, float) for name, value in named.items()}
        region = self.types.RegionOfInterest(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        size = {"height": CAMERA.height, "width": CAMERA.width, "binning_x": 0, "binning_y": 0, "roi": region}
        return self.types.CameraInfo(header=self.header(0), distortion_model=model, **size, **arrays)


def write_ros(
    path: Path,
    images: np.ndarray,
    topics: Mapping[str, str] = {TOPIC: "16UC1"},
    camera: tuple[str, Sequence[float]] | None = ("plumb_bob", (0.0,) * 5),
    projection: Sequence[float] = (0.0,) * 12,
    unit_m: float | None = None,
) -> Path:
    """Writes (T, H, W) uint16 millimetres into a bag of the kind of the path's ending; without one, a folder of ROS 2.

    `topics`, which all get these images, are names and encodings, of compressed images the whole format; `camera` is the lens's
    model and coefficients, None for no CameraInfo, `projection` the matrix P, for images without distortion. With `unit_m`, of
    the numbers in `images`, it is RealSense's kind of bag.
    """
    from rosbags import rosbag1, rosbag2

    make = Messages(path.suffix == ".bag")
    folder = path.with_suffix("") if path.suffix in (".db3", ".mcap") else path
    plugin = rosbag2.StoragePlugin.MCAP if path.suffix == ".mcap" else rosbag2.StoragePlugin.SQLITE3
    with rosbag1.Writer(path) if make.is_ros1 else rosbag2.Writer(folder, version=9, storage_plugin=plugin) as bag:
        connections: dict[str, Any] = {}

        def write(topic: str, message: Any, time_ns: int = START_S * 10**9, more: bytes = b"") -> None:
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, message.__msgtype__, typestore=make.store)
            bag.write(connections[topic], time_ns, make.pack(message) + more)

        if unit_m is not None:
            write("/device_0/sensor_0/option/Depth_Units/value", make.types.Float32(data=unit_m))
        for topic, kind in topics.items():
            base = topic.removesuffix("/compressedDepth")
            beside = base.replace("/image/data", "/info") if unit_m else base.rpartition("/")[0]
            if camera is not None:
                write(f"{beside}/camera_info", make.camera_info(*camera, projection))
            for number, image in enumerate(images):
                more = b"" if unit_m is None else struct.pack("<f", unit_m)
                write(topic, make.image(kind, image, number), START_S * 10**9 + round(number * 1e9 / FPS), more)
    if folder != path:
        (folder / f"{folder.name}{path.suffix}").rename(path)
        (folder / "metadata.yaml").unlink()
        folder.rmdir()
    return path
