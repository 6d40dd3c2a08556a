"""The page of `kpopnet rate` in a real browser: by keys and buttons, after a reload, on narrow screens."""

import re

import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from rated_sets import write_set
from selenium.webdriver.common.keys import Keys
from teacher_page import NARROW, chromium, served, skip_without_browser

from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.datasets.dances.ratings import ratings_path, read_ratings
from kpopnet.teacher.rating import Rating

skip_without_browser()

PAIRS = 4
"""Of one dance with three learners; one pair is shown again."""


def test_a_rater_answers_reloads_and_finishes(tmp_path):
    rating = Rating(KpopSet(write_set(tmp_path, 1), ranked=False), 0, lambda dance, learner: learner.joints())

    def choices() -> list[str]:
        return [one.choice for one in read_ratings(ratings_path(tmp_path, "eve 1"), rating.learners)]

    with served(rating) as address, chromium() as driver:

        def press(key: str) -> None:
            driver.find("body").send_keys(key)

        driver.get(f"{address}?lang=ko")
        driver.find("#name")
        assert driver.execute_script("return document.documentElement.lang") == "en"  # as its texts are
        driver.find("#name").send_keys("eve 1", Keys.ENTER)
        driver.reads("#told", f"Pair 1 of {PAIRS}")
        driver.until(lambda one: float(one.find("#scrub").get_attribute("value")) > 0.5)  # it plays
        driver.reads("#play", "Play")  # it is over
        for told in ("Pause", "Play"):
            press(Keys.SPACE)
            driver.reads("#play", told)
        canvases = driver.all(".trio canvas")
        before = [canvas.screenshot_as_base64 for canvas in canvases]
        assert len(set(before)) == 3  # each dances otherwise
        for selector, key in (("#scrub", Keys.HOME), ("#speed", Keys.ARROW_UP)):  # no answers, though arrows follow
            driver.execute_script(f"document.querySelector('{selector}').focus()")
            for one in (key, Keys.ARROW_RIGHT, Keys.ARROW_DOWN):
                driver.switch_to.active_element.send_keys(one)
        assert choices() == [] and driver.switch_to.active_element.get_attribute("id") == "speed"
        assert re.fullmatch(r"0:0\d of 0:0\d", driver.find("#scrub").get_attribute("aria-valuetext"))
        driver.find("#scrub").click()  # the mouse gives the keys back
        assert driver.switch_to.active_element.tag_name == "body"
        press("d")
        driver.until(lambda _: all(one.screenshot_as_base64 != old for one, old in zip(canvases, before, strict=True)))
        press(Keys.ARROW_LEFT)
        driver.reads("#told", "Pair 2")
        assert choices() == ["left"]
        press(Keys.BACKSPACE)
        driver.reads("#told", "Pair 1")
        driver.until(lambda one: not one.find("#undo").is_enabled())
        assert choices() == []
        driver.find("#right").click()
        driver.reads("#told", "Pair 2")
        press(Keys.ARROW_DOWN)
        driver.reads("#told", "Pair 3")
        driver.refresh()
        driver.reads("#told", "Pair 3")
        driver.resize(NARROW)
        assert driver.overflow_px <= 0
        assert all(one.rect["x"] + one.rect["width"] <= NARROW[0] for one in driver.all("button"))
        for told in ("Pair 4", f"All {PAIRS} pairs are rated"):
            press(Keys.ARROW_RIGHT)
            driver.reads("#told", told)
        assert not driver.find("#right").is_displayed()
        assert choices() == ["right", "equal", "right", "right"] and driver.severe() == []
