"""Generates sets of synthetic depth samples for training.

    python -m synth preset=demo                       42,000 samples into data/demo: what `make demo` trains on
    python -m synth preset=small out=data/small       88,000 samples: enough for a useful network
    python -m synth preset=paper out=/big/paper       the paper's 800,000 + 300,000
    python -m synth motion=clips motion.path=/my/bvh sensor=kinect_2 camera=kinect_2 out=data/mine
    python -m synth preset=small frozen=[train,validation,test]     noisy depth and ridge images on disk

or a simulated benchmark, in the file format of the real one where there is one:

    python -m synth benchmark=eval_sim                              24 sequences, 8 GB, into data/eval_sim
    python -m synth benchmark=eval_sim benchmark.seed=1 benchmark.sequences=8 out=data/eval_sim_1
    python -m synth benchmark=eval_sim motion=clips motion.path=PACK out=data/eval_sim_clips
    python -m synth benchmark=smmc10_sim                            28 sequences, 3 GB, into data/smmc10_sim
    python -m synth benchmark=two_people                            24 sequences of two people, 0.2 GB, into data/two_people
    python -m synth benchmark=kpop_sim                              100 dances, 400 learners, 3 GB, into data/kpop_sim
    python -m synth benchmark=kpop_sim benchmark.split=train out=data/kpop_train    other dances by other people

A command that was stopped makes only what is missing when it runs again. Several machines may share one folder: give each
its own range, shards=0:100, shards=100:200, ...; under SLURM (pip install 'kpopnet[cluster]'):

    python -m synth -m hydra/launcher=submitit_slurm preset=paper out=/big/paper shards=0:100,100:200,200:300

Installed from a wheel, the program is `kpopnet generate`.
"""

from kpopnet.runtime.endings import begin_imports, end_imports

if __name__ == "__main__":
    begin_imports()

import re
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from kpopnet.camera import Camera
from kpopnet.errors import InputError, check_between, check_seed
from kpopnet.ridge import RidgeConfig
from kpopnet.runtime.cpu import available_cores, bounded_processes
from kpopnet.runtime.folder_lock import EVERYTHING, locked
from kpopnet.runtime.hydra_app import entry_point, register_choices, register_schemas, user_errors
from synth.body.shape import BodyConfig
from synth.dances import simulate
from synth.dances import writer as dance_writer
from synth.dances.simulate import KpopSimConfig, KpopSimSet
from synth.motion import SPLITS, MotionConfig, build_motion
from synth.samples.generate import finish, generate
from synth.samples.observe import ExtractionConfig
from synth.samples.placing import StageConfig
from synth.samples.sampler import CameraConfig, SampleConfig
from synth.samples.writer import MAX_SHARD_SIZE, MAX_SHARDS, FreezeConfig, SetConfig
from synth.scene.props import PropsConfig
from synth.scene.render import RENDERERS, make_renderer
from synth.scene.room import ViewConfig
from synth.scene.scene import Scene
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated import writer as sequence_writer
from synth.simulated.eval_files import EVAL_SIM
from synth.simulated.eval_sim import EvalSimConfig, EvalSimSet
from synth.simulated.smmc10_files import SMMC10_SIM
from synth.simulated.smmc10_sim import Smmc10SimConfig, Smmc10SimSet
from synth.simulated.two_people import TwoPeopleConfig, TwoPeopleSet
from synth.simulated.two_people_files import TWO_PEOPLE


def parse_range(text: str, num_shards: int) -> range:
    """Shard numbers from "all" or "first:end".

    Raises:
        InputError: anything else.
    """
    if text == "all":
        return range(num_shards)
    if not re.fullmatch(r"[0-9]{1,9}:[0-9]{1,9}", text):
        raise InputError(f'shards={text}: give "all" or a range such as 0:100')
    first, _, end = text.partition(":")
    if int(first) >= int(end):
        raise InputError(f"shards={text}: the first number must be below the second")
    return range(int(first), min(int(end), num_shards))


