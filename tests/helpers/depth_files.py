"""The same few depth images in files of every kind that `kpopnet.sources` reads, with the camera where the kind can tell it."""

import json
import sqlite3
import struct
import time
from contextlib import closing, suppress
from dataclasses import astuple
from pathlib import Path

import h5py
import numpy as np
from PIL import Image

from kpopnet.camera import Camera
from kpopnet.sources.source import CameraAwayError, LiveCamera

CAMERA = Camera(70.0, 71.0, 31.0, 23.5, 64, 48)
FPS = 25.0


def depth_mm(frames: int = 12) -> np.ndarray:
    """(frames, 48, 64) uint16 millimetres; every frame, row and column differs; a hole in each."""
    row, column = np.mgrid[:48, :64]
    images = (1500 + 40 * row + 7 * column + 3 * np.arange(frames)[:, None, None]).astype(np.uint16)
    images[:, 5:9, 6:11] = 0
    return images


def write_pngs(folder: Path, images: np.ndarray, suffix: str = ".png") -> Path:
    """Names without leading zeros: their natural order is not that of their letters."""
    return save_images(folder, f"depth{{}}{suffix}", images)


def save_images(folder: Path, name: str, images: np.ndarray) -> Path:
    """Saves images under a name with their number."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, image in enumerate(images):
        Image.fromarray(image).save(folder / name.format(number))
    return folder


def write_tum(folder: Path, images: np.ndarray) -> Path:
    """The layout of the TUM RGB-D data set, which lists images with their times."""
    save_images(folder / "depth", "{}.png", images)
    lines = [f"{1305031102 + number / FPS:.6f} depth/{number}.png" for number in range(len(images))]
    (folder / "depth.txt").write_text("\n".join(["# depth maps", "# timestamp filename", *lines, ""]))
    return folder


SCANNET_MATRIX = f"{CAMERA.fx} 0 {CAMERA.cx} 0 0 {CAMERA.fy} {CAMERA.cy} 0 0 0 1 0 0 0 0 1"


def write_scannet(folder: Path, images: np.ndarray, units_per_m: int = 1000) -> Path:
    """What ScanNet's reader of .sens writes."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, image in enumerate(images):  # Pillow before 11 writes no PGM of 16 bits
        header = b"P5\n%d %d\n65535\n" % image.shape[::-1]
        (folder / f"frame-{number:06d}.depth.pgm").write_bytes(header + image.astype(">u2").tobytes())
    lines = ("m_versionNumber = 4", f"m_depthShift = {units_per_m}", f"m_calibrationDepthIntrinsic = {SCANNET_MATRIX} ", "")
    (folder / "_info.txt").write_text("\n".join(lines))
    return folder


def write_npz(path: Path, images: np.ndarray, **others: object) -> Path:
    np.savez_compressed(path, depth_mm=images, camera=astuple(CAMERA), **others)
    return path


def write_hdf5(path: Path, images: np.ndarray, chunk: int = 5) -> Path:
    with h5py.File(path, "w") as file:
        file.create_dataset("depth_mm", data=images, chunks=(min(chunk, len(images)), *images.shape[1:]), compression=1)
        file.attrs["camera"] = astuple(CAMERA)
        file.attrs["fps"] = FPS
    return path


def write_video(path: Path, images: np.ndarray, codec: str = "ffv1", pixels: str = "gray16le") -> Path:
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=int(FPS), options={"level": "3", "slicecrc": "1"})
        stream.width, stream.height, stream.pix_fmt = images.shape[2], images.shape[1], pixels
        for image in images:
            frame = av.VideoFrame.from_ndarray(image, format="gray16le")
            container.mux(stream.encode(frame.reformat(format=pixels) if pixels != "gray16le" else frame))
        container.mux(stream.encode())
    return path


class SoftwareCamera:
    """A simulated RealSense camera, made with the maker's library, whose functions take `device` for a camera."""

    def __init__(self, unit_m: float = 0.001, camera: Camera = CAMERA) -> None:
        import pyrealsense2 as rs

        self._library, self._camera, self._unit_m = rs, camera, unit_m
        self.device = rs.software_device()
        self._sensor = self.device.add_sensor("Depth")
        lens = rs.intrinsics()
        lens.fx, lens.fy, lens.ppx, lens.ppy, lens.width, lens.height = astuple(camera)
        stream = rs.video_stream()
        stream.type, stream.fmt, stream.bpp, stream.fps = rs.stream.depth, rs.format.z16, 2, int(FPS)
        stream.index, stream.uid, stream.width, stream.height, stream.intrinsics = 0, 0, camera.width, camera.height, lens
        self._profile = self._sensor.add_video_stream(stream).as_video_stream_profile()
        self._sensor.add_read_only_option(rs.option.depth_units, unit_m)

    def take(self, image: np.ndarray, number: int) -> None:
        """Measures an image: (H, W) uint16 in the camera's unit."""
        frame = self._library.software_video_frame()
        frame.pixels, frame.stride, frame.bpp, frame.depth_units = image, 2 * self._camera.width, 2, self._unit_m
        frame.timestamp, frame.domain = 1000 * number / FPS, self._library.timestamp_domain.hardware_clock
        frame.frame_number, frame.profile = number, self._profile
        self._sensor.on_video_frame(frame)


RECORDED_IMAGES = "SELECT count(*) FROM messages JOIN topics ON topics.id = topic_id WHERE name LIKE '%/image/data/%'"


def write_bag(path: Path, images: np.ndarray, unit_m: float = 0.001) -> Path:
    """Records a simulated RealSense camera with the maker's library; again where its recorder dropped images, as it may."""
    for _ in range(20):
        path.unlink(missing_ok=True)
        _record_bag(path, images, unit_m)
        with closing(sqlite3.connect(path)) as bag:
            ((recorded,),) = bag.execute(RECORDED_IMAGES)
        if recorded == len(images):
            return path
    raise AssertionError(f"{path}: {recorded} of {len(images)} images were recorded")


def _record_bag(path: Path, images: np.ndarray, unit_m: float) -> None:
    import pyrealsense2 as rs

    source = SoftwareCamera(unit_m)
    recorder = rs.recorder(str(path), source.device)
    recorded, queue = recorder.query_sensors()[0], rs.frame_queue(len(images))
    recorded.open(recorded.get_stream_profiles()[0])
    recorded.start(queue)
    for number, image in enumerate(images):
        source.take(image, number)
        time.sleep(0.02)  # the recorder takes frames from a thread of its own
    recorded.stop()
    recorded.close()


def sent_line(**others: object) -> bytes:
    """The first line of what a sender of `kpopnet.sources.stream` sends."""
    return json.dumps(vars(CAMERA) | {"dtype": "uint16", "unit_m": 0.001} | others).encode() + b"\n"


def next_image(camera: LiveCamera) -> tuple[np.ndarray, float]:
    """The next image of a camera that may still be away."""
    for _ in range(30):
        with suppress(CameraAwayError):
            return camera.read()
    raise AssertionError("no image came")


def sent_image(image: np.ndarray, time_s: float = float("nan")) -> bytes:
    return struct.pack("<dQ", time_s, image.nbytes) + image.tobytes()


def write_sent(path: Path, images: np.ndarray, **others: object) -> Path:
    path.write_bytes(sent_line(**others) + b"".join(sent_image(image, k / FPS) for k, image in enumerate(images)))
    return path
