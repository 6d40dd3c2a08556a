"""Films of `rooms` before they are measured: people of a cast put before a camera, in a room with furniture and clutter.

What does not fit is drawn again: people are before the camera and inside the walls, are not all hidden, and penetrate neither
furniture nor each other, but for those who hug: their distance is the same whatever their size.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kpopnet.camera import CAMERAS, Camera
from kpopnet.skeleton import NUM_JOINTS, Joint
from synth.body.shape import Person
from synth.motion.choreography.pairs import Part
from synth.rooms.held_back import BARRIERS, BENCHMARK_CLUTTER
from synth.rooms.scene import HEIGHT_M, LOST, OUTDOORS, draw_camera, draw_view, nearest_depth_m
from synth.samples.layers import millimetres
from synth.scene.mesh import Mesh, about_z, boxes
from synth.scene.props import platform_under, seat_under
from synth.scene.render import draw_mesh_m, whole_px
from synth.scene.room import DANCE_HALL, Room, View, draw_room, overlaps_boxes, posed_view
from synth.sensor.model import SENSORS, SensorConfig
from synth.simulated.casts import CASTS, FPS
from synth.simulated.film import (
    Played,
    Studio,
    are_apart,
    collides,
    measure_surfaces,
    nearest_surfaces,
    on_stage,
    pixels_of_people,
)
from synth.simulated.sequences import SequenceGenerator

SENSOR_OF_CAMERA = {
    "eval": "kinect_v1", "kinect_v1": "kinect_v1", "smmc10": "swissranger", "kinect_2": "kinect_2",
    "azure_kinect": "kinect_2", "realsense": "kinect_v1",
}  # fmt: skip
"""The sensor model of each preset: its own, or that of the same principle (time of flight, or triangulation)."""

FILM_CAMERAS = ("eval", "kinect_v1", "kinect_2", "smmc10")
FILM_PX = ((160, 120), (320, 240), (640, 576), (848, 480))  # most (width, height) of drawn cameras, pixels
PLACES = 40  # places before a camera that are drawn for a cast

DISTANCE_M, CEILING_DISTANCE_M = (1.2, 5.0), (0.6, 3.5)
"""Ranges of the distance of the middle of the stage from the camera, along the floor."""

CEILING_HEIGHT_M, CEILING_PITCH_DEG = (2.4, 2.9), (35.0, 50.0)
NEAREST_M, WALL_GAP_M = 0.5, 0.1  # least distances: of people and clutter from the camera, of people from walls
LEAST_FRAMES_IN_VIEW = 0.6  # least share of a film's frames in which each person's torso is inside the image
MOST_PENETRATION_M = 0.09
LEAST_CLUTTER, MOST_CLUTTER, CLUTTER_GAP_M = 4, 8, 0.1
"""Least number of things drawn for empty rooms, greatest of any, and their distance from people."""

HIDDEN_BEHIND = 0.15  # least share of a person behind furniture that is hidden in the middle of the film


class Actor(NamedTuple):
    """One person of a film: a motion, and by what it is moved, (3,) metres in the world."""

    played: Played
    place_m: np.ndarray


@dataclass(frozen=True)
class RoomTake:
    """A film before it is measured: people among (K,) meshes before a camera with a pose for all frames, or for each."""

    frames: int
    camera: Camera
    sensor: SensorConfig
    views: tuple[View, ...]
    surroundings: tuple[Mesh, ...]
    actors: tuple[Actor, ...]

    def __len__(self) -> int:
        return self.frames

    def view(self, number: int) -> View:
        return self.views[min(number, len(self.views) - 1)]


class ClearFrame(NamedTuple):
    """A frame of P people without noise; `labels` are those of `nearest_surfaces`."""

    number: int
    depth_m: np.ndarray  # (H, W) float32
    labels: np.ndarray  # (H, W) uint8
    joints_camera_m: np.ndarray  # (P, 15, 3) float32
    whole_px: np.ndarray  # (P,) int


def draw_take(rng: np.random.Generator, kind: str, people: Callable[[int], Person], frames: int) -> RoomTake | None:
    """Draws a film of a kind; None if its people penetrate themselves or each other, or if no place was free and in view."""
    camera, sensor = draw_film_camera(rng)
    studio, parts = Studio(camera, "cpu"), CASTS[kind](rng, frames)
    cast = []
    for number, part in enumerate(parts):
        cast.append(studio.play(people(number), part.motion, part.turn_rad, rng.uniform(0.0, 1.5, 2)))
        if cast[-1].penetration_m.max() > MOST_PENETRATION_M:
            return None
    joints_m = [studio.joints_world_m(one.person, one.local, one.hips_m) for one in cast]
    if kind != "hug" and not are_apart([j + on_stage(part.place_m, 0.0) for j, part in zip(joints_m, parts, strict=True)]):
        return None
    for _ in range(PLACES):
        views = draw_views(rng, kind, frames)
        y_m = rng.uniform(*(CEILING_DISTANCE_M if kind == "ceiling_camera" else DISTANCE_M))
        centre_m = np.array([rng.uniform(-1, 1) * min(y_m * camera.width / (2 * camera.fx), 2.5), y_m, 0.0])
        yaw_rad = -np.arctan2(centre_m[0], centre_m[1])  # what was played towards the camera still faces it
        actors = tuple(
            Actor(one.turned(yaw_rad), on_stage(part.place_m, yaw_rad) + centre_m + (0, 0, part.raised_m))
            for one, part in zip(cast, parts, strict=True)
        )
        torsos_m = [(j[:, Joint.TORSO] @ about_z(yaw_rad).T) + actor.place_m for j, actor in zip(joints_m, actors, strict=True)]
        if not all(_is_in_view(camera, views, torso_m) for torso_m in torsos_m):
            continue
        things = _things(rng, studio, parts, actors)
        surroundings = None if things is None else draw_surroundings(rng, kind, views, actors)
        if things is None or surroundings is None:
            continue
        take = RoomTake(frames, camera, sensor, views, (*surroundings, *things), actors)
        if not actors or _shows(kind, take):
            return take
    return None


def draw_film_camera(rng: np.random.Generator) -> tuple[Camera, SensorConfig]:
    """A camera that exists, or any other, and its sensor."""
    if rng.random() < 0.5:
        name = str(rng.choice(FILM_CAMERAS))
        return CAMERAS[name], SENSORS[SENSOR_OF_CAMERA[name]]
    return draw_camera(rng, FILM_PX[rng.integers(len(FILM_PX))]), SENSORS[str(rng.choice(("kinect_v1", "kinect_2")))]


def draw_views(rng: np.random.Generator, kind: str, frames: int) -> tuple[View, ...]:
    """The camera's pose: one of all frames, or one of each where the camera moves, as half of those in empty rooms do."""
    if kind == "moving_camera" or (kind == "empty_room" and rng.random() < 0.5):
        return _moving_views(rng, frames)
    if kind == "ceiling_camera":
        roll_deg = rng.choice((0, 0, 90, -90, 180)) + 5 * rng.normal()
        position_m = np.array([0, 0, rng.uniform(*CEILING_HEIGHT_M)])
        return (posed_view(position_m, np.radians(rng.uniform(*CEILING_PITCH_DEG)), np.radians(roll_deg)),)
    return (draw_view(rng),)


