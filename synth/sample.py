"""One sample: a person drawn, posed, placed in a room and rendered, with the truth beside the picture.

Sample i is a pure function of (config, seed, split, i): every random number comes from generators seeded by those and
nothing else, so any process on any machine makes the same one, alone or among others.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit

from kpopnet.camera import CAMERAS, MM_PER_METRE, Camera
from kpopnet.errors import InputError
from kpopnet.shards import Sample
from kpopnet.skeleton import Joint
from synth.body import BodyAsset, BodyConfig, Person, draw_person
from synth.motion import SPLITS, MotionConfig, MotionSource, build_motion
from synth.motion.skeleton import JOINT_NAMES as MOTION_BONES
from synth.motion.skeleton import height_above_floor, multiply
from synth.render import RENDERERS, Renderer, make_renderer
from synth.room import Room, View, ViewConfig, draw_room, draw_view
from synth.scene import Fitted, Scene

HIPS_HALF_DEPTH_M = 0.25  # how near a wall may be to the hips
BLOCK = 64  # samples whose poses are drawn together; no sample depends on it
SIDES = (("Left", 1.0), ("Right", -1.0))

COVER_M = {
    # How far in front of a joint its own body part's surface may lie for the joint to count as visible.
    Joint.HEAD: 0.16,
    Joint.NECK: 0.16,
    Joint.TORSO: 0.20,
    Joint.RIGHT_SHOULDER: 0.13,
    Joint.LEFT_SHOULDER: 0.13,
    Joint.RIGHT_HIP: 0.17,
    Joint.LEFT_HIP: 0.17,
    Joint.RIGHT_KNEE: 0.12,
    Joint.LEFT_KNEE: 0.12,
    Joint.RIGHT_ELBOW: 0.09,
    Joint.LEFT_ELBOW: 0.09,
    Joint.RIGHT_HAND: 0.08,
    Joint.LEFT_HAND: 0.08,
    Joint.RIGHT_FOOT: 0.12,
    Joint.LEFT_FOOT: 0.12,
}
_COVER_M = np.array([COVER_M[joint] for joint in Joint])


@dataclass(frozen=True)
class CameraConfig:
    """A preset of `kpopnet.camera.CAMERAS`, or `custom` with square pixels and a centred axis."""

    name: str = "kinect_v1"
    focal_px: float = 285.63
    width: int = 320
    height: int = 240

    def build(self) -> Camera:
        if self.name == "custom":
            return Camera.centred(self.focal_px, self.width, self.height)
        if self.name not in CAMERAS:
            raise InputError(f"camera.name={self.name}: choose one of {', '.join(CAMERAS)}, or custom with its numbers")
        if (self.focal_px, self.width, self.height) != (CameraConfig.focal_px, CameraConfig.width, CameraConfig.height):
            raise InputError(f"camera={self.name} is a preset with its own numbers; for others take camera=custom")
        return CAMERAS[self.name]


@dataclass(frozen=True)
class StageConfig:
    """Where people stand, how they turn, and which poses are refused.

    Attributes:
        distance_m: range of the hips' distance from the camera, uniform.
        off_centre: how far to the side the hips may be, as a share of the half picture.
        turned: share of people who face any direction; the others face the camera but for `turn_deg`.
        turn_deg: standard deviation of the heading of those who face the camera.
        penetration_m: how deep two body parts may lie in each other.
        least_pixels: with fewer pixels of person another place is tried.
        tries: poses drawn for one sample before the least bad is taken.
        place_tries: places drawn for one pose before one is taken where a part of the person is out of the picture.
    """

    distance_m: tuple[float, float] = (1.6, 4.2)
    off_centre: float = 0.6
    turned: float = 0.45
    turn_deg: float = 35.0
    penetration_m: float = 0.02
    least_pixels: int = 400
    tries: int = 16
    place_tries: int = 8

    def __post_init__(self) -> None:
        low, high = self.distance_m
        if not 0.3 <= low <= high <= 10:
            raise InputError(f"stage.distance_m=[{low},{high}] must be an increasing range within 0.3..10 m")
        if not (0 <= self.turned <= 1 and 0 <= self.off_centre <= 1):
            raise InputError(f"stage.turned={self.turned} and stage.off_centre={self.off_centre} must lie in 0..1")
        if self.tries < 1 or self.place_tries < 1:
            raise InputError(f"stage.tries={self.tries} and stage.place_tries={self.place_tries} must be at least 1")


@dataclass(frozen=True)
class SampleConfig:
    """All that a sample depends on besides seed, split and index.

    Attributes:
        samples_per_body: so many samples in a row show the same person.
        samples_per_room: so many in a row share room and camera position.
    """

    body: BodyConfig = field(default_factory=BodyConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    view: ViewConfig = field(default_factory=ViewConfig)
    stage: StageConfig = field(default_factory=StageConfig)
    renderer: str = "auto"
    samples_per_body: int = 8
    samples_per_room: int = 500

    def __post_init__(self) -> None:
        if self.renderer not in RENDERERS:
            raise InputError(f"renderer={self.renderer}: choose one of {', '.join(RENDERERS)}")
        if self.samples_per_body < 1 or self.samples_per_room < 1:
            raise InputError("samples_per_body and samples_per_room must be at least 1")


@dataclass(frozen=True)
class RenderedSample:
    """A clean sample and what it took to get it.

    Attributes:
        sample: as it is stored, but for `room`, which is the room's number in the whole set.
        refused: poses drawn before this one and thrown away.
        forced: none was good within the allowed tries, and this is the least bad.
    """

    sample: Sample
    refused: int
    forced: bool


@dataclass(frozen=True)
class RenderedRoom:
    """An empty room: `depth_mm` (H, W) uint16, `floor` (4,) in the camera frame, and how far people may go."""

    depth_mm: np.ndarray
    floor: np.ndarray
    room: Room
    view: View


class Sampler:
    """Makes samples of one split. Holds one compiled scene and one renderer."""

    def __init__(self, config: SampleConfig, seed: int, split: str) -> None:
        self.config = config
        self.split = split
        self.source: MotionSource = build_motion(config.motion, split)
        self.scene = Scene(config.camera.build())
        self.renderer: Renderer = make_renderer(config.renderer, self.scene)
        self._seed = (seed, SPLITS.index(split))
        self._people: dict[int, Fitted] = {}
        self._dressed: int | None = None
        self._room: tuple[int, RenderedRoom] | None = None

    def close(self) -> None:
        self.renderer.close()

    def _rng(self, kind: str, index: int) -> np.random.Generator:
        return np.random.default_rng((*self._seed, ("sample", "body", "room").index(kind), index))

    def person(self, body: int) -> Person:
        return draw_person(self._rng("body", body), self.config.body, self.split)

    def room(self, index: int) -> RenderedRoom:
        """Room number `index`, drawn and rendered."""
        if self._room is None or self._room[0] != index:
            rng = self._rng("room", index)
            view, room = draw_view(rng, self.config.view), draw_room(rng)
            self.scene.look(view)
            self.scene.furnish(room)
            depth_mm = _millimetres(self.renderer.room_m())
            self._room = index, RenderedRoom(depth_mm, view.floor().astype(np.float32), room, view)
        return self._room[1]

    def room_of(self, index: int) -> int:
        """The number of the room in which sample `index` takes place."""
        return index // self.config.samples_per_room

    def samples(self, start: int, stop: int) -> Iterator[RenderedSample]:
        """Samples start..stop-1 in order."""
        for block in range(start, stop, BLOCK):
            indices = range(block, min(block + BLOCK, stop))
            generators = [self._rng("sample", index) for index in indices]
            for index, rng, chosen in zip(indices, generators, self._choose(indices, generators), strict=True):
                yield self._shoot(index, rng, chosen)

    def _choose(self, indices: range, generators: list[np.random.Generator]) -> list["_Chosen"]:
        """A pose for each sample that does not lie in itself; all that do are drawn anew together."""
        config, scene = self.config.stage, self.scene
        chosen: list[_Chosen | None] = [None] * len(indices)
        pending = list(range(len(indices)))
        for attempt in range(config.tries):
            poses = self.source.poses([generators[k] for k in pending])
            lifts_m = np.maximum(height_above_floor(poses.quats, poses.root_m), 0) / poses.leg_m
            refused = []
            for j, k in enumerate(pending):
                self._dress(indices[k])
                local = self._put_on(generators[k], poses.quats[j])
                scene.pose(local, np.zeros(3))
                overlap_m = scene.penetration_m()
                if overlap_m > config.penetration_m:
                    refused.append(k)
                if chosen[k] is None or overlap_m < chosen[k].overlap_m:
                    lift_m = float(lifts_m[j]) * scene.person.leg_m
                    chosen[k] = _Chosen(poses.names[j], local, lift_m, overlap_m, refused=attempt)
            pending = refused
            if not pending:
                break
        for k in pending:
            chosen[k] = replace(chosen[k], refused=config.tries)
        return chosen

    def _shoot(self, index: int, rng: np.random.Generator, chosen: "_Chosen") -> RenderedSample:
        """Places the chosen pose and takes the picture."""
        config = self.config.stage
        room = self.room(self.room_of(index))
        self._dress(index)
        for _ in range(config.place_tries):
            self._place(rng, chosen, room)
            sample = self._picture(index, chosen.name, room)
            enough = np.count_nonzero(sample.depth_mm) >= config.least_pixels
            if enough:
                break
        forced = chosen.overlap_m > config.penetration_m or not enough
        return RenderedSample(sample, chosen.refused, forced)

    def _dress(self, index: int) -> None:
        """Makes the scene's person that of sample `index`; the last few people stay at hand."""
        body = index // self.config.samples_per_body
        if self._dressed == body:
            return
        if body not in self._people:
            if len(self._people) > BLOCK:
                self._people.clear()
            self._people[body] = self.scene.fit(self.person(body))
        self.scene.dress(self._people[body])
        self._dressed = body

    def _put_on(self, rng: np.random.Generator, quats: np.ndarray) -> np.ndarray:
        """(B, 4) local rotations of the body's bones for (23, 4) of the motion's, with a heading and loose fingers."""
        config = self.config.stage
        yaw = rng.uniform(-np.pi, np.pi) if rng.random() < config.turned else np.radians(config.turn_deg) * rng.normal()
        curls_rad = np.array([rng.uniform(0.0, 1.5) for _ in SIDES])
        return on_body(self.scene.asset, quats, yaw, curls_rad)

    def _place(self, rng: np.random.Generator, chosen: "_Chosen", room: RenderedRoom) -> None:
        """Stands the posed person on the floor, within the walls and if possible wholly in the picture."""
        config, scene, camera = self.config.stage, self.scene, self.scene.camera
        back, left, right = room.room.clear_m()
        scene.pose(chosen.local, np.zeros(3))
        height_m = chosen.lift_m - self.renderer.vertices_world_m()[:, 2].min()
        joints = scene.joints_world_m()
        for _ in range(config.place_tries):
            distance_m = min(rng.uniform(*config.distance_m), back - HIPS_HALF_DEPTH_M)
            half_view_m = config.off_centre * distance_m * camera.width / (2 * camera.fx)
            low, high = max(-half_view_m, left + HIPS_HALF_DEPTH_M), min(half_view_m, right - HIPS_HALF_DEPTH_M)
            place_m = np.array([rng.uniform(low, high), distance_m, height_m])
            u, v, z = camera.project(scene.view.to_camera(joints + place_m)).T
            off = np.maximum(np.abs(u - camera.cx) / camera.width, np.abs(v - camera.cy) / camera.height)
            if z.min() > 0 and off.max() < 0.5:
                break
        scene.pose(chosen.local, place_m)

    def _picture(self, index: int, name: str, room: RenderedRoom) -> Sample:
        scene, camera = self.scene, self.scene.camera
        depth_mm = np.empty((camera.height, camera.width), np.uint16)
        box = _cut_out(self.renderer.person_m(), room.depth_mm, depth_mm)
        joints = scene.view.to_camera(scene.joints_world_m())
        return Sample(
            depth_mm=depth_mm,
            box=box,
            joints_camera_m=joints.astype(np.float32),
            visible=_visible(joints, depth_mm, camera),
            body=index // self.config.samples_per_body,
            motion=name,
            yaw_rad=heading_rad(scene),
            room=self.room_of(index),
            ridge=None,
        )


