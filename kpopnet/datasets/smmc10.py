"""Benchmark `smmc10` (Ganapathi et al., CVPR 2010), read as published.

A file real01_<number>.cal.bin is one sequence: one C struct per frame, and nothing else.

    int32    magic (-1982), frame
    int64    timestamp
    float32  points[25344][3]     organised; metres, x right, y up, z negative in front of the camera
    uint16   dist[25344], amp[25344], conf[25344]     raw values of the SwissRanger; not used here
    int32    nmarkers
    { int32 id, frame; float32 x, y, z, cond; uint32 flag; } markers[64]     visible where cond > 0

The camera was in portrait orientation: point i is at column i // 176 and row i % 176 of an image of 144 x 176. A frame has
458,004 bytes, or 458,008 where the compiler padded it to a multiple of the size of int64.

The true positions are markers on the clothes, not joints in the body: a marker is some centimetres away from its joint, by an
unpublished distance. Reports therefore give the raw error and the error after a constant offset of each joint is subtracted.
Which marker is where is published only in part: configs/benchmark/smmc10.yaml has the map of one public reader for head and
hands (which also has 35 and 37 on the left lower leg, 43 and 41 on the right). The rest is a setting:

    python evaluate.py benchmark=smmc10 benchmark.path=PATH 'benchmark.joints={head: [1, 3], left_hand: 24}'
"""

import re

import numpy as np

from kpopnet.datasets.point_clouds import PointCloudBenchmark

FIELDS = [
    ("magic", "<i4"),
    ("frame", "<i4"),
    ("timestamp", "<i8"),
    ("points", "<f4", (144, 176, 3)),
    ("dist", "<u2", 25344),
    ("amp", "<u2", 25344),
    ("conf", "<u2", 25344),
    ("nmarkers", "<i4"),
    ("markers", [("id", "<i4"), ("frame", "<i4"), ("pos", "<f4", 3), ("cond", "<f4"), ("flag", "<u4")], 64),
]
PACKED = np.dtype(FIELDS)
PADDED = np.dtype(FIELDS, align=True)


class Smmc10Benchmark(PointCloudBenchmark):
    """Reads the published SMMC-10."""

    name = "smmc10"
    truth = "motion-capture markers"
    about = (
        "Real SwissRanger depth. The true positions are markers on the surface of the body, not joints inside it. Read the "
        "error after subtracting the constant offset of each joint beside the raw error. Joints without a known marker are "
        "not evaluated. The paper evaluates on this set."
    )
    set_name, first_file, suffix, fps = "SMMC-10", "real01_1.cal.bin", ".cal.bin", 25.0
    name_pattern = re.compile(r"real\d+_(?P<number>\d+)")  # who is recorded is not published
    layouts, magic, lists = (PACKED, PADDED), -1982, ("markers",)

    @staticmethod
    def points_m(frame: np.ndarray) -> np.ndarray:
        return frame["points"].swapaxes(0, 1)

    @staticmethod
    def is_visible(markers: np.ndarray) -> np.ndarray:
        return markers["cond"] > 0
