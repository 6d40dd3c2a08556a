"""Every benchmark and estimator by its name, with its settings and what makes it of them.

A new one is a line here and a file in configs/: `schema/NAME` there is the settings named here. A benchmark that is not judged
by joints, as dances are not, also says in evaluate.py by what it is.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from kpopnet.benchmarks.eval_benchmark import EvalBenchmark, EvalConfig, EvalSimBenchmark, EvalSimConfig
from kpopnet.benchmarks.itop import ItopBenchmark, ItopConfig
from kpopnet.benchmarks.kpop import KpopConfig, KpopSet, KpopSimConfig, open_set
from kpopnet.benchmarks.sequences import Benchmark
from kpopnet.benchmarks.smmc10_benchmark import Smmc10Benchmark, Smmc10Config, Smmc10SimBenchmark, Smmc10SimConfig
from kpopnet.benchmarks.synthetic import SyntheticBenchmark, SyntheticConfig
from kpopnet.benchmarks.utd_mhad import UtdMhadBenchmark, UtdMhadConfig
from kpopnet.checkpoint import read_meta
from kpopnet.errors import InputError
from kpopnet.estimators import Estimator
from kpopnet.mean_pose import MeanPoseEstimator
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.estimator import TrackerEstimator, TrackerEstimatorConfig
from kpopnet.tracker.fitted import FittedEstimator
from kpopnet.tree_walk.estimator import TreeWalkEstimator, TreeWalkEstimatorConfig


@dataclass
class NetworkEstimatorConfig:
    """A trained network. Attributes: checkpoint: its folder. device: cpu or cuda."""

    checkpoint: str | None = None
    device: str = "cpu"


@dataclass
class FittedNetworkConfig(NetworkEstimatorConfig):
    """A trained network, whose joints are fitted to the depth."""


@dataclass
class MeanPoseConfig:
    """The constant baseline. Attributes: checkpoint: folder of a network whose training set's mean pose to use."""

    checkpoint: str | None = None


def _network(config: NetworkEstimatorConfig) -> Estimator:
    return NetworkEstimator(config.checkpoint, device=config.device)


def _fitted_network(config: FittedNetworkConfig) -> Estimator:
    return FittedEstimator(NetworkEstimator(config.checkpoint, device=config.device))


def _mean_pose(config: MeanPoseConfig) -> Estimator:
    pose = _known_mean_pose_m(config.checkpoint)
    if pose is None:
        raise InputError(f"{config.checkpoint}: its meta.json holds no mean_pose_m, which estimator=mean_pose needs")
    return MeanPoseEstimator(pose)


BENCHMARKS: dict[str, tuple[type, Callable[[Any], Benchmark | KpopSet]]] = {
    "synthetic": (SyntheticConfig, SyntheticBenchmark),
    "utd_mhad": (UtdMhadConfig, UtdMhadBenchmark),
    "eval": (EvalConfig, EvalBenchmark),
    "eval_sim": (EvalSimConfig, EvalSimBenchmark),
    "smmc10": (Smmc10Config, Smmc10Benchmark),
    "smmc10_sim": (Smmc10SimConfig, Smmc10SimBenchmark),
    "itop": (ItopConfig, ItopBenchmark),
    "kpop": (KpopConfig, open_set),
    "kpop_sim": (KpopSimConfig, open_set),
}
"""Settings and reader of each benchmark."""

ESTIMATORS: dict[str, tuple[type, Callable[[Any], Estimator]]] = {
    "tracker": (TrackerEstimatorConfig, TrackerEstimator),
    "network": (NetworkEstimatorConfig, _network),
    "fitted_network": (FittedNetworkConfig, _fitted_network),
    "tree_walk": (TreeWalkEstimatorConfig, TreeWalkEstimator),
    "mean_pose": (MeanPoseConfig, _mean_pose),
}
"""Settings and builder of each kind of estimator. Settings of one kind belong to no other: they tell what to build."""


def build_benchmark(config: Any) -> Benchmark:
    _, reader = BENCHMARKS[config.name]
    return reader(config)


def build_estimators(configs: dict[str, Any]) -> dict[str, Estimator]:
    """The configured estimators by name; of what kind each is, its settings say.

    The mean pose joins them, last, wherever a checkpoint knows one: without it nobody can tell what a network's figures
    are worth.

    Raises:
        InputError: there are none, or one lacks what it is made of.
    """
    if not configs:
        raise InputError("estimator: expected at least one, for instance estimator=network checkpoint=...")
    for name, config in configs.items():
        if getattr(config, "checkpoint", "") is None:
            raise InputError(f"estimator {name} needs a trained network: estimator.{name}.checkpoint=outputs/train/RUN/best")
    builders = dict(ESTIMATORS.values())
    built = {name: builders[type(config)](config) for name, config in configs.items()}
    checkpoints = [config.checkpoint for config in configs.values() if getattr(config, "checkpoint", None)]
    if checkpoints and not any(isinstance(one, MeanPoseEstimator) for one in built.values()):
        pose = _known_mean_pose_m(checkpoints[0])
        if pose is not None:
            built["mean_pose"] = MeanPoseEstimator(pose)
    return built


def _known_mean_pose_m(checkpoint: str) -> np.ndarray | None:
    pose = read_meta(checkpoint).get("mean_pose_m")
    return None if pose is None else np.array(pose, np.float32).reshape(NUM_JOINTS, 3)
