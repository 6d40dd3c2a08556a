"""Benchmark `eval` (Ganapathi et al., ECCV 2012), read as published.

A file seq_<subject>_<number>.bin is one sequence: one C struct of 930,704 bytes per frame, and nothing else.

    int32    magic, frame
    float32  points[240][320][3]     organised; metres, x right, y up, z negative in front of the camera; z = 0: not measured
    int32    nmarkers
    { char name[255]; float32 x, y, z; } markers[32]      one byte of padding after the name; z = 0: absent; not used here
    int32    njoints
    { int32 id; float32 x, y, z; } joints[32]             z = 0: absent

Which id is which joint is not published:

    python evaluate.py benchmark=eval benchmark.path=PATH 'benchmark.joints={head: 1, neck: 2, right_hand: [7, 8]}'
"""

import re

import numpy as np

from kpopnet.datasets.point_clouds import PointCloudBenchmark

FRAME = np.dtype(
    [
        ("magic", "<i4"),
        ("frame", "<i4"),
        ("points", "<f4", (240, 320, 3)),
        ("nmarkers", "<i4"),
        ("markers", [("name", "S256"), ("pos", "<f4", 3)], 32),
        ("njoints", "<i4"),
        ("joints", [("id", "<i4"), ("pos", "<f4", 3)], 32),
    ]
)


class EvalBenchmark(PointCloudBenchmark):
    """Reads the published EVAL."""

    name = "eval"
    truth = "motion capture"
    about = (
        "Real Kinect depth of whole scenes. The joints come from marker-based motion capture; the authors of the set defined "
        "their positions in the body. The paper evaluates on this set."
    )
    set_name, first_file, suffix, fps = "EVAL", "seq_a_0.bin", ".bin", 30.0
    name_pattern = re.compile(r"seq_(?P<subject>[a-z]+)_(?P<number>\d+)")
    layouts, lists = (FRAME,), ("markers", "joints")

    @staticmethod
    def points_m(frame: np.ndarray) -> np.ndarray:
        return frame["points"]

    @staticmethod
    def is_visible(joints: np.ndarray) -> np.ndarray:
        return joints["pos"][:, 2] != 0
