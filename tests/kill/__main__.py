"""Kills a program again and again at random times, starts it again until it is done, and compares the result.

    python -m tests.kill --program synth --kills 50 --seed 0
    python -m tests.kill                                        # all programs

Each start of the program is killed by SIGKILL after a time drawn from 0 to the length of an undisturbed run; only its first
process is killed, as a user or a scheduler does. After each kill every other process of it must end within 5 s. A run that
gets done is compared with an undisturbed one: files byte for byte, trained weights bit for bit; then the next one begins, until
there were as many kills as wanted. Ends with a table, and exit code 1 if anything differed, stayed alive or failed.
"""

import argparse
import random
import sys
import tempfile
from pathlib import Path

from tests.kill.harness import Tally, kill_until_done, undisturbed
from tests.kill.programs import PROGRAMS


def judge(name: str, kills: int, seed: int, folder: Path) -> Tally:
    """Kills one program that many times in runs below `folder`."""
    program = PROGRAMS[name](folder)
    expected, tally = undisturbed(program, folder / "whole"), Tally(name)
    tally.undisturbed_s = expected.seconds
    rng = random.Random(f"{seed} {name}")
    while tally.kills < kills and not tally.problems:
        kill_until_done(program, folder / f"run_{tally.runs}", expected, kills, rng, tally)
        tally.runs += 1
    return tally


def main() -> None:
    parser = argparse.ArgumentParser(
        "python -m tests.kill", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--program", choices=sorted(PROGRAMS), action="append", help="one program; may be given again")
    parser.add_argument("--kills", type=int, default=50, help="of each program: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="of the times: %(default)s")
    given = parser.parse_args()
    tallies = []
    for name in given.program or PROGRAMS:
        with tempfile.TemporaryDirectory(prefix="kpopnet_kill_") as folder:
            tallies.append(judge(name, given.kills, given.seed, Path(folder)))
    print("\n".join([Tally.heading(), *(tally.row() for tally in tallies)]))
    problems = [f"{tally.name}: {problem}" for tally in tallies for problem in tally.problems]
    print("\n".join(problems), file=sys.stderr)
    raise SystemExit(1 if problems else 0)


if __name__ == "__main__":
    main()
