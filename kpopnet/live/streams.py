"""The joints of every image for other programs: JSON or CSV lines on the standard output, OSC or VMC messages by UDP.

JSON and CSV hold what `kpopnet predict` writes, with the number of the person; OSC and VMC go to ports of this machine.
Open Sound Control 1.0: https://opensoundcontrol.stanford.edu/spec-1_0.html. VMC protocol: https://protocol.vmc.info/english.
"""

import contextlib
import csv
import json
import socket
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from kpopnet.dance.joint_files.writing import CM_PER_METRE, CSV_COLUMNS, csv_rows, json_frames, skeleton
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError, check_between, check_one_of
from kpopnet.pose import PersonPose
from kpopnet.rotations import conjugate, multiply
from kpopnet.runtime.endings import is_windows_broken_pipe
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS, Joint


class Seen(NamedTuple):
    """All people in one image."""

    number: int  # of the image, from 0
    time_s: float  # seconds since the first one
    delay_ms: float  # from the image to its joints
    people: Sequence[PersonPose]  # those in view; identities from 1


Stream = Callable[[Seen], None]
"""Sends the joints of one image; raises BrokenPipeError where no program reads them any more."""


class ReaderGoneError(InputError):
    """No program reads the stream any more."""


PORTS = {"osc": 9000, "vmc": 39539}
"""The usual UDP ports of programs that receive."""

MOST_PORT = 65535
STREAMS = ("json", "csv", *PORTS)
TO_STDOUT = ("json", "csv")
LOOPBACK = "127.0.0.1"
FORGOTTEN_S = 5.0
"""A person who was away for this long leaves the port to others."""


@contextmanager
def open_stream(kind: str | None, port: int | None = None) -> Iterator[Stream | None]:
    """A stream of a kind in STREAMS; OSC goes to a UDP port of this machine, VMC to it and those that follow; None: none.

    Raises InputError for another kind or port.
    """
    if kind is not None:
        check_one_of("stream", kind, STREAMS)
    if port is not None:
        check_between("port", port, 1, MOST_PORT)
    if kind not in PORTS:
        yield {None: None, "json": _printed(_write_json), "csv": _printed(_write_csv)}[kind]
        return
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:

        def send(packet: bytes, number: int = 0) -> None:
            to = LOOPBACK, (port or PORTS[kind]) + number
            try:
                # No program listens yet, or all ports up to the last one are taken, some by people who have just left.
                with contextlib.suppress(ConnectionRefusedError, ConnectionResetError, OverflowError):  # Windows says reset
                    udp.sendto(packet, to)
            except OSError as error:  # such as a firewall's
                error.filename = "UDP to {}:{}".format(*to)
                raise

        yield (_osc_sender if kind == "osc" else _vmc_sender)(send)


def _printed(write: Stream) -> Stream:
    def stream(seen: Seen) -> None:
        try:
            write(seen)
        except OSError as error:
            if is_windows_broken_pipe(error):
                raise BrokenPipeError from error
            error.filename = "standard output"
            raise

    return stream


def _one(seen: Seen, person: PersonPose) -> Performance:
    return Performance(person.joints_camera_m[None], np.array([seen.time_s]), person.confidence[None])


def _write_json(seen: Seen) -> None:
    """One line an image: its number, time_s, delay_ms, and of every person in view the identity and the joints."""
    people = [{"identity": one.identity, "joints": next(json_frames(_one(seen, one)))["joints"]} for one in seen.people]
    head = {"image": seen.number, "time_s": round(seen.time_s, 6), "delay_ms": round(seen.delay_ms, 1)}
    print(json.dumps(head | {"people": people}, allow_nan=False), flush=True)


def _write_csv(seen: Seen) -> None:
    """A header with the first image, then a line for every person in each image; an image without people has none."""
    rows = csv.writer(sys.stdout, lineterminator="\n")
    if seen.number == 0:
        rows.writerow(("image", "identity", "delay_ms", *CSV_COLUMNS))
    for one in seen.people:
        rows.writerow([seen.number, one.identity, round(seen.delay_ms, 1), *next(csv_rows(_one(seen, one)))])
    sys.stdout.flush()


# --- Open Sound Control


def _padded(content: bytes) -> bytes:
    return content + b"\0" * (4 - len(content) % 4)  # text ends with one to four zeros


def message(address: str, *values: str | int | float) -> bytes:
    """An OSC message of texts, int32 and float32."""
    kinds, packed = ",", b""
    for one in values:
        kinds += "s" if isinstance(one, str) else "i" if isinstance(one, int) else "f"
        packed += _padded(one.encode()) if isinstance(one, str) else struct.pack(f">{kinds[-1]}", one)
    return _padded(address.encode()) + _padded(kinds.encode()) + packed


