"""Depth from bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap, or the folder of a bag), by rosbags; the extra `ros`.

Depth is an Image of 16UC1 (millimetres) or 32FC1 (metres; REP 118, https://ros.org/reps/rep-0118.html), or a CompressedImage of
compressedDepth: 12 bytes, then a PNG. The camera is the CameraInfo beside it; times are those of the headers. Definitions of
messages that a bag carries are not used: rosbags would make Python code of them.

RealSense's own tools record bags too, of other topics and with a unit of their own; the maker's library reads them where it is
installed (https://github.com/IntelRealSense/librealsense/blob/master/src/media/ros/ros_file_format.h).
"""

import importlib.util
import io
import struct
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import expect, names_in, parsing
from kpopnet.runtime.provenance import optional_library
from kpopnet.sources import realsense
from kpopnet.sources.camera_files import optics
from kpopnet.sources.images import natural, read_image
from kpopnet.sources.lenses import Optics
from kpopnet.sources.source import Recording, StoredImage, check_size, rate

SUFFIXES = (".bag", ".db3", ".mcap")
METADATA = "metadata.yaml"
"""Name of the file that makes a folder a bag of ROS 2; only its name is used."""

IMAGE, COMPRESSED, CAMERA_INFO = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo"))
DEPTH_TYPES = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
COMPRESSED_NAME, COMPRESSED_HEADER = "compressedDepth", struct.Struct("<iff")
"""The header: an enumeration of one value, and a and b of inverse depth, for 32FC1 alone: depth = a / (stored - b)."""

REALSENSE_PREFIX, REALSENSE_UNITS = "/device_", ("option/Depth_Units/value", "option/Depth Units/value")
"""The second of older versions. Newer ones append the unit to every Image of a .bag too, which ROS does not know."""

UNIT_BYTES = 4
ZSTD = b"\x28\xb5\x2f\xfd"
TIMED = 31
"""Number of first images whose times give the rate."""


class Bag(NamedTuple):
    """An open bag: rosbags' readers of its files, and the decoder of its messages by their type."""

    where: str
    readers: list[Any]
    decode: Any

    def topics(self) -> dict[str, str]:
        """The type of each topic's messages."""
        return {one.topic: one.msgtype for reader in self.readers for one in reader.connections}

    def count(self, topic: str) -> int:
        return sum(one.msgcount for reader in self.readers for one in reader.connections if one.topic == topic)

    def messages(self, topic: str) -> Iterator[Any]:
        """The decoded messages of a topic in the order of recording."""
        from rosbags.serde import SerdeError

        for reader in self.readers:
            if chosen := [one for one in reader.connections if one.topic == topic]:
                for connection, _, packed in reader.messages(connections=chosen):
                    expect(packed[:4] != ZSTD, self.where, "messages that are not compressed one by one; run ros2 bag convert")
                    try:
                        message = self.decode(packed, connection.msgtype)
                    except SerdeError:
                        if not _is_realsense(topic):
                            raise
                        message = self.decode(packed[:-UNIT_BYTES], connection.msgtype)
                    yield message


def read_bag(path: Path, key: str | None) -> Recording:
    """A bag; `key` names the topic of depth where there are several. RealSense's own are left to the maker's library."""
    with_library = path.suffix.lower() != ".mcap" and importlib.util.find_spec("pyrealsense2") is not None
    if with_library and importlib.util.find_spec("rosbags") is None:
        return realsense.read_bag(path)
    with _opened(path) as bag:
        if with_library and key is None and any(map(_is_realsense, bag.topics())):
            return realsense.read_bag(path)
        topic = _depth_topic(bag, key)
        height, width = next(_images(bag, topic)).depth.shape
        fps = rate([image.time_s or 0.0 for image in islice(_images(bag, topic), TIMED)])
        frames = bag.count(topic)
        found, units_per_m = _optics(bag, topic), _units_per_m(bag, topic)

    def images() -> Iterator[StoredImage]:
        with _opened(path) as bag:
            yield from _images(bag, topic)

    return Recording(images, width, height, frames, fps, *found, units_per_m)


@contextmanager
def _opened(path: Path) -> Iterator[Bag]:
    also = "" if path.suffix == ".mcap" else "; the extra realsense reads what a RealSense camera's own tools recorded"
    with optional_library(str(path), "rosbags", "ros", also):
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_typestore
    files = [path] if path.is_file() else sorted((one for one in path.iterdir() if one.suffix in SUFFIXES[1:]), key=natural)
    expect(bool(files), str(path), "a file .db3 or .mcap beside metadata.yaml; unpack .zstd files first: zstd -d FILE")
    for file in files:  # SQLite would take these for parts of an address
        expect(file.suffix != ".db3" or not set("?#%") & set(str(file)), str(file), "a path without ?, # and %; rename it")
    with ExitStack() as stack, parsing(str(path), "not a readable bag of ROS, or damaged"):
        if path.suffix.lower() == ".bag":
            store = get_typestore(Stores.ROS1_NOETIC)
            yield Bag(str(path), [stack.enter_context(rosbag1.Reader(path))], store.deserialize_ros1)
        else:
            store = get_typestore(Stores.ROS2_HUMBLE)
            yield Bag(str(path), [stack.enter_context(rosbag2.Reader(file)) for file in files], store.deserialize_cdr)


