"""The server over HTTP and WebSocket, with friends and strangers."""

import asyncio
import io
import json
import random
import re
import struct
import threading
import time
from collections import Counter
from dataclasses import replace
from posixpath import dirname, normpath
from unittest.mock import Mock

import numpy as np
import pytest

aiohttp = pytest.importorskip("aiohttp", reason="the extra app is not installed")

from random_requests import SERVER_ERRORS, random_request, status_of  # noqa: E402
from teacher_page import english, frame_of, with_client, with_its_client  # noqa: E402
from yarl import URL  # noqa: E402

from kpopnet.dance.joint_files.reader import read_performance  # noqa: E402
from kpopnet.errors import InputError  # noqa: E402
from kpopnet.pose import PersonPose  # noqa: E402
from kpopnet.skeleton import Joint  # noqa: E402
from kpopnet.teacher import server  # noqa: E402
from kpopnet.teacher.live.loop import as_rows  # noqa: E402
from kpopnet.teacher.pages import MOST_PAGES  # noqa: E402
from kpopnet.teacher.safety import Keys, is_loopback  # noqa: E402
from kpopnet.teacher.server import MAX_MESSAGE_BYTES, MAX_UPLOAD_BYTES, LessonPage  # noqa: E402


@with_its_client
async def test_the_page_and_all_that_it_names_come_from_this_server(client, teaching):
    page = await client.get("/")
    assert page.status == 200 and "script-src 'self'" in page.headers["Content-Security-Policy"]
    seen, waiting = set(), [f"/page/{name}" for name in ("app.js", "style.css", "icon.svg", "beats_worker.js")]
    text = await page.text()
    assert all(path in text for path in waiting[:3])
    while waiting:
        path = waiting.pop()
        text = await client.told(path)
        assert len(text) > 200, path
        seen.add(path)
        if path.endswith(".js") and "three" not in path:
            named = {normpath(f"{dirname(path)}/{name}") for name in re.findall(r' from "(\..+?)"', text)}
            waiting += named - seen
    assert {"/languages/ko.mjs", "/page/stage.js", "/page/body.js", "/page/vendor/three.js", "/page/result.js"} <= seen


@with_its_client
async def test_dances_and_the_body_are_served(client, teaching):
    dances = await client.told("/api/dances")
    assert [one["identity"] for one in dances] == ["dance_001", "dance_002"]
    assert dances[0]["phrase_s"] == pytest.approx(8 * 60 / dances[0]["bpm"])
    assert len(await client.told("/api/dances/dance_001/preview")) == 40
    dance, body = [await client.told(path) for path in ("/api/dances/dance_001", "/api/body")]
    frames = round(dance["seconds"] * dance["fps"])
    assert len(dance["quats"]) == pytest.approx(frames * len(body["names"]) * 8 * 4 / 3, abs=4)
    assert (await client.told("/api/offer"))["sources"] == teaching.sources


def test_what_takes_long_of_a_long_dance_stops_no_lesson_of_another_page(teaching, tried, monkeypatch):
    name, threads = tried(2.0), {}
    of_server = [(server, name) for name in ("preview_cm", "moves_cm", "packed_movement")]
    for of, slow in (*of_server, (teaching.library, "dance")):
        given = getattr(of, slow)

        def noted(one, slow=slow, given=given):
            threads.setdefault(slow, set()).add(threading.current_thread())
            return given(one)

        monkeypatch.setattr(of, slow, noted)

    async def look(client) -> None:
        for path in ("dances/dance_001/preview", "dances/dance_001", f"tries/dance_001/{name}/movement"):
            await client.told(f"/api/{path}")
        socket = await client.ws_connect("/live")
        await socket.send_str(MESSAGES[-1])  # a lesson with a dancer who is not in the dance
        assert (await socket.receive_json())["kind"] == "error"

    with_client(teaching, look)
    assert len(threads) == 4 and threading.current_thread() not in set().union(*threads.values())


STRANGERS = (
    {"Host": "evil.example:80"},
    {"Host": ""},
    {"Host": "127.0.0.1.evil.example"},
    {"Host": "[::1"},
    {"Origin": "http://evil.example"},
    {"Origin": "null"},
    {"Origin": "http://127.0.0.1:1"},
    {"Sec-Fetch-Site": "cross-site"},
)


