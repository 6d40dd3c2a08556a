"""Clutter of the benchmark `rooms`: kinds of things that no training shows, but for the pillar and the curtain of DANCE_HALL:
the finder's clutter has a pillar and a hanging cloth. A mesh stands on the floor at the origin, z up.
"""

import numpy as np

from synth.rooms.clutter import Clutter, leaning, of_boxes, pole, stretched
from synth.scene.mesh import Mesh, ball, boxes, joined
from synth.scene.room import DANCE_HALL


def dressmakers_dummy(rng: np.random.Generator) -> Mesh:
    """A trunk without head, arms and legs on a stand, as high as a person's."""
    hips, width = rng.uniform(0.8, 1.0), rng.uniform(0.15, 0.2)
    return joined([
        pole(0.02, 0, hips), pole(0.17, 0, 0.03),
        stretched(ball(1.0), (width, 0.65 * width, 0.18), (0, 0, hips)),
        stretched(ball(1.0), (0.8 * width, 0.55 * width, 0.25), (0, 0, hips + 0.2)),
        stretched(ball(1.0), (1.1 * width, 0.6 * width, 0.17), (0, 0, hips + 0.4)),
        pole(0.05, hips + 0.5, hips + 0.65),
    ])  # fmt: skip


def clothes_rail(rng: np.random.Generator) -> Mesh:
    """A rail on two posts with clothes that hang side by side."""
    half, height = rng.uniform(0.4, 0.7), rng.uniform(1.4, 1.7)
    frame = [pole(0.015, 0, height, side * half) for side in (-1, 1)]
    bars = [((0, 0, height), (half, 0.015, 0.015)), *(((side * half, 0, 0.02), (0.02, 0.25, 0.02)) for side in (-1, 1))]
    clothes = []
    for x_m in rng.uniform(-0.85, 0.85, rng.integers(1, 7)) * half:
        low = rng.uniform(0.3, 0.6)
        clothes.append(stretched(ball(1.0), (0.06, rng.uniform(0.18, 0.26), low), (float(x_m), 0, height - low)))
    return joined([*frame, boxes(bars), *clothes])


def punching_bag(rng: np.random.Generator) -> Mesh:
    """A bag as thick as a person and nearly as high, on a foot."""
    radius, height = rng.uniform(0.15, 0.22), rng.uniform(1.4, 1.9)
    return joined([pole(radius, 0.45, height), pole(0.06, 0, 0.5), pole(1.6 * radius, 0, 0.2)])


def inflatable_figure(rng: np.random.Generator) -> Mesh:
    """A stack of balls, such as a snowman."""
    radii = np.sort(rng.uniform(0.14, 0.36, 3))[::-1]
    centres = np.cumsum([radii[0], 0.8 * (radii[0] + radii[1]), 0.8 * (radii[1] + radii[2])])
    return joined([stretched(ball(r), (1, 1, 1), (0, 0, z)) for r, z in zip(radii.tolist(), centres.tolist(), strict=True)])


def stepladder(rng: np.random.Generator) -> Mesh:
    """Two pairs of rails that meet at the top, with steps on the one."""
    height, half, spread = rng.uniform(0.9, 2.0), rng.uniform(0.18, 0.25), rng.uniform(0.25, 0.45)
    rails = [
        leaning(0.02, np.array([side * half, way * spread, 0]), np.array([0.8 * side * half, 0, height]))
        for side in (-1, 1)
        for way in (-1, 1)
    ]
    steps = [((0, -spread * (1 - z / height), z), (half, 0.04, 0.015)) for z in np.arange(0.25, height, 0.25).tolist()]
    return joined([*rails, boxes(steps)])


def easel(rng: np.random.Generator) -> Mesh:
    height, half, low = rng.uniform(1.3, 1.8), rng.uniform(0.2, 0.45), rng.uniform(0.4, 0.7)
    legs = [leaning(0.015, np.array([x, y, 0]), np.array([0, 0, height])) for x, y in ((-0.35, 0), (0.35, 0), (0, 0.5))]
    return joined([*legs, boxes([((0, -0.05, (low + height) / 2), (half, 0.015, (height - low) / 2))])])