def _moving_views(rng: np.random.Generator, frames: int) -> tuple[View, ...]:
    """A camera that is carried: it walks, pans, nods and sways smoothly, and shakes a little."""
    seconds = np.arange(frames) / FPS

    def wander(amount: float, least_hz: float = 0.1, most_hz: float = 0.5) -> np.ndarray:
        waves = [np.sin(2 * np.pi * (rng.uniform(least_hz, most_hz) * seconds + rng.random())) for _ in range(2)]
        return amount * np.sum(waves, axis=0) / 2

    height_m = rng.uniform(HEIGHT_M[0] + 0.3, 2.2)
    position_m = np.stack([wander(0.5), wander(0.5), height_m + wander(0.15)], axis=1)
    pitch_rad = np.arctan2(height_m - rng.uniform(0.6, 1.2), rng.uniform(2.0, 4.0))
    shake_rad = [np.radians(wander(amount) + wander(0.4, 1.5, 4.0)) for amount in (8.0, 6.0, 20.0)]
    roll_rad = np.radians(4) * rng.normal()
    turns = zip(pitch_rad + shake_rad[0], roll_rad + shake_rad[1], shake_rad[2], strict=True)
    return tuple(posed_view(place_m, *turn) for place_m, turn in zip(position_m, turns, strict=True))


