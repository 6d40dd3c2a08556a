"""A person who is not of Anny's family, filmed: dm_control's football player, posed by motions, before a simulated Kinect v1.

`tools/other_figure.py` made the figure and says where its joints are labelled.
"""

from collections.abc import Iterable
from functools import cache
from typing import NamedTuple

import numpy as np
import trimesh
from programs import ROOT
from scipy.spatial.transform import Rotation

from kpopnet.camera import CAMERAS, Camera
from kpopnet.skeleton import NUM_JOINTS
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import JOINT_NAMES, Motion, forward_kinematics, height_above_floor
from synth.scene.mesh import boxes
from synth.scene.render import rasterise
from synth.scene.room import View, ViewConfig, draw_view
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS
from synth.simulated.film import CleanFrame, measure_frame

ASSET = ROOT / "tests" / "assets" / "other_body.npz"
CAMERA, FPS, SECONDS = CAMERAS["kinect_v1"], 30.0, 10.0

SCALE, HEADING_DEG, DISTANCE_M, WALL_M = (0.9, 1.1), 20.0, (2.0, 4.0), 1.5
"""Range of the scale of the figure, which is 1.69 m tall; deviation of its heading; range of its distance from the camera; the
wall's distance behind it."""

REACH_M, BORDER_PX, PLACES = 0.15, 2, 100
"""No surface is farther from the joints; the body stays this far inside the image; places tried for that."""


class Figure(NamedTuple):
    """The T-pose of B bones, of V points of the surface and of the 15 joints, which follow them; metres."""

    heads_m: np.ndarray  # (B, 3) where the bones turn
    parents: list[int]
    motion_bones: np.ndarray  # (B,) index of the motions' bone that turns it
    points_m: np.ndarray  # (V + 15, 3)
    weights: np.ndarray  # (V + 15, B) skinning weights
    faces: np.ndarray  # (F, 3) int32
    leg_m: float  # from hip through knee to ankle


class Film(NamedTuple):
    """T segmented images with true joints."""

    depth_m: np.ndarray  # (T, H, W) float32 metres, 0 elsewhere than on the person
    joints_camera_m: np.ndarray  # (T, 15, 3) float32 metres
    camera: Camera


@cache
def figure() -> Figure:
    with np.load(ASSET) as file:
        data = dict(file)
    heads_m, bones = data["heads_m"].astype(float), data["motion_bones"].tolist()
    solids = [solid(*parts) for parts in zip(data["solid_sizes_m"], data["solid_centres_m"], data["solid_axes"], strict=True)]
    counts, jersey = [len(one.vertices) for one in solids], len(data["jersey_m"])
    starts = jersey + np.cumsum([0, *counts[:-1]])
    rigid = np.concatenate([np.repeat(data["solid_bones"], counts), data["joint_bones"]])
    weights = np.zeros((jersey + len(rigid), len(bones)))
    np.put_along_axis(weights[:jersey], data["jersey_bones"].astype(int), data["jersey_weights"] / 255, axis=1)
    weights[np.arange(jersey, len(weights)), rigid] = 1
    hip_m, knee_m, ankle_m = (heads_m[bones.index(f"Left{name}")] for name in ("UpLeg", "Leg", "Foot"))
    return Figure(
        heads_m,
        data["parents"].tolist(),
        np.array([JOINT_NAMES.index(bone) for bone in bones]),
        np.concatenate([data["jersey_m"], *(one.vertices for one in solids), data["joints_m"]]).astype(float),
        weights / weights.sum(axis=1, keepdims=True),
        np.concatenate([data["jersey_faces"], *(o.faces + n for o, n in zip(solids, starts, strict=True))]).astype(np.int32),
        float(np.linalg.norm(knee_m - hip_m) + np.linalg.norm(ankle_m - knee_m)),
    )


def solid(size_m: np.ndarray, centre_m: np.ndarray, axes: np.ndarray) -> trimesh.Trimesh:
    """A capsule of a radius and a half length, a sphere of a radius, or an ellipsoid of three radii."""
    radius_m, half_m, third_m = size_m
    if half_m > 0 and third_m == 0:
        mesh = trimesh.creation.capsule(height=2 * half_m, radius=radius_m, count=[12, 12])
    else:
        mesh = trimesh.creation.icosphere(subdivisions=2)
        mesh.vertices *= size_m if third_m > 0 else radius_m
    mesh.vertices = mesh.vertices @ axes.T + centre_m
    return mesh