@with_its_client
async def test_strangers_get_nothing_and_its_own_page_is_none(client, teaching):
    for headers in STRANGERS:
        for path in ("/", "/api/dances", "/live", "/page/app.js", "/nothing"):
            answer = await client.get(path, headers=headers)
            assert answer.status == 403 and "default-src 'none'" in answer.headers["Content-Security-Policy"], headers
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await client.ws_connect("/live", headers=headers)
        await client.told("/api/dances?file=a.bvh", 403, "POST", data=b"x", headers=headers)
    own = {"Origin": f"http://127.0.0.1:{client.port}", "Sec-Fetch-Site": "same-origin"}
    await client.told("/api/dances", headers=own)
    await (await client.ws_connect("/live", headers=own)).close()


def test_other_machines_need_the_token(teaching):
    keys = Keys()
    (name, value), door = keys.cookie, f"/?token={keys.token}"

    async def work(client):
        for path in ("/", "/live", "/?token=wrong", "/?token=%C3%A4", f"/api/dances{door[1:]}"):
            await client.told(path, 403)
        for cookie in (f"{name}=wrong", f"{name}=\udcff\udcfe", f"{name}={keys.token}", f'{name}="\\303'):
            await client.told("/", 403, headers={"Cookie": cookie})
        await client.told(door, headers={"Host": "192.168.0.9:8471"})
        await client.told(door, 403, headers={"Host": "evil.example"})
        from_a_file = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}  # as this machine's browser is led here
        answer = await client.get(door, headers=from_a_file)
        cookie = answer.headers["Set-Cookie"]
        assert answer.status == 200 and "HttpOnly" in cookie and "SameSite=Strict" in cookie and keys.token not in cookie
        assert 'content="0;url=/"' in await answer.text()  # and so the token leaves the address
        await client.told("/api/dances", cookies={name: value})

    with_client(teaching, work, keys)


def test_only_this_machine_is_loopback():
    assert all(map(is_loopback, ("127.0.0.1", "127.3.2.1", "::1", "localhost")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "192.168.1.2", "localhost.evil.example", "127.0.0.1.evil.example")))


PATHS = (
    "/page/..%2f..%2f..%2fpyproject.toml",
    "/page/%2e%2e/server.py",
    "/page/vendor/../../server.py",
    "/api/dances/..%2f..%2f..%2fetc%2fpasswd",
    "/api/history/..%2fdances",
    "/api/tries/dance_001/..%2f..%2fdances%2fdance_001.json",
    "/api/tries/../body.npz/movement",
    "/api/tries/dance_001/20260101-000000-000.json",
    "/api/tries/dance_001/..%2f..%2fdances%2fdance_001/film",
    f"/api/dances/{'a' * 300}",
    f"/page/{'a' * 300}.js",
)


@with_its_client
async def test_paths_stay_in_their_folders_and_names_are_no_longer_than_files_have(client, teaching):
    for path in PATHS:
        ask = client.session.post if path.endswith("/film") else client.session.get
        answer = await ask(URL(f"http://127.0.0.1:{client.port}{path}", encoded=True))
        assert answer.status in (400, 404, 405), (path, await answer.text())


UPLOADS = (
    ("file=../../x.pkl", b"x", "a dance is a file that ends with"),
    ("file=dance.bvh", b"HIERARCHY\nnonsense", "line 2"),
    ("file=dance.npz", b"PK\x03\x04", "not a readable .npz"),
)


@with_its_client
async def test_uploads_at_once_get_names_of_their_own_and_broken_ones_a_clear_sentence(client, own, library):
    whole, performance = io.BytesIO(), library.dance("dance_001").performance
    np.savez(whole, joints_m=performance.joints_m.astype(np.float32), times_s=performance.times_s)
    asked = [client.told("/api/dances?file=my.npz&title=Mine", method="POST", data=whole.getvalue()) for _ in range(2)]
    assert {one["identity"] for one in await asyncio.gather(*asked)} == {"own_001", "own_002"}
    assert [(one["name"], one["own"]) for one in await client.told("/api/dances")] == [("Mine", True)] * 2
    for query, content, told in UPLOADS:
        message = await client.refused(f"/api/dances?{query}", method="POST", data=content)
        assert told in message and "/tmp" not in message, query
    large = io.BytesIO(bytes(MAX_UPLOAD_BYTES + 1))
    assert await client.refused("/api/dances?file=a.bvh", 413, "POST", data=large) == "the file is larger than 32 MB"


