"""Writes `eval_sim` as EVAL's files, spread over processes, with a manifest that says what they are and a picture.

A file is written beside its name and renamed when it is whole: a run that was killed goes on by making what is missing.
"""

import dataclasses
import json
import os
import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.eval_format import FRAME, HEIGHT, WIDTH, count_frames
from kpopnet.benchmarks.organised_points import FROM_OPENGL
from kpopnet.benchmarks.stand_ins import manifest_path, read_manifest
from kpopnet.drawing import TRUE, depth_picture, draw_skeleton, enlarged, save_png, sheet, with_captions
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from synth.eval_sim import CAMERA, FPS, EvalSim, EvalSimSet, sequence_name
from synth.film import Shot
from synth.generate import in_processes, progress_bar
from synth.markers import MARKERS

MAGIC = -1982
"""What the same authors' SMMC-10 has; EVAL's own is not known to us."""

TILES, TILE_PX = 10, 240


def write_set(config: EvalSimSet, folder: Path, processes: int) -> dict:
    """Makes those of the set's sequences that are not there yet, and a contact sheet; returns the manifest.

    Raises:
        InputError: the folder holds something else, or a process died; what is finished stays.
    """
    folder.mkdir(parents=True, exist_ok=True)
    manifest = _claim(config, folder)
    wanted = range(config.benchmark.sequences)
    missing = [index for index in wanted if not sequence_path(folder, index).exists()]
    if len(missing) < len(wanted):
        print(f"{folder}: {len(wanted) - len(missing)} of {len(wanted)} sequences are there already")
    jobs = [(config, folder, index) for index in missing]
    with progress_bar(len(missing) * sum(config.frames) // 2, "frame", config.benchmark.name) as bar:
        if processes == 1 or len(jobs) == 1:
            for job in jobs:
                write_sequence(*job, lambda: bar.update())
        elif jobs:
            in_processes(write_sequence, jobs, folder, processes, bar)
        bar.total = bar.n  # how long a sequence is shows only when it is made
    for torn in folder.glob(".seq_*.tmp"):
        torn.unlink(missing_ok=True)
    save_png(folder / "contact_sheet.png", contact_sheet(folder, manifest))
    return manifest


def sequence_path(folder: Path, index: int) -> Path:
    return folder / f"{sequence_name(index)}.bin"


def _claim(config: EvalSimSet, folder: Path) -> dict:
    """Writes the manifest before the first file, so that no file ever lies there without one."""
    path, count = manifest_path(folder), config.benchmark.sequences
    if path.exists():
        found = read_manifest(folder)
        if found["hash"] != config.hash:
            raise InputError(
                f"{folder}: holds another set (made with other settings, {found['hash']} against {config.hash}); choose "
                "another out=, or delete that folder"
            )
        count = max(count, found["sequences"])
    elif strange := sorted(folder.glob("seq_*.bin")):
        raise InputError(f"{strange[0]}: not made by this program, maybe the real EVAL; choose another out=")
    manifest = {
        "simulated": True,
        "about": "SIMULATED sequences in the format of EVAL; not EVAL, and no real person.",
        "benchmark": config.benchmark.name,
        "seed": config.benchmark.seed,
        "hash": config.hash,
        "sequences": count,
        "contents": {sequence_name(index): config.kind(index) for index in range(count)},
        "fps": FPS,
        "camera": dataclasses.asdict(CAMERA),
        "joint_ids": {joint.name.lower(): int(joint) for joint in Joint},
        "markers": list(MARKERS),
        "config": json.loads(config.as_json()),
    }
    part = path.with_name(f".manifest.{socket.gethostname()}.{os.getpid()}")
    part.write_text(json.dumps(manifest, indent=1))
    os.replace(part, path)
    return manifest


_makers: dict[str, EvalSim] = {}


def write_sequence(config: EvalSimSet, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
    """Makes one file. `on_frame` is called after every frame."""
    if config.hash not in _makers:
        _makers.clear()
        _makers[config.hash] = EvalSim(config)
    maker = _makers[config.hash]
    path = sequence_path(folder, index)
    torn = path.with_name(f".{path.name}.{socket.gethostname()}.{os.getpid()}.tmp")
    take = maker.take(index)
    try:
        with open(torn, "wb") as file:
            for number, shot in enumerate(maker.shots(index, take, range(len(take.played)))):
                file.write(as_frame(shot, number).tobytes())
                on_frame()
            file.flush()
            os.fsync(file.fileno())
        os.replace(torn, path)
    finally:
        torn.unlink(missing_ok=True)


_SLOPES = CAMERA.points(np.ones((HEIGHT, WIDTH), np.float32))


def as_frame(shot: Shot, number: int) -> np.ndarray:
    """() a frame of EVAL. A joint's id is its place in `kpopnet.skeleton.Joint`."""
    frame = np.zeros((), FRAME)
    frame["magic"], frame["frame"] = MAGIC, number
    frame["xyz"] = _SLOPES * shot.depth_m[..., None] * FROM_OPENGL
    frame["nmarkers"], frame["njoints"] = len(MARKERS), len(Joint)
    frame["markers"]["name"][: len(MARKERS)] = [name.encode() for name in MARKERS]
    frame["markers"]["pos"][: len(MARKERS)] = shot.markers_camera_m * FROM_OPENGL
    frame["joints"]["id"][: len(Joint)] = list(Joint)
    frame["joints"]["pos"][: len(Joint)] = shot.joints_camera_m * FROM_OPENGL
    return frame


def contact_sheet(folder: Path, manifest: dict) -> np.ndarray:
    """RGB picture: a row a sequence, frames spread over it, with the true skeletons."""
    rows = []
    for name, kind in manifest["contents"].items():
        path = folder / f"{name}.bin"
        if not path.exists():
            continue
        frames = count_frames(path)
        tiles = []
        for number in np.linspace(0, frames - 1, TILES).astype(int).tolist():
            frame = np.fromfile(path, FRAME, count=1, offset=number * FRAME.itemsize)[0]
            picture = enlarged(depth_picture(-frame["xyz"][..., 2]), TILE_PX)
            draw_skeleton(picture, frame["joints"]["pos"][: len(Joint)] * FROM_OPENGL, CAMERA, TRUE)
            tiles.append(with_captions(picture, (f"frame {number}",)))
        rows.append((f"{name}: {kind}, {frames} frames", tiles))
    return sheet(rows, (TRUE,), f"SIMULATED, {manifest['benchmark']}, seed {manifest['seed']}: depth and true joints")
