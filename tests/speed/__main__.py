"""Measures speeds: `make speed`, or `python -m tests.speed synth ridge` for some of them.

Every module `speed_*.py` beside this one has a function `measure()` that returns {name: (value, unit, against)}. Figures
are ratios within one run, or medians per core; run it on a quiet machine. Results go to outputs/speed.json.
"""

import argparse
import importlib
import json
import sys
from pathlib import Path

import kpopnet  # noqa: F401  before torch: it sets how OpenMP's threads wait

sys.path.append(str(Path(__file__).parents[1] / "helpers"))  # where the tests' own modules lie

OUT = Path("outputs/speed.json")

LIMITS = {  # what the project promises: at least, at most
    "synth.samples_per_core_second": (400, None),
    "train.sample_ms": (None, 2),
    "train.data_loss_percent": (None, 10),
    "ridge.vs_distance_transform": (None, 4),
    "tracker.fps": (100, None),  # the finder of people takes most of it
    "finder.frame_ms": (None, 4),
    "paper_extraction.frame_ms": (None, 3.3),
    "network.onnx_ms": (None, 2),
    "network.path_fps": (100, None),
    "network.path_fps_best": (100, None),
    "dance.online_ms_p95": (None, 2),
    "synth.cpu_vs_gl": (1, None),
    "synth.memory_mb": (None, 700),
    "train.memory_mb": (None, 3000),
}


def kept(name: str, value: float) -> str:
    """The promise, and whether this run keeps it."""
    least, most = LIMITS.get(name, (None, None))
    if least is None and most is None:
        return ""
    promise = f"at least {least}" if most is None else f"at most {most}"
    return f"{promise}: {'kept' if (least or value) <= value <= (most or value) else 'MISSED'}"


def main(wanted: list[str]) -> None:
    modules = sorted(path.stem for path in Path(__file__).parent.glob("speed_*.py"))
    unknown = set(wanted) - {name.removeprefix("speed_") for name in modules}
    if unknown:
        sys.exit(f"no measure called {', '.join(sorted(unknown))}; there are {', '.join(m[6:] for m in modules)}")
    results = json.loads(OUT.read_text()) if OUT.exists() else {}
    OUT.parent.mkdir(exist_ok=True)
    print(f"{'measure':36} {'value':>10} {'unit':22} {'promised':18} against")
    for module in modules:
        if wanted and module.removeprefix("speed_") not in wanted:
            continue
        for name, (value, unit, against) in importlib.import_module(f"tests.speed.{module}").measure().items():
            results[name] = {"value": round(float(value), 4), "unit": unit, "against": against}
            print(f"{name:36} {value:10.4g} {unit:22} {kept(name, value):18} {against}", flush=True)
        OUT.write_text(json.dumps(results, indent=1, sort_keys=True) + "\n")
    print(f"written to {OUT}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("measures", nargs="*", help="all by default")
    main(parser.parse_args().measures)
