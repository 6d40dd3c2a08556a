"""Writes stand-ins as the real sets' files, spread over processes, with a manifest that says what they are and a picture.

A file is written beside its name and renamed when it is whole: a run that was killed goes on by making what is missing.
"""

import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.stand_ins import manifest_path, read_manifest
from kpopnet.camera import Camera
from kpopnet.drawing import TRUE, depth_picture, draw_skeleton, enlarged, save_png, sheet, with_captions
from kpopnet.replacing import replacing
from synth.film import Shot
from synth.generate import in_processes, progress_bar
from synth.stand_in import StandIn, StandInSet

TILES = 10
TILE_WIDTH_PX, TILE_PORTRAIT_PX = 240, 160


@dataclass(frozen=True)
class StandInFormat:
    """The files of one stand-in.

    Attributes:
        maker: of its sequences.
        stands_for: the real set's name.
        suffix: of the files.
        truth: what the manifest says of where the truth lies in the files.
        as_bytes: one frame as stored, of what was filmed and the frame's number.
        count_frames: of a file.
        look: depth (H, W) and the joints (15, 3) that its truth says, in the camera frame, of a file's frame.
    """

    maker: type[StandIn]
    stands_for: str
    suffix: str
    truth: dict[str, object]
    as_bytes: Callable[[Shot, int], bytes]
    count_frames: Callable[[Path], int]
    look: Callable[[Path, int], tuple[np.ndarray, np.ndarray]]

    def path(self, folder: Path, index: int) -> Path:
        return folder / f"{self.maker.sequence_name(index)}{self.suffix}"


def write_set(form: StandInFormat, config: StandInSet, folder: Path, processes: int) -> dict:
    """Makes those of the set's sequences that are not there yet, and a contact sheet; returns the manifest.

    Raises:
        InputError: the folder holds something else, or a process died; what is finished stays.
    """
    folder.mkdir(parents=True, exist_ok=True)
    manifest = _claim(form, config, folder)
    wanted = range(config.benchmark.sequences)
    missing = [index for index in wanted if not form.path(folder, index).exists()]
    if len(missing) < len(wanted):
        print(f"{folder}: {len(wanted) - len(missing)} of {len(wanted)} sequences are there already")
    jobs = [(form, config, folder, index) for index in missing]
    with progress_bar(len(missing) * sum(config.frames) // 2, "frame", config.benchmark.name) as bar:
        in_processes(write_sequence, jobs, folder, processes, bar)
        bar.total = bar.n  # how long a sequence is shows only when it is made
    for torn in folder.glob(f".*{form.suffix}.*.tmp"):
        torn.unlink(missing_ok=True)
    save_png(folder / "contact_sheet.png", contact_sheet(form, folder, manifest))
    return manifest


def _claim(form: StandInFormat, config: StandInSet, folder: Path) -> dict:
    """Writes the manifest before the first file, so that no file ever lies there without one."""
    maker = form.maker
    count = config.amount_in(folder, read_manifest(folder), f"*{form.suffix}", f"the real {form.stands_for}")
    manifest = {
        "simulated": True,
        "about": f"SIMULATED sequences in the format of {form.stands_for}; not {form.stands_for}, and no real person.",
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
    with replacing(manifest_path(folder)) as part:
        part.write_text(json.dumps(manifest, indent=1))
    return manifest


_makers: dict[str, StandIn] = {}


def write_sequence(
    form: StandInFormat, config: StandInSet, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None
) -> None:
    """Makes one file. `on_frame` is called after every frame."""
    if config.hash not in _makers:
        _makers.clear()
        _makers[config.hash] = form.maker(config)
    maker = _makers[config.hash]
    take = maker.take(index)
    with replacing(form.path(folder, index)) as part, part.open("wb") as file:
        for number, shot in enumerate(maker.shots(index, take, range(len(take.played)))):
            file.write(form.as_bytes(shot, number))
            on_frame()


def contact_sheet(form: StandInFormat, folder: Path, manifest: dict) -> np.ndarray:
    """RGB picture: a row a sequence, frames spread over it, with the true skeletons."""
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
            picture = enlarged(depth_picture(depth_m), width_px)
            draw_skeleton(picture, joints_camera_m, camera, TRUE)
            tiles.append(with_captions(picture, (f"frame {number}",)))
        rows.append((f"{name}: {kind}, {frames} frames", tiles))
    return sheet(rows, (TRUE,), f"SIMULATED, {manifest['benchmark']}, seed {manifest['seed']}: depth and true joints")
