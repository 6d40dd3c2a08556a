"""Where the local servers listen, how they open a browser, how many they let in, and how they end."""

import contextlib
import logging
import os
import re
import signal
import socket
import stat
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from programs import ROOT, ended

pytest.importorskip("aiohttp", reason="the extra app is not installed")

SERVER = """
import argparse, asyncio, json, os, resource, sys, time
from kpopnet.teacher.hosting import host, page_app
host_name, files, opened = sys.argv[1], int(sys.argv[2]), sys.argv[3]
resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))
import webbrowser
def browse(address):
    open(opened, "w").write(address)
    time.sleep(60)
webbrowser.open = browse
def make(hosts, keys):
    app = page_app("rate.html", hosts, keys, 1000)
    async def long(request):
        await asyncio.to_thread(time.sleep, 60)
    app.router.add_get("/long", long)
    return app
host(make, argparse.Namespace(host=host_name, port=0, no_browser=False), "look at")
"""


@contextlib.contextmanager
def running(*words: object) -> Iterator[subprocess.Popen]:
    """Python with these words, which is killed with the context."""
    command, pipe = [sys.executable, *map(str, words)], subprocess.PIPE
    with subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


@contextlib.contextmanager
def hosting(opened: Path, host: str = "127.0.0.1", files: int = 128) -> Iterator[tuple[subprocess.Popen, str]]:
    """A server of a page in a process of its own, which may open this number of files; the process and its address."""
    with running("-c", SERVER, host, files, opened) as process:
        address = process.stdout.readline().split()[2]
        while not (opened.exists() and opened.read_text()):
            time.sleep(0.01)
        yield process, address


def get(address: str, cookie: str = "") -> tuple[int, str, str]:
    """Status, text and cookie of an answer."""
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers={"Cookie": cookie}), timeout=30) as answer:
            return answer.status, answer.read().decode(), answer.headers.get("Set-Cookie", "")
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode(), ""


HEADERS = {b"Expect: more\r\n": 417, b"Expect: \xff\r\n": 400, b"Connection: \xff\r\nUpgrade: websocket\r\n": 400}
"""What would be repeated in an answer, and the status instead."""


