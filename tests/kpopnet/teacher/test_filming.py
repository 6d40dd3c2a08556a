"""Films that are made while somebody waits for them: progress, cancelling, the server's end."""

import asyncio
import errno
import json
import multiprocessing
import time

import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")

from aiohttp.test_utils import TestClient, TestServer

from kpopnet.errors import InputError
from kpopnet.teacher import filming
from kpopnet.teacher.filming import Filming, make_film
from kpopnet.teacher.live.verdict import Recording
from kpopnet.teacher.safety import LOOPBACK_NAMES
from kpopnet.teacher.server import make_app

PATIENCE_S, SOON_S = 240, 60


@pytest.fixture
def tried(teaching):
    """Saves a try of some seconds of a dance; its name."""

    def save(seconds: float, speed: float = 1.0) -> str:
        performance, recording = teaching.library.dance("dance_001").performance, Recording()
        for one in zip(performance.times_s[:60], performance.joints_m[:60], performance.confidence[:60], strict=True):
            recording.add(*one)
        course = {"time_s": [0.5, 1.5], "total": [90.0, 50.0], "parts": {}}
        result = {"dance": "dance_001", "total": 81.5, "speed": speed, "from_s": 0.0, "to_s": seconds, "course": course}
        return teaching.sessions.save(result, recording.arrays())

    return save


def films_at_work() -> list:
    return [one for one in multiprocessing.active_children() if one.name == "film"]


def left_over(teaching) -> list[str]:
    """What lies beside the tries."""
    return [
        path.name for path in teaching.sessions.folder.rglob("*") if path.is_file() and path.suffix not in (".json", ".npz")
    ]


def with_client(teaching, work):
    async def run():
        async with TestClient(TestServer(make_app(teaching, LOOPBACK_NAMES))) as client:
            return await asyncio.wait_for(work(client), PATIENCE_S)

    return asyncio.run(run())


def test_a_film_tells_how_far_it_is_and_is_kept(teaching, tried):
    base = f"/api/tries/dance_001/{tried(1.0)}"

    async def work(client):
        early = await client.get(f"{base}.mp4")
        assert early.status == 400 and "not made yet" in (await early.json())["error"]
        answer = await client.post(f"{base}/film")
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        told = [json.loads(line)["fraction"] for line in (await answer.text()).splitlines()]
        assert told == sorted(told) and told[0] < 1 and told[-1] == 1
        ready = await client.get(f"{base}.mp4")
        assert (await ready.read())[4:8] == b"ftyp" and "attachment" in ready.headers["Content-Disposition"]
        again = await client.post(f"{base}/film")
        assert (await again.text()).splitlines() == ['{"fraction": 1}']  # it is there

    with_client(teaching, work)
    assert not films_at_work()


def test_whoever_leaves_cancels_the_film_and_another_waits_meanwhile(teaching, tried):
    long, short = tried(45.0, 0.25), tried(1.0)

    async def work(client):
        answer = await client.post(f"/api/tries/dance_001/{long}/film")
        while json.loads(await answer.content.readline())["fraction"] == 0:
            pass
        assert len(films_at_work()) == 1
        refused = await client.post(f"/api/tries/dance_001/{short}/film")
        assert "another film is being made" in json.loads(await refused.text())["error"]
        answer.close()
        until = time.monotonic() + SOON_S
        while films_at_work() and time.monotonic() < until:
            await asyncio.sleep(0.1)
        assert not films_at_work() and not left_over(teaching)
        ready = await client.post(f"/api/tries/dance_001/{short}/film")
        assert json.loads((await ready.text()).splitlines()[-1]) == {"fraction": 1}

    with_client(teaching, work)


def test_the_server_ends_although_a_film_is_being_made_and_a_page_is_open(teaching, tried):
    name, ended = tried(45.0, 0.25), []

    async def work():
        client = TestClient(TestServer(make_app(teaching, LOOPBACK_NAMES)))
        await client.start_server()
        socket = await client.ws_connect("/live")
        answer = await client.post(f"/api/tries/dance_001/{name}/film")
        while json.loads(await answer.content.readline())["fraction"] == 0:
            pass
        began = time.monotonic()
        await client.server.close()
        ended.append(time.monotonic() - began)
        assert socket.closed or (await socket.receive()).type.name in ("CLOSE", "CLOSED", "CLOSING")
        await client.close()

    asyncio.run(asyncio.wait_for(work(), PATIENCE_S))
    assert ended[0] < 30 and not films_at_work() and not left_over(teaching)


def told(teaching, name: str) -> list[tuple[float, str]]:
    """What the process of a film tells."""
    ours, theirs = multiprocessing.Pipe()
    make_film(theirs, teaching.library.folder, teaching.sessions.folder, "dance_001", name)
    theirs.close()
    messages = []
    while ours.poll():
        try:
            messages.append(ours.recv())
        except EOFError:
            break
    return messages


def test_what_goes_wrong_is_one_sentence(teaching, tried, monkeypatch):
    monkeypatch.setattr(filming.os, "nice", lambda more: None)
    ((_, sentence),) = told(teaching, tried(1.0, speed=5.0))
    assert "damaged" in sentence

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(filming, "write_film", full)
    assert told(teaching, tried(1.0)) == [(0.0, "the film could not be saved: No space left on device")]


def test_a_process_that_dies_is_told(teaching, tried):
    name = tried(45.0, 0.25)

    async def work():
        async for fraction in Filming(teaching.library, teaching.sessions).make("dance_001", name):
            if fraction > 0:
                films_at_work()[0].kill()

    with pytest.raises(InputError, match="make it again"):
        asyncio.run(asyncio.wait_for(work(), PATIENCE_S))


def test_a_film_that_could_not_be_begun_bars_no_other(teaching, tried, monkeypatch):
    films, name = Filming(teaching.library, teaching.sessions), tried(1.0)

    def refuse(process) -> None:
        raise OSError(errno.EAGAIN, "no more processes")

    async def make() -> list[float]:
        return [fraction async for fraction in films.make("dance_001", name)]

    async def twice() -> list[float]:
        with monkeypatch.context() as patched:
            patched.setattr("multiprocessing.context.SpawnProcess.start", refuse)
            with pytest.raises(InputError, match="not finished"):
                await make()
        return await make()

    assert asyncio.run(twice())[-1] == 1
