"""What a download of EVAL, SMMC-10, ITOP or UTD-MHAD, or a simulated stand-in, contains, and what is missing for a score.

The first sequence that can be read is looked at frame by frame; of the others only their lengths.
"""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from kpopnet.benchmarks import eval_format, smmc10_format
from kpopnet.benchmarks.eval_benchmark import EVAL
from kpopnet.benchmarks.id_pictures import Ids, eval_ids, smmc10_ids
from kpopnet.benchmarks.itop import CAMERA as ITOP_CAMERA
from kpopnet.benchmarks.itop import SPLITS, VIEWS, ItopFiles, sequences_of
from kpopnet.benchmarks.joint_maps import describe_map
from kpopnet.benchmarks.organised_points import describe_camera, fit_camera
from kpopnet.benchmarks.point_files import PointFiles
from kpopnet.benchmarks.smmc10_benchmark import KNOWN_MARKERS, SMMC10
from kpopnet.benchmarks.stand_ins import read_manifest
from kpopnet.benchmarks.utd_mhad import KINECT_JOINTS, STORED_CAMERA, UtdMhadBenchmark, UtdMhadConfig
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

EXPECTED = {
    "EVAL": "seq_a_0.bin, ...",
    "SMMC-10": "real01_1.cal.bin, ...",
    "ITOP": "ITOP_side_test_depth_map.h5 and ITOP_side_test_labels.h5, ...",
    "UTD-MHAD": "Depth/a1_s1_t1_depth.mat and Skeleton/a1_s1_t1_skeleton.mat, ...",
}
"""What a folder of each format holds."""

PATTERNS = {"EVAL": "seq_*_*.bin", "SMMC-10": "*.cal.bin", "ITOP": "ITOP_*.h5*", "UTD-MHAD": "Depth/*_depth.mat"}
"""By what each format is known."""


def describe(path: Path) -> str:
    """What lies in a folder, or in the folder that holds a file.

    Raises:
        InputError: nothing is there, or nothing that is known.
    """
    name, folder = recognised(path)
    return "\n".join(DESCRIBERS[name](folder))


