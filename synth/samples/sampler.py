"""Draws training samples: a random person, posed, placed in a room and rendered to depth, with ground-truth joints.

Sample i is a pure function of (config, seed, split, i): every random generator is seeded from these values only. Any
process on any machine produces the same sample, whichever other samples it produces.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit

from kpopnet.camera import CAMERAS, MM_PER_METRE, Camera
from kpopnet.data.shards import Sample
from kpopnet.errors import InputError, check_between, check_range
from kpopnet.skeleton import Joint
from synth.body.shape import BodyAsset, BodyConfig, Person, draw_person
from synth.motion import SPLITS, MotionConfig, MotionSource, build_motion
from synth.motion.skeleton import JOINT_NAMES as MOTION_BONES
from synth.motion.skeleton import height_above_floor, multiply
from synth.scene.render import RENDERERS, Renderer, make_renderer
from synth.scene.room import Room, View, ViewConfig, draw_room, draw_view
from synth.scene.scene import FittedPerson, Scene

HIPS_HALF_DEPTH_M = 0.25
"""Smallest distance between the hips and a wall."""

BLOCK = 64
"""Number of samples whose poses are drawn in one batch. No sample depends on it."""

SIDES = (("Left", 1.0), ("Right", -1.0))

SURFACE_OFFSET_M = {
    # Largest distance along z by which the measured surface may lie in front of a joint that counts as visible. A nearer
    # surface belongs to another body part.
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
_SURFACE_OFFSET_M = np.array([SURFACE_OFFSET_M[joint] for joint in Joint])


MAX_SIDE_PX = 4096
"""Largest width and height of a camera's image."""


@dataclass(frozen=True)
class CameraConfig:
    """The camera: a preset of `kpopnet.camera.CAMERAS`, or `custom` with square pixels and a centred principal point.

    Attributes:
        name: name of the preset, or custom.
        focal_px: focal length of a custom camera, pixels.
        width: image width of a custom camera, pixels.
        height: image height of a custom camera, pixels.
    """

    name: str = "kinect_v1"
    focal_px: float = 285.63
    width: int = 320
    height: int = 240

    def build(self) -> Camera:
        """The camera's intrinsics.

        Raises:
            InputError: an unknown preset, or a preset with other numbers than its own.
        """
        if self.name == "custom":
            for name in ("width", "height"):
                check_between(f"camera.{name}", getattr(self, name), 1, MAX_SIDE_PX)
            return Camera.centred(self.focal_px, self.width, self.height)
        if self.name not in CAMERAS:
            raise InputError(f"camera.name={self.name}: choose one of {', '.join(CAMERAS)}, or custom with its numbers")
        if (self.focal_px, self.width, self.height) != (CameraConfig.focal_px, CameraConfig.width, CameraConfig.height):
            raise InputError(f"camera={self.name} is a preset with fixed intrinsics; to choose them set camera=custom")
        return CAMERAS[self.name]


@dataclass(frozen=True)
class StageConfig:
    """Where people stand, how they turn, and which poses are rejected.

    Attributes:
        distance_m: range of the hips' distance from the camera along the floor, metres; drawn uniformly.
        off_centre: largest lateral offset of the hips, as a fraction of half the field of view at their distance.
        turned: fraction of the samples with a uniformly random heading; the others face the camera up to `turn_deg`.
        turn_deg: standard deviation of the heading of the people who face the camera, degrees.
        penetration_m: deepest penetration of two body parts that is accepted, metres.
        least_pixels: smallest number of visible pixels of the person; with fewer another place is drawn.
        tries: largest number of poses drawn for a sample; then the one with the smallest penetration is taken.
        place_tries: largest number of places drawn for a pose; then one is taken where the person is partly outside the
            image.
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
        check_range("stage.distance_m", self.distance_m, 0.3, 10)
        if not (0 <= self.turned <= 1 and 0 <= self.off_centre <= 1):
            raise InputError(f"stage.turned={self.turned} and stage.off_centre={self.off_centre} must lie in 0..1")
        limits = {
            "turn_deg": (0, 180),
            "penetration_m": (0, 1),
            "least_pixels": (0, 1e9),
            "tries": (1, 1e6),
            "place_tries": (1, 1e6),
        }
        for name, (low, high) in limits.items():
            check_between(f"stage.{name}", getattr(self, name), low, high)


@dataclass(frozen=True)
class SampleConfig:
    """Everything that a sample depends on besides seed, split and index.

    Attributes:
        body: body shapes, clothes and hair.
        motion: source of the poses.
        camera: intrinsics.
        view: range of camera poses.
        stage: where people stand and which poses are rejected.
        renderer: auto, gl or cpu.
        samples_per_body: number of consecutive samples of the same person.
        samples_per_room: number of consecutive samples in the same room with the same camera pose.
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
    """A clean sample and the statistics of its rejection sampling.

    Attributes:
        sample: the sample as it is stored, except that `room` is the room's number in the whole set.
        rejected: number of poses drawn before this one and rejected.
        forced: no acceptable pose and place was found within the allowed tries; the best one is taken.
    """

    sample: Sample
    rejected: int
    forced: bool


