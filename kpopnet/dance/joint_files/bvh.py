"""The BVH format, read and written: a hierarchy of joints with offsets, and the channels of every frame."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError
from kpopnet.rotations import about, multiply
from kpopnet.runtime.input_files import read_with

MAX_NUMBER = 1e7
"""No position in millimetres and no angle in degrees is greater."""

_FRAMES = re.compile(r"[0-9]{1,9}")
_CHANNEL = re.compile(r"([XYZ])(position|rotation)", re.IGNORECASE)


@dataclass(frozen=True)
class BvhFile:
    """The contents of a BVH file of J joints, parents first."""

    names: list[str]
    parents: list[int]  # index of each joint's parent, -1 for the root
    offsets: np.ndarray  # (J, 3) rest offset from the parent, in the file's unit
    quats: np.ndarray  # (T, J, 4) local rotations, w, x, y, z
    root: np.ndarray  # (T, 3) position of the root, in the file's unit
    fps: float
    moved: np.ndarray | None = None  # (T, J, 3) by how much a joint is off its offset, in the parent's frame; None: by nothing


def read_bvh(path: Path) -> BvhFile:
    """Reads a BVH file; raises InputError with the line where it is malformed or truncated."""
    lines = _Lines(Path(path))
    names, parents, offsets, channels = _read_hierarchy(lines)
    words = lines.next('"Frames: <number>"')
    if words[0].lower() != "frames:" or len(words) != 2 or not _FRAMES.fullmatch(words[1]) or not int(words[1]):
        raise lines.fail('"Frames: <number>", one or more')
    frames = int(words[1])
    words = lines.next('"Frame Time: <seconds>"')
    if [word.lower() for word in words[:2]] != ["frame", "time:"]:
        raise lines.fail('"Frame Time: <seconds>"')
    (frame_s,) = lines.numbers(words[2:], 1, "seconds per frame")
    if frame_s < 1e-6:
        raise lines.fail("a frame time above zero")
    width = sum(map(len, channels))
    values = np.empty((min(frames, lines.left), width))
    for t in range(frames):
        values[t] = lines.numbers(lines.next(f"frame {t + 1} of {frames}"), width, f"the channels of frame {t + 1}")

    quats = np.zeros((frames, len(names), 4))
    quats[..., 0] = 1.0
    root, moved = np.tile(offsets[0], (frames, 1)), np.zeros((frames, len(names), 3))
    column = 0
    for joint, joint_channels in enumerate(channels):
        for axis, kind in joint_channels:
            if kind == "rotation":
                quats[:, joint] = multiply(quats[:, joint], about(axis, np.deg2rad(values[:, column])))
            elif joint == 0:
                root[:, axis] = values[:, column]
            else:
                moved[:, joint, axis] = values[:, column] - offsets[joint][axis]
            column += 1
    return BvhFile(names, parents, np.array(offsets), quats, root, 1.0 / frame_s, moved if moved.any() else None)


class _Lines:
    """The words of a file line by line, with the position for error messages."""

    def __init__(self, path: Path) -> None:
        self.path, self.number = path, 0
        self._lines = _decoded(read_with(Path.read_bytes, path, "cannot be read")).splitlines()

    @property
    def left(self) -> int:
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
            values = []
        if len(values) != count or not all(abs(value) <= MAX_NUMBER for value in values):
            raise self.fail(f"{count} numbers up to {MAX_NUMBER:g} ({what})")
        return values


def _decoded(content: bytes) -> str:
    """UTF-8, or Shift JIS, as MikuMikuDance's tools write."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp932", errors="replace")