@with_its_client
async def test_a_dance_recorded_by_the_page_is_a_lesson_and_another_message_a_clear_sentence(client, own, library):
    danced, fps = library.dance("dance_001").joints_m[:180].copy(), library.dance("dance_001").fps
    poses = [PersonPose(1, joints_m.copy(), np.full(15, 0.9, np.float32)) for joints_m in danced]
    poses[5].joints_camera_m[Joint.LEFT_HAND], poses[5].confidence[Joint.LEFT_HAND] = np.nan, 0  # is missing
    frames = [{"time_s": number / fps, "joints": as_rows(pose)} for number, pose in enumerate(poses)]
    added = await client.told("/api/recordings?title=Mine&bpm=90", method="POST", json={"frames": frames})
    one = [0.0, 0.0, 2.0, 0.9]
    for sent, told in (
        ("[", "not valid JSON"),
        ('{"frames": []}', "images, found none"),
        ("{}", "frames"),
        ({"frames": [1]}, "frames"),
        ({"frames": [{"time_s": 0.0}]}, "joints"),
        ({"frames": [{"time_s": 0.0, "joints": [one] * 14}]}, "expected 15 joints"),
        ({"frames": [{"time_s": 0.0, "joints": [one[:3]] * 15}]}, "4 numbers"),
        ({"frames": [{"time_s": 0.0, "joints": [["x"] * 4] * 15}]}, "4 numbers"),
        ({"frames": [{"time_s": time_s, "joints": [one] * 15} for time_s in (0.0, 0.0)]}, "times must"),
        ({"frames": [{"time_s": time_s, "joints": [[None] * 4] * 15} for time_s in (0.0, 0.1)]}, "missing in every frame"),
        (
            {"frames": [*frames, {"time_s": 6.1, "joints": [[5e4, 0.0, 2.0, 0.9]] * 15}, frames[0] | {"time_s": 6.2}]},
            "within 1000 m",
        ),
    ):
        content = sent if isinstance(sent, str) else json.dumps(sent)
        assert told in await client.refused("/api/recordings", method="POST", data=content), told
    damaged = {"data": b"no archive", "headers": {"Content-Encoding": "gzip"}}
    assert await client.refused("/api/recordings", method="POST", **damaged) == "the file is damaged"
    dance = own.library.dance(added["identity"])
    assert dance.about.name == "Mine" and dance.about.bpm == 90 and 5.8 < dance.about.seconds < 6
    about_m = [joints_m - joints_m[:, [Joint.TORSO]] for joints_m in (dance.joints_m, danced[: len(dance.joints_m)])]
    assert np.argwhere(np.isnan(dance.joints_m[..., 0])).tolist() == [[5, Joint.LEFT_HAND]]
    assert np.nanmedian(np.linalg.norm(about_m[0] - about_m[1], axis=-1)) < 0.001


@with_its_client
async def test_a_broken_dance_is_shown_as_broken_and_leaves_the_others_alone(client, own, library):
    dance = library.dance("dance_001")
    own.library.write("whole", dance)
    path = own.library.path("whole")
    stored = dict(np.load(path))
    np.savez(path.with_stem("half"), **stored | {"about": np.array(str(stored["about"]).replace("name", "n\ud800"))})
    path.with_stem("cut").write_bytes(path.read_bytes()[:1000])
    cut, half, whole = await client.told("/api/dances")
    assert "half of a surrogate pair" in half["broken"] and "not a readable .npz" in cut["broken"]
    assert "broken" not in whole and whole["seconds"] == pytest.approx(dance.about.seconds)
    await client.refused("/api/dances/half")
    await client.told("/api/dances/whole")
    with pytest.raises(InputError, match=r"title: caf\\udce9: a name that is not UTF-8"):
        replace(dance.about, name="caf\udce9")


@with_its_client
async def test_windows_beyond_the_limit_are_told_so(client, teaching):
    sockets = [await client.ws_connect("/live") for _ in range(MOST_PAGES)]
    assert "close one of them" in await client.told("/live", 503)
    await client.told("/api/dances")
    await sockets[0].close()
    await (await client.ws_connect("/live")).close()


