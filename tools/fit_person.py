"""Fits whether a crop shows a person (kpopnet.networks.network.PersonHead) on what the finder cuts out of simulated rooms.

    python tools/fit_person.py outputs/train/RUN/best --out data/person

Run from the root of a checkout with `PYTHONPATH=.`. Draws scenes as `python -m synth benchmark=person_crops` does, and stores
in --out what the checkpoint's network says of everything that the finder takes for a person in them; a run that was stopped
goes on. Scenes of the split train fit the head, half of those of validation how sure the finder and it are together
(TOGETHER in kpopnet/finder/people.py), the other half judges. Writes person.safetensors into the checkpoint's folder, where
`kpopnet export` and tools/ship_weights.py take it from; prints TOGETHER, and recall and precision by threshold on the scenes
that judge.
"""

import argparse
import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import safetensors.torch
import torch
from torch.nn import functional

from kpopnet.camera import MM_PER_METRE
from kpopnet.data.cube import crop, person_cubes
from kpopnet.data.made_sets import claim_folder
from kpopnet.errors import InputError
from kpopnet.finder.finder import FOLLOWED_CERTAINTY, FinderConfig, PersonFinder
from kpopnet.human import Human
from kpopnet.networks import PERSON, WEIGHTS
from kpopnet.networks.checkpoint import load_network
from kpopnet.networks.network import PersonHead, PoseNetwork
from kpopnet.runtime.atomic_write import write_json, write_npz, write_whole
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.input_files import parsing
from kpopnet.runtime.provenance import measured_by
from kpopnet.skeleton import Joint
from kpopnet.weights import SHA256
from synth.resumable import make_missing
from synth.rooms.crops import PersonCropsConfig, PersonCropsSet, matched
from tools.fit_finder import THRESHOLDS, logistic

FAR_M = 0.6
"""What is this far from all torsos is no person."""

A_PERSON, NO_PERSON, NEITHER = 1, 0, -1

EPOCHS, BATCH, LR, DECAY, WEIGHT_DECAY = 25, 256, 2e-3, 0.88, 0.05


class Found(NamedTuple):
    """Whom the finder finds in some scenes, people and things, and what a network sees in them."""

    features: np.ndarray  # (N, K) of `PersonHead`
    certainty: np.ndarray  # (N,) the finder's
    is_person: np.ndarray  # (N,) bool


@dataclass(frozen=True)
class Looks:
    """Files of whom the finder finds, and what a network sees in them."""

    checkpoint: Path
    folder: Path
    split: str
    seed: int

    @cached_property
    def scenes(self) -> PersonCropsSet:
        return PersonCropsSet(benchmark=PersonCropsConfig(seed=self.seed, split=self.split, dances=200))

    @cached_property
    def network(self) -> PoseNetwork:
        torch.set_num_threads(1)
        return load_network(self.checkpoint)[0]

    def path(self, number: int) -> Path:
        return self.folder / self.split / f"looks_{number:05d}.npz"

    def make(self, number: int, on_scene: Callable[[], None]) -> None:
        crops, certainty, kinds, half_size_m = [], [], [], self.network.config.half_size_m
        for clear, measured in self.scenes.measured(number, on_scene):
            torsos_m = clear.joints_camera_m[:, Joint.TORSO].reshape(-1, 3)
            finder = PersonFinder(clear.camera, FinderConfig(least_certainty=FOLLOWED_CERTAINTY))
            humans = finder.extract(measured.depth_mm / np.float32(MM_PER_METRE))
            for human, kind in zip(humans, kinds_of(humans, torsos_m), strict=True):
                camera = human.cropped(clear.camera)
                for cube in person_cubes(human.depth_m[None], camera, half_size_m).values():
                    crops.append(crop(human.depth_m, camera, cube, self.network.config.crop_px))
                    certainty.append(human.certainty)
                    kinds.append(kind)
        with torch.inference_mode():
            batch = torch.from_numpy(np.stack(crops))
            maps = self.network.encoder(batch)
            features = PersonHead.features(maps[-1], self.network.head(maps).confidence_logit)
        write_npz(self.path(number), features=features.numpy(), certainty=certainty, kinds=kinds)

    def claim(self) -> None:
        """Raises InputError where the folder holds files of another network, finder or seed."""
        folder, weights = self.path(0).parent, hashlib.sha256((self.checkpoint / WEIGHTS).read_bytes()).hexdigest()
        folder.mkdir(parents=True, exist_ok=True)
        finder = SHA256["finder"] | SHA256["masks"]
        claim_folder(folder, "looks_*.npz", finder | {"weights": weights, "seed": self.seed, "split": self.split})

    def made(self, files: int) -> list[Found]:
        """Of each file those who are a person or none; makes what is missing."""
        self.claim()
        make_missing(
            self.make, range(files), lambda number: self.path(number).is_file(), self.path(0).parent, "file", "scene",
            lambda _: self.scenes.per_shard, os.cpu_count() or 1,
        )  # fmt: skip
        found = []
        for number in range(files):
            path = self.path(number)
            with parsing(path, "not a readable file", "delete it and make it again"), np.load(path) as stored:
                features, certainty, kinds = (stored[name] for name in ("features", "certainty", "kinds"))
            counts = kinds != NEITHER
            found.append(Found(features[counts], certainty[counts], kinds[counts] == A_PERSON))
        return found


