"""The developers' check on real depth: its posed body is that of the samples, and finds joints whose labels lie elsewhere."""

import sys

import numpy as np
import torch
from programs import ROOT
from scipy.spatial.transform import Rotation
from skinning import skinned

from kpopnet.camera import CAMERAS
from synth.body.shape import load_body, shape_person
from synth.scene.render import rasterise

sys.path.insert(0, str(ROOT / "tools"))
import posed_body
from posed_body import PosedBody, fit_body

CAMERA = CAMERAS["kinect_v1"]


def posed(frames: int, seed: int) -> PosedBody:
    """Somebody who faces the camera 2.6 m away, limbs a little bent at random."""
    rng = np.random.default_rng(seed)
    body = PosedBody(torch.tensor([[0.0, 0.1, 2.6]]).repeat(frames, 1), torch.eye(3).repeat(frames, 1, 1))
    with torch.no_grad():
        body.shape.copy_(torch.tensor(load_body().people[int(rng.integers(100))]))
        body.turns.copy_(torch.tensor(0.25 * rng.normal(size=body.turns.shape)) * (body.price < 1)[:, None])
    return body


def test_the_posed_body_is_that_of_the_samples():
    body, asset = posed(2, 0), load_body()
    with torch.no_grad():
        skin_m, joints_m = (found.double().numpy() for found in body())
    person = shape_person(body.shape.detach().numpy())
    from_rest = [np.eye(3)] * len(asset.bone_names)
    for frame in range(2):
        for bone, parent in enumerate(asset.bone_parents):
            row = body.posed.index(bone) if bone in body.posed else None
            turn = np.eye(3) if row is None else Rotation.from_rotvec(body.turns[frame, row].detach().numpy()).as_matrix()
            before = body.facing[frame].numpy() if parent < 0 else from_rest[parent]
            from_rest[bone] = before @ turn
        world = [rotation @ t_pose.T for rotation, t_pose in zip(from_rest, person.t_pose, strict=True)]
        local = [world[bone] if parent < 0 else world[parent].T @ world[bone] for bone, parent in enumerate(asset.bone_parents)]
        vertices, joints = skinned(person, np.array(local), body.root_m[frame].detach().numpy())
        np.testing.assert_allclose(skin_m[frame], vertices[: len(asset.weights)], atol=1e-4)
        np.testing.assert_allclose(joints_m[frame], joints, atol=1e-4)


def test_the_fit_finds_joints_from_depth_though_the_labels_lie_elsewhere(monkeypatch):
    monkeypatch.setattr(posed_body, "APPROACH_STEPS", 60)
    monkeypatch.setattr(posed_body, "FIT_STEPS", 100)
    body = posed(2, 1)
    with torch.no_grad():
        skin_m, true_m = (found.numpy() for found in body())
    depth_m = np.stack([rasterise(skin.astype(np.float32), load_body().faces.astype(np.int32), CAMERA) for skin in skin_m])
    labels_m = true_m + 0.01 * np.random.default_rng(0).normal(size=true_m.shape)
    labels_m[:, 9:11, 1] -= 0.07  # hips higher, as the Kinect SDK's
    labels_m[:, 0, 1] += 0.06
    fitted = fit_body(depth_m, CAMERA, labels_m.astype(np.float32))
    errors_m = np.linalg.norm(fitted.joints_m - true_m, axis=-1)
    assert errors_m.mean() < 0.035 and np.median(fitted.residual_m) < 0.01
    assert errors_m[:, 9:11].mean() < 0.045  # 7 cm in the labels
