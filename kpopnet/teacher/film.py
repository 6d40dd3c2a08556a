"""A film of a try: the teacher's body and the learner's side by side, brighter where the learner does right.

Films are made in a process of their own, one at a time, for as long as their page waits for them.
"""

import asyncio
import contextlib
import os
import time
from collections.abc import AsyncGenerator, Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.runtime.input_files import expect
from kpopnet.runtime.parallel import end_with_parent
from kpopnet.teacher.library import Library, TaughtDance, TeacherBody
from kpopnet.teacher.pages import Process
from kpopnet.teacher.posing import Movement, forward, learners_movement
from kpopnet.teacher.tries import Tries
from kpopnet.viz.overlay import write_video

FPS = 15.0
PANEL_PX, FLOOR_PX = (400, 480), 430
"""Width and height of each half, and the row of the floor."""

MOST_S = 300.0
"""Longest film, which takes about as long to make."""

PX_PER_M = 190.0
MARGIN_M = 0.7
"""The camera follows a body that is farther than this from the middle."""

TELL_EVERY_S = 0.5
END_S = 1.0
"""How long a film that is not wanted any more has to remove what it has written, seconds."""
PATIENCE_S = 2.0
"""A film that is asked for waits as long for one that is being cancelled."""

UNFINISHED = "the film was not finished; make it again"

NICENESS = 5
"""Lessons go first."""

GROUND, TEXT = (24, 24, 28), (235, 235, 235)
COLOURS = {"teacher": np.array([176.0, 91, 196]), "learner": np.array([224.0, 164, 58])}
LIGHT = np.array([0.35, -0.8, 0.5]) / np.linalg.norm([0.35, -0.8, 0.5])
AMBIENT = 0.35
DARKEST = 0.35
"""Brightness of a body that does nothing right."""


