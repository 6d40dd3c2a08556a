"""Reads .npz files of joints: our own, COCO keypoints as of AIST++, or named points."""

from pathlib import Path

import numpy as np

from kpopnet.dance.joint_files.joint_sets import trunks, unit_m
from kpopnet.dance.joint_files.named_points import (
    COCO_NAMES,
    NamedPoints,
    checked_performance,
    frame_times_s,
    named_performance,
)
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, check_array, expect, read_npz
from kpopnet.skeleton import NUM_JOINTS

NPZ_SCHEMA = {
    "joints_m": ArraySchema("fiu", ("frames", NUM_JOINTS, 3), False),
    "keypoints3d_optim": ArraySchema("fiu", ("frames", len(COCO_NAMES), 3), False),
    "keypoints3d": ArraySchema("fiu", ("frames", len(COCO_NAMES), 3), False),
    "points": ArraySchema("fiu", ("frames", "points", 3), False),
    "names": ArraySchema("U", ("points",), False),
    "times_s": ArraySchema("fiu", ("frames",), False),
    "confidence": ArraySchema("fiu", ("frames", None), False),
    "fps": ArraySchema("fiu", (), False),
}
"""joints_m in metres in the camera frame, or keypoints3d in COCO's order, or points and their names; then times_s or fps, and
the confidence of each joint or point."""


def read_npz_performance(path: Path, fps: float | None = None) -> Performance:
    """Reads an .npz file of joints; `fps` is the true frame rate of a file that states none or a wrong one.

    Raises:
        InputError: the file is not as NPZ_SCHEMA says.
    """
    found, source = read_npz(path, NPZ_SCHEMA), str(path)
    times_s, stated = found.get("times_s"), found.get("fps")
    stated_fps = None if stated is None else float(stated)
    confidence = found.get("confidence")
    if "joints_m" in found:
        joints_m = found["joints_m"].astype(np.float64)
        trunk = trunks(joints_m)
        whole = np.isfinite(trunk).all(axis=1)
        if whole.any() and (unit := unit_m(trunk[whole], source)) != 1:
            raise InputError(f"{source}: joints_m is in units of {unit:g} m; expected metres")
        times_s = frame_times_s(len(joints_m), times_s, stated_fps, fps, source)
        return checked_performance(joints_m, times_s, confidence, source)
    points = next((found[name] for name in ("keypoints3d_optim", "keypoints3d", "points") if name in found), None)
    if points is None:
        raise InputError(f"{source}: expected an array joints_m, keypoints3d, or points with names")
    keypoints = "keypoints3d" in found or "keypoints3d_optim" in found
    expect(keypoints or "names" in found, source, "an array names, of its points")
    names = COCO_NAMES if keypoints else [str(name) for name in found["names"]]
    if confidence is not None:
        check_array(f"{source}: confidence", confidence.shape, confidence.dtype, ArraySchema("fiu", points.shape[:2]))
    return named_performance(NamedPoints(names, points.astype(np.float64), times_s, confidence, stated_fps), source, fps)
