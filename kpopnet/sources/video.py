"""Depth from videos of 16-bit grey images, as lossless FFV1 in Matroska; needs PyAV, the extra `video`."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from kpopnet.errors import InputError
from kpopnet.sources.arrays import rate_of
from kpopnet.sources.source import Recording, StoredImage, check_size

if TYPE_CHECKING:
    from av import Packet, VideoFrame
    from av.container import InputContainer

CONTAINERS = {".mkv": "matroska", ".avi": "avi"}
"""The demuxer of each ending. FFmpeg is not left to guess: its playlists would open other files and the network."""

DEPTH_FORMATS = ("gray16le", "gray16be")


def read_video(path: Path, key: str | None) -> Recording:
    """A video with one stream of 16-bit grey images, millimetres.

    Raises:
        InputError: PyAV is missing, the file is no such video, or a key is given.
    """
    if key is not None:
        raise InputError(f"{path}: a video has no arrays by name, such as {key}")
    with _opened(path) as container:
        stream = container.streams.video[_depth_stream(path, container)]
        width, height = stream.codec_context.width, stream.codec_context.height
        check_size(str(path), width, height)
        frames = stream.frames if stream.frames > 0 else None
        fps = rate_of(str(path), None, float(stream.average_rate) if stream.average_rate else None)
    return Recording(lambda: _images(path), width, height, frames, fps)


def _images(path: Path) -> Iterator[StoredImage]:
    import av

    number = 0
    with _opened(path) as container:
        stream = container.streams.video[_depth_stream(path, container)]
        try:
            for frame in (frame for packet in container.demux(stream) for frame in _decoded(packet)):
                if frame.format.name not in DEPTH_FORMATS:
                    raise InputError(f"{path}: frame {number} is {frame.format.name}, expected 16-bit grey")
                yield StoredImage(frame.to_ndarray(format="gray16le"), f"{path}: frame {number}", frame.time)
                number += 1
        except (av.FFmpegError, OSError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: frame {number}: damaged ({error})") from error
    if not number:
        raise InputError(f"{path}: no image in it")


def _decoded(packet: "Packet") -> list["VideoFrame"]:
    """The images of a packet. FFmpeg makes up the pixels of damaged parts, and says so in its log only.

    Raises:
        ValueError: a part is damaged.
    """
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


def _opened(path: Path) -> "InputContainer":
    try:
        import av
    except ImportError as error:
        raise InputError(
            f"{path}: videos are read by PyAV, which is missing; install it: pip install 'kpopnet[video]'"
        ) from error
    options: dict[str, Any] = {"protocol_whitelist": "file"}
    try:
        return av.open(str(path), format=CONTAINERS[path.suffix.lower()], options=options)
    except (av.FFmpegError, OSError, ValueError) as error:
        raise InputError(f"{path}: not a readable video ({error})") from error


def _depth_stream(path: Path, container: "InputContainer") -> int:
    """The number of the first stream of 16-bit grey images."""
    formats = [getattr(stream, "pix_fmt", None) or "of an unknown kind" for stream in container.streams.video]
    found = next((number for number, name in enumerate(formats) if name in DEPTH_FORMATS), None)
    if found is None:
        raise InputError(
            f"{path}: its images are {', '.join(formats) or 'none'}; expected 16-bit grey (gray16le) in millimetres: colour "
            "and 8-bit video do not hold depth"
        )
    container.streams.video[found].codec_context.thread_count = 1  # a thread's complaints would not be heard
    return found
