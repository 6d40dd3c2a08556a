"""Films: depth sequences of one person who moves in one room in front of one static camera, with ground truth.

A sample (`synth.samples.sampler`) is a single frame. In a film the whole motion has to stay on the floor, inside the image,
between the walls and clear of the furniture. So the motion is first applied to the body without a camera (`Studio.play`), and a
position in a room is searched for afterwards (`Studio.place_in_rooms`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from kpopnet.camera import Camera
from kpopnet.dance.joint_files.points import CAMERA_DISTANCE_M, CAMERA_HEIGHT_M
from kpopnet.rotations import about, multiply
from synth.body.markers import MARKERS, tracked_markers
from synth.body.shape import Person
from synth.motion.skeleton import Motion, height_above_floor
from synth.samples.observe import LIMB_ENDS
from synth.samples.sampler import body_rotations
from synth.scene.mesh import about_z
from synth.scene.render import make_renderer
from synth.scene.room import Furniture, Room, View, ViewConfig, draw_room, draw_view, overlaps_boxes
from synth.scene.scene import Scene
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SensorConfig, measure_labelled

WALL_CLEARANCE_M = 0.2
FURNITURE_CLEARANCE_M = 0.2
DISTANCE_RANGE_M = (1.2, 4.2)
"""Least and greatest distance of any point of the person from the camera's wall: the range for which a Kinect v1 is made."""

IMAGE_MARGIN_PX = 4
PLACES = 24  # positions drawn for a motion in a room before the room is rejected
ROOM_BOXES = 4  # A room's first boxes: the floor and three walls. The others are furniture.

MAX_OCCLUDED_FRACTION = 0.02
"""Greatest fraction of the person's pixels that furniture may occlude in any of the tested frames."""

_VERTEX_STRIDE, _FRAME_STRIDE, _OCCLUSION_STRIDE = 7, 2, 15
"""Vertices and frames of which the skin is kept for collision tests; frames that are tested for occlusion."""

APART_M = 0.15  # least distance between joints of two people who do not hug
ROOM, PERSON = 1, 2  # pixel labels

LEVEL_VIEW = View(np.array([0, -CAMERA_DISTANCE_M, CAMERA_HEIGHT_M]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))


@dataclass(frozen=True)
class Played:
    """A motion applied to a body at the world's origin: T frames, B bones."""

    person: Person
    motion: Motion
    local: np.ndarray  # (T, B, 4) local rotations of the bones, unit quaternions
    hips_m: np.ndarray  # (T, 3) positions of the hips in the world, metres
    skin_m: np.ndarray  # (N, 3) a subset of the vertices in a subset of the frames, for collision tests, metres
    hull_m: np.ndarray  # (M, 3) the vertices of the convex hull of `skin_m`, metres
    penetration_m: np.ndarray  # (T,) greatest depth by which two parts of the body penetrate each other, metres

    def __len__(self) -> int:
        return len(self.local)

    def turned(self, yaw_rad: float) -> "Played":
        """The same rotated to the left, by an angle in radians, about the vertical axis through the origin."""
        local = self.local.copy()
        local[:, 0] = multiply(about(2, yaw_rad), local[:, 0])
        rotation = about_z(-yaw_rad)  # multiplies row vectors
        rotated = {name: getattr(self, name) @ rotation for name in ("hips_m", "skin_m", "hull_m")}
        return replace(self, local=local, **rotated)


@dataclass(frozen=True)
class Take:
    """A motion on a body in a room before a camera; the hips are moved by `place_m`, (3,) metres in the world."""

    played: Played
    room: Room
    view: View
    place_m: np.ndarray

    def __len__(self) -> int:
        return len(self.played)


@dataclass(frozen=True)
class CleanFrame:
    """Frame `number` of a take without sensor noise."""

    number: int
    person_m: np.ndarray  # (H, W) float32 depth of the person without the room, metres, 0 elsewhere
    room_m: np.ndarray  # (H, W) float32 depth of the room without the person, metres, 0 where it has no surface
    joints_camera_m: np.ndarray  # (15, 3) float32 true joints, metres


