"""Draws training samples: a random person, posed, placed in a room and rendered to depth, with ground-truth joints.

Sample i is a pure function of (config, seed, split, i): every random generator is seeded from these values only. Any
process on any machine produces the same sample, whichever other samples it produces.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kpopnet.camera import CAMERAS, Camera
from kpopnet.data.shards import Sample
from kpopnet.errors import InputError, check_between
from kpopnet.rotations import about, multiply
from kpopnet.skeleton import Joint
from synth.body.asset import BodyAsset
from synth.body.shape import BodyConfig, Person, draw_person
from synth.motion import SPLITS, MotionConfig, MotionSource, build_motion
from synth.motion.skeleton import JOINT_NAMES as MOTION_BONES
from synth.motion.skeleton import height_above_floor
from synth.samples.layers import Around, compose, hidden_fraction, millimetres, visible_joints
from synth.samples.placing import MISFRAMED, SOUND, UNSEEN, Body, Site, StageConfig, draw_place, draw_place_beside, faults
from synth.scene.props import PropsConfig, held_by, is_sitting, seat_under
from synth.scene.render import draw_mesh_m, make_renderer
from synth.scene.room import LIVING_ROOM, ViewConfig, draw_room, draw_view
from synth.scene.scene import Scene

BLOCK = 64  # samples whose poses are drawn in one batch; no sample depends on it
MAX_SIDE_PX = 4096  # of a camera's image

_STREAMS = ("sample", "body", "room", "props")
"""What is drawn from a generator of its own, by number. The order is part of every sample."""

OTHER_PEOPLE = 1000  # the second person of a sample is one of the split's next people, up to this many numbers on
ATTACHED_M = (0.03, 0.12)  # range of the distance within which a seat or another person is segmented as the person
MAX_HIDDEN = 0.5  # largest fraction of a person's pixels that another person may hide

FINGER_FLEXION = {"FingerBase": 0.2, "HandFinger1": 1.4}
"""Bones of the fingers, and by how much of the drawn angle each flexes: FingerBase lies in the palm, which hardly bends."""


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
        """The camera's intrinsics; raises InputError if the preset is unknown or has other numbers."""
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
class SampleConfig:
    """Everything that a sample depends on besides seed, split and index.

    Attributes:
        body: body shapes, clothes and hair.
        motion: source of the poses.
        camera: intrinsics.
        view: range of camera poses.
        stage: where people stand and which poses are rejected.
        props: things and people that hide a person or are segmented with them.
        renderer: auto, gl or cpu.
        samples_per_body: consecutive samples of the same person.
        samples_per_room: consecutive samples in the same room with the same camera pose.
    """

    body: BodyConfig = field(default_factory=BodyConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    view: ViewConfig = field(default_factory=ViewConfig)
    stage: StageConfig = field(default_factory=StageConfig)
    props: PropsConfig = field(default_factory=PropsConfig)
    renderer: str = "auto"
    samples_per_body: int = 8
    samples_per_room: int = 25

    def __post_init__(self) -> None:
        for name in ("samples_per_body", "samples_per_room"):
            check_between(name, getattr(self, name), 1, 1e9)


class RenderedSample(NamedTuple):
    sample: Sample  # as it is stored, except that `room` is the room's number in the whole set
    rejected: int  # number of poses drawn before this one
    refused_places: int  # number of places drawn before this one
    # No pose without self-penetration, or no free place with enough visible pixels, was found within the allowed tries; the
    # best one is taken.
    forced: bool
    around: Around  # what is drawn around the person or in their hands


class _Pose(NamedTuple):
    """A pose for person `number`: (B, 4) local rotations of the bones, the height of the lowest point above the floor, the
    largest penetration of two body parts, both in metres, and the number of poses rejected before.
    """

    number: int
    name: str
    local: np.ndarray
    lift_m: float
    penetration_m: float
    rejected: int


class _Placed(NamedTuple):
    """The person of sample `index` in a pose at a place, (3,) metres, in a room; `body` is the posed body."""

    index: int
    pose: _Pose
    body: Body
    place_m: np.ndarray
    room: Site


class Sampler:
    """Draws the samples of one split. Holds one compiled scene and one renderer."""

    def __init__(self, config: SampleConfig, seed: int, split: str) -> None:
        """Builds the motion source, the scene and the renderer; raises InputError if a setting cannot be built."""
        self.config, self.split = config, split
        self.source: MotionSource = build_motion(config.motion, split)
        self.scene = Scene(config.camera.build())
        self.renderer = make_renderer(config.renderer, self.scene)
        self._seed = (seed, SPLITS.index(split))
        self._known_person = lru_cache(BLOCK)(self.person)
        self.room = lru_cache(1)(self._room)  # the scene shows the last one

    def close(self) -> None:
        self.renderer.close()

    def _rng(self, kind: str, index: int) -> np.random.Generator:
        return np.random.default_rng((*self._seed, _STREAMS.index(kind), index))

    def person(self, number: int) -> Person:
        return draw_person(self._rng("body", number), self.config.body, self.split)

    def _room(self, index: int) -> Site:
        rng = self._rng("room", index)
        view, room = draw_view(rng, self.config.view), draw_room(rng, LIVING_ROOM)
        self.scene.set_view(view)
        self.scene.set_room(room)
        depth_mm, floor = millimetres(self.renderer.room_m()), view.floor().astype(np.float32)
        return Site(room, view, self.scene.camera, depth_mm, floor)

    def room_of(self, index: int) -> int:
        return index // self.config.samples_per_room

    def samples(self, start: int, stop: int) -> Iterator[RenderedSample]:
        """Yields samples start..stop-1 in order."""
        for block in range(start, stop, BLOCK):
            indices = range(block, min(block + BLOCK, stop))
            generators = [self._rng("sample", index) for index in indices]
            poses = self._draw_poses([index // self.config.samples_per_body for index in indices], generators)
            for index, rng, pose in zip(indices, generators, poses, strict=True):
                yield self._draw_sample(index, rng, pose)

    def _draw_poses(self, numbers: list[int], generators: list[np.random.Generator]) -> list[_Pose]:
        """Draws a pose without self-penetration for each person. All rejected poses are redrawn in one batch."""
        config, scene = self.config.stage, self.scene
        chosen: list[_Pose | None] = [None] * len(numbers)
        pending = list(range(len(numbers)))
        for attempt in range(config.tries):
            poses = self.source.poses([generators[k] for k in pending])
            lifts_m = np.maximum(height_above_floor(poses.quats, poses.root_m, poses.leg_m), 0) / poses.leg_m
            rejected = []
            for j, k in enumerate(pending):
                rng = generators[k]
                scene.set_person(self._known_person(numbers[k]))
                faces_camera = rng.random() >= config.turned
                yaw_rad = np.radians(config.turn_deg) * rng.normal() if faces_camera else rng.uniform(-np.pi, np.pi)
                local = body_rotations(scene.asset, poses.quats[j], yaw_rad, rng.uniform(0.0, 1.5, 2))
                scene.pose(local, np.zeros(3))
                penetration_m = scene.penetration_m()
                if penetration_m > config.penetration_m:
                    rejected.append(k)
                if chosen[k] is None or penetration_m < chosen[k].penetration_m:
                    lift_m = float(lifts_m[j]) * scene.person.leg_m
                    chosen[k] = _Pose(numbers[k], poses.names[j], local, lift_m, penetration_m, rejected=attempt)
            pending = rejected
            if not pending:
                break
        for k in pending:
            chosen[k] = chosen[k]._replace(rejected=config.tries)
        return chosen

    def _posed_body(self, pose: _Pose) -> Body:
        self.scene.set_person(self._known_person(pose.number))
        self.scene.pose(pose.local, np.zeros(3))
        vertices_m = self.renderer.vertices_world_m().copy()
        torso_m = self.scene.joints_world_m()[Joint.TORSO]
        low_m, high_m = (np.array([f(vertices_m[:, axis]) for axis in range(3)], float) for f in (np.min, np.max))
        return Body(vertices_m, low_m, high_m, torso_m, float(pose.lift_m - low_m[2]))

    def _draw_sample(self, index: int, rng: np.random.Generator, pose: _Pose) -> RenderedSample:
        """Draws places for the person in the pose until one is sound, and renders it; else the best of them."""
        config, room, body = self.config.stage, self.room(self.room_of(index)), self._posed_body(pose)
        cut = rng.random() < config.cut
        best, least = None, SOUND
        for refused in range(config.place_tries):
            placed = _Placed(index, pose, body, draw_place(rng, config, body, room, cut), room)
            fault = faults(body, placed.place_m, room, cut)
            if fault == SOUND:
                rendered = self._render(placed, refused, forced=False)
                if np.count_nonzero(rendered.sample.depth_mm) >= config.least_pixels:
                    return rendered
                fault = UNSEEN
            if best is None or fault < least:
                best, least = placed, fault
        return self._render(best, config.place_tries, forced=least > MISFRAMED)

    def _render(self, placed: _Placed, refused_places: int, forced: bool) -> RenderedSample:
        scene, camera, pose, room = self.scene, self.scene.camera, placed.pose, placed.room
        scene.pose(pose.local, placed.place_m)
        person_m = self.renderer.person_m()
        joints = scene.view.to_camera(scene.joints_world_m())
        yaw_rad = heading_rad(scene)
        around = self._draw_around(placed, person_m)
        composed = compose(person_m, room.depth_mm, around, camera)
        sample = Sample(
            depth_mm=composed.depth_mm,
            box=composed.box,
            joints_camera_m=joints.astype(np.float32),
            visible=visible_joints(joints, composed.own_mm, camera),
            body=pose.number,
            motion=pose.name,
            yaw_rad=yaw_rad,
            room=self.room_of(placed.index),
            ridge=None,
        )
        forced = forced or pose.penetration_m > self.config.stage.penetration_m
        return RenderedSample(sample, pose.rejected, refused_places, forced, around)

    def _draw_around(self, placed: _Placed, person_m: np.ndarray) -> Around:
        """Draws seat, held object and second person of a placed person."""
        config, scene = self.config.props, self.scene
        rng = self._rng("props", placed.index)
        sits, holds, joined, left, *attached = rng.random(6)
        seat_reach_m, other_reach_m = np.where(np.array(attached) < config.attached, rng.uniform(*ATTACHED_M, 2), 0.0)
        held_m, others = None, []
        if sits < config.seat and is_sitting(scene.joints_world_m()):
            seat = seat_under(rng, scene, self.renderer.vertices_world_m())
            if seat is not None:
                others.append((draw_mesh_m(scene, seat), seat_reach_m))
        if holds < config.held:
            held_m = draw_mesh_m(scene, held_by(rng, scene, left < 0.5))
        if joined < config.second_person:
            other_m = self._second_person_m(rng, placed, person_m)
            if other_m is not None:
                others.append((other_m, other_reach_m))
        images, reaches_m = zip(*others, strict=True) if others else ((), ())
        return Around(held_m, images, reaches_m)

    def _second_person_m(self, rng: np.random.Generator, placed: _Placed, person_m: np.ndarray) -> np.ndarray | None:
        """(H, W) depth in metres of another person of the split close to a placed one; None if no place is free for them."""
        scene, own, room = self.scene, placed.pose, placed.room
        (pose,) = self._draw_poses([own.number + int(rng.integers(1, OTHER_PEOPLE))], [rng])
        other, drawn_m = self._posed_body(pose), None
        for _ in range(self.config.stage.place_tries):
            place_m = draw_place_beside(rng, placed.body, placed.place_m, other, room)
            if place_m is None:
                continue
            scene.pose(pose.local, place_m)
            other_m = self.renderer.person_m()
            if hidden_fraction(person_m, other_m, room.depth_mm) <= MAX_HIDDEN:
                drawn_m = other_m
                break
        scene.set_person(self._known_person(own.number))
        scene.pose(own.local, placed.place_m)
        return drawn_m


def body_rotations(asset: BodyAsset, quats: np.ndarray, yaw_rad: float, curls_rad: np.ndarray) -> np.ndarray:
    """Retargets (..., 23, 4) local rotations of a motion's joints, w, x, y, z, to the body: (..., B, 4), relative to the
    T-pose.

    The whole person is rotated to the left by `yaw_rad`; `curls_rad` (2,) is the flexion of the left and the right fingers.
    """
    local = np.zeros((*quats.shape[:-2], len(asset.bone_names), 4))
    local[..., 0] = 1
    # In motions y is up and z is the front; in the world z is up and -y is the front: (x, y, z) -> (x, -z, y).
    local[..., [asset.bone(name) for name in MOTION_BONES], :] = quats[..., (0, 1, 3, 2)] * (1, 1, -1, 1)
    local[..., 0, :] = multiply(about(2, yaw_rad), local[..., 0, :])
    for (side, sign), curl in zip((("Left", 1.0), ("Right", -1.0)), curls_rad, strict=True):
        for finger, share in FINGER_FLEXION.items():
            # In the T-pose the palms face down, so the fingers flex about the y axis.
            half = sign * share * curl / 2
            local[..., asset.bone(f"{side}{finger}"), :] = np.cos(half), 0, np.sin(half), 0
    return local


def heading_rad(scene: Scene) -> float:
    """Heading of the person about the vertical, radians: 0 faces the camera, positive is turned to the person's left."""
    facing, place = scene.facing_world(), scene.data.qpos[:3] - scene.view.position_m
    return float(np.angle(complex(facing[0], facing[1]) / complex(-place[0], -place[1])))
