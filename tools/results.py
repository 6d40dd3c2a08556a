"""The documented figures: makes the rows of results/ and writes the tables of the pages from them.

    python tools/results.py make eval_sim_31    # runs the row's commands, writes results/eval_sim_31.json
    python tools/results.py pages               # writes tables and figures into the pages

A row is one evaluation: its commands stand in results/rows.toml; its file has what the program measured, the commit, the
date and the machine. A table stands between <!-- results: NAME --> and <!-- end -->. It pools the rows of several seeds of a
set: the intervals are over all their people, the seeds stand beside.
"""

import argparse
import json
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.errors import InputError
from kpopnet.evaluation.acceptance.sheet import machine
from kpopnet.evaluation.dances.ranking import in_order_by_one, mcnemar_p_value, wilson_interval
from kpopnet.evaluation.intervals import FEWEST_UNITS, Bootstrap
from kpopnet.evaluation.values import Table, Value
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.endings import user_errors

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results"
PAGES = tuple(ROOT / name for name in ("README.md", "docs/results.md", "docs/compare.md", "kpopnet/weights/MODEL_CARD.md"))
"""Their tables are made from the files; every figure outside the tables that has a unit or a % names its file."""

ALSO = (ROOT / "docs/trackers.md", ROOT / "docs/paper.md")
"""Pages some of whose figures name a file."""

CODE = ("kpopnet", "synth", "configs")
"""What figures depend on: the commit that a row names has it."""

