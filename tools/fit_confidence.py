"""Fits the weights from which the trackers and the refinement compute the confidence of joints.

The people are simulated, of seeds that no benchmark has, and dressed as those of the benchmarks are.

    python -m synth benchmark=eval_sim benchmark.seed=101 benchmark.sequences=8 out=data/confidence/101
    python -m synth benchmark=eval_sim benchmark.seed=102 benchmark.sequences=8 out=data/confidence/102
    python tools/fit_confidence.py data/confidence/101 data/confidence/102 --checkpoint outputs/train/RUN/best

prints new values of the weights in `kpopnet.tracker.confidence` and `kpopnet.paper_tracker.tracker`: logistic
regressions of whether a joint is within 10 cm of the truth. The sets of an evaluation must not be used: no other set has these
seeds. Run from the root of a checkout with `PYTHONPATH=.`.
"""

import argparse
from collections.abc import Sequence

import numpy as np
from tqdm import tqdm

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import BenchmarkConfig
from kpopnet.datasets.simulated import SimulatedBenchmark
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.evaluation.poses.confidence import WITHIN_M, Judged, calibration_error
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.paper_tracker.tracker import CONFIDENCE_WEIGHTS, PaperTracker, PaperTrackerConfig
from kpopnet.pose.extraction import extract_person
from kpopnet.runtime.hydra_app import user_errors
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.confidence import REFINED_WEIGHTS, TRACKED_WEIGHTS, probability
from kpopnet.tracker.refine import refine
from kpopnet.tracker.tracker import Tracker

SHIPPED = {"TRACKED_WEIGHTS": TRACKED_WEIGHTS, "CONFIDENCE_WEIGHTS": CONFIDENCE_WEIGHTS, "REFINED_WEIGHTS": REFINED_WEIGHTS}

NEWTON_STEPS = 25
RIDGE = 1e-6
"""Weight of the squared weights: keeps them finite where the evidence separates hits from misses."""

Labelled = tuple[np.ndarray, np.ndarray]
"""(N, K) evidence of joints, as the modules of the weights define it, and (N,) their distance from the truth, metres."""


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


def labelled(depth_m: np.ndarray, camera: Camera, truth_m: np.ndarray, network: Estimator) -> dict[str, Labelled]:
    """For each kind of weights the joints of a person, of whom there are (T, H, W) depth and (T, 15, 3) true joints, metres."""
    estimates = (
        tracked(depth_m, Tracker(camera)),
        tracked(depth_m, PaperTracker(camera, PaperTrackerConfig(repaired=True))),
        refine(network.estimate(depth_m, camera), depth_m, camera),
    )
    found = {}
    for name, (joints_m, evidence) in zip(SHIPPED, estimates, strict=True):
        error_m = np.linalg.norm(joints_m - truth_m, axis=-1)
        known = np.isfinite(error_m) & np.isfinite(evidence).all(axis=-1)
        found[name] = evidence[known], error_m[known]
    return found


def describe(name: str, evidence: np.ndarray, error_m: np.ndarray) -> str:
    """Source text of the weights fitted to joints, and how well these and the shipped ones are calibrated on them.

    Raises InputError if all joints are hits, or none.
    """
    hit = error_m < WITHIN_M
    if hit.all() or not hit.any():
        raise InputError(f"{name}: {hit.sum()} of {len(hit)} joints are within 10 cm: nothing to learn from; give more people")
    weights = logistic_weights(evidence, hit)
    fitted, shipped = (
        calibration_error(Judged(error_m, probability(evidence, tuple(one)))) for one in (weights, SHIPPED[name])
    )
    return (
        f"{name} = ({', '.join(f'{weight:.3f}' for weight in weights)})\n"
        f"    {len(hit)} joints, {hit.mean():.1%} within 10 cm; calibration error {fitted:.3f}, of the shipped weights "
        f"{shipped:.3f}"
    )


@user_errors
def main(arguments: Sequence[str] | None = None) -> None:
    """Command line, described in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", help="simulated EVAL with seeds of its own")
    parser.add_argument("--checkpoint", required=True, help="folder of the network whose joints are refined")
    options = parser.parse_args(arguments)
    network, parts = NetworkEstimator(options.checkpoint), []
    for folder in options.folders:
        benchmark = SimulatedBenchmark(BenchmarkConfig("eval_sim", folder))
        for name in tqdm(benchmark.sequence_names(), folder, unit="sequence"):
            sequence = benchmark.read(name)
            person_m = extract_person(sequence.depth_m, sequence.camera)
            parts.append(labelled(person_m, sequence.camera, sequence.joints_camera_m, network))
    for name in SHIPPED:
        print(describe(name, *(np.concatenate(arrays) for arrays in zip(*(part[name] for part in parts), strict=True))))


if __name__ == "__main__":
    main()
