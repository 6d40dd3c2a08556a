"""Judges a network on real depth in three ways: raw, in the labels' definition, and against a body fitted to the depth.

    python tools/real_check.py [outputs/train/RUN/best] --real /path/to/real --out outputs/real_check

The folder holds UTD-MHAD/ (Depth/ and Skeleton/, as published) and, if wanted, itop_side_test_3frames.npz (depth_mm, joints_m
with y up). Run from the root of a checkout with `PYTHONPATH=.`. Prints a table per joint group and writes real_check.json.

- raw: against the labels.
- SDK: against the labels, the network's joints moved by offsets that were fitted on the other people.
- body: against the joints of `posed_body.fit_body`, on fewer frames; "labels to body" says how far the labels are from it.
"""

import argparse
from pathlib import Path

import numpy as np
import torch
from posed_body import fit_body
from tqdm import tqdm

from kpopnet.datasets.itop import CAMERA as ITOP_CAMERA
from kpopnet.datasets.itop import FROM_ITOP
from kpopnet.datasets.utd_mhad import UtdMhadBenchmark, UtdMhadConfig
from kpopnet.estimator import Estimator
from kpopnet.evaluation.poses.definition import in_label_definition
from kpopnet.evaluation.poses.metrics import fraction_within, joint_errors_m, mean_error_m
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.pose.extraction import extract_person
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.endings import user_errors
from kpopnet.skeleton import JOINT_GROUPS, NUM_JOINTS

GROUPS = {"all": tuple(range(NUM_JOINTS)), **JOINT_GROUPS}
EDGE_FRAMES = 6
"""Frames at both ends of a sequence that are left out: the labels' lag leaves some of them without labels."""

MAX_RESIDUAL_M = 0.02
"""A frame is judged against the body only if half of its points are nearer to its surface."""


def figures(truth_m: np.ndarray, estimate_m: np.ndarray) -> dict[str, dict]:
    """By joint group: number of frames, fraction within 10 cm, mean error in cm."""
    errors_m = joint_errors_m(truth_m, estimate_m)
    return {
        name: {
            "frames": len(errors_m),
            "within_10cm": fraction_within(errors_m[:, list(joints)], 0.10),
            "mean_cm": 100 * mean_error_m(errors_m[:, list(joints)]),
        }
        for name, joints in GROUPS.items()
    }


class Frames:
    """N frames with labels of several people, and what a network estimates in them."""

    def __init__(self, benchmark: UtdMhadBenchmark, network: Estimator, every: int) -> None:
        person, names, depth_m, labels_m, estimate_m = [], [], [], [], []
        for name in tqdm(benchmark.sequence_names(), unit="sequence"):
            sequence = benchmark.read(name)
            rows = np.arange(EDGE_FRAMES, len(sequence.depth_m) - EDGE_FRAMES, every)
            rows = rows[np.isfinite(sequence.joints_camera_m[rows]).all(axis=(1, 2))]
            person += [sequence.identity] * len(rows)
            names += [name] * len(rows)
            depth_m.append(sequence.depth_m[rows])
            labels_m.append(sequence.joints_camera_m[rows])
            estimate_m.append(network.estimate(sequence.depth_m[rows], sequence.camera).joints_camera_m)
            self.camera = sequence.camera
        self.person, self.sequence = np.array(person), np.array(names)
        self.depth_m, self.labels_m, self.estimate_m = map(np.concatenate, (depth_m, labels_m, estimate_m))


