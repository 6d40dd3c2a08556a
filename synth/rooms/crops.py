"""`person_crops`: what the finder cuts out of measured scenes, with the true joints, on which networks are trained.

A network that is trained on clean cut-outs alone loses on the finder's a seventh of the joints that it has right on true masks:
hands are missing, and parts of other people and of things are there.
"""

from collections.abc import Callable, Iterator
from dataclasses import asdict, astuple, dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import linear_sum_assignment

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.data.observation import Observation
from kpopnet.data.person_crops import FILES, FORMAT, VERSION, PersonCrops
from kpopnet.finder.finder import FinderConfig, PersonFinder
from kpopnet.runtime.atomic_write import atomic_hdf5
from kpopnet.skeleton import Joint
from kpopnet.viz.drawing import TRUE, scene_tile, sheet
from kpopnet.weights import SHA256
from synth.rooms.images import MeasuredScene, RoomImagesConfig, SceneShards
from synth.rooms.scene import ClearScene
from synth.samples.layers import at_joints, millimetres

IMAGE_PX = (320, 240)  # most width and height of the scenes' images

FINDER = FinderConfig(least_certainty=0.3)
"""Less sure than where it is used: those whom it hardly finds are the hard ones."""

TILE_PX = 240
NEAR_M, LEAST_PX = 0.3, 100
"""A crop is of the person whose torso is this near to the finder's, and shows at least LEAST_PX pixels."""


@dataclass
class PersonCropsConfig(RoomImagesConfig):
    """Identity and size of the set.

    Attributes:
        name: name of the set.
        shards: number of files of 500 scenes.
        dances: number of dances of which single poses are taken.
    """

    name: str = "person_crops"
    shards: int = 40


@dataclass(frozen=True)
class PersonCropsSet(SceneShards):
    """Makes the files of `person_crops`, which depend on the finder too."""

    finished_files: ClassVar[str] = FILES
    unfinished_files: ClassVar[str] = ".crops_*"
    camera: ClassVar[Camera] = Camera.centred(200, *IMAGE_PX)  # each scene has its own
    most_px = IMAGE_PX
    about = "SIMULATED people, cut out of depth images of rooms by the finder."

    benchmark: PersonCropsConfig = field(default_factory=PersonCropsConfig)
    finder: Any = field(default_factory=lambda: SHA256["finder"] | SHA256["masks"] | asdict(FINDER))

    def manifest_entries(self) -> dict:
        return {"about": self.about, "scenes_per_shard": self.per_shard}

    def make(self, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
        crops = [crop for scene in self.measured(index, on_frame) for crop in crops_of(*scene)]
        pixels = [millimetres(crop.depth_m).ravel() for crop in crops]
        arrays = {
            "pixels_mm": np.concatenate(pixels),
            "starts": np.append(0, np.cumsum([len(one) for one in pixels])),
            "cameras": np.array([astuple(crop.camera) for crop in crops], float),
            "joints_m": np.stack([crop.joints_camera_m for crop in crops]).astype(np.float32),
            "visible": np.stack([crop.visible for crop in crops]),
        }
        with atomic_hdf5(self.path(folder, index)) as file:
            file.attrs["format"], file.attrs["version"], file.attrs["simulated"] = FORMAT, VERSION, True
            for name, array in arrays.items():
                packing = {"chunks": (8192,), "compression": 1, "shuffle": True} if name == "pixels_mm" else {}
                file.create_dataset(name, data=array, **packing)

    def contact_sheet(self, folder: Path, manifest: dict) -> np.ndarray:
        crops, tiles = PersonCrops(folder), []
        for k in np.linspace(0, len(crops) - 1, 40).astype(int).tolist():
            crop = crops.observe(k, 0)
            width_px = round(TILE_PX * min(1, crop.camera.width / crop.camera.height))
            tiles.append(scene_tile(crop.depth_m, crop.camera, ((crop.joints_camera_m, TRUE),), width_px))
        rows = [("", tiles[k : k + 8]) for k in range(0, len(tiles), 8)]
        return sheet(rows, (TRUE,), f"SIMULATED, cut out by the finder, {self.benchmark.split}, seed {manifest['seed']}")


def crops_of(clear: ClearScene, measured: MeasuredScene) -> Iterator[Observation]:
    """The people of one scene whom the finder finds."""
    camera, joints_m = clear.camera, clear.joints_camera_m
    if not len(joints_m):
        return
    humans = PersonFinder(camera, FINDER).extract(measured.depth_mm / np.float32(MM_PER_METRE))
    for row, person in matched(np.array([human.centre_m for human in humans]), joints_m[:, Joint.TORSO]):
        human = humans[row]
        if np.count_nonzero(human.depth_m) >= LEAST_PX:
            visible = at_joints(measured.labels, joints_m[person], camera) == person + 1
            yield Observation(human.depth_m, human.cropped(camera), joints_m[person], visible)


def matched(centres_m: np.ndarray, torsos_m: np.ndarray) -> list[tuple[int, int]]:
    """Numbers of those found, by (N, 3) centres, and of the people whom they show, by (P, 3) torsos."""
    apart_m = np.linalg.norm(torsos_m - centres_m.reshape(-1, 1, 3), axis=-1)
    pairs = zip(*linear_sum_assignment(np.minimum(apart_m, NEAR_M)), strict=True)
    return [(row, person) for row, person in pairs if apart_m[row, person] < NEAR_M]
