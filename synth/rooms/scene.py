"""Scenes of zero to six people among clutter, before any camera.

Scene i is a pure function of (seed, split, i). World frame: z up, floor at z = 0, the camera above the origin, looking towards
+y, up or down, and rolled. People are in any pose, some in contact, raised on a bed or a stage, on a seat, or with a thing in
their hands, which counts as theirs. Furniture and things of `clutter` stand anywhere in a room or outdoors, or there is nothing
but people and what they sit on, as in recordings whose background was removed. The image's border, clutter and others may hide
any part of a person.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera
from kpopnet.data.room_images import MOST_PEOPLE
from kpopnet.skeleton import NUM_JOINTS
from synth.rooms.clutter import CLUTTER, Clutter
from synth.samples.placing import Body
from synth.samples.sampler import SampleConfig, Sampler
from synth.scene.mesh import Mesh, about_z, boxes
from synth.scene.props import held_by, is_sitting, platform_under, seat_under
from synth.scene.render import draw_mesh_m, whole_px
from synth.scene.room import View, overlaps_boxes, posed_view

SHARES_OF_COUNTS = (0.12, 0.36, 0.24, 0.13, 0.08, 0.04, 0.03)
"""How many scenes are to show none, one, ..., six people. Who finds no place in PLACE_TRIES is left out: with ALONE, 27 % of
the scenes show none, 33 % one, 20, 10, 5, 4 and 1 % two to six."""

FORMATS = ((4, 3), (4, 3), (4, 3), (16, 9), (1, 1), (10, 9), (6, 5), (3, 4), (9, 11))
"""Width and height of images, in any unit."""

FIELD_OF_VIEW_DEG = (40.0, 120.0)
HEIGHT_M, MOST_PITCH_DEG = (0.3, 3.0), 50.0
DISTANCE_M = (0.5, 7.0)
FRAMED, FRAMED_DISTANCE_M, FRAMED_MARGIN, CUT_MARGIN = 0.5, (1.6, 5.5), 0.2, -0.1
"""In this share of the scenes people stand at such a distance, and their middle lies this share of the image from its border,
as before a camera that a person set up; in the others they may be anywhere, half outside the image."""

NEAREST_M = 0.35  # least distance from the camera to anything that is drawn
PLACE_TRIES, CLUTTER_TRIES = 12, 3
MOST_CLUTTER = 8
CLOSE, CLOSE_M = 0.45, (0.2, 0.8)  # share of the people who stand close to another one, and their distance

MOST_SHARED = 0.02
"""People are apart if at most this share of a body's surface lies in a cell of CELL_M that another's has too."""

CELL_M = 0.05
LOW_M, RAISED, RAISED_M = 0.9, 0.3, (0.1, 0.6)
"""Of the people whose highest point is lower, this share lies or sits on a bed or a stage of such a height."""

SEATED, HOLDS = 0.6, 0.08
OUTDOORS, ALONE = 0.15, 0.08  # shares of the scenes without walls, and of those of people and their seats alone

LOST = {"floor": 0.15, "back": 0.12, "left": 0.08, "right": 0.08, "ceiling": 0.3}
"""Share of the scenes in which a surface returns nothing, because it is dark, shines, is made of glass or is too far away."""


class ClearScene(NamedTuple):
    """One scene without sensor noise, of P people."""

    depth_m: np.ndarray  # (H, W) float32 depth, 0 where nothing returns
    labels: np.ndarray  # (H, W) uint8: 0 for the surroundings, 1..P for a person
    joints_camera_m: np.ndarray  # (P, 15, 3) float32 true joints
    whole_px: np.ndarray  # (P,) pixels that the whole person would have, if the image had no border and nothing else were there
    camera: Camera  # of these pixels
    view: View  # the camera's pose in the world


class Surroundings(NamedTuple):
    """What is drawn besides people; world frame, metres."""

    meshes: list[Mesh]  # surfaces that return something
    centres_m: np.ndarray  # (K, 3) centres of the boxes, yaw 0, that people keep clear of
    halves_m: np.ndarray  # (K, 3) half sizes of these
    walls: tuple[float, float, float, float] | None  # left, right and back wall's distances and the room's turn, of a room


NOTHING = Surroundings([], np.zeros((0, 3)), np.zeros((0, 3)), None)


class RoomScenes(Sampler):
    """Draws the scenes of one split, whose images have at most `most_px` (width, height) pixels."""

    def __init__(
        self, config: SampleConfig, seed: int, split: str, most_px: tuple[int, int], clutter: tuple[Clutter, ...] = CLUTTER
    ) -> None:
        super().__init__(config, seed, split)
        self._most_px, self._clutter = most_px, clutter

    def sensor_rng(self, index: int) -> np.random.Generator:
        """The generator of what a sensor does to scene `index`."""
        return self._rng("props", index)

    def draw_scene(self, index: int) -> ClearScene:
        rng, scene = self._rng("room", index), self.scene
        scene.camera = draw_camera(rng, self._most_px)
        view = draw_view(rng)
        scene.set_view(view)
        alone = rng.random() < ALONE
        around = NOTHING if alone else self._draw_surroundings(rng, view)
        framed = rng.random() < FRAMED
        count = int(rng.choice(MOST_PEOPLE + 1, p=SHARES_OF_COUNTS)) if not alone else int(rng.integers(1, 4))
        nearest_m = nearest_depth_m([draw_mesh_m(scene, mesh) for mesh in around.meshes], scene.camera)
        labels = np.zeros(nearest_m.shape, np.uint8)
        standing: list[tuple[np.ndarray, np.ndarray]] = []  # of each person where the hips are, and the cells that they fill
        joints_m, pixels = [], []
        # Eight scenes in a row show the same people: to dress one takes longer than to draw one.
        numbers = [index // 8 * MOST_PEOPLE + slot for slot in range(count)]
        generators = [self._rng("sample", index * MOST_PEOPLE + slot) for slot in range(count)]
        for pose, own in zip(self._draw_poses(numbers, generators) if count else [], generators, strict=True):
            body = self._posed_body(pose)
            raised_m = 0.0
            if np.ptp(body.vertices_m[:, 2]) < LOW_M and own.random() < RAISED:
                raised_m = own.uniform(*RAISED_M)
            place_m = self._place(own, body, raised_m, standing, around, framed)
            if place_m is None:
                continue
            scene.pose(pose.local, place_m)
            person_m = self.renderer.person_m()
            joints_world_m = scene.joints_world_m()
            joints_m.append(view.to_camera(joints_world_m))
            pixels.append(whole_px(scene, Mesh(self.renderer.vertices_world_m(), scene.skin.faces)))
            things_m = []
            if raised_m and not alone:
                low_m, high_m = body.low_m[:2] + place_m[:2], body.high_m[:2] + place_m[:2]
                things_m.append(draw_mesh_m(scene, platform_under(own, low_m, high_m, raised_m)))
            elif is_sitting(joints_world_m) and own.random() < SEATED:
                seat = seat_under(own, scene, body.vertices_m + place_m)
                if seat is not None:
                    things_m.append(draw_mesh_m(scene, seat))
            if own.random() < HOLDS:
                held_m = draw_mesh_m(scene, held_by(own, scene, left=own.random() < 0.5))
                person_m = nearest_depth_m([person_m, held_m], scene.camera)
            standing.append((place_m, _cells(body, place_m)))
            for thing_m in things_m:
                labels[_put(nearest_m, thing_m)] = 0
            labels[_put(nearest_m, person_m)] = len(standing)
        joints_camera_m = np.array(joints_m, np.float32).reshape(-1, NUM_JOINTS, 3)
        return ClearScene(nearest_m, labels, joints_camera_m, np.array(pixels, np.float32), scene.camera, view)

    def _draw_surroundings(self, rng: np.random.Generator, view: View) -> Surroundings:
        width, far = rng.uniform(1.5, 5.0), rng.uniform(2.0, 9.0)
        high = max(rng.uniform(2.2, 3.6), view.position_m[2] + 0.2)
        planes = {
            "floor": ((0, 4, -0.1), (12, 14, 0.1)),
            "back": ((0, far + 0.1, 3), (12, 0.1, 3)),
            "left": ((-width - 0.1, 4, 3), (0.1, 14, 3)),
            "right": ((width + 0.1, 4, 3), (0.1, 14, 3)),
            "ceiling": ((0, 4, high + 0.1), (12, 14, 0.1)),
        }
        if rng.random() < OUTDOORS:
            planes = {"floor": planes["floor"]}
        meshes = [boxes([box]) for name, box in planes.items() if rng.random() >= LOST[name]]
        turn = rng.uniform(-0.4, 0.4)  # the room, about the camera's wall
        rotation = about_z(turn)
        meshes = [mesh.moved(rotation, np.zeros(3)) for mesh in meshes]
        walls = (-width, width, far, turn) if "back" in planes else None
        centres_m, halves_m = [], []
        for _ in range(rng.integers(0, MOST_CLUTTER + 1)):
            thing = self._clutter[rng.integers(len(self._clutter))](rng)
            yaw = rng.uniform(-np.pi, np.pi)
            thing = thing.moved(about_z(yaw), np.zeros(3))
            low, high_m = thing.vertices_m.min(axis=0), thing.vertices_m.max(axis=0)
            for _ in range(CLUTTER_TRIES):
                y_m = rng.uniform(*DISTANCE_M)
                place_m = np.array([rng.uniform(-1, 1) * (0.5 + 0.9 * y_m), y_m, 0.0])
                centre, half = place_m + (low + high_m) / 2, (high_m - low) / 2
                to_camera_m = np.linalg.norm(np.maximum(np.abs(view.position_m - centre) - half, 0))
                if _outside(centre, walls) or to_camera_m < NEAREST_M:
                    continue
                meshes.append(thing.moved(np.eye(3), place_m))
                centres_m.append(centre)
                halves_m.append(half)
                break
        return Surroundings(meshes, np.reshape(centres_m, (-1, 3)), np.reshape(halves_m, (-1, 3)), walls)

    def _place(
        self,
        rng: np.random.Generator,
        body: Body,
        raised_m: float,
        standing: list[tuple[np.ndarray, np.ndarray]],
        around: Surroundings,
        framed: bool,
    ) -> np.ndarray | None:
        """Draws where the hips are, (3,) metres in the world: in view, clear of things and of other people who stand.

        Of walls the hips are clear: 6 % of people reach more than 2 cm into one. Beds and seats are drawn afterwards and tested
        against no other person, who is in 8 of 10 beds of scenes with others.
        """
        scene, camera = self.scene, self.scene.camera
        yaws_rad = np.zeros(len(around.centres_m))
        distance_m, margin = (FRAMED_DISTANCE_M, FRAMED_MARGIN) if framed else (DISTANCE_M, CUT_MARGIN)
        close = bool(standing) and rng.random() < CLOSE
        for _ in range(PLACE_TRIES):
            if close:
                angle, (beside_m, _) = rng.uniform(-np.pi, np.pi), standing[rng.integers(len(standing))]
                place_m = beside_m + rng.uniform(*CLOSE_M) * np.array([np.cos(angle), np.sin(angle), 0])
            else:
                y_m = rng.uniform(*distance_m)
                place_m = np.array([rng.uniform(-1.1, 1.1) * y_m * camera.width / (2 * camera.fx), y_m, 0.0])
            place_m[2] = body.height_m + raised_m
            u, v, z = camera.project(scene.view.to_camera(place_m + body.torso_m))
            if not (z > NEAREST_M and margin < u / camera.width < 1 - margin and margin < v / camera.height < 1 - margin):
                continue
            if _outside(place_m, around.walls):
                continue
            near_m = np.linalg.norm(body.vertices_m[::9] + (place_m - scene.view.position_m), axis=1).min()
            if near_m < NEAREST_M:
                continue
            if overlaps_boxes(body.vertices_m, place_m, around.centres_m, around.halves_m, yaws_rad, 0.0):
                continue
            cells = _cells(body, place_m)
            if all(np.isin(cells, others).mean() <= MOST_SHARED for _, others in standing):
                return place_m
        return None


def draw_camera(rng: np.random.Generator, most_px: tuple[int, int]) -> Camera:
    """A camera with square pixels whose image fits into (width, height) pixels."""
    wide, high = FORMATS[rng.integers(len(FORMATS))]
    scale = min(most_px[0] / wide, most_px[1] / high)
    width, height = round(wide * scale), round(high * scale)
    focal_px = max(width, height) / (2 * np.tan(np.radians(rng.triangular(FIELD_OF_VIEW_DEG[0], 60, FIELD_OF_VIEW_DEG[1])) / 2))
    off = rng.uniform(-0.02, 0.02, 2) * (width, height)
    return Camera(float(focal_px), float(focal_px), (width - 1) / 2 + off[0], (height - 1) / 2 + off[1], width, height)


def draw_view(rng: np.random.Generator) -> View:
    """A camera pose: most cameras aim at where people are, as those do that a person mounted; the others look anywhere."""
    height_m = rng.uniform(*HEIGHT_M)
    if rng.random() < 0.6:
        pitch = np.arctan2(height_m - rng.uniform(0.4, 1.4), rng.uniform(1.5, 4.0))
    else:
        pitch = np.radians(rng.uniform(-MOST_PITCH_DEG, MOST_PITCH_DEG))
    pitch = np.clip(pitch, *np.radians((-MOST_PITCH_DEG, MOST_PITCH_DEG)))
    mounted = rng.random()
    if mounted < 0.75:
        roll = np.radians(3) * rng.normal()
    elif mounted < 0.88:
        roll = np.radians(rng.uniform(-30, 30))
    else:
        roll = np.radians(rng.choice((90, -90, 180)) + 5 * rng.normal())
    return posed_view(np.array([0, 0, height_m]), pitch, roll)


def _outside(point_m: np.ndarray, walls: tuple[float, float, float, float] | None) -> bool:
    """Whether a point lies behind a wall, or nearer than 25 cm to it."""
    if walls is None:
        return False
    left, right, far, turn = walls
    x, y, _ = about_z(-turn) @ point_m
    return not (left + 0.25 < x < right - 0.25 and y < far - 0.25)


def _cells(body: Body, place_m: np.ndarray) -> np.ndarray:
    """The numbers of the cells of CELL_M that a body's surface touches, one for every third vertex."""
    cells = np.floor((body.vertices_m[::3] + place_m) / CELL_M).astype(np.int64) + 1000
    return (cells[:, 0] << 42) + (cells[:, 1] << 21) + cells[:, 2]


def nearest_depth_m(depths_m: list[np.ndarray], camera: Camera) -> np.ndarray:
    """(H, W) the nearest of several depth images, in which 0 is nothing."""
    nearest_m = np.zeros((camera.height, camera.width), np.float32)
    for depth_m in depths_m:
        _put(nearest_m, depth_m)
    return nearest_m


def _put(nearest_m: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
    """Draws a thing into a depth image, in place; returns (H, W) bool, the pixels where it is the nearest."""
    closer = (depth_m > 0) & ((nearest_m == 0) | (depth_m < nearest_m))
    nearest_m[closer] = depth_m[closer]
    return closer
