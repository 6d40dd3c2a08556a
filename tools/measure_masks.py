"""Measures what masks cost: of people in simulated rooms whom the finder finds and of whom half shows, how well the finder's
own masks and those after the mask network's look agree with the pixels that show them, and what joints the network has by each.

    python tools/measure_masks.py --out results/masks.json

Run from the root of a checkout with `PYTHONPATH=.`. Scenes of validation, as `python -m synth benchmark=person_crops` draws
them; joints of single images, without the fit.
"""

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np
from tqdm import tqdm

from kpopnet.camera import MM_PER_METRE
from kpopnet.finder.finder import FOLLOWED_CERTAINTY, candidates_in, open_finder
from kpopnet.finder.masks import open_masks, refine_masks
from kpopnet.finder.people import pixel_owners
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.provenance import measured_by
from kpopnet.skeleton import Joint
from synth.rooms.crops import PersonCropsConfig, PersonCropsSet, matched
from synth.rooms.images import measure_scene

SHOWN, WITHIN_M = 0.5, 0.10


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=1500, help="number of scenes: %(default)s")
    parser.add_argument("--seed", type=int, default=10, help="of the scenes: %(default)s")
    parser.add_argument("--out", type=Path, help="a JSON file for the figures")
    given = parser.parse_args()
    scenes = PersonCropsSet(PersonCropsConfig(seed=given.seed, split="validation", dances=300)).scenes
    finder, masks, network = open_finder(), open_masks(), NetworkEstimator()
    shared, errors_m = defaultdict(list), defaultdict(list)
    for number in tqdm(range(given.scenes), unit="scene"):
        clear = scenes.draw_scene(number)
        measured = measure_scene(scenes.sensor_rng(number), clear)
        depth_m = measured.depth_mm / np.float32(MM_PER_METRE)
        found = candidates_in(finder, depth_m, clear.camera, FOLLOWED_CERTAINTY)
        if not len(found.centres_m) or not len(clear.joints_camera_m):
            continue
        before = pixel_owners(found.cells, depth_m, *map(np.arange, depth_m.shape))
        after, _ = refine_masks(masks, depth_m, clear.camera, found.cells, found.centres_m)
        for row, person in matched(found.centres_m, clear.joints_camera_m[:, Joint.TORSO]):
            theirs = measured.labels == person + 1
            if np.count_nonzero(theirs) < SHOWN * clear.whole_px[person]:
                continue
            for name, mask in (("finder", before == row + 1), ("masks", after == row + 1), ("true", theirs)):
                shared[name].append(np.count_nonzero(mask & theirs) / np.count_nonzero(mask | theirs))
                estimate = network.estimate(np.where(mask, depth_m, np.float32(0))[None], clear.camera)
                distance_m = np.linalg.norm(estimate.joints_camera_m[0] - clear.joints_camera_m[person], axis=-1)
                errors_m[name].append(np.nan_to_num(distance_m, nan=np.inf))
    figures = {
        name: {"intersection_over_union": float(np.mean(shared[name])), "within_10cm": float(np.mean(np.less(one, WITHIN_M)))}
        for name, one in errors_m.items()
    }
    for name, one in figures.items():
        print(f"{name:<7} IoU {one['intersection_over_union']:.3f}, joints within 10 cm {100 * one['within_10cm']:.1f} %")
    if given.out:
        about = {"what": "SIMULATED scenes of validation, people whom the finder finds and of whom half shows"}
        write_json(given.out, about | {"people": len(shared["true"])} | figures | measured_by())


if __name__ == "__main__":
    main()
