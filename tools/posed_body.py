"""Fits the synthetic body to depth frames of one person, as an independent reference for estimated joints.

The body is the one that the training samples are rendered with, so its joints are those that a network is taught. One shape and
one thickness of clothes are shared by all frames of a person; every frame has its own pose. The fit begins at the labels, which
tell left from right and the rough pose. Then the depth decides: points on the surface, no body outside the silhouette or before
the measured depth, a plausible shape and posture. Labels keep a small, robust weight, after the offsets that are constant over
the frames (`kpopnet.evaluation.poses.definition`) are taken out: they tell how limbs move, and not where joints lie in the
body.

On 8 frames each of 3 simulated training people, with labels displaced as the Kinect SDK's are and 2 cm of noise on every
coordinate (5.3 cm on average), the fitted joints are 3.8 cm from the true ones: elbows 5.2, hands 4.5, hips 4.0, feet 2.6. The
label's weight was chosen of 0.01, 0.03 and 0.1 on them. Estimators that differ by less than that are not told apart.

Lengths are metres in the camera frame.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt
from torch import Tensor
from torch.nn.functional import grid_sample, normalize

from kpopnet.camera import Camera
from kpopnet.evaluation.poses.definition import fit_offsets, moved
from synth.body.asset import load_body

FACING_CAMERA = torch.tensor([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""From the body's axes (left, back, up) to the camera's of a person who faces it."""

SIDES = ("Left", "Right")
POSED_BONES = {
    "Hips": 0.0,
    **dict.fromkeys(("LowerBack", "Spine1", "Neck", "Head"), 1.0),
    **{side + bone: price for side in SIDES for bone, price in (("Shoulder", 2.0), ("Hand", 2.0), ("Foot", 1.0))},
    **{side + bone: 0.1 for side in SIDES for bone in ("Arm", "ForeArm", "UpLeg", "Leg")},
}
"""Bones that turn, and the price of turning one by a radian from the A-pose, in units of POSTURE_WEIGHT."""

POINTS = 400
"""Measured points of each frame that the surface is fitted to."""

SURFACE_SCALE_M, OUTSIDE_SCALE_M, LABEL_SCALE_M = 0.05, 0.10, 0.15
"""Residuals of this size have a quarter of their weight (Geman and McClure 1987)."""

OUTSIDE_WEIGHT, BEFORE_WEIGHT, LABEL_WEIGHT = 1.0, 0.5, 0.1
POSTURE_WEIGHT, SHAPE_WEIGHT, CLOTHES_WEIGHT = 2e-4, 2e-5, 1.0
"""Relative to 1 for the mean squared distance of the points in square metres; postures in square radians, shapes in squared
standard deviations."""

USUAL_CLOTHES_M = 0.01
APPROACH_STEPS, FIT_STEPS, STEP = 150, 250, 0.03
REDEFINE_STEPS = 25
"""Steps to the labels and then to the depth, the first step's size, and steps between two estimates of the labels' offsets."""


@dataclass(frozen=True)
class FittedBody:
    """The result of a fit to N frames."""

    joints_m: np.ndarray  # (N, 15, 3) joints of the body
    residual_m: np.ndarray  # (N,) median distance of a frame's measured points from the body's surface
    clothes_m: float  # thickness of the clothes


