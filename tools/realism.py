"""Compares generated depth with real depth: statistics as a table, and random frames side by side.

    python tools/realism.py --real UTD_MHAD --real ITOP --synthetic data/small --film data/eval_sim

Writes realism.txt, realism.json and realism.png to outputs/realism. Run from the root of a checkout with `PYTHONPATH=.`.
A line is a statistic: its median and quartiles over real and over generated frames after sensor and segmentation (of yes or no
the share and Wilson's 95 % interval, which takes frames for independent: over other people shares vary more), and the gap of
the medians in real interquartile ranges.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from kpopnet.camera import Camera
from kpopnet.data.shards import ShardedSet
from kpopnet.datasets.itop import FROM_ITOP, ItopBenchmark, ItopConfig
from kpopnet.datasets.protocol import evenly_spaced
from kpopnet.errors import InputError, check_between, check_seed
from kpopnet.evaluation.dances.ranking import wilson_interval
from kpopnet.evaluation.registry import BENCHMARKS
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.runtime.endings import user_errors
from kpopnet.skeleton import JOINT_GROUPS, NUM_JOINTS, Joint
from kpopnet.viz.drawing import BACKGROUND, depth_rgb, save_png, sheet, with_captions
from synth.samples.layers import at_joints
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SENSORS

STEPS_PER_M = 345.0  # Kinect v1's depth steps are z^2 / 345 m (synth.sensor.model): 345 / z is the disparity in steps
MOST_SEQUENCES, MOST_FILMS = 120, 6  # real sequences and films that are read, evenly spaced over the set
USUAL_LAG = -2  # most frequent lag of UTD-MHAD's labels, frames: no statistic here depends on a thirtieth of a second
UPRIGHT_DEG, STRAIGHT_DEG, LEG_DEG, LEVEL_FEET_M, FACING_DEG = 20.0, 30.0, 45.0, 0.15, 35.0  # see `is_standing`, `is_upright`
SHIN_ROWS, THIGH_ROWS, FOOT_ROWS = (0.08, 0.22), (0.31, 0.37), (0.0, 0.05)  # shares of a silhouette's height, from below
LARGEST_HOLE_CM2 = 100.0  # a larger enclosed region is the loop of an arm or the gap between the legs
SAME_SURFACE_STEPS = 3.0  # neighbours that differ by less lie on the same surface
WINDOW, STILL_STEPS, PASSING_STEPS, FLAT_STEPS, NOISE_AT_M = 5, 0.2, 0.75, 0.7, (2.0, 3.5)  # see `temporal_noise`
TILE_M, TILE_PX, ROWS, COLUMNS = 2.2, 230, 3, 3


@dataclass(frozen=True)
class Frame:
    """A segmented person: (H, W) float32 depth in metres, 0 elsewhere; the camera; (15, 3) labelled joints in metres."""

    name: str
    depth_m: np.ndarray
    camera: Camera
    joints_camera_m: np.ndarray

    @cached_property
    def is_cut(self) -> bool:
        """Whether the silhouette touches the border of the image."""
        inside = self.depth_m > 0
        return bool(inside[[0, -1]].any() or inside[:, [0, -1]].any())

    @cached_property
    def body(self) -> np.ndarray | None:
        """(H, W) bool: the largest connected part of the silhouette; None where the border cuts it or there is no person."""
        count, labels, stats, _ = cv2.connectedComponentsWithStats((self.depth_m > 0).astype(np.uint8), connectivity=8)
        return None if count < 2 or self.is_cut else labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))

    @cached_property
    def height_px(self) -> int:
        """Height of the body."""
        return int(np.ptp(np.flatnonzero(self.body.any(axis=1)))) + 1

    @cached_property
    def distance_m(self) -> float:
        """Median depth of the silhouette."""
        return float(np.median(self.depth_m[self.depth_m > 0]))

    def rows(self, part: tuple[float, float]) -> slice:
        """The rows between two shares of the body's height, from its lowest row."""
        bottom = np.flatnonzero(self.body.any(axis=1))[-1] + 1
        first, last = (bottom - round(share * self.height_px) for share in part[::-1])
        return slice(min(first, last - 1), last)


