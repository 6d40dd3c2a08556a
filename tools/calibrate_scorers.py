"""Chooses alpha, beta and tau of Eqs. (13) and (14) by one rule for every dance scorer, and compares the scorers afterwards.

    export PYTHONPATH=.
    python tools/calibrate_scorers.py choose outputs/scorers --result results/scorers_chosen.json
    python tools/calibrate_scorers.py compare outputs/scorers --recordings PACK --chosen results/scorers_chosen.json \
        --result results/scorers_compared.json

True joints of the dances of `kpop_sim`; nothing is rendered. A learner's body faces the camera from a place up to 15 degrees to
either side, as in the set, before the set's views; no angle of a dance feature depends on more of the place.

`choose`: of the grid ALPHAS x BETAS x TAUS, the same for all scorers, what orders the largest share of pairs of learners, the
mean of both families of faults, and of equals what has the largest mean difference of neighbouring learners; under bounds: the
mean copy of a teacher scores at least 96, a late copy what LATE says, and in 95 % of the dances standing still less than 20 and
another dance less than 30. Where nothing keeps the bounds, what exceeds them by the fewest points in all. Every second dance of
the split train is chosen on; the others say what the choice is worth.

`compare`: the scorers with the settings of `SCORERS` on dances of the split test, each of which should be looked at once; on
those of the first set also with all settings of --chosen, the report of `choose`, that keep the bounds with as many pairs.

Dances and their scores are kept in the folder: a program that was stopped goes on where it was.
"""

import argparse
import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

import kpopnet
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, Comparison, Scorer, TimeGrid
from kpopnet.errors import InputError
from kpopnet.evaluation.dances.ranking import is_ordered, mcnemar_p_value, wilson_interval
from kpopnet.evaluation.intervals import FEWEST_UNITS, Bootstrap, interval_of
from kpopnet.runtime.atomic_write import write_json, write_npz
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.runtime.provenance import measured_by
from synth.dances.faults import ENDS
from synth.dances.simulate import FPS, HEADING_STD_DEG, VIEW, KpopSim, KpopSimConfig
from synth.motion import MotionConfig
from synth.samples.sampler import body_rotations
from synth.scene.room import draw_view

ALPHAS = (0.1, 0.2, 0.31, 0.5, 1.0)
BETAS = (0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.8, 2.7)
TAUS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5)
COPY, STANDING, ANOTHER = 96.0, 20.0, 30.0
"""Bounds: least score of a copy, and of standing still and another dance what 95 % of the dances have to stay below."""

LATE = {0.1: (85.0, 98.0), 0.2: (65.0, 92.0), 0.3: (40.0, 80.0), 0.5: (0.0, 30.0)}
"""Bounds of the score of a copy by the seconds that it is late: what tests/kpopnet/dance/test_learners.py holds of ours."""

PLACE_DEG = 15.0


class DanceSet(NamedTuple):
    """Dances of kpop_sim; see `KpopSimConfig`."""

    split: str
    faults: str
    seed: int
    dances: int
    recorded: bool = False


TRAINING = {
    "skill": DanceSet("train", "skill", 2401, 30),
    "mixed": DanceSet("train", "mixed", 2402, 30),
    "ends": DanceSet("train", "ends", 2403, 30),
}
HELD_BACK = {
    "composed": DanceSet("test", "skill", 2404, 60),
    "composed, mixed faults": DanceSet("test", "mixed", 2405, 60),
    "recorded, mixed faults": DanceSet("test", "mixed", 2414, 22, recorded=True),
}


class Dance(NamedTuple):
    """A teacher's (T, 15, 3) joints, those of four learners, the best first, in metres, and the motion's name."""

    teacher_m: np.ndarray
    learners_m: np.ndarray
    motion: str


def dance(sim: KpopSim, index: int) -> Dance:
    """Dance `index` as true joints."""
    learners_m = {}
    for number, level in enumerate(sim.levels(index)):
        person, rng = sim._person(sim._rng("learner", index, number, 0)), sim._rng("place", index, number, 0)
        yaw_rad = np.radians(HEADING_STD_DEG * rng.normal() + rng.uniform(-PLACE_DEG, PLACE_DEG))
        motion, view = sim.learner(index, number).motion, draw_view(rng, VIEW)
        local = body_rotations(sim.studio.scene.asset, motion.quats, yaw_rad, np.zeros(2))
        learners_m[level] = view.to_camera(sim.studio.joints_world_m(person, local, np.zeros((len(local), 3))))
    ordered = [learners_m[level] for level in sorted(learners_m)]
    return Dance(sim.teacher_joints_m(index), np.array(ordered, np.float32), sim.teacher_motion(index).name)