@dataclass(frozen=True)
class RenderedRoom:
    """A rendered empty room.

    Attributes:
        depth_mm: (H, W) uint16 depth, millimetres.
        floor: (4,) float32 floor plane in the camera frame: upward unit normal n and offset d in metres, n.x + d = 0.
        room: the boxes.
        view: the camera pose.
    """

    depth_mm: np.ndarray
    floor: np.ndarray
    room: Room
    view: View


class Sampler:
    """Draws the samples of one split. Holds one compiled scene and one renderer."""

    def __init__(self, config: SampleConfig, seed: int, split: str) -> None:
        """Builds the motion source, the scene and the renderer.

        Raises:
            InputError: an unknown split, or a setting that cannot be built.
        """
        self.config = config
        self.split = split
        self.source: MotionSource = build_motion(config.motion, split)
        self.scene = Scene(config.camera.build())
        self.renderer: Renderer = make_renderer(config.renderer, self.scene)
        self._seed = (seed, SPLITS.index(split))
        self._people: dict[int, FittedPerson] = {}
        self._current_body: int | None = None
        self._room: tuple[int, RenderedRoom] | None = None

    def close(self) -> None:
        """Frees the renderer."""
        self.renderer.close()

    def _rng(self, kind: str, index: int) -> np.random.Generator:
        return np.random.default_rng((*self._seed, ("sample", "body", "room").index(kind), index))

    def person(self, body: int) -> Person:
        """Person number `body` of the split."""
        return draw_person(self._rng("body", body), self.config.body, self.split)

    def room(self, index: int) -> RenderedRoom:
        """Room number `index`, drawn and rendered."""
        if self._room is None or self._room[0] != index:
            rng = self._rng("room", index)
            view, room = draw_view(rng, self.config.view), draw_room(rng)
            self.scene.set_view(view)
            self.scene.set_room(room)
            depth_mm = _millimetres(self.renderer.room_m())
            self._room = index, RenderedRoom(depth_mm, view.floor().astype(np.float32), room, view)
        return self._room[1]

    def room_of(self, index: int) -> int:
        """Number of the room of sample `index`."""
        return index // self.config.samples_per_room

    def samples(self, start: int, stop: int) -> Iterator[RenderedSample]:
        """Yields samples start..stop-1 in order."""
        for block in range(start, stop, BLOCK):
            indices = range(block, min(block + BLOCK, stop))
            generators = [self._rng("sample", index) for index in indices]
            for index, rng, chosen in zip(indices, generators, self._choose_poses(indices, generators), strict=True):
                yield self._render_sample(index, rng, chosen)

    def _choose_poses(self, indices: range, generators: list[np.random.Generator]) -> list["_ChosenPose"]:
        """Draws a pose without self-penetration for each sample. All rejected poses are redrawn in one batch."""
        config, scene = self.config.stage, self.scene
        chosen: list[_ChosenPose | None] = [None] * len(indices)
        pending = list(range(len(indices)))
        for attempt in range(config.tries):
            poses = self.source.poses([generators[k] for k in pending])
            lifts_m = np.maximum(height_above_floor(poses.quats, poses.root_m), 0) / poses.leg_m
            rejected = []
            for j, k in enumerate(pending):
                self._set_person(indices[k])
                local = self._body_rotations(generators[k], poses.quats[j])
                scene.pose(local, np.zeros(3))
                penetration_m = scene.penetration_m()
                if penetration_m > config.penetration_m:
                    rejected.append(k)
                if chosen[k] is None or penetration_m < chosen[k].penetration_m:
                    lift_m = float(lifts_m[j]) * scene.person.leg_m
                    chosen[k] = _ChosenPose(poses.names[j], local, lift_m, penetration_m, rejected=attempt)
            pending = rejected
            if not pending:
                break
        for k in pending:
            chosen[k] = replace(chosen[k], rejected=config.tries)
        return chosen

    def _render_sample(self, index: int, rng: np.random.Generator, chosen: "_ChosenPose") -> RenderedSample:
        """Places the person in the chosen pose and renders the sample."""
        config = self.config.stage
        room = self.room(self.room_of(index))
        self._set_person(index)
        for _ in range(config.place_tries):
            self._place(rng, chosen, room)
            sample = self._render(index, chosen.name, room)
            enough = np.count_nonzero(sample.depth_mm) >= config.least_pixels
            if enough:
                break
        forced = chosen.penetration_m > config.penetration_m or not enough
        return RenderedSample(sample, chosen.rejected, forced)

    def _set_person(self, index: int) -> None:
        """Sets the scene's person to that of sample `index`. The last people are cached."""
        body = index // self.config.samples_per_body
        if self._current_body == body:
            return
        if body not in self._people:
            if len(self._people) > BLOCK:
                self._people.clear()
            self._people[body] = self.scene.fit(self.person(body))
        self.scene.set_person(self._people[body])
        self._current_body = body

    def _body_rotations(self, rng: np.random.Generator, quats: np.ndarray) -> np.ndarray:
        """(B, 4) local rotations of the body's bones from the (23, 4) of a motion, with random heading and finger curl."""
        config = self.config.stage
        yaw = rng.uniform(-np.pi, np.pi) if rng.random() < config.turned else np.radians(config.turn_deg) * rng.normal()
        curls_rad = np.array([rng.uniform(0.0, 1.5) for _ in SIDES])
        return body_rotations(self.scene.asset, quats, yaw, curls_rad)

    def _place(self, rng: np.random.Generator, chosen: "_ChosenPose", room: RenderedRoom) -> None:
        """Places the posed person on the floor, within the walls and, if possible, completely inside the image."""
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

    def _render(self, index: int, name: str, room: RenderedRoom) -> Sample:
        scene, camera = self.scene, self.scene.camera
        depth_mm = np.empty((camera.height, camera.width), np.uint16)
        box = _visible_depth(self.renderer.person_m(), room.depth_mm, depth_mm)
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


