r"""Compares ways to train a network on one benchmark, each by networks of several seeds, joint group by joint group.

    python tools/compare_networks.py eval_sim data/eval_sim --out outputs/comparison \
        --way dense=RUN_0,RUN_1 --way dense_ridge=RUN_2,RUN_3 --way holistic=RUN_4,RUN_5 --way holistic_ridge=RUN_6,RUN_7 \
        --pair dense_ridge-dense --pair dense_ridge+holistic_ridge-dense+holistic

Run from the root of a checkout with `PYTHONPATH=.`. The figures of a way are those of all frames of all its networks. `--pair
A-B` prints how much larger the figures of A are than those of B, and A+C are the networks of both ways. Sequences are resampled
for the intervals (`kpopnet.evaluation.intervals`), the same ones for both; networks are not, so an interval tells what other
sequences would do, and the differences of single seeds beside it tell what other trainings would. Where the labels of a
benchmark have a definition of their own (UTD-MHAD), the same tables follow in it, fitted on the other people. Writes
comparison.json.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from kpopnet.datasets.protocol import Benchmark
from kpopnet.errors import InputError
from kpopnet.evaluation.intervals import Bootstrap
from kpopnet.evaluation.poses.definition import in_label_definition
from kpopnet.evaluation.poses.metrics import PoseResults
from kpopnet.evaluation.poses.run import run_benchmark
from kpopnet.evaluation.registry import BENCHMARKS, build_benchmark
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.programs.evaluate import EVALUATIONS
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.skeleton import JOINT_GROUPS, NUM_JOINTS

GROUPS = {"all": tuple(range(NUM_JOINTS)), **{name: tuple(map(int, joints)) for name, joints in JOINT_GROUPS.items()}}


def way(text: str) -> tuple[str, list[str]]:
    """NAME=RUN,RUN as the way's name and its runs."""
    name, _, runs = text.partition("=")
    if not name or not runs or set(name) & set("+-"):
        raise argparse.ArgumentTypeError(f"{text}: expected NAME=RUN,RUN with a name without + and -")
    return name, runs.split(",")


def check_pairs(pairs: list[str], ways: dict[str, list[str]]) -> None:
    """Raises an InputError for pairs of unknown ways, or of unequal numbers of networks."""
    for pair in pairs:
        sides = [side.split("+") for side in pair.split("-")]
        if len(sides) != 2 or not {name for side in sides for name in side} <= ways.keys():
            raise InputError(f"--pair {pair}: expected A-B or A+C-B+D of the ways {', '.join(ways)}")
        counts = [sum(len(ways[name]) for name in side) for side in sides]
        if counts[0] != counts[1]:
            raise InputError(f"--pair {pair}: compares network by network, found {counts[0]} and {counts[1]} networks")


def errors_m(results: list[PoseResults], joints: tuple[int, ...]) -> np.ndarray:
    """(N, S, K) errors of S networks in N frames; NaN without a label, infinite where a joint is missing."""
    return np.stack([one.errors_m()[:, list(joints)] for one in results], axis=1)


def figures(results: list[PoseResults], seed: int) -> dict[str, dict]:
    """By joint group: percent within 10 cm and mean error in cm over all networks, each with its interval and by network."""
    found = {}
    for group, joints in GROUPS.items():
        errors = errors_m(results, joints)
        labelled, bootstrap = ~np.isnan(errors), Bootstrap(results[0].unit, seed)
        near, distance_cm = 100 * (errors < 0.10), 100 * np.where(np.isfinite(errors), errors, 0)
        found[group] = {
            "within_10cm": _pooled(near, labelled, bootstrap),
            "mean_cm": _pooled(distance_cm, np.isfinite(errors), bootstrap),
        }
    return found


def differences(first: list[PoseResults], second: list[PoseResults], seed: int) -> dict[str, dict]:
    """By joint group: the same figures of the first networks less those of the second, network by network in the order given.

    Mean errors are compared over the joints that both networks found, as in `kpopnet.evaluation.poses.metrics.difference`.
    """
    found = {}
    for group, joints in GROUPS.items():
        one, other = errors_m(first, joints), errors_m(second, joints)
        labelled, both = ~np.isnan(one), np.isfinite(one) & np.isfinite(other)
        bootstrap = Bootstrap(first[0].unit, seed)
        near = 100 * ((one < 0.10) & labelled).astype(float) - 100 * ((other < 0.10) & labelled)
        nearer_cm = np.where(both, 100 * (np.where(both, one, 0) - np.where(both, other, 0)), 0)
        found[group] = {"within_10cm": _pooled(near, labelled, bootstrap), "mean_cm": _pooled(nearer_cm, both, bootstrap)}
    return found


