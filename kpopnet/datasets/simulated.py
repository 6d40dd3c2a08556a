"""Simulated depth sequences of any number of people: their files, and the readers of `eval_sim`, `smmc10_sim`, `two_people` and
`rooms`.

`python -m synth benchmark=SET` writes manifest.json, which calls the set simulated, and an HDF5 file for each sequence:
the arrays of `StoredSequence`, and the attributes fps, camera (fx, fy, cx, cy, width, height), kind, people and marker_names.
"""

import logging
import re
from collections.abc import Sequence as Several
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.data.made_sets import MANIFEST
from kpopnet.datasets.protocol import BenchmarkConfig, Origin, Sequence, check_joints, heading_rad
from kpopnet.errors import InputError, check_between
from kpopnet.runtime.atomic_write import atomic_hdf5
from kpopnet.runtime.hdf5_files import Hdf5Schema, attributes_of, open_hdf5, read_array, stored_array
from kpopnet.runtime.input_files import ArraySchema, check_fields, check_names, expect, read_json
from kpopnet.skeleton import NUM_JOINTS

log = logging.getLogger(__name__)

FORMAT, VERSION = "kpopnet sequence", 1

SCHEMA = Hdf5Schema(
    name="a simulated sequence",
    attributes={
        "format": str, "version": int, "fps": float, "camera": list[float], "kind": str, "people": list[str],
        "marker_names": list[str],
    },
    optional=("marker_names",),
    fixed={"format": FORMAT, "version": VERSION},
    arrays={
        "depth": ArraySchema("uf", ("T", None, None)),
        "joints_m": ArraySchema("f", ("T", "P", NUM_JOINTS, 3)),
        "markers_m": ArraySchema("f", ("T", "P", None, 3), required=False),
        "alone_px": ArraySchema("iu", ("T", "P"), required=False),
        "whole_px": ArraySchema("iu", ("T", "P"), required=False),
        "seen_px": ArraySchema("iu", ("T", "P"), required=False),
    },
    remedy="make it again",
)  # fmt: skip
MANIFEST_SCHEMA = {
    "simulated": bool, "benchmark": str, "about": str, "truth": str, "seed": int, "hash": str,
    "sequences": int, "config": dict,
}  # fmt: skip


@dataclass(frozen=True)
class StoredSequence:
    """The content of a file: T frames of P people."""

    name: str
    kind: str  # of motion or scene
    fps: float
    camera: Camera
    people: tuple[str, ...]  # equal names in a set are the same person
    depth: np.ndarray  # (T, H, W) the whole scene, float32 metres or uint16 millimetres; 0: not measured
    joints_m: np.ndarray  # (T, P, 15, 3) float32 true joints, metres in the camera frame; NaN: unknown
    # (T, P, M, 3) float32 markers on skin or clothes, metres in the camera frame; NaN: not tracked
    markers_m: np.ndarray | None = None
    marker_names: tuple[str, ...] = ()
    alone_px: np.ndarray | None = None  # (T, P) pixels inside the image that would show the person if the others were not there
    # (T, P) pixels that the whole person would have if the image had no border and nothing else were there
    whole_px: np.ndarray | None = None
    seen_px: np.ndarray | None = None  # (T, P) pixels that show the person


def write_sequence(folder: Path, sequence: StoredSequence) -> None:
    """Writes NAME.h5, whole or not at all."""
    with atomic_hdf5(folder / f"{sequence.name}.h5") as file:
        file.attrs["format"], file.attrs["version"], file.attrs["simulated"] = FORMAT, VERSION, True
        file.attrs["fps"], file.attrs["kind"] = sequence.fps, sequence.kind
        file.attrs["camera"] = astuple(sequence.camera)
        file.attrs["people"], file.attrs["marker_names"] = list(sequence.people), list(sequence.marker_names)
        for name in SCHEMA.arrays:
            if (array := getattr(sequence, name)) is not None:
                packing = {"chunks": (1, *array.shape[1:]), "compression": 1, "shuffle": True} if array.size else {}
                file.create_dataset(name, data=array, **packing)


