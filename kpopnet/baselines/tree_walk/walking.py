"""Random tree walk: a baseline for the trackers and the networks. Trees, walks, the folder of a model, and the estimator.

After Jung, Lee, Heo & Yun, "Random tree walk toward instantaneous 3D human pose estimation" (CVPR 2015), with which the
paper compares itself in Fig. 8; an independent implementation. Each joint has one regression tree. At a position in space,
the tree evaluates depth differences around it and returns a few directions in which the joint may lie. A walk takes a step
in one of these directions and queries the tree again. The estimate is the mean of the visited positions. The walk of the
torso starts at the centre of the silhouette, that of every other joint at the estimate of its kinematic parent.

Features are depth differences in a small integer depth image of the cube, relative to a position (u, v, d) in the
coordinates of `kpopnet.data.cube`. These are metric at the person's distance, so the offsets of the probes need no division
by depth: the cube has normalised them.
"""

import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit
from safetensors.numpy import load_file, save_file

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.data.cube import crop, person_cubes
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.runtime.input_files import ArraySchema, check_array, check_fields, expect, read_json, read_with
from kpopnet.runtime.provenance import git_revision
from kpopnet.skeleton import BONES, JOINT_NAMES, NUM_JOINTS, Joint

TREES, META = "trees.safetensors", "meta.json"
FORMAT, VERSION = "kpopnet-tree-walk", 1
TRAIN_ONE = "`python train.py --config-name tree_walk` trains one"

UNITS = 10_000
"""Integer depth units per half edge of the cube; a unit is about a tenth of a millimetre."""

UNMEASURED = np.int16(32_767)
"""Value of pixels without a measurement: behind everything else."""

MAX_DIFFERENCE = 4_000
"""Depth differences are clipped to this, about 45 cm in front of and behind the position. Pixels farther behind and pixels
without a measurement give the same value."""

START = np.full(NUM_JOINTS, -1, np.int32)
"""(15,) the joint at whose estimate the walk of each joint starts; -1 for the centre of the silhouette."""
START[[child for _, child in BONES]] = [parent for parent, _ in BONES]

ORDER = [Joint.TORSO]
"""(15,) joints in the order of their walks, parents before children."""
for _joint in ORDER:
    ORDER += [child for parent, child in BONES if parent == _joint]
ORDER = np.array(ORDER, np.int32)


class Trees(NamedTuple):
    """The trees of all joints, concatenated into one set of arrays for numba.

    Attributes:
        root: (15,) int32 root node of each joint's tree.
        child: (N,) int32 child for features below the threshold, the other child is the next node; or -1 - leaf.
        threshold: (N,) int32 threshold of the feature.
        probe: (N, 5) int16, see `feature`.
        direction: (L, K, 3) float32 unit vectors in (u, v, d), the directions of each leaf.
        share: (L, K) float32 cumulative probabilities of the directions, up to 1.
    """

    root: np.ndarray
    child: np.ndarray
    threshold: np.ndarray
    probe: np.ndarray
    direction: np.ndarray
    share: np.ndarray


def integer_image(crop: np.ndarray) -> np.ndarray:
    """(..., S, S) int16 in UNITS of a crop, float32 cube depth d, 1 where nothing was measured (`kpopnet.data.cube.crop`)."""
    return np.where(crop < 1, np.rint(crop * np.float32(UNITS)), np.float32(UNMEASURED)).astype(np.int16)


@njit(cache=True)
def depth_difference(image, row, column, depth):
    """Depth of a pixel minus `depth`, clipped to -MAX_DIFFERENCE..MAX_DIFFERENCE; MAX_DIFFERENCE outside the image."""
    side = image.shape[0]
    if row < 0 or column < 0 or row >= side or column >= side:
        return np.int32(MAX_DIFFERENCE)
    return min(max(np.int32(image[row, column]) - depth, np.int32(-MAX_DIFFERENCE)), np.int32(MAX_DIFFERENCE))


@njit(cache=True)
def feature(image, row, column, depth, probe):
    """The feature at a position, int32 UNITS, in an (S, S) `integer_image`; the position in pixels and UNITS.

    Jung et al. use the depth difference between two probes of the image. Such differences do not depend on the depth of
    the position itself, so a feature may also be the depth difference between one probe and the position. `probe` is (5,)
    int16: offsets in rows and columns from the position to a first and a second probe, and 1 if there is a second.
    """
    value = depth_difference(image, row + probe[0], column + probe[1], depth)
    if probe[4]:
        value -= depth_difference(image, row + probe[2], column + probe[3], depth)
    return value


@njit(cache=True)
def random_uniform(key, count):
    """A pseudo-random number in [0, 1), a function of a seed and a counter: splitmix64."""
    z = np.uint64(key) + np.uint64(count + 1) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return np.float64(z >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True)