def dances(folder: Path, name: str, of: DanceSet, recordings: str | None) -> dict[Path, Dance]:
    """The dances of a set by their files, made where they are missing. Raises InputError if recordings are not given."""
    if of.recorded and recordings is None:
        raise InputError(f"{name}: give --recordings, a motion pack")
    motion = MotionConfig("clips", recordings) if of.recorded else MotionConfig("choreography")
    sim = KpopSim(motion=motion, benchmark=KpopSimConfig(split=of.split, faults=of.faults, seed=of.seed, dances=of.dances))
    found = {}
    for index in tqdm(range(of.dances), f"{name}: dances", unit="dance"):
        path = folder / f"{of.split}_{of.faults}_{of.seed}" / f"{index:03d}.npz"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_npz(path, **dance(sim, index)._asdict())
        with np.load(path) as stored:
            found[path] = Dance(stored["teacher_m"], stored["learners_m"], str(stored["motion"]))
    return found


def performed(joints_m: np.ndarray) -> Performance:
    return Performance(joints_m, np.arange(len(joints_m)) / FPS)


def compared(one: Dance, scorers: Sequence[Scorer], learners_m: Sequence[np.ndarray]) -> list[list[Comparison]]:
    """The windows of each learner of a dance by each of some scorers with the same feature."""
    grid, found = TimeGrid(performed(one.teacher_m), scorers[0].feature), []
    learners = [grid.resampled(performed(joints_m), grid.frames) for joints_m in learners_m]
    for scorer in scorers:
        teacher = scorer.teacher(grid.teacher)
        found.append([Comparison(grid, teacher, False) for _ in learners])
        for comparison, joints in zip(found[-1], learners, strict=True):
            comparison.add(*joints, len(grid.frames))
            comparison.keep_windows(len(grid.frames))
    return found


# Choosing


def windows(path: Path, one: Dance, name: str) -> np.ndarray:
    """(B, L, 3, N) delay in seconds, posture and weight of the windows of the learners and of the teacher, with each of BETAS.

    Ours lets S_t decide between two matches of a window: here that of its settings before the choice.
    """
    folder = Path(kpopnet.__file__).parent / "dance"
    sources = [*sorted(folder.rglob("*.py")), *sorted(folder.glob("*.json"))]
    settings = hashlib.sha256(repr((BETAS, SCORERS[name])).encode() + b"".join(one.read_bytes() for one in sources))
    kept = path.with_name(f"{path.stem}.{name}.{settings.hexdigest()[:10]}.windows.npz")
    if not kept.exists():
        found = compared(one, [replace(SCORERS[name], beta=beta) for beta in BETAS], [*one.learners_m, one.teacher_m])
        of_runs = [[run.summary().windows for run in runs] for runs in found]
        write_npz(kept, windows=np.array([[(one.delay_s, one.posture, one.weight) for one in runs] for runs in of_runs]))
    with np.load(kept) as stored:
        return stored["windows"]


def scores(found: np.ndarray, alpha: float, tau: float, ours: bool) -> np.ndarray:
    """(..., L) scores of (..., L, 3, N) windows, Eqs. (13) and (15)."""
    delay_s, posture, weight = np.moveaxis(found, -2, 0)
    timing = 1 - np.minimum(1, np.exp((np.abs(delay_s) - tau) / (alpha * tau)))
    similarity = np.nan_to_num(timing) * posture / (1 - np.exp(-1 / alpha) if ours else 1)
    known = np.isfinite(similarity) * weight
    return (np.nan_to_num(similarity) * known).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1e-9)


class Merit(NamedTuple):
    """What scores of training dances are worth: points beyond the bounds, percentage of pairs in order, mean separation."""

    excess: float
    pairs: float
    separation: float
    bounded: dict[str, float]
    in_order: dict[str, float]


