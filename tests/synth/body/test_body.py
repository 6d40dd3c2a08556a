"""The baked body, random people, and MuJoCo's skinning against the skinning in numpy."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from skinning import skinned

from kpopnet.camera import CAMERAS
from kpopnet.skeleton import Joint
from synth.body.asset import load_body
from synth.body.capsules import TRUNK
from synth.body.outfit import ClothesConfig
from synth.body.shape import BodyConfig, draw_person
from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig, Sampler
from synth.scene.render import CpuRenderer
from synth.scene.scene import Scene

NUM_BONES = len(load_body().bone_names)
NUM_VERTICES = len(load_body().weights)
BARE = BodyConfig(clothes=ClothesConfig(**dict.fromkeys(vars(ClothesConfig()), 0.0)))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(CAMERAS["kinect_v1"])


def test_mujoco_skinning_equals_the_reference(scene: Scene) -> None:
    rng = np.random.default_rng(0)
    person = draw_person(rng, BodyConfig(), "train")
    rotations, root_m = Rotation.from_rotvec(0.5 * rng.normal(size=(NUM_BONES, 3))), rng.normal(size=3)
    scene.set_person(person)
    scene.pose(rotations.as_quat(scalar_first=True), root_m)
    vertices, joints = skinned(person, rotations.as_matrix(), root_m)
    np.testing.assert_allclose(CpuRenderer(scene).vertices_world_m(), vertices, atol=5e-6)
    np.testing.assert_allclose(scene.joints_world_m(), joints, atol=1e-6)


def test_capsules_of_trunk_and_head_lie_in_the_middle_of_their_parts_and_touch_no_other_in_the_t_pose(scene: Scene) -> None:
    asset, person = load_body(), draw_person(np.random.default_rng(1), BodyConfig(), "train")
    scene.set_person(person)
    for name in (*TRUNK, "Head"):
        bone = asset.bone(name)
        middle_m = person.bare_m[asset.weight_bones[:, 0] == bone].mean(axis=0) - person.heads_m[bone]
        capsule_m = scene.model.geom(f"capsule_{bone}").pos
        np.testing.assert_allclose(capsule_m, person.t_pose[bone] @ middle_m, atol=1e-3, err_msg=name)
    scene.pose(np.tile([1.0, 0, 0, 0], (NUM_BONES, 1)), np.zeros(3))
    assert scene.penetration_m() == 0


def test_arms_lie_along_x_and_legs_along_z_in_the_t_pose() -> None:
    person = draw_person(np.random.default_rng(0), BodyConfig(), "test")
    _, joints = skinned(person, np.tile(np.eye(3), (NUM_BONES, 1, 1)), np.zeros(3))
    for a, b, axis in (
        (Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW, (1, 0, 0)),
        (Joint.RIGHT_SHOULDER, Joint.RIGHT_ELBOW, (-1, 0, 0)),
        (Joint.LEFT_HIP, Joint.LEFT_KNEE, (0, 0, -1)),
        (Joint.RIGHT_HIP, Joint.RIGHT_KNEE, (0, 0, -1)),
    ):
        along = joints[b] - joints[a]
        np.testing.assert_allclose(along / np.linalg.norm(along), axis, atol=1e-6)
    # The person faces -y, so the toes have a smaller y than the ankles.
    toes = person.heads_m[load_body().bone("LeftToeBase"), 1]
    assert toes < person.heads_m[load_body().bone("LeftFoot"), 1] - 0.05


def outside_m(vertices: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N,) distance of points outside the body from its surface, metres; 0 for points inside."""
    triangles = trimesh.Trimesh(vertices[:NUM_VERTICES], load_body().faces, process=False).triangles
    # Winding number of the surface about a point: 1 inside, 0 outside.
    a, b, c = np.moveaxis(triangles[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    above = np.einsum("jfk,jfk->jf", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    winding = np.arctan2(above, below).sum(1) / (2 * np.pi)
    distances = np.zeros(len(points))
    for k in np.flatnonzero(winding < 0.5):
        nearest = trimesh.triangles.closest_point(triangles, np.tile(points[k], (len(triangles), 1)))
        distances[k] = np.linalg.norm(nearest - points[k], axis=1).min()
    return distances


@pytest.mark.parametrize(("source", "count"), [("poses", 16), ("choreography", 6)])
def test_joints_lie_inside_the_body_in_generated_poses(source: str, count: int) -> None:
    sampler = Sampler(SampleConfig(BARE, MotionConfig(source=source), renderer="cpu"), 3, "train")
    # Check of the measure: a point 15 mm in front of the nose is outside by 15 mm.
    skin_m = load_body().mean.reshape(-1, 3)
    nose_m = skin_m[skin_m[:NUM_VERTICES, 1].argmin()]
    assert outside_m(skin_m, nose_m[None] - [0, 0.015, 0]) == pytest.approx(0.015, abs=1e-6)
    for rendered in sampler.samples(0, count):
        joints = sampler.scene.joints_world_m()
        outside = dict(zip(Joint, outside_m(sampler.renderer.vertices_world_m(), joints), strict=True))
        assert max(outside.values()) == 0, (rendered.sample.motion, outside)