def draw_surroundings(
    rng: np.random.Generator, kind: str, views: tuple[View, ...], actors: tuple[Actor, ...]
) -> list[Mesh] | None:
    """A floor, mostly walls and a ceiling, furniture, and clutter that is clear of people and camera; None if people are not.

    What people stand behind, in scenes of that kind, is 3 to 30 cm before them.
    """
    skin_m = np.concatenate([np.zeros((0, 3)), *(actor.played.skin_m + actor.place_m for actor in actors)])
    camera_m = np.array([view.position_m for view in views])
    room, indoors = draw_room(rng, DANCE_HALL), rng.random() >= OUTDOORS
    back, left, right = room.clear_m()
    gap_m = (skin_m[:, 0] - left, right - skin_m[:, 0], back - skin_m[:, 1])
    if indoors and (min(one.min(initial=np.inf) for one in gap_m) < WALL_GAP_M or collides(room, skin_m)):
        return None
    if np.linalg.norm(skin_m[:, None] - camera_m[None, ::10], axis=-1).min(initial=np.inf) < NEAREST_M:
        return None
    shown = [rng.random() >= LOST[name] for name in ("floor", "back", "left", "right")]
    shown += [indoors] * (len(room.centres_m) - len(shown))
    meshes = [mesh for mesh, keep in zip(room_meshes(room), shown, strict=True) if keep]
    if not indoors:
        meshes = meshes[: shown[0]]
    elif rng.random() >= LOST["ceiling"]:
        meshes.append(boxes([((0, 2, 3.1), (8, 8, 0.1))]))
    if kind == "behind_furniture":
        along = actors[0].place_m[:2] / np.linalg.norm(actors[0].place_m[:2])
        piece = BARRIERS[rng.integers(len(BARRIERS))](rng)
        front_m = (skin_m[:, :2] @ along).min() - rng.uniform(0.03, 0.3) - piece.vertices_m[:, 1].max()
        if front_m + piece.vertices_m[:, 1].min() < NEAREST_M:
            return None
        meshes.append(piece.moved(about_z(-np.arctan2(*along)), np.append(front_m * along, 0.0)))
    for _ in range(rng.integers(0 if actors else LEAST_CLUTTER, MOST_CLUTTER + 1)):
        thing = BENCHMARK_CLUTTER[rng.integers(len(BENCHMARK_CLUTTER))](rng)
        low_m, high_m = thing.vertices_m.min(axis=0), thing.vertices_m.max(axis=0)
        centre, half, yaw = (low_m + high_m) / 2, (high_m - low_m) / 2, rng.uniform(-np.pi, np.pi)
        y_m = rng.uniform(NEAREST_M, back)
        place_m = np.array([rng.uniform(max(left, -0.5 - 0.7 * y_m), min(right, 0.5 + 0.7 * y_m)), y_m, 0.0])
        reach_m = np.hypot(*half[:2])
        middle_m = place_m + about_z(yaw) @ centre
        inside = left + reach_m < middle_m[0] < right - reach_m and middle_m[1] < back - reach_m
        far = np.linalg.norm(camera_m[:, :2] - middle_m[:2], axis=1).min() > NEAREST_M + reach_m
        box = middle_m[None], half[None], np.array([yaw])
        if inside and far and not overlaps_boxes(skin_m, np.zeros(3), *box, CLUTTER_GAP_M):
            meshes.append(thing.moved(about_z(yaw), place_m))
    return meshes


