"""`room_images`: single images of scenes with the person that each pixel shows, on which the finder of people is trained.

Every image has a sensor of its own, and what real cameras lose besides: parts of dark clothes, patches that return nothing, and
surfaces that return noise.
"""

from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import ClassVar, NamedTuple

import cv2
import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.data.canvas import CANVAS
from kpopnet.data.room_images import FILES, FORMAT, MOST_PEOPLE, VERSION, RoomImages
from kpopnet.errors import check_between, check_one_of, check_seed
from kpopnet.runtime.atomic_write import atomic_hdf5
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.viz.drawing import depth_rgb, enlarged, sheet
from synth.body.shape import BodyConfig
from synth.motion import SPLITS, MixedPoses, MotionConfig
from synth.motion.poses import FAMILIES, ProceduralPoses
from synth.rooms.scene import ClearScene, RoomScenes
from synth.samples.layers import millimetres
from synth.samples.observe import LIMB_ENDS
from synth.samples.sampler import SampleConfig
from synth.sensor.model import SENSORS, measure_labelled
from synth.simulated.generator import SetGenerator

SENSOR_SHARES = {"kinect_v1": 0.4, "kinect_2": 0.25, "swissranger": 0.1, "ideal": 0.25}
DARK, PATCHED, NOISY = 0.1, 0.2, 0.1
"""Shares of the people whose clothes return little, of the images with patches that return nothing, and of the images in which
what returns nothing is filled with noise."""

POSES = {"poses": 0.6, "choreography": 0.4}
LOW, LOW_FAMILIES = 0.12, ("lie", "lie", "handstand", "sit", "all_fours")
"""Share of the people whose poses are of these families besides: people who lie look least like the others."""


@dataclass
class RoomImagesConfig:
    """Identity and size of the set.

    Attributes:
        name: name of the set.
        seed: of everything random.
        split: train, validation or test: they share no person.
        shards: number of files of 500 images.
        dances: number of dances of which single poses are taken. Each process that draws composes those it needs: 200 make
            50,000 images in half the time that 2,000 take.
        children: share of the people who are 6 to 12 years old; the others are adults.
    """

    name: str = "room_images"
    seed: int = 0
    split: str = "train"
    shards: int = 80
    dances: int = 2000
    children: float = 0.0

    def __post_init__(self) -> None:
        check_seed("benchmark.seed", self.seed)
        check_between("benchmark.shards", self.shards, 1, 1e5)
        check_between("benchmark.dances", self.dances, 1, 1e6)
        check_between("benchmark.children", self.children, 0, 1)
        check_one_of("benchmark.split", self.split, SPLITS)


class MeasuredScene(NamedTuple):
    """A scene as a sensor measures it: (H, W) uint16 depth, millimetres, and (H, W) uint8 person, 0 where there is none."""

    depth_mm: np.ndarray
    labels: np.ndarray


def measure_scene(rng: np.random.Generator, clear: ClearScene, shares: dict[str, float] = SENSOR_SHARES) -> MeasuredScene:
    """What one of several sensors, with such shares, measures of a scene."""
    sensor = SENSORS[rng.choice(list(shares), p=list(shares.values()))]
    ends_m = clear.joints_camera_m[:, LIMB_ENDS].reshape(-1, 3)
    depth_m, seen = measure_labelled(clear.depth_m, clear.labels + np.uint8(1), clear.camera, sensor, rng, ends_m)
    depth_m, labels = depth_m.copy(), np.where(seen > 0, seen - np.uint8(1), np.uint8(0)).astype(np.uint8)
    shape = depth_m.shape
    for person in range(1, len(clear.joints_camera_m) + 1):
        if rng.random() < DARK:
            depth_m[(labels == person) & (_clouds(rng, shape) < rng.uniform(0.1, 0.5))] = 0
    if rng.random() < PATCHED:
        for _ in range(rng.integers(1, 5)):
            patch = np.zeros(shape, np.uint8)
            centre = (rng.uniform(0, shape[1]), rng.uniform(0, shape[0]))
            axes = np.exp(rng.uniform(np.log(4), np.log(60), 2))
            cv2.ellipse(patch, (centre, tuple(axes), rng.uniform(0, 180)), 1, thickness=-1)
            depth_m[patch > 0] = 0
    if rng.random() < NOISY:
        lost = (depth_m == 0) & (rng.random(shape) < rng.uniform(0.02, 0.4))
        depth_m[lost] = rng.uniform(0.5, 8.0, np.count_nonzero(lost))
        labels[lost] = 0
    labels[depth_m == 0] = 0
    return MeasuredScene(millimetres(depth_m), labels)


def _clouds(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """(H, W) smooth random numbers, uniform in 0..1."""
    noise = cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), rng.uniform(1.5, 5.0))
    return np.argsort(np.argsort(noise, axis=None)).reshape(shape) / noise.size


