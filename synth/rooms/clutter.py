"""Things that stand about where people are: what may hide a person, or be taken for one.

A kind of clutter is a function of a random generator that returns a mesh whose origin is on the floor, z up.
"""

from collections.abc import Callable
from functools import wraps

import numpy as np

from synth.scene.mesh import Box, Mesh, ball, boxes, joined, rod
from synth.scene.room import LIVING_ROOM

Clutter = Callable[[np.random.Generator], Mesh]
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # turns a rod along y upright


def pole(radius_m: float, low_m: float, high_m: float, x_m: float = 0.0, y_m: float = 0.0) -> Mesh:
    """An upright rod from one height to another."""
    return rod(radius_m, (high_m - low_m) / 2).moved(UPRIGHT, np.array([x_m, y_m, (low_m + high_m) / 2]))


def leaning(radius_m: float, low_m: np.ndarray, high_m: np.ndarray) -> Mesh:
    """A rod between two points (3,)."""
    along = high_m - low_m
    length = float(np.linalg.norm(along))
    y = along / length
    x = np.cross(y, (0.3, 0.2, 1.0) if abs(y[2]) < 0.9 else (1.0, 0, 0))
    x /= np.linalg.norm(x)
    return rod(radius_m, length / 2).moved(np.stack([x, y, np.cross(x, y)], axis=1), (low_m + high_m) / 2)


def stretched(mesh: Mesh, factors: tuple[float, float, float], position_m: tuple[float, float, float]) -> Mesh:
    """The mesh scaled along its axes, then moved."""
    return Mesh(mesh.vertices_m * factors + position_m, mesh.faces)


def tripod(rng: np.random.Generator) -> Mesh:
    """A camera, a light or a music stand on three legs."""
    height, spread, turn = rng.uniform(0.9, 1.8), rng.uniform(0.25, 0.5), rng.uniform(0, 2 * np.pi)
    top = np.array([0, 0, 0.7 * height])
    legs = [
        leaning(0.015, np.array([spread * np.cos(turn + a), spread * np.sin(turn + a), 0]), top)
        for a in (0, 2 * np.pi / 3, 4 * np.pi / 3)
    ]
    w, h = rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.25)
    return joined([*legs, pole(0.015, 0.65 * height, height), boxes([((0, 0, height + h), (w, 0.06, h))])])


def floor_lamp(rng: np.random.Generator) -> Mesh:
    height, shade = rng.uniform(1.2, 1.9), rng.uniform(0.1, 0.25)
    return joined([
        pole(0.015, 0, height), pole(rng.uniform(0.1, 0.18), 0, 0.03),
        stretched(ball(shade), (1, 1, rng.uniform(0.6, 1.2)), (0, 0, height)),
    ])  # fmt: skip


def coat_stand(rng: np.random.Generator) -> Mesh:
    """A stand with a coat or two: as high as a person, with a head, shoulders and no legs."""
    height = rng.uniform(1.5, 1.9)
    parts = [pole(0.025, 0, height), pole(rng.uniform(0.15, 0.25), 0, 0.04)]
    for _ in range(rng.integers(1, 4)):
        angle, half = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 0.55)
        x, y = 0.14 * np.cos(angle), 0.14 * np.sin(angle)
        width = rng.uniform(0.13, 0.25)
        parts.append(stretched(ball(1.0), (width, 0.6 * width, half), (x, y, height - 0.15 - half)))
    if rng.random() < 0.5:
        parts.append(stretched(ball(0.12), (1, 1, 0.6), (0, 0, height)))
    return joined(parts)


def wall_coat(rng: np.random.Generator) -> Mesh:
    """A coat or a towel that hangs from a hook, without a stand."""
    high, half, width = rng.uniform(1.4, 1.9), rng.uniform(0.3, 0.6), rng.uniform(0.15, 0.3)
    return stretched(ball(1.0), (width, rng.uniform(0.05, 0.12), half), (0, 0, high - half))


