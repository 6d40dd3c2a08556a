"""Makes K-Pop sets (docs/kpop_format.md) of recorded motion: BVH files, ImperialDance, AIST++ keypoints.

    python -m synth.kpop_convert bvh OUT --dance NAME --teacher T.bvh --learners BEST.bvh GOOD.bvh ...
    python -m synth.kpop_convert aist OUT --dance NAME --teacher T.json --learners BEST.json GOOD.json ...
    python -m synth.kpop_convert imperial FOLDER OUT

Learners are named from the best to the worst: that order becomes the labels. Then

    python evaluate.py benchmark=kpop benchmark.path=OUT 'estimator=[]'

BVH files are danced by a mean adult of `synth`, and joints taken from it. The other two hold points: the torso is the mean
of shoulders and hips, as in the paper (section 2.3); metres, centimetres and millimetres, and whether y or z is up, are told
by the dancer's trunk; all are turned as a whole so that they face the camera in the mean over the first twentieth of their
frames.

ImperialDance: files dance_level_[e|i|b]_GENRE_chN.npy, (takes, 3, frames, 21) at 100 Hz. For every choreography one expert's
take is the teacher; the learners are another expert's, an intermediate dancer's and a beginner's.

AIST++: its pickles can run code when they are opened, so they are refused. Where you trust them, save them as

    numpy.savez("T.npz", keypoints3d=pickle.load(open("T.pkl", "rb"))["keypoints3d_optim"])
"""

import argparse
import json
import re
import zipfile
import zlib
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.kpop_writing import write_labels, write_learner, write_teacher
from kpopnet.dance.performance import Performance
from kpopnet.entry import user_errors
from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS, Joint
from synth.body import load_body, shape_person
from synth.kpop_sim import TEACHER_M, KpopSim, KpopSimSet
from synth.motion.retargeting import bvh_motion

AIST_FPS, IMPERIAL_FPS = 60.0, 100.0

_SIDES = ("right", "left")
_LIMBS = ("SHOULDER", "ELBOW", "HAND", "HIP", "KNEE", "FOOT")
COCO = {f"{side.upper()}_{limb}": 6 + 2 * n - (side == "left") for n, limb in enumerate(_LIMBS) for side in _SIDES}
"""Joint to the number of its point in COCO's order, where the left one comes first."""

_COCO_EARS = (3, 4)
NECK_SHARE = 0.37
"""How far the neck lies on the way from between the shoulders to the middle of the head, on synth's mean adult."""

IMPERIAL_POINTS = (
    "RShin", "RToe", "RThigh", "LThigh", "LFoot", "RShoulder", "LHand", "RHand", "LFArm", "LShoulder", "RFoot", "Neck",
    "LShin", "Chest", "Head", "LToe", "Ab", "RUArm", "LUArm", "Hip", "RFArm",
)  # fmt: skip
_IMPERIAL_LIMBS = ("UArm", "FArm", "Hand", "Thigh", "Shin", "Foot")
IMPERIAL = {
    f"{side.upper()}_{limb}": IMPERIAL_POINTS.index(side[0].upper() + name)
    for limb, name in zip(_LIMBS, _IMPERIAL_LIMBS, strict=True)
    for side in _SIDES
}
"""Joint to the number of its point: a segment's point is where it begins."""

_IMPERIAL_FILE = re.compile(r"dance_level_([eib])_([a-z])_ch(\d+)\.npy")
_UNITS_M = (1.0, 0.01, 0.001)
_TRUNK_M = (0.25, 0.9)