def recognised(path: Path) -> tuple[str, Path]:
    """Which format lies in a folder, or in the folder that holds a file, and that folder.

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
    held = sorted(entry.name for entry in folder.iterdir())
    raise InputError(
        f"{folder}: holds none of the formats known here. Expected "
        + "; or ".join(f"for {name} {files}" for name, files in EXPECTED.items())
        + f". Found {', '.join(held[:5]) or 'nothing'}{', ...' if len(held) > 5 else ''}"
    )


# EVAL and SMMC-10 ------------------------------


def _describe_eval(folder: Path) -> list[str]:
    manifest = read_manifest(folder)
    paths = [EVAL.path(folder, name) for name in EVAL.sequence_names(folder)]
    lines, first = _head(EVAL, manifest, paths, eval_format.count_frames)
    if first is None:
        return lines
    places, markers, frames = Places(), Counter(), 0
    for block in eval_format.read_blocks(first):
        frames += len(block)
        for frame in block:
            for number, xyz in frame["joints"][: frame["njoints"]].tolist():
                places.add(number, xyz, seen=xyz[2] != 0)
            markers.update({eval_format.marker_name(name) for name, _ in frame["markers"][: frame["nmarkers"]].tolist()})
    lines.append(_camera_line(first, eval_ids(first)))
    lines += [f"{first.name} holds joint ids", *places.lines(frames)]
    lines.append(f"and markers {', '.join(sorted(markers)) or 'none'}")
    if manifest is not None:
        return [*lines, describe_map(_lists(manifest.get("joint_ids", {}))), *_ready("eval_sim", folder)]
    return [
        *lines,
        "For a score is missing: which id is which joint, which nobody has published. Look at the picture that --picture",
        "makes, and give",
        f"  python evaluate.py benchmark=eval benchmark.path={folder} 'benchmark.joints={{head: ID, neck: ID, ...}}'"
        " 'estimator=[tracker]'",
        f"with any of {', '.join(JOINT_NAMES)}; of several ids, [ID, ID], the mean is taken.",
    ]


def _describe_smmc10(folder: Path) -> list[str]:
    manifest = read_manifest(folder)
    paths = [SMMC10.path(folder, name) for name in SMMC10.sequence_names(folder)]
    lines, first = _head(SMMC10, manifest, paths, lambda path: smmc10_format.find_layout(path)[1])
    if first is None:
        return lines
    layout, frames = smmc10_format.find_layout(first)
    places = Places()
    for block in smmc10_format.read_blocks(first):
        for frame in block:
            for marker in frame["markers"][: frame["nmarkers"]]:
                places.add(int(marker["id"]), marker["pos"].tolist(), seen=marker["cond"] > 0)
    padding = "packed" if layout == smmc10_format.PACKED else "padded"
    lines.append(f"its frames have {layout.itemsize:,} bytes ({padding})")
    lines.append(_camera_line(first, smmc10_ids(first)))
    lines += [f"{first.name} holds markers", *places.lines(frames)]
    if manifest is not None:
        names = {number: name for name, number in manifest.get("markers", {}).items()}
        lines.append("called " + ", ".join(f"{number} {names[number]}" for number in sorted(names)))
        return [*lines, describe_map(_lists(manifest.get("joint_markers", {}))), *_ready("smmc10_sim", folder)]
    known = _lists(KNOWN_MARKERS)
    absent = sorted({number for ids in known.values() for number in ids} - set(places.seen))
    lines.append(
        f"{describe_map(known)}, by one public reader"
        + (f"; of these {', '.join(map(str, absent))} are never visible in {first.name}" if absent else "")
    )
    return [
        *lines,
        "For a score of these joints nothing is missing:",
        f"  python evaluate.py benchmark=smmc10 benchmark.path={folder} 'estimator=[tracker]'",
        "For one of the others is missing which marker is where. Look at the picture that --picture makes, and add",
        "  'benchmark.joints={neck: ID, left_knee: [ID, ID], ...}'",
    ]


class Places:
    """How often each id is there, and where it is when it first is."""

    def __init__(self) -> None:
        self.given: Counter[int] = Counter()
        self.seen: Counter[int] = Counter()
        self.first: dict[int, list[float]] = {}

    def add(self, number: int, xyz_opengl_m: list[float], seen: bool) -> None:
        self.given[number] += 1
        if seen:
            self.seen[number] += 1
            self.first.setdefault(number, xyz_opengl_m)

    def lines(self, frames: int) -> list[str]:
        lines = []
        for number in sorted(self.given):
            x, y, z = self.first.get(number, (0, 0, 0))
            where = f", first at ({x:.2f}, {-y:.2f}, {-z:.2f}) m" if number in self.first else ""
            lines.append(f"  {number}: in {100 * self.seen[number] / frames:.0f} % of the frames{where}")
        return lines or ["  none"]


def _head(
    files: PointFiles, manifest: dict | None, paths: list[Path], count: Callable[[Path], int]
) -> tuple[list[str], Path | None]:
    """What the set is and how long its sequences are, and the first of them that can be read."""
    real = f"{files.published}, as published"
    lines = [real if manifest is None else f"{manifest['benchmark']}: {manifest.get('about', 'SIMULATED')}"]
    if manifest is not None:
        lines.append(
            f"seed {manifest['seed']}, configuration {manifest['hash']}; {len(paths)} of {manifest['sequences']} sequences"
        )
    lengths, torn = {}, []
    for path in paths:
        try:
            lengths[path] = count(path)
        except InputError as error:
            torn.append(f"cannot be read: {error}")
    if lengths:
        lines.append(
            f"{_plural(len(lengths), 'sequence')}, {_plural(sum(lengths.values()), 'frame')} at {files.fps:.0f} a second, "
            f"{min(lengths.values())} to {max(lengths.values())} each"
        )
    return lines + torn, next(iter(lengths), None)


def _camera_line(path: Path, frame: Ids | None) -> str:
    if frame is None:
        return f"{path.name}: not one point is measured before the camera: no camera can be fitted"
    try:
        return f"camera fitted to {path.name}: {describe_camera(fit_camera(frame.points, str(path)))}"
    except InputError as error:
        return f"no camera: {error}"


def _lists(ids: dict) -> dict[str, list[int]]:
    return {name: given if isinstance(given, list) else [given] for name, given in ids.items()}


def _ready(benchmark: str, folder: Path) -> list[str]:
    return [
        "For a score nothing is missing:",
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
                lines.append(f"{view} {split}: not here")
                continue
            try:
                files = ItopFiles(folder, view, split)
            except InputError as error:
                lines.append(f"{view} {split}: cannot be read: {error}")
                continue
            people = {name.partition("_")[0] for name in files.ids}
            lines.append(
                f"{view} {split}: {_plural(len(files.ids), 'frame')} of {len(people)} people ({', '.join(sorted(people))}), "
                f"{int(files.valid.sum()):,} with checked labels; read as {_plural(len(sequences_of(files.ids)), 'sequence')}"
            )
            ready.append((view, split))
    lines.append(f"camera, by the set's own formula: {describe_camera(ITOP_CAMERA)}")
    lines.append(f"joints: {', '.join(JOINT_NAMES)}, the right ones the person's right")
    if not ready:
        return [*lines, "For a score is missing: of one view and split both depth_map.h5 and labels.h5, whole and unpacked."]
    return [
        *lines,
        "For a score nothing is missing:",
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
    whole = [found for found in numbers if len(found) == 3]
    lines = ["UTD-MHAD, as published", f"{_plural(len(names), 'sequence')} with depth and skeleton (the whole set has 861)"]
    if whole:
        actions, subjects, trials = (len(set(column)) for column in zip(*whole, strict=True))
        lines.append(
            f"of {_plural(actions, 'action')}, {_plural(subjects, 'subject')} and {_plural(trials, 'trial')}, at 30 frames a "
            "second"
        )
    for missing, what in ((depth - skeletons, "Skeleton"), (skeletons - depth, "Depth")):
        if missing:
            lines.append(
                f"without their file in {what}/: {', '.join(sorted(missing)[:5])}{', ...' if len(missing) > 5 else ''}"
            )
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
            f"{first.name}: {_plural(len(first.depth_m), 'frame')}, {labelled} of them with labels once those are aligned"
        )
    lines.append(f"camera, nominal, the image as stored (a mirror's): {describe_camera(STORED_CAMERA)}")
    lines.append(f"labels are the Kinect SDK's: {', '.join(KINECT_JOINTS)}")
    if first is None:
        return [*lines, "For a score is missing: one sequence of which both files can be read."]
    return [
        *lines,
        "For a score nothing is missing:",
        f"  python evaluate.py benchmark=utd_mhad benchmark.path={folder} checkpoint=outputs/train/RUN/best",
    ]


DESCRIBERS: dict[str, Callable[[Path], list[str]]] = {
    "EVAL": _describe_eval,
    "SMMC-10": _describe_smmc10,
    "ITOP": _describe_itop,
    "UTD-MHAD": _describe_utd_mhad,
}