def against_body(frames: Frames, per_person: int) -> dict[str, dict]:
    """Network and labels against the fitted body: the middle frames of evenly spaced sequences of every person."""
    rows, body_m = [], []
    for person in np.unique(frames.person):
        names = list(dict.fromkeys(frames.sequence[frames.person == person]))
        chosen = [names[round(k)] for k in np.linspace(0, len(names) - 1, min(per_person, len(names)))]
        own = np.array([np.median(np.flatnonzero(frames.sequence == name)).astype(int) for name in chosen])
        fitted = fit_body(frames.depth_m[own], frames.camera, frames.labels_m[own])
        print(
            f"{person}: body fitted to {len(own)} frames, points {100 * np.median(fitted.residual_m):.1f} cm from its surface, "
            f"{(fitted.residual_m > MAX_RESIDUAL_M).sum()} frames left out; clothes {100 * fitted.clothes_m:.1f} cm"
        )
        good = fitted.residual_m <= MAX_RESIDUAL_M
        rows.append(own[good])
        body_m.append(fitted.joints_m[good])
    kept, truth_m = np.concatenate(rows), np.concatenate(body_m)
    return {
        "raw, same frames": figures(frames.labels_m[kept], frames.estimate_m[kept]),
        "body": figures(truth_m, frames.estimate_m[kept]),
        "labels to body": figures(truth_m, frames.labels_m[kept]),
    }


def utd_mhad(folder: Path, network: Estimator, every: int, per_person: int) -> dict[str, dict]:
    frames = Frames(UtdMhadBenchmark(UtdMhadConfig(path=str(folder))), network, every)
    moved_m = in_label_definition(frames.labels_m, frames.estimate_m, frames.person)
    found = {"raw": figures(frames.labels_m, frames.estimate_m), "SDK": figures(frames.labels_m, moved_m)}
    for person in np.unique(frames.person):
        own = frames.person == person
        found[f"raw, {person}"] = figures(frames.labels_m[own], frames.estimate_m[own])
        found[f"SDK, {person}"] = figures(frames.labels_m[own], moved_m[own])
    return found | against_body(frames, per_person)


def itop(path: Path, network: Estimator) -> dict[str, dict]:
    """The stored frames of ITOP's side view, each of another moment, against labels and against bodies of their own."""
    with np.load(path) as stored:
        scenes_m = stored["depth_mm"].astype(np.float32) / 1000
        labels_m = stored["joints_m"] * FROM_ITOP
    person_m = np.concatenate([extract_person(scene_m[None], ITOP_CAMERA) for scene_m in scenes_m])
    estimate_m = network.estimate(person_m, ITOP_CAMERA).joints_camera_m
    bodies = [fit_body(one[None], ITOP_CAMERA, labels[None]) for one, labels in zip(person_m, labels_m, strict=True)]
    body_m = np.concatenate([body.joints_m for body in bodies])
    return {
        "raw": figures(labels_m, estimate_m),
        "body": figures(body_m, estimate_m),
        "labels to body": figures(body_m, labels_m),
    }


def print_table(title: str, found: dict[str, dict]) -> None:
    """Within 10 cm and mean error, by joint group."""
    print(f"\n{title}")
    heads = [f"{name} ({parts['all']['frames']})" for name, parts in found.items()]
    print(" " * 11 + "".join(f"{head:>24}" for head in heads))
    for group in GROUPS:
        cells = (f"{100 * parts[group]['within_10cm']:.1f} % {parts[group]['mean_cm']:6.2f} cm" for parts in found.values())
        print(f"{group:<11}" + "".join(f"{cell:>24}" for cell in cells))


@user_errors
def program() -> None:
    """Command line, described in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", nargs="?", help="folder of a network; by default the one that comes with the package")
    parser.add_argument("--real", type=Path, required=True, help="folder with UTD-MHAD/ and itop_side_test_3frames.npz")
    parser.add_argument("--every", type=int, default=4, help="judge one in this number of frames")
    parser.add_argument("--bodies", type=int, default=24, help="frames of each person that the body is fitted to")
    parser.add_argument("--out", type=Path, help="folder for real_check.json")
    arguments = parser.parse_args()
    torch.manual_seed(0)
    network = NetworkEstimator(arguments.checkpoint)
    found = {"UTD-MHAD": utd_mhad(arguments.real / "UTD-MHAD", network, arguments.every, arguments.bodies)}
    stills = arguments.real / "itop_side_test_3frames.npz"
    if stills.is_file():
        found["ITOP, side view"] = itop(stills, network)
    for title, one in found.items():
        print_table(title, one)
    if arguments.out:
        write_json(arguments.out / "real_check.json", {"checkpoint": arguments.checkpoint, **found})


if __name__ == "__main__":
    program()
