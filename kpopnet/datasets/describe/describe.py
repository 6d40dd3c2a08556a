"""Describes a download of EVAL, SMMC-10, ITOP or UTD-MHAD, or a stand-in, and what an evaluation still needs.

The first readable sequence is read frame by frame; only the lengths of the others are determined.
"""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from kpopnet.datasets.describe.id_figures import Ids, eval_ids, smmc10_ids
from kpopnet.datasets.eval import format as eval_format
from kpopnet.datasets.eval.benchmark import EVAL
from kpopnet.datasets.itop import CAMERA as ITOP_CAMERA
from kpopnet.datasets.itop import SPLITS, VIEWS, ItopFiles, split_into_sequences
from kpopnet.datasets.manifest import read_manifest
from kpopnet.datasets.point_clouds.benchmark import PointFiles
from kpopnet.datasets.point_clouds.joint_maps import describe_map
from kpopnet.datasets.point_clouds.organised import describe_camera, fit_camera
from kpopnet.datasets.smmc10 import format as smmc10_format
from kpopnet.datasets.smmc10.benchmark import KNOWN_MARKERS, SMMC10
from kpopnet.datasets.utd_mhad import KINECT_JOINTS, STORED_CAMERA, UtdMhadBenchmark, UtdMhadConfig
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

EXPECTED = {
    "EVAL": "seq_a_0.bin, ...",
    "SMMC-10": "real01_1.cal.bin, ...",
    "ITOP": "ITOP_side_test_depth_map.h5 and ITOP_side_test_labels.h5, ...",
    "UTD-MHAD": "Depth/a1_s1_t1_depth.mat and Skeleton/a1_s1_t1_skeleton.mat, ...",
}
"""The files in a folder of each format, for messages."""

PATTERNS = {"EVAL": "seq_*_*.bin", "SMMC-10": "*.cal.bin", "ITOP": "ITOP_*.h5*", "UTD-MHAD": "Depth/*_depth.mat"}
"""Glob pattern by which each format is recognised."""


def describe(path: Path) -> str:
    """Describes the set in a folder, or in the folder that holds a file.

    Raises:
        InputError: the path does not exist, or the folder holds no known format.
    """
    name, folder = recognise_format(path)
    return "\n".join(DESCRIBERS[name](folder))


