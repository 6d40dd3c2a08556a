"""Trains a network that estimates 3D joints from depth.

    python -m synth preset=small                                  # first, something to train on: data/small
    python train.py                                               # dense network, depth
    python train.py model=holistic model.input=depth_ridge        # the paper's kind, with the ridge channel
    python train.py training=demo data.train=data/demo/train data.validation=data/demo/validation
    python train.py training=dance training.start=outputs/train/RUN/best    # its weights, trained on for dances (preset=dance)
    python train.py training.resume=outputs/train/RUN/last        # goes on as if never stopped
    torchrun --nproc-per-node=4 train.py training.batch_size=128  # several GPUs, or CPU processes
    python train.py --cfg job                                     # every setting and its value

Leaves `best` and `last`, a log and TensorBoard's files in outputs/train/<model>-<date-time>, or hydra.run.dir=PATH.
"""

from dataclasses import asdict, dataclass, field
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import OmegaConf

from kpopnet.checkpoint import read_meta, run_folder
from kpopnet.entry import entry_point, resumed_config
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.ridge import RidgeConfig
from kpopnet.shards import ShardedSet
from kpopnet.training import TrainingConfig, train
from synth.observe import ExtractionConfig, Observer
from synth.sensor import SensorConfig

OmegaConf.register_new_resolver("run_folder", run_folder)
OmegaConf.register_new_resolver("run_subdir", lambda resume: ".hydra" if resume is None else ".hydra_resumed")


@dataclass
class DataConfig:
    train: str = "data/small/train"
    validation: str = "data/small/validation"


@dataclass
class Config:
    """Everything about a training.

    Attributes:
        model, training: what is trained and how.
        sensor, extraction: noise and imperfect silhouettes, made of clean shards.
        ridge: of the ridge image, for model.input=depth_ridge.
        device: auto, cpu or cuda.
        workers: processes that prepare batches.
        threads: of torch on the CPU; 0 takes all cores.
    """

    model: ModelConfig = field(default_factory=ModelConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)
    data: DataConfig = field(default_factory=DataConfig)
    seed: int = 0
    device: str = "auto"
    workers: int = 1
    threads: int = 0

    def __post_init__(self) -> None:
        for name in ("seed", "workers", "threads"):
            if getattr(self, name) < 0:
                raise InputError(f"{name}={getattr(self, name)} must be 0 or more")


@entry_point(Config, "train")
def main(config: Config) -> None:
    """Reads the shards, and trains or goes on training."""
    if config.training.resume is not None:
        saved = read_meta(config.training.resume)["config"]
        config = resumed_config(config, saved, may_change=("training.resume", "data.", "device", "workers", "threads"))
    ridge = config.ridge if config.model.input == "depth_ridge" else None

    def observed(shards: ShardedSet) -> Observer:
        return Observer(shards, config.sensor, config.extraction, ridge, config.seed)

    sets = {"train": ShardedSet(config.data.train), "validation": ShardedSet(config.data.validation)}
    train(
        config.training,
        config.model,
        observed(sets["train"]),
        observed(sets["validation"]),
        out=Path(HydraConfig.get().runtime.output_dir),
        seed=config.seed,
        device=config.device,
        workers=config.workers,
        threads=config.threads,
        described=asdict(config),
        data={name: {"hash": shards.header.config_hash, "samples": len(shards)} for name, shards in sets.items()},
    )


if __name__ == "__main__":
    main()
