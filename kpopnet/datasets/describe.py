"""Lists the ids of EVAL's joints or SMMC-10's markers, of which `benchmark.joints` maps joints.

    kpopnet describe PATH                   the folder of the set, or a file in it
    kpopnet describe PATH --figure ids.png  also draws the ids at their positions over the depth

Other sets need no map.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from kpopnet.datasets.point_clouds import EvalBenchmark, PointCloudBenchmark, PointRecording, Smmc10Benchmark
from kpopnet.errors import InputError
from kpopnet.runtime.endings import user_errors
from kpopnet.viz.drawing import depth_rgb, enlarged, save_png, write

WIDTH_PX = 960
MARK_RGB = (225, 25, 45)


def recognised(path: Path) -> tuple[type[PointCloudBenchmark], Path]:
    """The set that a folder, or the folder of a file, holds; and that file or the first one of the folder."""
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    folder = path.parent if path.is_file() else path
    for kind in (Smmc10Benchmark, EvalBenchmark):
        if names := kind.names_in(folder):
            return kind, path if path.is_file() else kind.path(folder, names[0])
    found = ", ".join(sorted(entry.name for entry in folder.iterdir())[:5]) or "nothing"
    raise InputError(
        f"{folder}: expected sequences of SMMC-10 or EVAL, whose joints have ids, found {found}; other sets need no map: "
        "python evaluate.py --help"
    )


def described(kind: type[PointCloudBenchmark], path: Path, found: PointRecording) -> Iterator[str]:
    """Lines on a sequence of a set and its ids."""
    yield f"{kind.set_name}: {path.name}, {len(found.depth_m)} frames of the {found.camera}, with the ids"
    for number in sorted(found.positions_m):
        shown = np.isfinite(found.positions_m[number]).all(axis=1)
        x, y, z = found.positions_m[number][shown.argmax()]
        yield f"  {number}: in {100 * shown.mean():.0f} % of the frames, first at ({x:.2f}, {y:.2f}, {z:.2f}) m"
    yield "The map from joints to these ids is not published in full. Draw them with --figure, and run an evaluation with"
    settings = f"benchmark={kind.name} benchmark.path={path.parent}"
    yield f"  python evaluate.py {settings} 'benchmark.joints={{head: ID, neck: [ID, ID]}}'"


def id_figure(found: PointRecording) -> np.ndarray:
    """RGB image of the ids in the first measured frame, whose greys are halved: the ids are white."""
    frame = int(found.depth_m.any(axis=(1, 2)).argmax())
    image, scale = enlarged(depth_rgb(found.depth_m[frame]) // 2, WIDTH_PX), WIDTH_PX / found.camera.width
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
    parser.add_argument("--figure", type=Path, metavar="FILE.png", help="draw the ids over the depth")
    options = parser.parse_args()
    if options.figure is not None and options.figure.suffix.lower() != ".png":
        raise InputError(f"--figure {options.figure}: expected a name that ends in .png")
    kind, path = recognised(options.path)
    found = kind.recording(path)
    print("\n".join(described(kind, path, found)))
    if options.figure is not None:
        save_png(options.figure, id_figure(found))
        print(f"ids: {options.figure}")