def from_points(points: np.ndarray, limbs: dict[str, int], head: np.ndarray, neck: np.ndarray, where: str) -> np.ndarray:
    """Fifteen joints of recorded points, before a level camera that the dancer faces at first.

    Args:
        points: (T, P, 3) in any usual unit, y or z up, NaN where missing.
        limbs: joint's name to the number of its point.
        head: (T, 3) its middle.
        neck: (T, 3).
        where: for messages.

    Returns:
        (T, 15, 3) float32 metres.

    Raises:
        InputError: nobody's size, or nobody upright.
    """
    joints = np.full((len(points), NUM_JOINTS, 3), np.nan)
    for name, number in limbs.items():
        joints[:, Joint[name]] = points[:, number]
    corners = [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP]
    joints[:, Joint.TORSO] = joints[:, corners].mean(axis=1)
    joints[:, Joint.HEAD], joints[:, Joint.NECK] = head, neck
    hips = joints[:, corners[2:]].mean(axis=1)
    trunk = joints[:, corners[:2]].mean(axis=1) - hips
    known = np.isfinite(trunk).all(axis=1)
    if not known.any():
        raise InputError(f"{where}: no frame has both shoulders and both hips")
    length = float(np.median(np.linalg.norm(trunk[known], axis=1)))
    unit_m = next((unit for unit in _UNITS_M if _TRUNK_M[0] < unit * length < _TRUNK_M[1]), None)
    if unit_m is None:
        raise InputError(f"{where}: hips and shoulders are {length:g} apart, which is a person's in no usual unit")
    mean = trunk[known].mean(axis=0)
    if max(mean[1], mean[2]) < 0.5 * length:
        raise InputError(f"{where}: neither y nor z points up along the dancer's trunk")
    joints, hips = joints * unit_m, hips * unit_m
    if mean[2] > mean[1]:  # z up: (x, y, z) -> (x, z, -y)
        joints, hips = (np.stack([p[..., 0], p[..., 2], -p[..., 1]], axis=-1) for p in (joints, hips))
    across = joints[:, Joint.LEFT_HIP] - joints[:, Joint.RIGHT_HIP]
    first = np.flatnonzero(known)[: max(len(known) // 20, 1)]
    side = across[first].mean(axis=0)
    origin = np.array([*hips[first[0], [0]], np.nanmin(joints[..., 1]), *hips[first[0], [2]]])
    # The left hip has to lie to the camera's right: the camera's x along it, y down, z away from it.
    angle = np.arctan2(side[2], side[0])
    cos, sin = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(joints - origin, -1, 0)
    seen = np.stack([cos * x + sin * z, TEACHER_M[1] - y, TEACHER_M[0] - (cos * z - sin * x)], axis=-1)
    return seen.astype(np.float32)


def aist_joints_m(points: np.ndarray, where: str) -> np.ndarray:
    """(T, 15, 3) of (T, 17, 3) keypoints in COCO's order."""
    ears = points[:, _COCO_EARS].mean(axis=1)
    shoulders = points[:, [COCO["RIGHT_SHOULDER"], COCO["LEFT_SHOULDER"]]].mean(axis=1)
    return from_points(points, COCO, ears, shoulders + NECK_SHARE * (ears - shoulders), where)


def imperial_joints_m(points: np.ndarray, where: str) -> np.ndarray:
    """(T, 15, 3) of (T, 21, 3)."""
    head, neck = (points[:, IMPERIAL_POINTS.index(name)] for name in ("Head", "Neck"))
    return from_points(points, IMPERIAL, head, neck, where)


def read_aist(path: Path) -> np.ndarray:
    """(T, 17, 3) keypoints of a JSON or npz file.

    Raises:
        InputError: a pickle, or something else than keypoints.
    """
    if path.suffix.lower() in (".pkl", ".pickle"):
        raise InputError(
            f"{path}: a pickle can run code when it is opened, so it is not; where you trust it, save its keypoints with "
            "numpy.savez first (python -m synth.kpop_convert --help says how)"
        )
    try:
        if path.suffix.lower() == ".json":
            found = json.loads(path.read_text(encoding="utf-8"))
        else:
            with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                found = {name: file[name] for name in file if name.startswith("keypoints3d")}
        points = found["keypoints3d_optim"] if "keypoints3d_optim" in found else found["keypoints3d"]
        points = np.asarray(points, np.float64)
    except (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: no keypoints3d to be read in it ({error}); expected a JSON or npz file") from error
    if points.ndim != 3 or points.shape[1:] != (17, 3) or not len(points):
        raise InputError(f"{path}: its keypoints are {points.shape}; expected (frames, 17, 3) in COCO's order")
    return points


def read_imperial(path: Path) -> np.ndarray:
    """(takes, T, 21, 3) points of one file.

    Raises:
        InputError: not such a file.
    """
    try:
        data = np.lib.format.open_memmap(path, "r")
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a plain numpy array ({error})") from error
    if data.ndim != 4 or data.shape[1] != 3 or data.shape[3] != len(IMPERIAL_POINTS):
        raise InputError(f"{path}: holds {data.shape}; expected (takes, 3, frames, 21)")
    return data.transpose(0, 2, 3, 1)


def write_dance(out: Path, name: str, fps: float, teacher_m: np.ndarray, learners_m: dict[str, np.ndarray]) -> None:
    """One dance of joints at a rate; learners from the best to the worst."""
    write_teacher(out / name, Performance(teacher_m, np.arange(len(teacher_m)) / fps))
    for learner, joints_m in learners_m.items():
        write_learner(out / name, learner, np.arange(len(joints_m)) / fps, joints_m)
    write_labels(out / name, learners_m)
    print(f"{out / name}: teacher and {len(learners_m)} learners, best first: {', '.join(learners_m)}")


def convert_bvh(out: Path, dance: str, teacher: Path, learners: list[Path], fps: float | None) -> None:
    maker = KpopSim(KpopSimSet())
    adult = shape_person(np.zeros(len(load_body().basis), np.float32))
    motions = {path: bvh_motion(path, fps) for path in (teacher, *learners)}
    rates = {motion.fps for motion in motions.values()}
    if len(rates) > 1:
        raise InputError(f"the files are recorded at {', '.join(f'{rate:g}' for rate in rates)} frames a second; give --fps")
    joints_m = {path: maker.before_level_camera_m(adult, motion) for path, motion in motions.items()}
    write_dance(out, dance, rates.pop(), joints_m[teacher], _named({path: joints_m[path] for path in learners}))


def convert_aist(out: Path, dance: str, teacher: Path, learners: list[Path], fps: float | None) -> None:
    joints_m = {path: aist_joints_m(read_aist(path), str(path)) for path in (teacher, *learners)}
    write_dance(out, dance, fps or AIST_FPS, joints_m[teacher], _named({path: joints_m[path] for path in learners}))


def convert_imperial(source: Path, out: Path) -> None:
    """Every choreography of which all three levels are there.

    Raises:
        InputError: there is none.
    """
    found: dict[str, dict[str, Path]] = {}
    for path in sorted(source.glob("*.npy")):
        if match := _IMPERIAL_FILE.fullmatch(path.name):
            level, genre, number = match.groups()
            found.setdefault(f"{genre}_ch{number}", {})[level] = path
    whole = {name: levels for name, levels in found.items() if set(levels) == set("eib")}
    if not whole:
        raise InputError(f"{source}: no choreography with files dance_level_[e|i|b]_GENRE_chN.npy of all three levels")
    for name, levels in whole.items():
        takes = {level: read_imperial(path) for level, path in levels.items()}
        if len(takes["e"]) < 2:
            raise InputError(f"{levels['e']}: one take; two experts are needed, a teacher and a learner")
        chosen = {"expert": ("e", 1), "intermediate": ("i", 0), "beginner": ("b", 0)}
        learners = {
            learner: imperial_joints_m(np.array(takes[level][take]), str(levels[level]))
            for learner, (level, take) in chosen.items()
        }
        write_dance(out, name, IMPERIAL_FPS, imperial_joints_m(np.array(takes["e"][0]), str(levels["e"])), learners)


def _named(by_file: dict[Path, np.ndarray]) -> dict[str, np.ndarray]:
    names = {path.stem: joints_m for path, joints_m in by_file.items()}
    if len(names) < len(by_file) or len(names) < 2:
        raise InputError("--learners: give at least two files of different names, the best dancer's first")
    return names


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = parser.add_subparsers(dest="kind", required=True)
    for kind in ("bvh", "aist"):
        one = kinds.add_parser(kind)
        one.add_argument("out", type=Path, help="folder of the set, may be new")
        one.add_argument("--dance", required=True, help="its name in the set")
        one.add_argument("--teacher", type=Path, required=True)
        one.add_argument("--learners", type=Path, nargs="+", required=True, help="from the best to the worst")
        one.add_argument("--fps", type=float, help="the true frame rate, where the files state none or a wrong one")
    imperial = kinds.add_parser("imperial")
    imperial.add_argument("source", type=Path, help="folder of dance_level_*.npy")
    imperial.add_argument("out", type=Path, help="folder of the set, may be new")
    given = parser.parse_args()
    if given.kind == "imperial":
        convert_imperial(given.source, given.out)
    elif given.kind == "bvh":
        convert_bvh(given.out, given.dance, given.teacher, given.learners, given.fps)
    else:
        convert_aist(given.out, given.dance, given.teacher, given.learners, given.fps)


if __name__ == "__main__":
    main()
