"""The server of the dance teacher, of raters, or of a live camera, in a thread, and a real browser for its page."""

import asyncio
import contextlib
import functools
import importlib.util
import inspect
import json
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from kpopnet.languages import Said
from kpopnet.live.loop import Watching
from kpopnet.live.server import make_watch_app
from kpopnet.sources.source import CameraAwayError, LiveCamera
from kpopnet.teacher.rating import Rating, make_rating_app
from kpopnet.teacher.safety import LOOPBACK_NAMES, Keys
from kpopnet.teacher.server import Teaching, make_app

DRIVER, BROWSER = shutil.which("chromedriver"), shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = ("headless=new", "lang=en-US", "no-sandbox", "disable-dev-shm-usage", "enable-unsafe-swiftshader")
FAKE_WEBCAM = ("use-fake-device-for-media-stream", "use-fake-ui-for-media-stream")
WIDE, NARROW = (1280, 900), (400, 860)
PATIENCE_S = 480
"""Where nothing is cached yet, kernels are compiled first, beside other tests."""


MAKERS = {Teaching: make_app, Rating: make_rating_app, Watching: make_watch_app}
Shown = Teaching | Rating | Watching


def app_of(shown: Shown, keys: Keys | None = None) -> web.Application:
    """The application that serves it."""
    return MAKERS[type(shown)](shown, LOOPBACK_NAMES, keys)


class Visitor(TestClient):
    """A client of a server."""

    async def told(self, path: str, status: int = 200, method: str = "GET", **given: Any) -> Any:
        """What an address answers, which must be with this status: the content of JSON, in English, or a text."""
        answer = await self.request(method, path, **given)
        assert answer.status == status, (path, await answer.text())
        return english(await answer.json()) if answer.content_type == "application/json" else await answer.text()

    async def refused(self, path: str, status: int = 400, method: str = "GET", **given: Any) -> str:
        """Of which mistake an address tells, in one line."""
        told = (await self.told(path, status, method, **given))["error"]
        assert "\n" not in told
        return told


def with_client(shown: Shown, work, keys: Keys | None = None):
    """Runs a coroutine function that gets a client of a server of its own."""

    async def run():
        async with Visitor(TestServer(app_of(shown, keys))) as client:
            return await asyncio.wait_for(work(client), PATIENCE_S)

    return asyncio.run(run())


def with_its_client(test: Callable[..., Any]) -> Callable[..., None]:
    """Lets a coroutine function be a test: it gets a client of a server of the first of its other arguments."""

    @functools.wraps(test)
    def run(**given: Any) -> None:
        with_client(next(one for one in given.values() if isinstance(one, Shown)), functools.partial(test, **given))

    signature = inspect.signature(test)
    run.__signature__ = signature.replace(parameters=list(signature.parameters.values())[1:])  # pyright: ignore
    return run


def frame_of(data: bytes) -> tuple[dict, bytes]:
    """What a page is told of an image, and its picture."""
    end = 4 + int.from_bytes(data[:4], "little")
    return json.loads(data[4:end]), data[end:]


def english(told: dict | list | str | float):
    """What a page is told, see `kpopnet.languages.keyed`, in English."""
    if isinstance(told, dict):
        template, values = told.get("say"), {name: english(value) for name, value in told.items() if name != "say"}
        return Said(template, **values) if template else values
    return [english(one) for one in told] if isinstance(told, list) else told


@contextlib.contextmanager
def served(shown: Shown) -> Iterator[str]:
    """A server in a thread of its own; its address."""
    loop, ready, port = asyncio.new_event_loop(), threading.Event(), []

    async def start() -> web.AppRunner:
        runner = web.AppRunner(app_of(shown))
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        port.append(runner.addresses[0][1])
        ready.set()
        return runner

    def run() -> None:
        asyncio.set_event_loop(loop)
        runner = loop.run_until_complete(start())
        loop.run_forever()
        loop.run_until_complete(runner.cleanup())
        loop.close()

    thread = threading.Thread(target=run)
    thread.start()
    assert ready.wait(PATIENCE_S)
    try:
        yield f"http://127.0.0.1:{port[0]}/"
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join(PATIENCE_S)


