"""Benchmarks `smmc10` (Ganapathi et al., CVPR 2010) and `smmc10_sim`, its simulated stand-in: one reader for both.

The set's truth is markers on the clothes, not joints in the body. Which marker is where is published only in part; what one
public reader takes for the head and the hands is the default, and the rest of the map is a setting,

    python evaluate.py benchmark=smmc10 benchmark.path=PATH 'benchmark.joints={head: [1, 3], left_hand: 24}'

by the names of `kpopnet.skeleton`; of several markers the mean is taken, and joints that are not named are not judged. A
marker lies some centimetres from its joint, and no source says how far: reports give the raw error and the error after a
constant offset of each joint is taken out (`kpopnet.benchmarks.metrics.without_offsets`). The stand-in's map is in its
manifest, and its truth is markers just the same.
"""

import re
from dataclasses import dataclass, field
from typing import Any

from kpopnet.benchmarks.point_files import (
    PointFiles,
    PublishedBenchmark,
    PublishedConfig,
    SimulatedBenchmark,
    SimulatedConfig,
)
from kpopnet.benchmarks.smmc10_format import FPS, describe, read_sequence
from kpopnet.skeleton import JOINT_NAMES

SMMC10 = PointFiles(
    published="SMMC-10",
    called="real01_<number>.cal.bin",
    first="real01_1.cal.bin",
    pattern=re.compile(r"(real\d+|(?P<who>sim\d+))_(?P<number>\d+)"),  # nobody has published who is in which real one
    suffix=".cal.bin",
    fps=FPS,
    read=read_sequence,
    describe=describe,
)

KNOWN_MARKERS = {"head": [1, 3], "right_hand": 16, "left_hand": 24}
"""What one public reader takes; it also has 35 and 37 on the left lower leg, 43 and 41 on the right."""


@dataclass
class Smmc10Config(PublishedConfig):
    name: str = "smmc10"
    joints: dict[str, Any] = field(default_factory=lambda: dict.fromkeys(JOINT_NAMES) | KNOWN_MARKERS)


@dataclass
class Smmc10SimConfig(SimulatedConfig):
    name: str = "smmc10_sim"
    path: str = "data/smmc10_sim"


class Smmc10Benchmark(PublishedBenchmark):
    files = SMMC10
    name = "smmc10"
    truth = "motion-capture markers"
    about = (
        "Real SwissRanger depth. The truth is markers on the body's surface, not joints inside it: read the error after "
        "taking out each joint's constant offset beside the raw one. Joints without a known marker are not judged. The "
        "paper's set."
    )


class Smmc10SimBenchmark(SimulatedBenchmark):
    files = SMMC10
    name = "smmc10_sim"
    truth = "simulated markers"
    ids_key = "joint_markers"
    whole, size = 28, "3 GB"
    about_truth = (
        "The truth is markers on the skin, as there: read the error after taking out each joint's constant offset beside the "
        "raw one. "
    )
