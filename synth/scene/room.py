"""Random rooms (floor, walls and furniture made of boxes) and random camera poses.

World frame: z up, floor at z = 0, the camera above the origin looking along +y, people in front of it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from kpopnet.errors import check_between, check_range
from synth.scene.mesh import Box, about_z

MAX_BOXES = 24
WALL_HALF_THICKNESS_M = 0.1
AIM_DISTANCE_M = 2.7
DEPTH_M = (3.6, 7.2)  # range of the back wall's distance from the camera: people stand up to 5 m away


@dataclass(frozen=True)
class ViewConfig:
    """Ranges from which a camera pose is drawn uniformly.

    Attributes:
        height_m: camera's height above the floor, metres.
        aim_m: height of the point, 2.7 m in front of the camera, that the optical axis passes through, metres.
        roll_deg: largest roll to either side, degrees.
    """

    height_m: tuple[float, float] = (0.5, 2.0)
    aim_m: tuple[float, float] = (0.6, 1.2)
    roll_deg: float = 2.0

    def __post_init__(self) -> None:
        for name in ("height_m", "aim_m"):
            check_range(f"view.{name}", getattr(self, name), 0, 10)
        check_between("view.roll_deg", self.roll_deg, 0, 180)


@dataclass(frozen=True)
class View:
    position_m: np.ndarray  # (3,) position in the world, metres
    rotation: np.ndarray  # (3, 3) rotation from the camera frame (x right, y down, z forward) to the world frame

    def to_camera(self, points_world_m: np.ndarray) -> np.ndarray:
        """Transforms points (..., 3) from the world frame to the camera frame, metres."""
        return (points_world_m - self.position_m) @ self.rotation

    def floor(self) -> np.ndarray:
        """(4,) floor plane in the camera frame: upward unit normal n and offset d in metres, n.x + d = 0."""
        return np.append(self.rotation.T @ (0.0, 0.0, 1.0), self.position_m[2])


@dataclass(frozen=True)
class Room:
    """K boxes. The first four are the floor and the back, left and right walls."""

    centres_m: np.ndarray  # (K, 3) box centres in the world, metres
    halves_m: np.ndarray  # (K, 3) half sizes along the box's own axes, metres
    yaws_rad: np.ndarray  # (K,) rotations about the vertical, radians

    def clear_m(self) -> tuple[float, float, float]:
        """Inner faces of the walls, metres: y of the back wall, x of the left wall, x of the right wall."""
        _, back, left, right = self.centres_m[:4]
        return back[1] - WALL_HALF_THICKNESS_M, left[0] + WALL_HALF_THICKNESS_M, right[0] - WALL_HALF_THICKNESS_M


Furniture = Callable[[np.random.Generator], list[Box]]
"""Returns a piece of furniture as boxes in its own frame. Its back faces +y."""


def draw_view(rng: np.random.Generator, config: ViewConfig) -> View:
    height_m, aim_m = rng.uniform(*config.height_m), rng.uniform(*config.aim_m)
    pitch = np.arctan2(height_m - aim_m, AIM_DISTANCE_M)
    roll = np.radians(rng.uniform(-config.roll_deg, config.roll_deg))
    return posed_view(np.array([0, 0, height_m]), pitch, roll)


def posed_view(position_m: np.ndarray, pitch_rad: float, roll_rad: float, yaw_rad: float = 0.0) -> View:
    """A camera at a place (3,) of the world that looks towards +y, down by the pitch, to the left by the yaw, and is rolled."""
    forward = np.array([0, np.cos(pitch_rad), -np.sin(pitch_rad)])
    down, right = np.array([0, -np.sin(pitch_rad), -np.cos(pitch_rad)]), np.array([1.0, 0, 0])
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    looking = np.stack([cos * right + sin * down, cos * down - sin * right, forward], axis=1)
    return View(position_m, about_z(yaw_rad) @ looking)


def draw_room(rng: np.random.Generator, furniture: tuple[Furniture, ...]) -> Room:
    """Draws a room: a floor, three walls, and along these up to six pieces of furniture of the given kinds."""
    half_width, depth_m = rng.uniform(1.8, 3.5), rng.uniform(*DEPTH_M)
    thick = WALL_HALF_THICKNESS_M
    boxes = [
        ((0, 2, -thick), (8, 8, thick), 0),
        ((0, depth_m + thick, 1.5), (8, thick, 1.5), 0),
        ((-half_width - thick, 2, 1.5), (thick, 8, 1.5), 0),
        ((half_width + thick, 2, 1.5), (thick, 8, 1.5), 0),
    ]
    for _ in range(rng.integers(0, 7) if furniture else 0):
        piece = furniture[rng.integers(len(furniture))](rng)
        side = rng.integers(3)
        askew = rng.uniform(-0.2, 0.2)
        wide, deep = _extent(piece, askew)
        if side == 0:
            place, turn = np.array([rng.uniform(-1, 1) * (half_width - wide), depth_m - deep]), askew
        else:
            sign = 1 if side == 1 else -1
            place = np.array([sign * (half_width - deep), rng.uniform(1.2, depth_m - wide)])
            turn = askew - sign * np.pi / 2
        if len(boxes) + len(piece) > MAX_BOXES:
            break
        cos, sin = np.cos(turn), np.sin(turn)
        for (x, y, z), half in piece:
            boxes.append(((place[0] + cos * x - sin * y, place[1] + sin * x + cos * y, z), half, turn))
    centres, halves, yaws = zip(*boxes, strict=True)
    return Room(np.array(centres, float), np.array(halves, float), np.array(yaws, float))


def _extent(piece: list[Box], turn: float) -> tuple[float, float]:
    """Half the width and half the depth of a piece of furniture about its origin, turned by an angle in radians; metres."""
    wide = max(abs(centre[0]) + half[0] for centre, half in piece)
    deep = max(abs(centre[1]) + half[1] for centre, half in piece)
    cos, sin = np.cos(turn), abs(np.sin(turn))
    return cos * wide + sin * deep, sin * wide + cos * deep


def four_legs(half_x: float, half_y: float, height_m: float, thick_m: float) -> list[Box]:
    """The four legs of a piece: half the distances between their axes, height and half the thickness, metres."""
    middle = height_m / 2
    return [((sx * half_x, sy * half_y, middle), (thick_m, thick_m, middle)) for sx in (-1, 1) for sy in (-1, 1)]


def _cupboard(rng: np.random.Generator) -> list[Box]:
    w, d, h = rng.uniform(0.3, 0.6), rng.uniform(0.15, 0.3), rng.uniform(0.4, 1.05)
    return [((0, 0, h), (w, d, h))]


def _table(rng: np.random.Generator) -> list[Box]:
    w, d, h = rng.uniform(0.3, 0.7), rng.uniform(0.25, 0.45), rng.uniform(0.45, 0.75)
    return [((0, 0, h), (w, d, 0.02)), *four_legs(w - 0.03, d - 0.03, h, 0.025)]


def _chair(rng: np.random.Generator) -> list[Box]:
    w, h = rng.uniform(0.2, 0.26), rng.uniform(0.42, 0.5)
    return [((0, 0, h), (w, w, 0.025)), ((0, w, h + 0.25), (w, 0.02, 0.25)), *four_legs(w - 0.02, w - 0.02, h, 0.02)]


def _sofa(rng: np.random.Generator) -> list[Box]:
    w, d = rng.uniform(0.6, 1.1), rng.uniform(0.38, 0.48)
    arms = [((side * w, 0, 0.5), (0.1, d, 0.1)) for side in (-1, 1)]
    return [((0, 0, 0.21), (w, d, 0.21)), ((0, d - 0.1, 0.6), (w, 0.1, 0.2)), *arms]


LIVING_ROOM = (_cupboard, _table, _chair, _sofa)


# Held back from training: the rooms of simulated benchmarks have only these.
def _pillar(rng: np.random.Generator) -> list[Box]:
    w, d = rng.uniform(0.1, 0.3), rng.uniform(0.1, 0.25)
    return [((0, 0, 1.5), (w, d, 1.5))]


def _wall_bars(rng: np.random.Generator) -> list[Box]:
    w, h = rng.uniform(0.4, 0.6), rng.uniform(1.0, 1.3)
    rails = [((0, 0, height), (w, 0.02, 0.02)) for height in np.linspace(0.3, 2 * h - 0.1, 6)]
    return [((side * w, 0.03, h), (0.03, 0.05, h)) for side in (-1, 1)] + rails


def _steps(rng: np.random.Generator) -> list[Box]:
    w, depth, rise = rng.uniform(0.5, 1.0), rng.uniform(0.14, 0.2), rng.uniform(0.12, 0.2)
    return [((0, (2 * k - 2) * depth, (k + 1) * rise / 2), (w, depth, (k + 1) * rise / 2)) for k in range(3)]


def _upright_piano(rng: np.random.Generator) -> list[Box]:
    w, h = rng.uniform(0.65, 0.78), rng.uniform(0.5, 0.65)
    return [((0, 0.12, h), (w, 0.18, h)), ((0, -0.15, 0.68), (w, 0.12, 0.05))]


def _speaker_on_stand(rng: np.random.Generator) -> list[Box]:
    w, h, stand = rng.uniform(0.12, 0.22), rng.uniform(0.2, 0.35), rng.uniform(0.5, 1.1)
    return [((0, 0, stand + h), (w, 0.8 * w, h)), ((0, 0, stand / 2), (0.02, 0.02, stand / 2)), ((0, 0, 0.02), (w, w, 0.02))]


def _ballet_barre(rng: np.random.Generator) -> list[Box]:
    w, h = rng.uniform(0.6, 1.1), rng.uniform(0.8, 1.1)
    posts = [((side * (w - 0.1), 0, h / 2), (0.025, 0.025, h / 2)) for side in (-1, 1)]
    return [((0, 0, h), (w, 0.02, 0.02)), ((0, 0, 0.7 * h), (w, 0.02, 0.02)), *posts]


def _curtain(rng: np.random.Generator) -> list[Box]:
    w, slats = rng.uniform(0.4, 0.8), 8
    x = np.linspace(-w, w, slats)
    return [((float(x[k]), 0.08 * (k % 2) + rng.uniform(0, 0.04), 1.3), (w / slats, 0.02, 1.3)) for k in range(slats)]


DANCE_HALL = (_pillar, _wall_bars, _steps, _upright_piano, _speaker_on_stand, _ballet_barre, _curtain)


@njit(cache=True)
def overlaps_boxes(vertices_m, place_m, centres_m, halves_m, yaws_rad, clearance_m):
    """Whether any of a body's vertices (V, 3), moved by (3,), lies in a box that is larger by a clearance on every side.

    The boxes have (K, 3) centres, (K, 3) half sizes along their own axes and (K,) rotations about the vertical, as in `Room`.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(len(vertices_m)):
        for axis in range(3):
            low[axis] = min(low[axis], vertices_m[i, axis])
            high[axis] = max(high[axis], vertices_m[i, axis])
    low, high = low + place_m - clearance_m, high + place_m + clearance_m
    for box in range(len(centres_m)):
        cos, sin = np.cos(yaws_rad[box]), np.sin(yaws_rad[box])
        half_x, half_y, half_z = halves_m[box]
        x, y, z = centres_m[box]
        reach_x, reach_y = abs(cos) * half_x + abs(sin) * half_y, abs(sin) * half_x + abs(cos) * half_y
        apart = x - reach_x > high[0] or x + reach_x < low[0] or y - reach_y > high[1] or y + reach_y < low[1]
        if apart or z - half_z > high[2] or z + half_z < low[2]:
            continue
        for i in range(len(vertices_m)):
            if abs(vertices_m[i, 2] + place_m[2] - z) >= half_z + clearance_m:
                continue
            off_x, off_y = vertices_m[i, 0] + place_m[0] - x, vertices_m[i, 1] + place_m[1] - y
            if abs(cos * off_x + sin * off_y) < half_x + clearance_m and abs(cos * off_y - sin * off_x) < half_y + clearance_m:
                return True
    return False