MESSAGES = (
    "x",
    "[]",
    '{"do": "fly"}',
    '{"do": "prepare"}',
    '{"do": "prepare", "lesson": {"dance": "../x"}}',
    '{"do": "prepare", "lesson": {"dance": "dance_001", "source": "/dev/video0"}}',
    '{"do": "go", "in_s": 1}',
    '{"do": "prepare", "lesson": {"dance": "dance_001", "speed": NaN}}',
    '{"do": "prepare", "lesson": {"dance": "dance_001", "from_s": 60}}',
    '{"do": "prepare", "lesson": {"dance": "dance_001", "dancer": 1}}',
)


@with_its_client
async def test_wrong_messages_are_answered_and_start_nothing(client, teaching):
    socket = await client.ws_connect("/live")
    for message in MESSAGES:
        await socket.send_str(message)
        assert (await socket.receive_json())["kind"] == "error", message
    await socket.send_str("x" * (MAX_MESSAGE_BYTES + 1))
    assert (await socket.receive()).type is aiohttp.WSMsgType.CLOSE


@with_its_client
async def test_the_server_goes_on_while_the_text_of_a_movement_is_written(client, teaching, tried, monkeypatch):
    asked, base = threading.Event(), f"/api/tries/dance_001/{tried(1.0)}"

    def waits(*_) -> str:
        assert asked.wait(20)
        return "HIERARCHY"

    monkeypatch.setattr("kpopnet.teacher.server.as_bvh", waits)
    writing = asyncio.create_task(client.told(f"{base}.bvh"))
    await asyncio.sleep(0.5)
    await client.told("/api/offer")
    asked.set()
    assert await writing == "HIERARCHY"


@with_its_client
async def test_saved_tries_are_listed_and_given_as_files_and_a_broken_one_is_left_out(client, teaching, tried, tmp_path):
    *names, broken = [tried(1.0, unseen=(Joint.LEFT_FOOT, Joint.RIGHT_FOOT)) for _ in range(3)]  # as before a webcam
    teaching.tries.path("dance_001", broken, "json").write_text("{")
    history = await client.told("/api/history/dance_001")
    assert [one["session"] for one in history] == sorted(names, reverse=True) and history[0]["total"] == 81.5
    base = f"/api/tries/dance_001/{names[0]}"
    assert (await client.told(f"{base}.json"))["session"] == names[0]
    assert (await client.told(f"{base}.csv")).split() == ["time_s,total,left_arm", "0.5,90.0,1.0", "1.5,,2.0"]
    moved = await client.told(f"{base}/movement")
    assert moved["begin_s"] == 0 and moved["fps"] == 30
    (tmp_path / "learner.bvh").write_text(await client.told(f"{base}.bvh"))
    assert len(read_performance(tmp_path / "learner.bvh")) == 59
    assert await client.told("/api/history/dance_002") == []


def test_a_history_reads_a_try_once_unless_it_changes_and_forgets_one_that_is_gone(teaching, tried, monkeypatch):
    tries, read = teaching.tries, []
    kept, changed, gone = (tried(2.0) for _ in range(3))
    result = tries.result
    monkeypatch.setattr(tries, "result", lambda dance, name: [read.append(name), result(dance, name)][1])
    assert [one["session"] for one in tries.history("dance_001")] == [gone, changed, kept] == read
    for suffix in ("json", "npz"):
        tries.path("dance_001", gone, suffix).unlink()
    tries.path("dance_001", changed, "json").write_text(
        json.dumps({"total": 3.0, "who": "", "phrases": [{"start_s": 0.0, "total": 3.0, "end_s": 4.0}]})
    )
    read.clear()
    first, second = tries.history("dance_001")
    assert (first["total"], first["phrases"], second["total"]) == (3.0, [{"start_s": 0.0, "total": 3.0}], 81.5)
    assert read == [changed] and "who" not in first and tries.history("dance_001", "p_00000000") == []


def test_a_try_whose_phrases_are_damaged_leaves_others_alone_and_can_be_deleted(teaching, tried):
    tries = teaching.tries
    for phrases in (None, 5, "ab", [1, {"start_s": 0.0}]):
        (damaged := tries.path("dance_001", tried(4.0), "json")).write_text(json.dumps({"who": "p_0", "phrases": phrases}))
        assert [name for _, name in tries.of("p_0")] == [damaged.stem]
        tries.remove("dance_001", damaged.stem)