def bundle(messages: Sequence[bytes]) -> bytes:
    """OSC messages that belong to one moment: now."""
    return _padded(b"#bundle") + struct.pack(">Q", 1) + b"".join(struct.pack(">i", len(one)) + one for one in messages)


def _osc_sender(send: Callable[[bytes], None]) -> Stream:
    """Of each image /kpopnet/image, then for every person a bundle of /kpopnet/person/IDENTITY/JOINT."""

    def stream(seen: Seen) -> None:
        send(message("/kpopnet/image", seen.number, float(seen.time_s), float(seen.delay_ms), len(seen.people)))
        for person in seen.people:
            joints = zip(JOINT_NAMES, person.joints_camera_m, person.confidence, strict=True)
            told = [
                message(f"/kpopnet/person/{person.identity}/{name}", *map(float, (*joint_m, confidence)))
                for name, joint_m, confidence in joints
                if confidence > 0
            ]
            send(bundle(told))

    return stream


# --- Virtual Motion Capture

BONES = {
    "Hips": "Hips", "Spine": "Spine", "Spine1": "Chest", "Neck": "Neck", "Head": "Head",
    **{side + ours: side + theirs for side in ("Left", "Right") for ours, theirs in (
        ("Arm", "UpperArm"), ("ForeArm", "LowerArm"), ("Hand", "Hand"),
        ("UpLeg", "UpperLeg"), ("Leg", "LowerLeg"), ("Foot", "Foot"),
    )},
}  # fmt: skip
"""Bones of `skeleton` to Unity's HumanBodyBones. In both rest poses the arms are stretched sideways, the legs down."""


class Performer:
    """One person as bone rotations."""

    def __init__(self, number: int) -> None:
        self.number, self.seen_s = number, 0.0  # of the port, from 0; time when they were seen last
        self._last_m = np.full((NUM_JOINTS, 3), np.nan)
        self._origin_cm: np.ndarray | None = None

    def bones(self, person: PersonPose) -> Iterator[bytes]:
        """The messages of the bones, none while a joint has never been seen.

        The hips stand as high as they are above the lower foot, and are where they were first seen at first.
        """
        joints_m = self._without_gaps(person)
        if not np.isfinite(joints_m).all():
            return
        points_cm = joints_m * [1, -1, -1] * CM_PER_METRE
        try:
            bones, root_cm = skeleton(points_cm[None])
        except InputError:  # joints that lie in one point have no direction
            return
        self._origin_cm = root_cm[0] if self._origin_cm is None else self._origin_cm
        hips_cm = root_cm[0] - self._origin_cm
        hips_cm[1] = root_cm[0, 1] - points_cm[[Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 1].min()
        for name, bone in bones.items():
            turned = multiply(conjugate(bones[bone.parent].world), bone.world) if bone.parent else bone.world
            place_cm = bone.offset_cm if bone.parent else hips_cm
            # Unity's axes are those of a mirror: x to the person's right.
            w, x, y, z = turned[0]
            place_m = place_cm * [-1, 1, 1] / CM_PER_METRE
            yield message("/VMC/Ext/Bone/Pos", BONES[name], *map(float, (*place_m, x, -y, -z, w)))

    def _without_gaps(self, person: PersonPose) -> np.ndarray:
        """(15, 3) joints; one that is missing stays where it was last, relative to the torso."""
        joints_m = person.joints_camera_m.astype(float)
        held_m = self._last_m - self._last_m[Joint.TORSO] + joints_m[Joint.TORSO]
        joints_m = np.where(np.isfinite(joints_m), joints_m, held_m)
        if np.isfinite(joints_m[Joint.TORSO]).all():
            self._last_m = joints_m
        return joints_m


def _vmc_sender(send: Callable[[bytes, int], None]) -> Stream:
    """Of each image the bones of all people in view whose joints have all been seen.

    The protocol knows one performer a port: each person gets one, the first that is free.
    """
    known: dict[int, Performer] = {}

    def stream(seen: Seen) -> None:
        for identity in [identity for identity, one in known.items() if seen.time_s - one.seen_s > FORGOTTEN_S]:
            del known[identity]
        for person in seen.people:
            taken = {one.number for one in known.values()}
            performer = known.setdefault(person.identity, Performer(min(set(range(len(taken) + 1)) - taken)))
            performer.seen_s = seen.time_s
            if bones := list(performer.bones(person)):
                root = message("/VMC/Ext/Root/Pos", "root", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
                told = [message("/VMC/Ext/OK", 1), message("/VMC/Ext/T", float(seen.time_s)), root, *bones]
                send(bundle(told), performer.number)

    return stream
