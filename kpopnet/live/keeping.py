"""What is kept of what is seen: recordings of depth and files of joints, in one folder."""

import threading
import time
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.joint_files.writing import write_performance
from kpopnet.dance.performance import MAX_DURATION_S, Performance
from kpopnet.live.streams import Seen
from kpopnet.pose import PersonPose
from kpopnet.runtime.atomic_write import claim
from kpopnet.runtime.endings import of_the_disk
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.sources.arrays import DepthWriter
from kpopnet.sources.live import Image

MOST_JOINTS_S, RETRY_S = 3600.0, 600.0
"""Joints are kept in memory until they are written: after the first time they are, or, where that failed, after the second."""


def free_path(folder: Path, kind: str, suffix: str) -> Path:
    """A new file of the folder, named after its kind and now: depth-20261124-101500.h5."""
    folder.mkdir(parents=True, exist_ok=True)
    name, number = f"{kind}-{time.strftime('%Y%m%d-%H%M%S')}", 1
    while not claim(path := folder / f"{name}{'' if number == 1 else f'-{number}'}{suffix}"):
        number += 1
    return path


WRITING = OSError, RuntimeError
"""What h5py raises where a disk is full or gone, the latter when a file is begun or closed."""


class DepthRecorder:
    """Writes every image of the camera between start and stop; the camera's thread writes, another one gives the orders.

    A recording that is longer than `kpopnet predict` takes goes on in another file.
    """

    def __init__(self, folder: Path, camera: Camera) -> None:
        self._folder, self._camera = folder, camera
        self._lock = threading.Lock()
        self._writer: DepthWriter | None = None
        self._first = self._last = 0.0
        self._told = ""

    @property
    def state(self) -> dict | None:
        """Images and seconds so far; None while nothing is recorded."""
        writer, seconds = self._writer, self._last - self._first
        return None if writer is None else {"images": writer.images, "seconds": round(seconds, 1)}

    def start(self) -> None:
        """Begins a recording, unless one goes on. Raises WRITING where the folder cannot be written, or its disk is full."""
        with self._lock:
            if self._writer is None:
                self._begin()

    def add(self, image: Image) -> None:
        """Writes an image, if a recording goes on; one that cannot go on ends."""
        with self._lock:
            if self._writer is None:
                return
            if self._writer.images and image.taken <= self._last:
                return
            try:
                if self._writer.images and image.taken - self._first > MAX_DURATION_S:
                    self._end("")
                    self._begin()
                    self._told += "; the next one goes on"
                if not self._writer.images:
                    self._first = image.taken
                self._writer.add(image.depth_m, image.taken - self._first)
                self._last = image.taken
            except WRITING as error:
                why = f"; it ended early: {of_the_disk(error)}"
                if self._writer is None:  # the next file could not be begun
                    self._told += why
                else:
                    self._end(why)

    def stop(self) -> None:
        """Ends the recording, if one goes on."""
        with self._lock:
            if self._writer is not None:
                self._end("")

    def news(self) -> str:
        """What became of the last recording that has ended, once; else ""."""
        with self._lock:
            told, self._told = self._told, ""
            return told

    def _begin(self) -> None:
        path = free_path(self._folder, "depth", ".h5")
        try:
            self._writer = DepthWriter(path, self._camera)
        except WRITING:
            path.unlink(missing_ok=True)
            raise
        self._first = self._last = 0.0

    def _end(self, why: str) -> None:
        writer, self._writer = self._writer, None
        assert writer is not None
        try:
            writer.close()
        except WRITING as error:
            why = why or f"; it is not complete: {of_the_disk(error)}"
        if not writer.images:
            writer.path.unlink(missing_ok=True)
            told = f"no image came: nothing was recorded{why}"
        else:
            seconds = self._last - self._first
            told = f"{writer.images} depth images of {seconds:.1f} s are in {writer.path}{why}"
        self._told = f"{self._told}. Then {told}" if self._told else told  # of two files that end at once both are told


class JointKeeper:
    """Keeps the joints of all people until they are written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kept: list[Seen] | None = None
        self._due_s = 0.0

    @property
    def state(self) -> dict | None:
        """Images and seconds so far; None while nothing is kept."""
        if self._kept is None:
            return None
        seconds = self._kept[-1].time_s - self._kept[0].time_s if self._kept else 0.0
        return {"images": len(self._kept), "seconds": round(seconds, 1)}

    def start(self) -> None:
        """Begins to keep joints, unless they are kept already. Raises OSError where the folder cannot be made."""
        self._folder.mkdir(parents=True, exist_ok=True)
        self._kept = self._kept if self._kept is not None else []

    def add(self, seen: Seen) -> bool:
        """Keeps the joints of an image; whether it is time to write them.

        Left out is one that is not later than the image before, and one with which the recording is longer than a dance may be.
        """
        if self._kept is None:
            return False
        if not self._kept:
            self._due_s = seen.time_s + MOST_JOINTS_S
        kept = self._kept
        if not kept or (seen.time_s > kept[-1].time_s and seen.time_s - kept[0].time_s <= MAX_DURATION_S):
            kept.append(seen)
        if is_due := seen.time_s >= self._due_s:
            self._due_s = seen.time_s + RETRY_S
        return is_due

    def write(self) -> str:
        """Writes a file for each person, which `kpopnet score` reads, and forgets the joints; what was written, "" for nothing.

        Each goes from the first to the last image that shows the person, on one clock: 0 at the first image of all. Raises
        OSError and InputError: nothing is written then, and the joints are kept.
        """
        if (kept := self._kept) is None:
            return ""
        people = [{person.identity: person for person in seen.people} for seen in kept]
        shown: dict[int, list[int]] = {}  # the first and the last image that shows each
        for number, found in enumerate(people):
            for one in found:
                shown.setdefault(one, [number, number])[1] = number
        unseen = PersonPose(0, np.full((NUM_JOINTS, 3), np.nan, np.float32), np.zeros(NUM_JOINTS, np.float32))
        paths, times_s = [], np.array([seen.time_s - kept[0].time_s for seen in kept])
        try:
            for one, (first, last) in sorted(shown.items()):
                inside = slice(first, last + 1)  # of many passers-by whole recordings would take minutes
                poses = [found.get(one, unseen) for found in people[inside]]
                joints_m, confidence = (np.array(values) for values in [*zip(*poses, strict=True)][1:3])
                paths.append(free_path(self._folder, f"joints-person{one}", ".npz"))
                write_performance(paths[-1], Performance(joints_m, times_s[inside], confidence))
        except BaseException:
            for path in paths:
                path.unlink(missing_ok=True)
            raise
        self._kept = None
        if not paths:
            return "no person was in view: no joints were saved"
        return f"the joints of {len(kept)} images are in {', '.join(map(str, paths))}"
