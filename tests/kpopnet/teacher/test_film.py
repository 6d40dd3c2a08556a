"""Films of tries, made while their page waits for them: images, progress, cancelling, the server's end."""

import asyncio
import errno
import json
import multiprocessing
import os
import signal
import threading
import time
from contextlib import aclosing
from dataclasses import replace
from multiprocessing import resource_tracker
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")

from teacher_page import PATIENCE_S, with_its_client

from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from kpopnet.teacher import film
from kpopnet.teacher.film import (
    AMBIENT,
    COLOURS,
    FPS,
    LIGHT,
    MOST_S,
    PANEL_PX,
    Filming,
    drawn,
    make_film,
    skinned,
    write_film,
)
from kpopnet.teacher.library import TeacherBody
from kpopnet.teacher.posing import Movement, posed

SOON_S = 60
RESULT = {"from_s": 1.0, "to_s": 2.0, "speed": 0.5, "course": {"time_s": [1.0, 1.5, 2.0], "total": [95.0, None, 5.0]}}


def seen(half: np.ndarray) -> np.ndarray:
    """The (K, 3) pixels that are brighter than the ground, above the floor."""
    return half[60:380][half[60:380].max(axis=2) > 50]


def test_teacher_and_learner_stand_side_by_side_and_the_learner_is_as_bright_as_right(library, tmp_path):
    dance, path, found = library.dance("dance_001"), tmp_path / "film.mp4", []
    write_film(path, library.body, dance, dance.performance, RESULT)
    video = cv2.VideoCapture(str(path))
    while (read := video.read())[0]:
        found.append(read[1])
    assert len(found) == pytest.approx(2 * FPS, abs=1) and found[0].shape == (PANEL_PX[1], 2 * PANEL_PX[0], 3)
    first, last = ([seen(half) for half in np.split(found[k], 2, axis=1)] for k in (0, -1))
    assert len(first[0]) == pytest.approx(len(first[1]), rel=0.25) and len(first[0]) > 5000
    assert first[1].mean() > 1.5 * last[1].mean() and first[0].mean() < 1.3 * last[0].mean()


def test_a_skinned_body_has_its_joints_where_the_dancer_has_and_stays_in_the_picture(library):
    """The hands of the drawn body, with the body's own proportions, are on the side and at the height of the dancer's."""
    body, dance = library.body, library.dance("dance_001")
    quats, hips_m = posed(dance.joints_m[:90], body)
    hand = int(np.argmin(np.linalg.norm(body.vertices_m - body.joints_m[Joint.LEFT_HAND], axis=1)))
    torso = int(np.argmin(np.linalg.norm(body.vertices_m - body.joints_m[Joint.TORSO], axis=1)))
    above_m, wanted_m = [], []
    for frame in range(0, 90, 5):
        vertices_m = skinned(body, quats[frame], hips_m[frame])
        above_m.append(vertices_m[hand, 2] - vertices_m[torso, 2])
        wanted_m.append(dance.joints_m[frame, Joint.TORSO, 1] - dance.joints_m[frame, Joint.LEFT_HAND, 1])
    assert np.ptp(wanted_m) > 0.3 and np.abs(np.subtract(above_m, wanted_m)).max() < 0.15
    far = Movement(dance.quats[:1], np.array([[4.0, 0.0, dance.hips_m[0, 2]]], np.float32), 30.0)
    assert len(seen(drawn(body, far, 0.0, COLOURS["teacher"]))) > 5000
    assert [Movement(quats, hips_m, 30.0, 1.0).frame(time_s) for time_s in (0.0, 1.5, 99.0)] == [0, 15, 89]


