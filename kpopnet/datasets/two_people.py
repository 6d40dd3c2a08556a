"""`two_people`: simulated films of two people, with the true joints of both (`python -m synth benchmark=two_people`).

A sequence is a file NAME.npz:

    depth_mm  (T, H, W) uint16     the whole scene, millimetres, 0 where nothing was measured
    joints_m  (T, P, 15, 3) float  true joints, camera frame, metres; person p is the same in all frames
    alone_px  (T, P) int           pixels inside the image that would show the person if the others were not there
    seen_px   (T, P) int           pixels that show the person

manifest.json beside the files says that they are simulated, and names their camera, frame rate and kinds of scenes.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera
from kpopnet.datasets.manifest import manifest_path, open_stand_in, provenance, warn_if_unfinished
from kpopnet.errors import InputError, check_between
from kpopnet.runtime.input_files import ArraySchema, check_fields, check_names, expect, read_npz
from kpopnet.skeleton import NUM_JOINTS

SUFFIX = ".npz"
MAX_PEOPLE = 16
MAX_COORDINATE_M = 100.0

SCHEMA = {
    "depth_mm": ArraySchema("u", ("T", "height", "width")),
    "joints_m": ArraySchema("f", ("T", "people", NUM_JOINTS, 3)),
    "alone_px": ArraySchema("iu", ("T", "people")),
    "seen_px": ArraySchema("iu", ("T", "people")),
}
_CAMERA = dict.fromkeys(("fx", "fy", "cx", "cy", "width", "height"), float)


@dataclass
class TwoPeopleConfig:
    """Settings of the benchmark `two_people`.

    Attributes:
        name: of the benchmark.
        path: folder that `python -m synth benchmark=two_people` wrote.
    """

    name: str = "two_people"
    path: str = "data/two_people"


@dataclass(frozen=True)
class PeopleSequence:
    """A depth sequence of P people.

    Attributes:
        name: unique in its set.
        kind: of scene.
        fps: frames per second.
        camera: of the images.
        depth_mm: (T, H, W) uint16 millimetres of the whole scene, 0 where nothing was measured.
        joints_camera_m: (T, P, 15, 3) float32 true joints, metres, also of people outside the image.
        alone_px: (T, P) pixels inside the image that would show the person if the others were not there.
        seen_px: (T, P) pixels that show the person.
    """

    name: str
    kind: str
    fps: float
    camera: Camera
    depth_mm: np.ndarray
    joints_camera_m: np.ndarray
    alone_px: np.ndarray
    seen_px: np.ndarray


class TwoPeopleSet:
    """A folder of sequences, read one at a time.

    Attributes:
        folder: of the files.
        about: what a reader needs to interpret results.
        provenance: seed, version and configuration hash.
    """

    def __init__(self, config: TwoPeopleConfig) -> None:
        """Lists the sequences.

        Raises:
            InputError: the folder holds no sequences of this set, or its manifest is invalid.
        """
        self.folder = Path(config.path)
        manifest = open_stand_in(self.folder, config.name, "contents", "0.2 GB")
        where = str(manifest_path(self.folder))
        check_fields(where, manifest, {"fps": float, "camera": dict})
        camera = check_fields(f"{where}: camera", manifest["camera"], _CAMERA)
        self.camera = Camera.from_numbers((camera[name] for name in _CAMERA), f"{where}: camera")
        check_between(f"{where}: fps", manifest["fps"], 1, 1000)
        self.fps = float(manifest["fps"])
        self.names = sorted(path.stem for path in self.folder.glob(f"*{SUFFIX}"))
        check_names(str(self.folder), self.names)
        if not self.names:
            raise InputError(f"{self.folder}: no {SUFFIX} file in it; make the set again")
        warn_if_unfinished(self.folder, manifest, len(self.names))
        self._kinds, self.provenance = manifest["contents"], provenance(manifest)
        self.about = (
            f"SIMULATED films of two people, no real person: seed {manifest['seed']}, configuration {manifest['hash']}; "
            f"{len(self.names)} sequences. People are in no training set."
        )

    def read(self, name: str) -> PeopleSequence:
        """Reads one sequence.

        Raises:
            InputError: its file is missing, damaged, larger than allowed, or inconsistent.
        """
        path = self.folder / f"{name}{SUFFIX}"
        found = read_npz(path, SCHEMA)
        depth_mm, joints_m = found["depth_mm"], found["joints_m"]
        kind = self._kinds.get(name)
        expect(isinstance(kind, str), f"{manifest_path(self.folder)}: contents", f"the kind of scene of {name}")
        expect(depth_mm.dtype == np.uint16, f"{path}: depth_mm", f"uint16 millimetres, found {depth_mm.dtype}")
        size = self.camera.height, self.camera.width
        expect(depth_mm.shape[1:] == size, f"{path}: depth_mm", f"images of {size} (height, width), as the camera's")
        expect(len(depth_mm) > 0 and 0 < joints_m.shape[1] <= MAX_PEOPLE, str(path), f"frames of 1 to {MAX_PEOPLE} people")
        fits = np.isfinite(joints_m).all() and np.abs(joints_m).max() <= MAX_COORDINATE_M
        expect(bool(fits), f"{path}: joints_m", f"finite metres of at most {MAX_COORDINATE_M:g}")
        in_order = (found["seen_px"] <= found["alone_px"]).all() and found["seen_px"].min() >= 0
        expect(bool(in_order), f"{path}: seen_px", "at least 0 and at most alone_px")
        return PeopleSequence(
            name=name,
            kind=kind,
            fps=self.fps,
            camera=self.camera,
            depth_mm=depth_mm,
            joints_camera_m=joints_m.astype(np.float32),
            alone_px=found["alone_px"].astype(np.int64),
            seen_px=found["seen_px"].astype(np.int64),
        )
