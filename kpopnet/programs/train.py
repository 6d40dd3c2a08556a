"""Trains a network that estimates 3D joints from depth, or the random tree walk as a baseline.

    python -m synth preset=small                                  # first, training data: data/small
    python train.py                                               # dense network, depth
    python train.py model=holistic model.input=depth_ridge training.lr=0.00125   # the paper's class of network
    python train.py training=demo data.train=data/demo/train data.validation=data/demo/validation
    python train.py training=dance training.start=outputs/train/RUN/best    # fine-tunes a network on dances (preset=dance)
    python train.py training.start=outputs/train/RUN/best model.crop_px=96  # goes on with larger crops (dense networks)
    python train.py training.resume=outputs/train/RUN/last        # resumes a run that was stopped
    torchrun --nproc-per-node=4 train.py training.batch_size=128  # several GPUs, or CPU processes
    python train.py --cfg job                                     # every setting, its value and its meaning

Writes `best` and `last`, a log and TensorBoard's files to outputs/train/<model>-<date-time>, or hydra.run.dir=PATH.

    python train.py --config-name tree_walk                       # the random tree walk; minutes on one core
    python train.py --config-name tree_walk tree_walk.images=20000 out=outputs/tree_walk/mine

Writes a model to outputs/tree_walk/<date-time>, or out=PATH.

    python -m synth benchmark=room_images benchmark.shards=100 out=data/room_images/train
    python -m synth benchmark=room_images benchmark.shards=4 benchmark.split=validation out=data/room_images/validation
    python train.py --config-name finder                          # the finder of people; an hour on one core
    python train.py --config-name finder out=outputs/finder/RUN training.resume=true

Writes the finder's weights to outputs/finder/<date-time>, or out=PATH. Installed from a wheel, the program is `kpopnet train`.
"""

import logging
import os
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from kpopnet.baselines.tree_walk.training import TreeWalkConfig
from kpopnet.baselines.tree_walk.training import train as train_tree_walk
from kpopnet.baselines.tree_walk.walking import META
from kpopnet.data.made_sets import Identity, check_others
from kpopnet.data.observation import JoinedSources, ObservationSource
from kpopnet.data.person_crops import PersonCrops
from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError, check_between, check_seed
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import read_meta, run_folder
from kpopnet.ridge import RidgeConfig
from kpopnet.runtime.cpu import bounded_processes
from kpopnet.runtime.folder_lock import locked
from kpopnet.runtime.hydra_app import OutputFolder, command_line_settings, entry_point, register_choices, resumed_config
from kpopnet.runtime.input_files import settings_from
from kpopnet.training.finder import FinderTraining, refuse_other_finder, train_finder
from kpopnet.training.loop import RunConfig, refuse_other_run, train
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SENSORS, SensorConfig

log = logging.getLogger(__name__)

OmegaConf.register_new_resolver("run_folder", run_folder)
OmegaConf.register_new_resolver("run_subdir", lambda resume: ".hydra_resumed" if resume else ".hydra")
register_choices("sensor", SENSORS)


@dataclass
class DataConfig:
    """Where the samples are.

    Attributes:
        train: folder of shards to learn from.
        validation: folder of shards of other people, to choose the best checkpoint on.
    """

    train: str = "data/small/train"
    validation: str = "data/small/validation"


@dataclass
class ObservationConfig:
    """What both kinds of training share: the data and how a sensor sees it.

    Attributes:
        sensor: noise of the depth sensor, drawn again in every epoch.
        other_sensors: probability, for each image, that another sensor, by its name, measures it instead.
        extraction: errors of the silhouettes, drawn again in every epoch.
        data: where the samples are.
        crops: folder with person crops in train/ and validation/ (`kpopnet.data.person_crops`), which are added to the samples.
        crops_repeated: how often an epoch has each of the training crops.
        seed: of everything random.
        workers: processes that prepare batches; 0 prepares them in this process.
    """

    sensor: SensorConfig = field(default_factory=SensorConfig)
    other_sensors: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SENSORS, 0.0))
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    data: DataConfig = field(default_factory=DataConfig)
    crops: str | None = None
    crops_repeated: int = 1
    seed: int = 0
    workers: int = 1

    def __post_init__(self) -> None:
        check_seed("seed", self.seed)
        check_between("workers", self.workers, 0, 1e6)
        check_between("crops_repeated", self.crops_repeated, 1, 1e6)
        if self.crops is None and self.crops_repeated > 1:
            raise InputError(f"crops_repeated={self.crops_repeated}: there are no crops; give crops=FOLDER")

    def observed(self) -> tuple[ObservationSource, ObservationSource, dict[str, dict]]:
        """What to learn from and to validate with, and what identifies the sets.

        Raises InputError if a folder holds none, or both hold the same split of a set.
        """
        log.info(f"reading {self.data.train} and {self.data.validation}")
        sets = {name: ShardedSet(folder) for name, folder in asdict(self.data).items()}
        check_others(*(Identity(one.header.config_hash, one.header.split) for one in sets.values()), self.data.validation)
        for name, shards in sets.items():
            if shards.kind == "frozen":
                log.warning(f"data.{name}: a frozen set, measured once: sensor, other_sensors and extraction change nothing")
        sources: dict[str, ObservationSource] = {
            name: Observer(shards, self.sensor, self.extraction, self.seed, self.other_sensors) for name, shards in sets.items()
        }
        known = {name: {"hash": shards.header.config_hash, "samples": len(shards)} for name, shards in sets.items()}
        if self.crops is not None:
            crops = {name: PersonCrops(Path(self.crops) / name) for name in sources}
            check_others(*(one.identity for one in crops.values()), Path(self.crops) / "validation")
            for name, more in crops.items():
                repeated = self.crops_repeated if name == "train" else 1
                sources[name] = JoinedSources((sources[name], *[more] * repeated))
                known[f"crops/{name}"] = {"hash": more.identity.hash, "samples": len(more), "repeated": repeated}
        return sources["train"], sources["validation"], known