class Studio:
    """One compiled scene and its renderer, with a camera whose pose can be changed."""

    def __init__(self, camera: Camera, renderer: str) -> None:
        self.scene = Scene(camera)
        self.renderer = make_renderer(renderer, self.scene)

    def play(self, person: Person, motion: Motion, yaw_rad: float, curls_rad: np.ndarray) -> Played:
        """Applies a motion, on any skeleton and starting at any position, to a body.

        Translations are scaled by the ratio of the legs' lengths. In each frame the lowest vertex lies on the floor, or above
        it by the scaled height that the motion's skeleton has above the floor. The body is turned to the left by `yaw_rad`; at
        0 the motion's +Z axis points towards the camera. `curls_rad` (2,) is the flexion of the left and right fingers.
        """
        scene, scale = self.scene, person.leg_m / motion.leg_m
        scene.set_person(person)
        local = body_rotations(scene.asset, motion.quats, yaw_rad, curls_rad)
        hover_m = np.maximum(height_above_floor(motion.quats, motion.root_m, motion.leg_m), 0) * scale
        # The motion's y is up and its z in front: (x, y, z) -> (x, -z, y), then rotated by yaw_rad.
        left, front = ((motion.root_m - motion.root_m[0])[:, axis].astype(np.float64) * scale for axis in (0, 2))
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        hips_m = np.stack([cos * left + sin * front, sin * left - cos * front, np.zeros(len(left))], axis=1)
        skin_m, penetration_m = [], []
        for frame in range(len(motion)):
            scene.pose(local[frame], np.zeros(3))
            vertices = self.renderer.vertices_world_m()
            hips_m[frame, 2] = hover_m[frame] - vertices[:, 2].min()
            penetration_m.append(scene.penetration_m())
            if frame % _FRAME_STRIDE == 0:
                skin_m.append(vertices[::_VERTEX_STRIDE] + hips_m[frame])
        skin_m = np.concatenate(skin_m)
        return Played(person, motion, local, hips_m, skin_m, skin_m[ConvexHull(skin_m).vertices], np.array(penetration_m))

    def _place(self, rng: np.random.Generator, played: Played, room: Room, view: View) -> Take | None:
        """Searches a position in the room where the whole motion is visible and collides with nothing; None if PLACES do not.

        At every position the motion is rotated, so that what was played towards the camera still faces it.
        """
        first, last = standing_room_m(room)
        lower, upper = first - played.hull_m.min(axis=0)[:2], last - played.hull_m.max(axis=0)[:2]
        if (lower > upper).any():
            return None
        room_m = self.furnish(room, view)
        for _ in range(PLACES):
            place_m = np.append(rng.uniform(lower, upper), 0.0)
            take = Take(played.turned(-np.arctan2(place_m[0], place_m[1])), room, view, place_m)
            if self.in_image(take) and self.is_clear(take, room_m):
                return take
        return None

    def furnish(self, room: Room, view: View) -> np.ndarray:
        """Sets room and camera of the scene; returns the (H, W) depth of the room without people, metres."""
        self.scene.set_view(view)
        self.scene.set_room(room)
        return self.renderer.room_m()

    def is_clear(self, take: Take, room_m: np.ndarray) -> bool:
        """Whether nothing of the room is in the way: walls, furniture, or what hides the person.

        The take is in the room and before the camera of the last `furnish`, whose result is `room_m`.
        """
        (first, last), hull_m = standing_room_m(take.room), take.played.hull_m[:, :2] + take.place_m[:2]
        if (hull_m < first).any() or (hull_m > last).any():
            return False
        return not collides(take.room, take.played.skin_m + take.place_m) and not self._is_occluded(take, room_m)

    def place_in_rooms(
        self, rng: np.random.Generator, played: Played, view_config: ViewConfig, rooms: int, furniture: tuple[Furniture, ...]
    ) -> Take | None:
        """Draws rooms and views until one has a position for the motion; None if none of `rooms` rooms has one."""
        for _ in range(rooms):
            view, room = draw_view(rng, view_config), draw_room(rng, furniture)
            if (take := self._place(rng, played, room, view)) is not None:
                return take
        return None

    def in_image(self, take: Take) -> bool:
        """Whether the whole motion stays inside the image, IMAGE_MARGIN_PX from its border."""
        camera = self.scene.camera
        u, v, z = camera.project(take.view.to_camera(take.played.hull_m + take.place_m)).T
        outside_px = np.maximum(
            np.abs(u - (camera.width - 1) / 2) - camera.width / 2, np.abs(v - (camera.height - 1) / 2) - camera.height / 2
        )
        return z.min() > 0 and outside_px.max() < -IMAGE_MARGIN_PX

    def _is_occluded(self, take: Take, room_m: np.ndarray) -> bool:
        """Whether furniture occludes the person in any of the tested frames."""
        for frame in range(0, len(take), _OCCLUSION_STRIDE):
            self.pose(take.played, frame, take.place_m)
            person_m = self.renderer.person_m()
            occluded = (person_m > 0) & (room_m > 0) & (room_m < person_m)
            # The floor under the feet is not furniture: by rounding, it may occlude the last millimetre of a sole.
            if np.count_nonzero(occluded & (person_m - room_m > 0.02)) > MAX_OCCLUDED_FRACTION * np.count_nonzero(person_m):
                return True
        return False

    def joints_world_m(self, person: Person, local: np.ndarray, hips_m: np.ndarray) -> np.ndarray:
        """(T, 15, 3) joints in the world, metres, from (T, B, 4) local rotations and (T, 3) positions of the hips, metres."""
        self.scene.set_person(person)
        joints = []
        for quats, root_m in zip(local, hips_m, strict=True):
            self.scene.pose(quats, root_m)
            joints.append(self.scene.joints_world_m())
        return np.array(joints)

    def level_joints_m(self, played: Played) -> np.ndarray:
        """(T, 15, 3) float32 joints, metres, in the frame of a level camera that a person at the world's origin faces."""
        return LEVEL_VIEW.to_camera(self.joints_world_m(played.person, played.local, played.hips_m)).astype(np.float32)

    def render(self, take: Take, frames: range) -> Iterator[CleanFrame]:
        """Renders frames of a take without noise. The scene keeps the pose of a frame until the next one is requested."""
        room_m = self.furnish(take.room, take.view)
        for number in frames:
            self.pose(take.played, number, take.place_m)
            yield self.clean_frame(number, room_m)

    def clean_frame(self, number: int, room_m: np.ndarray) -> CleanFrame:
        """The posed person in the room of the last `furnish`, whose result is `room_m`, as frame `number`."""
        joints_m = self.scene.view.to_camera(self.scene.joints_world_m()).astype(np.float32)
        return CleanFrame(number, self.renderer.person_m(), room_m, joints_m)

    def shots(self, take: Take, sensor: SensorConfig, noise: FilmNoise, frames: range) -> Iterator[dict[str, np.ndarray]]:
        """Renders and measures frames of a take: what `measure_frame` returns, true joints (15, 3) and markers (M, 3), metres.

        The markers on skin or clothes, in the order of `synth.body.markers.MARKERS`, are NaN where no motion-capture system
        around the person would see them. A frame is the same whichever others are made.
        """
        for clean in self.render(take, frames):
            depth_m, person = measure_frame(clean, self.scene.camera, sensor, noise)
            skin_m = self.renderer.vertices_world_m()
            markers_m = take.view.to_camera(skin_m[list(MARKERS.values())]).astype(np.float32)
            markers_m[~tracked_markers(skin_m, take.place_m)] = np.nan
            yield {"depth_m": depth_m, "person": person, "joints_camera_m": clean.joints_camera_m, "markers_m": markers_m}

    def pose(self, played: Played, number: int, place_m: np.ndarray) -> None:
        """Poses the person of a motion as in frame `number`, moved by (3,) metres in the world."""
        self.scene.set_person(played.person)
        self.scene.pose(played.local[number], played.hips_m[number] + place_m)


