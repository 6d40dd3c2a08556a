"""Lets the dance teacher hold lessons for a long time: its memory must stay flat.

    python -m tests.soak.teacher --minutes 30
    python -m tests.soak.teacher --minutes 60 --attack 30

`kpopnet teach` runs as a user starts it, with dances of its own in a temporary folder. A client does what its page does: it
prepares a lesson of a simulated learner, dances it twice, asks for the result, the replay and the history, and begins the next,
of another dance, skill and speed. Every minute a line shows the resident memory of the server and of all its processes, and how
many lessons were held. Memory does not depend on speed, so a busy machine will do. With `--attack N` strangers send N random
requests a second meanwhile (tests/helpers/random_requests.py) and, each minute, open more connections than are answered. Exit
code 1 if a lesson fails, a request is answered by an error of the server, the log is larger than 1 MB, or the memory of the
last tenth exceeds that of the second tenth by more than 5 % and 20 MB.
"""

import argparse
import asyncio
import itertools
import json
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from urllib.parse import urlsplit

import aiohttp
import numpy as np

from tests.helpers.random_requests import SERVER_ERRORS, random_request, status_of
from tests.helpers.teacher_page import started
from tests.soak.__main__ import resident_mb

SKILLS = ("perfect", "good", "worst", "still", "absent")
DANCES = 5
SPEEDS = (1.0, 0.5)
LESSON_S = 10.0


def children(pid: int) -> list[int]:
    """The processes that a process has started, and theirs."""
    try:
        own = [int(one) for path in Path(f"/proc/{pid}/task").glob("*/children") for one in path.read_text().split()]
    except OSError:
        return []
    return [*own, *(below for one in own for below in children(one))]


async def hold(client: aiohttp.ClientSession, socket: aiohttp.ClientWebSocketResponse, lesson: dict) -> dict:
    """One lesson, danced twice; the second result."""
    await socket.send_json({"do": "prepare", "lesson": lesson})
    tries = 0
    async for message in socket:
        if message.type is aiohttp.WSMsgType.BINARY:
            await socket.send_json({"do": "drawn", "page_ms": 1000 * time.time()})
        if message.type is not aiohttp.WSMsgType.TEXT:
            continue
        content, dance = json.loads(message.data), lesson["dance"]
        if content["kind"] == "error":
            raise RuntimeError(content["text"])
        tries += content["kind"] == "done"
        if content["kind"] == "done" and "session" in content:
            base = f"/api/tries/{dance}/{content['session']}"
            for path in (f"{base}.json", f"{base}/movement", f"/api/dances/{dance}", f"/api/history/{dance}"):
                await fetch(client, path)
        if tries == 2:
            return content
        if content["kind"] in ("ready", "done"):
            await socket.send_json({"do": "go", "in_s": 1.0})
    raise RuntimeError("the server closed the lesson")


async def fetch(client: aiohttp.ClientSession, path: str) -> None:
    """Reads an address, again where the server has too many connections: whoever looks at the page would load it again."""
    for patience in (*itertools.repeat(1.0, 10), 0.0):
        async with client.get(path) as answer:
            if answer.status != 503 or not patience:
                answer.raise_for_status()
                await answer.read()
                return
        await asyncio.sleep(patience)


MOST_LOG_BYTES = 1_000_000
THRONG, THRONG_S = 100, 2.0
"""Connections that are opened at once, and how long they stay."""


async def attack(port: int, rate: float, answered: Counter) -> None:
    """Sends random requests at a rate per second, and counts the answers by status."""
    rng, sending, next_throng = random.Random(0), set(), time.monotonic() + 30
    while True:
        raw = random_request(rng)
        task = asyncio.create_task(status_of(port, raw))
        task.add_done_callback(lambda done, raw=raw: done.cancelled() or _count(done.result(), raw, answered))
        sending.add(task)
        task.add_done_callback(sending.discard)
        await asyncio.sleep(1 / rate)
        if time.monotonic() > next_throng:
            next_throng += 60
            idle = await asyncio.gather(*(asyncio.open_connection("127.0.0.1", port) for _ in range(THRONG)))
            await asyncio.sleep(THRONG_S)
            for _, writer in idle:
                writer.transport.abort()


def _count(status: int, raw: bytes, answered: Counter) -> None:
    answered[status] += 1
    if status in SERVER_ERRORS:
        print(f"answered by {status}: {raw!r}", flush=True)


async def soak(address: str, pid: int, minutes: int, rate: float) -> bool:
    """Holds lessons; whether the memory grew, or a stranger got an error of the server."""
    measured, totals = [], []

    async def lessons() -> None:
        async with aiohttp.ClientSession(address) as client, client.ws_connect("/live", max_msg_size=0) as socket:
            for number, skill, speed in zip(itertools.count(), itertools.cycle(SKILLS), itertools.cycle(SPEEDS), strict=False):
                lesson = {"dance": f"dance_{number % DANCES:03d}", "skill": skill, "speed": speed, "to_s": LESSON_S}
                totals.append((await hold(client, socket, lesson))["total"])

    answered: Counter = Counter()
    port = urlsplit(address).port or 0
    attacking = asyncio.create_task(attack(port, rate, answered)) if rate else None
    holding, began = asyncio.create_task(lessons()), time.monotonic()
    for minute in range(1, minutes + 1):
        await asyncio.wait([holding], timeout=began + 60 * minute - time.monotonic())
        for task in filter(None, (holding, attacking)):
            if task.done():
                task.result()
        server_mb = resident_mb(pid)
        measured.append((server_mb, server_mb + sum(map(resident_mb, children(pid)))))
        told = f"server {measured[-1][0]:7.1f} MB, all processes {measured[-1][1]:7.1f} MB, {len(totals)} lessons"
        told += f", {answered.total():,} requests" if rate else ""
        print(f"minute {minute:3}: {told}, the last scores {totals[-len(SKILLS) :]}", flush=True)
    holding.cancel()
    tenth = max(minutes // 10, 1)
    early_mb, late_mb = (np.median(part, axis=0) for part in (measured[tenth : 2 * tenth] or measured, measured[-tenth:]))
    print(f"server and all processes: {early_mb.round(1)} MB early, {late_mb.round(1)} MB late")
    if rate:
        print(f"answers to strangers: {dict(sorted(answered.items()))}")
    return bool(SERVER_ERRORS & set(answered)) or bool(((late_mb > 1.05 * early_mb) & (late_mb > early_mb + 20)).any())


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("python -m tests.soak.teacher", description=__doc__, formatter_class=form)
    parser.add_argument("--minutes", type=int, default=30, help="%(default)s")
    parser.add_argument("--checkpoint", help="as of kpopnet teach; by default the network of the package")
    parser.add_argument("--port", type=int, default=8479, help="%(default)s")
    parser.add_argument("--attack", type=float, default=0, help="random requests a second: %(default)s")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        words = ["kpopnet.programs.teach", "--no-browser", "--data", folder, "--port", given.port]
        words += ["--checkpoint", given.checkpoint] if given.checkpoint else []
        log = Path(folder) / "log.txt"
        with log.open("w") as errors, started(*words, errors=errors) as (address, pid):
            grew = asyncio.run(soak(address, pid, given.minutes, given.attack))
        told = log.read_text(errors="replace")
        print(f"its log: {len(told.encode()):,} bytes\n{told[-2000:]}")
    sys.exit(grew or len(told.encode()) > MOST_LOG_BYTES)


if __name__ == "__main__":
    main()
