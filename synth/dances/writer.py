"""Writes `kpop_sim` in the format of dance sets (docs/kpop_format.md), with a manifest and a contact sheet.

A dance's labels are written after its learners: a dance that has labels is finished.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.datasets.dances.format import LABELS, TEACHER
from kpopnet.datasets.dances.writer import write_labels, write_learner, write_teacher
from kpopnet.viz.drawing import TRUE, person_tile, save_png, sheet
from synth.dances.simulate import CAMERA, FPS, LEARNERS, KpopSim, KpopSimSet, dance_name
from synth.resumable import make_missing, remove_unfinished
from synth.simulated.configuration import maker_of

SHEET_DANCES, TILES, TILE_PX = 3, 8, 160


def write_set(config: KpopSimSet, folder: Path, processes: int) -> dict:
    """Makes those of the set's dances that are missing, and a contact sheet; returns the manifest.

    Raises:
        InputError: the folder holds something else, or a worker process died; finished learners stay.
    """
    benchmark = config.benchmark
    manifest = config.claim(
        folder,
        f"*/{LABELS}",
        name=benchmark.name,
        about=(
            f"SIMULATED teachers, learners and labels; not the paper's K-Pop set, and no real person: seed {benchmark.seed}, "
            f"split {benchmark.split}, faults {benchmark.faults}, configuration {config.hash}."
        ),
        split=benchmark.split,
        fps=FPS,
        levels=config.levels,
    )
    make_missing(
        partial(write_dance, config, folder),
        range(config.benchmark.dances),
        lambda index: (folder / dance_name(index) / LABELS).exists(),
        folder,
        "dance",
        "frame",
        lambda _: sum(config.seconds) / 2 * FPS * len(LEARNERS),
        processes,
    )
    remove_unfinished(folder, "dance_*/.*.tmp")
    save_png(folder / "contact_sheet.png", contact_sheet(folder))
    return manifest


def write_dance(config: KpopSimSet, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
    """Makes the missing files of one dance and calls `on_frame` after each frame of a learner."""
    maker, place = maker_of(KpopSim, config), folder / dance_name(index)
    if not (place / TEACHER).exists():
        joints_m = maker.teacher_joints_m(index)
        write_teacher(
            place, Performance(joints_m, np.arange(len(joints_m)) / FPS), {"motion": maker.teacher_motion(index).name}
        )
    for learner, name in enumerate(LEARNERS):
        if (place / f"{name}.h5").exists():
            continue
        planned = maker.take(index, learner)
        packed, joints_m = maker.record(index, learner, planned.take, on_frame)
        about = {
            "level": config.levels[planned.level],
            "strengths": planned.strengths,
            "mistakes": [dataclasses.asdict(mistake) for mistake in planned.mistakes],
        }
        write_learner(place, name, np.arange(len(joints_m)) / FPS, joints_m, packed, about)
    order = np.argsort(maker.levels(index))
    write_labels(place, [LEARNERS[learner] for learner in order])


def contact_sheet(folder: Path) -> np.ndarray:
    """RGB contact sheet of the first SHEET_DANCES dances: a row for the teacher and each learner, columns at equal times."""
    dances, rows = KpopSet(folder), []
    nothing_m = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    for name in dances.names[:SHEET_DANCES]:
        dance = dances.dance(name)
        taught_m = dance.teacher().joints_m
        chosen = np.linspace(0, len(taught_m) - 1, TILES + 2).astype(int)[1:-1].tolist()
        tiles = [person_tile(nothing_m, CAMERA, ((taught_m[frame], TRUE),), TILE_PX, ("",)) for frame in chosen]
        rows.append((f"{name}, teacher", tiles))
        for learner in dance.learners:
            clip, joints_m = learner.depth(), learner.joints().joints_m
            tiles = [
                person_tile(clip.depth_m[frame], clip.camera, ((joints_m[frame], TRUE),), TILE_PX, (f"{frame / FPS:.1f} s",))
                for frame in chosen
            ]
            strengths = "".join(f", {kind} {value:.2f}" for kind, value in learner.about["strengths"].items())
            rows.append((f"{name}, learner {learner.name}: {learner.about['level']}{strengths}", tiles))
    return sheet(rows, (TRUE,), f"{dances.manifest.about} Depth of the person alone, true joints")