def merit(of: dict[str, np.ndarray], late: dict[float, float]) -> Merit:
    """`of`: (D, 5) scores of the dances of each set of TRAINING: four learners, the best first, and the teacher.

    `late` are the scores of a copy by its delay in seconds.
    """
    ends = of["ends"]
    bounded = {
        "a copy, mean": float(ends[:, -1].mean()),
        "standing still, 95th percentile": float(np.percentile(ends[:, ENDS.index("standing still")], 95)),
        "another dance, 95th percentile": float(np.percentile(ends[:, ENDS.index("another dance")], 95)),
    }
    copy, standing, another = bounded.values()
    excess = max(COPY - copy, 0) + max(standing - STANDING, 0) + max(another - ANOTHER, 0)
    for delay_s, (least, most) in LATE.items():
        bounded[f"a copy {delay_s} s late"] = late[delay_s]
        excess += max(least - late[delay_s], 0) + max(late[delay_s] - most, 0)
    ordered, separation, in_order = [], [], {}
    for family in ("skill", "mixed"):
        learners = of[family][:, :4]
        ordered.append(np.mean([learners[:, a] > learners[:, b] for a, b in combinations(range(4), 2)]))
        separation.append(-np.diff(learners, axis=1).mean())
        in_order[family] = 100 * float(np.mean([is_ordered(one) for one in learners]))
    return Merit(round(excess, 1), 100 * float(np.mean(ordered)), float(np.mean(separation)), bounded, in_order)


def chosen(found: dict[str, np.ndarray], name: str) -> dict[str, Any]:
    """The settings of a scorer by the rule, from (D, B, L, 3, N) `windows` of the dances of each set, with their merit."""
    of_half: list[dict[tuple, Merit]] = [{}, {}]
    for half, (alpha, tau) in product((0, 1), product(ALPHAS, TAUS)):
        ours = name == "dance22"
        by_set = {key: scores(one[half::2], alpha, tau, ours) for key, one in found.items()}
        late = {delay_s: float(scores(np.array([[delay_s], [100.0], [1.0]]), alpha, tau, ours)) for delay_s in LATE}
        for b, beta in enumerate(BETAS):
            of_half[half][alpha, beta, tau] = merit({key: one[:, b] for key, one in by_set.items()}, late)
    best, other = map(_best, of_half)
    before = SCORERS[name].alpha, SCORERS[name].beta, SCORERS[name].tau
    report = {"settings": dict(zip(("alpha", "beta", "tau"), best, strict=True))}
    for half, of in zip(("chosen on", "checked on"), of_half, strict=True):
        report[half] = of[best]._asdict() | ({"settings before": of[before]._asdict()} if before in of else {})
    kept = {at: one for at, one in of_half[0].items() if one.excess == 0}
    return report | {
        "keep the bounds": f"{len(kept)} of {len(of_half[0])}",
        "within them, with as many pairs": [list(at) for at, one in kept.items() if one.pairs == of_half[0][best].pairs],
        "best on the other half": {"settings": other, "pairs": of_half[1][other].pairs},
    }


def _best(of: dict[tuple, Merit]) -> tuple:
    return max(of, key=lambda at: (-of[at].excess, of[at].pairs, of[at].separation))


def choose(folder: Path) -> dict[str, Any]:
    """The report of `choose`."""
    of_set: dict[str, dict[str, list]] = {name: {key: [] for key in TRAINING} for name in SCORERS}
    for key, of in TRAINING.items():
        made = dances(folder, key, of, None)
        for name in SCORERS:
            for path, one in tqdm(made.items(), f"{key}: {name}", unit="dance"):
                of_set[name][key].append(windows(path, one, name))
    return {name: chosen({key: _stacked(one) for key, one in by_set.items()}, name) for name, by_set in of_set.items()}


def _stacked(found: list[np.ndarray]) -> np.ndarray:
    """Arrays of (..., N) windows as one, those that a shorter dance lacks with no weight."""
    longest = max(one.shape[-1] for one in found)
    return np.stack([np.pad(one, [(0, 0)] * 3 + [(0, longest - one.shape[-1])]) for one in found])


# Comparing


def compare(folder: Path, recordings: str | None, tied: dict[str, list[list[float]]]) -> dict[str, Any]:
    """The report of `compare`; `tied`: the settings of each scorer that do as well by the rule."""
    report: dict[str, Any] = {}
    for key, of in HELD_BACK.items():
        if of.recorded and recordings is None:
            continue
        made, found = list(dances(folder, key, of, recordings).values()), {}
        for name, scorer in SCORERS.items():
            runs = [compared(one, [scorer], list(one.learners_m))[0] for one in tqdm(made, f"{key}: {name}", unit="dance")]
            found[name] = np.array([[learner.so_far for learner in one] for one in runs])
        if not report:
            of_tied = {name: with_settings(made, name, settings, found["dance22"]) for name, settings in tied.items()}
        unit = [re.sub(r"_s[0-9]+$", "", one.motion) for one in made] if of.recorded else list(map(str, range(len(made))))
        report[key] = of._asdict() | agreement(found, unit) | ({"recordings": unit} if of.recorded else {})
    return report | {"settings that tie": of_tied}


