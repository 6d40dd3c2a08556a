"""A film of a try: the teacher's body and the learner's side by side, brighter where the learner does right."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.teacher.adding import at_rate
from kpopnet.teacher.library import TaughtDance, TeacherBody
from kpopnet.teacher.posing import forward, posed
from kpopnet.viz.overlay import write_video

FPS = 15.0
PANEL_PX, FLOOR_PX = (400, 480), 430
"""Width and height of each half, and the row of the floor."""

MOST_S = 300.0
"""Longest film, which takes about as long to make."""

PX_PER_M = 190.0
MARGIN_M = 0.7
"""The camera follows a body that is farther than this from the middle."""

GROUND, TEXT = (24, 24, 28), (235, 235, 235)
COLOURS = {"teacher": (176, 91, 196), "learner": (224, 164, 58)}
LIGHT = np.array([0.35, -0.8, 0.5]) / np.linalg.norm([0.35, -0.8, 0.5])
AMBIENT = 0.35
DARKEST = 0.35
"""Brightness of a body that does nothing right."""


class Movement(NamedTuple):
    """What a body does: (T, B, 4) rotations of the bones, w first, (T, 3) metres of the root, and the first frame's time."""

    quats: np.ndarray
    hips_m: np.ndarray
    begin_s: float
    fps: float

    def frame(self, time_s: float) -> int:
        return int(np.clip(round((time_s - self.begin_s) * self.fps), 0, len(self.quats) - 1))


def write_film(
    path: Path,
    body: TeacherBody,
    dance: TaughtDance,
    learner: Performance,
    result: dict,
    tell: Callable[[float], None] = lambda fraction: None,
) -> None:
    """Writes an .mp4 file of FPS images a second, at the speed of the try.

    Args:
        path: of the file.
        body: the teacher's, which the learner gets too.
        dance: the teacher's dance.
        learner: the joints of the try.
        result: of the try, see `try_result`.
        tell: is called before each image with the fraction in 0..1 that is done; where it raises an error nothing is written.

    Raises:
        InputError: the try is damaged, or lasts longer than MOST_S; no encoder for videos is installed.
    """
    quats, hips_m = posed(at_rate(learner, dance.fps), body)
    learned = Movement(quats, hips_m, float(learner.times_s[0]), dance.fps)
    taught = Movement(dance.quats, dance.hips_m, 0.0, dance.fps)
    begin_s, end_s, speed, scored_s, totals = _course(result, dance.about.seconds)

    def images() -> Iterator[np.ndarray]:
        for time_s in np.arange(begin_s, end_s, speed / FPS):
            tell((time_s - begin_s) / (end_s - begin_s))
            total = float(totals[abs(scored_s - time_s).argmin()])
            right = 1.0 if np.isnan(total) else DARKEST + (1 - DARKEST) * total / 100
            image = np.concatenate(
                [
                    drawn(body, taught, time_s, COLOURS["teacher"]),
                    drawn(body, learned, time_s, tuple(right * value for value in COLOURS["learner"])),
                ],
                axis=1,
            )
            for text, x_px in (
                (f"teacher   {time_s:.1f} s", 0),
                ("you" if np.isnan(total) else f"you   {total:.0f}", PANEL_PX[0]),
            ):
                cv2.putText(image, text, (x_px + 14, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.7, TEXT, 1, cv2.LINE_AA)
            yield image

    write_video(path, images(), FPS)


def _course(result: dict, dance_s: float) -> tuple[float, float, float, np.ndarray, np.ndarray]:
    """Begin and end in seconds of the dance, speed, times and totals of a try's score."""
    try:
        begin_s, end_s, speed = float(result["from_s"]), float(result["to_s"]) or dance_s, float(result["speed"])
        scored_s, totals = (np.array(result["course"][name], float) for name in ("time_s", "total"))
        end_s, known = min(end_s, dance_s), len(scored_s) == len(totals) > 0 and 0.1 <= speed <= 2
    except (KeyError, TypeError, ValueError) as error:
        raise InputError("this try holds no course of its score; it is damaged") from error
    if not (known and 0 <= begin_s < end_s):
        raise InputError("this try holds no course of its score; it is damaged")
    if (end_s - begin_s) / speed > MOST_S:
        raise InputError(f"films last up to {MOST_S:g} s; dance a part of it, or less slowly")
    return begin_s, end_s, speed, scored_s, totals


def drawn(body: TeacherBody, movement: Movement, time_s: float, colour: tuple[float, float, float]) -> np.ndarray:
    """One half of an image: the body from the front, (H, W, 3) uint8 RGB."""
    width, height = PANEL_PX
    image = np.full((height, width, 3), GROUND, np.uint8)
    cv2.ellipse(image, (width // 2, FLOOR_PX), (width // 2 - 20, 34), 0, 0, 360, (52, 50, 60), -1, cv2.LINE_AA)
    frame = movement.frame(time_s)
    world_m = skinned(body, movement.quats[frame], movement.hips_m[frame])
    x_m = float(movement.hips_m[frame, 0])
    world_m[:, 0] -= np.sign(x_m) * max(abs(x_m) - MARGIN_M, 0)
    # From the front, as a camera sees the dancer: x to the right, z up; the dancer faces -y.
    pixels = np.column_stack([width / 2 + PX_PER_M * world_m[:, 0], FLOOR_PX - PX_PER_M * world_m[:, 2]])
    corners = world_m[body.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    facing = np.flatnonzero(normals[:, 1] < 0)
    shade = AMBIENT + (1 - AMBIENT) * np.maximum(normals[facing] @ LIGHT, 0)
    order = np.argsort(-corners[facing, :, 1].mean(axis=1))  # far ones first
    points = np.round(pixels[body.faces[facing[order]]]).astype(np.int32)
    colours = (np.outer(shade[order], colour)).tolist()
    for triangle, paint in zip(points, colours, strict=True):
        cv2.fillConvexPoly(image, triangle, paint, cv2.LINE_8)
    return image


def skinned(body: TeacherBody, quats: np.ndarray, hips_m: np.ndarray) -> np.ndarray:
    """(N, 3) vertices in the world, z up, of a pose: (B, 4) rotations relative to the parents, w first, and (3,) metres."""
    local = Rotation.from_quat(quats, scalar_first=True).as_matrix()
    world = np.empty_like(local)
    for bone, parent in enumerate(body.bone_parents):
        world[bone] = local[bone] if parent < 0 else world[parent] @ local[bone]
    heads_m = forward(world[None], body)[0] + hips_m
    moved = np.zeros((len(body.vertices_m), 3))
    for slot in range(4):
        bones, weights = body.weight_bones[:, slot].astype(int), body.weights[:, slot, None]
        turned = np.einsum("nij,nj->ni", (world @ body.t_pose)[bones], body.vertices_m - body.heads_m[bones])
        moved += weights * (turned + heads_m[bones])
    return moved
