"""One dance by its skeleton in the files of other programs is the same performance as in BVH; what is damaged is refused."""

import numpy as np
import pytest
from bvh_files import write_bvh
from gltf_files import write_gltf
from programs import ROOT
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.bones import MEAN_ADULT_M
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import INDEX

DANCE = dance(2, seconds=2.0)


def assert_same_dance(path, expected, **tolerance):
    read = read_performance(path)
    step = round((len(read.times_s) - 1) / (len(expected.times_s) - 1))
    np.testing.assert_allclose(read.times_s[::step] - read.times_s[0], expected.times_s, atol=1e-4, err_msg=path.name)
    np.testing.assert_allclose(read.joints_m[::step], expected.joints_m, err_msg=path.name, **(tolerance or {"atol": 1e-3}))


@pytest.fixture(scope="module")
def in_bvh(tmp_path_factory):
    return read_performance(write_bvh(tmp_path_factory.mktemp("bvh") / "a.bvh", DANCE))


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.glb", {}),
        ("a.gltf", {"uri": "data:", "interpolation": "CUBICSPLINE"}),
        ("b.gltf", {"uri": "my%20buffer.bin", "interpolation": "STEP"}),
        ("a.vrma", {"humanoid": "VRMC_vrm_animation"}),
        ("a.vrm", {"humanoid": "VRMC_vrm"}),
        ("b.vrm", {"humanoid": "VRM", "integers": True}),
    ],
)
def test_a_gltf_file_holds_the_dance(tmp_path, in_bvh, name, options):
    path = write_gltf(tmp_path / name, DANCE, **options)
    if path.name == "b.gltf":
        (tmp_path / "my%20buffer.bin").rename(tmp_path / "my buffer.bin")
    assert_same_dance(path, in_bvh)


def without(*keys):
    def change(content):
        for key in keys:
            content.pop(key)

    return change


def circle(content):
    content["nodes"][23]["children"] = [1]


def sparse(content):
    content["accessors"][0]["sparse"] = {}


def too_long(content):
    content["accessors"][0]["count"] = 10**9


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without("animations"), r"an animation of a skeleton, found none \(a \.vrm file is a body"),
        (without("nodes"), "not a readable glTF 2.0 file"),
        (lambda content: content["nodes"][10].update(name="Bone"), "no joint for"),
        (circle, "node 1: expected one parent"),
        (sparse, "accessor 0: expected an animation that is neither sparse nor compressed"),
        (too_long, "not a readable glTF 2.0 file"),
        (lambda content: content["buffers"][0].update(uri="../secret.bin"), "buffers in the file's own folder"),
        (lambda content: content["buffers"][0].update(uri="%2e%2e/secret.bin"), "buffers in the file's own folder"),
        (lambda content: content["buffers"][0].update(uri="/etc/passwd"), "buffers in the file's own folder"),
    ],
)
def test_other_gltf_files_are_refused(tmp_path, change, message):
    (tmp_path / "secret.bin").write_bytes(bytes(10**6))
    (tmp_path / "in").mkdir()
    with pytest.raises(InputError, match=rf"a\.glb.*{message}") as error:
        read_performance(write_gltf(tmp_path / "in" / "a.glb", DANCE, change=change))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["a.glb", "a.fbx"])