def shins_width(frame: Frame) -> float:
    """Width of both lower legs over the height, in the rows that show two separate legs; NaN if fewer than half do."""
    rows = frame.body[frame.rows(SHIN_ROWS)]
    edges = [np.flatnonzero(np.diff(np.pad(row.astype(np.int8), 1))) for row in rows]
    runs = [[end - start for start, end in zip(one[::2], one[1::2], strict=True) if end - start > 1] for one in edges]
    widths_px = [sum(lengths) for lengths in runs if len(lengths) == 2]
    return float(np.mean(widths_px)) / frame.height_px if 2 * len(widths_px) >= len(rows) > 0 else np.nan


def feet_width_cm(frame: Frame) -> float:
    """The most pixels in any of the lowest rows, as centimetres at their depth."""
    rows = frame.rows(FOOT_ROWS)
    body = frame.body[rows]
    return float(body.sum(axis=1).max() * np.median(frame.depth_m[rows][body]) / frame.camera.fx * 100)


def outline_px(body: np.ndarray) -> float:
    """Length of the longest outer outline of an (H, W) mask."""
    outlines, _ = cv2.findContours(body.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return max((cv2.arcLength(outline, True) for outline in outlines), default=np.nan)


def hole_share(frame: Frame) -> float:
    """Share of the pixels inside the outline that were not measured, in holes of at most LARGEST_HOLE_CM2."""
    inside = frame.depth_m > 0
    padded = np.pad(~inside, 1, constant_values=True).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(padded, connectivity=4)
    pixel_cm2 = (100 * frame.distance_m) ** 2 / (frame.camera.fx * frame.camera.fy)
    sizes_px = np.delete(stats[:, cv2.CC_STAT_AREA], [0, labels[0, 0]])  # without the silhouette and its surroundings
    holes_px = sizes_px[sizes_px * pixel_cm2 <= LARGEST_HOLE_CM2].sum()
    return float(holes_px / (holes_px + np.count_nonzero(inside)))


def roughness_steps(frame: Frame) -> float:
    """Standard deviation, in disparity steps, of the white noise that has the second differences along the rows.

    White noise of standard deviation s has second differences of sqrt(6) s.
    """
    steps = np.divide(STEPS_PER_M, frame.depth_m, out=np.full(frame.depth_m.shape, np.nan), where=frame.depth_m > 0)
    left, middle, right = steps[:, :-2], steps[:, 1:-1], steps[:, 2:]
    with np.errstate(invalid="ignore"):
        smooth = (np.abs(left - middle) < SAME_SURFACE_STEPS) & (np.abs(right - middle) < SAME_SURFACE_STEPS)
    second = (left - 2 * middle + right)[smooth]
    return float(np.sqrt(np.mean(second**2) / 6)) if len(second) else np.nan


def ridge_share(frame: Frame) -> float:
    """Share of the silhouette whose ridge probability exceeds 0.5."""
    ridge = ridge_probability(frame.depth_m, RidgeConfig()) > 0.5
    return float(np.count_nonzero(ridge) / np.count_nonzero(frame.depth_m))


def joint_depth_cm(frame: Frame, joints: tuple[Joint, ...]) -> float:
    """Mean depth of joints behind the surface at their pixels; joints at pixels without a measurement are left out."""
    joints_m = frame.joints_camera_m[list(joints)]
    surface_m = at_joints(frame.depth_m, joints_m, frame.camera)
    measured = surface_m > 0
    return 100 * float(np.mean((joints_m[:, 2] - surface_m)[measured])) if measured.any() else np.nan


# Measures of any frame with a person, and of upright people whom the border does not cut. Of a bool the share is told.
OF_FRAMES: dict[str, Callable[[Frame], float | bool]] = {
    "distance of the person, m": lambda frame: frame.distance_m,
    "share of silhouettes cut by the border": lambda frame: frame.is_cut,
    "holes, share of the silhouette": hole_share,
    "roughness of surfaces, steps": roughness_steps,
    "ridge, share of the silhouette": ridge_share,
}
OF_UPRIGHT: dict[str, Callable[[Frame], float]] = {
    "area / height^2": lambda frame: np.count_nonzero(frame.body) / frame.height_px**2,
    "width of both shins / height": shins_width,
    "width of both thighs / height": lambda f: float(f.body[f.rows(THIGH_ROWS)].sum(axis=1).mean()) / f.height_px,
    "width of both feet, cm": feet_width_cm,
    "outline^2 / area": lambda frame: outline_px(frame.body) ** 2 / np.count_nonzero(frame.body),
    "outline / smoothed outline": lambda f: outline_px(f.body) / outline_px(cv2.medianBlur(f.body.astype(np.uint8), 7)),
}
BEHIND = {f"{name} behind the surface, cm": partial(joint_depth_cm, joints=joints) for name, joints in JOINT_GROUPS.items()}


def is_standing(joints_camera_m: np.ndarray) -> np.ndarray:
    """(N,) bool of (N, 15, 3) joints in metres: trunk upright, both legs straight and down, feet at one height.

    The vertical is that of the image: the cameras look nearly level. A missing joint (NaN) makes it false.
    """
    joints = np.asarray(joints_camera_m, np.float64)
    hips_m = joints[:, [Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=1)
    down = np.broadcast_to((0.0, 1.0, 0.0), hips_m.shape)
    chosen = angle_deg(hips_m - joints[:, Joint.NECK], down) <= UPRIGHT_DEG
    for side in ("RIGHT", "LEFT"):
        hip, knee, foot = (joints[:, Joint[f"{side}_{part}"]] for part in ("HIP", "KNEE", "FOOT"))
        chosen &= (angle_deg(knee - hip, foot - knee) <= STRAIGHT_DEG) & (angle_deg(foot - hip, down) <= LEG_DEG)
    return chosen & (np.abs(joints[:, Joint.RIGHT_FOOT, 1] - joints[:, Joint.LEFT_FOOT, 1]) <= LEVEL_FEET_M)


def is_upright(joints_camera_m: np.ndarray) -> np.ndarray:
    """(N,) bool: standing, shoulders parallel to the image, both hands below the head: the silhouette's height is theirs."""
    joints = np.asarray(joints_camera_m, np.float64)
    across = joints[:, Joint.LEFT_SHOULDER] - joints[:, Joint.RIGHT_SHOULDER]
    turn_deg = np.degrees(np.arctan2(np.abs(across[:, 2]), np.abs(across[:, 0])))
    below = (joints[:, [Joint.RIGHT_HAND, Joint.LEFT_HAND], 1] > joints[:, Joint.HEAD, 1, None]).all(axis=1)
    return is_standing(joints) & (turn_deg <= FACING_DEG) & below


def angle_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N,) angles between (N, 3) vectors; NaN where one is missing or has no length."""
    with np.errstate(invalid="ignore"):
        cosine = (a * b).sum(axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
        return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def temporal_noise(depth_m: np.ndarray) -> tuple[float, float] | None:
    """Variance, squared disparity steps, of the differences of successive frames at still pixels, and their correlation at a
    distance of one pixel along the rows; None with fewer than 500 differences.

    A pixel is still in a pair of frames if the means of the WINDOW frames before and after agree to STILL_STEPS, those of the
    pair and of the frames around to PASSING_STEPS, and those of its four neighbours to FLAT_STEPS: none of them depends on
    the difference of the pair. People sway, so on people this is an upper bound of the sensor's noise. `depth_m` is (T, H, W)
    of a static camera, 0 where nothing was measured.
    """
    differences, products = [np.empty(0)], [np.empty(0)]
    for first in range(0, len(depth_m) - 2 * WINDOW - 1, WINDOW):
        frames = depth_m[first : first + 2 * WINDOW + 2]
        measured = np.logical_and(frames > NOISE_AT_M[0], frames < NOISE_AT_M[1]).min(axis=0)
        steps = STEPS_PER_M / np.where(measured, frames, 1).astype(np.float64)
        before, after = steps[:WINDOW].mean(axis=0), steps[-WINDOW:].mean(axis=0)
        around, pair = (before + after) / 2, (steps[WINDOW] + steps[WINDOW + 1]) / 2
        still = measured & (np.abs(before - after) < STILL_STEPS) & (np.abs(pair - around) < PASSING_STEPS)
        flat = np.zeros(still.shape, bool)
        middle = np.s_[1:-1, 1:-1]
        flat[middle] = True
        for beside in (np.s_[:-2, 1:-1], np.s_[2:, 1:-1], np.s_[1:-1, :-2], np.s_[1:-1, 2:]):
            flat[middle] &= measured[beside] & (np.abs(around[beside] - around[middle]) < FLAT_STEPS)
        still &= flat
        change = steps[WINDOW + 1] - steps[WINDOW]
        differences.append(change[still])
        products.append((change[:, 1:] * change[:, :-1])[still[:, 1:] & still[:, :-1]])
    changes, pairs = np.concatenate(differences), np.concatenate(products)
    if len(changes) < 500 or not len(pairs) or not changes.any():
        return None
    variance = float(np.mean(changes**2))
    return variance, float(pairs.mean()) / variance


@dataclass
class Source:
    """Data of one origin: random frames, random frames of upright people, all (N, 15, 3) joints, noise of each sequence."""

    name: str
    frames: list[Frame] = field(default_factory=list)
    upright: list[Frame] = field(default_factory=list)
    joints_m: np.ndarray = field(default_factory=lambda: np.empty((0, NUM_JOINTS, 3)))
    noise: list[tuple[float, float]] = field(default_factory=list)

    def values(self) -> dict[str, np.ndarray]:
        """Values of every statistic by its name, bool or float64, without those that are not defined."""
        standing = self.joints_m[is_standing(self.joints_m)]
        feet_cm = 100 * np.linalg.norm(standing[:, Joint.RIGHT_FOOT] - standing[:, Joint.LEFT_FOOT], axis=-1)
        people = [frame for frame in self.frames if frame.depth_m.any()]
        whole = [frame for frame in self.upright if frame.body is not None]
        found = {name: np.array([measure(frame) for frame in people]) for name, measure in OF_FRAMES.items()}
        found |= {f"upright: {name}": np.array([measure(frame) for frame in whole]) for name, measure in OF_UPRIGHT.items()}
        found |= {f"upright: {name}": np.array([measure(frame) for frame in self.upright]) for name, measure in BEHIND.items()}
        found |= {"standing: distance of the feet, cm": feet_cm, "standing: share of feet closer than 20 cm": feet_cm < 20}
        found["still pixels: variance of frame differences, steps^2"] = np.array([variance for variance, _ in self.noise])
        found["still pixels: correlation of frame differences at 1 px"] = np.array([one for _, one in self.noise])
        kept = {name: values[np.isfinite(values)] for name, values in found.items()}
        return {name: values if values.dtype == bool else values.astype(float) for name, values in kept.items()}


def read_real(path: Path, count: int, seed: int) -> Source:
    """A folder of UTD-MHAD, a folder of ITOP, or an .npz file with ITOP's joints as `side_m` (N, 15, 3); else an InputError."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as file:
            return Source("ITOP", joints_m=file["side_m"] * FROM_ITOP)
    if any(path.glob("ITOP_side_test_labels.h5*")):
        labels = ItopBenchmark(ItopConfig(path=str(path)))
        return Source("ITOP", joints_m=labels.joints_camera_m[labels.valid])
    if not any(path.glob("Depth/*_depth.mat")):
        raise InputError(f"--real {path}: expected a folder of UTD-MHAD (Depth/ and Skeleton/) or of ITOP (side view, test)")
    settings, reader = BENCHMARKS["utd_mhad"]
    benchmark = reader(settings(path=str(path), lag=USUAL_LAG))
    names, source, joints = evenly_spaced(benchmark.sequence_names(), MOST_SEQUENCES), Source("UTD-MHAD"), []
    for number, name in enumerate(tqdm(names, "real", unit="sequence", disable=None)):
        rng, sequence = np.random.default_rng([seed, number]), benchmark.read(name)
        joints.append(sequence.joints_camera_m)
        with_person, upright = sequence.depth_m.any(axis=(1, 2)), is_upright(sequence.joints_camera_m)
        for frames, eligible in ((source.frames, with_person), (source.upright, upright)):
            for row in sorted(rng.permutation(np.flatnonzero(eligible))[: -(-count // len(names))].tolist()):
                frames.append(Frame(f"{name} {row}", sequence.depth_m[row].copy(), sequence.camera, joints[-1][row]))
        if (noise := temporal_noise(sequence.depth_m)) is not None:
            source.noise.append(noise)
    source.joints_m = np.concatenate(joints)
    return source


def read_generated(path: Path, sensor: str, count: int, seed: int) -> tuple[Source, ShardedSet]:
    """Samples of a folder of shards, or of the split `train` in it, measured and segmented as in training."""
    shards = ShardedSet(path if any(path.glob("shard_*.h5")) or not (path / "train").is_dir() else path / "train")
    observer, camera = Observer(shards, SENSORS[sensor], ExtractionConfig(), seed=seed), shards.camera
    source = Source("synthetic", joints_m=shards.column("joints_m"))
    eligible = {"frames": np.arange(len(shards)), "upright": np.flatnonzero(is_upright(source.joints_m))}
    for stream, (kind, indices) in enumerate(eligible.items()):
        for index in tqdm(
            np.sort(np.random.default_rng([seed, stream]).permutation(indices)[:count]).tolist(), kind, disable=None
        ):
            seen = observer.observe(index, 0)
            x0, y0 = round(camera.cx - seen.camera.cx), round(camera.cy - seen.camera.cy)
            depth_m = np.zeros((camera.height, camera.width), np.float32)
            depth_m[y0 : y0 + seen.camera.height, x0 : x0 + seen.camera.width] = seen.depth_m
            getattr(source, kind).append(Frame(f"sample {index}", depth_m, camera, seen.joints_camera_m))
    return source, shards


def read_film_noise(folder: Path) -> list[tuple[float, float]]:
    """Temporal noise of sequences of a simulated EVAL."""
    settings, reader = BENCHMARKS["eval_sim"]
    benchmark = reader(settings(name="eval_sim", path=str(folder)))
    names = evenly_spaced(benchmark.sequence_names(), MOST_FILMS)
    found = [temporal_noise(benchmark.read(name).depth_m) for name in tqdm(names, "film", unit="sequence", disable=None)]
    return [noise for noise in found if noise is not None]


def summary(values: np.ndarray) -> list[float]:
    """Median, quartiles and number of values, of bool values the share with its 95 % interval, as of independent ones; empty
    without values.
    """
    count = len(values)
    if not count:
        return []
    if values.dtype != bool:
        return [*np.percentile(values, (50, 25, 75)).tolist(), count]
    return [float(np.mean(values)), *wilson_interval(int(np.sum(values)), count), count]


def compare(real: dict[str, dict[str, np.ndarray]], synthetic: dict[str, np.ndarray]) -> list[dict]:
    """A line for each statistic and each real set that knows it: values by statistic, those of real sets by set too."""
    lines = []
    for name, values in synthetic.items():
        ours = summary(values)
        known = {origin: summary(theirs[name]) for origin, theirs in real.items() if len(theirs[name])}
        for origin, theirs in (known or {"": []}).items():
            gap = (ours[0] - theirs[0]) / max(theirs[2] - theirs[1], 1e-9) if ours and theirs else None
            if ours or theirs:
                lines.append({"statistic": name, "set": origin, "real": theirs, "synthetic": ours, "gap": gap})
    return lines


def as_text(lines: list[dict]) -> str:
    """The table for people, with how many generated medians lie within the real quartiles."""
    shown = lambda one: f"{one[0]:.3g} [{one[1]:.3g}, {one[2]:.3g}] {one[3]}" if one else "-"  # noqa: E731
    rows = [("statistic", "real set", "real: median [quartiles] n", "synthetic: median [quartiles] n", "gap")]
    for line in lines:
        gap = "-" if line["gap"] is None else f"{line['gap']:+.1f}"
        rows.append((line["statistic"], line["set"] or "-", shown(line["real"]), shown(line["synthetic"]), gap))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    text = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    both = [line for line in lines if line["gap"] is not None]
    inside = sum(line["real"][1] <= line["synthetic"][0] <= line["real"][2] for line in both)
    return "\n".join([*text, "", f"{inside} of {len(both)} generated medians inside the real quartiles"])


def tile(frame: Frame) -> np.ndarray:
    """The person as a square image, TILE_M wide at their median distance, with the frame's name."""
    if not frame.depth_m.any():
        return with_captions(np.full((TILE_PX, TILE_PX, 3), BACKGROUND, np.uint8), (frame.name,))
    rows, columns = np.nonzero(frame.depth_m)
    scale = TILE_PX * frame.distance_m / (TILE_M * frame.camera.fx)
    u, v, shift = (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2, (TILE_PX - 1) / 2
    placed = np.array([[scale, 0, shift - scale * u], [0, scale, shift - scale * v]])
    size, flags = (TILE_PX, TILE_PX), cv2.INTER_NEAREST
    image = cv2.warpAffine(depth_rgb(frame.depth_m), placed, size, flags=flags, borderValue=BACKGROUND)
    return with_captions(image, (frame.name,))


def comparison_sheet(sources: list[Source], seed: int) -> np.ndarray:
    """RGB image of random frames: upright people above, all poses below; a set's frames beside each other."""
    rng, rows = np.random.default_rng([seed, 2]), []
    for kind in ("upright", "frames"):
        chosen = [[getattr(one, kind)[k] for k in rng.permutation(len(getattr(one, kind)))] for one in sources]
        for row in range(ROWS):
            if tiles := [tile(frame) for frames in chosen for frame in frames[row * COLUMNS : (row + 1) * COLUMNS]]:
                rows.append(("", tiles))
    names = " | ".join(f"{one.name}, {'generated' if one.name == 'synthetic' else 'real'}" for one in sources)
    return sheet(rows, (), f"from left to right: {names}. Every tile is {TILE_M} m wide at the person")


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, action="append", default=[], metavar="PATH", help="UTD-MHAD or ITOP; repeatable")
    parser.add_argument("--synthetic", type=Path, required=True, metavar="FOLDER", help="shards, or out= of python -m synth")
    parser.add_argument("--film", type=Path, metavar="FOLDER", help="simulated EVAL, for the noise in time")
    parser.add_argument("--out", type=Path, default=Path("outputs/realism"), metavar="FOLDER", help="default: %(default)s")
    parser.add_argument("--frames", type=int, default=300, help="frames of each kind and origin; default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="of the choice of frames and of the sensor's noise; default: 0")
    parser.add_argument("--sensor", choices=sorted(SENSORS), default="kinect_v1", help="measures clean shards")
    given = parser.parse_args()
    check_between("--frames", given.frames, 1, 1e6)
    check_seed("--seed", given.seed)
    synthetic, shards = read_generated(given.synthetic, given.sensor, given.frames, given.seed)
    real = [read_real(path, given.frames, given.seed) for path in given.real]
    synthetic.noise = read_film_noise(given.film) if given.film else []
    lines = compare({source.name: source.values() for source in real}, synthetic.values())
    given.out.mkdir(parents=True, exist_ok=True)
    text, header = as_text(lines), shards.header
    settings = {name: str(value) for name, value in vars(given).items()} | {"hash": header.config_hash, "split": header.split}
    (given.out / "realism.txt").write_text(text + "\n")
    (given.out / "realism.json").write_text(json.dumps({"settings": settings, "lines": lines}, indent=1) + "\n")
    save_png(given.out / "realism.png", comparison_sheet([*(one for one in real if one.frames), synthetic], given.seed))
    print(f"{text}\nwritten to {given.out}: realism.txt, realism.json, realism.png")


if __name__ == "__main__":
    main()