@dataclass(frozen=True)
class SceneShards(SetGenerator):
    """Makes files of single scenes; a file is a pure function of the seed, the split and its number."""

    part: ClassVar[str] = "shard"
    per_shard: ClassVar[int] = 500  # scenes in a file
    composed_only = "people are in poses of all kinds; leave motion out"
    images_differ: ClassVar[bool] = True
    most_px: ClassVar[tuple[int, int]]  # most width and height of an image

    @cached_property
    def scenes(self) -> RoomScenes:
        body, motion = BodyConfig(children=self.benchmark.children), MotionConfig(weights=POSES, dances=self.benchmark.dances)
        sample = SampleConfig(body, motion, renderer="cpu")
        return RoomScenes(sample, self.benchmark.seed, self.benchmark.split, self.most_px)

    def measured(self, index: int, on_frame: Callable[[], None]) -> Iterator[tuple[ClearScene, MeasuredScene]]:
        """The scenes of file `index`, as they are drawn and as a sensor measures them."""
        for number in range(index * self.per_shard, (index + 1) * self.per_shard):
            clear = self.scenes.draw_scene(number)
            yield clear, measure_scene(self.scenes.sensor_rng(number), clear)
            on_frame()

    def frames_per_part(self) -> float:
        return self.per_shard

    def path(self, folder: Path, index: int) -> Path:
        return folder / self.finished_files.replace("*", f"{index:05d}")


@dataclass(frozen=True)
class RoomImagesSet(SceneShards):
    finished_files: ClassVar[str] = FILES
    unfinished_files: ClassVar[str] = ".images_*"
    camera: ClassVar[Camera] = Camera.centred(100, *CANVAS)  # each image has its own
    most_px = CANVAS

    benchmark: RoomImagesConfig = field(default_factory=RoomImagesConfig)

    @cached_property
    def scenes(self) -> RoomScenes:
        scenes = super().scenes
        low = ProceduralPoses({name: (float(LOW_FAMILIES.count(name)), FAMILIES[name][1]) for name in LOW_FAMILIES})
        scenes.source = MixedPoses([scenes.source, low], [1 - LOW, LOW])
        return scenes

    def manifest_entries(self) -> dict:
        return {"about": "SIMULATED depth images of rooms with people.", "images_per_shard": self.per_shard}

    def make(self, folder: Path, index: int, on_frame: Callable[[], None] = lambda: None) -> None:
        count, size = self.per_shard, (self.per_shard, CANVAS[1], CANVAS[0])
        arrays = {
            "depth_mm": np.zeros(size, np.uint16),
            "labels": np.zeros(size, np.uint8),
            "cameras": np.zeros((count, 6)),
            "joints_m": np.full((count, MOST_PEOPLE, NUM_JOINTS, 3), np.nan, np.float32),
            "whole_px": np.zeros((count, MOST_PEOPLE), np.float32),
        }
        for row, (clear, measured) in enumerate(self.measured(index, on_frame)):
            camera, people = clear.camera, len(clear.joints_camera_m)
            arrays["depth_mm"][row, : camera.height, : camera.width] = measured.depth_mm
            arrays["labels"][row, : camera.height, : camera.width] = measured.labels
            arrays["cameras"][row] = astuple(camera)
            arrays["joints_m"][row, :people], arrays["whole_px"][row, :people] = clear.joints_camera_m, clear.whole_px
        with atomic_hdf5(self.path(folder, index)) as file:
            file.attrs["format"], file.attrs["version"], file.attrs["simulated"] = FORMAT, VERSION, True
            for name, array in arrays.items():
                chunks = (1, *array.shape[1:]) if array.ndim == 3 else None
                file.create_dataset(name, data=array, chunks=chunks, compression=1, shuffle=True)

    def contact_sheet(self, folder: Path, manifest: dict) -> np.ndarray:
        images = RoomImages(folder)
        shown = [labelled_image(*images[k][:2]) for k in np.linspace(0, len(images) - 1, 40).astype(int).tolist()]
        rows = [("", [enlarged(one, 240) for one in shown[k : k + 8]]) for k in range(0, len(shown), 8)]
        return sheet(rows, (), f"SIMULATED rooms, {self.benchmark.split}, seed {manifest['seed']}: people in colours")


PERSON_COLOURS = np.array(
    [(0, 0, 0), (235, 60, 60), (70, 130, 255), (60, 190, 80), (240, 170, 30), (190, 90, 230), (40, 200, 210)]
)
"""RGB of persons 1 to 6."""


def labelled_image(depth_mm: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """RGB depth image with each person's pixels in a colour."""
    image, person = depth_rgb(depth_mm / np.float32(MM_PER_METRE)), labels > 0
    image[person] = (0.5 * image[person] + 0.5 * PERSON_COLOURS[labels[person]]).astype(np.uint8)
    return image
