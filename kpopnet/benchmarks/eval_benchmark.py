"""Benchmarks `eval` (Ganapathi et al., ECCV 2012) and `eval_sim`, its simulated stand-in: one reader for both.

Which of a file's joint ids is which joint nobody has published. For the real set the map is therefore a setting,

    python evaluate.py benchmark=eval benchmark.path=PATH 'benchmark.joints={head: 1, neck: 2, right_hand: [7, 8]}'

by the names of `kpopnet.skeleton`; of several ids the mean is taken, and joints that are not named are not judged. Without
a map the error says what frame 0 holds. The stand-in's ids are in its manifest.
"""

import re
from dataclasses import dataclass

from kpopnet.benchmarks.eval_format import FPS, describe, read_sequence
from kpopnet.benchmarks.point_files import (
    PointFiles,
    PublishedBenchmark,
    PublishedConfig,
    SimulatedBenchmark,
    SimulatedConfig,
)

EVAL = PointFiles(
    published="EVAL",
    called="seq_<subject>_<number>.bin",
    first="seq_a_0.bin",
    pattern=re.compile(r"seq_(?P<who>[a-z]+)_(?P<number>\d+)"),
    suffix=".bin",
    fps=FPS,
    read=read_sequence,
    describe=describe,
)


@dataclass
class EvalConfig(PublishedConfig):
    name: str = "eval"


@dataclass
class EvalSimConfig(SimulatedConfig):
    name: str = "eval_sim"
    path: str = "data/eval_sim"


class EvalBenchmark(PublishedBenchmark):
    files = EVAL
    name = "eval"
    truth = "motion capture"
    about = (
        "Real Kinect depth of whole scenes; joints from marker-based motion capture, where the data set's authors put them "
        "in the body. The paper's set."
    )


class EvalSimBenchmark(SimulatedBenchmark):
    files = EVAL
    name = "eval_sim"
    truth = "synthetic truth"
    ids_key = "joint_ids"
    whole, size = 24, "8 GB"
