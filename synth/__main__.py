"""Generates sets of synthetic depth samples for training.

    python -m synth preset=demo                       42,000 samples into data/demo: what `make demo` trains on
    python -m synth preset=small out=data/small       88,000 samples: enough for a useful network
    python -m synth preset=paper out=/big/paper       the paper's 800,000 + 300,000
    python -m synth motion=clips motion.path=/my/bvh sensor=kinect_2 camera=kinect_2 out=data/mine
    python -m synth preset=small frozen=[train,validation,test]     noisy depth and ridge images on disk

or a simulated benchmark:

    python -m synth benchmark=eval_sim                              24 sequences, 0.7 GB, into data/eval_sim
    python -m synth benchmark=eval_sim benchmark.seed=1 benchmark.sequences=8 out=data/eval_sim_1
    python -m synth benchmark=eval_sim motion=clips motion.path=PACK out=data/eval_sim_clips
    python -m synth benchmark=smmc10_sim                            28 sequences, 0.3 GB, into data/smmc10_sim
    python -m synth benchmark=two_people                            24 sequences of two people, 0.2 GB, into data/two_people
    python -m synth benchmark=rooms                                 65 films and 400 images of any room, 0.6 GB, into data/rooms
    python -m synth benchmark=check_sim                             30 films for `kpopnet check`, 7 GB, into data/check_sim
    python -m synth benchmark=kpop_sim                              100 dances, 400 learners, 3 GB, into data/kpop_sim
    python -m synth benchmark=kpop_sim benchmark.split=train out=data/kpop_train    other dances by other people

A command that was stopped makes only what is missing when it runs again. Several machines may share one folder: give each
its own range, shards=0:100, shards=100:200, ...; under SLURM (pip install -e '.[cluster]'):

    python -m synth -m hydra/launcher=submitit_slurm preset=paper out=/big/paper shards=0:100,100:200,200:300

Installed from a wheel, the program is `kpopnet generate`.
"""

from kpopnet.runtime.endings import begin_imports, end_imports

if __name__ == "__main__":
    begin_imports()

import re
import sys
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError, check_between
from kpopnet.ridge import RidgeConfig
from kpopnet.runtime.cpu import available_cores, bounded_processes
from kpopnet.runtime.folder_lock import LOCK_FILE, locked
from kpopnet.runtime.hydra_app import entry_point, register_choices, register_schemas, user_errors
from synth.dances.simulate import KpopSim
from synth.motion import SPLITS, MotionConfig, build_motion
from synth.rooms.crops import PersonCropsSet
from synth.rooms.images import RoomImagesSet
from synth.rooms.masks import PersonMasksSet
from synth.samples.observe import ExtractionConfig, FreezeConfig
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig, finish, generate
from synth.scene.render import make_renderer
from synth.scene.scene import Scene
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated.check_sim import CheckSim
from synth.simulated.generator import SetGenerator
from synth.simulated.rooms import Rooms
from synth.simulated.stand_ins import EvalSim, Smmc10Sim
from synth.simulated.two_people import TwoPeople


def parse_range(text: str, num_shards: int) -> range:
    """Shard numbers from "all" or "first:end". Raises InputError for anything else."""
    if text == "all":
        return range(num_shards)
    if not re.fullmatch(r"[0-9]{1,9}:[0-9]{1,9}", text):
        raise InputError(f'shards={text}: give "all" or a range such as 0:100')
    first, end = map(int, text.split(":"))
    if first >= end:
        raise InputError(f"shards={text}: the first number must be below the second")
    return range(first, min(end, num_shards))


@dataclass(frozen=True)
class GenerateConfig(SampleConfig):
    """The settings of `python -m synth`: those of its samples, and what is made of them.

    Attributes:
        out: folder for the splits' folders.
        seed: of everything random.
        splits: number of samples in each split: train, validation and test, which share no person and no motion.
        frozen: splits whose noisy depth and ridge images are stored; the others store the clean render.
        shard_size: samples in one file.
        shards: "all", or the range "first:end" of shards to make in this run.
        processes: number of worker processes; 0 takes every core.
        sensor: noise of the depth sensor.
        extraction: errors of the silhouettes.
        ridge: parameters of the ridge image.
    """

    out: str = "data/small"
    seed: int = 0
    splits: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SPLITS, 0))
    frozen: list[str] = field(default_factory=lambda: ["test"])
    shard_size: int = 1000
    shards: str = "all"
    processes: int = 0
    sensor: SensorConfig = field(default_factory=SensorConfig)
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)

    def __post_init__(self) -> None:
        super().__post_init__()
        if unknown := {*self.frozen, *self.splits} - set(SPLITS):
            raise InputError(f"frozen and splits: {sorted(unknown)} are no splits; choose from {', '.join(SPLITS)}")
        parse_range(self.shards, 0)
        if not any(self.splits.values()):
            raise InputError("every split has size 0: choose a preset, or set for instance splits.train=1000")

    def sets(self) -> list[SetConfig]:
        """The sets to make, one for each split that has samples."""
        sample = {one.name: getattr(self, one.name) for one in fields(SampleConfig)}
        sample["renderer"] = resolved_renderer(self.renderer, self.camera.build())
        look = FreezeConfig(self.sensor, self.extraction, self.ridge)
        return [
            SetConfig(SampleConfig(**sample), self.seed, split, count, self.shard_size, look if split in self.frozen else None)
            for split, count in self.splits.items()
            if count
        ]


