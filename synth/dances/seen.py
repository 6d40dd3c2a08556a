"""What an estimator is off of all who dance the same: simulated people dance a dance before a camera.

An estimator's errors depend on the pose as much as on the person: of the squared error that a network makes of a perfect
dancer nearly half is the same for all who dance the same (docs/ledger.md). A learner who is compared with the teacher's true
joints loses points by all of it; compared with these joints and what is common of the errors, by the rest.
"""

from collections.abc import Callable, Iterator

import numpy as np

from kpopnet.camera import CAMERAS, Camera
from kpopnet.dance.noise.table import SEEN_PEOPLE
from kpopnet.estimator import Estimator
from kpopnet.skeleton import Joint
from synth.body.shape import BodyConfig, Person, draw_person
from synth.dances.live import motion_of, placed
from synth.dances.simulate import connected
from synth.motion.skeleton import Motion
from synth.samples.layers import silhouette_box, widened
from synth.samples.observe import MARGIN_PX
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS
from synth.simulated.film import Studio, measure_frame

PEOPLE, FPS = 8, 10.0
"""People who dance, and images of each a second. What more of both are worth: docs/ledger.md."""

CAMERA, SENSOR = CAMERAS["kinect_v1"], SENSORS["kinect_v1"]


def common_errors_m(
    joints_m: np.ndarray,
    quats: np.ndarray,
    hips_m: np.ndarray,
    estimator: Estimator,
    times_s: np.ndarray,
    on_person: Callable[[], object] = lambda: None,
) -> np.ndarray:
    """(N, 15, 3) metres by which an estimator is off of a dance in the mean of PEOPLE people; the torso's are taken off all.

    Args:
        joints_m: (T, 15, 3) true joints of the dance at FPS frames a second, in a level camera's frame, metres; NaN: missing.
        quats: (T, B, 4) rotations of `synth`'s body in the dance, as in `kpopnet.teacher.posing.Movement`.
        hips_m: (T, 3) positions of its hips, metres.
        estimator: the estimator; one that goes by time has `fps`, images a second, which is set.
        times_s: (N,) seconds from the first frame at which the errors are wanted.
        on_person: called after each person.
    """
    if hasattr(estimator, "fps"):
        estimator.fps = FPS
    studio, motion, errors_m = Studio(CAMERA, "cpu"), motion_of(quats, hips_m, FPS), []
    for number in range(PEOPLE):
        person = draw_person(np.random.default_rng([number, 4]), BodyConfig(), SEEN_PEOPLE)
        depth_m, camera, true_m = _film(studio, person, motion, number)
        errors_m.append(carried_over(estimator.estimate(depth_m, camera).joints_camera_m - true_m, true_m, joints_m))
        on_person()
    common_m = _mean(np.array(errors_m), 0)[0]
    columns = common_m.reshape(len(common_m), -1).T
    between_m = np.stack([np.interp(times_s, np.arange(len(common_m)) / FPS, one) for one in columns], axis=1)
    return between_m.reshape(len(times_s), *common_m.shape[1:])


def carried_over(errors_m: np.ndarray, true_m: np.ndarray, joints_m: np.ndarray) -> np.ndarray:
    """(T, 15, 3) errors of one body's joints, for another body in the same poses, elsewhere before a camera.

    From the errors, the (T, 15, 3) true joints of the one, and those of the other, of which some may be NaN. The similarity
    that brings the ones nearest to the others (Umeyama 1991) turns and scales the errors too; the torso's is taken off all.
    """
    known = np.isfinite(joints_m).all(axis=2, keepdims=True)
    from_m, to_m = (np.where(known, one - _mean(np.where(known, one, np.nan), 1), 0) for one in (true_m, joints_m))
    left, stretch, right = np.linalg.svd(to_m.transpose(0, 2, 1) @ from_m)
    proper = np.sign(np.linalg.det(left @ right))
    left[:, :, 2] *= proper[:, None]
    stretch[:, 2] *= proper
    scale = stretch.sum(axis=1) / np.maximum(np.square(from_m).sum(axis=(1, 2)), 1e-9)
    relative_m = errors_m - errors_m[:, [Joint.TORSO]]
    return scale[:, None, None] * (relative_m @ (left @ right).transpose(0, 2, 1))


def _mean(values: np.ndarray, axis: int) -> np.ndarray:
    """The mean over an axis, which stays, of what is known; 0 where nothing is."""
    known = np.isfinite(values)
    return np.where(known, values, 0).sum(axis=axis, keepdims=True) / np.maximum(known.sum(axis=axis, keepdims=True), 1)


def _film(studio: Studio, person: Person, motion: Motion, seed: int) -> tuple[np.ndarray, Camera, np.ndarray]:
    """(T, h, w) measured depth of a dancing person alone, metres, the camera of these pixels, and (T, 15, 3) true joints."""
    images = list(_images(studio, person, motion, seed))
    boxes = np.array([box for box, _, _ in images])
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0).tolist(), boxes[:, 2:].max(axis=0).tolist()
    depth_m = np.zeros((len(images), y1 - y0, x1 - x0), np.float32)
    for whole, ((left, top, right, bottom), part_m, _) in zip(depth_m, images, strict=True):
        whole[top - y0 : bottom - y0, left - x0 : right - x0] = part_m
    return depth_m, CAMERA.cropped(x0, y0, x1 - x0, y1 - y0), np.array([true_m for _, _, true_m in images])


def _images(
    studio: Studio, person: Person, motion: Motion, seed: int
) -> Iterator[tuple[tuple[int, int, int, int], np.ndarray, np.ndarray]]:
    """Of each image the box around the person, x0, y0, x1, y1, the measured depth of the person in it, and the true joints."""
    take, noise = placed(studio, person, motion, np.random.default_rng([seed, 5])), FilmNoise((*b"seen", seed))
    for clean in studio.render(take, range(len(take))):
        depth_m, is_person = measure_frame(clean, CAMERA, SENSOR, noise)
        x0, y0, x1, y1 = widened(silhouette_box(clean.person_m), MARGIN_PX, CAMERA)
        near = slice(y0, y1), slice(x0, x1)
        part_m = connected(np.where(is_person[near], depth_m[near], np.float32(0)))
        yield (x0, y0, x1, y1), part_m, clean.joints_camera_m
