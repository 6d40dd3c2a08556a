"""Films: one person moving in one furnished room before one camera, as a depth sensor sees it, with the truth beside it.

A sample (`synth.sample`) is a still; here the whole motion has to stay on the floor, in the picture, between the walls
and clear of the furniture, so it is played once without a camera and then given its place.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from kpopnet.camera import Camera
from synth.body import Person
from synth.markers import MARKERS, tracked_markers
from synth.motion.skeleton import Motion, height_above_floor, multiply
from synth.observe import LIMB_ENDS
from synth.render import make_renderer
from synth.room import Room, View
from synth.sample import heading_rad, on_body
from synth.scene import Scene
from synth.sensor import SensorConfig, measure_labelled

WALL_CLEARANCE_M = 0.2
FURNITURE_CLEARANCE_M = 0.2
REACH_M = (1.2, 4.2)
"""How near and how far from the camera's wall anything of the person may be: where a Kinect v1 is meant to be used."""

PICTURE_MARGIN_PX = 4
PLACES = 24
"""Places drawn for a motion in a room before the room is given up."""

HIDDEN_SHARE = 0.02
"""So much of the person the furniture may hide in any of the frames looked at."""

_EVERY_VERTEX, _EVERY_FRAME, _LOOKED_AT = 7, 2, 15
ROOM, PERSON = 1, 2


@dataclass(frozen=True)
class Played:
    """A motion on a body, at the world's origin: T frames, B bones.

    Attributes:
        person: the body.
        motion: what it does.
        local: (T, B, 4) rotations of the bones.
        hips_m: (T, 3) the hips over the floor.
        skin_m: (N, 3) some vertices of some frames, to find room for,
        hull_m: (M, 3) and those of them between which all lie.
        overlap_m: (T,) how deep any two parts of the body lie in each other.
    """

    person: Person
    motion: Motion
    local: np.ndarray
    hips_m: np.ndarray
    skin_m: np.ndarray
    hull_m: np.ndarray
    overlap_m: np.ndarray

    def __len__(self) -> int:
        return len(self.local)

    def turned(self, yaw_rad: float) -> "Played":
        """Everything turned to the left about the vertical through the origin, where the hips start."""
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        rotation = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])  # of rows
        local = self.local.copy()
        local[:, 0] = multiply(np.array([np.cos(yaw_rad / 2), 0, 0, np.sin(yaw_rad / 2)]), local[:, 0])
        moved = {name: getattr(self, name) @ rotation for name in ("hips_m", "skin_m", "hull_m")}
        return replace(self, local=local, **moved)


@dataclass(frozen=True)
class Take:
    """Where a played motion takes place."""

    played: Played
    room: Room
    view: View
    place_m: np.ndarray  # (3,) what the hips are moved by


@dataclass(frozen=True)
class Film:
    """What the sensor measured over T frames, and what is true.

    Attributes:
        name: of the sequence.
        identity: who it is.
        fps: frames a second.
        camera: its camera.
        depth_m: (T, H, W) float32 metres of the whole scene, 0 where nothing was measured.
        person: (T, H, W) bool, pixels that show the person.
        joints_camera_m: (T, 15, 3) float32.
        markers_camera_m: (T, M, 3) float32, on the skin or cloth, in the order of `synth.markers.MARKERS`.
        markers_tracked: (T, M) bool, the markers that a motion-capture system around the person sees.
        yaw_rad: (T,) float32 the heading, 0 facing the camera, positive to the person's left.
        floor: (4,) float32 unit normal n, upwards, and d with n.x + d = 0 on the floor, camera frame.
        motion: what the motion is made of.
    """

    name: str
    identity: str
    fps: float
    camera: Camera
    depth_m: np.ndarray
    person: np.ndarray
    joints_camera_m: np.ndarray
    markers_camera_m: np.ndarray
    markers_tracked: np.ndarray
    yaw_rad: np.ndarray
    floor: np.ndarray
    motion: str


@dataclass(frozen=True)
class Shot:
    """One frame of a film: see there; floats are float32."""

    depth_m: np.ndarray
    person: np.ndarray
    joints_camera_m: np.ndarray
    markers_camera_m: np.ndarray
    markers_tracked: np.ndarray
    yaw_rad: float


