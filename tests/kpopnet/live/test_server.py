"""The server of a live camera: what its pages see, what they may ask for, what is recorded; its process is a real one."""

import asyncio
import contextlib
import json
import multiprocessing
import os
import signal
import time
from functools import partial
from itertools import product

import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")

import aiohttp
from aiohttp import web
from live_people import FPS, open_unsteady_recording, watched, write_recording
from teacher_page import app_of, frame_of, with_client
from two_people_files import CAMERA

from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.errors import InputError
from kpopnet.live import server
from kpopnet.sources import open_depth
from kpopnet.teacher.safety import Keys


class Looking:
    """A page: its last message of each kind."""

    def __init__(self, socket) -> None:
        self._socket, self.said = socket, []
        self.seen = {"state": {"text": "", "paused": False, "ended": False}, "frame": {"people": []}}

    async def until(self, what):
        """Reads messages until a function of the last message of each kind gives something true; that."""
        while not (found := what(self.seen)):
            message = await self._socket.receive()
            if message.type is aiohttp.WSMsgType.BINARY:
                told, picture = frame_of(message.data)
                told["picture"] = picture
                await self._socket.send_json({"do": "drawn", "page_ms": 0.0})
            else:
                told = json.loads(message.data)
            self.seen[told["kind"]] = told
            if told["kind"] == "said":
                self.said.append(told["text"])
        return found

    async def order(self, what: str, on: bool) -> None:
        await self._socket.send_json({"do": what, "on": on})


@contextlib.asynccontextmanager
async def looking(client):
    async with client.ws_connect("/live") as socket:
        yield Looking(socket)


def two_people(seen: dict):
    return len(seen["frame"]["people"]) == 2 and seen["frame"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The recording, and its images."""
    folder = tmp_path_factory.mktemp("made")
    return folder / "two.npz", write_recording(folder)


@pytest.fixture
def images(made, tmp_path):
    (tmp_path / "two.npz").symlink_to(made[0])
    return made[1]


def test_people_are_shown_to_friends_alone_recorded_and_saved_and_a_pause_holds_them(images, tmp_path):
    keys = Keys()

    async def work(client):
        for path in ("/", "/live", "/page/watch.js"):
            assert (await client.get(path)).status == 403
            assert (await client.get(path, headers={"Host": "evil.example"})).status == 403
        assert (await client.get(f"/?token={keys.token}")).status == 200  # and its cookie opens the rest
        async with looking(client) as page, looking(client) as other:
            frame = await page.until(two_people)
            assert page.seen["opened"]["name"] == "two.npz" and page.seen["opened"]["camera"][4:] == [320, 240]
            assert [one["identity"] for one in frame["people"]] == [1, 2] and frame["delay_ms"] > 0
            assert np.frombuffer(frame["picture"][:4], "<u2").tolist() == [320, 240] and len(frame["picture"]) == 4 + 320 * 240
            left, right = (np.array(one["joints"], float) for one in frame["people"])
            assert left[0, 0] < 0 < right[0, 0] and left.shape == (15, 4)

            await page.order("record", True)
            await other.order("joints", True)
            await page.until(lambda seen: (seen["frame"]["depth"] or {}).get("images", 0) >= 8 and seen["frame"]["joints"])
            await other.until(lambda seen: seen["state"].get("recording") and seen["state"]["keeping"])  # every page knows
            await page.order("pause", True)
            await page.until(lambda seen: seen["state"]["paused"])
            await page.order("record", False)
            await page.order("joints", False)
            await page.until(lambda seen: len(page.said) == 2)
            last = page.seen["frame"]["time_s"]
            await page.order("pause", False)
            await page.until(lambda seen: not seen["state"]["paused"] and seen["frame"]["time_s"] > last)

            for wrong in ("{}", '{"do": "record"}', '{"do": "quit", "on": true}', '{"do": "watched", "on": false}', "[" * 900):
                page.seen.pop("said", None)
                await page._socket.send_str(wrong)
                assert await page.until(lambda seen: "said" in seen)

    with_client(watched(tmp_path), work, keys)
    (recording,) = (tmp_path / "kept").glob("depth-*.h5")
    recorded = open_depth(recording, in_child=True)
    assert recorded.camera == CAMERA
    numbers = [round(1000 * float(image[0, 0])) - 1000 for image in recorded]
    assert len(numbers) >= 8 and (np.diff(numbers) % len(images) == 1).all()  # none is left out
    for number, image in zip(numbers, recorded, strict=True):
        np.testing.assert_array_equal(image, images[number].astype(np.float32) / 1000)
    times_s = [image.time_s for image in recorded.timed()]
    assert np.diff(times_s).min() > 0 and np.median(np.diff(times_s)) > 0.5 / FPS  # a busy machine moves single ones

    saved = sorted((tmp_path / "kept").glob("joints-person*.npz"))
    assert len(saved) == 2
    for path, side in zip(saved, (-1, 1), strict=True):
        joints = read_performance(path)
        assert joints.times_s[0] == 0 and np.nanmedian(side * joints.joints_m[:, 0, 0]) > 0.2


def test_a_camera_that_is_unplugged_goes_on_and_the_program_ends_when_all_is_saved(images, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(server, "END_S", 0)  # for a process that has nothing to save
    ends_s = []

    async def work(client):
        async with looking(client) as page:
            await page.until(two_people)
            (tmp_path / "unplugged").touch()
            assert await page.until(lambda seen: seen["state"]["text"]) == "plug the camera in"
            async with looking(client) as late:
                await late.until(lambda seen: seen["state"]["text"])
            last = page.seen["frame"]["time_s"]
            (tmp_path / "unplugged").unlink()
            await page.until(lambda seen: not seen["state"]["text"] and seen["frame"]["time_s"] > last)
            await page.order("joints", True)
            await page.until(lambda seen: two_people(seen) and (seen["frame"]["joints"] or {}).get("images"))
            for child, number in product(multiprocessing.active_children(), (signal.SIGINT, signal.SIGHUP)):
                os.kill(child.pid, number)  # as a terminal that is closed does to all of its processes
        ends_s.append(time.monotonic())

    with_client(watched(tmp_path, open_camera=partial(open_unsteady_recording, tmp_path)), work)
    assert time.monotonic() - ends_s[0] < server.SAVE_S / 2
    (path, _) = sorted((tmp_path / "kept").glob("joints-person*.npz"))
    assert path.name in capfd.readouterr().err


def test_the_end_of_a_recording_is_told_and_what_is_kept_is_saved(images, tmp_path, capfd):
    async def work(client):
        async with looking(client) as page:
            await page.order("joints", True)
            ended = await page.until(lambda seen: seen["state"]["ended"] and seen["state"])
            assert ended["text"] == "two.npz has ended" and any("joints of" in text for text in page.said)

    with_client(watched(tmp_path, loop=False), work)
    assert len(list((tmp_path / "kept").glob("joints-person*.npz"))) == 2
    assert capfd.readouterr().err.count("two.npz has ended") == 1


def test_a_source_that_does_not_open_ends_the_program_before_it_serves(tmp_path):
    with pytest.raises(InputError, match=r"two\.npz: no such file"):
        asyncio.run(web.AppRunner(app_of(watched(tmp_path))).setup())