async def hold(socket, lesson: dict, draws: bool = True) -> tuple[dict, list[dict], list[str]]:
    """Holds a lesson to its end, for a page that draws the frames, or that is stuck; its result, frames, and kinds of texts."""
    await socket.send_json({"do": "prepare", "lesson": lesson})
    frames, kinds = [], []
    while True:
        message = await socket.receive()
        if message.type is aiohttp.WSMsgType.BINARY:
            content, picture = frame_of(message.data)
            frames.append(content)
            width, height = struct.unpack_from("<HH", picture)
            assert len(picture) == 4 + width * height
            if draws:
                await socket.send_json({"do": "drawn", "page_ms": 1000 * time.time()})
            continue
        content = json.loads(message.data)
        kinds.append(content["kind"])
        if content["kind"] == "ready":
            await socket.send_json({"do": "go", "in_s": 0.2})
        elif content["kind"] in ("done", "error"):
            assert kinds[0] == "preparing" and content["kind"] == "done", (kinds, content)
            return content, frames, kinds


@with_its_client
async def test_lessons_are_held_watched_and_saved(client, teaching):
    """A simulated learner with a hanging arm, then one who stands still, on the same page; slowly, for slow machines."""
    lesson = {"dance": "dance_001", "to_s": 3.0, "speed": 0.5, "skill": "perfect"}
    socket = await client.ws_connect("/live")
    faulty, frames, _ = await hold(socket, lesson | {"fault": "left arm"})
    assert faulty["parts"]["left arm"] < 40 < min(faulty["parts"]["left leg"], faulty["parts"]["right leg"])
    assert faulty["worst"][0]["part"] == "left arm", faulty["worst"]
    assert any("left arm" in english(frame["words"]) for frame in frames) and len(frames[-1]["joints"]) == 15
    still, frames, kinds = await hold(socket, lesson | {"skill": "still", "to_s": 2.5}, draws=False)
    assert still["total"] < 20 and 1 <= len(frames) <= 2 and kinds.count("verdict") >= 1
    await socket.send_json({"do": "drawn", "page_ms": 7.0})
    late, _ = frame_of(await socket.receive_bytes())
    assert late["heard_ms"][0] == 7 and late["heard_ms"][1] <= late["sent_ms"] < late["taken_ms"] + 3000
    saved = await client.told(f"/api/tries/dance_001/{faulty['session']}.json")
    assert saved["total"] == faulty["total"] and saved["fault"] == "left arm"
    await socket.close()


@with_its_client
async def test_no_random_request_is_an_error_of_the_server(client, teaching, tried):
    """`python -m tests.soak.teacher --attack` sends more of them."""
    tried(1.0)
    rng, statuses = random.Random(0), Counter()
    for _ in range(8):
        sent = [random_request(rng) for _ in range(25)]
        answered = await asyncio.gather(*(status_of(client.port, raw) for raw in sent))
        assert not [(raw, status) for raw, status in zip(sent, answered, strict=True) if status in SERVER_ERRORS]
        statuses.update(answered)
    assert len(statuses) > 5 and await client.told("/api/dances")


@pytest.fixture
def told(teaching):
    """What a page is told of a lesson's last message, after these."""
    lessons = LessonPage(Mock(), teaching, Mock())

    async def last(messages: tuple) -> dict:
        return [await lessons.told(*message) for message in messages][-1]

    return lambda *messages: asyncio.run(last(messages))


DONE = {"dance": "dance_001", "who": "", "total": 80.0}


def test_each_learners_try_is_kept_and_the_firsts_names_the_others(teaching, told):
    arrays = {"joints_m": np.zeros((3, 15, 3)), "times_s": np.arange(3.0)}
    seen, unseen = ("member", DONE | {"total": 50.0}, arrays), ("member", {"total": None}, {})
    again = "preparing", {"fraction": 0.0, "text": ""}, None  # a try that was left between its messages has no part in the next
    done = told(seen, again, seen, unseen, ("done", DONE, arrays))
    (of_second, of_third) = teaching.tries.result("dance_001", done["session"])["members"]
    assert of_third == {"session": None, "total": None} and of_second["total"] == 50.0
    assert teaching.tries.result("dance_001", of_second["session"])["total"] == 50.0


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), OSError("it is gone")])
def test_a_try_that_cannot_be_saved_says_why_or_what_the_system_says(told, monkeypatch, error):
    monkeypatch.setattr("kpopnet.teacher.server.Profiles.keep", Mock(side_effect=error))
    text = told(("done", DONE, {}))["not_saved"]
    assert text == {"say": "this try could not be saved: {reason}", "reason": error.strerror or "it is gone"}
