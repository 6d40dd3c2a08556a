"""Makes sets of synthetic depth samples.

    python -m synth preset=demo                       a few thousand samples into data/demo
    python -m synth preset=small out=data/small       enough to train a useful network on a CPU
    python -m synth preset=paper out=/big/paper       the paper's 800,000 + 300,000
    python -m synth motion=clips motion.path=/my/bvh sensor=kinect_2 camera=kinect_2 out=data/mine
    python -m synth preset=small frozen=[train,validation,test]     noisy depth and ridge images on disk

or a benchmark's simulated stand-in, in the real one's own files:

    python -m synth benchmark=eval_sim                              24 sequences, 8 GB, into data/eval_sim
    python -m synth benchmark=eval_sim benchmark.seed=1 benchmark.sequences=8 out=data/eval_sim_1
    python -m synth benchmark=eval_sim motion=clips motion.path=PACK out=data/eval_sim_clips
    python -m synth benchmark=smmc10_sim                            28 sequences, 3 GB, into data/smmc10_sim
    python -m synth benchmark=kpop_sim                              100 dances, 400 learners, 3 GB, into data/kpop_sim
    python -m synth benchmark=kpop_sim benchmark.split=train out=data/kpop_train    other dances by other people

Run again after being stopped, it makes only what is missing. Several machines may share one folder: give each its own
range, shards=0:100, shards=100:200, ...; under SLURM (pip install -e '.[cluster]'):

    python -m synth -m hydra/launcher=submitit_slurm preset=paper out=/big/paper shards=0:100,100:200,200:300
"""

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from hydra.core.config_store import ConfigStore

from kpopnet.camera import Camera
from kpopnet.entry import entry_point, user_errors
from kpopnet.errors import InputError
from kpopnet.machine import cores_at_hand
from kpopnet.ridge import RidgeConfig
from synth import kpop_files, kpop_sim, stand_in_files
from synth.body import BodyConfig
from synth.eval_files import EVAL_SIM
from synth.eval_sim import EvalSimConfig, EvalSimSet
from synth.generate import finish, generate
from synth.kpop_sim import KpopSimConfig, KpopSimSet
from synth.motion import SPLITS, MotionConfig, build_motion
from synth.observe import ExtractionConfig
from synth.render import RENDERERS, make_renderer
from synth.room import ViewConfig
from synth.sample import CameraConfig, SampleConfig, StageConfig
from synth.scene import Scene
from synth.sensor import SensorConfig
from synth.shards import FreezeConfig, SetConfig
from synth.smmc10_files import SMMC10_SIM
from synth.smmc10_sim import Smmc10SimConfig, Smmc10SimSet


def parse_range(text: str, num_shards: int) -> range:
    """"all" or "first:end" as shard numbers.

    Raises:
        InputError: anything else.
    """
    if text == "all":
        return range(num_shards)
    first, colon, end = text.partition(":")
    if not (colon and first.isdigit() and end.isdigit()):
        raise InputError(f'shards={text}: give "all" or a range such as 0:100')
    if int(first) >= int(end):
        raise InputError(f"shards={text}: the first number must be below the second")
    return range(int(first), min(int(end), num_shards))


@dataclass(frozen=True)
class SplitSizes:
    """Samples in each split. The splits share no person and no motion."""

    train: int = 0
    validation: int = 0
    test: int = 0


