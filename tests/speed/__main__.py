"""Measures speeds: `make speed`, or `python -m tests.speed synth ridge` for some of them.

Every module `speed_*.py` beside this one has a function `measure()` that returns {name: (value, unit, against)}. Figures
are ratios within one run, or medians per core; run it on a quiet machine. Results go to outputs/speed.json.
"""

import importlib
import json
import sys
from pathlib import Path

import kpopnet  # noqa: F401  before torch: it sets how OpenMP's threads wait

sys.path.append(str(Path(__file__).parents[1]))  # where the tests' own modules lie

OUT = Path("outputs/speed.json")


def main(wanted: list[str]) -> None:
    modules = sorted(path.stem for path in Path(__file__).parent.glob("speed_*.py"))
    unknown = set(wanted) - {name.removeprefix("speed_") for name in modules}
    if unknown:
        sys.exit(f"no measure called {', '.join(sorted(unknown))}; there are {', '.join(m[6:] for m in modules)}")
    results = json.loads(OUT.read_text()) if OUT.exists() else {}
    OUT.parent.mkdir(exist_ok=True)
    print(f"{'measure':36} {'value':>10} unit")
    for module in modules:
        if wanted and module.removeprefix("speed_") not in wanted:
            continue
        for name, (value, unit, against) in importlib.import_module(f"tests.speed.{module}").measure().items():
            results[name] = {"value": round(float(value), 4), "unit": unit, "against": against}
            print(f"{name:36} {value:10.4g} {unit:22} {against}", flush=True)
        OUT.write_text(json.dumps(results, indent=1, sort_keys=True) + "\n")
    print(f"written to {OUT}")


if __name__ == "__main__":
    main(sys.argv[1:])
