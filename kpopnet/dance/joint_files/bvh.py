"""Reads BVH files: a hierarchy of joints with offsets, and the channels of every frame."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError
from kpopnet.rotations import about, multiply
from kpopnet.runtime.input_files import check_budget

MAX_JOINTS, MAX_NUMBER = 1000, 1e7
"""No skeleton has more joints; no position in millimetres and no angle in degrees is greater."""

_FRAMES = re.compile(r"[0-9]{1,9}")
_CHANNEL = re.compile(r"^([XYZ])(position|rotation)$", re.IGNORECASE)


@dataclass(frozen=True)
class BvhFile:
    """The contents of a BVH file.

    Attributes:
        names: names of the J joints, parents first.
        parents: index of each joint's parent, -1 for the root.
        offsets: (J, 3) rest offset from the parent, in the file's unit.
        quats: (T, J, 4) local rotations, w, x, y, z.
        root: (T, 3) position of the root, in the file's unit.
        fps: frames per second.
    """

    names: list[str]
    parents: list[int]
    offsets: np.ndarray
    quats: np.ndarray
    root: np.ndarray
    fps: float


class _Lines:
    """The words of a file line by line, with the position for error messages."""

    def __init__(self, path: Path) -> None:
        self.path, self.number = path, 0
        try:
            check_budget(path, 4 * path.stat().st_size, "its text")
            self._lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        except (OSError, ValueError) as error:
            raise error if isinstance(error, InputError) else InputError(f"{path}: cannot be read ({error})") from error

    @property
    def left(self) -> int:
        """Lines that are still to be read."""
        return len(self._lines) - self.number

    def next(self, expected: str) -> list[str]:
        while self.number < len(self._lines):
            self.number += 1
            if words := self._lines[self.number - 1].split():
                return words
        raise InputError(f"{self.path} ends after line {self.number} where {expected} was expected; the file is truncated")

    def fail(self, expected: str) -> InputError:
        found = self._lines[self.number - 1].strip()
        return InputError(f"{self.path}, line {self.number}: expected {expected}, found {found[:60]!r}")

    def numbers(self, words: list[str], count: int, what: str) -> list[float]:
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise self.fail(f"{count} numbers ({what})") from None
        if len(values) != count:
            raise self.fail(f"{count} numbers ({what}), not {len(values)}")
        if not all(abs(value) <= MAX_NUMBER for value in values):
            raise self.fail(f"finite numbers up to {MAX_NUMBER:g} ({what})")
        return values


def read_bvh(path: Path) -> BvhFile:
    """Reads a BVH file: the hierarchy, the channels in the order that the file declares, and the motion.

    Raises:
        InputError: the file is malformed or truncated; the message names the line.
    """
    lines = _Lines(Path(path))
    names, parents, offsets, channels = _hierarchy(lines)
    frames_line = lines.next('"Frames:"')
    if frames_line[0].lower() != "frames:" or len(frames_line) != 2 or not _FRAMES.fullmatch(frames_line[1]):
        raise lines.fail('"Frames: <number>"')
    time_line = lines.next('"Frame Time:"')
    if [word.lower() for word in time_line[:2]] != ["frame", "time:"] or len(time_line) != 3:
        raise lines.fail('"Frame Time: <seconds>"')
    (frame_s,) = lines.numbers(time_line[2:], 1, "seconds per frame")
    if frame_s < 1e-6:
        raise lines.fail("a frame time above zero")

    width, frames = sum(map(len, channels)), int(frames_line[1])
    if frames == 0:
        raise InputError(f"{lines.path} has no frames")
    stored = min(frames, lines.left)
    check_budget(lines.path, 8 * stored * (width + 20 * len(names)), f"{stored} frames of {len(names)} joints")
    values = np.empty((stored, width))
    for t in range(frames):
        values[t] = lines.numbers(lines.next(f"frame {t + 1} of {frames}"), width, f"the channels of frame {t + 1}")

    quats = np.zeros((frames, len(names), 4))
    quats[..., 0] = 1.0
    root = np.tile(offsets[0], (frames, 1))
    column = 0
    for joint, joint_channels in enumerate(channels):
        for axis, kind in joint_channels:
            if kind == "rotation":
                quats[:, joint] = multiply(quats[:, joint], about(axis, np.deg2rad(values[:, column])))
            elif joint == 0:
                root[:, axis] = values[:, column]
            column += 1
    return BvhFile(names, parents, np.array(offsets), quats, root, 1.0 / frame_s)


def _hierarchy(lines: _Lines) -> tuple[list[str], list[int], list[list[float]], list[list[tuple[int, str]]]]:
    """Names, parents, offsets and channels (axis, kind) of the joints."""
    if lines.next('"HIERARCHY"')[0].upper() != "HIERARCHY":
        raise lines.fail('"HIERARCHY"; is this a BVH file?')
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[list[tuple[int, str]]] = []
    open_blocks: list[int] = []  # joints whose braces are open; -1 for an end site
    while True:
        words = lines.next('"JOINT", "}" or "MOTION"')
        keyword = words[0].upper()
        if keyword in ("ROOT", "JOINT", "END"):
            if (keyword == "ROOT") == bool(names) or (keyword != "ROOT" and (not open_blocks or open_blocks[-1] < 0)):
                raise lines.fail("one ROOT, and JOINT or End Site within a joint")
            if keyword != "END":
                if not 2 <= len(words) <= 20 or len(names) == MAX_JOINTS:
                    raise lines.fail(f"the joint's name, of at most {MAX_JOINTS} joints")
                parents.append(open_blocks[-1] if open_blocks else -1)
                names.append(" ".join(words[1:])[:100])
                offsets.append([])
                channels.append([])
            if lines.next('"{"') != ["{"]:
                raise lines.fail('"{"')
            open_blocks.append(-1 if keyword == "END" else len(names) - 1)
        elif keyword == "OFFSET" and open_blocks:
            offset = lines.numbers(words[1:], 3, "an offset")
            if open_blocks[-1] >= 0:
                offsets[open_blocks[-1]] = offset
        elif keyword == "CHANNELS" and open_blocks and open_blocks[-1] >= 0:
            matches = [_CHANNEL.match(word) for word in words[2:]]
            if len(words) < 2 or words[1] != str(len(matches)) or not all(matches):
                raise lines.fail('"CHANNELS <number>" and that number of names Xposition ... Zrotation')
            channels[open_blocks[-1]] = [("XYZ".index(m[1].upper()), m[2].lower()) for m in matches if m]
        elif keyword == "}" and open_blocks:
            joint = open_blocks.pop()
            if joint >= 0 and not offsets[joint]:
                raise lines.fail(f"an OFFSET in joint {names[joint]} before its end")
        elif keyword == "MOTION" and names and not open_blocks:
            return names, parents, offsets, channels
        else:
            raise lines.fail('"JOINT", "OFFSET", "CHANNELS", "}" or "MOTION" in its place')