def measure_frame(clean: CleanFrame, camera: Camera, sensor: SensorConfig, noise: FilmNoise) -> tuple[np.ndarray, np.ndarray]:
    """Applies the sensor model to a clean frame.

    (H, W) float32 depth in metres, 0 where nothing was measured, and bool, pixels that show the person.
    """
    surfaces = nearest_surfaces(clean.room_m, [clean.person_m])
    depth_m, labels = measure_surfaces(surfaces, clean.number, clean.joints_camera_m, camera, sensor, noise)
    return depth_m, labels == PERSON


def measure_surfaces(
    surfaces: tuple[np.ndarray, np.ndarray],
    number: int,
    joints_camera_m: np.ndarray,
    camera: Camera,
    sensor: SensorConfig,
    noise: FilmNoise,
) -> tuple[np.ndarray, np.ndarray]:
    """Applies the sensor model to frame `number`: the result of `nearest_surfaces`, and (..., 15, 3) joints of all, metres.

    (H, W) float32 depth in metres, 0 where nothing was measured, and (H, W) uint8 labels of what was measured.
    """
    rng, shared = noise.frame(number)
    ends_m = joints_camera_m[..., LIMB_ENDS, :].reshape(-1, 3)
    return measure_labelled(*surfaces, camera, sensor, rng, ends_m, shared)