def room_meshes(room: Room) -> list[Mesh]:
    boxes_of = zip(room.centres_m, room.halves_m.tolist(), room.yaws_rad.tolist(), strict=True)
    return [boxes([((0, 0, 0), half)]).moved(about_z(yaw), centre) for centre, half, yaw in boxes_of]


def _things(rng: np.random.Generator, studio: Studio, parts: list[Part], actors: tuple[Actor, ...]) -> list[Mesh] | None:
    """Seats and beds under the people who need one; None if no seat fits."""
    things = []
    for part, actor in zip(parts, actors, strict=True):
        if part.seated:
            studio.pose(actor.played, 0, actor.place_m)
            if (seat := seat_under(rng, studio.scene, studio.renderer.vertices_world_m())) is None:
                return None
            things.append(seat)
        if part.raised_m:
            skin_m = actor.played.skin_m[:, :2] + actor.place_m[:2]
            things.append(platform_under(rng, skin_m.min(axis=0), skin_m.max(axis=0), part.raised_m))
    return things


def render(take: RoomTake, numbers: range) -> Iterator[ClearFrame]:
    """Renders frames of a film without noise."""
    studios, room_m = [Studio(take.camera, "cpu") for _ in range(max(1, len(take.actors)))], None
    for number in numbers:
        view, people_m, joints_m, pixels = take.view(number), [], [], []
        if room_m is None or len(take.views) > 1:
            for studio in studios:
                studio.scene.set_view(view)
            room_m = nearest_depth_m([draw_mesh_m(studios[0].scene, mesh) for mesh in take.surroundings], take.camera)
        for studio, actor in zip(studios, take.actors, strict=False):
            studio.pose(actor.played, number, actor.place_m)
            mesh = Mesh(studio.renderer.vertices_world_m(), studio.scene.skin.faces)
            people_m.append(draw_mesh_m(studio.scene, mesh))
            joints_m.append(view.to_camera(studio.scene.joints_world_m()))
            pixels.append(whole_px(studio.scene, mesh))
        depth_m, labels = nearest_surfaces(room_m, people_m)
        joints_camera_m = np.array(joints_m, np.float32).reshape(-1, NUM_JOINTS, 3)
        yield ClearFrame(number, depth_m, labels, joints_camera_m, np.array(pixels, np.int32))


class RoomFilms(SequenceGenerator):
    """Makes films of rooms, each before its own camera."""

    images_differ = True

    def shots(self, index: int, take: RoomTake, frames: range) -> Iterator[dict[str, np.ndarray]]:
        noise = self.noise(index)
        for clear in render(take, frames):
            surfaces, joints_m = (clear.depth_m, clear.labels), clear.joints_camera_m
            depth_m, labels = measure_surfaces(surfaces, clear.number, joints_m, take.camera, take.sensor, noise)
            seen_px = pixels_of_people(labels, len(clear.whole_px))
            shot = {"depth": millimetres(depth_m), "joints_m": joints_m}
            yield shot | {"whole_px": np.maximum(clear.whole_px, seen_px), "seen_px": seen_px}


def _shows(kind: str, take: RoomTake) -> bool:
    """Whether at least half of a person shows in the middle of the film, and whether furniture hides a part where it should."""
    clear = next(render(take, range(len(take) // 2, len(take) // 2 + 1)))
    share = pixels_of_people(clear.labels, len(clear.whole_px)) / np.maximum(clear.whole_px, 1)
    return bool(share.max() >= 0.5 and (kind != "behind_furniture" or share.min() <= 1 - HIDDEN_BEHIND))


def _is_in_view(camera: Camera, views: tuple[View, ...], points_m: np.ndarray) -> bool:
    """Whether a point (T, 3) of the world is inside the image in LEAST_FRAMES_IN_VIEW of the frames."""
    if len(views) > 1:
        points = np.array([view.to_camera(point_m) for view, point_m in zip(views, points_m, strict=True)])
    else:
        points = views[0].to_camera(points_m)
    u, v, z = camera.project(points).T
    inside = (z > NEAREST_M) & (u > 0) & (u < camera.width - 1) & (v > 0) & (v < camera.height - 1)
    return bool(inside.mean() >= LEAST_FRAMES_IN_VIEW)
