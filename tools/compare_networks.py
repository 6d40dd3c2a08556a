r"""Compares ways to train a network on one benchmark, each by several trainings, joint group by joint group.

    python tools/compare_networks.py eval_sim data/eval_sim --result results/trainings_eval_sim.json \
        --way dense=RUN_0,RUN_1,RUN_2,RUN_3,RUN_4 --way ridge=RUN_5,RUN_6,RUN_7,RUN_8,RUN_9 --pair ridge-dense

Run from the root of a checkout with `PYTHONPATH=.`. The figure of a way is the mean of those of its trainings. `--pair A-B` is
the figure of A less that of B, training by training in the order given: trainings of one seed stand at one place. Each figure
has two intervals: of other trainings, judged by the same people (Student's); and of other trainings judged by other people (or
whatever unit the benchmark has), where there are enough of both (`crossed_interval`). Where the
labels of a benchmark have a definition of their own (UTD-MHAD), the same tables follow in it, fitted on the other people.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import stdtrit

from kpopnet.datasets.point_clouds import PointCloudConfig
from kpopnet.datasets.protocol import Benchmark
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.evaluation.intervals import FEWEST_UNITS, LEVEL, Bootstrap, interval_of
from kpopnet.evaluation.poses.definition import in_label_definition
from kpopnet.evaluation.poses.metrics import PoseResults
from kpopnet.evaluation.poses.run import run_benchmark
from kpopnet.evaluation.registry import BENCHMARKS, build_benchmark
from kpopnet.networks.checkpoint import read_meta
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.programs.evaluate import EVALUATIONS
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.provenance import measured_by
from kpopnet.skeleton import JOINT_GROUPS, NUM_JOINTS

GROUPS = {"all": tuple(range(NUM_JOINTS)), **{name: tuple(map(int, joints)) for name, joints in JOINT_GROUPS.items()}}

SETS = sorted(name for name, (schema, _) in BENCHMARKS.items() if name not in EVALUATIONS and schema is not PointCloudConfig)
"""The benchmarks of one person, but those whose joints have ids, of which a map would have to be given."""


def way(text: str) -> tuple[str, list[str]]:
    """NAME=RUN,RUN as the way's name and its runs."""
    name, _, runs = text.partition("=")
    if not name or not runs or "-" in name:
        raise argparse.ArgumentTypeError(f"{text}: expected NAME=RUN,RUN with a name without -")
    listed = runs.split(",")
    if len(set(listed)) < len(listed):  # intervals would take it for two trainings
        raise argparse.ArgumentTypeError(f"{text}: names a training twice")
    return name, listed


def check_pairs(pairs: list[str], ways: dict[str, list[str]]) -> None:
    """Raises an InputError for pairs of unknown ways, or of unequal numbers of trainings."""
    for pair in pairs:
        sides = pair.split("-")
        if len(sides) != 2 or not set(sides) <= ways.keys():
            raise InputError(f"--pair {pair}: expected A-B of the ways {', '.join(ways)}")
        first, second = (len(ways[name]) for name in sides)
        if first != second:
            raise InputError(f"--pair {pair}: compares training by training, found {first} and {second} trainings")


def errors_m(results: list[PoseResults], joints: tuple[int, ...]) -> np.ndarray:
    """(N, S, K) errors of S trainings in N frames; NaN without a label, infinite where a joint is missing."""
    return np.stack([one.errors_m()[:, list(joints)] for one in results], axis=1)


def figures(first: list[PoseResults], second: list[PoseResults] | None = None) -> dict[str, dict]:
    """By joint group: percent within 10 cm and mean error in cm, as `_over_trainings` has them; or less those of `second`.

    Mean errors are compared over the joints that both networks found, as in `kpopnet.evaluation.poses.metrics.difference`.
    """
    found = {}
    for group, joints in GROUPS.items():
        one, other = errors_m(first, joints), None if second is None else errors_m(second, joints)
        labelled, both = ~np.isnan(one), np.isfinite(one) & np.isfinite(0 if other is None else other)
        near = 100.0 * (one < 0.10) - (0 if other is None else 100.0 * (other < 0.10))
        cm = 100 * (np.where(both, one, 0) - (0 if other is None else np.where(both, other, 0)))
        found[group] = {
            "within_10cm": _over_trainings(near, labelled, first[0].unit),
            "mean_cm": _over_trainings(cm, both, first[0].unit),
        }
    return found


def _over_trainings(values: np.ndarray, counted: np.ndarray, unit: np.ndarray) -> dict:
    """The mean over S trainings of the ratio of the sums of two (N, S, K) arrays, its intervals, and the ratios.

    Everything is None where a training has nothing that counts.
    """
    above, below = values.sum(axis=2, dtype=float), counted.sum(axis=2, dtype=float)
    if not below.sum(axis=0).all():
        return dict.fromkeys(("value", "other_trainings", "other_trainings_and_units", "by_training"))
    by_training = above.sum(axis=0) / below.sum(axis=0)
    units, trainings = Bootstrap(unit, 0), Bootstrap(np.arange(len(by_training)), 1)
    sums = units.sums(above), units.sums(below)
    drawn = np.divide(*sums, out=np.full_like(sums[0], np.nan), where=sums[1] > 0)
    return {
        "value": float(by_training.mean()),
        "other_trainings": mean_interval(by_training),
        "other_trainings_and_units": crossed_interval(drawn, trainings, units),
        "by_training": by_training.tolist(),
    }


def mean_interval(values: np.ndarray) -> list[float] | None:
    """Student's LEVEL interval [low, high] of the mean of (S,) independent values; None for fewer than FEWEST_UNITS."""
    if len(values) < FEWEST_UNITS:
        return None
    reach = stdtrit(len(values) - 1, (1 + LEVEL) / 2) * np.std(values, ddof=1) / np.sqrt(len(values))
    return [float(np.mean(values) - reach), float(np.mean(values) + reach)]


