"""`person_masks`: crops of measured scenes around people whom the finder finds, with the pixels that it takes for theirs and
those that are, on which its mask network is trained.
"""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from kpopnet.camera import MM_PER_METRE
from kpopnet.data.person_masks import CROP_PX, FILES, FORMAT, OTHER, OWN, THEIRS, VERSION, read_person_masks
from kpopnet.finder.finder import candidates_in, open_finder
from kpopnet.finder.masks import crop_owner, scene_crop, taken
from kpopnet.finder.people import pixel_owners
from kpopnet.runtime.atomic_write import atomic_hdf5
from kpopnet.skeleton import Joint
from kpopnet.viz.drawing import depth_rgb, enlarged, sheet
from kpopnet.weights import SHA256
from synth.rooms.crops import FINDER, LEAST_PX, PersonCropsConfig, PersonCropsSet, matched
from synth.rooms.images import MeasuredScene
from synth.rooms.scene import ClearScene
from synth.samples.layers import millimetres

COLOURS = {OWN: (90, 140, 255), THEIRS: (240, 170, 30), OWN | THEIRS: (60, 190, 80), OTHER: (90, 90, 90)}
"""RGB of the pixels that only the finder takes for theirs, that only are, that both, and of those that are another's."""


@dataclass
class PersonMasksConfig(PersonCropsConfig):
    """Identity and size of the set.

    Attributes:
        name: name of the set.
    """

    name: str = "person_masks"


@dataclass(frozen=True)
class PersonMasksSet(PersonCropsSet):
    """Makes the files of `person_masks`, which depend on the finder, not on the mask network."""

    finished_files: ClassVar[str] = FILES
    unfinished_files: ClassVar[str] = ".masks_*"
    about = "SIMULATED scenes around people, with the pixels that the finder takes for theirs and those that are."

    benchmark: PersonMasksConfig = field(default_factory=PersonMasksConfig)
    finder: Any = field(default_factory=lambda: SHA256["finder"] | asdict(FINDER))

    def make(self, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
        crops = [crop for scene in self.measured(index, on_frame) for crop in crops_of(*scene)]
        with atomic_hdf5(self.path(folder, index)) as file:
            file.attrs["format"], file.attrs["version"], file.attrs["simulated"] = FORMAT, VERSION, True
            for name, arrays in zip(("depth_mm", "labels", "centres_m"), zip(*crops, strict=True), strict=True):
                packing = {} if name == "centres_m" else {"chunks": (1, CROP_PX, CROP_PX), "compression": 1, "shuffle": True}
                file.create_dataset(name, data=np.stack(arrays), **packing)

    def contact_sheet(self, folder: Path, manifest: dict) -> np.ndarray:
        crops, tiles = read_person_masks(folder), []
        for k in np.linspace(0, len(crops.labels) - 1, 40).astype(int).tolist():
            tile = depth_rgb(crops.depth_mm[k] / np.float32(MM_PER_METRE))
            for labels, colour in COLOURS.items():
                tile[crops.labels[k] == labels] = 0.5 * tile[crops.labels[k] == labels] + 0.5 * np.array(colour)
            tiles.append(enlarged(tile, 192))
        rows = [("", tiles[k : k + 8]) for k in range(0, len(tiles), 8)]
        title = "green: the finder's and theirs; blue: the finder's alone; orange: theirs alone; grey: the finder's, another's"
        return sheet(rows, (), f"SIMULATED, {self.benchmark.split}, seed {manifest['seed']}. {title}")


def crops_of(clear: ClearScene, measured: MeasuredScene) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Depth in millimetres, labels and centre of the people of one scene whom the finder finds."""
    camera, joints_m = clear.camera, clear.joints_camera_m
    if not len(joints_m):
        return
    depth_m = measured.depth_mm / np.float32(MM_PER_METRE)
    found = candidates_in(open_finder(FINDER.weights), depth_m, camera, FINDER.least_certainty)
    owners = pixel_owners(found.cells, depth_m, *map(np.arange, depth_m.shape))
    for row, person in matched(found.centres_m, joints_m[:, Joint.TORSO]):
        if np.count_nonzero(owners == row + 1) < LEAST_PX:
            continue
        crop = scene_crop(depth_m, camera, found.centres_m[row])
        truly = taken((measured.labels == person + 1).astype(np.uint8), crop.rows, crop.columns)
        yield millimetres(crop.depth_m), crop_owner(found.cells, crop, row + 1) + THEIRS * truly, found.centres_m[row]
