"""Where a posed person stands: free of walls and furniture, wholly inside the image or cut by its border."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.errors import check_between, check_range
from synth.scene.room import Room, View, overlaps_boxes

CLEARANCE_M = 0.03
"""Least distance of the body's vertices from walls and furniture: twice the usual distance between neighbours on the skin, so
that nothing as thin as a table's leg passes between them."""

NEAREST_M = 0.4
"""Least depth of any point of the body: nearer surfaces lie in the blind zone of every modelled sensor."""

CUT_INSIDE = (0.35, 0.97)
"""Fraction of the vertices of body and wardrobe that lies inside the image if the border cuts the person. Clothes that are not
worn lie inside the body: of the body's own vertices it is 0.05 less in the median."""

SOUND, MISFRAMED, UNSEEN, BLOCKED = range(4)
"""What is wrong with a place, from the best to the worst: nothing; the image's border cuts the person, or does not where it
should, or they are too near; too few pixels of them are visible; they stand in a wall or in furniture."""

BESIDE_M, ASIDE_M = (-1.2, 0.3), (0.1, 0.8)
"""Ranges of another person's distance behind a person, and of that to either side of the line of sight to them."""


@dataclass(frozen=True)
class StageConfig:
    """Where people stand, how they turn, and which poses are rejected.

    Attributes:
        distance_m: range of the hips' distance from the camera along the floor, metres. Of people wholly inside the image it
            is the mean of two uniform draws, which keeps the bulk in the middle of the range; of people who may be cut it is
            the smaller of two, since near people do not fit into the image.
        off_centre: largest lateral offset of the hips, as a fraction of half the field of view at their distance; up to 1 for
            people who may be cut.
        cut: fraction of the samples that the image's border cuts. The torso stays inside the image.
        turned: fraction of the samples with a uniformly random heading; the others face the camera up to `turn_deg`.
        turn_deg: standard deviation of the heading of the people who face the camera, degrees.
        penetration_m: deepest penetration of two body parts that is accepted, metres.
        least_pixels: smallest number of visible pixels of the person; with fewer another place is drawn.
        tries: largest number of poses drawn for a sample; then the one with the smallest penetration is taken.
        place_tries: largest number of places drawn for a pose; then the first of the best ones is taken: rather partly
            outside the image than in furniture.
    """

    distance_m: tuple[float, float] = (1.0, 5.0)
    off_centre: float = 0.6
    cut: float = 0.12
    turned: float = 0.45
    turn_deg: float = 35.0
    penetration_m: float = 0.02
    least_pixels: int = 400
    tries: int = 16
    place_tries: int = 30

    def __post_init__(self) -> None:
        check_range("stage.distance_m", self.distance_m, 0.3, 10)
        limits = {"off_centre": (0, 1), "cut": (0, 1), "turned": (0, 1), "turn_deg": (0, 180), "penetration_m": (0, 1)}
        limits |= {"least_pixels": (0, 1e9), "tries": (1, 1e6), "place_tries": (1, 1e6)}
        for name, (low, high) in limits.items():
            check_between(f"stage.{name}", getattr(self, name), low, high)


class Body(NamedTuple):
    """A posed body with the hips at the world's origin."""

    vertices_m: np.ndarray  # (V, 3) float32 skin, metres
    low_m: np.ndarray  # (3,) least coordinates of the skin, metres
    high_m: np.ndarray  # (3,) greatest coordinates of the skin, metres
    torso_m: np.ndarray  # (3,) the torso joint, metres
    height_m: float  # of the hips above the floor


class Site(NamedTuple):
    """What a person is placed in."""

    room: Room
    view: View
    camera: Camera
    depth_mm: np.ndarray  # (H, W) uint16 depth of the empty room, millimetres
    floor: np.ndarray  # (4,) float32 floor plane in the camera frame: upward unit normal n and offset d in metres, n.x + d = 0


