"""The page in a real browser: pick a dance, dance it, look at the verdict, practise; narrow screens; two tabs; a reload."""

import re
import time
import wave
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from dance_learners import arm_lowered

pytest.importorskip("aiohttp", reason="the extra app is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from teacher_page import BROWSER, DRIVER, NARROW, STAMP_BITS, STAMP_PX, chromium, open_stamped, open_unsteady, resize, served

from kpopnet.dance.feedback import feedback
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from kpopnet.sources.live import Image
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.score import DanceTry
from kpopnet.teacher.result_page import result_page

if not (DRIVER and BROWSER):
    pytest.skip("no Chromium with its chromedriver on this machine", allow_module_level=True)

PATIENCE_S = 300


@pytest.fixture
def address(teaching):
    with served(teaching) as found:
        yield found


@pytest.fixture
def browser():
    with chromium() as driver:
        yield driver
        severe = [line["message"] for line in driver.get_log("browser") if line["level"] == "SEVERE"]
    assert [message for message in severe if "/api/dances/none " not in message] == []  # a test asks for it


def until(driver, condition):
    return WebDriverWait(driver, PATIENCE_S, 0.2).until(condition)


def find(driver, selector):
    return until(driver, lambda one: one.find_elements(By.CSS_SELECTOR, selector))[0]


RECORDER = """
window.told = [[], [], []];
const value = (part) => Number(document.querySelector(`li[data-part="${part}"]`).dataset.value || NaN);
const note = () => {
  told[0].push(document.getElementById("words").textContent);
  if (!isNaN(value("left arm"))) { told[1].push(value("left arm")); told[2].push(value("left leg")); }
};
new MutationObserver(note).observe(document.getElementById("words"), { childList: true, characterData: true, subtree: true });
"""
"""Notes what the page tells during the dance: words, and the scores of left arm and left leg."""


def overflow_px(driver) -> int:
    return driver.execute_script("return document.documentElement.scrollWidth - document.documentElement.clientWidth")


def test_a_dance_from_the_menu_to_practice(address, browser):
    browser.get(address)
    find(browser, "[data-dance=dance_001]")
    assert len(browser.find_elements(By.CSS_SELECTOR, ".card")) == 2
    name = browser.find_element(By.CSS_SELECTOR, "[data-dance=dance_001] b").text
    browser.find_element(By.ID, "search").send_keys(name)
    assert len(browser.find_elements(By.CSS_SELECTOR, ".card")) == 1
    find(browser, "[data-dance=dance_001]").send_keys(Keys.ENTER)
    find(browser, "#start")
    browser.get(f"{address}#/dance/dance_001?phrase=0&speed=25&skill=perfect&fault=left+arm")
    browser.refresh()
    find(browser, "#start")
    browser.execute_script(RECORDER)
    find(browser, "#start").send_keys(Keys.ENTER)
    worst = find(browser, "#worst button")
    assert worst.get_attribute("data-part") == "left arm"
    told, arms, legs = browser.execute_script("return told")
    assert any(words.startswith("left arm") for words in told)
    assert max(arms) < 50 and min(legs) > max(arms)
    total = float(find(browser, "#result-total b").text)
    assert 0 <= total < 80 and "/try/" in browser.current_url
    before = find(browser, "#scrub").get_attribute("value")
    worst.send_keys(Keys.ENTER)
    until(browser, lambda one: one.find_element(By.ID, "scrub").get_attribute("value") != before)
    assert len(browser.find_elements(By.CSS_SELECTOR, "#history tr")) == 1
    find(browser, "a.practise").send_keys(Keys.ENTER)
    until(browser, lambda one: one.find_element(By.ID, "start").text == "Stop")
    assert find(browser, "#practise").get_attribute("value") == "80" and find(browser, "#speed").get_attribute("value") == "75"
    browser.refresh()
    until(browser, lambda one: one.find_element(By.ID, "start").text == "Stop")
    find(browser, "#start").send_keys(Keys.ENTER)
    assert find(browser, "#start").text == "Start" and find(browser, "#error").text == ""


def test_narrow_screens_and_two_tabs(address, browser):
    resize(browser, NARROW)
    browser.get(address)
    find(browser, ".card")
    assert overflow_px(browser) <= 0
    for theme in ("dark", "light"):
        find(browser, f"#theme option[value={theme}]").click()
        ground = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert (sum(int(value) for value in ground[4:-1].split(",")) < 200) == (theme == "dark")
    browser.get(f"{address}#/dance/dance_002?go&skill=nobody")
    until(browser, lambda one: one.find_element(By.ID, "start").text == "Stop")
    assert overflow_px(browser) <= 0
    browser.switch_to.new_window("tab")
    browser.get(f"{address}#/dance/dance_001")
    find(browser, "#start")
    browser.get(f"{address}#/dance/none")
    assert "there is no dance" in find(browser, "[role=alert]").text
    browser.switch_to.window(browser.window_handles[0])
    assert find(browser, "#start").text == "Stop"


LATIN_WORDS = """
const said = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT | NodeFilter.SHOW_ELEMENT);
for (let node = walk.currentNode; node; node = walk.nextNode()) {
  const isText = node.nodeType === 3, element = isText ? node.parentElement : node;
  if (element.closest("#language, noscript")) continue;
  said.push(isText ? node.data : ["aria-label", "placeholder", "title"].map((name) => node.getAttribute(name)).join(" "));
}
return said.filter((one) => /[A-Za-z]{2,}/.test(one || ""));
"""
"""Texts and labels of the page that hold words of Latin letters."""

NOT_TRANSLATED = r"\b(BPM|ms|JSON|CSV|BVH|OAK|RealSense|zip)\b|\.[a-z]+\b"  # and endings of files


def test_in_korean_no_word_of_english_is_left(library, address, browser):
    """Each view once: whatever is in Latin letters then is no text of ours, or one that is not translated."""
    names = "|".join(library.about(one).name for one in library.identities())
    views = {
        "#/": ".card", "#/me": "#names", "#/record": "#bpm", "#/calibrate": "#kept", "#/dance/none": "[role=alert]",
        "#/dance/dance_001?phrase=0&speed=25&skill=perfect&fault=left+arm&go": "#verdict span:not(:empty)",
    }  # fmt: skip
    browser.get(f"{address}?lang=ko")
    for view, shown in views.items():
        browser.get(f"{address}{view}")
        find(browser, shown)
        left = [re.sub(f"{names}|'none'|{NOT_TRANSLATED}", "", one) for one in browser.execute_script(LATIN_WORDS)]
        assert [one for one in left if re.search("[A-Za-z]{2,}", one)] == [], view
    assert find(browser, "#verdict").text.startswith("동작 1: ") and find(browser, "#start").text == "정지"
    total_of(browser)
    find(browser, "#history")
    left = [re.sub(f"{names}|{NOT_TRANSLATED}", "", one) for one in browser.execute_script(LATIN_WORDS)]
    assert [one for one in left if re.search("[A-Za-z]{2,}", one)] == []
    find(browser, "#language option[value=de]").click()
    until(browser, lambda one: find(one, "h2").text == "Schwächste Momente")


NOTE_VERDICTS = """
window.verdicts = [];
new MutationObserver(() => {
  const shown = document.getElementById("verdict");
  if (shown && shown.textContent && shown.textContent !== verdicts.at(-1)) verdicts.push(shown.textContent);
}).observe(document.body, { childList: true, characterData: true, subtree: true });
"""


def total_of(driver) -> float:
    """The total on the page of a result, once the dance is over."""
    until(driver, lambda one: "/try/" in one.current_url)
    return float(find(driver, "#result-total b").text)


def test_learners_come_in_the_right_order(address, browser):
    """Seen through the simulated sensor and the estimator, slowly, for slow machines."""
    totals = {}
    for skill in ("perfect", "worst", "still"):
        browser.get(address)
        browser.execute_script(NOTE_VERDICTS)
        browser.execute_script("location.hash = arguments[0]", f"#/dance/dance_001?go&phrase=0&speed=25&skill={skill}")
        totals[skill] = total_of(browser)
        verdict = browser.execute_script("return verdicts")[0]
        assert verdict.startswith("move 1: "), (skill, verdict)
        assert (skill == "perfect") == ("," not in verdict), (skill, verdict)  # the reason, where it is not
    assert totals["perfect"] >= 90 and totals["perfect"] > totals["worst"] + 10 and totals["still"] < 20, totals


def test_the_second_visit_greets_by_name_and_a_profile_is_deleted_after_a_second_word(teaching, tried, address, browser):
    browser.get(f"{address}#/me")
    find(browser, "#name").send_keys("Mina", Keys.ENTER)
    assert find(browser, "#greeting").text.startswith("Hello Mina!")
    tried(20.0, who=browser.execute_script("return JSON.parse(localStorage['teach.who'])"))
    browser.refresh()
    assert "Welcome back, Mina!" in find(browser, "#greeting").text
    browser.get(f"{address}#/me")
    assert find(browser, "svg.curve") and overflow_px(browser) <= 0
    find(browser, "#delete").send_keys(Keys.ENTER)
    assert list(teaching.tries.folder.rglob("*.json"))
    find(browser, "#delete").send_keys(Keys.ENTER)
    find(browser, "#cards")
    assert not list(teaching.tries.folder.rglob("*.*"))


def test_a_camera_that_is_unplugged_interrupts_the_dance_until_it_is_back(teaching, browser, tmp_path):
    unplugged = tmp_path / "unplugged"
    unsteady = replace(teaching, open_camera=partial(open_unsteady, unplugged))
    with served(unsteady) as address:
        browser.get(f"{address}#/dance/dance_001?go&speed=50&skill=perfect")  # long enough that it is not over yet
        until(browser, lambda one: find(one, "#so-far").text.isdigit())
        unplugged.touch()
        until(browser, lambda one: find(one, "#guide").text == "plug the camera in")
        assert find(browser, "#start").text == "Stop" and find(browser, "#error").text == ""
        unplugged.unlink()
        until(browser, lambda one: find(one, "#guide").text != "plug the camera in")
        assert total_of(browser) > 80


NOTE_AGES = f"""
window.ages = [];
new MutationObserver(() => {{
  const now = Date.now(), canvas = document.getElementById("learner"), zoom = Math.min(canvas.width / 160, canvas.height / 120);
  const left = (canvas.width - zoom * 160) / 2, top = (canvas.height - zoom * 120) / 2, square = zoom * {STAMP_PX // 2};
  const row = canvas.getContext("2d").getImageData(0, Math.round(top + square / 2), canvas.width, 1).data;
  let stamp = 0;
  for (let bit = 0; bit < {STAMP_BITS}; bit++) {{
    if (row[4 * Math.round(left + zoom * 160 - (bit + 0.5) * square)] > 40) stamp |= 1 << bit;
  }}
  const age = ((now - stamp) % {1 << STAMP_BITS} + {1 << STAMP_BITS}) % {1 << STAMP_BITS};
  ages.push([now, age, parseFloat(document.getElementById("age").textContent)]);
}}).observe(document.getElementById("age"), {{ childList: true, characterData: true, subtree: true }});
"""
"""Notes whenever an image is drawn: the time, how old it is by its stamp, and what the page says; all in milliseconds.

The picture is 160 pixels wide, half of the image, and mirrored.
"""


def test_a_slow_page_draws_the_newest_image_and_says_how_old_it_is(teaching, browser):
    browser.execute_cdp_cmd("Emulation.setCPUThrottlingRate", {"rate": 8})
    with served(replace(teaching, open_camera=open_stamped)) as address:
        browser.get(f"{address}#/dance/dance_001?go&loop&skill=perfect")
        until(browser, lambda one: find(one, "#age").text)
        browser.execute_script(NOTE_AGES)
        ages = until(browser, lambda one: len(found := one.execute_script("return ages")) >= 60 and found)
        browser.get("about:blank")  # before the server ends
    now_ms, age_ms, said_ms = np.array(ages, float).T
    assert np.median(abs(said_ms - age_ms)) < 50  # the stamp is read a moment later, on busy machines more than that
    # An image waits for one drawing at most, however many come in between; it also takes the time of its pose.
    assert np.median(age_ms[-20:]) < np.median(age_ms[:20]) + 2 * np.diff(now_ms).max()


READY_AT_ONCE = """
window.WebSocket = class extends EventTarget {
  static OPEN = 1;
  readyState = 1;
  send(text) {
    const { do: what, in_s, lesson } = JSON.parse(text);
    const message = (content) => new MessageEvent("message", { data: JSON.stringify(content) });
    const tell = (content) => setTimeout(() => this.dispatchEvent(message(content)));
    if (what === "prepare") window.speed = lesson.speed;
    if (what === "prepare") tell({ kind: "ready" });
    if (what === "pause") tell({ kind: "paused", from_s: 1 });
    if (what === "go" || what === "resume") window.begin = performance.now() + 1000 * in_s;
  }
  close() {}
};
"""
"""In place of the server's lesson: it is ready at once, and pauses at the dance's second 1."""


def write_song(path, bpm, one_s, seconds=40.0, rate=16000) -> None:
    """A song of decaying notes on the beats, the ones higher in energy, after a silence."""
    times_s = np.arange(round(seconds * rate)) / rate - one_s
    beats = times_s * bpm / 60
    since_s = np.mod(beats, 1) * 60 / bpm
    loudness = np.where(np.mod(np.floor(beats + 1e-9), 4) == 0, 0.9, 0.4) * np.exp(-since_s / 0.06) * (times_s >= 0)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes((32767 * loudness * np.sin(2 * np.pi * 60 * since_s)).astype("<i2").tobytes())


def test_a_dance_follows_the_beats_of_a_song_from_its_one_on_and_pauses_with_it(library, address, browser, tmp_path):
    bpm, one_s = library.about("dance_001").bpm / 1.1, 5.2
    write_song(tmp_path / "song.wav", bpm, one_s)
    browser.get(f"{address}#/dance/dance_001?skill=perfect")
    find(browser, "#music option[value=song]").click()
    find(browser, "#song-file").send_keys(str(tmp_path / "song.wav"))
    told = until(
        browser, lambda one: re.search(r"([\d.]+) beats a minute, the one at ([\d.]+) s", find(one, "#song-told").text)
    )
    assert float(told[1]) == pytest.approx(bpm, abs=0.2) and float(told[2]) == pytest.approx(one_s, abs=0.02)
    assert find(browser, "#follows").text == "The dance follows it, at 91 % of its own tempo."
    browser.execute_script(READY_AT_ONCE)
    find(browser, "#start").send_keys(Keys.ENTER)
    until(browser, lambda one: one.find_element(By.ID, "begin").is_displayed())
    find(browser, "#begin").send_keys(Keys.ENTER)
    assert browser.execute_script("return speed") == pytest.approx(1 / 1.1, abs=0.002)
    off_s = "return song.paused ? 99 : song.currentTime - (performance.now() - begin) / 1000"  # song: the element's identity
    until(browser, lambda one: one.execute_script(off_s) == pytest.approx(one_s, abs=0.05))
    body = browser.find_element(By.TAG_NAME, "body")
    body.send_keys("p")
    until(browser, lambda one: find(one, "#words").text.startswith("paused") and one.execute_script("return song.paused"))
    body.send_keys("p")  # the dance's second 1 is 1.1 s after the song's one
    until(browser, lambda one: one.execute_script(off_s) == pytest.approx(one_s + 1.1, abs=0.05))
    loaded = browser.execute_script("return performance.getEntriesByType('resource').map((one) => one.name)")
    assert [name for name in loaded if not name.startswith((address, "blob:"))] == []


SEEN_ALWAYS = """
window.hand = null; // where the right hand is, in the picture; null: nobody is there
window.asked = [];
window.extra = {}; // what else the images tell
window.WebSocket = class extends EventTarget {
  static OPEN = 1;
  readyState = 1;
  constructor() {
    super();
    setInterval(() => {
      const joints = Array.from({ length: 15 }, () => [0.5, 0.45, 2, 1]);
      Object.assign(joints, { 1: [0.5, 0.3, 2, 1], 6: [...(hand || [0.4, 0.62]), 2, 1], 7: [0.6, 0.62, 2, 1] });
      for (const hip of [9, 10]) joints[hip] = [0.5, 0.6, 2, 1];
      const at = { time_s: null, sent_ms: Date.now(), taken_ms: Date.now() };
      const content = { kind: "frame", joints: hand ? joints : null, guidance: "", words: "", parts: {}, ...at, ...extra };
      const text = new TextEncoder().encode(JSON.stringify(content)), message = new Uint8Array(4 + text.length + 5);
      new DataView(message.buffer).setUint32(0, text.length, true);
      message.set(text, 4);
      message.set([1, 0, 1, 0, 9], 4 + text.length);
      this.dispatchEvent(new MessageEvent("message", { data: message.buffer }));
    }, 40);
  }
  send(text) {
    const { do: what, lesson } = JSON.parse(text);
    if (what !== "drawn") asked.push(what === "prepare" && lesson.calibrate ? "watch" : what);
    const message = (content) => new MessageEvent("message", { data: JSON.stringify(content) });
    const tell = (content) => setTimeout(() => this.dispatchEvent(message(content)));
    if (what === "prepare") tell({ kind: "ready" });
    if (what === "pause") tell({ kind: "paused", from_s: 1 });
  }
};
"""
"""In place of the server's lessons: joints of somebody whose right hand is where `hand` says."""


def point_at(driver, target: str) -> None:
    """Moves the simulated hand so that the cursor stays in the middle of a field."""
    driver.execute_script("hand = [0.5, 0.48]")  # raised, below the fields, which appear
    until(driver, lambda one: one.find_elements(By.CSS_SELECTOR, f"#hands:not([hidden]) [data-target='{target}']"))
    x, y = driver.execute_script(
        """const page = document.documentElement, field = document.querySelector(`[data-target="${arguments[0]}"]`);
        const box = field.getBoundingClientRect();
        return [(box.left + box.right) / 2 / page.clientWidth, (box.top + box.bottom) / 2 / page.clientHeight];""",
        target,
    )
    driver.execute_script("hand = [arguments[0], arguments[1]]", 0.5 - 0.45 * (x - 0.5), 0.3 + 0.3 * (1.4 * y - 0.75))


def test_a_hand_that_points_chooses_a_dance_starts_it_stops_it_and_goes_to_the_next(address, browser):
    browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": SEEN_ALWAYS})
    browser.get(address)
    find(browser, "#hands-free").click()
    until(browser, lambda one: "watch" in one.execute_script("return asked"))
    time.sleep(1)
    assert not find(browser, "#hands").is_displayed() and not find(browser, "#hands-hint").is_displayed()  # nobody is there
    browser.execute_script("hand = [0.4, 0.62]")
    until(browser, lambda one: find(one, "#hands-hint").is_displayed())  # hands hang
    point_at(browser, "dance_002")
    until(browser, lambda one: one.current_url.endswith("#/dance/dance_002"))
    point_at(browser, "start")
    until(browser, lambda one: find(one, "#start").text == "Stop")
    browser.execute_script("hand = [0.4, 0.62]")
    until(browser, lambda one: "go" in one.execute_script("return asked"))
    browser.execute_script("hand = [0.4, 0.3]")
    time.sleep(2)
    assert not find(browser, "#hands").is_displayed()  # while dancing nothing can be chosen
    browser.find_element(By.TAG_NAME, "body").send_keys("p")
    point_at(browser, "stop")
    until(browser, lambda one: find(one, "#start").text == "Start")
    point_at(browser, "next")
    until(browser, lambda one: one.current_url.endswith("#/dance/dance_001"))
    wanted = ["prepare", "go", "pause", "watch", "stop", "watch"]
    until(browser, lambda one: one.execute_script("return asked")[-len(wanted) :] == wanted)


def test_learners_beside_each_other_have_their_own_colour_and_score(teaching, browser):
    teaching.sources["recording"] = "the recording of two"
    browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": SEEN_ALWAYS})
    with served(teaching) as address:
        browser.get(address)
        stored = "localStorage['teach.source'] = '\"recording\"'; localStorage['teach.people'] = '2'"
        browser.execute_script(stored)
        browser.get(f"{address}#/dance/dance_001")
        browser.refresh()
        browser.execute_script("hand = [0.4, 0.62]; extra = { others: [{ joints: null, parts: {}, so_far: null }] }")
        find(browser, "#start").send_keys(Keys.ENTER)
        until(browser, lambda one: find(one, "#words").text.startswith("stand before"))  # the second is not there yet
        joints = [[0.7, 0.5, 2, 1]] * 15
        browser.execute_script(
            "extra = { time_s: 1, so_far: 82, others: [{ joints: arguments[0], parts: {}, so_far: 61.4, time_s: 1 }] }", joints
        )
        until(browser, lambda one: "go" in one.execute_script("return asked"))
        first, second = until(browser, lambda one: one.find_elements(By.CSS_SELECTOR, "#members li"))
        until(browser, lambda _: first.text.startswith("82") and second.text.startswith("61"))
        colours = [
            one.find_element(By.CLASS_NAME, "swatch").value_of_css_property("background-color") for one in (first, second)
        ]
        assert colours[0] != colours[1] and not find(browser, "#so-far").is_displayed()
        find(browser, "#start").send_keys(Keys.ENTER)


def said_of(driver) -> float:
    """The total that is said at the end of a dance that is looped."""
    return float(until(driver, lambda one: re.fullmatch(r"(\d+) of 100", find(one, "#words").text))[1])


def test_two_lessons_at_once_and_a_reload_in_the_middle(address, browser):
    windows = {}
    for skill, dance in (("perfect", "dance_001"), ("still", "dance_002")):
        if windows:
            browser.switch_to.new_window("window")
        windows[skill] = browser.current_window_handle
        browser.get(f"{address}#/dance/{dance}?go&loop&phrase=0&speed=25&skill={skill}")
        until(browser, lambda one: find(one, "#so-far").text.isdigit())
    browser.refresh()
    until(browser, lambda one: find(one, "#so-far").text.isdigit())
    browser.switch_to.new_window("window")
    browser.get(f"{address}#/dance/dance_002?go")
    until(browser, lambda one: "2 dances are going on" in find(one, "#error").text)
    browser.close()
    totals = {}
    for skill, window in windows.items():
        browser.switch_to.window(window)
        totals[skill] = said_of(browser)
    assert totals["perfect"] > 60 and totals["still"] < 20, totals


def test_a_film_is_followed_cancelled_and_made(teaching, address, browser):
    dance, clock = teaching.library.dance("dance_001"), DanceClock(0.0, 1.0)
    one = DanceTry(Lesson("dance_001", to_s=4.0, speed=0.25), dance, "none")
    clock.start(0.0)
    begun = time.monotonic()
    for frame in range(130):
        image = Image(np.zeros((2, 2), np.float32), begun + frame / dance.fps)
        one.score(clock, image, dance.joints_m[frame], np.ones(15))
    browser.get(f"{address}#/dance/dance_001/try/{teaching.tries.save(*one.finish(0))}")
    button = find(browser, "#film")
    button.send_keys(Keys.ENTER)
    until(browser, lambda one: re.search("making the film: [1-9]", find(one, "#film-told").text))
    assert button.text == "cancel the film"
    button.send_keys(Keys.ENTER)
    until(browser, lambda one: "was cancelled" in find(one, "#film-told").text)
    until(browser, lambda _: not list(teaching.tries.folder.rglob("*.mp4*")))  # the maker may be about to notice
    until(browser, lambda one: "is saved" in one.find_element(By.ID, "film-told").text or asked_again(one))
    (film,) = teaching.tries.folder.rglob("*.mp4")
    assert film.read_bytes()[4:8] == b"ftyp"


def test_the_page_of_a_score_replays_it_without_a_server(library, browser, tmp_path):
    teacher = library.dance("dance_001").performance
    learner = Performance(arm_lowered(teacher.joints_m, "left", 50), teacher.times_s + 0.1)
    score = score_dance(teacher, learner)
    page = tmp_path / "score.html"
    page.write_text(
        result_page("a <b>", library.body, (teacher, learner), score, feedback(score), ["a note"]), encoding="utf-8"
    )
    resize(browser, NARROW)
    browser.get(page.as_uri())
    worst = find(browser, "#worst button")
    assert worst.get_attribute("data-part") == "left arm" and overflow_px(browser) <= 0
    assert find(browser, "h1").text == f"a <b>: {score.similarity:.0f} of 100"
    assert "a note" in find(browser, "#main").text and browser.find_elements(By.CSS_SELECTOR, "a") == []
    worst.send_keys(Keys.ENTER)
    until(browser, lambda one: float(find(one, "#scrub").get_attribute("value")) > 0)
    loaded = browser.execute_script("return performance.getEntriesByType('resource').map((one) => one.name)")
    assert [name for name in loaded if not name.startswith("data:")] == []


def asked_again(driver) -> bool:
    """Asks for the film, which the server may still be cancelling; False."""
    button = driver.find_element(By.ID, "film")
    if button.text != "cancel the film":
        button.send_keys(Keys.ENTER)
    return False
