"""Writes the sequences of a simulated set (`kpopnet.datasets.simulated`), with a manifest and a contact sheet."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from kpopnet.camera import depth_in_metres
from kpopnet.datasets.simulated import read_sequence
from kpopnet.datasets.simulated import write_sequence as write_file
from kpopnet.viz.drawing import TRUE, depth_rgb, draw_skeleton, enlarged, save_png, sheet, with_captions
from synth.resumable import make_missing, remove_unfinished
from synth.simulated.configuration import maker_of
from synth.simulated.sequences import SequenceMaker, SequenceSet

TILES = 10
TILE_WIDTH_PX, TILE_PORTRAIT_PX = 240, 160


def write_set(maker: type[SequenceMaker], config: SequenceSet, folder: Path, processes: int) -> dict:
    """Makes those of the set's sequences that are missing, and a contact sheet; returns the manifest.

    Raises:
        InputError: the folder holds something else, or a worker process died; finished sequences stay.
    """
    manifest = config.claim(folder, "*.h5", benchmark=config.benchmark.name, about=maker.about, truth=maker.truth)
    make_missing(
        partial(write_sequence, maker, config, folder),
        range(config.benchmark.sequences),
        lambda index: path_of(maker, folder, index).exists(),
        folder,
        "sequence",
        "frame",
        lambda _: sum(config.frames) / 2,
        processes,
    )
    remove_unfinished(folder, ".*.h5.*.tmp")
    save_png(folder / "contact_sheet.png", contact_sheet(maker, folder, manifest))
    return manifest


def path_of(maker: type[SequenceMaker], folder: Path, index: int) -> Path:
    """The file of sequence `index`."""
    return folder / f"{maker.sequence_name(index)}.h5"


def write_sequence(
    maker: type[SequenceMaker], config: SequenceSet, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None
) -> None:
    """Makes the file of one sequence and calls `on_frame` after each frame."""
    write_file(path_of(maker, folder, index), maker_of(maker, config).sequence(index, on_frame))


def contact_sheet(maker: type[SequenceMaker], folder: Path, manifest: dict) -> np.ndarray:
    """RGB contact sheet: a row for each sequence, TILES frames at even distances, with the true skeletons."""
    camera, rows = maker.camera, []
    width_px = TILE_WIDTH_PX if camera.width >= camera.height else TILE_PORTRAIT_PX
    for index in range(manifest["sequences"]):
        path = path_of(maker, folder, index)
        if not path.exists():
            continue
        stored, tiles = read_sequence(path), []
        depth, joints_m = stored.arrays["depth"], stored.arrays["joints_m"]
        for number in np.linspace(0, len(depth) - 1, TILES).astype(int).tolist():
            image = enlarged(depth_rgb(depth_in_metres(depth[number])), width_px)
            for person_m in joints_m[number]:
                draw_skeleton(image, person_m, camera, TRUE)
            tiles.append(with_captions(image, (f"frame {number}",)))
        rows.append((f"{path.stem}: {stored.kind}, {len(depth)} frames", tiles))
    return sheet(rows, (TRUE,), f"SIMULATED, {manifest['benchmark']}, seed {manifest['seed']}: depth and true joints")