@dataclass(frozen=True)
class SplitSizes:
    """Samples in each split. The splits share no person and no motion.

    Attributes:
        train: number of training samples.
        validation: number of validation samples.
        test: number of test samples.
    """

    train: int = 0
    validation: int = 0
    test: int = 0

    def __post_init__(self) -> None:
        for name in SPLITS:
            check_between(f"splits.{name}", getattr(self, name), 0, MAX_SHARDS * MAX_SHARD_SIZE)


@dataclass(frozen=True)
class GenerateConfig:
    """The settings of `python -m synth`.

    Attributes:
        out: folder for the splits' folders.
        seed: of everything random.
        splits: number of samples in each split.
        frozen: splits whose noisy depth and ridge images are stored; the others store the clean render.
        shard_size: samples in one file.
        shards: "all", or the range "first:end" of shards to make in this run.
        processes: number of worker processes; 0 takes every core.
        body: shapes of the people.
        motion: where poses and motions come from.
        camera: intrinsics of the depth camera.
        view: where the camera stands and looks.
        stage: where people stand in the room.
        props: seats, held objects and second people.
        sensor: noise of the depth sensor.
        extraction: errors of the silhouettes.
        ridge: parameters of the ridge image.
        renderer: auto, cpu (z-buffer in numba) or gl (MuJoCo's OpenGL).
        samples_per_body: consecutive samples that show the same person.
        samples_per_room: consecutive samples in the same room before the same camera.
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
    props: PropsConfig = field(default_factory=PropsConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)
    renderer: str = "auto"
    samples_per_body: int = 8
    samples_per_room: int = 25

    def __post_init__(self) -> None:
        unknown = set(self.frozen) - set(SPLITS)
        if unknown:
            raise InputError(f"frozen={self.frozen}: {sorted(unknown)} are no splits; choose from {', '.join(SPLITS)}")
        parse_range(self.shards, 0)
        check_seed("seed", self.seed)
        check_between("shard_size", self.shard_size, 1, MAX_SHARD_SIZE)
        for split in SPLITS:
            if (count := getattr(self.splits, split)) > MAX_SHARDS * self.shard_size:
                raise InputError(
                    f"splits.{split}={count}: more than {MAX_SHARDS:,} shards of shard_size={self.shard_size} samples; "
                    "choose fewer samples or larger shards"
                )
        if self.splits == SplitSizes(0, 0, 0):
            raise InputError("every split has size 0: choose a preset, or set for instance splits.train=1000")
        if self.processes < 0:
            raise InputError(f"processes={self.processes} must be 0 (every core) or more")

    def sample(self) -> SampleConfig:
        """The settings on which samples depend, with the renderer resolved."""
        renderer = resolved_renderer(self.renderer, self.camera.build())
        return SampleConfig(
            self.body,
            self.motion,
            self.camera,
            self.view,
            self.stage,
            self.props,
            renderer,
            self.samples_per_body,
            self.samples_per_room,
        )


def resolved_renderer(renderer: str, camera: Camera) -> str:
    """The renderer's name; for `auto` the one that this machine has."""
    if renderer != "auto":
        return renderer
    probe = make_renderer("auto", Scene(camera))
    probe.close()
    return probe.name


