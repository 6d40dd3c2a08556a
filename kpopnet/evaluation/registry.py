"""The registry: every benchmark and estimator by name, with the dataclass of its settings and its builder.

A new one is an entry here and a file in configs/, whose `schema/NAME` stands for the dataclass. Benchmarks of dances and of
several people, which are not evaluated by the joints of one person, also have an entry in kpopnet/programs/evaluate.py.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from kpopnet.baselines.mean_pose import MeanPoseEstimator
from kpopnet.baselines.tree_walk.walking import TreeWalkEstimator, TreeWalkEstimatorConfig
from kpopnet.datasets.dances.dance_set import KpopConfig, KpopSet, open_set
from kpopnet.datasets.itop import ItopBenchmark, ItopConfig
from kpopnet.datasets.point_clouds import EvalBenchmark, PointCloudConfig, Smmc10Benchmark
from kpopnet.datasets.protocol import Benchmark, BenchmarkConfig
from kpopnet.datasets.simulated import PeopleSet, SimulatedBenchmark
from kpopnet.datasets.synthetic import SyntheticBenchmark
from kpopnet.datasets.utd_mhad import UtdMhadBenchmark, UtdMhadConfig
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.networks.backend import read_description
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.paper_tracker.tracker import PaperTrackerConfig, PaperTrackerEstimator
from kpopnet.pose.person import PersonEstimator
from kpopnet.tracker.estimator import TrackerEstimator, TrackerEstimatorConfig
from kpopnet.tracker.refine import FittedEstimator


@dataclass
class NetworkEstimatorConfig:
    """A trained network.

    Attributes:
        checkpoint: folder of a checkpoint, such as outputs/train/RUN/best, or a file of `kpopnet export`; None for the network
            that comes with the package.
        device: cpu or cuda.
    """

    checkpoint: str | None = None
    device: str = "cpu"


@dataclass
class FittedNetworkConfig(NetworkEstimatorConfig):
    """A trained network whose joints are refined by fitting the body model to the depth."""


@dataclass
class RealtimeConfig(NetworkEstimatorConfig):
    """A trained network's joints and those fitted to the depth, weighed over the frames so far (kpopnet.pose): as they come."""


@dataclass
class BestConfig(RealtimeConfig):
    """The same, with two passes over each frame and with the frames that follow (kpopnet.pose): joints of whole recordings."""


@dataclass
class MeanPoseConfig:
    """The constant baseline.

    Attributes:
        checkpoint: a network, as for `network`, whose description holds the mean pose of its training set.
    """

    checkpoint: str | None = None


def _network(config: NetworkEstimatorConfig) -> NetworkEstimator:
    return NetworkEstimator(config.checkpoint, device=config.device)


def _tracker(config: TrackerEstimatorConfig) -> Estimator:
    return TrackerEstimator(config, None if config.network is None else NetworkEstimator(config.network))


def _mean_pose(config: MeanPoseConfig) -> Estimator:
    if (known := _known_mean_pose(config.checkpoint)) is None:
        raise InputError(f"{config.checkpoint}: its description holds no mean_pose_m, which estimator=mean_pose needs")
    return known


def _known_mean_pose(checkpoint: str | None) -> MeanPoseEstimator | None:
    pose_m = read_description(checkpoint).get("mean_pose_m")
    return None if pose_m is None else MeanPoseEstimator(pose_m)


BENCHMARKS: dict[str, tuple[type, Callable[[Any], Benchmark | KpopSet | PeopleSet]]] = {
    "synthetic": (BenchmarkConfig, SyntheticBenchmark),
    "utd_mhad": (UtdMhadConfig, UtdMhadBenchmark),
    "eval": (PointCloudConfig, EvalBenchmark),
    "eval_sim": (BenchmarkConfig, SimulatedBenchmark),
    "smmc10": (PointCloudConfig, Smmc10Benchmark),
    "smmc10_sim": (BenchmarkConfig, SimulatedBenchmark),
    "itop": (ItopConfig, ItopBenchmark),
    "two_people": (BenchmarkConfig, PeopleSet),
    "rooms": (BenchmarkConfig, PeopleSet),
    "kpop": (KpopConfig, open_set),
    "kpop_sim": (KpopConfig, open_set),
}
"""Settings and reader of each benchmark."""

ESTIMATORS: dict[str, tuple[type, Callable[[Any], Estimator]]] = {
    "tracker": (TrackerEstimatorConfig, _tracker),
    "paper_tracker": (PaperTrackerConfig, PaperTrackerEstimator),
    "network": (NetworkEstimatorConfig, _network),
    "fitted_network": (FittedNetworkConfig, lambda config: FittedEstimator(_network(config))),
    "realtime": (RealtimeConfig, lambda config: PersonEstimator(_network(config), "realtime")),
    "best": (BestConfig, lambda config: PersonEstimator(_network(config), "best")),
    "tree_walk": (TreeWalkEstimatorConfig, TreeWalkEstimator),
    "mean_pose": (MeanPoseConfig, _mean_pose),
}
"""Settings and builder of each kind of estimator. Each kind has a dataclass of its own, by which its builder is found."""


def build_benchmark(config: Any) -> Benchmark:
    _, reader = BENCHMARKS[config.name]
    return reader(config)


def build_estimators(configs: dict[str, Any]) -> dict[str, Estimator]:
    """Builds the configured estimators, by name; the class of the settings determines the kind.

    Where a checkpoint holds a mean pose, that baseline is added as the last estimator, for comparison with the network. Raises
    InputError if no estimator is configured, or a file that one needs is missing.
    """
    if not configs:
        raise InputError("estimator: expected at least one, for instance estimator=network checkpoint=...")
    for name, config in configs.items():
        if getattr(config, "checkpoint", None) == "":
            raise InputError(f"estimator {name} needs a trained network: estimator.{name}.checkpoint=outputs/train/RUN/best")
    builders = dict(ESTIMATORS.values())
    built = {name: builders[type(config)](config) for name, config in configs.items()}
    checkpoints = [config.checkpoint for config in configs.values() if hasattr(config, "checkpoint")]
    if checkpoints and not any(isinstance(one, MeanPoseEstimator) for one in built.values()):
        known = _known_mean_pose(checkpoints[0])
        built |= {} if known is None else {known.name: known}
    return built
