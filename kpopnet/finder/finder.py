"""The finder: all people in one depth image of any scene before any camera, and who is who in films."""

from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera, check_camera, image_in_metres
from kpopnet.data.canvas import STRIDE, Reduced, reduced
from kpopnet.errors import check_between, check_type
from kpopnet.estimator import FRAME_S, LATEST_S
from kpopnet.finder.following import UNKNOWN, Followed
from kpopnet.finder.masks import open_masks, refine_masks
from kpopnet.finder.people import (
    INPUTS,
    OUTPUT_NAMES,
    Cells,
    Network,
    OwnedCells,
    certainty,
    certainty_together,
    gather_people,
)
from kpopnet.human import Human, Look, Looker
from kpopnet.networks.backend import shipped_session

LEAST_PROBABILITY, LEAST_M2, LEAST_CELLS = 0.4, 0.03, 8
"""Of the cells of a person; the least surface that shows of a person, and the least number of their cells."""

LEAST_ALONE, LEAST_TOGETHER = 0.6, 0.9
"""A new person is reported from this probability on: of the finder alone, and of the finder together with a network that judges
the crop."""

FOLLOWED_CERTAINTY = 0.2
"""A person who is being followed is reported from this certainty on, of the finder and of both, where they are expected: what
is found with little certainty counts for tracks and not for new ones, as in ByteTrack (Zhang et al. 2022)."""


@dataclass(frozen=True)
class FinderConfig:
    """Which finder finds people, and how sure it has to be.

    Attributes:
        weights: a file of `train.py --config-name finder` (training.part=finder); None: the finder that comes with the package.
            The mask network is the package's.
        least_certainty: a new person is reported from this probability on; None: from 0.6 of the finder alone, and from 0.9
            where the network of joints judges too.
    """

    weights: str | None = None
    least_certainty: float | None = None

    def __post_init__(self) -> None:
        if self.least_certainty is not None:
            check_between("extraction.least_certainty", self.least_certainty, 0, 1)


class PersonFinder:
    """Finds the people in the images of one camera, which may move, and follows them from image to image."""

    def __init__(self, camera: Camera, config: FinderConfig = FinderConfig(), looker: Looker | None = None) -> None:
        """With a `looker`, it judges every candidate, and their certainty is that of both (`certainty_together`).

        Raises InputError if the weights are missing, damaged or of another version.
        """
        check_camera(camera)
        check_type("extraction", config, FinderConfig)
        self.camera, self.config, self.looker, self._followed, self._time_s = camera, config, looker, Followed(), 0.0
        self._network, self._masks = open_finder(config.weights), open_masks()

    def extract(self, depth_m: np.ndarray, time_s: float | None = None) -> list[Human]:
        """The people in the next image, as `kpopnet.pose.extraction.Extractor`: (H, W) metres, 0 where nothing was measured."""
        if time_s is not None:
            check_between("time_s", time_s, -LATEST_S, LATEST_S)
        depth_m = image_in_metres(
            depth_m, self.camera, unit_known=True
        )  # metres, as stated: a few far pixels of a covered lens tell nothing else
        given = self.config.least_certainty
        least = FOLLOWED_CERTAINTY if given is None else min(FOLLOWED_CERTAINTY, given)
        candidates = candidates_in(self._network, depth_m, self.camera, least)
        owners, boxes = refine_masks(self._masks, depth_m, self.camera, candidates.cells, candidates.centres_m)
        found = enumerate(zip(boxes, candidates.centres_m, candidates.certainty.tolist(), strict=True), 1)
        cut_out = [
            replace(Human.cut_out(UNKNOWN, depth_m, owners, number, box, centre_m), certainty=one)
            for number, (box, centre_m, one) in found
            if box[2] > box[0]
        ]
        looked_at = cut_out if self.looker is None else map(_looked_at, cut_out, self.looker(cut_out))
        humans = [human for human in looked_at if human.certainty >= least]
        self._time_s = self._time_s + FRAME_S if time_s is None else time_s
        centres_m = np.reshape([human.centre_m for human in humans], (-1, 3))
        certain = np.array([self._is_certain(human) for human in humans], bool)
        identities = self._followed.identify(centres_m, certain, self._time_s)
        known = (replace(human, identity=one) for human, one in zip(humans, identities, strict=True) if one != UNKNOWN)
        return sorted(known, key=lambda human: human.identity)

    def _is_certain(self, human: Human) -> bool:
        is_judged = human.look and human.look.person_logit is not None
        least, given = LEAST_TOGETHER if is_judged else LEAST_ALONE, self.config.least_certainty
        return human.certainty >= (least if given is None else given)


def _looked_at(human: Human, look: Look) -> Human:
    both = human.certainty if look.person_logit is None else certainty_together(human.certainty, look.person_logit)
    return replace(human, certainty=both, look=look)


class Candidates(NamedTuple):
    """The P candidates of one image, the one with the largest surface first."""

    centres_m: np.ndarray  # (P, 3) float32 torso joints as voted, camera frame, metres
    certainty: np.ndarray  # (P,)
    cells: OwnedCells  # whose the cells of the image are, 1..P


def candidates_in(network: Network, depth_m: np.ndarray, camera: Camera, least_certainty: float) -> Candidates:
    """Those of whom the network is so certain at least, in an (H, W) float32 image in metres, 0 where nothing was measured."""
    canvas = reduced(depth_m, camera)
    cells = cells_of(network, canvas)
    people = gather_people(cells, LEAST_PROBABILITY, LEAST_M2, LEAST_CELLS)
    probability = certainty(people)
    candidate = probability >= least_certainty
    numbers = np.append(0, np.where(candidate, np.cumsum(candidate), 0)).astype(np.uint8)
    owned = OwnedCells.of(cells.depth_m, cells.probability, numbers[people.owner], canvas.reduction)
    return Candidates(people.centres_m[candidate], probability[candidate], owned)


def cells_of(network: Network, canvas: Reduced) -> Cells:
    """What a network says of the cells of an image."""
    probability, torso_m = network(canvas.depth_m[None], canvas.intrinsics[None])
    depth_m = np.ascontiguousarray(canvas.depth_m[::STRIDE, ::STRIDE])
    area_m2 = depth_m**2 * np.float32(STRIDE**2 / (canvas.intrinsics[0] * canvas.intrinsics[1]))
    return Cells(depth_m, area_m2, probability, torso_m)


@cache
def open_finder(weights: str | None = None) -> Network:
    """The network of a training's file of weights, or None for the one that comes with the package, which ONNX Runtime runs,
    faster than torch. Opened once, on one thread.

    Raises InputError if it is missing or no finder.
    """
    if weights is not None:
        from kpopnet.finder.network import torch_finder  # takes a second to import

        return torch_finder(weights)
    session = shipped_session("finder")
    return lambda depth_m, intrinsics: session.run(list(OUTPUT_NAMES), dict(zip(INPUTS, (depth_m, intrinsics), strict=True)))