def recognise_format(path: Path) -> tuple[str, Path]:
    """Name of the format in a folder, or in the folder that holds a file; and that folder.

    Raises:
        InputError: see `describe`.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    folder = path.parent if path.is_file() else path
    if folder.name in ("Depth", "Skeleton"):
        folder = folder.parent
    for name, pattern in PATTERNS.items():
        if any(folder.glob(pattern)):
            return name, folder
    names = sorted(entry.name for entry in folder.iterdir())
    raise InputError(
        f"{folder}: holds no known format. Expected "
        + "; or ".join(f"for {name} {files}" for name, files in EXPECTED.items())
        + f". Found {', '.join(names[:5]) or 'nothing'}{', ...' if len(names) > 5 else ''}"
    )


# EVAL and SMMC-10 ------------------------------


def _describe_eval(folder: Path) -> list[str]:
    manifest = read_manifest(folder)
    paths = [EVAL.path(folder, name) for name in EVAL.sequence_names(folder)]
    lines, first = _head(EVAL, manifest, paths, eval_format.count_frames)
    if first is None:
        return lines
    statistics, markers, frames = IdStatistics(), Counter(), 0
    for block in eval_format.read_blocks(first):
        frames += len(block)
        for frame in block:
            for number, xyz in frame["joints"][: frame["njoints"]].tolist():
                statistics.add(number, xyz, visible=xyz[2] != 0)
            markers.update({eval_format.marker_name(name) for name, _ in frame["markers"][: frame["nmarkers"]].tolist()})
    lines.append(_camera_line(first, eval_ids(first)))
    lines += [f"{first.name} holds joint ids", *statistics.lines(frames)]
    lines.append(f"and markers {', '.join(sorted(markers)) or 'none'}")
    if manifest is not None:
        return [*lines, describe_map(_lists(manifest.get("joint_ids", {}))), *_ready("eval_sim", folder)]
    return [
        *lines,
        "An evaluation still needs the map from joints to ids, which is not published. Draw the ids with --figure and run",
        f"  python evaluate.py benchmark=eval benchmark.path={folder} 'benchmark.joints={{head: ID, neck: ID, ...}}'"
        " 'estimator=[tracker]'",
        f"with any of {', '.join(JOINT_NAMES)}. The mean of several ids, [ID, ID], is used.",
    ]


def _describe_smmc10(folder: Path) -> list[str]:
    manifest = read_manifest(folder)
    paths = [SMMC10.path(folder, name) for name in SMMC10.sequence_names(folder)]
    lines, first = _head(SMMC10, manifest, paths, lambda path: smmc10_format.find_layout(path)[1])
    if first is None:
        return lines
    layout, frames = smmc10_format.find_layout(first)
    statistics = IdStatistics()
    for block in smmc10_format.read_blocks(first):
        for frame in block:
            for marker in frame["markers"][: frame["nmarkers"]]:
                statistics.add(int(marker["id"]), marker["pos"].tolist(), visible=marker["cond"] > 0)
    padding = "packed" if layout == smmc10_format.PACKED else "padded"
    lines.append(f"its frames have {layout.itemsize:,} bytes ({padding})")
    lines.append(_camera_line(first, smmc10_ids(first)))
    lines += [f"{first.name} holds markers", *statistics.lines(frames)]
    if manifest is not None:
        names = {number: name for name, number in manifest.get("markers", {}).items()}
        lines.append("marker names: " + ", ".join(f"{number} {names[number]}" for number in sorted(names)))
        return [*lines, describe_map(_lists(manifest.get("joint_markers", {}))), *_ready("smmc10_sim", folder)]
    known = _lists(KNOWN_MARKERS)
    absent = sorted({number for ids in known.values() for number in ids} - set(statistics.visible))
    lines.append(
        f"{describe_map(known)}, by one public reader"
        + (f"; of these {', '.join(map(str, absent))} are never visible in {first.name}" if absent else "")
    )
    return [
        *lines,
        "An evaluation of these joints needs nothing else:",
        f"  python evaluate.py benchmark=smmc10 benchmark.path={folder} 'estimator=[tracker]'",
        "For the other joints it needs the ids of their markers. Draw the ids with --figure and add",
        "  'benchmark.joints={neck: ID, left_knee: [ID, ID], ...}'",
    ]


class IdStatistics:
    """Counts in how many frames each id is visible, and keeps its first visible position."""

    def __init__(self) -> None:
        self.listed: Counter[int] = Counter()
        self.visible: Counter[int] = Counter()
        self.first_position: dict[int, list[float]] = {}

    def add(self, number: int, xyz_opengl_m: list[float], visible: bool) -> None:
        """Adds an id of a frame with its position in metres, y up, z negative in front of the camera."""
        self.listed[number] += 1
        if visible:
            self.visible[number] += 1
            self.first_position.setdefault(number, xyz_opengl_m)

    def lines(self, frames: int) -> list[str]:
        """One line of text per id. `frames` is the number of frames."""
        lines = []
        for number in sorted(self.listed):
            x, y, z = self.first_position.get(number, (0, 0, 0))
            where = f", first at ({x:.2f}, {-y:.2f}, {-z:.2f}) m" if number in self.first_position else ""
            lines.append(f"  {number}: in {100 * self.visible[number] / frames:.0f} % of the frames{where}")
        return lines or ["  none"]


def _head(
    files: PointFiles, manifest: dict | None, paths: list[Path], count: Callable[[Path], int]
) -> tuple[list[str], Path | None]:
    """Lines of text on the set and the lengths of its sequences; and the path of the first readable sequence, if any."""
    real = f"{files.set_name}, as published"
    lines = [real if manifest is None else f"{manifest['benchmark']}: {manifest.get('about', 'SIMULATED')}"]
    if manifest is not None:
        lines.append(
            f"seed {manifest['seed']}, configuration {manifest['hash']}; {len(paths)} of {manifest['sequences']} sequences"
        )
    lengths, errors = {}, []
    for path in paths:
        try:
            lengths[path] = count(path)
        except InputError as error:
            errors.append(f"cannot be read: {error}")
    if lengths:
        lines.append(
            f"{_plural(len(lengths), 'sequence')}, {_plural(sum(lengths.values()), 'frame')} at {files.fps:.0f} per second, "
            f"{min(lengths.values())} to {max(lengths.values())} each"
        )
    return lines + errors, next(iter(lengths), None)


def _camera_line(path: Path, frame: Ids | None) -> str:
    if frame is None:
        return f"{path.name}: no point in front of the camera is measured: no camera can be fitted"
    try:
        return f"camera fitted to {path.name}: {describe_camera(fit_camera(frame.points, str(path)))}"
    except InputError as error:
        return f"no camera: {error}"


def _lists(ids: dict) -> dict[str, list[int]]:
    return {name: given if isinstance(given, list) else [given] for name, given in ids.items()}


def _ready(benchmark: str, folder: Path) -> list[str]:
    return [
        "An evaluation needs nothing else:",
        f"  python evaluate.py benchmark={benchmark} benchmark.path={folder} 'estimator=[tracker]'",
    ]


def _plural(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"


# ITOP and UTD-MHAD ------------------------------


def _describe_itop(folder: Path) -> list[str]:
    lines, ready = ["ITOP, as published"], []
    for view in VIEWS:
        for split in SPLITS:
            part = f"ITOP_{view}_{split}"
            if not any(folder.glob(f"{part}_*")):
                lines.append(f"{view} {split}: not in this folder")
                continue
            try:
                files = ItopFiles(folder, view, split)
            except InputError as error:
                lines.append(f"{view} {split}: cannot be read: {error}")
                continue
            people = {name.partition("_")[0] for name in files.ids}
            sequences = _plural(len(split_into_sequences(files.ids)), "sequence")
            lines.append(
                f"{view} {split}: {_plural(len(files.ids), 'frame')} of {len(people)} people ({', '.join(sorted(people))}), "
                f"{int(files.valid.sum()):,} with checked labels; split into {sequences}"
            )
            ready.append((view, split))
    lines.append(f"camera, from the formula published with the set: {describe_camera(ITOP_CAMERA)}")
    lines.append(f"joints: {', '.join(JOINT_NAMES)}; right is the person's right")
    if not ready:
        return [*lines, "An evaluation still needs complete and decompressed depth_map.h5 and labels.h5 of one view and split."]
    return [
        *lines,
        "An evaluation needs nothing else:",
        *(
            f"  python evaluate.py benchmark=itop benchmark.path={folder} benchmark.view={view} benchmark.split={split}"
            " checkpoint=outputs/train/RUN/best"
            for view, split in ready
        ),
    ]


def _describe_utd_mhad(folder: Path) -> list[str]:
    depth = {path.name.removesuffix("_depth.mat") for path in folder.glob("Depth/*_depth.mat")}
    skeletons = {path.name.removesuffix("_skeleton.mat") for path in folder.glob("Skeleton/*_skeleton.mat")}
    benchmark = UtdMhadBenchmark(UtdMhadConfig(path=str(folder)))
    names = [name for name in benchmark.sequence_names() if name in skeletons]
    numbers = [[int(digits) for digits in re.findall(r"\d+", name)] for name in names]
    complete = [number for number in numbers if len(number) == 3]
    lines = ["UTD-MHAD, as published", f"{_plural(len(names), 'sequence')} with depth and skeleton (the complete set has 861)"]
    if complete:
        actions, subjects, trials = (len(set(column)) for column in zip(*complete, strict=True))
        lines.append(
            f"of {_plural(actions, 'action')}, {_plural(subjects, 'subject')} and {_plural(trials, 'trial')}, at 30 frames per "
            "second"
        )
    for missing, what in ((depth - skeletons, "Skeleton"), (skeletons - depth, "Depth")):
        if missing:
            lines.append(f"without a file in {what}/: {', '.join(sorted(missing)[:5])}{', ...' if len(missing) > 5 else ''}")
    first = None
    for name in names:
        try:
            first = benchmark.read(name)
            break
        except InputError as error:
            lines.append(f"cannot be read: {error}")
    if first is not None:
        labelled = int(first.visible.any(axis=1).sum())
        lines.append(
            f"{first.name}: {_plural(len(first.depth_m), 'frame')}, {labelled} of them with labels after the alignment in time"
        )
    lines.append(f"camera of the mirrored image as stored: {describe_camera(STORED_CAMERA)}")
    lines.append(f"labels of the Kinect SDK: {', '.join(KINECT_JOINTS)}")
    if first is None:
        return [*lines, "An evaluation still needs one sequence with two readable files."]
    return [
        *lines,
        "An evaluation needs nothing else:",
        f"  python evaluate.py benchmark=utd_mhad benchmark.path={folder} checkpoint=outputs/train/RUN/best",
    ]


DESCRIBERS: dict[str, Callable[[Path], list[str]]] = {
    "EVAL": _describe_eval,
    "SMMC-10": _describe_smmc10,
    "ITOP": _describe_itop,
    "UTD-MHAD": _describe_utd_mhad,
}
