"""What is compared: frames, skeletons and temporal noise of real sets and of generated ones."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from tqdm import tqdm

from kpopnet.data.shards import ShardedSet
from kpopnet.datasets.eval.benchmark import EvalSimBenchmark, EvalSimConfig
from kpopnet.datasets.itop import FROM_ITOP, ItopFiles
from kpopnet.datasets.protocol import evenly_spaced
from kpopnet.datasets.utd_mhad import UtdMhadBenchmark, UtdMhadConfig
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, expect, read_npz
from kpopnet.skeleton import NUM_JOINTS
from synth.realism.noise import TemporalNoise, temporal_noise
from synth.realism.selection import is_upright
from synth.realism.shapes import Frame
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SensorConfig

MOST_SEQUENCES = 120
"""Real sequences that are read, evenly spaced over the set, whose order is by action and person."""

MOST_FILMS = 6

USUAL_LAG = -2
"""The most frequent lag of UTD-MHAD's labels, frames: a search for each sequence's own would take most of the time, and no
statistic here depends on a thirtieth of a second."""


@dataclass
class Source:
    """Data of one origin.

    Attributes:
        name: of the set.
        frames: random frames.
        upright: random frames of upright people (synth.realism.selection).
        skeletons_m: (N, 15, 3) joints in metres, camera frame.
        noise: temporal noise of each sequence.
    """

    name: str
    frames: list[Frame] = field(default_factory=list)
    upright: list[Frame] = field(default_factory=list)
    skeletons_m: np.ndarray = field(default_factory=lambda: np.empty((0, NUM_JOINTS, 3)))
    noise: list[TemporalNoise] = field(default_factory=list)


def read_real(path: Path, count: int, seed: int) -> Source:
    """A real set: a folder of UTD-MHAD, a folder of ITOP, or an .npz file with ITOP's joints as `side_m` (N, 15, 3).

    Args:
        path: of the set.
        count: wanted number of frames of each kind.
        seed: of their choice.

    Raises:
        InputError: none of the three, or files that cannot be read.
    """
    if path.suffix == ".npz":
        joints = read_npz(path, {"side_m": ArraySchema("f", (None, NUM_JOINTS, 3))})["side_m"]
        expect(len(joints) > 0, f"{path}: side_m", "at least one skeleton")
        return Source("ITOP", skeletons_m=joints * FROM_ITOP)
    if any(path.glob("ITOP_side_test_labels.h5*")):
        files = ItopFiles(path, "side", "test")
        return Source("ITOP", skeletons_m=files.joints_camera_m[files.valid])
    if any(path.glob("Depth/*_depth.mat")):
        return _read_utd_mhad(path, count, seed)
    raise InputError(
        f"--real {path}: expected a folder of UTD-MHAD (Depth/ and Skeleton/), a folder of ITOP "
        "(ITOP_side_test_labels.h5), or an .npz file with ITOP's joints as side_m"
    )


def _read_utd_mhad(path: Path, count: int, seed: int) -> Source:
    benchmark = UtdMhadBenchmark(UtdMhadConfig(path=str(path), lag=USUAL_LAG))
    names = evenly_spaced(benchmark.sequence_names(), MOST_SEQUENCES)
    source, skeletons = Source("UTD-MHAD"), []
    each = -(-count // len(names))
    for number, name in enumerate(tqdm(names, "real", unit="sequence", disable=None)):
        rng = np.random.default_rng([seed, number])
        sequence = benchmark.read(name)
        upright = is_upright(sequence.joints_camera_m)
        for frames, eligible in (
            (source.frames, np.flatnonzero(sequence.depth_m.any(axis=(1, 2)))),
            (source.upright, np.flatnonzero(upright)),
        ):
            for row in sorted(rng.permutation(eligible)[:each].tolist()):
                joints_m = sequence.joints_camera_m[row]
                frames.append(Frame(f"{name} {row}", sequence.depth_m[row].copy(), sequence.camera, joints_m))
        skeletons.append(sequence.joints_camera_m)
        if (noise := temporal_noise(sequence.depth_m)) is not None:
            source.noise.append(noise)
    source.skeletons_m = np.concatenate(skeletons)
    return source


def open_generated(path: Path) -> ShardedSet:
    """The shards in a folder, or those of the split `train` in a folder of splits.

    Raises:
        InputError: no shards.
    """
    return ShardedSet(path if any(path.glob("shard_*.h5")) or not (path / "train").is_dir() else path / "train")


def chosen_indices(shards: ShardedSet, count: int, seed: int) -> np.ndarray:
    """(count,) random samples of a set, ascending, all of them if there are fewer."""
    return np.sort(np.random.default_rng([seed, 0]).permutation(len(shards))[:count])


def read_generated(shards: ShardedSet, sensor: SensorConfig, count: int, seed: int) -> Source:
    """Generated samples, measured and segmented as in training, and the joints of all samples."""
    observer = Observer(shards, sensor, ExtractionConfig(), seed=seed)
    joints_m = shards.column("joints_m")
    upright = np.flatnonzero(is_upright(joints_m))
    upright = np.sort(np.random.default_rng([seed, 1]).permutation(upright)[:count])
    source = Source("synthetic", skeletons_m=joints_m)
    wanted = ((source.frames, chosen_indices(shards, count, seed)), (source.upright, upright))
    for frames, indices in wanted:
        for index in tqdm(indices.tolist(), "synthetic", unit="frame", disable=None):
            frames.append(_observed(observer, index))
    return source


def _observed(observer: Observer, index: int) -> Frame:
    """A sample after sensor and segmentation, pasted back into the whole image."""
    seen, camera = observer.observe(index, 0), observer.shards.camera
    x0, y0 = round(camera.cx - seen.camera.cx), round(camera.cy - seen.camera.cy)
    depth_m = np.zeros((camera.height, camera.width), np.float32)
    depth_m[y0 : y0 + seen.camera.height, x0 : x0 + seen.camera.width] = seen.depth_m
    return Frame(f"sample {index}", depth_m, camera, seen.joints_camera_m)


def read_film_noise(folder: Path) -> list[TemporalNoise]:
    """Temporal noise of the sequences of a simulated EVAL.

    Raises:
        InputError: the folder holds no simulated EVAL.
    """
    benchmark = EvalSimBenchmark(EvalSimConfig(path=str(folder)))
    names = evenly_spaced(benchmark.sequence_names(), MOST_FILMS)
    found = [temporal_noise(benchmark.read(name).depth_m) for name in tqdm(names, "film", unit="sequence", disable=None)]
    return [noise for noise in found if noise is not None]
