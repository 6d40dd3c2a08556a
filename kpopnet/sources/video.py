"""Depth from videos of 16-bit grey images; needs PyAV, the extra `video`.

They are lossless, as FFV1 in Matroska, or what an Azure Kinect or its successor Femto records: a Matroska file with a track for
depth, one for infrared, which looks the same, and the camera's calibration as an attachment
(https://learn.microsoft.com/previous-versions/azure/kinect-dk/record-file-format).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, cast

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import expect, parse_json, parsing
from kpopnet.runtime.provenance import optional_library
from kpopnet.sources.camera_files import azure_kinect
from kpopnet.sources.lenses import Optics
from kpopnet.sources.source import Recording, StoredImage

if TYPE_CHECKING:
    from av import VideoFrame
    from av.container import InputContainer
    from av.video.stream import VideoStream

CONTAINERS = {".mkv": "matroska", ".avi": "avi"}
"""The demuxer of each ending. FFmpeg is not left to guess: its playlists would open other files and the network."""

DEPTH_FORMATS = ("gray16le", "gray16be")
DEPTH_TITLES, INFRARED_TITLES = ("DEPTH",), ("IR", "DEPTH_IR")
DEPTH_TAG, INFRARED_TAG = "K4A_DEPTH_MODE", "K4A_IR_MODE"
"""How an Azure Kinect marks its tracks."""

CALIBRATION = "calibration.json"
"""Name of the attachment, if the tag K4A_CALIBRATION_FILE names no other."""


def read_video(path: Path) -> Recording:
    """A video whose images are millimetres."""
    with _opened(path) as (container, stream):
        width, height = stream.codec_context.width, stream.codec_context.height
        fps = float(stream.average_rate) if stream.average_rate else None
        optics = _calibrated(path, container, width, height)
        frames = stream.frames if stream.frames > 0 else None
        return Recording(lambda: _images(path), width, height, frames, fps, *optics)


def _calibrated(path: Path, container: "InputContainer", width: int, height: int) -> Optics | tuple[None, None]:
    """The camera and lens of the attachment, None where there is none."""
    name = container.metadata.get("K4A_CALIBRATION_FILE", CALIBRATION)
    for attachment in container.streams.attachments:
        if attachment.name == name:
            content = bytes(attachment.data or b"").rstrip(b"\0")
            return azure_kinect(parse_json(content, f"{path}: {name}"), f"{path}: {name}", width, height)
    return None, None


def _images(path: Path) -> Iterator[StoredImage]:
    number = 0
    with _opened(path) as (container, stream):
        packets = container.demux(stream)
        while True:
            with parsing(f"{path}: frame {number}", "damaged"), _heard():
                if (packet := next(packets, None)) is None:
                    break
                frames = cast("list[VideoFrame]", packet.decode())
            for frame in frames:
                expect(frame.format.name in DEPTH_FORMATS, f"{path}: frame {number}", f"16-bit grey, found {frame.format.name}")
                yield StoredImage(frame.to_ndarray(format="gray16le"), f"{path}: frame {number}", frame.time)
                number += 1


@contextmanager
def _heard(sign: str = "") -> Iterator[None]:
    """Makes a ValueError of an error with this sign in FFmpeg's log: nothing else tells of cut files and made up pixels."""
    import av

    level = av.logging.get_level()
    av.logging.set_level(av.logging.ERROR)
    try:
        with av.logging.Capture() as complaints:
            yield
    finally:
        av.logging.set_level(level)
    told = [text.strip() for _, _, text in complaints if sign in text]
    if told:
        raise ValueError(told[0])


@contextmanager
def _opened(path: Path) -> Iterator[tuple["InputContainer", "VideoStream"]]:
    """A video and its stream of depth."""
    with optional_library(str(path), "PyAV", "video"):
        import av
    with parsing(str(path), "not a readable video"), _heard("prematurely"):  # others may be about tracks that are not read
        container = av.open(
            str(path.absolute()), format=CONTAINERS[path.suffix.lower()], options={"protocol_whitelist": "file"}
        )
    with container:
        stream = _depth_stream(path, container)
        stream.codec_context.thread_count = 1  # a thread's complaints would not be heard
        yield container, stream


def _depth_stream(path: Path, container: "InputContainer") -> "VideoStream":
    """The track that is called depth, or the only one of 16-bit grey that is not called infrared."""
    formats = [getattr(stream, "pix_fmt", None) or "of an unknown kind" for stream in container.streams.video]
    grey = [one for one, name in zip(container.streams.video, formats, strict=True) if name in DEPTH_FORMATS]
    if not grey:
        raise InputError(
            f"{path}: its images are {', '.join(formats) or 'none'}; expected 16-bit grey (gray16le) in millimetres: "
            "colour and 8-bit video do not hold depth"
        )

    def marked(stream: "VideoStream", titles: tuple[str, ...], tag: str) -> bool:
        return stream.metadata.get("title", "").upper() in titles or tag in stream.metadata

    chosen = [one for one in grey if marked(one, DEPTH_TITLES, DEPTH_TAG)]
    chosen = chosen or [one for one in grey if not marked(one, INFRARED_TITLES, INFRARED_TAG)]
    if len(chosen) != 1:
        raise InputError(
            f"{path}: {len(chosen) or 'none'} of its {len(grey)} tracks of 16-bit grey can be depth; expected one, or the "
            "title DEPTH; an Azure Kinect's passive infrared mode records no depth"
        )
    return chosen[0]