@dataclass(frozen=True)
class GenerateConfig:
    """What `python -m synth` takes.

    Attributes:
        out: folder for the splits' folders.
        seed: of everything random.
        splits: how many samples of each.
        frozen: splits whose noisy depth and ridge images are stored; the others store the clean render.
        shard_size: samples in one file.
        shards: "all", or the range "first:end" of each split that this run is to make.
        processes: 0 takes every core.
    """

    out: str = "data/small"
    seed: int = 0
    splits: SplitSizes = field(default_factory=SplitSizes)
    frozen: list[str] = field(default_factory=lambda: ["test"])
    shard_size: int = 1000
    shards: str = "all"
    processes: int = 0
    body: BodyConfig = field(default_factory=BodyConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    view: ViewConfig = field(default_factory=ViewConfig)
    stage: StageConfig = field(default_factory=StageConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)
    renderer: str = "auto"
    samples_per_body: int = 8
    samples_per_room: int = 500

    def __post_init__(self) -> None:
        unknown = set(self.frozen) - set(SPLITS)
        if unknown:
            raise InputError(f"frozen={self.frozen}: {sorted(unknown)} are no splits; choose from {', '.join(SPLITS)}")
        parse_range(self.shards, 0)
        if self.seed < 0:
            raise InputError(f"seed={self.seed} must be 0 or more")
        if self.splits == SplitSizes(0, 0, 0):
            raise InputError("every split has size 0: choose a preset, or set for instance splits.train=1000")
        if self.processes < 0:
            raise InputError(f"processes={self.processes} must be 0 (every core) or more")

    def sample(self) -> SampleConfig:
        """Its part that decides what a sample is, with the renderer decided."""
        renderer = decided(self.renderer, self.camera.build())
        return SampleConfig(
            self.body,
            self.motion,
            self.camera,
            self.view,
            self.stage,
            renderer,
            self.samples_per_body,
            self.samples_per_room,
        )


def decided(renderer: str, camera: Camera) -> str:
    """What `auto` means on this machine."""
    if renderer != "auto":
        return renderer
    probe = make_renderer("auto", Scene(camera))
    probe.close()
    return probe.name


@entry_point(GenerateConfig, "generate", "../configs")
def make_set(config: GenerateConfig) -> None:
    sample = config.sample()
    look = FreezeConfig(config.sensor, config.extraction, config.ridge)
    processes = config.processes or cores_at_hand()
    camera = config.camera.build()
    print(
        f"{config.camera.name} {camera.width}x{camera.height}, motion {config.motion.source}, "
        f"sensor {config.sensor.name}, renderer {sample.renderer}, {processes} processes, into {config.out}"
    )
    for split in SPLITS:
        count = getattr(config.splits, split)
        if not count:
            continue
        # Opened here once, so that what it has to say of the recordings is said once and before the work begins.
        build_motion(config.motion, split)
        freeze = look if split in config.frozen else None
        a_set = SetConfig(sample, config.seed, split, count, config.shard_size, freeze)
        folder = Path(config.out) / split
        generate(a_set, folder, parse_range(config.shards, a_set.num_shards), processes)
        summary = finish(a_set, folder, look)
        if summary is None:
            print(f"{folder}: this run's shards are done; others are still missing")
            continue
        print(
            f"{folder}: {summary['samples']} samples in {summary['shards']} shards, {summary['bytes'] / 1e6:.0f} MB, "
            f"{summary['refused_poses']} poses refused, {summary['forced_samples']} taken though not good; "
            f"look at {folder / 'contact_sheet.png'}"
        )


@dataclass(frozen=True)
class StandInConfig:
    """What `python -m synth benchmark=...` takes.

    Attributes:
        benchmark: which, with its seed and how much of it.
        out: folder for its files.
        motion: choreography, or clips of a motion pack's test subjects.
        renderer: auto, cpu or gl.
        processes: 0 takes every core.
    """

    benchmark: Any
    out: str = "data/eval_sim"
    motion: MotionConfig = field(default_factory=MotionConfig)
    renderer: str = "auto"
    processes: int = 0

    def __post_init__(self) -> None:
        if self.renderer not in RENDERERS:
            raise InputError(f"renderer={self.renderer}: choose one of {', '.join(RENDERERS)}")
        if self.processes < 0:
            raise InputError(f"processes={self.processes} must be 0 (every core) or more")


class Makeable(NamedTuple):
    """A benchmark that can be made.

    Attributes:
        settings: of the benchmark, a dataclass.
        camera: what its pictures are drawn with.
        describe: (settings, motion, renderer) to the whole of what the set depends on.
        write: (that, folder, processes) makes what is missing.
    """

    settings: type
    camera: Camera
    describe: Callable[[Any, MotionConfig, str], Any]
    write: Callable[[Any, Path, int], dict]


STAND_INS = {
    "eval_sim": Makeable(EvalSimConfig, EVAL_SIM.maker.camera, EvalSimSet, partial(stand_in_files.write_set, EVAL_SIM)),
    "smmc10_sim": Makeable(
        Smmc10SimConfig, SMMC10_SIM.maker.camera, Smmc10SimSet, partial(stand_in_files.write_set, SMMC10_SIM)
    ),
    "kpop_sim": Makeable(KpopSimConfig, kpop_sim.CAMERA, KpopSimSet, kpop_files.write_set),
}
"""Each benchmark that can be made."""

for name, stand_in in STAND_INS.items():
    ConfigStore.instance().store(group="benchmark/schema", name=name, node=stand_in.settings)


@entry_point(StandInConfig, "stand_in", "../configs")
def make_stand_in(config: StandInConfig) -> None:
    stand_in = STAND_INS[config.benchmark.name]
    a_set = stand_in.describe(config.benchmark, config.motion, decided(config.renderer, stand_in.camera))
    processes, folder = config.processes or cores_at_hand(), Path(config.out)
    settings = ", ".join(f"{name} {value}" for name, value in asdict(config.benchmark).items() if name != "name")
    print(
        f"{config.benchmark.name}, simulated, {settings}, motion {config.motion.source}, renderer {a_set.renderer}, "
        f"{processes} processes, into {folder}"
    )
    stand_in.write(a_set, folder, processes)
    print(f"{folder}: finished; look at {folder / 'contact_sheet.png'}")


@user_errors
def main() -> None:
    """A benchmark where the command line names one, else a set of samples."""
    named = [given.removeprefix("benchmark=") for given in sys.argv[1:] if given.startswith("benchmark=")]
    for name in named:
        if name not in STAND_INS:
            raise InputError(f"benchmark={name}: there are stand-ins for no other than {', '.join(STAND_INS)}")
    (make_stand_in if named else make_set)()


if __name__ == "__main__":
    main()
