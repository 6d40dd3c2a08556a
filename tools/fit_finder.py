"""Fits how sure the finder may be of a person (SURE in kpopnet/finder/people.py), on validation images of simulated rooms.

    python -m synth benchmark=room_images benchmark.split=validation benchmark.seed=4 out=data/room_images/other
    python tools/fit_finder.py data/room_images/validation --judged data/room_images/other
    python tools/fit_finder.py data/room_images/validation --judged data/room_images/other --weights RUN/finder.safetensors

Run from the root of a checkout with `PYTHONPATH=.`. An estimate is right if its centre is within 30 cm of the torso of a person
of whom at least half shows; of people of whom less shows it counts as neither. Prints the fit, and recall and precision by
threshold on other images, such as those of the same split and another seed.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.camera import MM_PER_METRE
from kpopnet.data.canvas import reduced
from kpopnet.data.room_images import RoomImage, RoomImages
from kpopnet.errors import InputError
from kpopnet.finder.finder import LEAST_CELLS, LEAST_M2, LEAST_PROBABILITY, cells_of, open_finder
from kpopnet.finder.people import Network, People, certainty_features, gather_people
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.provenance import measured_by
from kpopnet.skeleton import Joint
from synth.rooms.crops import matched
from tools.fit_confidence import logistic_weights

LEAST_SHOWN = 0.5
THRESHOLDS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


def people_of(network: Network, image: RoomImage) -> People:
    """All people that the finder may report of an image."""
    camera = image.camera
    depth_m = image.depth_mm[: camera.height, : camera.width] / np.float32(MM_PER_METRE)
    return gather_people(cells_of(network, reduced(depth_m, camera)), LEAST_PROBABILITY, LEAST_M2, LEAST_CELLS)


def judged(image: RoomImage, people: People) -> tuple[np.ndarray, np.ndarray, int]:
    """(P,) whether each estimate is right, (P,) whether it counts, and the number of people who should be found."""
    present = np.flatnonzero(image.whole_px > 0)
    seen_px = np.array([np.count_nonzero(image.labels == number + 1) for number in present])
    wanted = seen_px >= LEAST_SHOWN * image.whole_px[present]
    torsos_m = image.joints_m[present, Joint.TORSO].reshape(-1, 3)
    right, counts = np.zeros(len(people.score), bool), np.ones(len(people.score), bool)
    for one, person in matched(people.centres_m, torsos_m):
        right[one] = counts[one] = wanted[person]
    return right, counts, int(wanted.sum())


def logistic(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """(K + 1,) weights of a logistic regression on (N, K) features, the constant first."""
    return logistic_weights(np.column_stack([np.ones(len(features)), features]), right)


class Judged(NamedTuple):
    """The estimates in a set of images that count."""

    features: np.ndarray  # (N, K) what certainty is judged by
    right: np.ndarray  # (N,) bool
    wanted: int  # people who should be found
    images: int


def judged_in(folder: Path, network: Network) -> Judged:
    """Judges all estimates of a finder in a folder of room images."""
    images, features, right, wanted = RoomImages(folder), [], [], 0
    for number in tqdm(range(len(images)), str(folder), disable=None):
        people = people_of(network, images[number])
        is_right, counts, present = judged(images[number], people)
        features.append(certainty_features(people)[counts])
        right.append(is_right[counts])
        wanted += present
    return Judged(np.concatenate(features), np.concatenate(right), wanted, len(images))


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", type=Path, help="folder of validation room images, to fit on")
    parser.add_argument("--judged", type=Path, required=True, help="folder of others, for recall and precision")
    parser.add_argument("--weights", type=Path, help="a finder's weights; otherwise those that come with the package")
    parser.add_argument("--out", type=Path, help="a JSON file for the figures, as those of results/")
    given = parser.parse_args()
    if RoomImages(given.images).identity == RoomImages(given.judged).identity:
        raise InputError(f"{given.judged}: the images that are fitted on; judge on others")
    network = open_finder(given.weights and str(given.weights))
    fitted, other = judged_in(given.images, network), judged_in(given.judged, network)
    weights = logistic(fitted.features, fitted.right)
    print(f"SURE = ({', '.join(f'{value:.2f}' for value in weights)})")
    probability = 1 / (1 + np.exp(-(weights[0] + other.features @ weights[1:])))
    print(f"{other.wanted} people of whom half shows, in {other.images} images")
    figures = {}
    for threshold in THRESHOLDS:
        reported = probability >= threshold
        found = np.count_nonzero(reported & other.right)
        recall, precision = found / max(other.wanted, 1), found / max(np.count_nonzero(reported), 1)
        figures[str(threshold)] = {"recall": float(recall), "precision": float(precision)}
        print(f"at {threshold}: recall {100 * recall:.1f} %, precision {100 * precision:.1f} %")
    if given.out:
        about = {"what": "SIMULATED rooms, images of validation", "images": other.images, "people": other.wanted}
        write_json(given.out, about | {"sure": weights.tolist()} | measured_by() | {"at": figures})


if __name__ == "__main__":
    main()