def find_leaf(trees, joint, image, position):
    """The leaf of a joint's tree for a position (u, v, d)."""
    half = 0.5 * image.shape[0]
    row, column = np.int32(np.floor((position[1] + 1) * half)), np.int32(np.floor((position[0] + 1) * half))
    depth = np.int32(np.rint(position[2] * UNITS))
    node = trees.root[joint]
    while trees.child[node] >= 0:
        above = feature(image, row, column, depth, trees.probe[node]) >= trees.threshold[node]
        node = trees.child[node] + (1 if above else 0)
    return -1 - trees.child[node]


@njit(cache=True)
def walk(image, trees, steps, settling, step, key):
    """Walks of all joints through one (S, S) `integer_image`, clipped to the cube: outside it trees give no direction back.

    `step` is the length of a step in cube units, `key` the seed; the others are as in `TreeWalkModel`.

    Returns:
        (15, 3) float32 mean position in (u, v, d), and (15,) float32 root mean square distance from it, in cube units.
    """
    mean, deviation = np.zeros((NUM_JOINTS, 3), np.float32), np.zeros(NUM_JOINTS, np.float32)
    counted = steps - settling
    for joint in ORDER:
        position, total, squares = np.zeros(3), np.zeros(3), 0.0
        if START[joint] >= 0:
            position[:] = mean[START[joint]]
        for number in range(steps):
            leaf = find_leaf(trees, joint, image, position)
            draw = random_uniform(key, joint * steps + number)
            chosen = 0
            while trees.share[leaf, chosen] <= draw and chosen < trees.share.shape[1] - 1:
                chosen += 1
            for axis in range(3):
                position[axis] = min(max(position[axis] + step * trees.direction[leaf, chosen, axis], -1.0), 1.0)
            if number >= settling:
                total += position
                squares += _square(position)
        mean[joint] = total / counted
        deviation[joint] = np.sqrt(max(squares / counted - _square(total) / (counted * counted), 0.0))
    return mean, deviation


@njit(cache=True)
def _square(vector):
    return vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]


_SCHEMA = {
    "root": ArraySchema("i", (NUM_JOINTS,)),
    "child": ArraySchema("i", ("nodes",)),
    "threshold": ArraySchema("i", ("nodes",)),
    "probe": ArraySchema("i", ("nodes", 5)),
    "direction": ArraySchema("f", ("leaves", "directions", 3)),
    "share": ArraySchema("f", ("leaves", "directions")),
    "spread_m": ArraySchema("f", (NUM_JOINTS, "bounds")),
    "within_10cm": ArraySchema("f", (NUM_JOINTS, "bins")),
}


