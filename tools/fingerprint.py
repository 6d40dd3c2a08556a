"""Computes figures and hashes that a refactoring must not change: shard, training, joints, scores.

    python tools/fingerprint.py /tmp/fingerprint    # writes /tmp/fingerprint/fingerprint.json

Run from the root of a checkout with `PYTHONPATH=.`; `compare_checkouts.py` does so for two checkouts and compares them.
"""

import argparse
import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

from kpopnet.dance.scoring import SCORERS
from kpopnet.datasets.dances.dance_set import open_set
from kpopnet.evaluation import engine
from kpopnet.evaluation.dances.run import run_dances
from kpopnet.evaluation.poses.run import SequenceEstimation
from kpopnet.evaluation.registry import BENCHMARKS, ESTIMATORS, build_estimators
from kpopnet.finder.finder import FinderConfig
from kpopnet.runtime.atomic_write import write_json

SEQUENCES = 4
DANCES = 5


def run(*words: str) -> None:
    """Runs a command of the checkout."""
    subprocess.run([sys.executable, *words], check=True)


def digest(array: np.ndarray) -> str:
    """Sixteen hexadecimal digits of the array's type, shape and bytes."""
    described = f"{array.dtype.str}{array.shape}".encode()
    return hashlib.sha256(described + np.ascontiguousarray(array).tobytes()).hexdigest()[:16]


def file_digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def shards(folder: Path) -> dict[str, str]:
    """A clean shard, whole and by column, and a frozen one."""
    run("-m", "synth", "preset=demo", f"out={folder}", "splits={train:1000,validation:100,test:100}", "processes=2")
    found = {}
    for split in ("train", "validation", "test"):
        for path in sorted((folder / split).glob("*.h5")):
            found[f"shard/{split}/{path.name}"] = file_digest(path)
            with h5py.File(path) as file:
                found |= {f"shard/{split}/{path.name}/{name}": digest(np.asarray(file[name])) for name in file}
    return found


def training(data: Path, folder: Path) -> dict[str, str]:
    """Weights after 50 steps of two networks, one of them with the ridge channel."""
    sets = [f"data.train={data}/train", f"data.validation={data}/validation", "threads=1", "training.steps=50"]
    sets += ["training.validate_every=25", "training.validation_samples=64"]
    found = {}
    for name, model in {"dense": ["model.crop_px=64"], "ridge": ["model=holistic", "model.input=depth_ridge"]}.items():
        run("train.py", *sets, *model, f"hydra.run.dir={folder}/{name}")
        found[f"training/{name}"] = file_digest(folder / name / "last" / "model.safetensors")
    return found


def joints(name: str, folder: Path, checkpoint: Path) -> dict[str, str]:
    """Joints by every estimator in some sequences of a simulated benchmark."""
    path = folder / name
    run("-m", "synth", f"benchmark={name}", f"benchmark.sequences={SEQUENCES}", f"out={path}", "processes=2")
    settings, reader = BENCHMARKS[name]
    benchmark = reader(settings(name=name, path=str(path)))
    tracker, paper_tracker = ESTIMATORS["tracker"][0], ESTIMATORS["paper_tracker"][0]
    estimators = {
        "tracker": tracker(),
        "tracker_from_label": tracker(start="label"),
        "tracker_with_network": tracker(network=str(checkpoint)),
        "paper_tracker": paper_tracker(),
        "paper_tracker_repaired": paper_tracker(repaired=True),
        "paper_tracker_depth": paper_tracker(candidates="depth"),
        "network": ESTIMATORS["network"][0](checkpoint=str(checkpoint)),
        "fitted_network": ESTIMATORS["fitted_network"][0](checkpoint=str(checkpoint)),
    }
    work = SequenceEstimation(benchmark, build_estimators(estimators), FinderConfig())
    estimated, failed = engine.run(work, benchmark.sequence_names(), 1, name)
    found = {f"joints/{name}/{sequence}": f"failed: {reason}" for sequence, reason in failed.items()}
    for sequence, outcome in estimated.items():
        for estimator, results in outcome.results.items():
            found[f"joints/{name}/{sequence}/truth"] = digest(results.truth_m)
            found[f"joints/{name}/{sequence}/{estimator}"] = digest(results.estimate_m)
    return found


def scores(folder: Path, checkpoint: Path) -> dict[str, list[float]]:
    """Scores of every learner of some simulated dances, by source of joints and scorer."""
    path = folder / "kpop_sim"
    run("-m", "synth", "benchmark=kpop_sim", f"benchmark.dances={DANCES}", f"out={path}", "processes=2")
    dances = open_set(BENCHMARKS["kpop_sim"][0](name="kpop_sim", path=str(path)))
    estimators = {
        "tracker": ESTIMATORS["tracker"][0](),
        "network": ESTIMATORS["network"][0](checkpoint=str(checkpoint)),
    }
    done = run_dances(dances, estimators, SCORERS, folder / "poses", DANCES, seed=0, processes=2)
    return {
        f"score/{source}/{scorer}/{dance}/{learner.name}": [
            learner.score.similarity, learner.score.timing, learner.score.posture, *learner.score.windows.similarity.tolist()
        ]
        for (source, scorer), by_dance in done.scores.items()
        for dance, learners in by_dance.items()
        for learner in learners
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="for everything made; emptied first")
    given = parser.parse_args()
    folder = given.folder.resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    found: dict[str, object] = dict(shards(folder / "data"))
    found |= training(folder / "data", folder / "training")
    checkpoint = folder / "training" / "dense" / "last"
    for name in ("eval_sim", "smmc10_sim"):
        found |= joints(name, folder, checkpoint)
    found |= scores(folder, checkpoint)
    write_json(folder / "fingerprint.json", found)


if __name__ == "__main__":
    main()
