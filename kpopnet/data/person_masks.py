"""Person masks: what the finder's mask network is trained on. Crops of whole scenes around people whom the finder found, with
the pixels that the finder takes for theirs and those that really are.

`python -m synth benchmark=person_masks` writes manifest.json and HDF5 files of N crops each, CROP_PX wide and high, of the cube
(`kpopnet.data.cube`) around the torso as the finder has it, half its edge HALF_M:

    depth_mm     (N, 96, 96) uint16 depth of the scene, millimetres; 0: not measured, or outside the image
    labels       (N, 96, 96) uint8 OWN or OTHER where the finder takes the pixel for this person's or for another's, else 0;
                 THEIRS is added where it shows this person
    centres_m    (N, 3) float32 centres of the cubes, camera frame, metres
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.data.made_sets import Identity, made_files
from kpopnet.runtime.hdf5_files import Hdf5Schema, open_hdf5, read_array
from kpopnet.runtime.input_files import ArraySchema

CROP_PX, HALF_M = 96, 1.15
OWN, OTHER, THEIRS = 1, 2, 4
FORMAT, VERSION = "kpopnet person masks", 1
FILES = "masks_*.h5"

SCHEMA = Hdf5Schema(
    name="person masks",
    fixed={"format": FORMAT, "version": VERSION},
    arrays={
        "depth_mm": ArraySchema("u", ("N", CROP_PX, CROP_PX)),
        "labels": ArraySchema("u", ("N", CROP_PX, CROP_PX)),
        "centres_m": ArraySchema("f", ("N", 3)),
    },
    remedy="make it again",
)


class PersonMasks(NamedTuple):
    """All crops of a folder."""

    depth_mm: np.ndarray
    labels: np.ndarray
    centres_m: np.ndarray
    identity: Identity


def read_person_masks(folder: Path | str) -> PersonMasks:
    """The crops of all files; raises InputError if there are none or one is damaged."""
    paths, identity = made_files(folder, FILES, "person_masks")
    parts = []
    for path in paths:
        with open_hdf5(path, SCHEMA) as file:
            parts.append([read_array(file, name) for name in SCHEMA.arrays])
    return PersonMasks(*(np.concatenate(one) for one in zip(*parts, strict=True)), identity)