class Studio:
    """One compiled scene and one renderer; a camera that may be put anywhere."""

    def __init__(self, camera: Camera, renderer: str) -> None:
        self.scene = Scene(camera)
        self.renderer = make_renderer(renderer, self.scene)
        self._dressed: Person | None = None

    def close(self) -> None:
        self.renderer.close()

    def play(self, person: Person, motion: Motion, yaw_rad: float, curls_rad: np.ndarray) -> Played:
        """The motion on a body: scaled by its legs, its lowest vertex on the floor but for what the motion hovers.

        Args:
            person: the body.
            motion: on any skeleton, starting anywhere.
            yaw_rad: how far everything is turned to the left; unturned, the motion's +Z comes towards the camera.
            curls_rad: (2,) how far the fingers are bent, left and right.
        """
        scene, scale = self.scene, person.leg_m / motion.leg_m
        self._dress(person)
        local = on_body(scene.asset, motion.quats, yaw_rad, curls_rad)
        hover_m = np.maximum(height_above_floor(motion.quats, motion.root_m), 0) * scale
        # The motion's y is up and z in front: (x, y, z) -> (x, -z, y), then turned.
        left, front = ((motion.root_m - motion.root_m[0])[:, axis].astype(np.float64) * scale for axis in (0, 2))
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        hips_m = np.stack([cos * left + sin * front, sin * left - cos * front, np.zeros(len(left))], axis=1)
        skin_m, overlap_m = [], []
        for frame in range(len(motion)):
            scene.pose(local[frame], np.zeros(3))
            vertices = self.renderer.vertices_world_m()
            hips_m[frame, 2] = hover_m[frame] - vertices[:, 2].min()
            overlap_m.append(scene.penetration_m())
            if frame % _EVERY_FRAME == 0:
                skin_m.append(vertices[::_EVERY_VERTEX] + hips_m[frame])
        skin_m = np.concatenate(skin_m)
        return Played(person, motion, local, hips_m, skin_m, skin_m[ConvexHull(skin_m).vertices], np.array(overlap_m))

    def place(self, rng: np.random.Generator, played: Played, room: Room, view: View) -> Take | None:
        """A place in the room where the whole motion is seen and touches nothing, or None if none was found.

        At every place the whole is turned so that what was played towards the camera goes on doing so.
        """
        scene = self.scene
        back, left, right = room.clear_m()
        first = np.array([left + WALL_CLEARANCE_M, REACH_M[0]])
        last = np.array([right - WALL_CLEARANCE_M, min(back - WALL_CLEARANCE_M, REACH_M[1])])
        least, most = first - played.hull_m.min(axis=0)[:2], last - played.hull_m.max(axis=0)[:2]
        if (least > most).any():
            return None
        scene.look(view)
        scene.furnish(room)
        room_m = self.renderer.room_m()
        for _ in range(PLACES):
            place_m = np.append(rng.uniform(least, most), 0.0)
            turned = played.turned(-np.arctan2(place_m[0], place_m[1]))
            hull_m = turned.hull_m + place_m
            if (hull_m[:, :2] < first).any() or (hull_m[:, :2] > last).any() or not self._in_picture(hull_m, view):
                continue
            if not _touches(room, turned.skin_m + place_m) and not self._hidden(turned, place_m, room_m):
                return Take(turned, room, view, place_m)
        return None

    def _in_picture(self, points_world_m: np.ndarray, view: View) -> bool:
        camera = self.scene.camera
        u, v, z = camera.project(view.to_camera(points_world_m)).T
        off = np.maximum(
            np.abs(u - (camera.width - 1) / 2) - camera.width / 2, np.abs(v - (camera.height - 1) / 2) - camera.height / 2
        )
        return z.min() > 0 and off.max() < -PICTURE_MARGIN_PX

    def _hidden(self, played: Played, place_m: np.ndarray, room_m: np.ndarray) -> bool:
        """Whether furniture stands before the person."""
        self._dress(played.person)
        for frame in range(0, len(played), _LOOKED_AT):
            self.scene.pose(played.local[frame], played.hips_m[frame] + place_m)
            person_m = self.renderer.person_m()
            behind = (person_m > 0) & (room_m > 0) & (room_m < person_m)
            # The floor that the feet stand on is not furniture: rounding hides a sole's last millimetre in it.
            if np.count_nonzero(behind & (person_m - room_m > 0.02)) > HIDDEN_SHARE * np.count_nonzero(person_m):
                return True
        return False

    def shots(self, take: Take, sensor: SensorConfig, noise: Callable[[int], np.random.Generator], frames: range):
        """Yields a `Shot` for each of the frames; frame t's noise comes from noise(t) alone."""
        scene, camera, played = self.scene, self.scene.camera, take.played
        self._dress(played.person)
        scene.look(take.view)
        scene.furnish(take.room)
        room_m = self.renderer.room_m()
        for frame in frames:
            scene.pose(played.local[frame], played.hips_m[frame] + take.place_m)
            person_m = self.renderer.person_m()
            is_person = (person_m > 0) & ((room_m == 0) | (person_m <= room_m))
            labels = np.where(is_person, np.uint8(PERSON), np.uint8(ROOM))
            joints_m = take.view.to_camera(scene.joints_world_m()).astype(np.float32)
            depth_m, seen = measure_labelled(
                np.where(is_person, person_m, room_m), labels, camera, sensor, noise(frame), joints_m[LIMB_ENDS]
            )
            skin_m = self.renderer.vertices_world_m()
            yield Shot(
                depth_m=depth_m,
                person=seen == PERSON,
                joints_camera_m=joints_m,
                markers_camera_m=take.view.to_camera(skin_m[list(MARKERS.values())]).astype(np.float32),
                markers_tracked=tracked_markers(skin_m, take.place_m),
                yaw_rad=heading_rad(scene),
            )

    def _dress(self, person: Person) -> None:
        if self._dressed is not person:
            self.scene.dress(self.scene.fit(person))
            self._dressed = person


def _touches(room: Room, points_world_m: np.ndarray) -> bool:
    """Whether any of (N, 3) points lies in a piece of furniture or within FURNITURE_CLEARANCE_M beside it."""
    for centre, half, yaw in zip(room.centres_m[4:], room.halves_m[4:], room.yaws_rad[4:], strict=True):
        away = points_world_m - centre
        cos, sin = np.cos(yaw), np.sin(yaw)
        along = np.stack([cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0], away[:, 2]], axis=1)
        if (np.abs(along) < half + FURNITURE_CLEARANCE_M).all(axis=1).any():
            return True
    return False
