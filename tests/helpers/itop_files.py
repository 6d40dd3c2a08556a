"""Writes ITOP files in the published layout."""

from pathlib import Path

import h5py
import numpy as np


def write_itop(
    folder: Path,
    ids: list[str],
    depth_m: np.ndarray,
    joints_m: np.ndarray,
    valid: np.ndarray | None = None,
    visible: np.ndarray | None = None,
    part: str = "side_test",
) -> None:
    """Writes the files of one view and split.

    Args:
        folder: output folder; created if necessary.
        ids: (N,) ids of the frames, "PP_FFFFF".
        depth_m: (N, 240, 320) metres.
        joints_m: (N, 15, 3) metres in ITOP's axes: x right, y up, z forward.
        valid: (N,) whether the labels were checked; all by default.
        visible: (N, 15) whether the joints are visible; all by default.
        part: view and split.
    """
    folder.mkdir(parents=True, exist_ok=True)
    frames = len(ids)
    names = np.array([name.encode() for name in ids], dtype="S8")
    with h5py.File(folder / f"ITOP_{part}_depth_map.h5", "w") as file:
        file["id"] = names
        file.create_dataset("data", data=depth_m.astype(np.float16), chunks=(1, 240, 320), compression="gzip")
    with h5py.File(folder / f"ITOP_{part}_labels.h5", "w") as file:
        file["id"] = names
        file["is_valid"] = (np.ones(frames) if valid is None else valid).astype(np.uint8)
        file["visible_joints"] = (np.ones((frames, 15)) if visible is None else visible).astype(np.int16)
        file["image_coordinates"] = np.zeros((frames, 15, 2), np.int16)
        file["real_world_coordinates"] = joints_m.astype(np.float16)
        file["segmentation"] = np.full((frames, 240, 320), -1, np.int8)
