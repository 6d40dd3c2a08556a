"""Fuzzes the readers of every file format that strangers send.

    python -m tests.fuzz                                    # 2,000 mutations of every format
    python -m tests.fuzz --planted                          # first: does the harness find each planted fault?
    python -m tests.fuzz --cases 20000 --format bvh camera  # more of some
    python -m tests.fuzz --format bvh --only 1234           # one case again

Prints a table. Exit code 1 where anything came out but success or an InputError of one line in time and memory, with the input
as it was and nothing else touched (`fuzz.runner` judges); or where a planted fault was missed.
"""

import argparse
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), str(TESTS), str(TESTS / "helpers")]


def main() -> None:
    from planted import find_all

    from fuzz.formats import FORMATS
    from fuzz.runner import ACCEPTED, REFUSED, fuzz

    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("python -m tests.fuzz", description=__doc__, formatter_class=form)
    parser.add_argument("--cases", type=int, default=2000, help="mutations of each format: %(default)s")
    parser.add_argument("--format", nargs="+", choices=FORMATS, default=list(FORMATS), help="all by default")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="number of the one case to run")
    parser.add_argument("--stop", action="store_true", help="at the first fault")
    parser.add_argument(
        "--planted", nargs="*", metavar="NAME", help="look for faults planted in copies, all by default, instead"
    )
    given = parser.parse_args()
    if given.planted is not None:
        sys.exit(not find_all(TESTS / "fuzz" / "planted", "tests.fuzz", given.planted))
    cases = range(given.cases) if given.only is None else range(given.only, given.only + 1)
    failed = False
    print(f"{'format':20} {'accepted':>9} {'refused':>9} {'faults':>7}")
    for name in given.format:
        outcomes, faults = fuzz([name], cases, given.seed, given.stop)[name]
        print(f"{name:20} {outcomes[ACCEPTED]:9} {outcomes[REFUSED]:9} {len(faults):7}", flush=True)
        for case, fault in faults[:10]:
            print(f"    case {case}: {fault}", flush=True)
        failed |= bool(faults)
        if failed and given.stop:
            break
    sys.exit(failed)


if __name__ == "__main__":
    main()
