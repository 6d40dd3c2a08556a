"""The streams: their bytes, decoded here by the words of the protocols alone."""

import io
import json
import socket
import struct
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from cone_people import cone_joints
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.errors import InputError
from kpopnet.live.streams import TO_STDOUT, Seen, open_stream
from kpopnet.pose import PersonPose
from kpopnet.runtime import endings
from kpopnet.skeleton import JOINT_NAMES, Joint


def person(identity: int, *missing: Joint, x_m: float = 0.0, yaw_deg: float = 0.0) -> PersonPose:
    joints_m = cone_joints(yaw_deg=yaw_deg, place_m=(x_m, 0.1, 3.0)).astype(np.float32)
    confidence = np.full(15, 0.9, np.float32)
    joints_m[list(missing)], confidence[list(missing)] = np.nan, 0
    return PersonPose(identity, joints_m, confidence)


SEEN = Seen(7, 0.5, 12.5, [person(1), person(3, Joint.LEFT_FOOT, x_m=1.0)])


def text(data: bytes, at: int) -> tuple[str, int]:
    """A text that ends with zeros up to a multiple of four bytes, and where it ends."""
    end = data.index(b"\0", at)
    after = end + 4 - end % 4
    assert not any(data[end:after])
    return data[at:end].decode(), after


def decoded(packet: bytes) -> list[tuple]:
    """The messages of an OSC packet: address and values."""
    if packet.startswith(b"#bundle\0"):
        assert packet[8:16] == struct.pack(">Q", 1)  # at once
        found, at = [], 16
        while at < len(packet):
            (size,) = struct.unpack_from(">i", packet, at)
            assert size % 4 == 0
            found += decoded(packet[at + 4 : at + 4 + size])
            at += 4 + size
        return found
    address, at = text(packet, 0)
    kinds, at = text(packet, at)
    values = []
    for kind in kinds.removeprefix(","):
        if kind == "s":
            value, at = text(packet, at)
        else:
            (value,), at = struct.unpack_from(f">{kind}", packet, at), at + 4
        values.append(value)
    assert at == len(packet)
    return [(address, *values)]


@pytest.fixture
def heard():
    """Two UDP sockets on successive ports."""
    for first in range(40_000, 60_000, 7):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as two:
            try:
                for port, socket_ in enumerate((one, two), first):
                    socket_.bind(("127.0.0.1", port))
                    socket_.settimeout(10)
            except OSError:  # taken
                continue
            yield one, two
            return


def port_of(heard) -> int:
    return heard[0].getsockname()[1]


def test_json_is_one_line_an_image(capsys):
    with open_stream("json") as stream:
        stream(SEEN)
        stream(Seen(8, 0.6, 11.0, []))
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    assert (first["image"], first["time_s"], first["delay_ms"]) == (7, 0.5, 12.5) and second["people"] == []
    one, other = first["people"]
    assert (one["identity"], other["identity"]) == (1, 3) and list(one["joints"]) == list(JOINT_NAMES)
    head_m = SEEN.people[0].joints_camera_m[Joint.HEAD]
    assert one["joints"]["head"] == pytest.approx([*head_m, 0.9], abs=1e-4)
    assert other["joints"]["left_foot"] is None


def test_csv_of_one_person_is_what_the_scorer_reads(monkeypatch, tmp_path):
    written = io.StringIO()
    monkeypatch.setattr(sys, "stdout", written)
    with open_stream("csv") as stream:
        for number in range(4):
            stream(Seen(number, number / 30, 10.0, [person(2, x_m=0.1 * number)]))
    lines = written.getvalue().splitlines()
    assert lines[0].startswith("image,identity,delay_ms,time_s,head_x,head_y,head_z,head_confidence,") and len(lines) == 5
    (tmp_path / "joints.csv").write_text(written.getvalue())
    read = read_performance(tmp_path / "joints.csv")
    np.testing.assert_allclose(read.times_s, np.arange(4) / 30, atol=1e-6)
    read_m, true_m = (joints_m - joints_m[Joint.TORSO] for joints_m in (read.joints_m[3], person(2).joints_camera_m))
    np.testing.assert_allclose(read_m, true_m, atol=2e-4)