def plant(rng: np.random.Generator) -> Mesh:
    height, pot = rng.uniform(0.6, 1.8), rng.uniform(0.12, 0.22)
    leaves = [
        stretched(ball(rng.uniform(0.08, 0.25)), (1, 1, rng.uniform(0.5, 1.3)),
                  (*rng.uniform(-0.25, 0.25, 2), rng.uniform(0.4, 1.0) * height))
        for _ in range(rng.integers(2, 8))
    ]  # fmt: skip
    return joined([pole(pot, 0, 2 * pot), pole(0.03, 0, height), *leaves])


def animal(rng: np.random.Generator) -> Mesh:
    """A dog or a cat of boxes and balls: a body on four legs with a head and a tail."""
    size = rng.uniform(0.25, 0.75)
    half = (0.55 * size, 0.2 * size, 0.22 * size)
    legs = [pole(0.06 * size, 0, 0.6 * size, x, y) for x in (-0.42 * size, 0.42 * size) for y in (-0.13 * size, 0.13 * size)]
    body = stretched(ball(1.0), half, (0, 0, 0.75 * size))
    head = stretched(ball(0.22 * size), (1.2, 1, 1), (0.62 * size, 0, rng.uniform(0.8, 1.1) * size))
    return joined([body, head, leaning(0.03 * size, np.array([-0.5 * size, 0, 0.8 * size]),
                                       np.array([-0.8 * size, 0, rng.uniform(0.6, 1.2) * size])), *legs])  # fmt: skip


def ball_or_cushion(rng: np.random.Generator) -> Mesh:
    radius = rng.uniform(0.1, 0.38)
    return stretched(ball(radius), (1, 1, (flat := rng.uniform(0.4, 1.0))), (0, 0, radius * flat))


def pile(rng: np.random.Generator) -> Mesh:
    """A stack of boxes and bags, up to the height of a person."""
    parts: list[Box] = []
    top = 0.0
    for _ in range(rng.integers(1, 6)):
        half = rng.uniform(0.1, 0.3, 3)
        parts.append(((*rng.uniform(-0.08, 0.08, 2), top + half[2]), tuple(half)))
        top += 2 * half[2]
    return boxes(parts)


def pillar(rng: np.random.Generator) -> Mesh:
    return pole(rng.uniform(0.08, 0.25), 0, rng.uniform(1.2, 3.0))


def chair_on_wheels(rng: np.random.Generator) -> Mesh:
    """An office chair: a star of feet, a column, a seat, a round back and arms."""
    seat, w = rng.uniform(0.42, 0.52), rng.uniform(0.2, 0.26)
    feet = [leaning(0.025, np.array([0, 0, 0.08]), np.array([0.3 * np.cos(a), 0.3 * np.sin(a), 0.04]))
            for a in np.linspace(0, 2 * np.pi, 5, endpoint=False)]  # fmt: skip
    back = stretched(ball(1.0), (w, 0.05, rng.uniform(0.22, 0.4)), (0, w, seat + 0.38))
    arms = [((side * (w + 0.03), 0, seat + 0.2), (0.03, 0.14, 0.02)) for side in (-1, 1)]
    return joined([*feet, pole(0.03, 0.05, seat), boxes([((0, 0, seat), (w, w, 0.04)), *arms]), back])


def drape(rng: np.random.Generator) -> Mesh:
    """A curtain, a towel or a sheet that hangs in folds, as wide as a person or a window."""
    half, high, long = rng.uniform(0.2, 1.2), rng.uniform(1.2, 2.6), rng.uniform(0.6, 2.4)
    low, fold, folds = max(high - long, 0.02), rng.uniform(0.01, 0.08), rng.uniform(2, 8)
    x = np.linspace(-half, half, 40)
    y = fold * np.sin(np.pi * folds * x / half + rng.uniform(0, 2 * np.pi)) + 0.3 * fold * rng.standard_normal(len(x))
    gather = rng.uniform(0.4, 1.0)  # width at the bottom; a curtain that is tied back is narrow there
    upper, lower = np.stack([x, y, np.full(len(x), high)], 1), np.stack([gather * x, y, np.full(len(x), low)], 1)
    k = np.arange(len(x) - 1)
    one, other = np.stack([k, k + 1, k + 41], 1), np.stack([k, k + 41, k + 40], 1)
    front = np.concatenate([one, other])
    return Mesh(np.concatenate([upper, lower]), np.concatenate([front, front[:, ::-1]]).astype(np.int32))