def posed(quats: np.ndarray) -> np.ndarray:
    """(T, V + 15, 3) surface and joints, metres, y up, about the hips, from (T, 23, 4) local rotations of a motion."""
    body, shape = figure(), (len(quats), len(figure().heads_m), 3)
    _, turned = forward_kinematics(quats, np.zeros((len(quats), 3)))
    rotations = Rotation.from_quat(turned[:, body.motion_bones].reshape(-1, 4), scalar_first=True).as_matrix()
    rotations, heads_m = rotations.reshape(*shape, 3), np.zeros(shape)
    for bone, parent in enumerate(body.parents):
        if parent >= 0:
            heads_m[:, bone] = heads_m[:, parent] + rotations[:, parent] @ (body.heads_m[bone] - body.heads_m[parent])
    moves_m = heads_m - (rotations @ body.heads_m[..., None])[..., 0]
    bones = np.concatenate([rotations, moves_m[..., None]], axis=-1).reshape(*shape[:2], 12)
    blended = (body.weights @ bones).reshape(len(quats), -1, 3, 4)
    return (blended[..., :3] @ body.points_m[..., None])[..., 0] + blended[..., 3]


def film(motion: Motion, frames: Iterable[int], *seed: int) -> Film:
    """Frames of a motion by a figure whose size, heading, place and camera the seed draws, as a Kinect v1 measures them."""
    rng, frames = np.random.default_rng([*seed, 3]), list(frames)
    scale, yaw_rad, view = rng.uniform(*SCALE), np.radians(HEADING_DEG) * rng.normal(), draw_view(rng, ViewConfig())
    quats, root_m = motion.quats[frames], motion.root_m[frames].astype(float)
    stride = scale * figure().leg_m / motion.leg_m
    points_m = scale * posed(quats) + stride * (root_m - root_m.mean(axis=0))[:, None]
    above_m = np.maximum(height_above_floor(quats, root_m, motion.leg_m), 0) * stride
    points_m[..., 1] += (above_m - points_m[..., 1].min(axis=1))[:, None]
    points_m = points_m[..., (0, 2, 1)] * (1, -1, 1) @ Rotation.from_euler("z", yaw_rad).as_matrix().T  # z up, front is -y
    place_m = draw_place(rng, points_m[:, -NUM_JOINTS:], view)
    points_m = view.to_camera(points_m + place_m).astype(np.float32)
    walls = boxes([((0, 3, -0.1), (8, 6, 0.1)), ((0, place_m[1] + WALL_M, 1.5), (8, 0.1, 2))])
    room_m = rasterise(view.to_camera(walls.vertices_m).astype(np.float32), walls.faces, CAMERA)
    depth_m, joints_m, noise = [], points_m[:, -NUM_JOINTS:], FilmNoise(seed)
    for number, (surface_m, true_m) in enumerate(zip(points_m[:, :-NUM_JOINTS], joints_m, strict=True)):
        clean = CleanFrame(number, rasterise(surface_m, figure().faces, CAMERA), room_m, true_m)
        measured_m, person = measure_frame(clean, CAMERA, SENSORS["kinect_v1"], noise)
        depth_m.append(np.where(person, measured_m, 0))
    return Film(np.array(depth_m, np.float32), joints_m, CAMERA)


def draw_place(rng: np.random.Generator, joints_world_m: np.ndarray, view: View) -> np.ndarray:
    """(3,) where the whole body stays inside the image; the last one tried if none is found."""
    for _ in range(PLACES):
        distance_m = rng.uniform(*DISTANCE_M)
        place_m = np.array([rng.uniform(-0.3, 0.3) * distance_m, distance_m, 0.0])
        u, v, z = np.moveaxis(CAMERA.project(view.to_camera(joints_world_m + place_m)), -1, 0)
        reach_px = BORDER_PX + CAMERA.fx * REACH_M / z
        if (np.minimum(u, CAMERA.width - u) > reach_px).all() and (np.minimum(v, CAMERA.height - v) > reach_px).all():
            break
    return place_m


def still(seed: int, index: int) -> Film:
    """One image of dance number `index` of the collection `seed`."""
    frame = int(np.random.default_rng([seed, 0, index]).integers(SECONDS * FPS))
    return film(dance(index, seed, SECONDS, FPS), [frame], seed, 0, index)


def dancing(seed: int, index: int, frames: int) -> Film:
    """The first frames of the same dance by another figure elsewhere; dances start standing."""
    return film(dance(index, seed, SECONDS, FPS), range(frames), seed, 1, index)
