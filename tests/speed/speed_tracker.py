"""How fast a person is found and followed: extraction and tracking of whole 320x240 frames, on one core."""

import time
from types import SimpleNamespace

import cv2
import numpy as np
from stand_ins import film_of

from kpopnet.finder.finder import PersonFinder
from kpopnet.paper_extraction import PaperExtractor
from kpopnet.tracker.tracker import Tracker
from synth.simulated.stand_ins import EvalSim, EvalSimConfig
from tests.speed.common import Figures, one_core, timed

FRAMES = 240
SEQUENCES = (0, 1, 2)  # one of each subject: a dance, crossed punches, kicks
EXTRACTED, ROUNDS, SETTLED = 200, 7, 30


def measure() -> Figures:
    """Frames of `eval_sim`."""
    simulator = EvalSim(EvalSimConfig(seed=21))
    films = [film_of(simulator, index, FRAMES) for index in SEQUENCES]
    with one_core():
        _follow(films[0])  # compiles
        frames_ms, transforms_ms = np.concatenate([_follow(film) for film in films]).T
        figures = _extraction()
    middle, late = np.percentile(frames_ms, (50, 95))
    against = f"median of {len(frames_ms)} whole frames, {1000 / late:.0f} at the 95th percentile"
    transform = "cv2.distanceTransform(DIST_L2, 5) of the whole 320x240 frame, in the same run"
    return figures | {
        "tracker.fps": (1000 / middle, "frames/core-second", f"{against}; {1000 / frames_ms.mean():.0f} on average"),
        "tracker.vs_distance_transform": (middle / np.median(transforms_ms), "times", transform),
    }


def _follow(film: SimpleNamespace) -> list[tuple[float, float]]:
    """Milliseconds of every frame, from the raw image to the joints, and of a distance transform of it."""
    extractor, person = PersonFinder(film.camera), Tracker(film.camera)
    person.start(film.joints_camera_m[0])

    def follow(depth_m: np.ndarray) -> None:
        if humans := extractor.extract(depth_m):
            person.track(humans[0].whole(film.camera))

    times_ms = []
    for depth_m in film.depth_m:
        measured = (depth_m > 0).astype(np.uint8)
        transform = cv2.distanceTransform, measured, cv2.DIST_L2, cv2.DIST_MASK_5
        times_ms.append((timed(follow, depth_m)[0], timed(*transform)[0]))
    return times_ms


def _extraction() -> Figures:
    """Finding a person in a furnished room: by the finder and by Algorithm 1."""
    film = film_of(EvalSim(EvalSimConfig()), 0, EXTRACTED)
    figures: Figures = {}
    for name in ("finder", "paper_extraction"):
        frames_ms = np.empty((ROUNDS, EXTRACTED))
        for times_ms in frames_ms:
            extractor = PersonFinder(film.camera) if name == "finder" else PaperExtractor(film.camera)
            times_ms[:] = [timed(extractor.extract, depth_m, clock=time.perf_counter)[0] for depth_m in film.depth_m]
        # A busy machine makes single rounds slow, never fast.
        middle, late = np.percentile(frames_ms.min(axis=0)[SETTLED:], (50, 95))
        against = f"median; 95 % within {late:.2f}, first image {frames_ms[:, 0].min():.1f}"
        figures[f"{name}.frame_ms"] = (middle, "ms a frame", against)
    return figures
