"""Benchmarks `smmc10` (Ganapathi et al., CVPR 2010) and `smmc10_sim`, its simulated stand-in, with one reader for both.

The true positions of the set are markers on the clothes, not joints in the body. The placement of the markers is published
only in part. The markers that one public reader uses for the head and the hands are the default; the rest is a setting,

    python evaluate.py benchmark=smmc10 benchmark.path=PATH 'benchmark.joints={head: [1, 3], left_hand: 24}'

with the names of `kpopnet.skeleton`. The mean of several markers is used, and joints that are not in the map are not
evaluated. A marker is some centimetres away from its joint, by an unpublished distance. Reports therefore give the raw error
and the error after a constant offset of each joint is subtracted (`kpopnet.evaluation.poses.metrics.without_offsets`). The
stand-in has markers too, and its map is in its manifest.
"""

import re
from dataclasses import dataclass, field
from typing import Any

from kpopnet.datasets.point_clouds.benchmark import (
    PointFiles,
    PublishedBenchmark,
    PublishedConfig,
    SimulatedBenchmark,
    SimulatedConfig,
)
from kpopnet.datasets.smmc10.format import FPS, describe_ids, read_sequence
from kpopnet.skeleton import JOINT_NAMES

SMMC10 = PointFiles(
    set_name="SMMC-10",
    file_pattern="real01_<number>.cal.bin",
    first_file="real01_1.cal.bin",
    name_pattern=re.compile(
        r"(real\d+|(?P<subject>sim\d+))_(?P<number>\d+)"
    ),  # the subjects of the real sequences are not published
    suffix=".cal.bin",
    fps=FPS,
    read=read_sequence,
    describe_ids=describe_ids,
)

KNOWN_MARKERS = {"head": [1, 3], "right_hand": 16, "left_hand": 24}
"""Marker ids of one public reader. It also has 35 and 37 on the left lower leg, 43 and 41 on the right."""


@dataclass
class Smmc10Config(PublishedConfig):
    """Settings of the benchmark `smmc10`; see PublishedConfig."""

    name: str = "smmc10"
    joints: dict[str, Any] = field(default_factory=lambda: dict.fromkeys(JOINT_NAMES) | KNOWN_MARKERS)


@dataclass
class Smmc10SimConfig(SimulatedConfig):
    """Settings of the benchmark `smmc10_sim`; see SimulatedConfig."""

    name: str = "smmc10_sim"
    path: str = "data/smmc10_sim"


class Smmc10Benchmark(PublishedBenchmark):
    """Reads the published SMMC-10."""

    files = SMMC10
    name = "smmc10"
    truth = "motion-capture markers"
    about = (
        "Real SwissRanger depth. The true positions are markers on the surface of the body, not joints inside it. Read the "
        "error after subtracting the constant offset of each joint beside the raw error. Joints without a known marker are "
        "not evaluated. The paper evaluates on this set."
    )


class Smmc10SimBenchmark(SimulatedBenchmark):
    """Reads simulated SMMC-10."""

    files = SMMC10
    name = "smmc10_sim"
    truth = "simulated markers"
    ids_key = "joint_markers"
    full_set_sequences, disk_size = 28, "3 GB"
    about_truth = (
        "The true positions are markers on the skin, as in the real set. Read the error after subtracting the constant offset "
        "of each joint beside the raw error. "
    )
