"""Depth from videos of 16-bit grey images, as lossless FFV1 in Matroska; needs PyAV, the extra `video`."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, cast

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import expect, parsing
from kpopnet.sources.source import Recording, StoredImage

if TYPE_CHECKING:
    from av import Packet, VideoFrame
    from av.container import InputContainer
    from av.video.stream import VideoStream

CONTAINERS = {".mkv": "matroska", ".avi": "avi"}
"""The demuxer of each ending. FFmpeg is not left to guess: its playlists would open other files and the network."""

DEPTH_FORMATS = ("gray16le", "gray16be")


def read_video(path: Path) -> Recording:
    """A video with one stream of 16-bit grey images, millimetres."""
    with _opened(path) as (_, stream):
        width, height = stream.codec_context.width, stream.codec_context.height
        fps = float(stream.average_rate) if stream.average_rate else None
        return Recording(lambda: _images(path), width, height, stream.frames if stream.frames > 0 else None, fps)


def _images(path: Path) -> Iterator[StoredImage]:
    number = 0
    with _opened(path) as (container, stream):
        packets = container.demux(stream)
        while True:
            with parsing(f"{path}: frame {number}", "damaged"):
                packet = next(packets, None)
                if packet is None:
                    break
                frames = _decoded(packet)
            for frame in frames:
                expect(frame.format.name in DEPTH_FORMATS, f"{path}: frame {number}", f"16-bit grey, found {frame.format.name}")
                yield StoredImage(frame.to_ndarray(format="gray16le"), f"{path}: frame {number}", frame.time)
                number += 1
    if not number:
        raise InputError(f"{path}: no image in it")


def _decoded(packet: "Packet") -> list["VideoFrame"]:
    """The images of a packet. FFmpeg makes up the pixels of damaged parts, and says so in its log only: a ValueError here."""
    import av

    level = av.logging.get_level()
    av.logging.set_level(av.logging.ERROR)
    try:
        with av.logging.Capture() as complaints:
            frames = packet.decode()
    finally:
        av.logging.set_level(level)
    if complaints:
        raise ValueError(complaints[0][2].strip())
    return cast("list[VideoFrame]", frames)


@contextmanager
def _opened(path: Path) -> Iterator[tuple["InputContainer", "VideoStream"]]:
    """A video and its first stream of 16-bit grey images."""
    try:
        import av
    except ImportError as error:
        raise InputError(
            f"{path}: videos are read by PyAV, which is missing; install it: pip install 'kpopnet[video]'"
        ) from error
    with parsing(str(path), "not a readable video"):
        container = av.open(str(path), format=CONTAINERS[path.suffix.lower()], options={"protocol_whitelist": "file"})
    with container:
        formats = [getattr(stream, "pix_fmt", None) or "of an unknown kind" for stream in container.streams.video]
        found = next((number for number, name in enumerate(formats) if name in DEPTH_FORMATS), None)
        if found is None:
            raise InputError(
                f"{path}: its images are {', '.join(formats) or 'none'}; expected 16-bit grey (gray16le) in millimetres: "
                "colour and 8-bit video do not hold depth"
            )
        stream = container.streams.video[found]
        stream.codec_context.thread_count = 1  # a thread's complaints would not be heard
        yield container, stream