@pytest.mark.parametrize("kind", TO_STDOUT)
@pytest.mark.parametrize("error", [BrokenPipeError(), OSError(22, "Invalid argument")])
def test_a_reader_that_has_gone_is_told_with_the_first_image(monkeypatch, kind, error):
    def gone(*_: object) -> None:
        raise error

    monkeypatch.setattr(endings, "ON_WINDOWS", error.errno == 22)  # where it is told so
    monkeypatch.setattr(sys, "stdout", SimpleNamespace(write=gone, flush=gone))
    with open_stream(kind) as stream, pytest.raises(BrokenPipeError):
        stream(SEEN)


def test_a_full_disk_behind_the_standard_output_is_named(monkeypatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys, "stdout", SimpleNamespace(write=full, flush=full))
    with open_stream("json") as stream, pytest.raises(OSError, match="standard output"):
        stream(SEEN)


@pytest.mark.parametrize("error", [ConnectionRefusedError, ConnectionResetError])  # Linux's, Windows'
def test_where_no_program_listens_images_go_nowhere(monkeypatch, error):
    class Deaf(socket.socket):
        def sendto(self, *_):
            raise error

    monkeypatch.setattr(socket, "socket", Deaf)
    with open_stream("vmc") as stream:
        stream(SEEN)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("OSC",), "stream=OSC: expected one of json, csv, osc, vmc"),
        (("osc", 70000), r"port=70000: expected a number in 1\.\.65535"),
        (("vmc", "9000"), "port='9000': expected a number"),
    ],
)
def test_another_stream_or_port_is_refused(given, message):
    with pytest.raises(InputError, match=message), open_stream(*given):
        pass


def test_osc_names_people_and_joints(heard):
    with open_stream("osc", port_of(heard)) as stream:
        stream(SEEN)
    ((address, *image),) = decoded(heard[0].recv(65536))
    assert address == "/kpopnet/image" and image == [7, 0.5, 12.5, 2]
    one, other = (decoded(heard[0].recv(65536)) for _ in range(2))
    assert [address for address, *_ in one] == [f"/kpopnet/person/1/{name}" for name in JOINT_NAMES]
    np.testing.assert_allclose([values[:3] for _, *values in one], SEEN.people[0].joints_camera_m, atol=1e-6)
    assert "/kpopnet/person/3/left_foot" not in [address for address, *_ in other] and len(other) == 14


BONES = (
    ("LeftUpperArm", "LeftLowerArm", Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW),
    ("RightUpperLeg", "RightLowerLeg", Joint.RIGHT_HIP, Joint.RIGHT_KNEE),
    ("RightLowerLeg", "RightFoot", Joint.RIGHT_KNEE, Joint.RIGHT_FOOT),
)
PARENTS = {
    "Spine": "Hips", "Chest": "Spine", "LeftUpperArm": "Chest", "LeftLowerArm": "LeftUpperArm", "RightUpperLeg": "Hips",
    "RightLowerLeg": "RightUpperLeg", "RightFoot": "RightLowerLeg",
}  # fmt: skip
"""Of Unity's humanoid."""


def placed(bones: dict[str, list[float]], name: str) -> tuple[np.ndarray, Rotation]:
    """Where a bone begins and how it is turned in the room, by its parents, in Unity's axes."""
    place, turned = np.array(bones[name][:3]), Rotation.from_quat(bones[name][3:])
    if name not in PARENTS:
        return place, turned
    parent_place, parent_turned = placed(bones, PARENTS[name])
    return parent_place + parent_turned.apply(place), parent_turned * turned


def heard_bones(packet: bytes) -> dict[str, list[float]]:
    messages = decoded(packet)
    assert ("/VMC/Ext/OK", 1) in messages and messages[2][:2] == ("/VMC/Ext/Root/Pos", "root")
    return {values[0]: values[1:] for address, *values in messages if address == "/VMC/Ext/Bone/Pos"}