class PosedBody(torch.nn.Module):
    """A person's shape, and their pose in N frames, as parameters."""

    def __init__(self, root_m: Tensor, facing: Tensor) -> None:
        """A mean person in the A-pose with the hips at (N, 3) `root_m`, turned by (N, 3, 3) from one who faces the camera."""
        super().__init__()
        asset = load_body()
        self.asset = asset
        self.mean, self.basis = torch.tensor(asset.mean), torch.tensor(asset.basis)
        self.weights, self.weight_bones = torch.tensor(asset.weights), torch.tensor(asset.weight_bones)
        self.faces = torch.tensor(asset.faces.astype(np.int64))
        self.posed = [asset.bone(name) for name in POSED_BONES]
        self.price = torch.tensor(list(POSED_BONES.values()))
        self.facing = facing @ FACING_CAMERA
        self.shape = torch.nn.Parameter(torch.zeros(len(asset.basis)))  # (K,) coefficients in standard deviations
        self.clothes_m = torch.nn.Parameter(torch.tensor(USUAL_CLOTHES_M))  # thickness over the skin
        self.root_m = torch.nn.Parameter(root_m)  # (N, 3) head of the hips bone
        self.turns = torch.nn.Parameter(1e-3 * torch.ones(len(root_m), len(self.posed), 3))  # axes times radians

    def forward(self) -> tuple[Tensor, Tensor]:
        """(N, V, 3) vertices of the skin and (N, 15, 3) joints in the camera frame: linear blend skinning."""
        asset, frames = self.asset, len(self.root_m)
        points = (self.mean + self.shape @ self.basis).reshape(-1, 3)
        vertices, heads, joints = points.split([len(self.weights), len(asset.bone_names), 15])
        local = {bone: _rotation(self.turns[:, row]) for row, bone in enumerate(self.posed)}
        rotations: list[Tensor] = []
        places: list[Tensor] = []
        for bone, parent in enumerate(asset.bone_parents):
            if parent < 0:
                rotations.append(self.facing @ local[bone])
                places.append(self.root_m)
            else:
                rotations.append(rotations[parent] @ local[bone] if bone in local else rotations[parent])
                places.append(places[parent] + rotations[parent] @ (heads[bone] - heads[parent]))
        rotation, place = torch.stack(rotations, 1), torch.stack(places, 1)
        place = place - torch.einsum("nbij,bj->nbi", rotation, heads)
        blended = torch.cat([rotation, place[..., None]], -1).reshape(frames, -1, 12)
        per_vertex = sum(self.weights[:, k, None] * blended[:, self.weight_bones[:, k]] for k in range(4))
        per_vertex = per_vertex.reshape(frames, -1, 3, 4)
        skin = torch.einsum("nvij,vj->nvi", per_vertex[..., :3], vertices) + per_vertex[..., 3]
        bones = torch.tensor(asset.joint_bones)
        return skin, torch.einsum("njik,jk->nji", rotation[:, bones], joints) + place[:, bones]

    def normals(self, skin_m: Tensor) -> Tensor:
        """(N, V, 3) unit normals, outwards."""
        corners = skin_m[:, self.faces]
        areas = torch.linalg.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        sums = torch.zeros_like(skin_m)
        for corner in range(3):
            sums = sums.index_add(1, self.faces[:, corner], areas)
        return normalize(sums, dim=-1)


class Frames:
    """What is measured in N frames of one person: (N, POINTS, 3) points, (N, 15, 3) labels, (N, H, W) depth, 0 outside of the
    silhouette, and distance of every pixel from it, 0 inside.
    """

    def __init__(self, depth_m: np.ndarray, camera: Camera, labels_m: np.ndarray) -> None:
        rng = np.random.default_rng(0)
        clouds = [camera.points(image)[image > 0] for image in depth_m]
        self.points_m = torch.tensor(np.stack([cloud[rng.integers(len(cloud), size=POINTS)] for cloud in clouds])).float()
        self.labels_m = torch.tensor(labels_m).float()
        self.outside_px = torch.tensor(np.stack([distance_transform_edt(image == 0) for image in depth_m])).float()
        self.depth_m = torch.tensor(depth_m).float()
        self.camera = camera

    def at(self, images: Tensor, points_m: Tensor, mode: str = "bilinear") -> Tensor:
        """(N, V) values of (N, H, W) images where (N, V, 3) points project; those at the border beyond it."""
        camera = self.camera
        u = camera.fx * points_m[..., 0] / points_m[..., 2] + camera.cx
        v = camera.fy * points_m[..., 1] / points_m[..., 2] + camera.cy
        grid = torch.stack([2 * u / (camera.width - 1) - 1, 2 * v / (camera.height - 1) - 1], -1)[:, None]
        sampled = grid_sample(images[:, None], grid, mode=mode, padding_mode="border", align_corners=True)
        return sampled[:, 0, 0]


