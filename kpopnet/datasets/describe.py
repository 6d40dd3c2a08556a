"""Says what a folder of a data set holds, and what an evaluation still needs.

python -m kpopnet.datasets.describe PATH                   a folder of EVAL, SMMC-10, ITOP, UTD-MHAD, dances, a simulated set
python -m kpopnet.datasets.describe PATH --figure ids.png  also draws the ids of EVAL's joints or SMMC-10's markers at their
                                                           positions
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.datasets.eval import EvalBenchmark
from kpopnet.datasets.itop import SPLITS, VIEWS, ItopBenchmark, ItopConfig
from kpopnet.datasets.point_clouds import PointCloudBenchmark
from kpopnet.datasets.protocol import Benchmark, BenchmarkConfig
from kpopnet.datasets.simulated import MANIFEST, PeopleSet, SimulatedBenchmark, SimulatedSet, read_manifest
from kpopnet.datasets.smmc10 import Smmc10Benchmark
from kpopnet.datasets.utd_mhad import UtdMhadBenchmark, UtdMhadConfig
from kpopnet.errors import InputError
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.input_files import expect
from kpopnet.viz.drawing import depth_rgb, enlarged, save_png, write

WIDTH_PX = 960
MARK_RGB = (225, 25, 45)
LAYOUTS = {
    "EVAL": "seq_*_*.bin",
    "SMMC-10": "*.cal.bin",
    "ITOP": "ITOP_*.h5*",
    "UTD-MHAD": "Depth/*_depth.mat",
    "dances": "*/labels.csv",
    "simulated sequences": MANIFEST,
}
"""The pattern of the files by which each set is recognised."""

POINT_CLOUDS: dict[str, type[PointCloudBenchmark]] = {"EVAL": EvalBenchmark, "SMMC-10": Smmc10Benchmark}


def recognised(path: Path) -> tuple[str, Path]:
    """The name in LAYOUTS of the set in a folder, or in the folder that holds a file; and that folder."""
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    folder = path.parent if path.is_file() else path
    folder = folder.parent if folder.name in ("Depth", "Skeleton") else folder
    for name, pattern in LAYOUTS.items():
        if any(folder.glob(pattern)):
            return name, folder
    known = ", ".join(f"{pattern} ({name})" for name, pattern in LAYOUTS.items())
    found = ", ".join(sorted(entry.name for entry in folder.iterdir())[:5]) or "nothing"
    raise InputError(f"{folder}: an unknown layout; expected one of {known}; found {found}")


def describe(path: Path) -> Iterator[str]:
    """Lines on the set in a folder, or in the folder that holds a file; raises InputError as the set's reader."""
    name, folder = recognised(path)
    if name in POINT_CLOUDS:
        yield from _point_clouds(POINT_CLOUDS[name], folder)
    elif name == "ITOP":
        for view, split in ((view, split) for view in VIEWS for split in SPLITS if any(folder.glob(f"ITOP_{view}_{split}_*"))):
            arguments = f"benchmark.view={view} benchmark.split={split}"
            yield from _sequences(ItopBenchmark(ItopConfig(path=str(folder), view=view, split=split)), folder, arguments)
    elif name == "UTD-MHAD":
        yield from _sequences(UtdMhadBenchmark(UtdMhadConfig(path=str(folder))), folder)
    elif name == "dances":
        dances = KpopSet(folder)
        yield f"{dances.manifest.name}: {dances.manifest.about}"
        yield f"{len(dances)} dances; {dances.names[0]} has {len(dances.dance(dances.names[0]).learners)} learners"
        yield f"  python evaluate.py benchmark=kpop benchmark.path={folder}"
    else:
        config = BenchmarkConfig(read_manifest(folder)["benchmark"], str(folder))
        if config.name in ("two_people", "rooms"):
            yield from (PeopleSet(config).about, f"  python evaluate.py benchmark={config.name} benchmark.path={folder}")
        elif config.name == "check_sim":
            yield from (SimulatedSet(config).about, f"  kpopnet check {folder}")
        else:
            yield from _sequences(SimulatedBenchmark(config), folder)


def _point_clouds(kind: type[PointCloudBenchmark], folder: Path) -> Iterator[str]:
    names = kind.names_in(folder)
    path = kind.path(folder, names[0])
    found = kind.recording(path)
    yield f"{kind.set_name}, as published: {len(names)} sequences at {kind.fps:g} frames per second"
    yield f"{path.name}: {len(found.depth_m)} frames of the {found.camera}, with the ids"
    for number in sorted(found.positions_m):
        shown = np.isfinite(found.positions_m[number]).all(axis=1)
        x, y, z = found.positions_m[number][shown.argmax()]
        yield f"  {number}: in {100 * shown.mean():.0f} % of the frames, first at ({x:.2f}, {y:.2f}, {z:.2f}) m"
    yield "The map from joints to these ids is not published in full. Draw them with --figure, and run an evaluation with"
    yield f"  python evaluate.py benchmark={kind.name} benchmark.path={folder} 'benchmark.joints={{head: ID, neck: [ID, ID]}}'"


def _sequences(benchmark: Benchmark, folder: Path, arguments: str = "") -> Iterator[str]:
    names = benchmark.sequence_names()
    yield f"{benchmark.name}: {benchmark.about}"
    first = benchmark.read(names[0])
    share = 100 * np.isfinite(first.joints_camera_m).all(axis=-1).mean()
    yield f"{len(names)} sequences; {first.name}: {len(first.depth_m)} frames of the {first.camera}"
    yield f"{share:.0f} % of its joints have a true position ({benchmark.truth}). Nothing else is needed:"
    yield f"  python evaluate.py benchmark={benchmark.name} benchmark.path={folder} {arguments}".rstrip()


def id_figure(path: Path) -> np.ndarray:
    """RGB image of the ids in the first measured frame of a sequence: the file at `path`, or the first one of the folder."""
    name, folder = recognised(path)
    expect(
        name in POINT_CLOUDS, f"{folder}: --figure", f"EVAL or SMMC-10, whose joints have ids; the joints of {name} have names"
    )
    kind = POINT_CLOUDS[name]
    found = kind.recording(path if path.is_file() else kind.path(folder, kind.names_in(folder)[0]))
    frame = int(found.depth_m.any(axis=(1, 2)).argmax())
    image, scale = enlarged(depth_rgb(found.depth_m[frame]), WIDTH_PX), WIDTH_PX / found.camera.width
    for number, track_m in found.positions_m.items():
        u, v, z = found.camera.project(track_m[frame])
        if z > 0 and 0 <= u < found.camera.width and 0 <= v < found.camera.height:
            position = round((u + 0.5) * scale), round((v + 0.5) * scale)
            cv2.circle(image, position, 4, MARK_RGB, -1, cv2.LINE_AA)
            write(image, str(number), (min(position[0] + 6, WIDTH_PX - 40), position[1] - 4))
    return image


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", type=Path, help="folder of the set, or a file in it")
    parser.add_argument("--figure", type=Path, metavar="FILE.png", help="draw the ids of EVAL or SMMC-10 over the depth")
    options = parser.parse_args()
    for line in describe(options.path):
        print(line)
    if options.figure is not None:
        save_png(options.figure, id_figure(options.path))
        print(f"ids: {options.figure}")


if __name__ == "__main__":
    main()
