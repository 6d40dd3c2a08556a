"""The page of `kpopnet rate` in a real browser: by keys and buttons, after a reload, on narrow screens."""

import cv2
import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from rated_sets import SKILLS_M, write_set
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from teacher_page import BROWSER, DRIVER, NARROW, chromium, resize, served

from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.dance_set import Dance, KpopSet, Learner
from kpopnet.datasets.dances.ratings import all_pairs, ratings_path, read_ratings
from kpopnet.teacher.rating import Rating

if not (DRIVER and BROWSER):
    pytest.skip("no Chromium with its chromedriver on this machine", allow_module_level=True)

PAIRS = 4
"""Of one dance with three learners; one pair is shown again."""


def drawn(canvas) -> np.ndarray:
    """What is drawn below the label of a panel: (H, W, 3) RGB."""
    image = cv2.imdecode(np.frombuffer(canvas.screenshot_as_png, np.uint8), cv2.IMREAD_COLOR)
    return cv2.cvtColor(image[60:], cv2.COLOR_BGR2RGB).astype(int)


def orange_pixels(image: np.ndarray) -> int:
    """Pixels of the right limbs."""
    return int((image[..., 0] - image[..., 2] > 60).sum())


def told(driver) -> str:
    return driver.find_element(By.ID, "told").text


def test_a_rater_answers_reloads_and_finishes(tmp_path):
    first = all_pairs({"dance_0": sorted(SKILLS_M)}, "eve 1", 0)[0]

    def joints(dance: Dance, learner: Learner) -> Performance:
        """Of the learner who is first shown on the left nothing is known but the head."""
        performance = learner.joints()
        performance.joints_m[:, 1:] = np.nan if learner.name == first.left else performance.joints_m[:, 1:]
        return performance

    rating = Rating(KpopSet(write_set(tmp_path, 1), ranked=False), 0, joints)

    def choices() -> list[str]:
        return [one.choice for one in read_ratings(ratings_path(tmp_path, "eve 1"), rating.learners)]

    with served(rating) as address, chromium() as driver:

        def until(condition):
            return WebDriverWait(driver, 120, 0.2).until(lambda _: condition())

        def press(key):
            ActionChains(driver).send_keys(key).perform()

        driver.get(address)
        until(lambda: driver.find_elements(By.ID, "name"))
        driver.find_element(By.ID, "name").send_keys("eve 1", Keys.ENTER)
        until(lambda: driver.find_elements(By.ID, "told") and told(driver).startswith(f"Pair 1 of {PAIRS}"))
        scrub = driver.find_element(By.ID, "scrub")
        until(lambda: float(scrub.get_attribute("value")) > 0.5)  # it plays
        play = driver.find_element(By.ID, "play")
        until(lambda: play.text == "Play")  # it is over
        press(Keys.SPACE)
        until(lambda: play.text == "Pause")
        until(lambda: play.text == "Play")
        left, teacher, right = driver.find_elements(By.CSS_SELECTOR, ".trio canvas")
        before = [drawn(canvas) for canvas in (left, teacher, right)]
        oranges = [orange_pixels(image) for image in before]
        assert oranges[0] == 0 < 200 < min(oranges[1:]) and (before[1] != before[2]).any(), oranges
        press("d")
        until(lambda: all((drawn(canvas) != old).any() for canvas, old in zip((left, teacher, right), before, strict=True)))
        press(Keys.ARROW_LEFT)
        until(lambda: told(driver).startswith("Pair 2"))
        assert choices() == ["left"]
        press(Keys.BACKSPACE)
        until(lambda: told(driver).startswith("Pair 1") and not driver.find_element(By.ID, "undo").is_enabled())
        assert choices() == []
        driver.find_element(By.ID, "right").click()
        until(lambda: told(driver).startswith("Pair 2"))
        press(Keys.ARROW_DOWN)
        until(lambda: told(driver).startswith("Pair 3"))
        driver.refresh()
        until(lambda: driver.find_elements(By.ID, "told") and told(driver).startswith("Pair 3"))
        resize(driver, NARROW)
        assert driver.execute_script("return document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
        assert all(one.rect["x"] + one.rect["width"] <= NARROW[0] for one in driver.find_elements(By.TAG_NAME, "button"))
        for number in (4, "over"):
            press(Keys.ARROW_RIGHT)
            until(lambda shown=f"Pair {number}": told(driver).startswith((shown, f"All {PAIRS} pairs are rated")))
        assert told(driver).startswith("All") and not driver.find_element(By.ID, "right").is_displayed()
        assert choices() == ["right", "equal", "right", "right"]
        assert [line["message"] for line in driver.get_log("browser") if line["level"] == "SEVERE"] == []
