"""Benchmarks `eval` (Ganapathi et al., ECCV 2012) and `eval_sim`, its simulated stand-in, with one reader for both.

The map from the joint ids in the files to joints is not published. For the real set it is therefore a setting,

    python evaluate.py benchmark=eval benchmark.path=PATH 'benchmark.joints={head: 1, neck: 2, right_hand: [7, 8]}'

with the names of `kpopnet.skeleton`. The mean of several ids is used, and joints that are not in the map are not evaluated.
Without a map, the error message lists the contents of frame 0. The map of the stand-in is in its manifest.
"""

import re
from dataclasses import dataclass

from kpopnet.datasets.eval.format import FPS, describe_ids, read_sequence
from kpopnet.datasets.point_clouds.benchmark import (
    PointFiles,
    PublishedBenchmark,
    PublishedConfig,
    SimulatedBenchmark,
    SimulatedConfig,
)

EVAL = PointFiles(
    set_name="EVAL",
    file_pattern="seq_<subject>_<number>.bin",
    first_file="seq_a_0.bin",
    name_pattern=re.compile(r"seq_(?P<subject>[a-z]+)_(?P<number>\d+)"),
    suffix=".bin",
    fps=FPS,
    read=read_sequence,
    describe_ids=describe_ids,
)


@dataclass
class EvalConfig(PublishedConfig):
    """Settings of the benchmark `eval`; see PublishedConfig."""

    name: str = "eval"


@dataclass
class EvalSimConfig(SimulatedConfig):
    """Settings of the benchmark `eval_sim`; see SimulatedConfig."""

    name: str = "eval_sim"
    path: str = "data/eval_sim"


class EvalBenchmark(PublishedBenchmark):
    """Reads the published EVAL."""

    files = EVAL
    name = "eval"
    truth = "motion capture"
    about = (
        "Real Kinect depth of whole scenes. The joints come from marker-based motion capture; the authors of the set defined "
        "their positions in the body. The paper evaluates on this set."
    )


class EvalSimBenchmark(SimulatedBenchmark):
    """Reads simulated EVAL."""

    files = EVAL
    name = "eval_sim"
    truth = "synthetic truth"
    ids_key = "joint_ids"
    full_set_sequences, disk_size = 24, "8 GB"