def nearest_surfaces(room_m: np.ndarray, people_m: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) depth of what is nearest, metres, and (H, W) uint8 labels: ROOM, or for person k PERSON + k.

    From (H, W) depths of the room and of each person alone, metres, 0 without a surface.
    """
    depth_m, labels = room_m.copy(), np.full(room_m.shape, ROOM, np.uint8)
    for label, person_m in enumerate(people_m, PERSON):
        nearer = (person_m > 0) & ((depth_m == 0) | (person_m <= depth_m))
        depth_m[nearer], labels[nearer] = person_m[nearer], label
    return depth_m, labels


def pixels_of_people(labels: np.ndarray, people: int) -> np.ndarray:
    """(P,) int32 pixels of (H, W) labels of `nearest_surfaces` that show each person."""
    return np.bincount(labels.ravel(), minlength=PERSON + people)[PERSON : PERSON + people].astype(np.int32)


def are_apart(joints_m: list[np.ndarray]) -> bool:
    """Whether the joints (T, 15, 3) of any two people stay APART_M from each other."""
    pairs = ((one, other) for number, one in enumerate(joints_m) for other in joints_m[:number])
    return all(np.linalg.norm(one[:, :, None] - other[:, None], axis=-1).min() >= APART_M for one, other in pairs)


def on_stage(place_m: tuple[float, float], yaw_rad: float) -> np.ndarray:
    """(3,) position from the middle of a stage turned to the left, world frame, metres: z of the place faces the camera."""
    (x, z), cos, sin = place_m, np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([cos * x + sin * z, sin * x - cos * z, 0.0])


def standing_room_m(room: Room) -> tuple[np.ndarray, np.ndarray]:
    """The corners (2,) x and y of the floor on which people may be: clear of walls and within DISTANCE_RANGE_M, metres."""
    back, left, right = room.clear_m()
    first = np.array([left + WALL_CLEARANCE_M, DISTANCE_RANGE_M[0]])
    last = np.array([right - WALL_CLEARANCE_M, min(back - WALL_CLEARANCE_M, DISTANCE_RANGE_M[1])])
    return first, last


def collides(room: Room, points_world_m: np.ndarray) -> bool:
    """Whether any of (N, 3) points lies inside a piece of furniture or within FURNITURE_CLEARANCE_M of it."""
    furniture = (array[ROOM_BOXES:] for array in (room.centres_m, room.halves_m, room.yaws_rad))
    return overlaps_boxes(points_world_m, np.zeros(3), *furniture, FURNITURE_CLEARANCE_M)
