"""People made of balls: an ObservationSource whose ground truth is known by construction, without a renderer."""

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.data.observation import Observation
from kpopnet.skeleton import BONES, NUM_JOINTS, Joint

CAMERA = Camera.centred(140.0, 160, 120)
BALLS_PER_BONE, RADIUS_M = 8, 0.06

STANDING_M = {
    Joint.HEAD: (0, -0.65, 0),
    Joint.NECK: (0, -0.45, 0),
    Joint.RIGHT_SHOULDER: (-0.18, -0.42, 0),
    Joint.TORSO: (0, -0.15, 0),
    Joint.RIGHT_HIP: (-0.1, 0.05, 0),
    Joint.RIGHT_KNEE: (-0.12, 0.45, 0),
    Joint.RIGHT_FOOT: (-0.13, 0.85, 0),
}


def standing() -> np.ndarray:
    """(15, 3) metres: both sides of STANDING_M about the origin; the elbows and hands are left at 0."""
    body = np.zeros((NUM_JOINTS, 3))
    for joint, position in STANDING_M.items():
        body[joint] = position
        if joint.name.startswith("RIGHT_"):
            body[Joint["LEFT_" + joint.name[6:]]] = (-position[0], *position[1:])
    return body


def draw_joints(rng: np.random.Generator) -> np.ndarray:
    """(15, 3) joints in metres of a person who roughly faces the camera, with random arms."""
    body = standing()
    for side, sign in (("RIGHT", -1), ("LEFT", 1)):
        end = body[Joint[f"{side}_SHOULDER"]]
        for name, length in (("ELBOW", 0.28), ("HAND", 0.26)):
            raised = rng.uniform(-1.3, 1.3)
            forward = rng.uniform(-0.6, 0.2)
            direction = np.array([sign * np.cos(raised), -np.sin(raised), forward])
            end = end + length * direction / np.linalg.norm(direction)
            body[Joint[f"{side}_{name}"]] = end
    yaw = rng.uniform(-0.5, 0.5)
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    return (body @ turn.T + (*rng.uniform(-0.2, 0.2, 2), rng.uniform(2.6, 3.0))).astype(np.float32)


def draw_depth(joints_camera_m: np.ndarray) -> np.ndarray:
    """(H, W) float32 metres: balls along the bones; nearer balls occlude farther ones."""
    share = np.linspace(0, 1, BALLS_PER_BONE)[:, None]
    balls = np.concatenate([joints_camera_m[a] * (1 - share) + joints_camera_m[b] * share for a, b in BONES])
    depth = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    for u, v, z in CAMERA.project(balls[np.argsort(-balls[:, 2])]):
        cv2.circle(depth, (round(u), round(v)), round(CAMERA.fx * RADIUS_M / z), float(z - RADIUS_M), -1)
    return depth


class CapsulePeople:
    """An ObservationSource; the observations at the indices `empty` show no person."""

    def __init__(self, count: int, seed: int = 0, empty: tuple[int, ...] = ()) -> None:
        self.count = count
        self.seed = seed
        self.empty = empty

    def __len__(self) -> int:
        return self.count

    def observe(self, index: int, epoch: int) -> Observation:
        joints = draw_joints(np.random.default_rng([self.seed, index]))
        depth = draw_depth(joints)
        noise = np.random.default_rng([self.seed, index, epoch]).normal(0, 0.005, depth.shape)
        depth = np.where(depth > 0, depth + noise, 0).astype(np.float32)
        if index in self.empty:
            depth[:] = 0
        return Observation(depth, CAMERA, joints, np.ones(NUM_JOINTS, bool))