def test_a_free_port_is_opened_odd_headers_are_refused_and_it_ends_whatever_its_threads_do(tmp_path):
    with hosting(tmp_path / "opened") as (process, address):
        place = "127.0.0.1", urlsplit(address).port
        assert get(address)[0] == 200 and (tmp_path / "opened").read_text() == address
        for header, status in HEADERS.items():
            with socket.create_connection(place) as stranger:
                stranger.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + header + b"\r\n")
                assert stranger.recv(4096).startswith(b"HTTP/1.1 %d " % status)
        with socket.create_connection(place) as waiting:
            waiting.sendall(b"GET /long HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            process.send_signal(signal.SIGINT)
            assert process.wait(30) == 0 and process.stderr.read() == ""


def test_a_host_that_is_no_address_of_this_machine_is_told_so(tmp_path):
    for name in ("no-such-host.invalid", "192.0.2.1"):  # a name, and an address that documents use
        with running("-c", SERVER, name, 128, tmp_path / "opened") as process:
            assert f"--host {name}: no address of this machine (" in process.stderr.read()


def test_a_secret_reaches_the_browser_in_a_file_that_only_its_user_reads(tmp_path):
    with hosting(tmp_path / "opened", host="0.0.0.0") as (process, address):
        given = (tmp_path / "opened").read_text()
        assert given.startswith("file:///")
        page = Path(unquote(urlsplit(given).path))
        assert stat.S_IMODE(page.parent.stat().st_mode) == 0o700
        inside = re.search(r"url=(http://\S+)\"", page.read_text()).group(1)
        token = urlsplit(inside).query.removeprefix("token=")
        assert token and token not in given and token not in address
        assert get(address.partition("?")[0])[0] == 403
        status, _, cookie = get(inside)
        assert status == 200 and get(address.partition("?")[0], cookie.partition(";")[0])[0] == 200
        assert get(inside)[0] == 403 and get(address)[0] == 200  # the printed one is for other machines
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0 and not page.parent.exists()


def has_ipv6() -> bool:
    """Whether a server of this machine can be reached at ::1."""
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        return False
    return True


@pytest.mark.skipif(not has_ipv6(), reason="this machine has no IPv6")
def test_a_server_of_all_addresses_of_ipv6_prints_one_that_it_answers(tmp_path):
    with hosting(tmp_path / "opened", host="::") as (_, address):
        assert address.startswith("http://[::1]:") and get(address)[0] == 200


def test_too_many_connections_are_told_so_and_fill_no_log(tmp_path):
    with hosting(tmp_path / "opened") as (process, address):
        place = "127.0.0.1", urlsplit(address).port
        with contextlib.ExitStack() as stack:
            for _ in range(120):
                stack.enter_context(socket.create_connection(place))
            status = 0
            while not status:  # in the throng itself some are cut off
                with contextlib.suppress(ConnectionResetError):
                    status, told, _ = get(address)
            assert status == 503 and "close other windows" in told
        while get(address)[0] != 200:
            time.sleep(0.1)
        process.send_signal(signal.SIGTERM)
        assert process.stderr.read() == ""


def test_each_error_is_told_once_and_none_of_a_page_that_has_gone():
    """asyncio's loop on Windows makes an error of each: https://github.com/python/cpython/issues/83191."""
    from kpopnet.teacher.hosting import _Once

    once, gone = _Once(), "Exception in callback _ProactorBasePipeTransport._call_connection_lost(None)"
    for error, told in ((ConnectionResetError(10054, "closed"), (False, False)), (ValueError("odd"), (True, False))):
        record = logging.LogRecord("", logging.ERROR, "", 0, gone, None, (type(error), error, None))
        assert (once.filter(record), once.filter(record)) == told


STARTING = """
import argparse, asyncio
from aiohttp import web
from kpopnet.teacher.hosting import host
async def opens_a_camera(app):
    print("opening", flush=True)
    try:
        await asyncio.sleep(60)
        yield
    finally:
        print("closed", flush=True)
def make(hosts, keys):
    app = web.Application()
    app.cleanup_ctx.append(opens_a_camera)
    return app
host(make, argparse.Namespace(host="127.0.0.1", port=0, no_browser=True), "look at")
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])  # Ctrl-C, a terminal that is closed
def test_it_ends_while_it_starts(name):
    with running("-c", STARTING) as one:
        assert one.stdout.readline() == "opening\n"
        one.send_signal(getattr(signal, name))
        assert one.wait(30) == 0 and one.stderr.read() == "" and one.stdout.read() == "closed\n"


def test_under_nohup_a_terminal_that_is_closed_does_not_end_it():
    with running("-c", "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)" + STARTING) as one:
        assert one.stdout.readline() == "opening\n"
        one.send_signal(signal.SIGHUP)
        with pytest.raises(subprocess.TimeoutExpired):
            one.wait(1)


LESSONS = """
import asyncio, sys
from kpopnet.teacher.live import process
async def main():
    both = [process.LessonProcesses(None, "tracker") for _ in range(2)]
    for one in both:
        one.keep_ready()
    print(*(one._idle[0]._process.pid for one in both), flush=True)
    await asyncio.to_thread(sys.stdin.readline)
    await asyncio.to_thread(both[0].end)
    print("ended", flush=True)
    await asyncio.to_thread(sys.stdin.readline)
if __name__ == "__main__":
    asyncio.run(main())
"""


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_no_process_of_a_lesson_stays_frozen_or_after_a_kill_of_the_server(tmp_path):
    (tmp_path / "lessons.py").write_text(LESSONS)
    with running(tmp_path / "lessons.py") as process:
        frozen, other = map(int, process.stdout.readline().split())
        os.kill(frozen, signal.SIGSTOP)
        process.stdin.write("end\n")
        process.stdin.flush()
        assert process.stdout.readline() == "ended\n" and ended(frozen)
        process.kill()
    assert ended(other)
