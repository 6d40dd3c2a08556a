"""How fast a person is followed: extraction and tracking of whole frames, on one core."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import fmean

import cv2
import numpy as np

from kpopnet.extraction import HumanExtractor
from kpopnet.tracker import tracker
from kpopnet.tracker.tracker import Tracker
from synth.simulated.eval_sim import EvalSim, EvalSimConfig, EvalSimSet
from synth.simulated.film import Film

FRAMES = 240
SEQUENCES = (0, 1, 2)  # one of each subject: a dance, crossed punches, kicks
STAGES = {
    "grid": ((tracker, "build_depth_grid"),),
    "fit": ((tracker, "fit"), (tracker, "pose_cost")),
    "limbs": ((tracker, "refit_limbs"),),
}
"""Functions and who calls them, by what they are a part of; the rest of a frame is small."""


def measure() -> dict[str, tuple[float, str, str]]:
    """Processor time of one core over frames of `eval_sim` at 320x240, from the raw image to the joints."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    simulator = EvalSim(EvalSimSet(EvalSimConfig(seed=21)))
    films = [simulator.film(index, FRAMES) for index in SEQUENCES]
    frames_ms, transforms_ms, stages_ms = [], [], defaultdict(list)
    _follow(films[0], lambda extraction_ms: None)  # compiles
    for film in films:
        for frame_ms, transform_ms in _follow(film, lambda extraction_ms: None):
            frames_ms.append(frame_ms)
            transforms_ms.append(transform_ms)
    # The stages in a second pass: reading the processor's time around every call costs 3 % of a frame.
    with _timed(stages_ms) as begin_frame:
        for film in films:
            _follow(film, begin_frame)
    cv2.setNumThreads(threads)
    median, late = np.median(frames_ms), np.percentile(frames_ms, 95)
    figures = {
        "tracker.fps": (
            1000 / median,
            "frames/core-second",
            f"median of {len(frames_ms)} whole frames, {1000 / late:.0f} at the 95th percentile; "
            f"{1000 / fmean(frames_ms):.0f} on average",
        ),
        "tracker.vs_distance_transform": (
            median / np.median(transforms_ms),
            "times",
            "cv2.distanceTransform(DIST_L2, 5) of the whole 320x240 frame, in the same run",
        ),
    }
    for stage in ("extraction", *STAGES):
        times = stages_ms[stage]
        against = f"median of a frame; {np.percentile(times, 95):.2f} at the 95th percentile, {fmean(times):.2f} on average"
        figures[f"tracker.{stage}_ms"] = (float(np.median(times)), "ms a frame", against)
    return figures


def _follow(film: Film, begin_frame: Callable[[float], None]) -> list[tuple[float, float]]:
    """Milliseconds of every frame, and of a distance transform of it."""
    extractor = HumanExtractor(film.camera, expect_person=True)
    person = Tracker(film.camera)
    person.start(film.joints_camera_m[0])
    times = []
    for depth_m in film.depth_m:
        measured = (depth_m > 0).astype(np.uint8)
        start = time.process_time()
        humans = extractor.extract(depth_m)
        extracted = time.process_time()
        begin_frame(1000 * (extracted - start))
        if humans:
            person.track(humans[0].whole(film.camera))
        tracked = time.process_time()
        cv2.distanceTransform(measured, cv2.DIST_L2, cv2.DIST_MASK_5)
        times.append((1000 * (tracked - start), 1000 * (time.process_time() - tracked)))
    return times


@contextmanager
def _timed(stages_ms: dict[str, list[float]]) -> Iterator[Callable[[float], None]]:
    """Adds up what the stages take in each frame; a frame begins with what its extraction took."""
    originals = {place: getattr(*place) for places in STAGES.values() for place in places}

    def begin_frame(extraction_ms: float) -> None:
        stages_ms["extraction"].append(extraction_ms)
        for stage in STAGES:
            stages_ms[stage].append(0.0)

    def timed(stage: str, function: Callable) -> Callable:
        def call(*args, **kwargs):
            start = time.process_time()
            result = function(*args, **kwargs)
            stages_ms[stage][-1] += 1000 * (time.process_time() - start)
            return result

        return call

    for stage, places in STAGES.items():
        for place in places:
            setattr(*place, timed(stage, originals[place]))
    try:
        yield begin_frame
    finally:
        for place, function in originals.items():
            setattr(*place, function)