@contextlib.contextmanager
def started(*words: object, errors: IO | None = None) -> Iterator[tuple[str, int]]:
    """`python -m` with these words, a program that serves a page: its address and process, which is ended with the context."""
    command = [sys.executable, "-m", *map(str, words)]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
    try:
        address = re.search(r"http://\S+", program.stdout.readline())
        if address is None:
            sys.exit(f"{words[0]} did not start")
        yield address[0], program.pid
    finally:
        program.terminate()
        program.wait(60)


class Browser:
    """Selenium's driver of Chromium, with what tests do to a page."""

    def __init__(self, driver) -> None:
        self._driver = driver

    def __getattr__(self, name: str) -> Any:
        return getattr(self._driver, name)

    def until(self, condition: Callable[["Browser"], Any]) -> Any:
        """Waits until a condition gives something true; that. An element that was replaced meanwhile is looked for again."""
        from selenium.common.exceptions import StaleElementReferenceException
        from selenium.webdriver.support.ui import WebDriverWait

        return WebDriverWait(self, PATIENCE_S, 0.1, [StaleElementReferenceException]).until(condition)

    def all(self, selector: str) -> list:
        """The elements of a CSS selector."""
        return self._driver.find_elements("css selector", selector)

    def find(self, selector: str):
        """The first of them, as soon as there is one."""
        return self.until(lambda _: self.all(selector))[0]

    def reads(self, selector: str, text: str) -> None:
        """Waits until an element holds a text."""
        self.until(lambda _: text in self.find(selector).text)

    def resize(self, size: tuple[int, int]) -> None:
        """Gives the page this width and height in pixels."""
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self._driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    @property
    def overflow_px(self) -> int:
        """By how much the page is wider than the window."""
        return self._driver.execute_script("const page = document.documentElement; return page.scrollWidth - page.clientWidth")

    @property
    def loaded(self) -> list[str]:
        """The addresses that the page has loaded."""
        return self._driver.execute_script("return performance.getEntriesByType('resource').map((one) => one.name)")

    def severe(self) -> list[str]:
        """The errors in the log since it was asked for last."""
        return [line["message"] for line in self._driver.get_log("browser") if line["level"] == "SEVERE"]


@contextlib.contextmanager
def chromium(size: tuple[int, int] = WIDE, webcam: Path | None = None) -> Iterator[Browser]:
    """A headless Chromium with a window of this width and height in pixels; needs selenium, `DRIVER` and `BROWSER`.

    A film `webcam` (.mjpeg or .y4m) is played, again and again, as its webcam, which every page may use.
    """
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    film = () if webcam is None else (*FAKE_WEBCAM, f"use-file-for-fake-video-capture={webcam}")
    for flag in (*FLAGS, *film):
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = Browser(webdriver.Chrome(options=options, service=Service(DRIVER)))
    try:
        browser.resize(size)
        yield browser
    finally:
        with contextlib.suppress(Exception):
            browser.quit()


def skip_without_browser() -> None:
    """Skips the tests of a module where there is no Chromium, or what drives it."""
    if not (DRIVER and BROWSER and importlib.util.find_spec("selenium")):
        pytest.skip("no Chromium with its chromedriver, or no selenium, on this machine", allow_module_level=True)


class UnsteadyCamera:
    """A camera that is unplugged while a file exists; a `LiveCamera`."""

    def __init__(self, unplugged: Path, camera: LiveCamera) -> None:
        self.camera, self._unplugged, self._source = camera.camera, unplugged, camera

    def read(self) -> tuple[np.ndarray, float] | None:
        """See `LiveCamera.read`."""
        if self._unplugged.exists():
            time.sleep(0.2)
            raise CameraAwayError("plug the camera in")
        return self._source.read()

    def close(self) -> None:
        self._source.close()