def bar_table(rng: np.random.Generator) -> Mesh:
    height = rng.uniform(0.7, 1.15)
    return joined([pole(0.035, 0, height), pole(0.22, 0, 0.03), pole(rng.uniform(0.25, 0.4), height - 0.03, height)])


def parasol(rng: np.random.Generator) -> Mesh:
    height, is_open = rng.uniform(1.9, 2.4), rng.random() < 0.5
    width, long = (rng.uniform(0.6, 1.0), 0.2) if is_open else (0.12, 0.55)
    return joined(
        [pole(0.02, 0, height), pole(0.22, 0, 0.1), stretched(ball(1.0), (width, width, long), (0, 0, height - long))]
    )


def trolley_case(rng: np.random.Generator) -> Mesh:
    w, d, h = rng.uniform(0.18, 0.26), rng.uniform(0.1, 0.16), rng.uniform(0.25, 0.38)
    handle = [((side * 0.5 * w, 0, 2 * h + 0.15), (0.012, 0.012, 0.2)) for side in (-1, 1)]
    return boxes([((0, 0, h + 0.04), (w, d, h)), *handle, ((0, 0, 2 * h + 0.35), (0.5 * w, 0.015, 0.015))])


def drum_kit(rng: np.random.Generator) -> Mesh:
    drums = [(0.0, -0.3, 0.25, 0.0, 0.5), (-0.35, -0.1, 0.18, 0.4, 0.6), (0.4, 0.0, 0.2, 0.25, 0.6), (0.0, 0.4, 0.17, 0.0, 0.5)]
    parts = [pole(radius * rng.uniform(0.9, 1.1), low, high, x, y) for x, y, radius, low, high in drums]
    for x, y in ((-0.6, -0.3), (0.6, -0.35)):
        height = rng.uniform(0.8, 1.2)
        parts += [pole(0.015, 0, height, x, y), pole(0.22, height, height + 0.02, x, y)]
    return joined(parts)


BENCHMARK_CLUTTER: tuple[Clutter, ...] = (
    *(of_boxes(furniture) for furniture in DANCE_HALL),
    dressmakers_dummy, clothes_rail, punching_bag, inflatable_figure, stepladder, easel, bar_table, parasol, trolley_case,
    drum_kit,
)  # fmt: skip


def bar_counter(rng: np.random.Generator) -> Mesh:
    half, depth, height = rng.uniform(0.7, 1.3), rng.uniform(0.2, 0.3), rng.uniform(0.85, 1.1)
    front = ((0, 0.05, height / 2), (half, depth - 0.05, height / 2))
    return boxes([front, ((0, 0, height), (half + 0.05, depth + 0.05, 0.02))])


def tennis_table(rng: np.random.Generator) -> Mesh:
    height = rng.uniform(0.7, 0.8)
    legs = [((x, y, height / 2), (0.03, 0.03, height / 2)) for x in (-0.6, 0.6) for y in (-0.6, 0.6)]
    return boxes([((0, 0, height), (1.37, 0.76, 0.02)), ((0, 0, height + 0.09), (0.01, 0.8, 0.08)), *legs])


def vaulting_box(rng: np.random.Generator) -> Mesh:
    layers = int(rng.integers(3, 6))
    return boxes([((0, 0, 0.2 * k + 0.095), (0.75 - 0.03 * k, 0.3 - 0.03 * k, 0.095)) for k in range(layers)])


def planter(rng: np.random.Generator) -> Mesh:
    half, high = rng.uniform(0.4, 0.8), rng.uniform(0.2, 0.3)
    places = np.arange(-half + 0.1, half, 0.25).tolist()
    bushes = [stretched(ball(0.2), (1, 0.8, rng.uniform(0.8, 2.0)), (x, 0, 2 * high + 0.15)) for x in places]
    return joined([boxes([((0, 0, high), (half, 0.18, high))]), *bushes])


BARRIERS: tuple[Clutter, ...] = (bar_counter, tennis_table, vaulting_box, planter)  # what people stand behind