def read_sequence(path: Path, images: Several[int] | None = None) -> StoredSequence:
    """Reads a file: all of its depth images, or those with the given ascending numbers, and every other array whole.

    Raises InputError if it is missing, damaged, larger than the budget, or inconsistent.
    """
    with open_hdf5(path, SCHEMA) as file:
        attributes = attributes_of(file)
        names = [name for name in SCHEMA.arrays if name in file and (images is None or name != "depth")]
        arrays = {name: read_array(file, name) for name in names}
        if images is not None:
            arrays["depth"] = stored_array(file, "depth")[list(images)]
    joints_m, people = arrays["joints_m"], tuple(attributes["people"])
    expect(len(joints_m) > 0 and len(people) == joints_m.shape[1], str(path), "frames, and a name for each person")
    if people:
        check_joints(f"{path}: joints_m", joints_m)
    expect(len(attributes["camera"]) == 6, f"{path}: camera", "fx, fy, cx, cy, width, height")
    camera, fps = Camera.from_numbers(attributes["camera"], f"{path}: camera"), float(attributes["fps"])
    check_between(f"{path}: fps", fps, 1, 1000)
    expect(arrays["depth"].shape[1:] == (camera.height, camera.width), f"{path}: depth", "images of the camera's size")
    names = tuple(attributes.get("marker_names", ()))
    return StoredSequence(path.stem, attributes["kind"], fps, camera, people, marker_names=names, **arrays)


class SimulatedSet:
    """A folder of simulated sequences, read one at a time, ordered by number, with the attributes of a `Benchmark`."""

    origin = Origin.SIMULATED

    def __init__(self, config: BenchmarkConfig) -> None:
        """Lists the sequences; raises InputError if there are none of this set, or the manifest is invalid."""
        self.name, self.folder = config.name, config.folder(f"the folder that `python -m synth benchmark={config.name}` wrote")
        make = f"`python -m synth benchmark={config.name} out={self.folder}` makes the set"
        if not (path := self.folder / MANIFEST).exists():
            raise InputError(f"{self.folder}: no {MANIFEST} in it; {make}")
        try:
            manifest = check_fields(str(path), read_json(path, non_finite=True), MANIFEST_SCHEMA)
            expect(manifest["simulated"], str(path), "a set that is called simulated")
        except InputError as error:
            raise InputError(f"{error}; make the set again") from error
        if manifest["benchmark"] != config.name:
            raise InputError(f"{self.folder}: holds {manifest['benchmark']}, not {config.name}")
        found = [path.stem for path in self.folder.glob("[!.]*.h5")]
        check_names(str(self.folder), found)
        self.names = sorted(found, key=lambda name: (int((re.findall(r"\d+", name) or "0")[-1]), name))
        if not self.names:
            raise InputError(f"{self.folder}: none of its sequences NAME.h5 is there; {make}")
        if len(self.names) < manifest["sequences"]:
            log.warning("%s: only %d of its %d sequences exist; %s", self.folder, len(self.names), manifest["sequences"], make)
        self.truth = manifest["truth"]
        self.about = (
            f"{manifest['about']} Seed {manifest['seed']}, configuration {manifest['hash']}; {len(self.names)} sequences. "
            "People and motions are in no training set."
        )
        generator = manifest["config"].get("generator")
        self.provenance = {"seed": manifest["seed"], "version": generator, "config_hash": manifest["hash"]}

    def path(self, name: str) -> Path:
        return self.folder / f"{name}.h5"

    def sequence_names(self) -> list[str]:
        return self.names


class SimulatedBenchmark(SimulatedSet):
    """A set of sequences of one person: `eval_sim` and `smmc10_sim`."""

    @property
    def label_definition(self) -> str | None:
        """Markers on the skin are other points of the body than our joints."""
        return self.truth if "markers" in self.truth else None

    def read(self, name: str) -> Sequence:
        path = self.path(name)
        stored = read_sequence(path)
        expect(len(stored.people) == 1, str(path), "one person")
        joints_m = stored.joints_m[:, 0].astype(np.float32)
        return Sequence(
            name=name,
            identity=stored.people[0],
            fps=stored.fps,
            camera=stored.camera,
            depth_m=depth_in_metres(stored.depth, stored.camera, where=f"{path}: depth"),
            joints_camera_m=joints_m,
            visible=np.isfinite(joints_m).all(axis=-1),
            yaw_rad=heading_rad(joints_m),
            is_segmented=False,
        )


class PeopleSet(SimulatedSet):
    """A set of sequences of any number of people, in millimetres: `two_people` (with `alone_px`), `rooms` (with `whole_px`)."""

    def read(self, name: str) -> StoredSequence:
        """Reads one sequence; raises InputError as `read_sequence`, or if it lacks the pixels of each person."""
        path = self.path(name)
        stored = read_sequence(path)
        expect(stored.depth.dtype == np.uint16, f"{path}: depth", "uint16 millimetres")
        full_px = stored.alone_px if stored.whole_px is None else stored.whole_px
        if full_px is None or stored.seen_px is None:
            raise InputError(f"{path}: expected arrays seen_px, and alone_px or whole_px")
        in_order = bool(((stored.seen_px >= 0) & (stored.seen_px <= full_px)).all())
        expect(in_order, f"{path}: seen_px", "at least 0 and at most alone_px or whole_px")
        return stored