def body_rotations(asset: BodyAsset, quats: np.ndarray, yaw_rad: float, curls_rad: np.ndarray) -> np.ndarray:
    """Retargets the rotations of a motion to the bones of the body.

    Args:
        asset: the body.
        quats: (..., 23, 4) local rotations of the motion's joints, w, x, y, z.
        yaw_rad: rotation of the whole person to the left, radians.
        curls_rad: (2,) flexion of the fingers of the left and the right hand, radians.

    Returns:
        (..., B, 4) local rotations relative to the T-pose.
    """
    local = np.zeros((*quats.shape[:-2], len(asset.bone_names), 4))
    local[..., 0] = 1
    # In motions y is up and z is the front; in the world z is up and -y is the front: (x, y, z) -> (x, -z, y).
    local[..., [asset.bone(name) for name in MOTION_BONES], :] = quats[..., (0, 1, 3, 2)] * (1, 1, -1, 1)
    local[..., 0, :] = multiply(np.array([np.cos(yaw_rad / 2), 0, 0, np.sin(yaw_rad / 2)]), local[..., 0, :])
    for (side, sign), curl in zip(SIDES, curls_rad, strict=True):
        curl = sign * curl  # in the T-pose the palms face down, so the fingers flex about the y axis
        for finger in (f"{side}FingerBase", f"{side}HandFinger1"):
            local[..., asset.bone(finger), :] = np.cos(curl / 2), 0, np.sin(curl / 2), 0
    return local


@dataclass(frozen=True)
class _ChosenPose:
    """A pose for one sample.

    Attributes:
        name: name of the pose.
        local: (B, 4) local rotations of the body's bones.
        lift_m: height of the lowest point of the body above the floor, metres.
        penetration_m: largest penetration of two body parts, metres.
        rejected: number of poses rejected before.
    """

    name: str
    local: np.ndarray
    lift_m: float
    penetration_m: float
    rejected: int


def _millimetres(depth_m: np.ndarray) -> np.ndarray:
    """Depth in metres as uint16 millimetres."""
    return np.rint(depth_m * np.float32(MM_PER_METRE)).astype(np.uint16)


def silhouette_box(depth_mm: np.ndarray) -> tuple[int, int, int, int]:
    """Bounding box x0, y0, x1, y1 of the non-zero pixels, the last two exclusive; all 0 for an empty image."""
    rows, columns = np.flatnonzero(depth_mm.any(1)), np.flatnonzero(depth_mm.any(0))
    if not len(rows):
        return 0, 0, 0, 0
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


@njit(cache=True)
def _visible_depth(person_m, room_mm, depth_mm):
    """Writes the person's depth where the room does not occlude it. Returns the bounding box x0, y0, x1, y1."""
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
    """(15,) bool: whether a joint projects onto the visible person and the surface there belongs to its body part."""
    u, v, z = camera.project(joints_camera_m).T
    inside = (z > 0) & (np.abs(u - (camera.width - 1) / 2) < camera.width / 2)
    inside &= np.abs(v - (camera.height - 1) / 2) < camera.height / 2
    row, column = (np.where(inside, np.rint(w), 0).astype(int) for w in (v, u))
    seen_mm = depth_mm[row, column]
    return inside & (seen_mm > 0) & (seen_mm / MM_PER_METRE > z - _SURFACE_OFFSET_M)


def heading_rad(scene: Scene) -> float:
    """Heading of the person about the vertical, radians: 0 faces the camera, positive is turned to the person's left."""
    facing, place = scene.facing_world(), scene.data.qpos[:3] - scene.view.position_m
    return float(np.angle(complex(facing[0], facing[1]) / complex(-place[0], -place[1])))
