"""How long it takes to find a person in a depth image of a furnished room."""

import time

import cv2
import numpy as np

from kpopnet.extraction import HumanExtractor
from synth.simulated.eval_sim import CAMERA, EvalSim, EvalSimConfig, EvalSimSet

FRAMES, ROUNDS, SETTLED = 200, 7, 30


def measure() -> dict[str, tuple[float, str, str]]:
    """Whole 320x240 frames of a dance through a simulated Kinect v1, one core; once the room has been learned."""
    film = EvalSim(EvalSimSet(EvalSimConfig())).film(0, frames=FRAMES)
    mask = film.person[0].astype(np.uint8)
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    frames_ms, transforms_ms = np.empty((ROUNDS, FRAMES)), np.empty((ROUNDS, FRAMES))
    for times_ms, transform_ms in zip(frames_ms, transforms_ms, strict=True):
        extractor = HumanExtractor(CAMERA, expect_person=True)
        for t, depth_m in enumerate(film.depth_m):
            started = time.perf_counter()
            extractor.extract(depth_m)
            times_ms[t] = 1000 * (time.perf_counter() - started)
            started = time.perf_counter()
            cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_5)
            transform_ms[t] = 1000 * (time.perf_counter() - started)
    cv2.setNumThreads(threads)
    # A busy machine makes single rounds slow, never fast.
    settled_ms = frames_ms.min(axis=0)[SETTLED:]
    times = np.median(settled_ms) / np.median(transforms_ms.min(axis=0))
    against = (
        f"median; 95 % within {np.percentile(settled_ms, 95):.2f}, first image {frames_ms[:, 0].min():.1f}; "
        f"{times:.1f} times cv2.distanceTransform of the person's mask"
    )
    return {"extraction.frame_ms": (np.median(settled_ms), "ms a frame", against)}
