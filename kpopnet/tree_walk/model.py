"""A trained tree walk and its folder: `trees.safetensors` and a `meta.json` that says what it is.

Nothing in it can run code. What is read is checked: every walk through checked trees ends, and within their leaves.
"""

import json
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
import safetensors
from safetensors.numpy import load_file, save_file

from kpopnet.checkpoint import git_revision
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS
from kpopnet.tree_walk.image import SIDES_PX
from kpopnet.tree_walk.walking import Trees, WalkConfig, walk

FORMAT = "kpopnet-tree-walk"
VERSION = 1
TREES, META = "trees.safetensors", "meta.json"


@dataclass(frozen=True)
class TreeWalkModel:
    """All that an estimate needs.

    Attributes:
        crop_px: side of the image of the cube.
        half_size_m: half the cube's edge.
        gait: how the walks go.
        trees: where they go.
        spread_m: (15, B - 1) float32, rising: bounds between walks by how far they spread around their mean.
        within_10cm: (15, B) float32: the share of joints within 10 cm of the truth, of walks between these bounds.
    """

    crop_px: int
    half_size_m: float
    gait: WalkConfig
    trees: Trees
    spread_m: np.ndarray
    within_10cm: np.ndarray

    def walked(self, image: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
        """The walks through one image.

        Args:
            image: (crop_px, crop_px) `integer_image`.
            number: of the image, the seed of its chance.

        Returns:
            (15, 3) float32 places in cube coordinates, and (15,) float32 metres by which each walk spreads around its own.
        """
        step = self.gait.step_m / self.half_size_m
        mean, spread = walk(image, self.trees, self.gait.steps, self.gait.settling, step, number)
        return mean, spread * np.float32(self.half_size_m)

    def confidence(self, spread_m: np.ndarray) -> np.ndarray:
        """(15,) float32, for walks that spread so far: the probability that the joint lies within 10 cm of the truth."""
        between = (spread_m[:, None] >= self.spread_m).sum(axis=1)
        return self.within_10cm[np.arange(NUM_JOINTS), between]

    def save(self, folder: Path, described: dict) -> None:
        """Writes the folder's files.

        Args:
            folder: made if need be.
            described: for `meta.json`: configuration, data and metrics, made of what JSON knows.
        """
        folder.mkdir(parents=True, exist_ok=True)
        arrays = self.trees._asdict() | {"spread_m": self.spread_m, "within_10cm": self.within_10cm}
        save_file({name: np.ascontiguousarray(array) for name, array in arrays.items()}, folder / TREES)
        meta = {
            "format": FORMAT,
            "version": VERSION,
            "crop_px": self.crop_px,
            "half_size_m": self.half_size_m,
            "walk": asdict(self.gait),
            **described,
            "joint_names": JOINT_NAMES,
            "git": git_revision(),
            "packages": {name: version(name) for name in ("numba", "numpy", "safetensors")},
        }
        (folder / META).write_text(json.dumps(meta, indent=2) + "\n")

    @classmethod
    def load(cls, folder: Path | str) -> "TreeWalkModel":
        """Reads a folder that `save` wrote.

        Raises:
            InputError: nothing there, not a model of this version, or damaged.
        """
        path = Path(folder) / META
        if not path.is_file():
            raise InputError(f"{folder}: no tree walk model there (no {META}); `python train_tree_walk.py` makes one")
        try:
            meta = json.loads(path.read_text())
        except ValueError as error:
            raise InputError(f"{path}: not JSON ({error}); the model is damaged or foreign") from error
        found = (meta.get("format"), meta.get("version")) if isinstance(meta, dict) else (None, None)
        if found != (FORMAT, VERSION):
            raise InputError(f"{path}: expected a {FORMAT} of version {VERSION}, found {found[0]} of version {found[1]}")
        try:
            gait = WalkConfig(**meta["walk"])
            crop_px, half_size_m = int(meta["crop_px"]), float(meta["half_size_m"])
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{path}: described in terms unknown here ({error})") from error
        if not (SIDES_PX[0] <= crop_px <= SIDES_PX[1] and 0.5 <= half_size_m <= 5):
            raise InputError(f"{path}: a cube of {crop_px} pixels and {half_size_m} m cannot be")
        path = Path(folder) / TREES
        try:
            arrays = load_file(path)
            trees = Trees(*(arrays[name] for name in Trees._fields))
            spread_m, within = arrays["spread_m"], arrays["within_10cm"]
        except (OSError, KeyError, safetensors.SafetensorError) as error:
            raise InputError(f"{path}: missing, damaged or foreign: {error}") from error
        if fault := _fault(trees, spread_m, within):
            raise InputError(f"{path}: damaged or foreign: {fault}")
        return cls(crop_px, half_size_m, gait, trees, spread_m, within)


def _fault(trees: Trees, spread_m: np.ndarray, within: np.ndarray) -> str | None:
    """What is wrong with a model's arrays; None if walks through them are safe and end."""
    nodes, leaves, most = len(trees.child), len(trees.share), trees.share.shape[-1]
    bins = within.shape[-1]
    for name, array, kind, shape in (
        ("root", trees.root, np.int32, (NUM_JOINTS,)),
        ("child", trees.child, np.int32, (nodes,)),
        ("threshold", trees.threshold, np.int32, (nodes,)),
        ("probe", trees.probe, np.int16, (nodes, 5)),
        ("direction", trees.direction, np.float32, (leaves, most, 3)),
        ("share", trees.share, np.float32, (leaves, most)),
        ("spread_m", spread_m, np.float32, (NUM_JOINTS, bins - 1)),
        ("within_10cm", within, np.float32, (NUM_JOINTS, bins)),
    ):
        if array.dtype != kind or array.shape != shape or (array.size == 0 and name != "spread_m"):
            return f"{name} is {array.dtype}{list(array.shape)}, expected {np.dtype(kind)}{list(shape)}"
    node = np.arange(nodes)
    inner = trees.child >= 0
    if (trees.root < 0).any() or (trees.root >= nodes).any():
        return "a root is no node"
    if (trees.child[inner] <= node[inner]).any() or (trees.child[inner] >= nodes - 1).any():
        return "a node's children do not follow it"
    if (trees.child[~inner] < -leaves).any():
        return "a node's leaf does not exist"
    if not (np.abs(np.linalg.norm(trees.direction, axis=-1) - 1) < 1e-3).all():
        return "directions are no unit vectors"
    if not ((trees.share[:, -1] > 0.999).all() and (np.diff(trees.share, prepend=0) >= 0).all()):
        return "the shares of a leaf's directions do not add up to 1"
    if not ((within >= 0) & (within <= 1)).all() or not (np.diff(spread_m) >= 0).all():
        return "confidences or their bounds are none"
    return None