def _pooled(values: np.ndarray, counted: np.ndarray, bootstrap: Bootstrap) -> dict:
    """The ratio of the sums of two (N, S, K) arrays, its interval, and the same by network (S)."""
    flat = values.reshape(len(values), -1) * 1.0, counted.reshape(len(counted), -1)
    return {
        "value": _ratio(values.sum(), counted.sum()),
        "interval": bootstrap.interval(bootstrap.ratios(*flat)),
        "by_network": [_ratio(*sums) for sums in zip(values.sum(axis=(0, 2)), counted.sum(axis=(0, 2)), strict=True)],
    }


def _ratio(total: float, count: float) -> float | None:
    return float(total / count) if count else None


def in_the_labels_definition(benchmark: Benchmark, results: dict[str, PoseResults]) -> dict[str, PoseResults]:
    """The results with every estimate moved to the joints that the labels define, fitted on the other people."""
    names = next(iter(results.values())).sequence_names
    people = np.array([benchmark.read(name).identity for name in names])
    return {
        run: replace(one, estimate_m=in_label_definition(one.truth_m, one.estimate_m, people[one.sequence]))
        for run, one in results.items()
    }


def compare(results: dict[str, PoseResults], ways: dict[str, list[str]], pairs: list[str], seed: int = 0) -> dict[str, dict]:
    """The figures of every way, then the differences of every pair, by name."""

    def of(names: str) -> list[PoseResults]:
        return [results[run] for name in names.split("+") for run in ways[name]]

    single = {name: figures(of(name), seed) for name in ways}
    return single | {pair: differences(*map(of, pair.split("-")), seed) for pair in pairs}


def print_tables(title: str, found: dict[str, dict]) -> None:
    """A table in Markdown for each way and pair."""
    print(f"\n{title}, [95 % interval over other sequences], by seed")
    for name, groups in found.items():
        print(f"\n| {name} | within 10 cm | | mean error, cm | |\n|---|---|---|---|---|")
        for group, one in groups.items():
            print(f"| {group} | {_cells(one['within_10cm'], 1)} | {_cells(one['mean_cm'], 2)} |")


def _cells(figure: dict, digits: int) -> str:
    def text(value: float | None) -> str:
        return "-" if value is None else f"{value:.{digits}f}"

    low, high = figure["interval"] or (None, None)
    return f"{text(figure['value'])} [{text(low)}, {text(high)}] | {', '.join(map(text, figure['by_network']))}"


def measured(arguments: argparse.Namespace, ways: dict[str, list[str]]) -> dict[str, dict]:
    """Runs all networks on the benchmark: `compare` of the raw joints, and in the labels' definition where there is one."""
    schema, _ = BENCHMARKS[arguments.benchmark]
    benchmark = build_benchmark(schema(name=arguments.benchmark, path=arguments.path))
    networks = {run: NetworkEstimator(run) for runs in ways.values() for run in runs}
    results = run_benchmark(benchmark, networks, processes=arguments.processes).results
    found = {"raw": compare(results, ways, arguments.pair)}
    if hasattr(benchmark, "label_definition"):
        moved = in_the_labels_definition(benchmark, results)
        found["in the labels' definition"] = compare(moved, ways, arguments.pair)
    return found


def program() -> None:
    """Command line, described in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("benchmark", choices=sorted(BENCHMARKS.keys() - EVALUATIONS.keys()), help="name of the benchmark")
    parser.add_argument("path", help="folder of its data")
    parser.add_argument("--way", type=way, action="append", required=True, help="NAME=RUN,RUN: networks of several seeds")
    parser.add_argument("--pair", action="append", default=[], help="A-B or A+C-B+D: the difference of ways")
    parser.add_argument("--processes", type=int, default=1, help="sequences worked on at once")
    parser.add_argument("--out", type=Path, required=True, help="folder for comparison.json")
    arguments = parser.parse_args()
    ways = dict(arguments.way)
    if len(ways) < len(arguments.way):
        parser.error("--way: give every way a name of its own")
    try:
        check_pairs(arguments.pair, ways)
        found = measured(arguments, ways)
    except InputError as error:
        parser.error(str(error))
    for title, tables in found.items():
        print_tables(f"{arguments.benchmark}, {title}", tables)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with atomic_path(arguments.out / "comparison.json") as path:
        path.write_text(json.dumps({"ways": ways, **found}, indent=1, allow_nan=False) + "\n")


if __name__ == "__main__":
    program()