def test_a_truncated_empty_or_foreign_file_is_refused_in_one_line(tmp_path, name):
    whole = write_gltf(tmp_path / "whole.glb", DANCE).read_bytes()
    for content in (whole[: len(whole) // 2], whole[:15], b"", b"Kaydara FBX Binary  \0", whole[:4] + bytes(100)):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name.replace(".", r"\.")) as error:
            read_performance(tmp_path / name)
        assert "\n" not in str(error.value)


def on_the_mean_adult(motion, parents, names):
    """(T, J, 3) joints of a motion on MEAN_ADULT_M, link by link."""
    turned, at = {}, {}
    for name, parent in zip(names, parents, strict=True):
        local = Rotation.from_quat(motion.quats[:, INDEX[name]], scalar_first=True)
        turned[name] = local if parent is None else turned[parent] * local
        offset = MEAN_ADULT_M[name] - MEAN_ADULT_M[parent or name]
        at[name] = motion.root_m if parent is None else at[parent] + turned[parent].apply(offset)
    return at


def write_amass(path, motion, width, **others):
    """A motion whose rotations are those of `SMPL_PARENTS`, z up as AMASS's are."""
    poses = np.zeros((len(motion), width))
    for joint, name in enumerate(SMPL_PARENTS):
        local = Rotation.from_quat(motion.quats[:, INDEX[name]], scalar_first=True)
        local = Z_UP * local if name == "Hips" else local
        poses[:, 3 * joint : 3 * joint + 3] = local.as_rotvec()
    arrays = {
        "poses": poses,
        "trans": Z_UP.apply(motion.root_m),
        "mocap_framerate": 30.0,
        "betas": np.zeros(16),
        "gender": "male",
    }
    np.savez(path, **arrays | others)
    return path


Z_UP = Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
SMPL_PARENTS = {
    "Hips": None, "LeftUpLeg": "Hips", "RightUpLeg": "Hips", "LowerBack": "Hips", "LeftLeg": "LeftUpLeg",
    "RightLeg": "RightUpLeg", "Spine": "LowerBack", "LeftFoot": "LeftLeg", "RightFoot": "RightLeg", "Spine1": "Spine",
    "LeftToeBase": "LeftFoot", "RightToeBase": "RightFoot", "Neck": "Spine1", "LeftShoulder": "Spine1",
    "RightShoulder": "Spine1", "Head": "Neck", "LeftArm": "LeftShoulder", "RightArm": "RightShoulder",
    "LeftForeArm": "LeftArm", "RightForeArm": "RightArm", "LeftHand": "LeftForeArm", "RightHand": "RightForeArm",
}  # fmt: skip
"""SMPL's tree in its order, by our names."""


@pytest.mark.parametrize("width", [72, 156, 165])
def test_an_smpl_motion_is_danced_by_the_mean_adult(tmp_path, width):
    read = read_performance(write_amass(tmp_path / "a.npz", DANCE, width))
    at = on_the_mean_adult(DANCE, SMPL_PARENTS.values(), SMPL_PARENTS)
    assert_joints_lie_at(read, at)
    np.testing.assert_allclose(read.times_s, np.arange(len(DANCE)) / 30)


JOINT_AT = {"ELBOW": ("ForeArm",), "SHOULDER": ("Arm",), "HIP": ("UpLeg",), "KNEE": ("Leg",), "FOOT": ("Foot", "ToeBase")}


def assert_joints_lie_at(read, at):
    """Each joint is as far from each other one, and as high above it, as it should be: to a millimetre."""
    places = {
        (side, joint): np.mean([at[side + bone] for bone in bones], axis=0)
        for side in ("Left", "Right")
        for joint, bones in JOINT_AT.items()
    }
    places |= {(side, "HAND"): at[f"{side}Hand"] for side in ("Left", "Right")}
    ours = [Joint[f"{side.upper()}_{joint}"] for side, joint in places]
    expected, found = np.stack(list(places.values()), axis=1), read.joints_m[:, ours]
    for values in (found, expected):
        assert values.shape == (len(read.times_s), len(ours), 3)
    apart = [np.linalg.norm(values[:, :, None] - values[:, None], axis=-1) for values in (found, expected)]
    np.testing.assert_allclose(*apart, atol=1e-3)
    assert np.ptp(found[..., 1] + expected[..., 1]) < 1e-3


def test_the_mean_adult_is_that_of_the_body_model():
    with np.load(ROOT / "synth/assets/body.npz") as body:
        heads = dict(zip(body["bone_names"].tolist(), body["mean_heads_m"], strict=True))
    for one, other in (("Arm", "ForeArm"), ("ForeArm", "Hand"), ("UpLeg", "Leg"), ("Leg", "Foot"), ("Foot", "ToeBase")):
        measured = np.linalg.norm(heads[f"Left{one}"] - heads[f"Left{other}"])
        assert np.linalg.norm(MEAN_ADULT_M[f"Left{one}"] - MEAN_ADULT_M[f"Left{other}"]) == pytest.approx(measured, abs=2e-3)


@pytest.mark.parametrize(
    ("others", "message"),
    [
        ({"poses": np.zeros((60, 100))}, "poses of 66, 72, 156, 165 numbers, found 100"),
        ({"poses": np.full((60, 72), np.nan)}, "poses, in radians"),
        ({"trans": np.zeros((3, 3))}, r"trans: shape \(3, 3\), expected \(frames = 60, 3\)"),
        ({"poses": np.array([{}])}, "not a readable .npz file"),
    ],
)
def test_other_poses_are_refused(tmp_path, others, message):
    with pytest.raises(InputError, match=rf"a\.npz.*{message}"):
        read_performance(write_amass(tmp_path / "a.npz", DANCE, 156, **others))
