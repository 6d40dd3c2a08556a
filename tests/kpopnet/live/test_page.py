"""The page of a live camera in a real browser: two people, by keys and buttons, unplugged, narrow, and after the program."""

import contextlib

import cv2
import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from functools import partial

from live_people import open_unsteady_recording, watched, write_recording
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait
from teacher_page import BROWSER, DRIVER, NARROW, chromium, resize, served

from kpopnet.sources import open_depth

if not (DRIVER and BROWSER):
    pytest.skip("no Chromium with its chromedriver on this machine", allow_module_level=True)

PATIENCE_S = 120
PINK, YELLOW = (238, 102, 119), (204, 187, 68)


def shows(driver, colours: tuple[tuple[int, int, int], ...]) -> bool:
    """Whether both panels show each of these hues; one picture, since taking one takes a while."""
    image = cv2.imdecode(np.frombuffer(driver.get_screenshot_as_png(), np.uint8), cv2.IMREAD_COLOR)
    pixels = cv2.cvtColor(image, cv2.COLOR_BGR2HSV).astype(int)
    hues = [int(cv2.cvtColor(np.uint8([[colour[::-1]]]), cv2.COLOR_BGR2HSV)[0, 0, 0]) for colour in colours]
    for name in ("depth", "room"):
        place = driver.find_element(By.ID, name).rect
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
        address = server.enter_context(served(watching))

        def until(condition):
            return WebDriverWait(driver, PATIENCE_S, 0.1).until(condition)

        def text(identity: str) -> str:
            return driver.find_element(By.ID, identity).text

        def press(key: str) -> None:
            ActionChains(driver).send_keys(key).perform()

        driver.get(address)
        until(lambda _: len(driver.find_elements(By.CSS_SELECTOR, "#people li")) == 2)
        assert "person 1: " in text("people") and "person 2: " in text("people")
        assert "ms from image to joints" in text("numbers")
        until(lambda _: shows(driver, (PINK, YELLOW)))

        press("r")
        until(lambda _: text("record").startswith("Stop recording ("))
        driver.find_element(By.ID, "joints").click()
        until(lambda _: text("joints").startswith("Save joints (") and "(0:00)" not in text("joints"))
        driver.find_element(By.ID, "record").click()
        press("j")
        until(lambda _: len(driver.find_elements(By.CSS_SELECTOR, "#said li")) == 2)
        assert "depth images of" in text("said") and "joints of" in text("said")
        (recording,) = (tmp_path / "kept").glob("*.h5")
        assert len(list(open_depth(recording))) > 5 and len(list((tmp_path / "kept").glob("*.npz"))) == 2

        press(" ")
        until(lambda _: text("pause") == "Go on" and text("told") == "paused")
        press(" ")
        until(lambda _: text("pause") == "Pause" and not text("told"))

        (tmp_path / "unplugged").touch()
        until(lambda _: text("told") == "plug the camera in")
        (tmp_path / "unplugged").unlink()
        until(lambda _: not text("told"))

        resize(driver, NARROW)
        until(lambda _: driver.execute_script("return window.innerWidth") == NARROW[0])
        assert driver.execute_script("return document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
        assert [line["message"] for line in driver.get_log("browser") if line["level"] == "SEVERE"] == []
        server.close()
        until(lambda _: "does not answer" in text("told"))
