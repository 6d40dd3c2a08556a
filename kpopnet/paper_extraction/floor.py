"""Floor removal (Eq. 1 and the first part of Algorithm 1).

Choices where the paper is silent or wrong:

- d in Eq. (1) is X A of the normal A before, so its least squares give that A again. Here all candidates of the floor have the
  same distance: X_f A = -1, whose solution is A = n / d for the plane n.x + d = 0 with the unit normal n, upwards.
- Each row is divided by its depth: a triangulating camera measures 1/z equally well at all distances.
- "Until X_f is changed" must read "until X_f no longer changes".
- X_f takes everything below the plane, wrong measurements too. The fit uses the points within delta_f on both sides of it.
- A_0 and d_0 are the plane of the image before. Without one, A_0 is the upward direction of a camera of each of `PITCHES_RAD`
  and d_0 the height of its lowest points; the plane with the most points on it and hardly any below is the floor.
"""

import numpy as np

from kpopnet.camera import Camera

PITCHES_RAD = np.radians(np.arange(-30.0, 61.0, 15.0))
"""Tried pitches of the camera, positive downwards."""

SAMPLES = 1000
"""Approximate number of pixels in a fit, on a regular grid."""

FIRST_BAND_M = 0.1
"""delta_f of the fit to the lowest points."""

MAX_ITERATIONS = 20

MIN_SHARE, MAX_SHARE_BELOW = 0.02, 0.02
"""Smallest share of the sampled pixels on the floor, and largest share of the measured ones below it."""

MIN_UP = 0.5
"""Smallest component of the floor's normal along the image's upward axis: 60 degrees."""

MIN_CAMERA_HEIGHT_M = 0.2


def find_floor(depth_m: np.ndarray, camera: Camera, delta_f_m: float, before: np.ndarray | None) -> np.ndarray | None:
    """The floor in an (H, W) image in metres.

    Args:
        depth_m: the image, 0 where nothing was measured.
        camera: its camera.
        delta_f_m: points less than this above the floor are floor, metres.
        before: the floor in the image before, None if there is none.

    Returns:
        (4,) unit normal n, upwards, and d with n.x + d = 0 on the floor, camera frame, metres; None if no floor is in view.
    """
    stride = max(1, round((depth_m.size / SAMPLES) ** 0.5))
    v, u = np.mgrid[0 : camera.height : stride, 0 : camera.width : stride]
    z = depth_m[::stride, ::stride].astype(np.float64)
    measured = z > 0
    points = camera.back_project(np.stack([u, v, z], axis=-1)[measured])
    if len(points) < MIN_SHARE * z.size:
        return None
    if before is not None and _num_on_floor(fitted := fit_floor(points, before, delta_f_m), points, delta_f_m, z.size):
        return fitted
    planes = []
    for pitch in PITCHES_RAD:
        normal = np.array([0.0, -np.cos(pitch), -np.sin(pitch)])
        # "the depth data that have the smallest y"; the lowest 1 % are skipped as wrong measurements
        lowest = np.append(normal, -np.quantile(points @ normal, 0.01))
        planes.append(fit_floor(points, fit_floor(points, lowest, FIRST_BAND_M), delta_f_m))
    counts = [_num_on_floor(plane, points, delta_f_m, z.size) for plane in planes]
    return planes[int(np.argmax(counts))] if any(counts) else None


def fit_floor(points: np.ndarray, plane: np.ndarray | None, delta_f_m: float) -> np.ndarray | None:
    """The loop of Algorithm 1: least squares over the points near the plane, until these no longer change.

    Args:
        points: (N, 3) metres, camera frame, in front of the camera.
        plane: (4,) A_0, d_0 as `find_floor` returns them, or None.
        delta_f_m: see `find_floor`.

    Returns:
        (4,) the fitted plane; None if the points near it lie on a line.
    """
    floor = None
    for _ in range(MAX_ITERATIONS):
        if plane is None:
            return None
        # X_f = {X_n : X_n A - d < delta_f}
        floor, before = np.abs(points @ plane[:3] + plane[3]) < delta_f_m, floor
        if before is not None and np.array_equal(floor, before):
            break
        # Eq. (1): A = (X_f^T X_f)^-1 X_f^T d, with rows X / z and d = -1 / z
        rows = points[floor] / points[floor, 2:]
        squares = rows.T @ rows
        if len(rows) < 3 or np.linalg.cond(squares) > 1e9:
            return None
        normal = np.linalg.solve(squares, rows.T @ (-1 / points[floor, 2]))
        plane = np.append(normal, 1) / np.linalg.norm(normal)
    return plane


def remove_floor(depth_m: np.ndarray, camera: Camera, plane: np.ndarray, delta_f_m: float) -> np.ndarray:
    """(H, W) float32 metres: the image with 0 where a point is less than delta_f_m above the plane, X without X_f."""
    a, b, c, d = plane.astype(np.float32)
    x, y = (np.arange(camera.width, dtype=np.float32) - camera.cx) / camera.fx, np.arange(camera.height, dtype=np.float32)
    slope = (a * x + c)[None] + (b * (y - camera.cy) / camera.fy)[:, None]
    return np.where(depth_m * slope + d < delta_f_m, np.float32(0), depth_m)


def _num_on_floor(plane: np.ndarray | None, points: np.ndarray, delta_f_m: float, num_samples: int) -> int:
    """Number of points on a plane; 0 if it cannot be the floor."""
    if plane is None or not (-plane[1] > MIN_UP and plane[3] > MIN_CAMERA_HEIGHT_M):
        return 0
    height_m = points @ plane[:3] + plane[3]
    on_floor = int(np.count_nonzero(np.abs(height_m) < delta_f_m))
    below = np.count_nonzero(height_m < -2 * delta_f_m)
    return on_floor if on_floor > MIN_SHARE * num_samples and below <= MAX_SHARE_BELOW * len(points) else 0
