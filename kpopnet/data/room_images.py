"""Room images: what the finder of people is trained on. Depth images of whole scenes with the person that each pixel shows.

`python -m synth benchmark=room_images` writes manifest.json and HDF5 files of N images each, which all lie in the upper left
corner of a CANVAS:

    depth_mm     (N, 128, 160) uint16 depth, millimetres; 0: not measured, or outside the image
    labels       (N, 128, 160) uint8 person that a measured pixel shows, 1..6; 0: none
    cameras      (N, 6) fx, fy, cx, cy, width, height of the image
    joints_m     (N, 6, 15, 3) float32 true joints in the camera frame, metres; NaN: there is no such person
    whole_px     (N, 6) float32 pixels that the whole person would have if nothing hid or cut them; 0: no such person
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera
from kpopnet.data.canvas import CANVAS
from kpopnet.data.made_sets import located, made_files
from kpopnet.runtime.hdf5_files import Hdf5Schema, open_hdf5, read_array
from kpopnet.runtime.input_files import ArraySchema
from kpopnet.skeleton import NUM_JOINTS

MOST_PEOPLE = 6
FORMAT, VERSION = "kpopnet room images", 1
FILES = "images_*.h5"

SCHEMA = Hdf5Schema(
    name="room images",
    fixed={"format": FORMAT, "version": VERSION},
    arrays={
        "depth_mm": ArraySchema("u", ("N", CANVAS[1], CANVAS[0])),
        "labels": ArraySchema("u", ("N", CANVAS[1], CANVAS[0])),
        "cameras": ArraySchema("f", ("N", 6)),
        "joints_m": ArraySchema("f", ("N", MOST_PEOPLE, NUM_JOINTS, 3)),
        "whole_px": ArraySchema("f", ("N", MOST_PEOPLE)),
    },
    remedy="make it again",
)


class RoomImage(NamedTuple):
    """One image; see the arrays above."""

    depth_mm: np.ndarray
    labels: np.ndarray
    camera: Camera
    joints_m: np.ndarray
    whole_px: np.ndarray


class RoomImages:
    """A folder of room images as one sequence. A file's images are decoded together and kept while its neighbours are read."""

    def __init__(self, folder: Path | str) -> None:
        """Reads the sizes of all files; raises InputError if there are none or one is damaged."""
        self.paths, self.identity = made_files(folder, FILES, "room_images")
        sizes = []
        for path in self.paths:
            with open_hdf5(path, SCHEMA) as file:
                sizes.append(len(file["depth_mm"]))
        self._ends = np.cumsum(sizes).tolist()
        self._held: tuple[int, dict[str, np.ndarray]] | None = None

    def __len__(self) -> int:
        return self._ends[-1]

    def __getitem__(self, index: int) -> RoomImage:
        """Image `index`."""
        number, row = located(self._ends, index)
        arrays = self.file(number)
        camera = Camera.from_numbers(arrays["cameras"][row].tolist(), str(self.paths[number]))
        return RoomImage(
            *(arrays[name][row] for name in ("depth_mm", "labels")), camera, arrays["joints_m"][row], arrays["whole_px"][row]
        )

    def file(self, number: int) -> dict[str, np.ndarray]:
        """All arrays of file `number`."""
        if self._held is None or self._held[0] != number:
            with open_hdf5(self.paths[number], SCHEMA) as file:
                self._held = number, {name: read_array(file, name) for name in SCHEMA.arrays}
        return self._held[1]