def crossed_interval(values: np.ndarray, trainings: Bootstrap, units: Bootstrap) -> list[float] | None:
    """The LEVEL interval of a mean over S trainings, each of which was judged by the same units; None where either are too few.

    Trainings and units are resampled independently: Owen, "The pigeonhole bootstrap", Annals of Applied Statistics 1(2), 2007,
    which is never too narrow in the mean. The ends are the percentiles of the fewer of both. `values` are (DRAWS, S), the
    figure of each training in the resamples of the units; the resamples of the trainings have other random numbers.
    """
    if min(trainings.units, units.units) < FEWEST_UNITS:
        return None
    times = trainings.sums(np.eye(trainings.units))
    return interval_of((times * values).sum(axis=1) / trainings.units, min(trainings.units, units.units))


def in_the_labels_definition(results: dict[str, PoseResults]) -> dict[str, PoseResults]:
    """The results with every estimate moved to the joints that the labels define, fitted on the other people."""
    return {
        run: replace(one, estimate_m=in_label_definition(one.truth_m, one.estimate_m, one.person))
        for run, one in results.items()
    }


def compare(results: dict[str, PoseResults], ways: dict[str, list[str]], pairs: list[str]) -> dict[str, dict]:
    """The figures of every way, then the differences of every pair, by name."""
    of = {name: [results[run] for run in runs] for name, runs in ways.items()}
    found = {name: figures(of[name]) for name in ways}
    for pair in pairs:
        first, second = pair.split("-")
        found[pair] = figures(of[first], of[second])
    return found


def print_tables(title: str, found: dict[str, dict]) -> None:
    """A table in Markdown for each way and pair."""
    print(f"\n{title}, (95 % interval of other trainings) [of other trainings and units], by training")
    for name, groups in found.items():
        print(f"\n| {name} | within 10 cm | | mean error, cm | |\n|---|---|---|---|---|")
        for group, one in groups.items():
            print(f"| {group} | {_cells(one['within_10cm'], 1)} | {_cells(one['mean_cm'], 2)} |")


def _cells(figure: dict, digits: int) -> str:
    if figure["value"] is None:
        return "- | -"
    trainings, units = figure["other_trainings"], figure["other_trainings_and_units"]
    value = f"{figure['value']:.{digits}f}"
    value += " ({:.{d}f} to {:.{d}f})".format(*trainings, d=digits) if trainings else ""
    value += " [{:.{d}f} to {:.{d}f}]".format(*units, d=digits) if units else ""
    return f"{value} | {', '.join(f'{one:.{digits}f}' for one in figure['by_training'])}"


def measured(benchmark: Benchmark, ways: dict[str, list[str]], pairs: list[str], processes: int) -> dict[str, Any]:
    """Runs all networks on the benchmark: `compare` of the raw joints, and in the labels' definition where there is one."""
    networks: dict[str, Estimator] = {run: NetworkEstimator(run) for runs in ways.values() for run in runs}
    run = run_benchmark(benchmark, networks, processes=processes)
    if failed := run.about["failed_sequences"]:
        raise InputError(f"{benchmark.name}: {', '.join(failed)} failed")
    resampled = run.about["resampled"]
    found = {"unit": resampled["units"], "units": resampled["count"], "raw": compare(run.results, ways, pairs)}
    if "in_label_definition" in run.metrics[run.main]:
        found["in_label_definition"] = compare(in_the_labels_definition(run.results), ways, pairs)
    return found


def trained(run: str) -> dict[str, Any]:
    """How a training was made: its code, seed, network, samples and learning rate, of its checkpoint."""
    meta = read_meta(Path(run))
    config = meta["config"]
    network = {name: config["model"][name] for name in ("kind", "input", "crop_px")}
    samples = meta["step"] * config["training"]["batch_size"]
    return {"code": meta["git"], "seed": config["seed"], **network, "samples": samples, "lr": config["training"]["lr"]}


def rounded(found: Any) -> Any:
    """The same with numbers of four digits after the point."""
    if isinstance(found, dict):
        return {name: rounded(one) for name, one in found.items()}
    if isinstance(found, list):
        return [rounded(one) for one in found]
    return round(found, 4) if isinstance(found, float) else found


def program() -> None:
    """Command line, described in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("benchmark", choices=SETS, help="name of the benchmark")
    parser.add_argument("path", help="folder of its data")
    parser.add_argument("--way", type=way, action="append", required=True, help="NAME=RUN,RUN: trainings of several seeds")
    parser.add_argument("--pair", action="append", default=[], help="A-B: the difference of two ways")
    parser.add_argument("--processes", type=int, default=1, help="sequences worked on at once")
    parser.add_argument("--result", type=Path, required=True, help="the JSON file that is written")
    arguments = parser.parse_args()
    ways = dict(arguments.way)
    if len(ways) < len(arguments.way):
        parser.error("--way: give every way a name of its own")
    try:
        check_pairs(arguments.pair, ways)
        trainings = {run: trained(run) for runs in ways.values() for run in runs}
        schema, _ = BENCHMARKS[arguments.benchmark]
        benchmark = build_benchmark(schema(name=arguments.benchmark, path=arguments.path))
        found = measured(benchmark, ways, arguments.pair, arguments.processes)
    except InputError as error:
        parser.error(str(error))
    for name in ("raw", "in_label_definition"):
        if name in found:
            print_tables(f"{arguments.benchmark}, {name}", found[name])
    write_json(arguments.result, measured_by() | {"ways": ways, "trainings": trainings} | rounded(found), allow_nan=False)


if __name__ == "__main__":
    program()