def test_what_is_nearer_hides_what_is_behind_it():
    """A triangle that faces the camera before a larger one that leans back, in both orders."""
    near_m, far_m = [[-0.3, -0.5, 0.5], [0.3, -0.5, 0.5], [0, -0.5, 1.1]], [[-0.5, 0.5, 0.4], [0.5, 0.5, 0.4], [0, 0.9, 1.4]]
    still = Movement(np.array([[[1.0, 0, 0, 0]]]), np.zeros((1, 3)), 30.0)
    for faces in ([[0, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]):
        body = TeacherBody(
            bone_names=np.array(["Hips"]), bone_parents=np.array([-1]), heads_m=np.zeros((1, 3)), t_pose=np.eye(3)[None],
            joints_m=np.zeros((15, 3)), vertices_m=np.array([*near_m, *far_m]), faces=np.array(faces),
            weight_bones=np.zeros((6, 4)), weights=np.tile([1.0, 0, 0, 0], (6, 1)),
        )  # fmt: skip
        shades = drawn(body, still, 0.0, np.full(3, 200.0))[[297, 410 - 190], [200, 200], 0]  # 0.7 m and 1.1 m high
        assert shades[0] == pytest.approx(200 * (AMBIENT - (1 - AMBIENT) * LIGHT[1]), abs=1) and shades[1] > shades[0] + 10


def test_a_damaged_or_endless_try_is_refused(library, tmp_path):
    dance = library.dance("dance_001")
    dance = replace(dance, about=replace(dance.about, seconds=900.0))
    for wrong in ({"course": None}, {"course": {"time_s": [1.0], "total": []}}, {"from_s": float("nan")}, {"to_s": 0.0}):
        told = f"up to {MOST_S:g} s" if "to_s" in wrong else "damaged"
        with pytest.raises(InputError, match=told):
            write_film(tmp_path / "film.mp4", library.body, dance, dance.performance, RESULT | wrong)
    assert not list(tmp_path.iterdir())


def films_at_work() -> list:
    return [one for one in multiprocessing.active_children() if one.name == "film"]


def left_over(teaching) -> list[str]:
    """What lies beside the tries."""
    return [path.name for path in teaching.tries.folder.rglob("*") if path.is_file() and path.suffix not in (".json", ".npz")]


async def begun(client, path: str):
    """The answer of a server that is making a film."""
    answer = await client.post(path)
    while json.loads(await answer.content.readline())["fraction"] == 0:
        pass
    return answer


@with_its_client
async def test_whoever_leaves_cancels_the_film_and_the_next_tells_how_far_it_is_and_is_kept(client, teaching, tried):
    long, short = (f"/api/tries/dance_001/{tried(*given)}" for given in ((45.0, 0.25), (1.0,)))
    assert "not made yet" in await client.refused(f"{short}.mp4")
    answer = await begun(client, f"{long}/film")
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"] and len(films_at_work()) == 1
    assert "another film is being made" in await client.told(f"{short}/film", method="POST")
    answer.close()
    until = time.monotonic() + SOON_S
    while films_at_work() and time.monotonic() < until:
        await asyncio.sleep(0.1)
    assert not films_at_work() and not left_over(teaching)
    made = await client.told(f"{short}/film", method="POST")
    told = [json.loads(line)["fraction"] for line in made.splitlines()]
    assert told == sorted(told) and told[0] < 1 and told[-1] == 1
    ready = await client.get(f"{short}.mp4")
    assert (await ready.read())[4:8] == b"ftyp" and "attachment" in ready.headers["Content-Disposition"]
    assert await client.told(f"{short}/film", method="POST") == '{"fraction": 1}\n'  # it is there
    assert not films_at_work()


@with_its_client
async def test_the_server_ends_although_a_film_is_being_made_and_a_page_is_open(client, teaching, tried):
    socket = await client.ws_connect("/live")
    await begun(client, f"/api/tries/dance_001/{tried(45.0, 0.25)}/film")
    began = time.monotonic()
    await client.server.close()
    assert time.monotonic() - began < 30 and not films_at_work() and not left_over(teaching)
    assert socket.closed or (await socket.receive()).type.name in ("CLOSE", "CLOSED", "CLOSING")


def test_what_goes_wrong_is_one_sentence(teaching, tried, monkeypatch):
    def told(name: str) -> str:
        ours, theirs = multiprocessing.Pipe()
        begins = threading.Thread(target=ours.send, args=((teaching.library, teaching.tries, "dance_001", name),))
        begins.start()  # more than a pipe holds
        make_film(theirs)
        begins.join()
        _, kind, content, _ = ours.recv()
        assert kind == "error" and not ours.poll()
        return content["text"]

    monkeypatch.setattr(film.os, "nice", lambda more: None)
    assert "damaged" in told(tried(1.0, speed=5.0))

    monkeypatch.setattr(film, "write_film", Mock(side_effect=OSError(errno.ENOSPC, "No space left on device")))
    assert told(tried(1.0)) == "the film could not be saved: No space left on device"

    def deleted_meanwhile(path, *_):
        path.write_bytes(b"a film")
        path.with_suffix(".json").unlink()

    monkeypatch.setattr(film, "write_film", deleted_meanwhile)
    assert "there is no such try" in told(tried(1.0)) and not left_over(teaching)


@pytest.mark.skipif(os.name != "posix", reason="a script of the shell stands in for Python")
def test_the_server_goes_on_while_the_process_of_a_film_starts(teaching, tried, monkeypatch, tmp_path):
    slow = tmp_path / "python"  # which reads nothing meanwhile
    slow.write_text(f"#!/bin/sh\nexec sleep {SOON_S}\n")
    slow.chmod(0o700)
    resource_tracker.ensure_running()  # by Python itself
    monkeypatch.setattr("multiprocessing.spawn._python_exe", os.fsencode(slow))
    films, name = Filming(teaching.library, teaching.tries), tried(1.0)

    async def begin() -> float:
        async with aclosing(films.make("dance_001", name)) as fractions:
            return await anext(fractions)

    signal.signal(signal.SIGALRM, Mock(side_effect=AssertionError("the server waits for it")))
    signal.alarm(SOON_S // 3)
    try:
        assert asyncio.run(begin()) == 0
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)


def test_a_process_that_cannot_be_started_or_dies_is_told(teaching, tried, monkeypatch):
    films, name = Filming(teaching.library, teaching.tries), tried(45.0, 0.25)

    async def make() -> None:
        async for fraction in films.make("dance_001", name):
            if fraction > 0:
                films_at_work()[0].kill()

    async def twice() -> None:
        with monkeypatch.context() as patched:
            patched.setattr("multiprocessing.context.SpawnProcess.start", Mock(side_effect=OSError("no more processes")))
            with pytest.raises(InputError, match="not finished"):
                await make()
        with pytest.raises(InputError, match="make it again"):  # it was begun: the one before bars no other
            await make()

    asyncio.run(asyncio.wait_for(twice(), PATIENCE_S))
