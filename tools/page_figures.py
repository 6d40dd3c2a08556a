"""Takes the pictures of the pages in docs/teaching.md and docs/live.md from the running programs.

    python tools/page_figures.py teach
    python -m synth benchmark=two_people benchmark.sequences=6 out=outputs/two_people
    python tools/page_figures.py live --source outputs/two_people/pair_05.h5

For `teach` a simulated learner whose left arm hangs dances a dance; for `live` two simulated people dance. Needs Chromium,
chromedriver and selenium. Run it on a quiet machine: the pictures show images a second and milliseconds, and a score that
suffers where images are dropped.
"""

import argparse
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "helpers"))

from teacher_page import Browser, chromium, started  # noqa: E402

LESSON = "dance/dance_001?go&skill=perfect&fault=left+arm&speed={speed}"
SHOWN_MOVE = 3
RESULT_PX = (400, 1720)
SETTLED_S, LIVE_S = 2.0, 6.0


def take_teach(browser: Browser, address: str, folder: Path, speed: int) -> None:
    """Holds a lesson and writes teach_stage.png, the dance after a verdict, and teach_result.png."""
    browser.get(f"{address}#/{LESSON.format(speed=speed)}")
    browser.reads("#verdict", f"move {SHOWN_MOVE}")
    browser.save_screenshot(str(folder / "teach_stage.png"))
    browser.until(lambda one: "/try/" in one.current_url)
    browser.find("#history")
    browser.resize(RESULT_PX)
    browser.refresh()  # the replay takes the place that it has when it is made
    browser.find("#history")
    time.sleep(SETTLED_S)
    browser.save_screenshot(str(folder / "teach_result.png"))


def take_live(browser: Browser, address: str, folder: Path) -> None:
    """Writes live.png, the people of a recording."""
    browser.get(address)
    browser.find("#people li")
    time.sleep(LIVE_S)
    browser.save_screenshot(str(folder / "live.png"))


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("tools/page_figures.py", description=__doc__, formatter_class=form)
    parser.add_argument("page", choices=("teach", "live"))
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures", help="where to: %(default)s")
    parser.add_argument("--data", default="outputs/teach", help="teach: folder of dances, see kpopnet teach: %(default)s")
    parser.add_argument("--speed", type=int, default=100, help="teach: of the dance, percent: %(default)s")
    parser.add_argument("--source", help="live: a recording of depth that states its camera")
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 860), help="live: of the window in pixels: %(default)s")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    alone = ("--no-browser", "--port", "0")
    if given.page == "teach":
        program = ("kpopnet.programs.teach", "--data", given.data, *alone)
        with started(*program) as (address, _), chromium() as browser:
            take_teach(browser, address, given.out, given.speed)
    else:
        program = ("kpopnet.cli", "live", given.source, "--loop", *alone)
        with started(*program) as (address, _), chromium(tuple(given.size)) as browser:
            take_live(browser, address, given.out)


if __name__ == "__main__":
    main()
