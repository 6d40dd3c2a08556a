"""The baked body, random people, and MuJoCo's skinning against the skinning in numpy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpopnet.camera import CAMERAS
from kpopnet.skeleton import Joint
from synth.body.asset import load_body
from synth.body.capsules import TRUNK
from synth.body.outfit import ClothesConfig, load_skin
from synth.body.shape import BodyConfig, Person, _adults, draw_person
from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig, Sampler
from synth.scene.render import CpuRenderer
from synth.scene.scene import Scene

NUM_BONES = len(load_body().bone_names)
NUM_VERTICES = len(load_body().weights)
BARE = BodyConfig(clothes=ClothesConfig(**dict.fromkeys(vars(ClothesConfig()), 0.0)))
BARE_CHILDREN = replace(BARE, children=1.0)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(CAMERAS["kinect_v1"])


def skinned(person: Person, rotations: np.ndarray, root_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) vertices and (15, 3) joints in the world, metres, of (B, 3, 3) local rotations relative to the T-pose and the head
    of the hips bone in the world: linear blend skinning, the slow twin of MuJoCo's.
    """
    asset, skin = load_body(), load_skin()
    world_rotation, world_m = rotations.copy(), np.tile(root_m, (len(rotations), 1))
    for bone, parent in enumerate(asset.bone_parents[1:], 1):
        world_rotation[bone] = world_rotation[parent] @ rotations[bone]
        offset = person.t_pose[parent] @ (person.heads_m[bone] - person.heads_m[parent])
        world_m[bone] = world_m[parent] + world_rotation[parent] @ offset
    skinning = world_rotation @ person.t_pose  # from the rest pose to the world
    offsets = person.vertices_m[:, None] - person.heads_m[skin.weight_bones]
    moved = np.einsum("vkij,vkj->vki", skinning[skin.weight_bones], offsets)
    vertices = np.einsum("vk,vki->vi", skin.weights, moved + world_m[skin.weight_bones])
    offsets = person.joints_m - person.heads_m[asset.joint_bones]
    joints = np.einsum("jik,jk->ji", skinning[asset.joint_bones], offsets) + world_m[asset.joint_bones]
    return vertices, joints


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
    for side, sign in (("LEFT", 1), ("RIGHT", -1)):
        for begin, end, axis in (("SHOULDER", "ELBOW", (sign, 0, 0)), ("HIP", "KNEE", (0, 0, -1))):
            along = joints[Joint[f"{side}_{end}"]] - joints[Joint[f"{side}_{begin}"]]
            np.testing.assert_allclose(along / np.linalg.norm(along), axis, atol=1e-6)
    # The person faces -y, so the toes have a smaller y than the ankles.
    toes = person.heads_m[load_body().bone("LeftToeBase"), 1]
    assert toes < person.heads_m[load_body().bone("LeftFoot"), 1] - 0.05


def is_inside(vertices: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N,) bool: whether the surface of the body winds once about a point."""
    a, b, c = np.moveaxis(vertices[load_body().faces][None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    above = np.einsum("jfk,jfk->jf", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.arctan2(above, below).sum(1) / (2 * np.pi) > 0.5


@pytest.mark.parametrize(
    ("source", "count", "body"), [("poses", 16, BARE), ("choreography", 6, BARE), ("poses", 12, BARE_CHILDREN)]
)
def test_joints_lie_inside_the_body_in_generated_poses(source: str, count: int, body: BodyConfig) -> None:
    sampler = Sampler(SampleConfig(body, MotionConfig(source=source), renderer="cpu"), 3, "train")
    for rendered in sampler.samples(0, count):
        skin_m = sampler.renderer.vertices_world_m()
        assert is_inside(skin_m, sampler.scene.joints_world_m()).all(), rendered.sample.motion
        assert not is_inside(skin_m, skin_m[:NUM_VERTICES].max(axis=0)[None] + 0.001).any()


def test_adults_are_drawn_with_the_body_mass_index_of_adults() -> None:
    """A tenth is below 19.7, a tenth above 30.5 kg/m², as far as a split has such people."""
    first, thresholds = _adults("train")
    bmi, share = load_body().facts[first : first + len(thresholds), 3], np.diff(thresholds, prepend=0)
    order = np.argsort(bmi)
    quantiles = np.interp((0.1, 0.5, 0.9), np.cumsum(share[order]), bmi[order])
    np.testing.assert_allclose(quantiles, (19.7, 24.5, 30.5), rtol=0.04)
    assert share.max() < 0.01
