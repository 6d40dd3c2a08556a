"""Writes simulated sequences, with a manifest that calls them simulated, and a contact sheet."""

import dataclasses
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.camera import Camera
from kpopnet.datasets.manifest import manifest_path, read_manifest
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.viz.drawing import TRUE, depth_rgb, draw_skeleton, enlarged, save_png, sheet, with_captions
from synth.resumable import Units, make_missing, remove_unfinished
from synth.simulated.sequences import SequenceMaker, StandInSet

TILES = 10
TILE_WIDTH_PX, TILE_PORTRAIT_PX = 240, 160


@dataclass(frozen=True)
class StandInFormat:
    """The file format of one simulated set.

    Attributes:
        maker: the class that makes its sequences.
        stands_for: the real set's name; None where there is no such real set.
        suffix: of the files' names.
        truth: manifest entries that say where the true joints are in the files.
        encode: rendered frames to the bytes of the file, in pieces.
        count_frames: (path) to the number of frames in a file.
        look: (path, frame) to depth (H, W) in metres and true joints (..., 15, 3) in the camera frame, read from a file.
    """

    maker: type[SequenceMaker]
    stands_for: str | None
    suffix: str
    truth: dict[str, object]
    encode: Callable[[Iterator[Any]], Iterator[bytes]]
    count_frames: Callable[[Path], int]
    look: Callable[[Path, int], tuple[np.ndarray, np.ndarray]]

    def path(self, folder: Path, index: int) -> Path:
        return folder / f"{self.maker.sequence_name(index)}{self.suffix}"


def write_set(form: StandInFormat, config: StandInSet, folder: Path, processes: int) -> dict:
    """Makes those of the set's sequences that are missing, and a contact sheet; returns the manifest.

    Raises:
        InputError: the folder holds something else, or a worker process died; finished sequences stay.
    """
    folder.mkdir(parents=True, exist_ok=True)
    manifest = _claim(form, config, folder)
    units = Units("frame", lambda _: sum(config.frames) / 2, exact=False)
    make_missing(
        partial(write_sequence, form, config, folder),
        range(config.benchmark.sequences),
        lambda index: form.path(folder, index).exists(),
        folder,
        "sequence",
        units,
        processes,
    )
    remove_unfinished(folder, f".*{form.suffix}.*.tmp")
    save_png(folder / "contact_sheet.png", contact_sheet(form, folder, manifest))
    return manifest


def _claim(form: StandInFormat, config: StandInSet, folder: Path) -> dict:
    """Writes the manifest before the first file, so that no simulated file ever lies in a folder without one."""
    maker = form.maker
    real = form.stands_for
    count = config.amount_in(folder, read_manifest(folder), f"*{form.suffix}", f"the real {real}" if real else "recordings")
    manifest = {
        "simulated": True,
        "about": f"SIMULATED sequences{f' in the format of {real}; not {real}, and' if real else ','} no real person.",
        "benchmark": config.benchmark.name,
        "seed": config.benchmark.seed,
        "hash": config.hash,
        "sequences": count,
        "contents": {maker.sequence_name(index): config.kind(index) for index in range(count)},
        "fps": maker.fps,
        "camera": dataclasses.asdict(maker.camera),
        **form.truth,
        "config": json.loads(config.as_json()),
    }
    with atomic_path(manifest_path(folder)) as part:
        part.write_text(json.dumps(manifest, indent=1))
    return manifest


_makers: dict[str, SequenceMaker] = {}


def write_sequence(
    form: StandInFormat, config: StandInSet, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None
) -> None:
    """Makes the file of one sequence and calls `on_frame` after each frame."""
    if config.hash not in _makers:
        _makers.clear()
        _makers[config.hash] = form.maker(config)
    maker = _makers[config.hash]
    take = maker.take(index)
    shots = _counted(maker.shots(index, take, range(len(take))), on_frame)
    with atomic_path(form.path(folder, index)) as part, part.open("wb") as file:
        file.writelines(form.encode(shots))


def _counted(shots: Iterator[Any], on_frame: Callable[[], None]) -> Iterator[Any]:
    for shot in shots:
        yield shot
        on_frame()


def contact_sheet(form: StandInFormat, folder: Path, manifest: dict) -> np.ndarray:
    """RGB contact sheet: a row for each sequence, TILES frames at even distances, with the true skeletons."""
    camera: Camera = form.maker.camera
    width_px = TILE_WIDTH_PX if camera.width >= camera.height else TILE_PORTRAIT_PX
    rows = []
    for name, kind in manifest["contents"].items():
        path = folder / f"{name}{form.suffix}"
        if not path.exists():
            continue
        frames = form.count_frames(path)
        tiles = []
        for number in np.linspace(0, frames - 1, TILES).astype(int).tolist():
            depth_m, joints_camera_m = form.look(path, number)
            image = enlarged(depth_rgb(depth_m), width_px)
            for person_m in joints_camera_m.reshape(-1, *joints_camera_m.shape[-2:]):
                draw_skeleton(image, person_m, camera, TRUE)
            tiles.append(with_captions(image, (f"frame {number}",)))
        rows.append((f"{name}: {kind}, {frames} frames", tiles))
    return sheet(rows, (TRUE,), f"SIMULATED, {manifest['benchmark']}, seed {manifest['seed']}: depth and true joints")