def test_vmc_bones_point_where_the_joints_do_and_everybody_has_a_port(heard):
    with open_stream("vmc", port_of(heard)) as stream:
        stream(Seen(0, 0.0, 10.0, [person(1, yaw_deg=25), person(3, x_m=1.0, yaw_deg=25)]))
    for socket_, x_m in zip(heard, (0.0, 1.0), strict=True):
        bones, joints_m = heard_bones(socket_.recv(65536)), person(1, x_m=x_m, yaw_deg=25).joints_camera_m
        assert len(bones) == 17
        for name, end, first, second in BONES:
            along = placed(bones, end)[0] - placed(bones, name)[0]
            # In Unity a person faces z, y is up and x to their right: of a person before the camera all three are opposed.
            true = (joints_m[second] - joints_m[first]) * [-1, -1, -1]
            np.testing.assert_allclose(along / np.linalg.norm(along), true / np.linalg.norm(true), atol=0.02)
        np.testing.assert_allclose(bones["Hips"][0::2][:2], 0, atol=1e-5)  # where they were first seen
        assert 0.6 < bones["Hips"][1] < 1.2


def test_vmc_holds_a_limb_that_is_hidden_and_keeps_ports(heard):
    with open_stream("vmc", port_of(heard)) as stream:
        stream(Seen(0, 0.0, 10.0, [person(4, Joint.LEFT_HAND)]))  # one that was never seen has no direction
        stream(Seen(1, 0.1, 10.0, [person(4), person(5)]))
        before = heard_bones(heard[0].recv(65536))
        stream(Seen(2, 0.2, 10.0, [person(4, Joint.LEFT_HAND, Joint.RIGHT_FOOT, x_m=0.5)]))
        held = heard_bones(heard[0].recv(65536))
        for name, values in before.items():
            np.testing.assert_allclose(held[name][3:], values[3:], atol=1e-5)
        assert held["Hips"][0] == pytest.approx(-0.5, abs=1e-5)
        heard[1].recv(65536)
        stream(Seen(3, 9.0, 10.0, [person(5)]))  # who came second stays second for as long as the first may come back
        stream(Seen(4, 20.0, 10.0, [person(6)]))  # and now no person is known
        assert heard_bones(heard[0].recv(65536))
    with open_stream("vmc", 65535) as stream:
        stream(Seen(0, 0.0, 10.0, [person(1), person(2)]))  # the second has no port


def test_a_firewall_that_lets_nothing_through_is_told_with_the_port(monkeypatch):
    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(socket, "socket", lambda *_: nullcontext(SimpleNamespace(sendto=refused)))
    with open_stream("osc", 9123) as stream, pytest.raises(OSError, match=r"UDP to 127\.0\.0\.1:9123"):
        stream(SEEN)


def test_vmc_keeps_the_place_of_who_stays_in_view_for_long(heard):
    with open_stream("vmc", port_of(heard)) as stream:
        for number, x_m in enumerate((0.0, 0.25, 0.5)):
            stream(Seen(number, 4.0 * number, 10.0, [person(1, x_m=x_m)]))
    hips = [heard_bones(heard[0].recv(65536))["Hips"] for _ in range(3)]
    np.testing.assert_allclose([x for x, *_ in hips], [0, -0.25, -0.5], atol=1e-5)


def test_vmc_hips_are_as_high_as_above_the_foot_that_stands(heard):
    lifted = person(1)
    lifted.joints_camera_m[[Joint.RIGHT_KNEE, Joint.RIGHT_FOOT]] -= np.float32([0, 0.3, 0])
    with open_stream("vmc", port_of(heard)) as stream:
        for number, one in enumerate((person(1), lifted)):
            stream(Seen(number, 0.1 * number, 10.0, [one]))
    first, second = (heard_bones(heard[0].recv(65536))["Hips"][1] for _ in range(2))
    assert second == pytest.approx(first, abs=1e-5)