def write_film(
    path: Path,
    body: TeacherBody,
    dance: TaughtDance,
    learner: Performance,
    result: dict,
    tell: Callable[[float], None] = lambda fraction: None,
) -> None:
    """Writes an .mp4 file of FPS images a second, at the speed of the try whose joints and result (see `try_result`) are given.

    Before each image `tell` gets the fraction in 0..1 that is done; where it raises an error nothing is written. Raises
    InputError: the try is damaged, or lasts longer than MOST_S; no encoder for videos is installed.
    """
    taught, learned = Movement(dance.quats, dance.hips_m, dance.fps), learners_movement(learner, dance.fps, body)
    begin_s, end_s, speed, scored_s, totals = _course(result, dance.about.seconds)

    def images() -> Iterator[np.ndarray]:
        for time_s in np.arange(begin_s, end_s, speed / FPS):
            tell((time_s - begin_s) / (end_s - begin_s))
            total = float(totals[abs(scored_s - time_s).argmin()])
            right = 1.0 if np.isnan(total) else DARKEST + (1 - DARKEST) * total / 100
            halves = (
                (f"teacher   {time_s:.1f} s", drawn(body, taught, time_s, COLOURS["teacher"])),
                ("you" if np.isnan(total) else f"you   {total:.0f}", drawn(body, learned, time_s, right * COLOURS["learner"])),
            )
            for text, half in halves:
                cv2.putText(half, text, (14, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.7, TEXT, 1, cv2.LINE_AA)
            yield np.concatenate([half for _, half in halves], axis=1)

    write_video(path, images(), FPS)


def _course(result: dict, dance_s: float) -> tuple[float, float, float, np.ndarray, np.ndarray]:
    """Begin and end in seconds of the dance, speed, times and totals of a try's score."""
    try:
        begin_s, end_s, speed = (float(result[name]) for name in ("from_s", "to_s", "speed"))
        scored_s, totals = (np.array(result["course"][name], float) for name in ("time_s", "total"))
        end_s = min(end_s or dance_s, dance_s)
        if not (scored_s.shape == totals.shape == (len(totals),) != (0,) and 0.1 <= speed <= 2 and 0 <= begin_s < end_s):
            raise ValueError
    except (KeyError, TypeError, ValueError) as error:
        raise InputError("this try holds no course of its score; it is damaged") from error
    if (end_s - begin_s) / speed > MOST_S:
        raise InputError(Said("films last up to {seconds} s; dance a part of it, or less slowly", seconds=f"{MOST_S:g}"))
    return begin_s, end_s, speed, scored_s, totals


def drawn(body: TeacherBody, movement: Movement, time_s: float, colour: np.ndarray) -> np.ndarray:
    """One half of an image: the body from the front in a colour (3,), (H, W, 3) uint8 RGB."""
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


class Filming:
    """Makes the films of tries."""

    def __init__(self, library: Library, tries: Tries) -> None:
        self._library, self._tries = library, Tries(tries.folder)  # what it knows of tries need not travel to the process
        self._one, self._ended = asyncio.Lock(), False

    async def make(self, dance: str, name: str) -> AsyncGenerator[float]:
        """Makes the film of a try, if there is none yet, and yields how much is done, 0..1, every TELL_EVERY_S seconds or so.

        Closing this generator ends the work, and nothing is left of it. Raises InputError: there is no such try, its film
        cannot be made, another film is being made, or the server ends.
        """
        if self._tries.film_path(dance, name).is_file():
            return
        try:
            await asyncio.wait_for(self._one.acquire(), PATIENCE_S)
        except TimeoutError as error:
            raise InputError("another film is being made; wait for it, or cancel it where it was begun") from error
        try:
            process, fraction = Process(make_film, (), "film", UNFINISHED), 0.0
            process.send(self._library, self._tries, dance, name)  # larger than a pipe: a start would wait until it is read
            try:
                while fraction < 1:
                    with contextlib.suppress(TimeoutError):
                        kind, content, _ = await asyncio.wait_for(process.next(), TELL_EVERY_S)
                        if kind == "error":
                            raise InputError(content["text"])
                        fraction = content["fraction"]
                    if self._ended:
                        raise InputError("the program ends; make the film again")
                    yield fraction  # also where there is nothing new: writing to a page that has gone fails
            finally:
                process.send("quit")
                await asyncio.to_thread(process.end, time.monotonic() + END_S)
        except OSError as error:
            raise InputError(UNFINISHED) from error
        finally:
            self._one.release()

    def end(self) -> None:
        """Ends the film that is being made, if there is one, and makes no others."""
        self._ended = True


def make_film(connection: Connection) -> None:
    """Makes a film and says how much is done, or what went wrong, until the server says anything or closes the connection.

    First the server says of what: the library, the tries, the dance and the name of the try.
    """
    end_with_parent()
    with contextlib.suppress(AttributeError, OSError):  # where processes have no niceness
        os.nice(NICENESS)
    next_s = 0.0

    def say(kind: str, **content: object) -> None:
        connection.send((0, kind, content, None))

    def tell(fraction: float) -> None:
        nonlocal next_s
        if connection.poll():  # the film is not wanted any more
            raise BrokenPipeError
        if time.monotonic() >= next_s:
            say("progress", fraction=fraction)
            next_s = time.monotonic() + TELL_EVERY_S

    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError, KeyboardInterrupt):
        library, tries, dance, name = connection.recv()
        try:
            learner, result = tries.joints(dance, name), tries.result(dance, name)
            number, dancers = result.get("dancer", 0), library.dance(dance).dancers
            is_one = type(number) is int and number in range(len(dancers))
            expect(is_one, f"{dance}/{name}: dancer", f"one of the {len(dancers)} of the dance")
            path = tries.film_path(dance, name)
            write_film(path, library.body, dancers[number], learner, result, tell)
            try:
                tries.film_path(dance, name)
            except InputError:  # the try was deleted meanwhile, and its film goes with it
                path.unlink(missing_ok=True)
                raise
            say("progress", fraction=1.0)
        except InputError as error:
            say("error", text=error.said)
        except (BrokenPipeError, ConnectionResetError):
            raise
        except OSError as error:
            say("error", text=Said("the film could not be saved: {reason}", reason=error.strerror or str(error)))