def with_settings(made: list[Dance], name: str, settings: list[list[float]], ours: np.ndarray) -> list[dict[str, Any]]:
    """Dances in the right order by a scorer with each of some settings, and how that differs from our (D, 4) scores."""
    scorers = [replace(SCORERS[name], alpha=alpha, beta=beta, tau=tau) for alpha, beta, tau in settings]
    by_dance = [compared(one, scorers, list(one.learners_m)) for one in tqdm(made, f"{name}: settings that tie", unit="dance")]
    found, right = [], np.array([is_ordered(one) for one in ours])
    for number, (alpha, beta, tau) in enumerate(settings):
        flags = np.array([is_ordered([learner.so_far for learner in one[number]]) for one in by_dance])
        only_ours, only_other = int((right & ~flags).sum()), int((flags & ~right).sum())
        about = {"alpha": alpha, "beta": beta, "tau": tau, "dances in order": int(flags.sum())}
        found.append(about | {"p against dance22": mcnemar_p_value(only_ours, only_other)})
    return found


def agreement(found: dict[str, np.ndarray], unit: list[str]) -> dict[str, Any]:
    """Dances in the right order by each scorer, from its (D, 4) scores, the best learner first, and the unit of each dance.

    Dances of different units are independent of each other. Where every dance is one, intervals are Wilson's and tests
    McNemar's; where a unit has several, both are intervals of a bootstrap over units: none below FEWEST_UNITS, nor where all
    dances agree, of which resamples say nothing; if all are in order, Wilson's with a unit as a trial.
    """
    number = {name: row for row, name in enumerate(dict.fromkeys(unit))}
    bootstrap, alone = Bootstrap(np.array([number[one] for one in unit]), 0), len(number) == len(unit)
    right = {name: np.array([is_ordered(one) for one in scores]) for name, scores in found.items()}

    def interval(values: np.ndarray) -> list[float] | None:
        return interval_of(100 * bootstrap.ratios(values[:, None], np.ones((len(values), 1))), len(number))

    scorers, pairs = {}, {}
    for name, flags in right.items():
        trials = (int(flags.sum()), len(flags)) if alone else (len(number), len(number))
        wilson = [100 * end for end in wilson_interval(*trials)] if len(number) >= FEWEST_UNITS else None
        in_order = np.mean([found[name][:, a] > found[name][:, b] for a, b in combinations(range(4), 2)])
        scorers[name] = {
            "dances in order": int(flags.sum()),
            "percent": 100 * float(flags.mean()),
            "interval": wilson if alone or flags.all() else interval(flags.astype(float)),
            "pairs of learners in order, percent": 100 * float(in_order),
            "in order, dance by dance": "".join("01"[int(flag)] for flag in flags),
        }
    for one, other in combinations(right, 2):
        only_one, only_other = int((right[one] & ~right[other]).sum()), int((right[other] & ~right[one]).sum())
        pairs[f"{one}, {other}"] = {"only the first": only_one, "only the second": only_other} | (
            {"p": mcnemar_p_value(only_one, only_other)}
            if alone
            else {"difference, points": interval(right[one].astype(float) - right[other])}
        )
    return {"units": len(number), "scorers": scorers, "pairs of scorers": pairs}


@user_errors
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=("choose", "compare"), help="choose settings on training dances, or compare scorers")
    parser.add_argument("folder", type=Path, help="where dances and their scores are kept")
    parser.add_argument("--recordings", help="a motion pack for the recorded dances, which are left out without it")
    parser.add_argument("--chosen", type=Path, help="the report of choose, of whose ties compare tells too")
    parser.add_argument("--result", type=Path, help="JSON file for the report, which is printed without it")
    options = parser.parse_args(arguments)
    tied = {}
    if options.chosen is not None:
        of_scorers = json.loads(options.chosen.read_text())["results"]
        tied = {name: one["within them, with as many pairs"] for name, one in of_scorers.items() if name != "dance22"}
    found = choose(options.folder) if options.part == "choose" else compare(options.folder, options.recordings, tied)
    seeds = {name: of.seed for name, of in (TRAINING if options.part == "choose" else HELD_BACK).items()}
    about = measured_by() | {
        "seeds": seeds,
        "settings": {name: [scorer.alpha, scorer.beta, scorer.tau] for name, scorer in SCORERS.items()},
    }
    if options.result is None:
        print(json.dumps(about | {"results": found}, indent=1))
    else:
        write_json(options.result, about | {"results": found})


if __name__ == "__main__":
    main()