def _depth_topic(bag: Bag, key: str | None) -> str:
    """The topic of depth: `key`, or the only one of depth images whose name has "depth"; of an image and its compressedDepth,
    the image.
    """
    held = {name for name, kind in bag.topics().items() if kind in (IMAGE, COMPRESSED) and _is_depth(bag, name)}
    listed = names_in(sorted(held)) or f"none among {names_in(sorted(bag.topics())) or 'no topics'}"
    if key is not None:
        expect(key in held, f"{bag.where}: {key}", f"a topic of depth (--key); it holds {listed}")
        return key
    meant = [name for name in held if "depth" in name.lower() and name.removesuffix(f"/{COMPRESSED_NAME}") not in held - {name}]
    if len(meant) != 1:
        raise InputError(
            f"{bag.where}: {len(meant) or 'no'} topics are called depth and hold images of 16UC1, 32FC1 or compressedDepth; "
            f"say which is meant (--key): it holds {listed}"
        )
    return meant[0]


def _is_depth(bag: Bag, topic: str) -> bool:
    """Whether the first image of a topic is depth; 16-bit grey, which infrared is too, by the topic's name."""
    message = next(bag.messages(topic), None)
    kind = getattr(message, "encoding", None) or getattr(message, "format", "")
    return kind in ("16UC1", "32FC1") or COMPRESSED_NAME in kind or (kind == "mono16" and "depth" in topic.lower())


def _images(bag: Bag, topic: str) -> Iterator[StoredImage]:
    """The images as they are stored; times begin with 0."""
    first_ns = None
    for number, message in enumerate(bag.messages(topic)):
        where, stamp = f"{bag.where}: {topic}, frame {number}", message.header.stamp
        time_ns = stamp.sec * 10**9 + stamp.nanosec
        first_ns = time_ns if first_ns is None else first_ns
        depth = _unpacked(message, where) if hasattr(message, "format") else _raw(message, where)
        yield StoredImage(depth, where, (time_ns - first_ns) / 1e9)


def _raw(message: Any, where: str) -> np.ndarray:
    check_size(where, message.width, message.height)
    expect(message.encoding in DEPTH_TYPES, where, f"one of {', '.join(DEPTH_TYPES)}, found {message.encoding:.40}")
    dtype = np.dtype(DEPTH_TYPES[message.encoding]).newbyteorder(">" if message.is_bigendian else "<")
    row, size = message.width * dtype.itemsize, message.height * message.step
    expect(message.step >= row and len(message.data) >= size, where, f"{size:,} bytes in rows of {row:,} or more")
    rows = np.asarray(message.data[:size]).reshape(message.height, message.step)
    return np.ascontiguousarray(rows[:, :row]).view(dtype)


def _unpacked(message: Any, where: str) -> np.ndarray:
    kind, _, packing = message.format.partition(";")
    packing = packing.split()
    expect(packing[:1] == [COMPRESSED_NAME] and packing[1:] in ([], ["png"]), where,
           f"{COMPRESSED_NAME} of PNG, found {message.format:.60}; republish it as raw images")  # fmt: skip
    packed = bytes(message.data)
    expect(len(packed) > COMPRESSED_HEADER.size, where, "a header and a PNG image")
    _, a, b = COMPRESSED_HEADER.unpack_from(packed)
    stored = read_image(io.BytesIO(packed[COMPRESSED_HEADER.size :]), where)
    if kind.strip() != "32FC1":
        return stored
    with np.errstate(all="ignore"):
        return np.where(stored == 0, np.float32(0), np.float32(a) / (stored.astype(np.float32) - np.float32(b)))


def _optics(bag: Bag, topic: str) -> Optics | tuple[None, None]:
    """Camera and lens of the CameraInfo beside a topic, None where there is none or it was not calibrated."""
    image = topic.removesuffix(f"/{COMPRESSED_NAME}")
    parent, _, name = image.rpartition("/")
    beside = (
        image.removesuffix("/image/data") + "/info/camera_info"
        if _is_realsense(topic) and image == topic
        else f"{parent}/camera_info"
    )
    info = next(bag.messages(beside), None) if bag.topics().get(beside) == CAMERA_INFO else None
    if info is None:
        return None, None
    k, d, p = (np.asarray(getattr(info, one, getattr(info, one.lower(), ()))) for one in "KDP")
    if "rect" in name and p.any():  # the driver has undone the lens; P is the camera of its images
        k, d = p.reshape(3, 4)[:, :3].ravel(), d[:0]
    if not k.any():
        return None, None
    where = f"{bag.where}: {beside}"
    camera = Camera.from_numbers((*k[[0, 4, 2, 5]].tolist(), info.width, info.height), where)
    return optics(camera, d.tolist(), info.distortion_model, where)


def _is_realsense(topic: str) -> bool:
    return topic.startswith(REALSENSE_PREFIX)


def _units_per_m(bag: Bag, topic: str) -> float | None:
    """The unit of a bag that RealSense's own tools recorded."""
    if not _is_realsense(topic):
        return None
    sensor, topics = "/".join(topic.split("/")[:3]), bag.topics()
    named = [f"{sensor}/{one}" for one in REALSENSE_UNITS if f"{sensor}/{one}" in topics]
    unit = next(bag.messages(named[0]), None) if named else None
    unit_m = float(getattr(unit, "data", 0))
    expect(0 < unit_m < 1, bag.where, "the unit of depth, as RealSense's tools store it; the extra realsense reads it")
    return 1 / unit_m
