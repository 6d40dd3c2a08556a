"""The page of `kpopnet rate` in a real browser: by keys and buttons, after a reload, on narrow screens."""

import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from rated_sets import write_set
from selenium.webdriver.common.keys import Keys
from teacher_page import NARROW, chromium, find, overflow_px, reads, resize, served, severe, skip_without_browser, until

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
            find(driver, "body").send_keys(key)

        driver.get(address)
        find(driver, "#name").send_keys("eve 1", Keys.ENTER)
        reads(driver, "#told", f"Pair 1 of {PAIRS}")
        until(driver, lambda one: float(find(one, "#scrub").get_attribute("value")) > 0.5)  # it plays
        reads(driver, "#play", "Play")  # it is over
        for told in ("Pause", "Play"):
            press(Keys.SPACE)
            reads(driver, "#play", told)
        canvases = driver.find_elements("css selector", ".trio canvas")
        before = [canvas.screenshot_as_base64 for canvas in canvases]
        assert len(set(before)) == 3  # each dances otherwise
        press("d")
        until(driver, lambda _: all(one.screenshot_as_base64 != old for one, old in zip(canvases, before, strict=True)))
        press(Keys.ARROW_LEFT)
        reads(driver, "#told", "Pair 2")
        assert choices() == ["left"]
        press(Keys.BACKSPACE)
        reads(driver, "#told", "Pair 1")
        until(driver, lambda one: not find(one, "#undo").is_enabled())
        assert choices() == []
        find(driver, "#right").click()
        reads(driver, "#told", "Pair 2")
        press(Keys.ARROW_DOWN)
        reads(driver, "#told", "Pair 3")
        driver.refresh()
        reads(driver, "#told", "Pair 3")
        resize(driver, NARROW)
        assert overflow_px(driver) <= 0
        assert all(one.rect["x"] + one.rect["width"] <= NARROW[0] for one in driver.find_elements("tag name", "button"))
        for told in ("Pair 4", f"All {PAIRS} pairs are rated"):
            press(Keys.ARROW_RIGHT)
            reads(driver, "#told", told)
        assert not find(driver, "#right").is_displayed()
        assert choices() == ["right", "equal", "right", "right"] and severe(driver) == []