def draw_place(rng: np.random.Generator, config: StageConfig, body: Body, site: Site, cut: bool) -> np.ndarray:
    """Draws a place, (3,) metres, for the hips: its bounding box lies within the walls; nothing else is tested."""
    back, left, right = site.room.clear_m()
    low, high = body.low_m, body.high_m
    near, far = config.distance_m
    far = min(far, back - high[1] - CLEARANCE_M)
    draws = rng.random(2)
    distance_m = min(near, far) + (far - min(near, far)) * (draws.min() if cut else draws.mean())
    half_view_m = (1.0 if cut else config.off_centre) * distance_m * site.camera.width / (2 * site.camera.fx)
    first, last = max(-half_view_m, left - low[0] + CLEARANCE_M), min(half_view_m, right - high[0] - CLEARANCE_M)
    return np.array([first + (last - first) * rng.random(), distance_m, body.height_m])


def draw_place_beside(
    rng: np.random.Generator, body: Body, body_place_m: np.ndarray, other: Body, site: Site
) -> np.ndarray | None:
    """Draws a place for another person close to the line of sight to a person at (3,) metres, before them or beside them
    within reach; None if it is not free.
    """
    distance_m = body_place_m[1] + rng.uniform(*BESIDE_M)
    on_sight_m = body_place_m[0] * distance_m / body_place_m[1]
    aside_m = rng.uniform(*ASIDE_M) * (1 if rng.random() < 0.5 else -1)
    place_m = np.array([on_sight_m + aside_m, distance_m, other.height_m])
    if not are_apart(body, body_place_m, other, place_m) or stands_in_room(other, place_m, site.room):
        return None
    inside, nearest_m = image_fraction(other.vertices_m, place_m, site)
    return place_m if inside >= CUT_INSIDE[0] and nearest_m >= NEAREST_M else None


def faults(body: Body, place_m: np.ndarray, site: Site, cut: bool) -> int:
    """What is wrong with a place: SOUND, MISFRAMED or BLOCKED."""
    if stands_in_room(body, place_m, site.room):
        return BLOCKED
    inside, nearest_m = image_fraction(body.vertices_m, place_m, site)
    torso, _ = image_fraction(body.torso_m[None], place_m, site)
    framed = torso == 1 and CUT_INSIDE[0] <= inside <= CUT_INSIDE[1] if cut else inside == 1
    return SOUND if framed and nearest_m >= NEAREST_M else MISFRAMED


def are_apart(one: Body, one_place_m: np.ndarray, other: Body, other_place_m: np.ndarray) -> bool:
    """Whether the upright bounding boxes of two bodies at their places do not touch: then the bodies do not either."""
    before = one.high_m + one_place_m + CLEARANCE_M < other.low_m + other_place_m
    behind = other.high_m + other_place_m + CLEARANCE_M < one.low_m + one_place_m
    return bool((before | behind)[:2].any())


def stands_in_room(body: Body, place_m: np.ndarray, room: Room) -> bool:
    """Whether the body touches a wall or a piece of furniture. The floor is the first box of a room."""
    boxes = room.centres_m[1:], room.halves_m[1:], room.yaws_rad[1:]
    return overlaps_boxes(body.vertices_m, place_m, *boxes, CLEARANCE_M)


def image_fraction(points_m: np.ndarray, place_m: np.ndarray, site: Site) -> tuple[float, float]:
    """Fraction of points (N, 3), moved by (3,) in the world, that project into the image, and their least depth in metres."""
    view, camera = site.view, site.camera
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    return _image_fraction(points_m, place_m - view.position_m, view.rotation, intrinsics, camera.width, camera.height)


@njit(cache=True)
def _image_fraction(points, offset, rotation, intrinsics, width, height):
    fx, fy, cx, cy = intrinsics
    inside, nearest = 0, np.inf
    for i in range(len(points)):
        x, y, z = points[i, 0] + offset[0], points[i, 1] + offset[1], points[i, 2] + offset[2]
        depth = x * rotation[0, 2] + y * rotation[1, 2] + z * rotation[2, 2]
        nearest = min(nearest, depth)
        if depth > 0:
            u = fx * (x * rotation[0, 0] + y * rotation[1, 0] + z * rotation[2, 0]) / depth + cx
            v = fy * (x * rotation[0, 1] + y * rotation[1, 1] + z * rotation[2, 1]) / depth + cy
            inside += -0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5
    return inside / len(points), nearest
