"""Fits the weights from which the trackers and the refinement compute the confidence of joints, on simulated training people.

    python -m synth benchmark=eval_sim benchmark.seed=101 benchmark.sequences=8 out=data/confidence/101
    python -m synth benchmark=eval_sim benchmark.seed=102 benchmark.sequences=8 out=data/confidence/102
    python -m kpopnet.evaluation.poses.calibration data/confidence/101 data/confidence/102 --checkpoint outputs/train/RUN/best

prints new values of the weights in `kpopnet.tracker.fit.confidence` and `kpopnet.paper_tracker.confidence`: logistic
regressions of whether a joint is within 10 cm of the truth. The sets of an evaluation must not be used: no other set has these
seeds.
"""

import argparse
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.camera import Camera
from kpopnet.datasets.simulated import SimulatedBenchmark, SimulatedConfig
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.evaluation.poses.confidence import WITHIN_M, Judged, calibration_error
from kpopnet.extraction import extract_person
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.paper_tracker.confidence import WEIGHTS as PAPER_WEIGHTS
from kpopnet.paper_tracker.config import ALL_REPAIRS, PaperTrackerConfig
from kpopnet.paper_tracker.tracker import PaperTracker
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.fit.confidence import REFINED_WEIGHTS, TRACKED_WEIGHTS, probability
from kpopnet.tracker.fit.refine import refine
from kpopnet.tracker.tracker import Tracker

SHIPPED = {
    "TRACKED_WEIGHTS": TRACKED_WEIGHTS,
    "PAPER_WEIGHTS": PAPER_WEIGHTS,
    "REFINED_WEIGHTS": REFINED_WEIGHTS,
}

NEWTON_STEPS = 25
RIDGE = 1e-6
"""Weight of the squared weights: keeps them finite where the evidence separates hits from misses."""


class Labelled(NamedTuple):
    """Evidence of joints with a true position.

    Attributes:
        evidence: (N, K), as the modules of the weights define it.
        error_m: (N,) distance from the true position, metres.
    """

    evidence: np.ndarray
    error_m: np.ndarray


def logistic_weights(evidence: np.ndarray, hit: np.ndarray) -> np.ndarray:
    """(K,) weights of the logistic regression of (N,) hits on (N, K) evidence: maximum likelihood by Newton's method."""
    weights = np.zeros(evidence.shape[1])
    penalty = RIDGE * np.eye(len(weights))
    for _ in range(NEWTON_STEPS):
        chance = probability(evidence, tuple(weights))
        gradient = evidence.T @ (chance - hit) + penalty @ weights
        curvature = evidence.T @ (evidence * (chance * (1 - chance))[:, None]) + penalty
        weights = weights - np.linalg.solve(curvature, gradient)
    return weights


def tracked(depth_m: np.ndarray, tracker: Tracker | PaperTracker) -> tuple[np.ndarray, np.ndarray]:
    """(T, 15, 3) joints of a tracker that waits for the Y pose, NaN where missing, and (T, 15, 3) their evidence."""
    joints_m, evidence = np.full((len(depth_m), NUM_JOINTS, 3), np.nan), np.full((len(depth_m), NUM_JOINTS, 3), np.nan)
    for frame, image in enumerate(depth_m):
        joints_m[frame], _ = tracker.track(image)
        if tracker.evidence is not None:
            evidence[frame] = tracker.evidence
    return joints_m, evidence


def labelled_people(folders: Sequence[str]) -> Iterator[tuple[np.ndarray, Camera, np.ndarray]]:
    """(T, H, W) segmented depth in metres, camera and (T, 15, 3) true joints of every sequence in the folders.

    Raises:
        InputError: a folder is not of the command above.
    """
    for folder in folders:
        benchmark = SimulatedBenchmark(SimulatedConfig("eval_sim", folder))
        for name in tqdm(benchmark.sequence_names(), folder, unit="sequence"):
            sequence = benchmark.read(name)
            yield extract_person(sequence.depth_m, sequence.camera), sequence.camera, sequence.joints_camera_m


def labelled(truth_m: np.ndarray, joints_m: np.ndarray, evidence: np.ndarray) -> Labelled:
    """Of (T, 15, 3) joints those with truth, estimate and evidence."""
    error_m = np.linalg.norm(joints_m - truth_m, axis=-1)
    known = np.isfinite(error_m) & np.isfinite(evidence).all(axis=-1)
    return Labelled(evidence[known], error_m[known])


def gather(folders: Sequence[str], network: Estimator) -> dict[str, Labelled]:
    """All joints of all sequences with the evidence for each kind of weights, by the weights' name."""
    parts: dict[str, list[Labelled]] = {name: [] for name in SHIPPED}
    for depth_m, camera, truth_m in labelled_people(folders):
        found = (
            tracked(depth_m, Tracker(camera)),
            tracked(depth_m, PaperTracker(camera, PaperTrackerConfig(repairs=ALL_REPAIRS))),
            refine(network.estimate(depth_m, camera), depth_m, camera),
        )
        for part, one in zip(parts.values(), found, strict=True):
            part.append(labelled(truth_m, *one))
    return {name: Labelled(*map(np.concatenate, zip(*part, strict=True))) for name, part in parts.items()}


@user_errors
def main(arguments: Sequence[str] | None = None) -> None:
    """Command line, described in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", help="simulated EVAL with seeds of its own")
    parser.add_argument("--checkpoint", required=True, help="folder of the network whose joints are refined")
    options = parser.parse_args(arguments)
    for name, joints in gather(options.folders, NetworkEstimator(options.checkpoint)).items():
        print(describe(name, joints))


def describe(name: str, joints: Labelled) -> str:
    """Source text of the weights fitted to joints, and how well these and the shipped ones are calibrated on them.

    Raises:
        InputError: all joints are hits, or none.
    """
    hit = joints.error_m < WITHIN_M
    if hit.all() or not hit.any():
        raise InputError(f"{name}: {hit.sum()} of {len(hit)} joints are within 10 cm: nothing to learn from; give more people")

    def error(weights: Sequence[float]) -> float:
        return calibration_error(Judged(joints.error_m, probability(joints.evidence, tuple(weights))))

    weights = logistic_weights(joints.evidence, hit)
    return (
        f"{name} = ({', '.join(f'{weight:.3f}' for weight in weights)})\n"
        f"    {len(hit)} joints, {hit.mean():.1%} within 10 cm; calibration error {error(weights):.3f}, of the shipped weights "
        f"{error(SHIPPED[name]):.3f}"
    )


if __name__ == "__main__":
    main()