@entry_point({"generate": GenerateConfig}, "synth")
def make_set(config: GenerateConfig) -> None:
    sample = config.sample()
    look = FreezeConfig(config.sensor, config.extraction, config.ridge)
    processes = bounded_processes(config.processes) or available_cores()
    camera = config.camera.build()
    print(
        f"{config.camera.name} {camera.width}x{camera.height}, motion {config.motion.source}, "
        f"sensor {config.sensor.name}, renderer {sample.renderer}, {processes} processes, into {config.out}"
    )
    for split in SPLITS:
        count = getattr(config.splits, split)
        if not count:
            continue
        # Opened here first: warnings about recordings appear once, before the worker processes start.
        build_motion(config.motion, split)
        freeze = look if split in config.frozen else None
        a_set = SetConfig(sample, config.seed, split, count, config.shard_size, freeze)
        folder = Path(config.out) / split
        shards = parse_range(config.shards, a_set.num_shards)
        with locked(folder, EVERYTHING if config.shards == "all" else shards):
            generate(a_set, folder, shards, processes)
            summary = finish(a_set, folder, look)
        if summary is None:
            print(f"{folder}: the shards of this run are finished; other shards are missing")
            continue
        print(
            f"{folder}: {summary['samples']} samples in {summary['shards']} shards, {summary['bytes'] / 1e6:.0f} MB, "
            f"{summary['refused_poses']} poses and {summary['refused_places']} places rejected, "
            f"{summary['forced_samples']} samples accepted after the last attempt; look at {folder / 'contact_sheet.png'}"
        )


@dataclass(frozen=True)
class StandInConfig:
    """The settings of `python -m synth benchmark=...`.

    Attributes:
        benchmark: the simulated benchmark, its seed and its size.
        out: folder for its files.
        motion: choreography, or clips of a motion pack's test subjects.
        renderer: auto, cpu (z-buffer in numba) or gl (MuJoCo's OpenGL).
        processes: number of worker processes; 0 takes every core.
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
    """A benchmark that can be simulated.

    Attributes:
        settings: dataclass of the benchmark's settings.
        camera: its depth camera.
        describe: (settings, motion, renderer) to the complete configuration of the set.
        write: (complete configuration, folder, processes) makes the missing files.
    """

    settings: type
    camera: Camera
    describe: Callable[[Any, MotionConfig, str], Any]
    write: Callable[[Any, Path, int], dict]


STAND_INS = {
    "eval_sim": Makeable(EvalSimConfig, EVAL_SIM.maker.camera, EvalSimSet, partial(sequence_writer.write_set, EVAL_SIM)),
    "smmc10_sim": Makeable(
        Smmc10SimConfig, SMMC10_SIM.maker.camera, Smmc10SimSet, partial(sequence_writer.write_set, SMMC10_SIM)
    ),
    "two_people": Makeable(
        TwoPeopleConfig, TWO_PEOPLE.maker.camera, TwoPeopleSet, partial(sequence_writer.write_set, TWO_PEOPLE)
    ),
    "kpop_sim": Makeable(KpopSimConfig, simulate.CAMERA, KpopSimSet, dance_writer.write_set),
}
"""Each benchmark that can be simulated."""

# A group of its own: evaluate.py has other settings for the same benchmarks.
register_schemas("simulated", {name: stand_in.settings for name, stand_in in STAND_INS.items()}, place="benchmark")
register_choices("sensor", SENSORS)


@entry_point({"simulated_set": StandInConfig}, "synth")
def make_stand_in(config: StandInConfig) -> None:
    stand_in = STAND_INS[config.benchmark.name]
    a_set = stand_in.describe(config.benchmark, config.motion, resolved_renderer(config.renderer, stand_in.camera))
    processes, folder = bounded_processes(config.processes) or available_cores(), Path(config.out)
    settings = ", ".join(f"{name} {value}" for name, value in asdict(config.benchmark).items() if name != "name")
    print(
        f"{config.benchmark.name}, simulated, {settings}, motion {config.motion.source}, renderer {a_set.renderer}, "
        f"{processes} processes, into {folder}"
    )
    with locked(folder):
        stand_in.write(a_set, folder, processes)
    print(f"{folder}: finished; look at {folder / 'contact_sheet.png'}")


@user_errors
def main() -> None:
    """Makes a simulated benchmark where the command line has benchmark=NAME, else a set of samples."""
    named = [given.removeprefix("benchmark=") for given in sys.argv[1:] if given.startswith("benchmark=")]
    for name in named:
        if name not in STAND_INS:
            raise InputError(f"benchmark={name}: the simulated benchmarks are {', '.join(STAND_INS)}")
    (make_stand_in if named else make_set)()


if __name__ == "__main__":
    end_imports()
    main()
