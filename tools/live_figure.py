"""Takes the picture of `kpopnet live` in docs/live.md from the running program.

    python -m synth benchmark=two_people benchmark.sequences=6 out=outputs/two_people
    python tools/live_figure.py outputs/two_people/pair_05.h5

Two simulated people dance; needs Chromium, chromedriver and selenium. Run it on a quiet machine: the picture shows images a
second and milliseconds.
"""

import argparse
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "helpers"))

from teacher_page import chromium, find, started  # noqa: E402

SETTLED_S = 6.0


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("tools/live_figure.py", description=__doc__, formatter_class=form)
    parser.add_argument("source", help="a recording of depth that states its camera")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures" / "live.png", help="where to: %(default)s")
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 860), help="of the window in pixels: %(default)s")
    parser.add_argument("--dark", action="store_true", help="in the dark theme")
    given = parser.parse_args()
    program = ("kpopnet.cli", "live", given.source, "--loop", "--no-browser", "--port", "0")
    with started(*program) as (address, _), chromium(tuple(given.size)) as driver:
        if given.dark:
            scheme = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
            driver.execute_cdp_cmd("Emulation.setEmulatedMedia", scheme)
        driver.get(address)
        find(driver, "#people li")
        time.sleep(SETTLED_S)
        driver.save_screenshot(str(given.out))


if __name__ == "__main__":
    main()
