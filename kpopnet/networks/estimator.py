"""Pose estimation in depth sequences with a trained network."""

import logging
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres, subsampled
from kpopnet.data.cube import Cube, crop, person_centre
from kpopnet.estimator import WHOLE_ROOM, Estimate, shows_a_room
from kpopnet.networks import ModelConfig
from kpopnet.networks.backend import Output, open_network
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.runtime.input_files import settings_from
from kpopnet.skeleton import MIRROR, Joint, bone_lengths

log = logging.getLogger(__name__)

BATCH = 32
"""Crops that a network is run on at once."""

ADULT_M = 4.16
"""Sum of the bones of the mean adult of training, metres: of 20,000 images of `preset=release`."""

CHILD_SIZE, MIN_SIZE = 0.85, 0.6
"""The second pass for people below `CHILD_SIZE` of the mean adult, as are 2 % of these adults, has a smaller cube, of at least
`MIN_SIZE` of an adult's."""

SURFACE_OFFSET_M = 0.1
"""How much nearer the median point of a silhouette is than the mean of the joints: 9 cm in clean images, 14 in rooms."""

CONFIDENCE_MARGIN = 0.03
"""The mean confidence in joints by which a crop that was turned has to exceed the crop as it is."""


class NetworkEstimator:
    """A `kpopnet.estimator.Estimator`.

    Frames are independent: the person's centre is the median of the frame's silhouette, as in training. People get
    two passes of the network (test-time augmentation), the second on a mirrored crop whose place and size follow from the first
    (`second_cube`); the joints of both are weighed by their confidence (`fused`), the logits of a person averaged. Who is
    not upright is seen upright as well (`run_upright`). The confidence is the network's estimate of the probability that the
    joint lies within 10 cm of the ground truth.
    """

    def __init__(self, checkpoint: Path | str | None = None, device: str = "cpu") -> None:
        """Loads a network; arguments and errors as in `kpopnet.networks.backend.open_network`."""
        self.backend = open_network(checkpoint, device)
        self.meta = self.backend.meta
        self.model = ModelConfig(**self.meta["model"])
        self.name = self.model.name
        self._warned = False
        takes_ridge, settings = self.model.input == "depth_ridge", self.meta["config"].get("ridge", {})
        self.ridge = settings_from(RidgeConfig, settings, f"{checkpoint}: its ridge settings") if takes_ridge else None

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`."""
        depth_m, camera = subsampled(sequence_in_metres(depth_m, camera), camera)
        return self.judge([(frame_m, camera) for frame_m in depth_m])[0]

    def judge(
        self, images: Sequence[tuple[np.ndarray, Camera]], second_pass_confidence: float = 1.0
    ) -> tuple[Estimate, np.ndarray | None]:
        """See `kpopnet.estimator.Judge`."""
        if images and not self._warned and shows_a_room(*images[len(images) // 2]):
            self._warned = True
            log.warning(WHOLE_ROOM, self.name)
        result = Estimate.missing(len(images))
        judges, person_logit = False, np.full(len(images), -np.inf, np.float32)
        centres_m = [person_centre(*image) for image in images]
        cubes = {row: Cube(centre_m, self.model.half_size_m) for row, centre_m in enumerate(centres_m) if centre_m is not None}
        rows = list(cubes)
        for batch in (rows[i : i + BATCH] for i in range(0, len(rows), BATCH)):
            joints_m, confidence, person = self._run(images, {row: cubes[row] for row in batch})
            if person is not None:
                judges, person_logit[batch] = True, person
            again = np.flatnonzero(
                (relative_sizes(joints_m) < CHILD_SIZE) | (confidence.mean(axis=1) <= second_pass_confidence)
            )
            if len(again):
                rows_again = np.array(batch)[again].tolist()
                second = {row: second_cube(cubes[row], joints_m[k]) for k, row in zip(again, rows_again, strict=True)}
                second_m, second_confidence, second_logit = self._run(images, second, mirrored=True)
                passes = joints_m[again], confidence[again], second_m, second_confidence
                joints_m[again], confidence[again] = fused(*passes)
                if second_logit is not None:
                    person_logit[rows_again] = (person_logit[rows_again] + second_logit) / 2
            result.joints_camera_m[batch], result.confidence[batch] = joints_m, confidence
        return result, person_logit if judges else None

    def _run(self, images: Sequence[tuple[np.ndarray, Camera]], cubes: dict[int, Cube], mirrored: bool = False) -> Output:
        """What the network says of the cubes around people, by number of the image, in a mirror or not; joints in metres."""
        crops = np.stack([self._crop(*images[row], cube) for row, cube in cubes.items()])
        uvd, confidence, person = run_upright(self.backend, np.ascontiguousarray(crops[..., ::-1]) if mirrored else crops)
        if mirrored:
            uvd, confidence = uvd[:, MIRROR] * np.array([-1, 1, 1], np.float32), confidence[:, MIRROR]
        return np.stack([cube.to_metres(one) for cube, one in zip(cubes.values(), uvd, strict=True)]), confidence, person

    def _crop(self, depth_m: np.ndarray, camera: Camera, cube: Cube) -> np.ndarray:
        ridge = None if self.ridge is None else ridge_probability(depth_m, self.ridge)
        return crop(depth_m, camera, cube, self.model.crop_px, ridge)


def relative_sizes(joints_m: np.ndarray) -> np.ndarray:
    """The sum of the bones of (..., 15, 3) joints, as a share of the mean adult's: (...)."""
    return bone_lengths(joints_m).sum(axis=-1) / ADULT_M


def second_cube(cube: Cube, joints_m: np.ndarray) -> Cube:
    """The cube of the second pass, from the (15, 3) joints of the first, camera frame, metres.

    Its centre is halfway from that of the silhouette, which lacks what is hidden, to that of the joints. A child fills it as an
    adult would, down to `MIN_SIZE`, for there are no children in the training; in full rooms a fifth of the adults, hidden in
    part, are taken for children too, which costs a third of a point (docs/ledger.md).
    """
    size = float(relative_sizes(joints_m))
    centre_m = (cube.centre_m + joints_m.mean(axis=0) - np.array([0, 0, SURFACE_OFFSET_M], np.float32)) / 2
    centre_m[2] = max(centre_m[2], cube.centre_m[2] / 2)  # before the camera, whatever was detected
    return Cube(centre_m, cube.half_size_m * (max(size, MIN_SIZE) if size < CHILD_SIZE else 1))


def fused(
    joints_m: np.ndarray, confidence: np.ndarray, second_m: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(N, 15, 3) joints of two passes, weighed by the odds of their (N, 15) confidences, and the means of the latter."""
    odds, second_odds = (p / (1 - p) for p in np.clip((confidence, second), 0.001, 0.999))
    share = second_odds / (odds + second_odds)
    return joints_m + share[..., None] * (second_m - joints_m), (confidence + second) / 2


def run_upright(network: Callable[[np.ndarray], Output], crops: np.ndarray) -> Output:
    """What a network says of (N, C, S, S) crops, as `Backend`; where it sees a trunk that is not upright it is asked again, of
    the crop turned by quarters until the trunk is, and what it is surer of counts.

    Few people of the training lie or stand on their hands, and few of its cameras are rolled. Whether it is a person at all is
    said of the crop as it is.
    """
    uvd, confidence, person = network(crops)
    trunk = uvd[:, Joint.NECK] - (uvd[:, Joint.RIGHT_HIP] + uvd[:, Joint.LEFT_HIP]) / 2
    quarters = np.rint(np.arctan2(trunk[:, 0], -trunk[:, 1]) / (np.pi / 2)).astype(int) % 4
    rows = np.flatnonzero(quarters)
    if len(rows):
        turned, sure, _ = network(np.stack([np.rot90(crops[row], quarters[row], (1, 2)) for row in rows]))
        for row, joints, one in zip(rows, turned, sure, strict=True):
            if one.mean() > confidence[row].mean() + CONFIDENCE_MARGIN:
                back = np.linalg.matrix_power([[0, -1], [1, 0]], quarters[row])
                uvd[row, :, :2], uvd[row, :, 2], confidence[row] = joints[:, :2] @ back.T, joints[:, 2], one
    return uvd, confidence, person
