"""Trains the random tree walk, a peer to judge the tracker and the networks beside (kpopnet.tree_walk).

    python -m synth preset=small                                  # first, something to train on: data/small
    python train_tree_walk.py                                     # some minutes on one core
    python train_tree_walk.py data.train=data/demo/train data.validation=data/demo/validation out=outputs/demo_walk
    python train_tree_walk.py tree_walk.images=20000 tree_walk.growth.leaf_samples=100 seed=3
    python train_tree_walk.py --cfg job                           # every setting and its value

Leaves a model in outputs/tree_walk/<date-time>, or out=PATH. To judge it:

    python evaluate.py 'estimator=[tree_walk]' estimator.tree_walk.path=PATH
"""

import logging
from dataclasses import asdict, dataclass, field
from pathlib import Path

from kpopnet.entry import entry_point
from kpopnet.errors import InputError
from kpopnet.shards import ShardedSet
from kpopnet.tree_walk.training import TreeWalkConfig, train
from synth.observe import ExtractionConfig, Observer
from synth.sensor import SensorConfig

log = logging.getLogger(__name__)


@dataclass
class DataConfig:
    """Folders of shards."""

    train: str = "data/small/train"
    validation: str = "data/small/validation"


@dataclass
class Config:
    """Everything about a training.

    Attributes:
        out: the model's folder.
        tree_walk: what is trained and how.
        sensor, extraction: noise and imperfect silhouettes, made of clean shards.
        workers: processes that prepare images.
    """

    out: str
    tree_walk: TreeWalkConfig = field(default_factory=TreeWalkConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    data: DataConfig = field(default_factory=DataConfig)
    seed: int = 0
    workers: int = 1

    def __post_init__(self) -> None:
        for name in ("seed", "workers"):
            if getattr(self, name) < 0:
                raise InputError(f"{name}={getattr(self, name)} must be 0 or more")


@entry_point(Config, "train_tree_walk")
def main(config: Config) -> None:
    """Reads the shards, trains, and writes the model."""
    sets = {"train": ShardedSet(config.data.train), "validation": ShardedSet(config.data.validation)}
    source, validation = (Observer(shards, config.sensor, config.extraction, None, config.seed) for shards in sets.values())
    model, metrics = train(config.tree_walk, source, validation, config.seed, config.workers)
    data = {name: {"hash": shards.header.config_hash, "samples": len(shards)} for name, shards in sets.items()}
    model.save(Path(config.out), {"config": asdict(config), "data": data, "metrics": metrics})
    log.info(
        f"{config.out}: mean error {metrics['mean_error_cm']:.2f} cm, {100 * metrics['within_10cm']:.1f} % within 10 cm "
        "on validation people"
    )


if __name__ == "__main__":
    main()
