"""Writes `kpop_sim` in the format of K-Pop sets, spread over processes, with a manifest and a picture of it.

A learner's file is written beside its name and renamed when it is whole, and a dance's labels come last: a run that was
killed goes on by making what is missing.
"""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.kpop import KpopSet
from kpopnet.benchmarks.kpop_format import LABELS, MANIFEST, TEACHER
from kpopnet.benchmarks.kpop_writing import write_labels, write_learner, write_teacher
from kpopnet.dance.performance import Performance
from kpopnet.drawing import TRUE, person_tile, save_png, sheet
from kpopnet.replacing import replacing
from synth.generate import in_processes, progress_bar
from synth.kpop_sim import CAMERA, FPS, LEARNERS, KpopSim, KpopSimSet, dance_name
from synth.skill import LEVELS

SHEET_DANCES, TILES, TILE_PX = 3, 8, 160


def write_set(config: KpopSimSet, folder: Path, processes: int) -> dict:
    """Makes those of the set's dances that are not there yet, and a contact sheet; returns the manifest.

    Raises:
        InputError: the folder holds something else, or a process died; what is finished stays.
    """
    folder.mkdir(parents=True, exist_ok=True)
    manifest = _claim(config, folder)
    wanted = range(config.benchmark.dances)
    missing = [index for index in wanted if not (folder / dance_name(index) / LABELS).exists()]
    if len(missing) < len(wanted):
        print(f"{folder}: {len(wanted) - len(missing)} of {len(wanted)} dances are there already")
    jobs = [(config, folder, index) for index in missing]
    frames = round(sum(config.seconds) / 2 * FPS) * len(LEARNERS)
    with progress_bar(len(missing) * frames, "frame", config.benchmark.name) as bar:
        in_processes(write_dance, jobs, folder, processes, bar)
        bar.total = bar.n  # how long a dance is shows only when it is made
    for torn in folder.glob("dance_*/.*.tmp"):
        torn.unlink(missing_ok=True)
    save_png(folder / "contact_sheet.png", contact_sheet(folder))
    return manifest


def _claim(config: KpopSimSet, folder: Path) -> dict:
    """Writes the manifest before the first dance, so that no dance ever lies there without one."""
    path, benchmark = folder / MANIFEST, config.benchmark
    found = json.loads(path.read_text()) if path.exists() else None
    count = config.amount_in(folder, found, f"*/{LABELS}", "a real set")
    manifest = {
        "simulated": True,
        "name": benchmark.name,
        "about": (
            f"SIMULATED teachers, learners and labels; not the paper's K-Pop set, and no real person: seed {benchmark.seed}, "
            f"split {benchmark.split}, configuration {config.hash}."
        ),
        "seed": benchmark.seed,
        "split": benchmark.split,
        "hash": config.hash,
        "dances": count,
        "fps": FPS,
        "levels": LEVELS,
        "config": json.loads(config.as_json()),
    }
    with replacing(path) as part:
        part.write_text(json.dumps(manifest, indent=1))
    return manifest


_makers: dict[str, KpopSim] = {}


def write_dance(config: KpopSimSet, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
    """Makes what is missing of one dance. `on_frame` is called after every frame of a learner."""
    if config.hash not in _makers:
        _makers.clear()
        _makers[config.hash] = KpopSim(config)
    maker, place = _makers[config.hash], folder / dance_name(index)
    if not (place / TEACHER).exists():
        joints_m = maker.teacher_joints_m(index)
        write_teacher(place, Performance(joints_m, times_s(len(joints_m))), {"motion": maker.teacher_motion(index).name})
    for learner, name in enumerate(LEARNERS):
        if (place / f"{name}.h5").exists():
            continue
        planned = maker.take(index, learner)
        packed, joints_m = maker.record(index, learner, planned.take, on_frame)
        about = {
            "level": LEVELS[planned.level],
            "strengths": dataclasses.asdict(planned.strengths),
            "mistakes": [dataclasses.asdict(mistake) for mistake in planned.mistakes],
        }
        write_learner(place, name, times_s(len(joints_m)), joints_m, packed, about)
    order = np.argsort(maker.levels(index))
    write_labels(place, [LEARNERS[learner] for learner in order])


def times_s(frames: int) -> np.ndarray:
    return np.arange(frames) / FPS


def contact_sheet(folder: Path) -> np.ndarray:
    """RGB picture: of the first dances a row for the teacher and each learner, the same moments below each other."""
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
            about = learner.about
            rows.append((f"{name}, learner {learner.name}: {about['level']}, {_in_words(about['strengths'])}", tiles))
    return sheet(rows, (TRUE,), f"{dances.manifest.about} Depth of the person alone, true joints")


def _in_words(strengths: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2f}" for name, value in strengths.items())