def part(rng: np.random.Generator, reach_m: float) -> Mesh:
    """A solid about the origin: a box, a ball, a rod or a board, of half sizes up to the reach, upright or turned."""
    half = np.exp(rng.uniform(np.log(0.02), np.log(reach_m), 3))
    kind = rng.integers(3)
    solid = stretched((boxes([((0, 0, 0), (1, 1, 1))]), ball(1.0), rod(1.0, 1.0))[kind], tuple(half), (0, 0, 0))
    if rng.random() < 0.5:
        return solid
    turns, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return solid.moved(turns * np.linalg.det(turns), np.zeros(3))


def assembly(rng: np.random.Generator) -> Mesh:
    """Up to a dozen solids that touch: a thing of no known kind, as large as a stool, a person or a wardrobe."""
    high, wide = rng.uniform(0.4, 2.2), rng.uniform(0.1, 0.6)
    spine = rng.uniform(-1, 1, 2) * 0.3 * wide
    parts = [part(rng, 0.35).moved(np.eye(3), np.array([*spine, rng.uniform(0.1, high)]))]
    for _ in range(rng.integers(1, 12)):
        other = parts[rng.integers(len(parts))].vertices_m
        at = other[rng.integers(len(other))]
        inside = np.clip(at, (-wide, -wide, 0.0), (wide, wide, high))
        parts.append(part(rng, rng.choice((0.12, 0.35))).moved(np.eye(3), inside))
    mesh = joined(parts)
    return mesh.moved(np.eye(3), np.array([0, 0, -min(mesh.vertices_m[:, 2].min(), rng.uniform(0, 0.5))]))


def row_of_parts(rng: np.random.Generator) -> Mesh:
    """A solid again and again, side by side or above each other: bars of a fence, boards of a shelf, ribs of a radiator."""
    upright, half = rng.random() < 0.6, rng.uniform(0.2, 0.9)
    thin, deep, count = rng.uniform(0.01, 0.06), rng.uniform(0.01, 0.2), int(rng.integers(3, 14))
    low, high = rng.uniform(0.0, 0.3), rng.uniform(0.6, 2.2)
    if upright:
        middle, tall = (low + high) / 2, (high - low) / 2
        bars = [((float(x), 0.0, middle), (thin, deep, tall)) for x in np.linspace(-half, half, count)]
        ends = [((0.0, 0.0, z), (half, 0.7 * deep, thin)) for z in (low, high)]
    else:
        bars = [((0.0, 0.0, float(z)), (half, deep, thin)) for z in np.linspace(low, high, count)]
        ends = [((x, 0.0, (low + high) / 2), (thin, deep, (high - low) / 2)) for x in (-half, half)]
    shown = bars if rng.random() < 0.3 else [*bars, *ends]
    mesh = joined([boxes(shown), *(part(rng, 0.2).moved(np.eye(3), np.array(bars[k][0])) for k in rng.integers(count, size=2))])
    lean = np.radians(rng.choice((0.0, rng.uniform(0, 25))))
    cos, sin = np.cos(lean), np.sin(lean)
    leant = mesh.moved(np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]]), np.zeros(3))
    return leant.moved(np.eye(3), np.array([0, 0, max(-leant.vertices_m[:, 2].min(), 0.0)]))


def of_boxes(furniture: Callable[[np.random.Generator], list[Box]]) -> Clutter:
    @wraps(furniture)
    def thing(rng: np.random.Generator) -> Mesh:
        return boxes(furniture(rng))

    return thing


CLUTTER: tuple[Clutter, ...] = (
    *(of_boxes(furniture) for furniture in LIVING_ROOM),
    tripod, floor_lamp, coat_stand, wall_coat, plant, animal, ball_or_cushion, pile, pillar, chair_on_wheels,
    drape, row_of_parts, row_of_parts, assembly, assembly, assembly,
)  # fmt: skip
"""What rooms of training have: known things, and things of no known kind, from which the finder learns that what has no human
shape is no person, whatever it is."""
