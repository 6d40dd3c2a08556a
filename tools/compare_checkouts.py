"""Compares what two checkouts compute, bit for bit: for refactorings, which must change nothing.

    git worktree add /tmp/before HEAD~5
    python tools/compare_checkouts.py /tmp/before . --out /tmp/compared           # some minutes each
    python tools/compare_checkouts.py /tmp/before . --out /tmp/compared --keep    # keeps fingerprints made before

Runs `tools/fingerprint.py` of each checkout in its root, with the Python that runs this, and prints every difference.
Exit code 0 where there is none.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path


def fingerprint(checkout: Path, folder: Path) -> dict[str, object]:
    """What the checkout's own `tools/fingerprint.py` finds."""
    program = checkout / "tools" / "fingerprint.py"
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    subprocess.run([sys.executable, str(program), str(folder)], cwd=checkout, env=environment, check=True)
    return read(folder)


def read(folder: Path) -> dict[str, object]:
    return json.loads((folder / "fingerprint.json").read_text())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="root of a checkout")
    parser.add_argument("after", type=Path, help="root of another")
    parser.add_argument("--out", type=Path, required=True, help="folder for what both make")
    parser.add_argument("--keep", action="store_true", help="take a fingerprint that is there already for made")
    given = parser.parse_args()
    found = {}
    for name, checkout in (("before", given.before.resolve()), ("after", given.after.resolve())):
        folder = given.out.resolve() / name
        made = given.keep and (folder / "fingerprint.json").exists()
        found[name] = read(folder) if made else fingerprint(checkout, folder)
    before, after = found["before"], found["after"]
    differing = [name for name in sorted(before.keys() | after.keys()) if before.get(name) != after.get(name)]
    for name in differing:
        print(f"{name}: {before.get(name, 'absent')} -> {after.get(name, 'absent')}")
    print(f"{len(before.keys() | after.keys()) - len(differing)} equal, {len(differing)} different")
    sys.exit(bool(differing))


if __name__ == "__main__":
    main()