def kinds_of(humans: list[Human], torsos_m: np.ndarray) -> list[int]:
    """What each of the finder's people is, given the (P, 3) true torsos.

    A person whom no other is nearer to; no person where all torsos are far, or another one has the nearest: a second one on
    the same body is none. Who is found with the centre somewhat off is neither.
    """
    centres_m = np.reshape([human.centre_m for human in humans], (-1, 3))
    apart_m, taken = np.linalg.norm(centres_m[:, None] - torsos_m, axis=-1), dict(matched(centres_m, torsos_m))
    kinds = []
    for row, distances_m in enumerate(apart_m):
        if row in taken:
            kinds.append(A_PERSON)
        elif distances_m.min(initial=np.inf) > FAR_M or distances_m.argmin() in taken.values():
            kinds.append(NO_PERSON)
        else:
            kinds.append(NEITHER)
    return kinds


def joined(found: list[Found]) -> Found:
    return Found(*map(np.concatenate, zip(*found, strict=True)))


def fitted(features: np.ndarray, is_person: np.ndarray, coarse: int) -> PersonHead:
    torch.manual_seed(0)
    head, inputs, wanted = PersonHead(coarse), torch.from_numpy(features), torch.from_numpy(is_person.astype(np.float32))
    optimiser = torch.optim.AdamW(head.parameters(), LR, weight_decay=WEIGHT_DECAY)
    for epoch in range(EPOCHS):
        optimiser.param_groups[0]["lr"] = LR * DECAY**epoch
        for rows in torch.randperm(len(inputs)).split(BATCH):
            if len(rows) > 1:  # a batch normalisation needs two
                loss = functional.binary_cross_entropy_with_logits(head.layers(inputs[rows])[:, 0], wanted[rows])
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
    return head.eval()


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path, help="folder of a network that sees depth alone")
    parser.add_argument("--out", type=Path, required=True, help="folder of what the network says, of one network and seed")
    parser.add_argument("--files", type=int, default=80, help="of 500 scenes, to fit on: %(default)s")
    parser.add_argument("--judged", type=int, default=8, help="of 500 scenes of validation: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="of the scenes: %(default)s")
    parser.add_argument("--figures", type=Path, help="a JSON file for the figures, as those of results/")
    given = parser.parse_args()
    if given.files < 1 or given.judged < 2:
        parser.error("expected --files of at least 1 and --judged of at least 2: half of them ties the certainties together")
    network, meta = load_network(given.checkpoint)
    if network.config.input != "depth":
        raise InputError(f"{given.checkpoint}: sees {network.config.input}; expected a network that sees depth alone")
    learnt_from, others = (
        Looks(given.checkpoint, given.out, split, given.seed).made(files)
        for split, files in (("train", given.files), ("validation", given.judged))
    )
    train, tied, judged = joined(learnt_from), joined(others[::2]), joined(others[1::2])
    head = fitted(train.features, train.is_person, network.config.widths[-1])
    write_whole(
        given.checkpoint / PERSON,
        safetensors.torch.save({name: value.contiguous() for name, value in head.state_dict().items()}),
    )
    print(f"fitted on {train.is_person.sum():,} people and {(~train.is_person).sum():,} things")
    together = logistic(evidence(head, tied), tied.is_person)
    print(f"TOGETHER = ({', '.join(f'{value:.2f}' for value in together)})")
    by_both = 1 / (1 + np.exp(-(together[0] + evidence(head, judged) @ together[1:])))
    people, figures = judged.is_person, {}
    print(f"of {people.sum():,} people and {(~people).sum():,} things of scenes of validation, finder -> both:")
    for threshold in THRESHOLDS:
        taken = {"finder": judged.certainty >= threshold, "both": by_both >= threshold}
        rates = {name: (float(one[people].mean()), float(people[one].mean())) for name, one in taken.items()}
        figures[str(threshold)] = {name: dict(zip(("recall", "precision"), one, strict=True)) for name, one in rates.items()}
        recall, precision = ([100 * rates[name][k] for name in taken] for k in range(2))
        print(
            f"at {threshold}: recall {recall[0]:.1f} -> {recall[1]:.1f} %, precision {precision[0]:.1f} -> {precision[1]:.1f} %"
        )
    if given.figures:
        about = {"what": "SIMULATED rooms, whom the finder finds in scenes of validation with a certainty of 0.2 or more"}
        about |= {"people": int(people.sum()), "things": int((~people).sum()), "step": meta["step"]}
        write_json(given.figures, about | {"together": together.tolist()} | measured_by() | {"at": figures})


@torch.inference_mode()
def evidence(head: PersonHead, found: Found) -> np.ndarray:
    """(N, 2) the logits of the finder's certainty and of the head's."""
    judged = head.layers(torch.from_numpy(found.features))[:, 0].numpy()
    return np.column_stack([np.log(found.certainty / (1 - found.certainty)), judged])


if __name__ == "__main__":
    main()
