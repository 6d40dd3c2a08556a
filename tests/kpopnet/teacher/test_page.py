"""The page in a real browser: pick a dance, dance it, look at the verdict, practise; narrow screens; two tabs; a reload."""

import re
import time
import wave

import numpy as np
import pytest
from dance_learners import arm_lowered

pytest.importorskip("aiohttp", reason="the extra app is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from selenium.webdriver.common.keys import Keys
from teacher_page import NARROW, WIDE, chromium, served, skip_without_browser

from kpopnet.dance.feedback import feedback
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from kpopnet.teacher.live.words import score_result
from kpopnet.teacher.result_page import result_page

skip_without_browser()


@pytest.fixture
def address(teaching):
    with served(teaching) as found:
        yield found


@pytest.fixture(scope="module")
def driver():
    with chromium() as started:
        yield started


@pytest.fixture
def browser(driver):
    """With one tab, a new one. What pages store is stored by address, and so for one test alone."""
    before = driver.window_handles
    driver.switch_to.new_window("tab")
    tab = driver.current_window_handle
    for one in before:
        driver.switch_to.window(one)
        driver.close()
    driver.switch_to.window(tab)
    driver.resize(WIDE)
    driver.get_log("browser")
    yield driver
    assert [message for message in driver.severe() if "/api/dances/none " not in message] == []  # a test asks for it


RECORDER = """
window.told = [[], [], []];
window.verdicts = [];
const value = (part) => Number(document.querySelector(`li[data-part="${part}"]`).dataset.value || NaN);
new MutationObserver(() => {
  const words = document.getElementById("words"), verdict = document.getElementById("verdict");
  if (words) told[0].push(words.textContent);
  if (words && !isNaN(value("left arm"))) { told[1].push(value("left arm")); told[2].push(value("left leg")); }
  if (verdict && verdict.textContent) verdicts.push(verdict.textContent);
}).observe(document.body, { childList: true, characterData: true, subtree: true });
"""
"""Notes what the page tells during the dance: words, the scores of left arm and left leg, and the verdicts on moves."""

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


def latin_words(driver, names) -> list[str]:
    left = [re.sub(f"{names}|'none'|{NOT_TRANSLATED}", "", one) for one in driver.execute_script(LATIN_WORDS)]
    return [one for one in left if re.search("[A-Za-z]{2,}", one)]


def test_a_dance_from_the_menu_to_its_result_and_practice_and_all_of_it_in_korean(library, address, browser):
    """The simulated learner's left arm hangs; in Korean, whatever is in Latin letters is no text of ours."""
    names = "|".join(library.about(one).name for one in library.identities())
    browser.get(address)
    browser.find("[data-dance=dance_001]")
    assert len(browser.all(".card")) == 2
    name = browser.find("[data-dance=dance_001] b").text
    browser.find("#search").send_keys(name)
    assert len(browser.all(".card")) == 1
    browser.find("[data-dance=dance_001]").send_keys(Keys.ENTER)
    browser.find("#start")
    browser.get(f"{address}#/dance/dance_001?phrase=0&speed=50&skill=perfect&fault=left+arm")
    browser.refresh()
    browser.find("#start")
    before = browser.current_url
    browser.execute_script("document.querySelector('.skip').click()")
    assert browser.current_url == before and browser.switch_to.active_element.get_attribute("id") == "main"
    browser.execute_script(RECORDER)
    browser.find("#start").send_keys(Keys.ENTER)
    worst = browser.find("#worst button")
    assert worst.get_attribute("data-part") == "left arm"
    told, arms, legs = browser.execute_script("return told")
    assert any(words.startswith("left arm") for words in told) and max(arms) < 50 and min(legs) > max(arms)
    assert browser.execute_script("return verdicts")[0].startswith("move 1: ")
    assert 0 <= float(browser.find("#result-total b").text) < 80 and "/try/" in browser.current_url
    before = browser.find("#scrub").get_attribute("value")
    worst.send_keys(Keys.ENTER)
    browser.until(lambda one: one.find("#scrub").get_attribute("value") != before)
    assert len(browser.all("#history tbody tr")) == 1
    film = browser.find("#film")
    film.send_keys(Keys.ENTER)
    browser.until(lambda one: re.search("making the film: [1-9]", one.find("#film-told").text))
    film.send_keys(Keys.ENTER)
    browser.reads("#film-told", "was cancelled")

    result = browser.current_url
    views = {
        "#/": ".card", "#/me": "#names", "#/record": "#bpm", "#/calibrate": "#kept", "#/dance/none": "[role=alert]",
        "#/dance/dance_001": "#start",
    }  # fmt: skip
    for url, shown in {**{f"{address}?lang=ko{view}": shown for view, shown in views.items()}, result: "#history"}.items():
        browser.get(url)  # the last one without ?lang=, which is remembered
        browser.find(shown)
        assert latin_words(browser, names) == [], url
    browser.find("#language option[value=de]").click()
    browser.reads("h2", "Schwächste Momente")
    browser.find("#language option[value=en]").click()

    browser.find("a.practise").send_keys(Keys.ENTER)
    browser.reads("#start", "Stop")
    assert browser.find("#practise").get_attribute("value") == "80" and browser.find("#speed").get_attribute("value") == "75"
    browser.refresh()
    browser.reads("#start", "Stop")
    browser.execute_script("location.hash = '#/'")
    browser.find(".card")
    browser.back()
    browser.find("#practise option[value='80']")
    assert browser.find("#start").text == "Start"  # nor does it for who comes back
    browser.find("#start").send_keys(Keys.ENTER)
    browser.reads("#start", "Stop")
    browser.find("#start").send_keys(Keys.ENTER)
    assert browser.find("#start").text == "Start" and browser.find("#error").text == ""
    assert browser.find("#speed").get_attribute("value") == "50"  # as it was chosen before
    browser.refresh()
    browser.find("#practise option[value='80']")
    assert browser.find("#start").text == "Start"  # what was stopped does not begin by itself


def test_by_the_keyboard_a_view_begins_at_its_heading_and_a_language_is_chosen_after_another(library, address, browser):
    browser.get(f"{address}?lang=en")
    browser.find("[data-dance=dance_001]").send_keys(Keys.ENTER)
    browser.until(lambda one: one.switch_to.active_element.tag_name == "h1")
    assert browser.switch_to.active_element.text.startswith(library.about("dance_001").name)
    browser.execute_script("location.hash = '#/dance/none'")
    browser.until(lambda one: one.find("[role=alert]").text and one.switch_to.active_element.get_attribute("id") == "main")
    for language, text in (("ko", "춤 선생님"), ("de", "Tanzcoach")):
        browser.find("#language").send_keys(Keys.ARROW_DOWN)
        browser.until(lambda one, wanted=language: one.execute_script("return document.documentElement.lang") == wanted)
        browser.reads("#home", text)
        assert browser.switch_to.active_element.get_attribute("id") == "language"


def test_a_narrow_screen_in_the_dark_and_two_lessons_at_once_and_no_third(address, browser):
    browser.resize(NARROW)
    browser.get(address)
    browser.find(".card")
    assert browser.overflow_px <= 0
    for theme in ("dark", "light"):
        browser.find(f"#theme option[value={theme}]").click()
        ground = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert (sum(int(value) for value in ground[4:-1].split(",")) < 200) == (theme == "dark")
    for dance in ("dance_001", "dance_002"):
        browser.get(f"{address}#/dance/{dance}?go&loop&skill=absent")
        browser.reads("#start", "Stop")
        assert browser.overflow_px <= 0
        browser.refresh()  # takes the lesson up again
        browser.reads("#start", "Stop")
        browser.switch_to.new_window("tab")
    browser.get(f"{address}#/dance/none")
    assert "there is no dance" in browser.find("[role=alert]").text
    browser.get(f"{address}#/dance/dance_002?go")
    browser.reads("#error", "2 dances are going on")
    browser.switch_to.window(browser.window_handles[0])
    assert browser.find("#start").text == "Stop"


def test_the_second_visit_greets_by_name_and_a_profile_is_deleted_after_a_second_word(teaching, tried, address, browser):
    browser.get(f"{address}#/me")
    browser.find("#name").send_keys("Mina", Keys.ENTER)
    assert browser.find("#greeting").text.startswith("Hello Mina!")
    tried(20.0, who=browser.execute_script("return JSON.parse(localStorage['teach.who'])"))
    browser.refresh()
    assert "Welcome back, Mina!" in browser.find("#greeting").text
    browser.get(f"{address}#/me")
    assert browser.find("svg.curve") and browser.overflow_px <= 0
    browser.find("#delete").send_keys(Keys.ENTER)
    assert list(teaching.tries.folder.rglob("*.json"))
    browser.find("#delete").send_keys(Keys.ENTER)
    browser.find("#cards")
    assert not list(teaching.tries.folder.rglob("*.*"))


SEEN_ALWAYS = """
window.hand = null; // where the right hand is, in the picture; null: no person is there
window.asked = [];
window.silent = false; // no images come
window.WebSocket = class extends EventTarget {
  static OPEN = 1;
  readyState = 1;
  constructor() {
    super();
    window.tell = (content) => this.dispatchEvent(new MessageEvent("message", { data: JSON.stringify(content) }));
    setInterval(() => {
      if (silent) return;
      const joints = Array.from({ length: 15 }, () => [0.5, 0.45, 2, 1]);
      Object.assign(joints, { 1: [0.5, 0.3, 2, 1], 6: [...(hand || [0.4, 0.62]), 2, 1], 7: [0.6, 0.62, 2, 1] });
      for (const hip of [9, 10]) joints[hip] = [0.5, 0.6, 2, 1];
      const at = { time_s: null, sent_ms: Date.now(), taken_ms: Date.now() };
      const content = { kind: "frame", joints: hand ? joints : null, guidance: "", words: "", parts: {}, ...at };
      const text = new TextEncoder().encode(JSON.stringify(content)), message = new Uint8Array(4 + text.length + 5);
      new DataView(message.buffer).setUint32(0, text.length, true);
      message.set(text, 4);
      message.set([1, 0, 1, 0, 9], 4 + text.length);
      this.dispatchEvent(new MessageEvent("message", { data: message.buffer }));
    }, 40);
  }
  send(text) {
    const { do: what, in_s, lesson } = JSON.parse(text);
    if (what === "prepare") window.speed = lesson.speed;
    if (what === "go" || what === "resume") window.begin = performance.now() + 1000 * in_s;
    if (what !== "drawn") asked.push(what === "prepare" && lesson.calibrate ? "watch" : what);
    if (what === "prepare") setTimeout(tell, 0, { kind: "ready" });
    if (what === "pause") setTimeout(tell, 0, { kind: "paused", from_s: 1 });
  }
};
"""
"""In place of the server's lessons: joints of a person whose right hand is where `hand` says; a pause is at the second 1."""


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
    browser.find("#music option[value=song]").click()
    browser.find("#song-file").send_keys(str(tmp_path / "song.wav"))
    found = re.compile(r"([\d.]+) beats a minute, the one at ([\d.]+) s")
    told = browser.until(lambda one: found.search(one.find("#song-told").text))
    assert float(told[1]) == pytest.approx(bpm, abs=0.2) and float(told[2]) == pytest.approx(one_s, abs=0.02)
    assert browser.find("#follows").text == "The dance follows it, at 91 % of its own tempo."
    browser.execute_script(SEEN_ALWAYS + "silent = true;")
    browser.find("#start").send_keys(Keys.ENTER)
    browser.until(lambda one: one.find("#begin").is_displayed())
    browser.find("#begin").send_keys(Keys.ENTER)
    assert browser.execute_script("return speed") == pytest.approx(1 / 1.1, abs=0.002)
    off_s = "return song.paused ? 99 : song.currentTime - (performance.now() - begin) / 1000"  # song: the element's identity
    browser.until(lambda one: one.execute_script(off_s) == pytest.approx(one_s, abs=0.05))
    body = browser.find("body")
    body.send_keys("p")
    browser.until(lambda one: one.find("#words").text.startswith("paused") and one.execute_script("return song.paused"))
    body.send_keys("p")  # the dance's second 1 is 1.1 s after the song's one
    browser.until(lambda one: one.execute_script(off_s) == pytest.approx(one_s + 1.1, abs=0.05))
    assert [name for name in browser.loaded if not name.startswith((address, "blob:"))] == []


def point_at(driver, target: str) -> None:
    """Moves the simulated hand so that the cursor stays in the middle of a field."""
    driver.execute_script("hand = [0.5, 0.48]")  # raised, below the fields, which appear
    driver.until(lambda one: one.all(f"#hands:not([hidden]) [data-target='{target}']"))
    x, y = driver.execute_script(
        """const page = document.documentElement, field = document.querySelector(`[data-target="${arguments[0]}"]`);
        const box = field.getBoundingClientRect();
        return [(box.left + box.right) / 2 / page.clientWidth, (box.top + box.bottom) / 2 / page.clientHeight];""",
        target,
    )
    driver.execute_script("hand = [arguments[0], arguments[1]]", 0.5 - 0.45 * (x - 0.5), 0.3 + 0.3 * (1.4 * y - 0.75))


def test_a_hand_that_points_chooses_starts_and_stops_a_dance(address, browser):
    browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": SEEN_ALWAYS})
    browser.get(address)
    browser.find("#hands-free").click()
    browser.until(lambda one: "watch" in one.execute_script("return asked"))
    time.sleep(1)
    assert not browser.find("#hands").is_displayed() and not browser.find("#hands-hint").is_displayed()  # no person is there
    browser.execute_script("hand = [0.4, 0.62]")
    browser.until(lambda one: one.find("#hands-hint").is_displayed())  # hands hang
    point_at(browser, "dance_002")
    browser.until(lambda one: one.current_url.endswith("#/dance/dance_002"))
    point_at(browser, "start")
    browser.reads("#start", "Stop")
    browser.execute_script("hand = [0.4, 0.62]")
    browser.until(lambda one: "go" in one.execute_script("return asked"))
    browser.execute_script("hand = [0.4, 0.3]")
    time.sleep(1)
    assert not browser.find("#hands").is_displayed()  # while dancing nothing can be chosen
    for _ in range(2):  # off and on again: the dance goes on
        browser.find("#hands-free").click()
    browser.find("body").send_keys("p")
    point_at(browser, "stop")
    browser.reads("#start", "Start")
    point_at(browser, "next")
    browser.until(lambda one: one.current_url.endswith("#/dance/dance_001"))
    wanted = ["prepare", "go", "pause", "watch", "stop", "watch"]
    browser.until(lambda one: one.execute_script("return asked")[-len(wanted) :] == wanted)


def test_the_page_of_a_score_replays_it_without_a_server(library, browser, tmp_path):
    teacher = library.dance("dance_001").performance
    learner = Performance(arm_lowered(teacher.joints_m, "left", 50), teacher.times_s + 0.1)
    score = score_dance(teacher, learner)
    result = score_result(score, feedback(score), {}, None)
    page = result_page("a <b>", library.body, (teacher, learner), result, ["a note"])
    (tmp_path / "score.html").write_text(page, encoding="utf-8")
    browser.resize(NARROW)
    browser.get((tmp_path / "score.html").as_uri())
    worst = browser.find("#worst button")
    assert worst.get_attribute("data-part") == "left arm" and browser.overflow_px <= 0
    assert browser.find("h1").text == f"a <b>: {score.similarity:.0f} of 100"
    assert "a note" in browser.find("#main").text and browser.all("a") == []
    worst.send_keys(Keys.ENTER)
    browser.until(lambda one: float(one.find("#scrub").get_attribute("value")) > 0)
    assert re.fullmatch(r"\d:\d\d of \d:\d\d", browser.find("#scrub").get_attribute("aria-valuetext"))
    for contrast in ("forced-colors: active", "prefers-contrast: more"):
        name, value = contrast.split(": ")
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": name, "value": value}]})
        told = browser.execute_script(
            """const style = (one) => getComputedStyle(document.querySelector(one));
            const grounds = [".track i", ".track"].map((one) => style(one).backgroundColor);
            return [...grounds, style(".panel").borderColor, style("body").color];"""
        )
        assert told[0] != told[1] and told[2] == told[3], contrast
    assert [name for name in browser.loaded if not name.startswith("data:")] == []