def resolved_renderer(renderer: str, camera: Camera) -> str:
    """The renderer's name; for `auto` the one that this machine has. Raises InputError if there is no such renderer."""
    if renderer in ("cpu", "gl"):
        return renderer
    probe = make_renderer(renderer, Scene(camera))
    probe.close()
    return probe.name


def number_of_processes(given: int) -> int:
    """The number of worker processes, of which 0 stands for one on every core. Raises InputError for a negative number."""
    check_between("processes", given, 0, 1e6)
    return bounded_processes(given) or available_cores()


@entry_point({"generate": GenerateConfig}, "synth")
def make_samples(config: GenerateConfig) -> None:
    processes, camera, sets = number_of_processes(config.processes), config.camera.build(), config.sets()
    print(
        f"{config.camera.name} {camera.width}x{camera.height}, motion {config.motion.source}, "
        f"sensor {config.sensor.name}, renderer {sets[0].sample.renderer}, {processes} processes, into {config.out}"
    )
    for a_set in sets:
        # Opened here first: warnings about recordings appear once, before the worker processes start.
        build_motion(config.motion, a_set.split)
        folder = Path(config.out) / a_set.split
        shards = parse_range(config.shards, a_set.num_shards)
        # Processes with other ranges of shards write into the same folder.
        lock = LOCK_FILE if config.shards == "all" else f"{LOCK_FILE}_{shards.start}-{shards.stop}"
        with locked(folder, lock):
            generate(a_set, folder, shards, processes)
            summary = finish(a_set, folder, FreezeConfig(config.sensor, config.extraction, config.ridge))
        if summary is None:
            print(f"{folder}: the shards of this run are finished; other shards are missing")
            continue
        print(
            f"{folder}: {summary['samples']} samples in {summary['shards']} shards, {summary['bytes'] / 1e6:.0f} MB, "
            f"{summary['refused_poses']} poses and {summary['refused_places']} places rejected, "
            f"{summary['forced_samples']} people whose pose penetrates itself or for whom no place was free; "
            f"look at {folder / 'contact_sheet.png'}"
        )


@dataclass(frozen=True)
class BenchmarkConfig:
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


BENCHMARKS: dict[str, type[SetGenerator]] = {
    "eval_sim": EvalSim,
    "smmc10_sim": Smmc10Sim,
    "two_people": TwoPeople,
    "rooms": Rooms,
    "check_sim": CheckSim,
    "kpop_sim": KpopSim,
    "room_images": RoomImagesSet,
    "person_crops": PersonCropsSet,
    "person_masks": PersonMasksSet,
}
"""Each benchmark that can be simulated."""

# A group of its own: evaluate.py has other settings for the same benchmarks.
register_schemas("simulated", {name: one().benchmark for name, one in BENCHMARKS.items()}, place="benchmark")
register_choices("sensor", SENSORS)
register_choices("camera", [*CAMERAS, "custom"])


@entry_point({"simulated_set": BenchmarkConfig}, "synth")
def make_benchmark(config: BenchmarkConfig) -> None:
    processes, folder = number_of_processes(config.processes), Path(config.out)
    (kind,) = (one for one in BENCHMARKS.values() if type(one().benchmark) is type(config.benchmark))
    a_set = kind(config.benchmark, config.motion, resolved_renderer(config.renderer, kind.camera))
    settings = ", ".join(f"{name} {value}" for name, value in asdict(config.benchmark).items() if name != "name")
    print(
        f"{config.benchmark.name}, simulated, {settings}, motion {config.motion.source}, renderer {a_set.renderer}, "
        f"{processes} processes, into {folder}"
    )
    with locked(folder):
        a_set.write(folder, processes)
    print(f"{folder}: finished; look at {folder / 'contact_sheet.png'}")


@user_errors
def main() -> None:
    """Makes the simulated benchmark that benchmark=NAME on the command line asks for, else a set of samples."""
    asked = [word.removeprefix("benchmark=") for word in sys.argv[1:] if word.startswith("benchmark=")]
    if unknown := set(asked) - set(BENCHMARKS):
        raise InputError(f"benchmark={unknown.pop()}: the simulated benchmarks are {', '.join(BENCHMARKS)}")
    (make_benchmark if asked else make_samples)()


if __name__ == "__main__":
    end_imports()
    main()
