"""How fast the random tree walk is; its authors claim over 1,000 frames a second on one core."""

import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from kpopnet.baselines.tree_walk.model import TreeWalkEstimator, TreeWalkEstimatorConfig
from kpopnet.baselines.tree_walk.training import TreeWalkConfig, train
from kpopnet.baselines.tree_walk.walking import integer_image
from kpopnet.data.cube import Cube, crop, person_centre
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SensorConfig
from tests.speed.generated import generated_set

SAMPLES, ROUNDS = 200, 5
CONFIG = TreeWalkConfig(images=2000, places=50, leaf_samples=10, features=20, validation_images=50)
"""Small leaves and many places: trees of few images get as large as those of many, which do not fit the caches."""


def measure() -> dict[str, tuple[float, str, str]]:
    """Whole estimates of people alone in 320x240 frames, by the processor's clock of one core."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        shards = generated_set(Path(folder, "set"), SAMPLES)
        people = Observer(shards, SensorConfig(), ExtractionConfig(), seed=0)
        train(CONFIG, people, people, seed=0, workers=0)[0].save(Path(folder, "model"), {})
        estimator = TreeWalkEstimator(TreeWalkEstimatorConfig(str(Path(folder, "model"))))
        depth_m = np.stack([shards[index].depth_mm for index in range(SAMPLES)]).astype(np.float32) / 1000
    model, camera = estimator.model, shards.camera
    cubes = [Cube(person_centre(image, camera), model.half_size_m) for image in depth_m]
    crops = [integer_image(crop(image, camera, cube, model.crop_px)[0]) for image, cube in zip(depth_m, cubes, strict=True)]
    whole_s, walks_s = [], []
    for _ in range(ROUNDS):
        start = time.process_time()
        estimator.estimate(depth_m, camera)
        whole_s.append(time.process_time() - start)
        start = time.process_time()
        for number, crop_image in enumerate(crops):
            model.run_walks(crop_image, number)
        walks_s.append(time.process_time() - start)
    cv2.setNumThreads(threads)
    nodes = len(model.trees.child)
    against = f"at least 1,000 claimed; {nodes:,} nodes; the walks alone {SAMPLES / min(walks_s[1:]):.0f} frames/s"
    return {"tree_walk.fps": (SAMPLES / min(whole_s[1:]), "frames/s, one core", against)}
