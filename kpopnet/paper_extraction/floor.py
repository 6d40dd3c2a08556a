"""Floor removal (Eq. 1 and the first part of Algorithm 1).

Choices where the paper is silent or wrong:

- d in Eq. (1) is X A of the normal A before, so its least squares give that A again. Here all candidates of the floor have the
  same distance: X_f A = -1, whose solution is A = n / d for the plane n.x + d = 0 with the unit normal n, upwards.
- Each row is divided by its depth: a triangulating camera measures 1/z equally well at all distances.
- "Until X_f is changed" must read "until X_f no longer changes".
- X_f takes everything below the plane, wrong measurements too. The fit uses the points within delta_f on both sides of it.
- A_0 and d_0 are the plane of the image before. Without one, steps (1) and (2) of the text give them: the image's upward axis
  and the height of the lowest points. The first fit has a wider band: a tilted camera sees few points at that height.
"""

import numpy as np

from kpopnet.camera import Camera

SAMPLES = 1000
"""Approximate number of pixels in a fit, on a regular grid."""

FIRST_BAND_M = 0.1
"""delta_f of the fit to the lowest points."""

MAX_ITERATIONS = 20

MIN_SHARE = 0.02
"""Smallest share of the sampled pixels that lie on the floor."""

MIN_UP = 0.5
"""Smallest component of the floor's normal along the image's upward axis: 60 degrees."""


def find_floor(depth_m: np.ndarray, camera: Camera, delta_f_m: float, before: np.ndarray | None) -> np.ndarray | None:
    """(4,) unit normal n, upwards, and d with n.x + d = 0 on the floor, camera frame, metres; None if no floor is in view.

    From an (H, W) image in metres, 0 where nothing was measured. Points less than `delta_f_m` above the floor are floor;
    `before` is the floor in the image before, None if there is none.
    """
    stride = max(1, round((depth_m.size / SAMPLES) ** 0.5))
    v, u = np.mgrid[0 : camera.height : stride, 0 : camera.width : stride]
    z = depth_m[::stride, ::stride].astype(np.float64)
    measured = z > 0
    points = camera.back_project(np.stack([u, v, z], axis=-1)[measured])
    if len(points) < MIN_SHARE * z.size:
        return None
    if _is_floor(fitted := fit_floor(points, before, delta_f_m), points, delta_f_m, z.size):
        return fitted
    # "the depth data that have the smallest y"; the lowest 1 % are skipped as wrong measurements
    lowest = np.array([0.0, -1.0, 0.0, np.quantile(points[:, 1], 0.99)])
    fitted = fit_floor(points, fit_floor(points, lowest, FIRST_BAND_M), delta_f_m)
    return fitted if _is_floor(fitted, points, delta_f_m, z.size) else None


def fit_floor(points: np.ndarray, plane: np.ndarray | None, delta_f_m: float) -> np.ndarray | None:
    """The loop of Algorithm 1: least squares over the points near the plane, until these no longer change.

    From (N, 3) points, metres, in front of the camera, and (4,) A_0, d_0 or None, as `find_floor` returns them. None if the
    points near the plane lie on a line.
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


def _is_floor(plane: np.ndarray | None, points: np.ndarray, delta_f_m: float, num_samples: int) -> bool:
    """Whether a plane lies below the camera, not before it, and enough of it is in view."""
    if plane is None or -plane[1] < MIN_UP:
        return False
    on_floor = np.abs(points @ plane[:3] + plane[3]) < delta_f_m
    return bool(on_floor.sum() > MIN_SHARE * num_samples)
