"""Takes the two pictures of the dance teacher in docs/teaching.md from the running program.

    python tools/teach_figures.py

A simulated learner whose left arm hangs dances a dance; needs Chromium, chromedriver and selenium. Run it on a quiet machine:
the pictures show how many milliseconds the score takes, and a score that suffers where images are dropped.
"""

import argparse
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "helpers"))

from teacher_page import chromium, find, reads, resize, started, until  # noqa: E402

FIGURES = ROOT / "docs" / "figures"
LESSON = "dance/dance_001?go&skill=perfect&fault=left+arm&speed={speed}"
SHOWN_MOVE = 3
RESULT_PX = (400, 1720)
SETTLED_S = 2.0


def take(address: str, folder: Path, speed: int) -> None:
    """Holds a lesson and writes teach_stage.png, the dance after a verdict, and teach_result.png."""
    with chromium() as driver:
        driver.get(f"{address}#/{LESSON.format(speed=speed)}")
        reads(driver, "#verdict", f"move {SHOWN_MOVE}")
        driver.save_screenshot(str(folder / "teach_stage.png"))
        until(driver, lambda one: "/try/" in one.current_url)
        find(driver, "#history")
        resize(driver, RESULT_PX)
        driver.refresh()  # the replay takes the place that it has when it is made
        find(driver, "#history")
        time.sleep(SETTLED_S)
        driver.save_screenshot(str(folder / "teach_result.png"))


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("tools/teach_figures.py", description=__doc__, formatter_class=form)
    parser.add_argument(
        "--data", type=Path, default=Path("outputs/teach"), help="folder of dances, see kpopnet teach: %(default)s"
    )
    parser.add_argument("--out", type=Path, default=FIGURES, help="where to: %(default)s")
    parser.add_argument("--port", type=int, default=8478, help="%(default)s")
    parser.add_argument("--speed", type=int, default=100, help="of the dance, percent: %(default)s")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    program = ("kpopnet.programs.teach", "--no-browser", "--data", given.data, "--port", given.port)
    with started(*program) as (address, _):
        take(address, given.out, given.speed)


if __name__ == "__main__":
    main()
