"""Person crops: what the finder cuts out of whole scenes, with the true joints, for the training of networks.

`python -m synth benchmark=person_crops` writes manifest.json and HDF5 files of N crops each:

    pixels_mm    (M,) uint16 depth of all crops, row after row, millimetres; 0: not measured, or not of this person
    starts       (N + 1,) int64 the first pixel of each crop, and M
    cameras      (N, 6) fx, fy, cx, cy, width, height of a crop's pixels
    joints_m     (N, 15, 3) float32 true joints in the camera frame, metres
    visible      (N, 15) bool: the joint's pixel shows this person

Errors of the finder are in them: lost hands, parts of other people and of things.
"""

from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.data.made_sets import located, made_files
from kpopnet.data.observation import Observation
from kpopnet.runtime.hdf5_files import Hdf5Schema, kept_open, opened_hdf5, read_array, readable, stored_array
from kpopnet.runtime.input_files import ArraySchema, expect
from kpopnet.skeleton import NUM_JOINTS

FORMAT, VERSION = "kpopnet person crops", 1
FILES = "crops_*.h5"

SCHEMA = Hdf5Schema(
    name="person crops",
    fixed={"format": FORMAT, "version": VERSION},
    arrays={
        "pixels_mm": ArraySchema("u", ("M",)),
        "starts": ArraySchema("i", ("K",)),
        "cameras": ArraySchema("f", ("N", 6)),
        "joints_m": ArraySchema("f", ("N", NUM_JOINTS, 3)),
        "visible": ArraySchema("b", ("N", NUM_JOINTS)),
    },
    remedy="make it again",
)


class _File:
    """An open file with everything but the pixels in memory."""

    def __init__(self, path: Path) -> None:
        self.path, self.file = path, opened_hdf5(path, SCHEMA)
        with readable(path, SCHEMA):
            self.pixels_mm: h5py.Dataset = stored_array(self.file, "pixels_mm")
            self.starts, self.cameras, self.joints_m, self.visible = (
                read_array(self.file, name) for name in ("starts", "cameras", "joints_m", "visible")
            )
        sizes = np.prod(self.cameras[:, 4:], axis=1)
        expect(np.array_equal(np.append(0, np.cumsum(sizes)), self.starts), f"{path}: starts", "the cameras' sizes added up")
        expect(self.starts[-1] == len(self.pixels_mm), f"{path}: pixels_mm", f"{self.starts[-1]} pixels")


class PersonCrops:
    """A folder of person crops; implements `kpopnet.data.observation.ObservationSource`. Every epoch shows the same."""

    def __init__(self, folder: Path | str) -> None:
        """Reads the sizes of all files; raises InputError if there are none or one is damaged."""
        self.paths, self.identity = made_files(folder, FILES, "person_crops")
        self._ends = np.cumsum([len(_File(path).cameras) for path in self.paths]).tolist()
        self._open: dict[int, _File] = {}

    def __len__(self) -> int:
        return self._ends[-1]

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_open": {}}

    def observe(self, index: int, epoch: int) -> Observation:
        """See `kpopnet.data.observation.ObservationSource`."""
        del epoch
        number, row = located(self._ends, index)
        file = kept_open(self._open, number, lambda: _File(self.paths[number]))
        camera = Camera.from_numbers(file.cameras[row].tolist(), str(file.path))
        with readable(file.path, SCHEMA):
            pixels_mm = file.pixels_mm[file.starts[row] : file.starts[row + 1]]
        depth_m = pixels_mm.reshape(camera.height, camera.width).astype(np.float32) / np.float32(MM_PER_METRE)
        return Observation(depth_m, camera, file.joints_m[row], file.visible[row])
