"""The page of a live camera in a real browser: two people, by keys and buttons, unplugged, narrow, and after the program."""

import contextlib
import re

import cv2
import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")

from functools import partial

from live_people import open_unsteady_recording, watched, write_recording
from teacher_page import NARROW, chromium, served, skip_without_browser

from kpopnet.sources import open_depth

skip_without_browser()

PINK, YELLOW = (238, 102, 119), (204, 187, 68)


def shows(driver, colours: tuple[tuple[int, int, int], ...]) -> bool:
    """Whether both panels show each of these hues; one picture, since taking one takes a while."""
    image = cv2.imdecode(np.frombuffer(driver.get_screenshot_as_png(), np.uint8), cv2.IMREAD_COLOR)
    pixels = cv2.cvtColor(image, cv2.COLOR_BGR2HSV).astype(int)
    hues = [int(cv2.cvtColor(np.uint8([[colour[::-1]]]), cv2.COLOR_BGR2HSV)[0, 0, 0]) for colour in colours]
    for name in ("depth", "room"):
        place = driver.find(f"#{name}").rect
        top, left = int(place["y"]), int(place["x"])
        panel = pixels[top : top + int(place["height"]), left : left + int(place["width"])]
        for hue in hues:
            away = np.abs(panel[..., 0] - hue)
            if ((np.minimum(away, 180 - away) < 8) & (panel[..., 1] > 90)).mean() < 0.002:
                return False
    return True


def test_two_people_are_seen_recorded_paused_and_lost_and_the_end_of_the_program_is_told(tmp_path):
    write_recording(tmp_path)
    watching = watched(tmp_path, open_camera=partial(open_unsteady_recording, tmp_path))
    with contextlib.ExitStack() as server, chromium() as driver:
        driver.get(server.enter_context(served(watching)) + "?lang=ko")
        driver.until(lambda one: one.execute_script("return document.documentElement.lang") == "en")  # as its texts are
        driver.until(lambda one: len(one.all("#people li")) == 2)
        driver.reads("#people", "person 1: ")
        driver.reads("#people", "person 2: ")
        driver.reads("#numbers", "ms from image to joints")
        driver.until(lambda one: shows(one, (PINK, YELLOW)))

        body = driver.find("body")
        body.send_keys("r")
        driver.reads("#record", "Stop recording (")
        assert driver.find("#record").accessible_name == "Stop recording"
        assert driver.find("#depth").aria_role in ("img", "image")
        driver.find("#joints").click()
        driver.until(lambda one: re.match(r"Save joints \((?!0:00)", one.find("#joints").text))
        driver.find("#record").click()
        body.send_keys("j")
        driver.until(lambda one: len(one.all("#said li")) == 2)
        driver.reads("#said", "depth images of")
        driver.reads("#said", "joints of")
        assert driver.find("#said").aria_role == "list" and driver.all("[role=log] #said")
        (recording,) = (tmp_path / "kept").glob("*.h5")
        assert len(list(open_depth(recording))) > 5 and len(list((tmp_path / "kept").glob("*.npz"))) == 2

        for button, told in (("Go on", "paused"), ("Pause", "")):
            body.send_keys(" ")
            driver.until(lambda one, wanted=(button, told): (one.find("#pause").text, one.find("#told").text) == wanted)
        (tmp_path / "unplugged").touch()
        driver.reads("#told", "plug the camera in")
        (tmp_path / "unplugged").unlink()
        driver.until(lambda one: not one.find("#told").text)

        driver.resize(NARROW)
        driver.until(lambda one: one.execute_script("return window.innerWidth") == NARROW[0])
        assert driver.overflow_px <= 0 and driver.severe() == []
        server.close()
        driver.reads("#told", "does not answer")
