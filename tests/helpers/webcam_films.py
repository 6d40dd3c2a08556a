"""Colour films of SIMULATED learners, which a browser takes for its webcam: the generator's bodies, clothes and rooms, lit.

Skin, hair, shoes and two garments have colours and patterns of their own, walls and floor too; one lamp and the sky light them.
Squares along the top of an image are the number of its frame, the least bit on the left.
"""

from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import cKDTree

from kpopnet.camera import Camera
from synth.body.asset import load_body
from synth.dances.live import LiveLearner

CAMERA = Camera.from_fov(64.0, 640, 480)
STAMP_BITS, STAMP_PX = 12, 16
CLOTH_M = 0.004
"""Where the surface lies farther from the skin than this, it is cloth, hair or a shoe."""

SKIN_BGR = np.array([[180, 205, 240], [140, 175, 220], [95, 130, 180], [60, 85, 125]], float)
NOISE_GREY = 4.0


class FilmedLearner(LiveLearner):
    """A learner before a webcam; arguments as of `LiveLearner`."""

    def __init__(self, *args, camera: Camera = CAMERA, seed: int = 0, **more) -> None:
        super().__init__(*args, camera=camera, seed=seed, **more)
        self._rng = np.random.default_rng([seed, 4])
        self._light = self._rng.normal((0.0, -0.8, 0.8), 0.5)  # in the world: from the camera's side and above
        self._light /= np.linalg.norm(self._light)
        self._exposure = self._rng.uniform(0.75, 1.15)
        self._vertex_bgr = self._worn_bgr(self._take.played.person)
        self._room_bgr = self._painted()

    def __len__(self) -> int:
        return len(self._take)

    def picture(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """(H, W, 3) uint8 blue, green, red of a frame of the dance at its own rate, and its (15, 3) true joints in metres."""
        scene, played = self._studio.scene, self._take.played
        self._studio.pose(played, number, self._take.place_m)
        person_m, vertices = self._studio.renderer.person_m(), self._studio.renderer.vertices_world_m()
        bgr = self._room_bgr.copy()
        v, u = np.nonzero((person_m > 0) & ((self._room_m == 0) | (person_m < self._room_m + 0.02)))
        seen = self._world_m(person_m)[v, u]
        distance, near = cKDTree(vertices).query(seen, k=3)
        weights = 1 / np.maximum(distance, 1e-4)[..., None]
        weights /= weights.sum(axis=1, keepdims=True)
        colours, normals = self._vertex_bgr[near], vertex_normals(vertices, scene.skin.faces)[near]
        bgr[v, u] = (weights * colours).sum(axis=1) * self._lit((weights * normals).sum(axis=1))
        soft = cv2.GaussianBlur(bgr * self._exposure, (3, 3), 0.7) + self._rng.normal(0, NOISE_GREY, bgr.shape)
        return np.clip(soft, 0, 255).astype(np.uint8), self.true_joints_m()

    def _lit(self, normals: np.ndarray) -> np.ndarray:
        facing = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9) @ self._light
        return (0.45 + 0.65 * np.clip(facing, 0, 1))[..., None]

    def _world_m(self, depth_m: np.ndarray) -> np.ndarray:
        """(H, W, 3) points of the world that a depth image sees."""
        view = self._take.view
        return self.camera.points(depth_m) @ view.rotation.T + view.position_m

    def _worn_bgr(self, person) -> np.ndarray:
        """(N, 3) colours of the vertices of a person's skin, clothes, hair and shoes."""
        rng, body = self._rng, load_body()
        skin, top, bottom, shoe, hair = SKIN_BGR[rng.integers(4)], *rng.uniform(20, 235, (3, 3)), rng.uniform(10, 70, 3)
        count = len(person.bare_m)
        rest_m, colours = person.vertices_m, np.empty((len(person.vertices_m), 3))
        hips_z, ankle_z = person.heads_m[body.bone("LeftUpLeg"), 2], person.heads_m[body.bone("LeftFoot"), 2]
        neck_z = person.heads_m[body.bone("Head"), 2]
        high = rest_m[:, 2]
        colours[:] = np.where((high > hips_z - 0.02)[:, None], top, bottom)
        stripes = np.sin(2 * np.pi * high / rng.uniform(0.06, 0.3)) > rng.uniform(0, 1.5)
        colours[stripes] *= 0.6
        colours[high < ankle_z] = shoe
        colours[high > neck_z + 0.02] = hair
        bare = np.linalg.norm(person.vertices_m[:count] - person.bare_m, axis=1) < CLOTH_M
        colours[:count][bare] = skin
        face = (high[:count] > neck_z) & (rest_m[:count, 1] < person.heads_m[body.bone("Head"), 1] - 0.03)
        colours[:count][face] = skin
        return colours

    def _painted(self) -> np.ndarray:
        """(H, W, 3) colours of the room without the person."""
        rng, points = self._rng, self._world_m(np.where(self._room_m > 0, self._room_m, 6.0))
        across, down = np.gradient(points, axis=1), np.gradient(points, axis=0)
        normals = np.cross(down, across)
        normals *= np.sign(np.einsum("hwi,hwi->hw", normals, self._take.view.position_m - points))[..., None]
        floor = points[..., 2] < 0.02
        wall_bgr, floor_bgr = rng.uniform(90, 230, 3), rng.uniform(50, 190, 3)
        planks = 0.85 + 0.15 * (np.floor(points[..., 0] / 0.12) % 2)
        pattern = 0.94 + 0.06 * np.sin(points @ rng.normal(0, 6, 3))
        bgr = np.where(floor[..., None], floor_bgr * planks[..., None], wall_bgr * pattern[..., None])
        return bgr * self._lit(normals)


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N, 3) outward normals of a mesh's vertices, not normalised."""
    corners = vertices[faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], flat)
    return normals


def stamped(bgr: np.ndarray, number: int) -> np.ndarray:
    """An image with the number of its frame."""
    bgr = bgr.copy()
    for bit in range(STAMP_BITS):
        bgr[:STAMP_PX, bit * STAMP_PX : (bit + 1) * STAMP_PX] = 255 * (number >> bit & 1)
    return bgr


def write_film(path: Path, learner: FilmedLearner, frames: range, repeated: int = 1) -> np.ndarray:
    """Writes frames of a dance as motion JPEG, each `repeated` times; their (T, 15, 3) true joints, metres, camera frame."""
    joints_m = []
    with path.open("wb") as file:
        for number in frames:
            bgr, true_m = learner.picture(number)
            joints_m.append(true_m)
            file.write(repeated * cv2.imencode(".jpg", stamped(bgr, number), [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes())
    return np.array(joints_m)