def fit_body(depth_m: np.ndarray, camera: Camera, labels_m: np.ndarray) -> FittedBody:
    """Fits the body of one person to N frames: (N, H, W) metres, 0 outside the person, and (N, 15, 3) labels, all known."""
    frames = Frames(depth_m, camera, labels_m)
    body = PosedBody(frames.labels_m[:, [9, 10]].mean(1), _facing(frames.labels_m))
    lengths = {"params": [body.root_m, body.clothes_m], "lr": STEP / 5}
    optimiser = torch.optim.Adam([{"params": [body.turns, body.shape]}, lengths], STEP)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: 0.02 + 0.98 * _cosine(step))
    surface_m = torch.zeros(frames.points_m.shape[:2])
    for step in range(APPROACH_STEPS + FIT_STEPS):
        skin_m, joints_m = body()
        label = (joints_m - frames.labels_m).square().sum(-1)
        loss = POSTURE_WEIGHT * (body.price[:, None] * body.turns.square()).sum((1, 2)).mean()
        loss = loss + SHAPE_WEIGHT * body.shape.square().sum() + CLOTHES_WEIGHT * (body.clothes_m - USUAL_CLOTHES_M).square()
        if step < APPROACH_STEPS:
            loss = loss + label.mean()
        else:
            if (step - APPROACH_STEPS) % REDEFINE_STEPS == 0:
                targets_m = _redefined(frames.labels_m, joints_m)
            label = (joints_m - targets_m).square().sum(-1)
            loss = loss + LABEL_WEIGHT * _robust(label, LABEL_SCALE_M).mean()
            depth_loss, surface_m = _cost(body, frames, skin_m)
            loss = loss + depth_loss
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    with torch.no_grad():
        return FittedBody(body()[1].numpy(), surface_m.abs().median(1).values.detach().numpy(), float(body.clothes_m))


def _redefined(labels_m: Tensor, joints_m: Tensor) -> Tensor:
    """(N, 15, 3) the labels without the offsets that are constant over all frames: what they say of poses, not of joints."""
    labels = labels_m.numpy()
    return torch.tensor(moved(labels, fit_offsets(joints_m.detach().numpy(), labels))).float()


def _cost(body: PosedBody, frames: Frames, skin_m: Tensor) -> tuple[Tensor, Tensor]:
    """The cost of a body given the depth, and (N, POINTS) signed distances of the points from the surface."""
    normals = body.normals(skin_m)
    with torch.no_grad():
        towards = (normals * skin_m).sum(-1) < 0  # the side that the camera sees
        distance = torch.cdist(frames.points_m, skin_m) + (~towards[:, None]).float()
        nearest = distance.argmin(-1)[..., None].expand(-1, -1, 3)
    offset = frames.points_m - skin_m.gather(1, nearest)
    surface_m = (offset * normals.gather(1, nearest)).sum(-1) - body.clothes_m
    # Vertices are some 2 cm apart, so the distance along the surface counts little.
    cost = _robust(surface_m.square() + 0.1 * offset.square().sum(-1), SURFACE_SCALE_M).mean()
    outside_m = frames.at(frames.outside_px, skin_m) * skin_m[..., 2] / frames.camera.fx
    measured = frames.at(frames.depth_m, skin_m, "nearest")
    before_m = torch.where(towards & (measured > 0), measured - skin_m[..., 2], 0.0).clamp(min=0)
    cost = cost + OUTSIDE_WEIGHT * _robust(outside_m.square(), OUTSIDE_SCALE_M).mean()
    return cost + BEFORE_WEIGHT * _robust(before_m.square(), OUTSIDE_SCALE_M).mean(), surface_m


def _robust(squared: Tensor, scale: float) -> Tensor:
    return squared * scale**2 / (scale**2 + squared)


def _cosine(step: int) -> float:
    """Learning rate of a step: falls to 0 twice, in the approach to the labels and in the fit to the depth."""
    part = step / APPROACH_STEPS if step < APPROACH_STEPS else (step - APPROACH_STEPS) / FIT_STEPS
    return (1 + np.cos(np.pi * min(part, 1.0))) / 2


def _facing(labels_m: Tensor) -> Tensor:
    """(N, 3, 3) rotation of the labelled torso from one that faces the camera upright."""
    down = normalize(labels_m[:, [9, 10]].mean(1) - labels_m[:, 1], dim=-1)
    left = (labels_m[:, [3, 10]] - labels_m[:, [2, 9]]).sum(1)
    left = normalize(left - (left * down).sum(-1, keepdim=True) * down, dim=-1)
    return torch.stack([left, down, torch.linalg.cross(left, down)], -1)


def _rotation(turns: Tensor) -> Tensor:
    """(N, 3, 3) rotations by (N, 3) axes times angles (Rodrigues)."""
    angle = turns.norm(dim=-1, keepdim=True).clamp(min=1e-6)[..., None]
    x, y, z = turns.unbind(-1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(-1, 3, 3)
    return torch.eye(3) + torch.sin(angle) / angle * cross + (1 - torch.cos(angle)) / angle.square() * (cross @ cross)
