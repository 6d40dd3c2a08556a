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

from collections import namedtuple
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numba import njit
from safetensors.numpy import load_file, save_file

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.data.cube import crop, person_cubes
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.runtime.atomic_write import atomic_path, write_json
from kpopnet.runtime.input_files import ArraySchema, as_path, check_array, check_fields, expect, read_json, read_with
from kpopnet.runtime.provenance import git_revision
from kpopnet.skeleton import BONES, JOINT_NAMES, NUM_JOINTS, Joint

TREES, META = "trees.safetensors", "meta.json"
FORMAT, VERSION = "kpopnet-tree-walk", 1
TRAIN_ONE = "`kpopnet train --config-name tree_walk` trains one"

UNITS = 10_000
"""Integer depth units per half edge of the cube; a unit is about a tenth of a millimetre."""

UNMEASURED = np.int16(32_767)
"""Value of pixels without a measurement: behind everything else."""

HALF_SIZE_M = 1.15
"""Half the cube's edge, that of the networks."""

STEPS, SETTLING, STEP = 128, 32, 0.05 / HALF_SIZE_M
"""Steps of each joint's walk, the first ones that are left out of the mean, and a step's length, 5 cm, in cube units."""

MAX_DIFFERENCE = 4_000
"""Depth differences are clipped to this, about 45 cm in front of and behind the position. Pixels farther behind and pixels
without a measurement give the same value."""

START = np.full(NUM_JOINTS, -1, np.int32)
"""(15,) the joint at whose estimate the walk of each joint starts; -1 for the centre of the silhouette."""
START[[child for _, child in BONES]] = [parent for parent, _ in BONES]

ORDER = np.array(sorted(Joint, key=(Joint.TORSO, Joint.NECK, *Joint).index), np.int32)
"""(15,) joints in the order of their walks, parents before children."""


SCHEMA = {
    "root": ArraySchema("i", (NUM_JOINTS,)),  # root node of each joint's tree
    # child for features below the threshold, the other child is the next node; or -1 - leaf
    "child": ArraySchema("i", ("nodes",)),
    "threshold": ArraySchema("i", ("nodes",)),  # of the feature
    "probe": ArraySchema("i", ("nodes", 5)),  # see `feature`
    "direction": ArraySchema("f", ("leaves", "directions", 3)),  # unit vectors in (u, v, d), the directions of each leaf
    "share": ArraySchema("f", ("leaves", "directions")),  # cumulative probabilities of the directions, up to 1
}
"""The arrays of a model's file: int32, int16 probes and float32."""

Trees = namedtuple("Trees", SCHEMA)
"""The trees of all joints, concatenated into one set of arrays for numba."""


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
def walk(image, trees, key):
    """(15, 3) float32 mean (u, v, d) of the walks of all joints through one (S, S) `integer_image`, seeded by `key`.

    Walks are clipped to the cube: outside it trees give no direction back.
    """
    mean = np.zeros((NUM_JOINTS, 3), np.float32)
    for joint in ORDER:
        position, total = np.zeros(3), np.zeros(3)
        if START[joint] >= 0:
            for axis in range(3):  # element by element: numba compiles a copy of a row for a second
                position[axis] = mean[START[joint], axis]
        for number in range(STEPS):
            leaf = find_leaf(trees, joint, image, position)
            draw = random_uniform(key, joint * STEPS + number)
            chosen = 0
            while trees.share[leaf, chosen] <= draw and chosen < trees.share.shape[1] - 1:
                chosen += 1
            for axis in range(3):
                position[axis] = min(max(position[axis] + STEP * trees.direction[leaf, chosen, axis], -1.0), 1.0)
                if number >= SETTLING:
                    total[axis] += position[axis]
        for axis in range(3):
            mean[joint, axis] = total[axis] / (STEPS - SETTLING)
    return mean


@dataclass(frozen=True)
class TreeWalkModel:
    """A trained model: the trees of all joints, and the side in pixels of the cube's image that they read."""

    crop_px: int
    trees: Trees

    def save(self, folder: Path, described: dict) -> None:
        """Writes trees.safetensors and meta.json, with configuration and data (`described`, JSON types)."""
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_path(folder / TREES) as part:
            save_file({name: np.ascontiguousarray(array) for name, array in self.trees._asdict().items()}, part)
        made = {"git": git_revision(), "packages": {name: version(name) for name in ("numba", "numpy", "safetensors")}}
        kind = {"format": FORMAT, "version": VERSION, "crop_px": self.crop_px, "half_size_m": HALF_SIZE_M}
        write_json(folder / META, kind | described | {"joint_names": JOINT_NAMES} | made)

    @classmethod
    def load(cls, folder: Path | str) -> "TreeWalkModel":
        """Reads a folder written by `save`; raises InputError if it holds no model of this version or a damaged one."""
        path = as_path(folder) / META
        if not path.is_file():
            raise InputError(f"{folder}: no tree walk model there (no {META}); {TRAIN_ONE}")
        kind = {"format": str, "version": int, "crop_px": int, "half_size_m": float}
        meta = check_fields(str(path), read_json(path, non_finite=True), kind)
        known = (meta["format"], meta["version"], meta["half_size_m"]) == (FORMAT, VERSION, HALF_SIZE_M)
        expectation = f"a {FORMAT} of version {VERSION} with a cube of {HALF_SIZE_M} m and 32 to 512 pixels; {TRAIN_ONE}"
        expect(known and 32 <= meta["crop_px"] <= 512, str(path), expectation)
        return cls(meta["crop_px"], _read_trees(Path(folder) / TREES))


def _read_trees(path: Path) -> Trees:
    """The trees, checked so that every walk ends and stays within the arrays."""
    arrays = read_with(load_file, path, "missing, damaged or of another format")
    lengths: dict[str, int] = {}
    for name, schema in SCHEMA.items():
        expect(name in arrays, str(path), f"an array {name}")
        check_array(f"{path}: {name}", arrays[name].shape, arrays[name].dtype, schema, lengths)
    trees = Trees(*(arrays[name] for name in Trees._fields))
    parents = np.flatnonzero(trees.child >= 0)
    last, children = lengths["nodes"] - 1, trees.child[parents]
    valid = (trees.root >= 0).all() and (trees.root <= last).all() and (children > parents).all() and (children < last).all()
    valid = valid and trees.share.size > 0 and (trees.child >= -lengths["leaves"]).all()
    expect(bool(valid), str(path), "roots that are nodes, children after their parent, and leaves with a direction")
    expect(all(np.isfinite(one).all() for one in (trees.direction, trees.share)), str(path), "finite numbers")
    return trees


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
    sequence. The confidence is 1 in every frame with a person: a walk does not judge itself.
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
        for frame, cube in person_cubes(depth_m, camera, HALF_SIZE_M).items():
            image = integer_image(crop(depth_m[frame], camera, cube, self.model.crop_px)[0])
            result.joints_camera_m[frame] = cube.to_metres(walk(image, self.model.trees, frame))
            result.confidence[frame] = 1
        return result