def _read_hierarchy(lines: _Lines) -> tuple[list[str], list[int], list[list[float]], list[list[tuple[int, str]]]]:
    """Names, parents, offsets and channels (axis, kind) of the joints."""
    if lines.next('"HIERARCHY"')[0].upper() != "HIERARCHY":
        raise lines.fail('"HIERARCHY"; is this a BVH file?')
    names, parents, offsets = list[str](), list[int](), list[list[float]]()
    channels = list[list[tuple[int, str]]]()
    open_blocks: list[int] = []  # joints whose braces are open; -1 for an end site
    while True:
        keyword, *words = lines.next('"JOINT", "}" or "MOTION"')
        match keyword.upper():
            case "ROOT" | "JOINT" | "END" as kind if (not names) if kind == "ROOT" else (open_blocks and open_blocks[-1] >= 0):
                if kind != "END":
                    parents.append(open_blocks[-1] if open_blocks else -1)
                    names.append(" ".join(words)[:100])
                    offsets.append([])
                    channels.append([])
                if lines.next('"{"') != ["{"]:
                    raise lines.fail('"{"')
                open_blocks.append(-1 if kind == "END" else len(names) - 1)
            case "OFFSET" if open_blocks:
                offset = lines.numbers(words, 3, "an offset")
                if open_blocks[-1] >= 0:
                    offsets[open_blocks[-1]] = offset
            case "CHANNELS" if open_blocks and open_blocks[-1] >= 0:
                matches = [_CHANNEL.fullmatch(word) for word in words[1:]]
                if not words or words[0] != str(len(matches)) or not all(matches):
                    raise lines.fail('"CHANNELS <number>" and that number of names Xposition ... Zrotation')
                channels[open_blocks[-1]] = [("XYZ".index(m[1].upper()), m[2].lower()) for m in matches if m]
            case "}" if open_blocks:
                joint = open_blocks.pop()
                if joint >= 0 and not offsets[joint]:
                    raise lines.fail(f"an OFFSET in joint {names[joint]} before its end")
            case "MOTION" if names and not open_blocks:
                return names, parents, offsets, channels
            case _:
                raise lines.fail('"ROOT" (one), "JOINT", "OFFSET", "CHANNELS", "}" or "MOTION" in its place')


def bvh_text(bvh: BvhFile, ends: np.ndarray | Sequence[np.ndarray]) -> str:
    """The text of a BVH file; `ends` (J, 3) is where each joint's bone ends if no joint follows, from the joint."""
    children: list[list[int]] = [[] for _ in bvh.names]
    for joint, parent in enumerate(bvh.parents[1:], 1):
        children[parent].append(joint)
    lines, order = ["HIERARCHY"], list[int]()

    def write(joint: int, indent: str) -> None:
        order.append(joint)
        channels = "3" if joint else "6 Xposition Yposition Zposition"
        lines.extend([f"{indent}{'JOINT' if joint else 'ROOT'} {bvh.names[joint]}", indent + "{"])
        lines.append(f"{indent}  OFFSET {_numbers(bvh.offsets[joint], 5)}")
        lines.append(f"{indent}  CHANNELS {channels} Zrotation Xrotation Yrotation")
        for child in children[joint]:
            write(child, indent + "  ")
        if not children[joint]:
            end = f"OFFSET {_numbers(ends[joint], 5)}"
            lines.extend([f"{indent}  End Site", indent + "  {", f"{indent}    {end}", indent + "  }"])
        lines.append(indent + "}")

    write(0, "")
    lines += ["MOTION", f"Frames: {len(bvh.quats)}", f"Frame Time: {1 / bvh.fps:.8f}"]
    from scipy.spatial.transform import Rotation  # slow to import, and not needed to read

    rotations = Rotation.from_quat(bvh.quats[:, order].reshape(-1, 4), scalar_first=True)
    angles_deg = rotations.as_euler("ZXY", degrees=True).reshape(len(bvh.quats), -1)
    motion = np.concatenate([bvh.root, angles_deg], axis=1)
    return "\n".join([*lines, *(_numbers(row, 4) for row in motion)]) + "\n"


def _numbers(values: np.ndarray, digits: int) -> str:
    return " ".join(f"{one:.{digits}f}" for one in values.tolist())