@dataclass(frozen=True)
class TreeWalkModel:
    """A trained model.

    Attributes:
        crop_px: side of the image of the cube in pixels.
        half_size_m: half the cube's edge in metres.
        trees: the trees of all joints.
        deviation_bounds_m: (15, B - 1) float32, ascending bounds in metres that divide the walks of each joint into B bins
            by the root mean square distance of their positions from the mean.
        within_10cm: (15, B) float32, the share of joints within 10 cm of the ground truth, per bin.
        steps: number of steps of each joint's walk.
        settling: number of steps at the start of a walk that are excluded from the mean.
        step_m: length of a step in metres.
    """

    crop_px: int
    half_size_m: float
    trees: Trees
    deviation_bounds_m: np.ndarray
    within_10cm: np.ndarray
    steps: int = 128
    settling: int = 32
    step_m: float = 0.05

    def run_walks(self, image: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Runs the walks of all joints through a (crop_px, crop_px) `integer_image`; `number` seeds its random numbers.

        Returns:
            (15, 3) float32 joints in cube coordinates, and (15,) float32 root mean square distance of each walk's positions
            from its joint, in metres.
        """
        mean, deviation = walk(image, self.trees, self.steps, self.settling, self.step_m / self.half_size_m, number)
        return mean, deviation * np.float32(self.half_size_m)

    def confidence(self, deviation_m: np.ndarray) -> np.ndarray:
        """(15,) float32 probability that each joint lies within 10 cm of the ground truth, given its walk's deviation."""
        bins = (deviation_m[:, None] >= self.deviation_bounds_m).sum(axis=1)
        return self.within_10cm[np.arange(NUM_JOINTS), bins]

    def save(self, folder: Path, described: dict) -> None:
        """Writes trees.safetensors and meta.json, with configuration, data and metrics (`described`, JSON types)."""
        folder.mkdir(parents=True, exist_ok=True)
        arrays = self.trees._asdict() | {"spread_m": self.deviation_bounds_m, "within_10cm": self.within_10cm}
        save_file({name: np.ascontiguousarray(array) for name, array in arrays.items()}, folder / TREES)
        meta = {
            "format": FORMAT,
            "version": VERSION,
            "crop_px": self.crop_px,
            "half_size_m": self.half_size_m,
            "walk": {"steps": self.steps, "settling": self.settling, "step_m": self.step_m},
            **described,
            "joint_names": JOINT_NAMES,
            "git": git_revision(),
            "packages": {name: version(name) for name in ("numba", "numpy", "safetensors")},
        }
        (folder / META).write_text(json.dumps(meta, indent=2) + "\n")

    @classmethod
    def load(cls, folder: Path | str) -> "TreeWalkModel":
        """Reads a folder written by `save`; raises InputError if it holds no model of this version or a damaged one."""
        path = Path(folder) / META
        if not path.is_file():
            raise InputError(f"{folder}: no tree walk model there (no {META}); {TRAIN_ONE}")
        kind = {"format": str, "version": int, "walk": dict, "crop_px": int, "half_size_m": float}
        meta = check_fields(str(path), read_json(path, non_finite=True), kind)
        expect((meta["format"], meta["version"]) == (FORMAT, VERSION), str(path), f"a {FORMAT} of version {VERSION}")
        side, half_m, steps = meta["crop_px"], float(meta["half_size_m"]), meta["walk"]
        check_fields(f"{path}: walk", steps, {"steps": int, "settling": int, "step_m": float})
        expect(32 <= side <= 512 and 0.5 <= half_m <= 5, str(path), f"a possible cube, found {side} pixels and {half_m} m")
        possible = 0 <= steps["settling"] < steps["steps"] <= 10_000 and 0 < steps["step_m"] <= 0.5
        expect(possible, f"{path}: walk", f"0 <= settling < steps <= 10000, 0 < step_m <= 0.5, found {steps}")
        trees, bounds_m, within = _read_trees(Path(folder) / TREES)
        return cls(side, half_m, trees, bounds_m, within, steps["steps"], steps["settling"], steps["step_m"])


def _read_trees(path: Path) -> tuple[Trees, np.ndarray, np.ndarray]:
    """The trees, `deviation_bounds_m` and `within_10cm`, checked so that every walk ends and stays within the arrays."""
    arrays = read_with(load_file, path, "missing, damaged or of another format")
    lengths: dict[str, int] = {}
    for name, schema in _SCHEMA.items():
        expect(name in arrays, str(path), f"an array {name}")
        check_array(f"{path}: {name}", arrays[name].shape, arrays[name].dtype, schema, lengths)
    trees, bounds_m, within = Trees(*(arrays[name] for name in Trees._fields)), arrays["spread_m"], arrays["within_10cm"]
    parents = np.flatnonzero(trees.child >= 0)
    after = (trees.child[parents] > parents) & (trees.child[parents] < lengths["nodes"] - 1)
    for right, expectation in (
        (
            trees.share.size > 0 and lengths["bins"] == lengths["bounds"] + 1,
            "a direction in each leaf and a bound between bins",
        ),
        ((trees.root >= 0) & (trees.root < lengths["nodes"]), "roots that are nodes"),
        (after, "children that are nodes after their parent"),
        (trees.child >= -lengths["leaves"], "leaves that exist"),
        ([np.isfinite(arrays[name]).all() for name in ("direction", "share", "spread_m", "within_10cm")], "finite numbers"),
        ((within >= 0) & (within <= 1), "confidences in 0..1"),
    ):
        expect(bool(np.all(right)), str(path), expectation)
    return trees, bounds_m, within


@dataclass(frozen=True)
class TreeWalkEstimatorConfig:
    """The random tree walk.

    Attributes:
        path: folder of a trained model.
    """

    path: str | None = None


class TreeWalkEstimator:
    """Implements kpopnet.estimator.Estimator.

    Frames are independent: the walks of a frame start at the median of its silhouette, and are seeded with its index in the
    sequence. The confidence is the share of joints within 10 cm of the ground truth among validation walks with a similar
    deviation.
    """

    name = "tree_walk"

    def __init__(self, config: TreeWalkEstimatorConfig) -> None:
        """Raises InputError if no path is given, or the model cannot be read."""
        if config.path is None:
            raise InputError(
                f"estimator=tree_walk needs a trained model: estimator.tree_walk.path=outputs/tree_walk/RUN; {TRAIN_ONE}"
            )
        self.model = TreeWalkModel.load(config.path)

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`."""
        depth_m = sequence_in_metres(depth_m, camera)
        result = Estimate.missing(len(depth_m))
        for frame, cube in person_cubes(depth_m, camera, self.model.half_size_m).items():
            image = integer_image(crop(depth_m[frame], camera, cube, self.model.crop_px)[0])
            uvd, deviation_m = self.model.run_walks(image, frame)
            result.joints_camera_m[frame] = cube.to_metres(uvd)
            result.confidence[frame] = self.model.confidence(deviation_m)
        return result
