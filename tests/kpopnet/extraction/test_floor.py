import math

import numpy as np
import pytest

from kpopnet.camera import CAMERAS, Camera
from kpopnet.extraction import HumanExtractor
from kpopnet.extraction.floor import find_floor, refit_floor

CAMERA = CAMERAS["kinect_v1"]
DELTA_M = 0.005


def plane_of(height_m: float, pitch_deg: float, roll_deg: float) -> np.ndarray:
    pitch, roll = math.radians(pitch_deg), math.radians(roll_deg)
    up = np.array([math.sin(roll) * math.cos(pitch), -math.cos(roll) * math.cos(pitch), -math.sin(pitch)])
    return np.append(up, height_m)


def rays(camera: Camera) -> np.ndarray:
    v, u = np.mgrid[: camera.height, : camera.width]
    return np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)


def depth_of(plane: np.ndarray, camera: Camera = CAMERA) -> np.ndarray:
    """(H, W) depth of a plane, inf where it is not in view."""
    slope = rays(camera) @ plane[:3]
    with np.errstate(divide="ignore"):
        z = -plane[3] / slope
    return np.where(z > 0, z, np.inf)


def room_of(plane: np.ndarray, wall_m: float = 4.0) -> np.ndarray:
    """A floor, an upright wall, a cupboard and a table top."""
    up = plane[:3]
    forward = np.array([0, 0, 1.0]) - up[2] * up
    forward /= np.linalg.norm(forward)
    depth = np.minimum(depth_of(plane), depth_of(np.append(-forward, wall_m)))
    cupboard = depth_of(np.append(-forward, wall_m - 0.8))
    heights = cupboard[..., None] * rays(CAMERA) @ up + plane[3]
    depth[:, 40:90] = np.where((heights < 1.2)[:, 40:90], np.minimum(depth, cupboard)[:, 40:90], depth[:, 40:90])
    table = depth_of(plane - (0, 0, 0, 0.7))
    on_table = (table > 2.2) & (table < 2.8)
    depth[:, 210:280] = np.where(on_table, np.minimum(depth, table), depth)[:, 210:280]
    return np.where(np.isfinite(depth), depth, 0).astype(np.float32)


def noisy(depth: np.ndarray, seed: int, per_m2: float = 0.002) -> np.ndarray:
    return (depth + per_m2 * depth**2 * np.random.default_rng(seed).standard_normal(depth.shape)).astype(np.float32)


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return math.degrees(math.acos(min(1.0, float(a[:3] @ b[:3]))))


VIEWS = [(0.5, -10, 1), (0.9, 0, 0), (1.2, 8, -2), (1.6, 17, 2), (2.0, 27, -1)]


@pytest.mark.parametrize(("height_m", "pitch_deg", "roll_deg"), VIEWS)
def test_a_tilted_floor_with_known_normal(height_m, pitch_deg, roll_deg):
    plane = plane_of(height_m, pitch_deg, roll_deg)
    floor = find_floor(room_of(plane), CAMERA, DELTA_M)
    assert angle_deg(floor.plane, plane) < 0.05
    assert floor.plane[3] == pytest.approx(height_m, abs=0.005)
    assert np.linalg.norm(floor.plane[:3]) == pytest.approx(1)


@pytest.mark.parametrize(("height_m", "pitch_deg", "roll_deg"), VIEWS)
def test_a_tilted_floor_in_noise(height_m, pitch_deg, roll_deg):
    plane = plane_of(height_m, pitch_deg, roll_deg)
    floor = find_floor(noisy(room_of(plane), 1), CAMERA, DELTA_M)
    for seed in range(3):
        assert angle_deg(floor.plane, plane) < 0.6
        assert floor.plane[3] == pytest.approx(height_m, abs=0.04)
        floor = refit_floor(floor, noisy(room_of(plane), 2 + seed), CAMERA, DELTA_M)


def test_the_fit_iterates_eq_1_over_the_near_points_until_they_no_longer_change():
    plane = plane_of(1.2, 8, -2)
    depth = noisy(room_of(plane), 4)
    floor = find_floor(depth, CAMERA, DELTA_M)
    again = refit_floor(floor, depth, CAMERA, DELTA_M)
    # Reference implementation on the same pixels.
    stride = 6
    above = np.maximum(np.arange(0, 240, stride) - stride, 0)
    below = np.minimum(np.arange(0, 240, stride) + stride, 239)
    growth = (1 / depth[below, ::stride] - 1 / depth[above, ::stride]) * CAMERA.fy / (below - above)[:, None]
    points, z = rays(CAMERA)[::stride, ::stride], depth[::stride, ::stride].astype(float)
    found, near = floor.plane, None
    a, b = floor.delta_f(DELTA_M)
    while True:
        height = z * (points @ found[:3]) + found[3]
        now = (np.abs(height) < a + b * z) & (growth > -0.5 * found[1] / found[3])
        if near is not None and (now == near).all():
            break
        near = now
        # Eq. (1), each row divided by its depth
        solved = np.linalg.lstsq(points[near], 1 / z[near], rcond=None)[0]
        found = np.append(-solved, 1) / np.linalg.norm(solved)
    assert again.plane == pytest.approx(found, abs=1e-9)
    height = z * (points @ found[:3]) + found[3]
    assert again.scatter == pytest.approx(math.sqrt(((height / z)[near] ** 2).mean()), rel=1e-6)


@pytest.mark.parametrize("what", ["wall", "nothing", "one pixel", "garbage", "ceiling", "person only"])
def test_no_floor_in_view(what):
    depth = np.zeros((240, 320), np.float32)
    if what == "wall":
        depth = noisy(np.full((240, 320), 3.0, np.float32), 0)
    elif what == "one pixel":
        depth[100, 100] = 2
    elif what == "garbage":
        depth = (np.random.default_rng(0).integers(0, 65536, depth.shape) / 1000).astype(np.float32)
    elif what == "ceiling":
        depth = noisy(np.minimum(depth_of(np.array([0, 1, 0, 1.2])), 4.0).astype(np.float32), 0)
    elif what == "person only":
        v, u = np.mgrid[:240, :320]
        depth = np.where(((u - 160) / 30) ** 2 + ((v - 120) / 90) ** 2 < 1, 2.5 - 0.002 * v, 0).astype(np.float32)
    assert find_floor(depth, CAMERA, DELTA_M) is None
    extractor = HumanExtractor(CAMERA)
    extractor.extract(depth)
    assert extractor.floor is None


def test_a_hidden_floor_is_kept():
    plane = plane_of(1.2, 8, 0)
    floor = find_floor(room_of(plane), CAMERA, DELTA_M)
    assert refit_floor(floor, np.full((240, 320), 1.0, np.float32), CAMERA, DELTA_M) is floor
    assert refit_floor(floor, np.zeros((240, 320), np.float32), CAMERA, DELTA_M) is floor


def test_the_floor_is_refitted_to_the_next_image():
    floor = find_floor(room_of(plane_of(1.2, 8, 0)), CAMERA, DELTA_M)
    moved = refit_floor(floor, room_of(plane_of(1.203, 8.1, 0)), CAMERA, DELTA_M)
    assert moved.plane == pytest.approx(plane_of(1.203, 8.1, 0), abs=2e-3)