def on_body(asset: BodyAsset, quats: np.ndarray, yaw_rad: float, curls_rad: np.ndarray) -> np.ndarray:
    """A motion's rotations as those of the body's bones.

    Args:
        asset: the body.
        quats: (..., 23, 4) local rotations of the motion's joints.
        yaw_rad: how far the whole person is turned to the left.
        curls_rad: (2,) how far the fingers of the left and of the right hand are bent.

    Returns:
        (..., B, 4) local rotations away from the T-pose.
    """
    local = np.zeros((*quats.shape[:-2], len(asset.bone_names), 4))
    local[..., 0] = 1
    # The motion's y is up and z in front, the world's z is up and -y in front: (x, y, z) -> (x, -z, y).
    local[..., [asset.bone(name) for name in MOTION_BONES], :] = quats[..., (0, 1, 3, 2)] * (1, 1, -1, 1)
    local[..., 0, :] = multiply(np.array([np.cos(yaw_rad / 2), 0, 0, np.sin(yaw_rad / 2)]), local[..., 0, :])
    for (side, sign), curl in zip(SIDES, curls_rad, strict=True):
        curl = sign * curl  # in the T-pose the palms face down: fingers curl about the y axis
        for finger in (f"{side}FingerBase", f"{side}HandFinger1"):
            local[..., asset.bone(finger), :] = np.cos(curl / 2), 0, np.sin(curl / 2), 0
    return local