@dataclass
class NetworkTrainingConfig(ObservationConfig, RunConfig):
    """Training of a network: both parents' settings."""


@dataclass
class TreeWalkTrainingConfig(ObservationConfig):
    """Training of the random tree walk.

    Attributes:
        out: folder for the model.
        tree_walk: the trees and how they are grown.
    """

    out: str = "outputs/tree_walk"
    tree_walk: TreeWalkConfig = field(default_factory=TreeWalkConfig)


@dataclass
class FinderTrainingConfig:
    """Training of a network of the finder of people.

    Attributes:
        out: folder for the weights.
        data: where the room images are, or, for training.part=masks, the person masks.
        training: how the finder is trained.
        seed: of weights, order and mirroring.
        device: auto, cpu or cuda.
        threads: of torch on the CPU; 0 takes all cores.
    """

    out: str = "outputs/finder"
    data: DataConfig = field(default_factory=lambda: DataConfig("data/room_images/train", "data/room_images/validation"))
    training: FinderTraining = field(default_factory=FinderTraining)
    seed: int = 0
    device: str = "auto"
    threads: int = 0

    def __post_init__(self) -> None:
        check_seed("seed", self.seed)


class TrainingFolder(OutputFolder):
    """Locks a run's folder, and refuses one that holds another run, whose configuration Hydra would replace."""

    def check(self, config: DictConfig, folder: Path) -> None:
        if "tree_walk" in config:
            refuse_other_model(Path(config.out))
        elif "out" not in config:
            refuse_other_run(folder, config.training.resume)
        elif not config.training.resume:
            refuse_other_finder(Path(config.out))


def as_started_from(config: NetworkTrainingConfig) -> NetworkTrainingConfig:
    """With the model and ridge image of the checkpoint `training.start`, but for what the command line says otherwise.

    Settings of a file (--config-dir) count where they are not the default.
    """
    meta, given = read_meta(config.training.start), command_line_settings()
    model, ridge = (
        {name.removeprefix(f"{part}.") for name in given if name.startswith(f"{part}.")} for part in ("model", "ridge")
    )
    model |= {name for name, value in asdict(ModelConfig()).items() if getattr(config.model, name) != value}
    ridge |= {name for name, value in asdict(RidgeConfig()).items() if getattr(config.ridge, name) != value}
    model |= {"kind"} if "model" in given else set()
    return replace(
        config,
        model=ModelConfig(**(meta["model"] | {name: getattr(config.model, name) for name in model})),
        ridge=replace(
            settings_from(RidgeConfig, meta["config"].get("ridge", {}), f"{config.training.start}: its ridge settings"),
            **{name: getattr(config.ridge, name) for name in ridge},
        ),
    )


def run_network_training(config: NetworkTrainingConfig) -> None:
    if config.training.resume is not None:
        saved = read_meta(config.training.resume)["config"]
        config = resumed_config(config, saved, may_change=("training.resume", "data.", "crops", "device", "workers", "threads"))
    elif config.training.start is not None:
        config = as_started_from(config)
    source, validation, data = config.observed()
    train(config, source, validation, Path(HydraConfig.get().runtime.output_dir), data)


def refuse_other_model(folder: Path) -> None:
    """Raises InputError for a folder with a tree walk."""
    if (folder / META).exists():
        raise InputError(f"{folder}: holds a model; give another folder (out=...), or delete it")


def run_tree_walk_training(config: TreeWalkTrainingConfig) -> None:
    source, _, data = config.observed()
    with locked(config.out):  # another folder than Hydra's, if both are given
        refuse_other_model(Path(config.out))
        model = train_tree_walk(config.tree_walk, source, config.seed, bounded_processes(config.workers, "workers"))
        model.save(Path(config.out), {"config": asdict(config), "data": data})
    log.info(f"{config.out}: judge it by kpopnet evaluate 'estimator=[tree_walk]' estimator.tree_walk.path={config.out}")


@entry_point({"train": NetworkTrainingConfig, "tree_walk": TreeWalkTrainingConfig, "finder": FinderTrainingConfig})
def main(config: NetworkTrainingConfig | TreeWalkTrainingConfig | FinderTrainingConfig) -> None:
    """Trains what --config-name chose, by default a network."""
    if not isinstance(config, NetworkTrainingConfig) and int(os.environ.get("WORLD_SIZE", "1")) > 1:
        raise InputError("the finder and the tree walk train in one process: start it without torchrun")
    if isinstance(config, TreeWalkTrainingConfig):
        run_tree_walk_training(config)
    elif isinstance(config, FinderTrainingConfig):
        with locked(config.out):
            train_finder(config.training, config.seed, asdict(config.data), Path(config.out), config.threads, config.device)
    else:
        run_network_training(config)