BLOCK = re.compile(r"(<!-- results: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
REFERENCE = re.compile(r"((?:(?<=[\s(\[])-)?\b\d+(?:\.\d+)?)((?: (?:%|cm|points))?)<!-- ([\w./:, -]+:[\w./:, -]+) -->")
"""A figure, its unit, and the number of a file that it shows."""

KEPT = ("map_10cm", "mean_error_cm", "labelled_joints", "missing_joints", "interval")
"""Figures of an estimator that a row's file keeps, beside those by group of joints, by heading, in the labels' definition and,
where people are the unit, by person."""


def rows() -> dict[str, dict]:
    """results/rows.toml: by name, `commands` in the order in which they run; the last one reports to outputs/results/NAME."""
    return tomllib.loads((RESULTS / "rows.toml").read_text())


def make(name: str) -> None:
    """Runs the commands of a row and writes its file."""
    known = rows()
    if name not in known:
        raise InputError(f"{name}: no row of {RESULTS / 'rows.toml'}, which has {', '.join(known)}")
    if _git("status", "--porcelain", *CODE):
        raise InputError(f"{ROOT}: kpopnet, synth or configs have changes that are not committed: no commit names this code")
    commit = _git("rev-parse", "--short=12", "HEAD")
    for command in known[name]["commands"]:
        words = shlex.split(command)
        print("$", command, flush=True)
        if subprocess.run([sys.executable, *words[1:]] if words[0] == "python" else words, cwd=ROOT, check=False).returncode:
            raise InputError(f"{name}: a command of it failed, see above; data that it names in ../shared: docs/datasets.md")
    metrics = json.loads((ROOT / "outputs/results" / name / "metrics.json").read_text())
    if _git("diff", "--name-only", commit, "--", *CODE):
        raise InputError(f"{name}: kpopnet, synth or configs changed while it was measured: no commit names this code")
    # Films of several people have figures by kind of scene, which are few: all are kept.
    resampled, estimators = metrics["benchmark"].get("resampled"), metrics["estimators"]
    if resampled is not None:
        estimators = {label: _kept(one, resampled["units"] == "people") for label, one in estimators.items()}
    found = {
        "row": name,
        "commands": known[name]["commands"],
        "commit": commit,
        "date": datetime.now(UTC).date().isoformat(),
        "machine": machine()["processor"],
        "benchmark": metrics["benchmark"],
        "estimators": estimators,
    }
    write_json(RESULTS / f"{name}.json", found)


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def _kept(metrics: dict, by_person: bool) -> dict:
    small = ("map_10cm", "mean_error_cm", "labelled_joints", "missing_joints", "moving_10cm", "moving_joints")
    kept = {name: metrics[name] for name in KEPT if name in metrics}
    kept["per_group"] = {name: {key: one[key] for key in small[:2]} for name, one in metrics["per_group"].items()}
    if by_person:
        kept["per_person"] = {name: {key: one[key] for key in small} for name, one in metrics["per_person"].items()}
    kept["by_yaw"] = {name: {"map_10cm": one["map_10cm"]} for name, one in metrics["by_yaw"].items()}
    kept["calibration_error"] = metrics["confidence"].get("ece")
    kept |= {name: metrics.get(name) for name in ("missed_by_cause", "label_free")}
    if "in_label_definition" in metrics:
        kept["in_label_definition"] = _kept(metrics["in_label_definition"], by_person)
    return kept


def load(name: str) -> dict:
    """A row's file; raises an InputError if it was not made yet."""
    path = RESULTS / f"{name}.json"
    if not path.exists():
        raise InputError(f"{path}: not there; make it by `make results ROW={name}`")
    return json.loads(path.read_text())


def pooled(parts: list[dict], what: str = "map_10cm") -> Value:
    """A figure of one estimator over all its rows (`_kept`), with its interval over people; without one for fewer than
    FEWEST_UNITS. `what` is map_10cm, moving_10cm or mean_error_cm.
    """
    people = [one for part in parts for one in part["per_person"].values()]
    labelled, missing, moving = (
        np.array([one[name] for one in people], float) for name in ("labelled_joints", "missing_joints", "moving_joints")
    )
    below = {"map_10cm": labelled, "moving_10cm": moving, "mean_error_cm": labelled - missing}[what][:, None]
    above = below * np.array([[one[what] or 0.0] for one in people])
    if not below.sum():
        return Value(None)
    bootstrap = Bootstrap(np.arange(len(people)), 0)
    unit = "cm" if what == "mean_error_cm" else "%"
    return Value(float(above.sum() / below.sum()), unit, bootstrap.interval(above, below))


def _single(parts: list[dict]) -> str:
    """The figure of each row, or of each person where there is one row of few people."""
    found = parts if len(parts) > 1 else list(parts[0]["per_person"].values())
    if len(parts) == 1 and len(found) >= FEWEST_UNITS:
        return ""
    return ", ".join(f"{100 * one['map_10cm']:.1f}" for one in found)


def joints_table(chosen: list[dict]) -> Table:
    """Groups of rows: `set` names them, `rows` are pooled, `estimators` maps their names to what the table calls them."""
    table = Table(["benchmark", "estimator", "within 10 cm", "single seeds or people", "moving joints", "mean error"], [])
    for group in chosen:
        files = [load(name) for name in group["rows"]]
        for number, (label, shown) in enumerate(group["estimators"].items()):
            name, _, definition = label.partition("/")
            parts = [file["estimators"][name] for file in files]
            parts = [part["in_label_definition"] for part in parts] if definition else parts
            figures = [pooled(parts, what) for what in ("map_10cm", "moving_10cm", "mean_error_cm")]
            table.rows.append([group["set"] if not number else "", shown, figures[0], _single(parts), *figures[1:]])
    return table


SCORERS = {"dance22": "ours", "paper": "paper", "raptis": "[17]"}


def dances_table(chosen: list[dict]) -> Table:
    """Dances whose learners' scores are in order; groups as those of `joints_table`.

    Where `independent` is false (dances that are excerpts of few recordings) there are no intervals and tests by dance.
    """
    pairs = [("dance22", "paper"), ("dance22", "raptis")]
    heads = (f"only {SCORERS[one]}, only {SCORERS[other]} in order" for one, other in pairs)
    table = Table(["dances", "joints of", "mean error", *SCORERS.values(), *heads], [])
    for group in chosen:
        files = [load(name) for name in group["rows"]]
        dances = sum(file["benchmark"]["dances"] for file in files)
        for number, (label, shown) in enumerate(group["estimators"].items()):
            parts = [file["estimators"][label] for file in files]
            wrong = {
                scorer: [(k, dance) for k, part in enumerate(parts) for dance in part["scorers"][scorer]["wrong"]]
                for scorer in SCORERS
            }
            figures = []
            for count in (dances - len(those) for those in wrong.values()):
                interval = wilson_interval(count, dances) if group["independent"] else None
                figures.append(Value(count / dances, "%", interval, digits=0))
            compared = []
            for one, other in pairs:
                alone = in_order_by_one(wrong[one], wrong[other])
                p = mcnemar_p_value(*alone)
                tested = f" (p {f'{p:.3f}' if p >= 0.001 else '< 0.001'})" if group["independent"] else ""
                compared.append("{}, {}".format(*alone) + tested)
            error = None if parts[0]["mean_error_cm"] is None else float(np.mean([part["mean_error_cm"] for part in parts]))
            table.rows.append([group["set"] if not number else "", shown, Value(error, "cm", digits=1), *figures, *compared])
    return table


ROOMS = {"people_recall": "recall", "people_precision": "precision", "map_10cm": "joints", "mota": "MOTA", "idf1": "IDF1"}


def rooms_table(chosen: list[dict]) -> Table:
    """Films of several people, in percent, a figure of each seed in a cell: `rows`, of one estimator, and `before`, a file of
    joints of the same images by what was there before. The last row holds the intervals of the one above it.
    """
    (group,) = chosen
    earlier, files = load(group["before"]), {name: load(name)["estimators"][group["estimator"]] for name in group["rows"]}
    table = Table(["scene", *ROOMS.values(), "joints before"], [])

    def cell(numbers: Iterable[float | None]) -> str:
        return ", ".join("-" if number is None else f"{100 * number:.1f}" for number in numbers)

    def span(interval: list[float] | None) -> str:
        return "-" if interval is None else "{:.0f} to {:.0f}".format(*(100 * end for end in interval))

    for scene in group["scenes"]:
        parts = [file[scene] for file in files.values()]
        before = (earlier[name][group["estimator"]][scene]["map_10cm"] for name in files)
        table.rows.append([scene.replace("_", " "), *(cell(part[name] for part in parts) for name in ROOMS), cell(before)])
    intervals = (", ".join(span(part["interval"][name]) for part in parts) for name in ROOMS)
    table.rows.append(["95 % intervals over films and images", *intervals, ""])
    return table


TABLES = {"joints": joints_table, "readme": joints_table, "dances": dances_table, "rooms": rooms_table}
"""What makes each table of the pages."""


def filled(page: str) -> str:
    """The text of a page with its tables made anew, and the figures that name their file renewed."""
    tables = tomllib.loads((RESULTS / "tables.toml").read_text())

    def block(found: re.Match) -> str:
        return found[1] + TABLES[found[2]](tables[found[2]]).markdown() + "\n" + found[3]

    def renewed(found: re.Match) -> str:
        shown, unit, reference = found.groups()
        number = figure(reference)
        # Without a unit a fraction stands in percent or as it is: as what is nearer to what stood there.
        percent = abs(number) <= 1 if unit == " %" else abs(100 * number - float(shown)) < abs(number - float(shown))
        return f"{100 * number if percent else number:.{len(shown.partition('.')[2])}f}{unit}<!-- {reference} -->"

    return REFERENCE.sub(renewed, BLOCK.sub(block, page))


def referenced(page: str) -> Iterator[tuple[str, str]]:
    """Every percentage, length and difference outside the tables and the code, and what the comment behind it refers to.

    The comment is `<!-- NAME:key/key -->`; "" without one. It may stand behind a number without a unit too. Limits (within 10
    cm) and levels (95 % intervals) are no figures.
    """
    text = re.sub(r"```.*?```|`[^`\n]*`", "", BLOCK.sub("", page), flags=re.DOTALL)
    unit, comment = r" (?:%|cm|points)(?! (?:bootstrap|interval))", r"<!-- ([\w./:, -]+) -->"
    number = r"(?<!ithin )(?<!below )(?<!than )((?:(?<=[\s(\[])-)?\b\d+(?:\.\d+)?)"
    for found in re.finditer(rf"{number}(?:{unit}(?:{comment})?|{comment})", text):
        yield found[1], found[2] or found[3] or ""


def figure(reference: str) -> float:
    """The number that NAME:key/key stands for: in results/NAME.json, by keys and places in lists."""
    name, _, keys = reference.partition(":")
    found: Any = load(name)
    for key in keys.split("/"):
        found = found[int(key)] if isinstance(found, list) else found[key]
    return found


def states(shown: str, number: float) -> bool:
    """Whether a figure of a page is the number, or the fraction in percent, rounded to its digits."""
    digits = len(shown.partition(".")[2])
    return shown in (f"{number:.{digits}f}", f"{100 * number:.{digits}f}")


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("make", help="runs the commands of rows, writes their files").add_argument("rows", nargs="+")
    commands.add_parser("pages", help="writes tables and figures into the pages")
    given = parser.parse_args()
    if given.command == "make":
        for name in given.rows:
            make(name)
    else:
        for path in (*PAGES, *ALSO):
            path.write_text(filled(path.read_text()))


if __name__ == "__main__":
    main()