@dataclass(frozen=True)
class _Chosen:
    """A pose for one sample: (B, 4) local rotations, how far it hovers, how deep its parts lie in each other."""

    name: str
    local: np.ndarray
    lift_m: float
    overlap_m: float
    refused: int


def _millimetres(depth_m: np.ndarray) -> np.ndarray:
    return np.rint(depth_m * np.float32(MM_PER_METRE)).astype(np.uint16)


def silhouette_box(depth_mm: np.ndarray) -> tuple[int, int, int, int]:
    """x0, y0, x1, y1 around what is not 0, the last two exclusive; all 0 if there is nothing."""
    rows, columns = np.flatnonzero(depth_mm.any(1)), np.flatnonzero(depth_mm.any(0))
    if not len(rows):
        return 0, 0, 0, 0
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


@njit(cache=True)
def _cut_out(person_m, room_mm, depth_mm):
    """Writes the person's depth where nothing of the room is before it; returns x0, y0, x1, y1 around what is left."""
    height, width = person_m.shape
    x0, y0, x1, y1 = width, height, 0, 0
    for y in range(height):
        for x in range(width):
            mm = np.uint16(np.rint(person_m[y, x] * np.float32(MM_PER_METRE)))
            if mm > 0 and 0 < room_mm[y, x] < mm:
                mm = np.uint16(0)
            depth_mm[y, x] = mm
            if mm > 0:
                x0, y0, x1, y1 = min(x0, x), min(y0, y), max(x1, x + 1), max(y1, y + 1)
    return (x0, y0, x1, y1) if x1 > 0 else (0, 0, 0, 0)


def _visible(joints_camera_m: np.ndarray, depth_mm: np.ndarray, camera: Camera) -> np.ndarray:
    """(15,) bool: the joint falls on the person as seen, and what is seen there is its own part's surface."""
    u, v, z = camera.project(joints_camera_m).T
    inside = (z > 0) & (np.abs(u - (camera.width - 1) / 2) < camera.width / 2)
    inside &= np.abs(v - (camera.height - 1) / 2) < camera.height / 2
    row, column = (np.where(inside, np.rint(w), 0).astype(int) for w in (v, u))
    seen_mm = depth_mm[row, column]
    return inside & (seen_mm > 0) & (seen_mm / MM_PER_METRE > z - _COVER_M)


def heading_rad(scene: Scene) -> float:
    """The person's heading about the vertical, 0 facing the camera, positive turned to the person's left."""
    facing, place = scene.facing_world(), scene.data.qpos[:3] - scene.view.position_m
    return float(np.angle(complex(facing[0], facing[1]) / complex(-place[0], -place[1])))
