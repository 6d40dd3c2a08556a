"""A trained random tree walk, its folder (`trees.safetensors` and a `meta.json` that describes it), and its estimator."""

import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

from kpopnet.baselines.tree_walk.walking import Trees, integer_image, walk
from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.data.cube import crop, person_cubes
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.runtime.input_files import check_fields, expect, read_json, read_with
from kpopnet.runtime.provenance import git_revision
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

FORMAT = "kpopnet-tree-walk"
VERSION = 1
TREES, META = "trees.safetensors", "meta.json"

TRAIN_ONE = "`python train.py --config-name tree_walk` trains one"


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
        """Runs the walks of all joints through one image.

        Args:
            image: (crop_px, crop_px) `integer_image`.
            number: index of the image, the seed of its random numbers.

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
        """Writes the folder's files, with configuration, data and metrics (`described`, JSON types) in `meta.json`."""
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
        """Reads a folder written by `save`.

        Raises:
            InputError: no model in the folder, one of another version, or a damaged one.
        """
        path = Path(folder) / META
        if not path.is_file():
            raise InputError(f"{folder}: no tree walk model there (no {META}); {TRAIN_ONE}")
        meta = read_json(path, non_finite=True)
        found = (meta.get("format"), meta.get("version")) if isinstance(meta, dict) else (None, None)
        if found != (FORMAT, VERSION):
            raise InputError(
                f"{path}: expected a {FORMAT} of version {VERSION}, found {found[0]!s:.40} of version {found[1]!s:.40}"
            )
        check_fields(str(path), meta, {"walk": dict, "crop_px": int, "half_size_m": float})
        side, half_m, steps = meta["crop_px"], float(meta["half_size_m"]), meta["walk"]
        check_fields(f"{path}: walk", steps, {"steps": int, "settling": int, "step_m": float})
        expect(32 <= side <= 512 and 0.5 <= half_m <= 5, str(path), f"a possible cube, found {side} pixels and {half_m} m")
        possible = 0 <= steps["settling"] < steps["steps"] <= 10_000 and 0 < steps["step_m"] <= 0.5
        expect(possible, f"{path}: walk", f"0 <= settling < steps <= 10000, 0 < step_m <= 0.5, found {steps}")
        path = Path(folder) / TREES
        arrays = read_with(load_file, path, "missing, damaged or of another format")
        if missing := [name for name in (*Trees._fields, "spread_m", "within_10cm") if name not in arrays]:
            raise InputError(f"{path}: lacks {', '.join(missing)}: of another format")
        trees, bounds_m, within = Trees(*(arrays[name] for name in Trees._fields)), arrays["spread_m"], arrays["within_10cm"]
        if fault := _find_fault(trees, bounds_m, within):
            raise InputError(f"{path}: damaged or of another format: {fault}")
        return cls(side, half_m, trees, bounds_m, within, steps["steps"], steps["settling"], steps["step_m"])


def _find_fault(trees: Trees, bounds_m: np.ndarray, within: np.ndarray) -> str | None:
    """The first error in a model's arrays; None if every walk ends and stays within them, and its confidence exists."""
    nodes, leaves, most = trees.child.size, *(trees.share.shape if trees.share.ndim == 2 else (0, 0))
    bins = within.shape[-1] if within.ndim else 0
    for name, array, kind, shape in (
        ("root", trees.root, np.int32, (NUM_JOINTS,)),
        ("child", trees.child, np.int32, (nodes,)),
        ("threshold", trees.threshold, np.int32, (nodes,)),
        ("probe", trees.probe, np.int16, (nodes, 5)),
        ("direction", trees.direction, np.float32, (leaves, most, 3)),
        ("share", trees.share, np.float32, (leaves, most)),
        ("spread_m", bounds_m, np.float32, (NUM_JOINTS, bins - 1)),
        ("within_10cm", within, np.float32, (NUM_JOINTS, bins)),
    ):
        if array.dtype != kind or array.shape != shape or (array.size == 0 and name != "spread_m"):
            return f"{name} is {array.dtype}{list(array.shape)}, expected {np.dtype(kind)}{list(shape)}"
    inner = trees.child >= 0
    if (trees.root < 0).any() or (trees.root >= nodes).any():
        return "a root is not a node"
    if (trees.child[inner] <= np.flatnonzero(inner)).any() or (trees.child[inner] >= nodes - 1).any():
        return "a node's children do not follow it"
    if (trees.child[~inner] < -leaves).any():
        return "a node's leaf does not exist"
    with np.errstate(over="ignore", invalid="ignore"):
        if not (np.abs(np.linalg.norm(trees.direction, axis=-1) - 1) < 1e-3).all():
            return "directions are not unit vectors"
        if not ((np.diff(trees.share, prepend=0) >= 0).all() and (np.abs(trees.share[:, -1] - 1) < 1e-3).all()):
            return "the shares of a leaf's directions do not add up to 1"
        if (
            not ((within >= 0) & (within <= 1)).all()
            or not (np.isfinite(bounds_m) & (np.diff(bounds_m, append=np.inf) >= 0)).all()
        ):
            return "confidences are not in 0..1, or their bounds do not ascend"
    return None


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
        """Loads the model.

        Raises:
            InputError: no path is given, or the model cannot be read.
        """
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
