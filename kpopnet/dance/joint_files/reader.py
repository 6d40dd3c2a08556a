"""Reads a recording of joints from a file of any of the known formats."""

from pathlib import Path

from kpopnet.dance.joint_files.arrays import read_npz_performance
from kpopnet.dance.joint_files.bvh_motion import BvhMotion, bvh_points_m, read_bvh_motion
from kpopnet.dance.joint_files.keypoints import read_json_points
from kpopnet.dance.joint_files.named_points import NamedPoints, named_performance
from kpopnet.dance.joint_files.table import read_csv_points
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError

SUFFIXES = (".npz", ".bvh", ".csv", ".json")


def read_performance(path: Path | str, fps: float | None = None) -> Performance:
    """Reads a recording of joints; the ending of the file's name tells the format (docs/dance_scoring.md).

    Joints of .npz files of our own stay in their camera frame. Those of all other files are turned so that the dancer faces a
    level camera on average over the first twentieth of the frames.

    Args:
        path: an .npz, .bvh, .csv or .json file.
        fps: the true frame rate of a file that states none or a wrong one.

    Raises:
        InputError: the file is not of a known format, is damaged, or lacks a joint throughout.
    """
    path = Path(path)
    match path.suffix.lower():
        case ".npz":
            return read_npz_performance(path, fps)
        case ".bvh":
            motion = read_bvh_motion(path, fps)
            return named_performance(bvh_points(motion), str(path), fps)
        case ".csv":
            return named_performance(read_csv_points(path), str(path), fps)
        case ".json":
            return named_performance(read_json_points(path), str(path), fps)
        case ".pkl" | ".pickle":
            raise InputError(
                f"{path}: a pickle can run code when it is opened, so it is not opened; if you trust it, save its arrays with "
                "numpy.savez first (kpopnet convert --help says how)"
            )
        case _:
            raise InputError(f"{path}: expected a file that ends with {', '.join(SUFFIXES)}")


_BVH_POINTS = {
    **{f"{side}{point}": f"{side}{joint}" for side in ("Left", "Right") for point, joint in (
        ("Shoulder", "Arm"), ("Elbow", "ForeArm"), ("Wrist", "Hand"), ("Hip", "UpLeg"), ("Knee", "Leg"), ("Ankle", "Foot"),
        ("Foot", "ToeBase"),
    )},
    "Head": "Head", "Neck": "Neck",
}  # fmt: skip
"""Our names of points to MotionBuilder's names of the joints that lie there. A clavicle, "Shoulder", begins at the neck."""


def bvh_points(motion: BvhMotion) -> NamedPoints:
    """The joints of a recorded skeleton by the names of points, metres, y up."""
    names = [name for name, joint in _BVH_POINTS.items() if joint in motion.found]
    columns = [motion.found[_BVH_POINTS[name]] for name in names]
    points_m = bvh_points_m(motion)[:, columns]
    return NamedPoints(names, points_m, fps=motion.fps)
