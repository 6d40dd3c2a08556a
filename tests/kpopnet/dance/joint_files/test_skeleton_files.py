"""One dance by its skeleton in the files of other programs is the same performance as in BVH; what is damaged is refused."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from bvh_files import write_bvh
from gltf_files import write_gltf
from programs import ROOT
from scipy.spatial.transform import Rotation
from vmd_files import write_vmd

from kpopnet.dance.feedback import feedback
from kpopnet.dance.joint_files.bones import MEAN_ADULT_M
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.dance.scoring import score_dance
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import INDEX

DANCE = dance(2, seconds=2.0)
UNIT_M, REST = 1.693 / 20, ((0, 0, 0), (0, 0, 0, 1))
LIMBS = ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase")


def assert_same_dance(path, expected):
    read = read_performance(path)
    step = round((len(read.times_s) - 1) / (len(expected.times_s) - 1))
    np.testing.assert_allclose(read.times_s[::step] - read.times_s[0], expected.times_s, atol=1e-4, err_msg=path.name)
    np.testing.assert_allclose(read.joints_m[::step], expected.joints_m, atol=1e-3, err_msg=path.name)


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
    if options.get("interpolation") != "STEP":
        between_m = (in_bvh.joints_m[:-1] + in_bvh.joints_m[1:]) / 2
        np.testing.assert_allclose(read_performance(path).joints_m[1::2], between_m, atol=0.012)


def first_keys(content, count):
    """The one animation of a glTF file, cut to its first keys."""
    (dance,), own = content["animations"], {}
    for sampler in dance["samplers"]:
        for number in (sampler["input"], sampler["output"]):
            if number not in own:
                own[number] = len(content["accessors"])
                content["accessors"].append(content["accessors"][number] | {"count": count})
    return dance | {"samplers": [one | {"input": own[one["input"]], "output": own[one["output"]]} for one in dance["samplers"]]}


def test_of_several_animations_in_a_gltf_file_the_longest_is_the_dance(tmp_path, in_bvh):
    def with_a_pose(content):
        """A short animation before the dance, and another after it: its first three keys."""
        (dance,), pose = content["animations"], first_keys(content, 3)
        content["animations"] = [pose, dance, pose]

    assert_same_dance(write_gltf(tmp_path / "a.glb", DANCE, change=with_a_pose), in_bvh)


def test_an_animation_of_a_camera_that_lasts_longer_is_not_the_dance(tmp_path, in_bvh):
    def filmed(content):
        """The first half of the dance, and for the whole of it a camera that moves."""
        (dance,), half = content["animations"], first_keys(content, 30)
        content["nodes"].append({"name": "Camera"})
        first, number = dance["channels"][0], len(content["nodes"]) - 1
        camera = dance | {"channels": [first | {"target": first["target"] | {"node": number}}]}
        content["animations"] = [camera, half]

    read = read_performance(write_gltf(tmp_path / "a.glb", DANCE, change=filmed))
    expected = in_bvh.joints_m[: len(read) // 2]
    assert len(read) == 59 and np.ptp(read.joints_m, axis=0).max() > 0.1
    np.testing.assert_allclose(read.joints_m[::2][: len(expected)], expected, atol=0.012)


def bent(motion, bone, degrees):
    """A motion in which a bone is turned forwards throughout, beyond what it does."""
    quats = motion.quats.astype(float)
    local = Rotation.from_euler("X", degrees, degrees=True) * Rotation.from_quat(quats[:, INDEX[bone]], scalar_first=True)
    quats[:, INDEX[bone]] = local.as_quat(scalar_first=True)
    return replace(motion, quats=quats)


WRITERS = {
    "bvh": write_bvh, "glb": write_gltf, "npz": lambda path, motion: write_amass(path, motion, 72),
    "vmd": lambda path, motion: write_vmd(path, vmd_bones(motion)),
}  # fmt: skip


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_bent_back_is_a_fault_of_the_torso_in_skeletons_of_all_files(tmp_path, suffix):
    motion = dance(2, seconds=6.0)
    score = score_dance(
        *(read_performance(WRITERS[suffix](tmp_path / f"a.{suffix}", one)) for one in (motion, bent(motion, "Spine", 30)))
    )
    assert score.parts.pop("torso") < 35 and min(score.parts.values()) > 95
    (fault,) = feedback(score).faults
    assert re.fullmatch(r"torso (2[5-9]|3[0-5])° bent too far forward throughout", str(fault.text))


def test_a_skin_and_not_the_nodes_says_how_a_skeleton_of_gltf_rests(tmp_path, in_bvh):
    """Nodes may rest in any pose, such as the animation's first, and a skin may be bound in any unit."""

    def without_skin(content):
        del content["skins"]

    resting = bent(DANCE, "Spine", 40).quats[0]
    assert_same_dance(write_gltf(tmp_path / "a.glb", DANCE, resting=resting), in_bvh)
    moved = read_performance(write_gltf(tmp_path / "b.glb", DANCE, resting=resting, change=without_skin)).joints_m[::2]
    np.testing.assert_allclose(np.delete(moved - in_bvh.joints_m, Joint.TORSO, axis=1), 0, atol=1e-3)
    assert np.linalg.norm((moved - in_bvh.joints_m)[:, Joint.TORSO], axis=-1).min() > 0.02


def on_the_mean_adult(motion, parents, names):
    """(T, J, 3) joints of a motion on MEAN_ADULT_M, link by link."""
    turned, at = {}, {}
    for name, parent in zip(names, parents, strict=True):
        local = Rotation.from_quat(motion.quats[:, INDEX[name]], scalar_first=True)
        turned[name] = local if parent is None else turned[parent] * local
        offset = MEAN_ADULT_M[name] - MEAN_ADULT_M[parent or name]
        at[name] = motion.root_m if parent is None else at[parent] + turned[parent].apply(offset)
    middle_m = np.mean([MEAN_ADULT_M[side + bone] for side in ("Left", "Right") for bone in ("Arm", "UpLeg")], axis=0)
    return at | {"Torso": at["Spine"] + turned["Spine"].apply(middle_m - MEAN_ADULT_M["Spine"])}


def write_amass(path, motion, width, **others):
    """A motion whose rotations are those of `SMPL_PARENTS`, z up as AMASS's are."""
    poses = np.zeros((len(motion), width))
    for joint, name in enumerate(SMPL_PARENTS):
        local = Rotation.from_quat(motion.quats[:, INDEX[name]], scalar_first=True)
        local = Z_UP * local if name == "Hips" else local
        poses[:, 3 * joint : 3 * joint + 3] = local.as_rotvec()
    arrays = {"poses": poses, "trans": Z_UP.apply(motion.root_m), "mocap_framerate": 30.0, "betas": np.zeros(16)}
    np.savez(path, **{name: value for name, value in (arrays | others).items() if value is not None})
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


TIMES_S = np.arange(len(DANCE)) / 30


@pytest.mark.parametrize(("width", "rate"), [(72, {"mocap_framerate": 30.0}), (165, {"fps": 30.0}), (66, {"times_s": TIMES_S})])
def test_an_smpl_motion_is_danced_by_the_mean_adult(tmp_path, width, rate):
    motion = bent(DANCE, "Spine", 20)
    read = read_performance(write_amass(tmp_path / "a.npz", motion, width, **{"mocap_framerate": None} | rate))
    assert_joints_lie_at(read, on_the_mean_adult(motion, SMPL_PARENTS.values(), SMPL_PARENTS))
    np.testing.assert_allclose(read.times_s, TIMES_S)


def test_an_smpl_motion_without_a_path_is_danced_about_the_hips(tmp_path):
    read, still = (
        read_performance(write_amass(tmp_path / "a.npz", DANCE, 72, **one)).joints_m for one in ({}, {"trans": None})
    )
    hips_m, fixed_m = (one[:, [Joint.LEFT_HIP, Joint.RIGHT_HIP]].mean(axis=1, keepdims=True) for one in (read, still))
    np.testing.assert_allclose(still - fixed_m, read - hips_m, atol=1e-5)
    assert np.ptp(fixed_m, axis=0).max() < 1e-5 < 0.05 < np.ptp(hips_m, axis=0).max()


def assert_joints_lie_at(read, at):
    """Each joint is as far from each other one, and as high above it, as it should be: to a millimetre."""
    bones = {"ELBOW": "ForeArm", "SHOULDER": "Arm", "HIP": "UpLeg", "KNEE": "Leg", "HAND": "Hand"}
    places = {f"{side}_{joint}": at[side + bone] for side in ("Left", "Right") for joint, bone in bones.items()}
    places |= {f"{side}_FOOT": (at[f"{side}Foot"] + at[f"{side}ToeBase"]) / 2 for side in ("Left", "Right")}
    places["Torso"] = at["Torso"]
    found, expected = read.joints_m[:, [Joint[name.upper()] for name in places]], np.stack(list(places.values()), axis=1)
    apart = [np.linalg.norm(values[:, :, None] - values[:, None], axis=-1) for values in (found, expected)]
    np.testing.assert_allclose(*apart, atol=1e-3)
    assert np.ptp(found[..., 1] + expected[..., 1]) < 1e-3


def test_the_mean_adult_is_that_of_the_body_model():
    with np.load(ROOT / "synth/assets/body.npz") as body:
        heads = dict(zip(body["bone_names"].tolist(), body["mean_heads_m"], strict=True))
    for one, other in (("Arm", "ForeArm"), ("ForeArm", "Hand"), ("UpLeg", "Leg"), ("Leg", "Foot"), ("Foot", "ToeBase")):
        measured = np.linalg.norm(heads[f"Left{one}"] - heads[f"Left{other}"])
        assert np.linalg.norm(MEAN_ADULT_M[f"Left{one}"] - MEAN_ADULT_M[f"Left{other}"]) == pytest.approx(measured, abs=2e-3)


VMD_PARENTS = SMPL_PARENTS | dict.fromkeys(("Neck", "LeftShoulder", "RightShoulder"), "Spine")
VMD_NAMES = {"Hips": "グルーブ", "LowerBack": "上半身", "Spine": "上半身2", "Neck": "首", "Head": "頭"} | {
    side + ours: sign + theirs
    for side, sign in (("Left", "左"), ("Right", "右"))
    for ours, theirs in zip(LIMBS, ("肩", "腕", "ひじ", "手首", "足", "ひざ", "足首", "つま先"), strict=True)
}


def vmd_place(place_m):
    return np.array(place_m) * [1, 1, -1] / UNIT_M


VMD_BONES = [name for name in SMPL_PARENTS if name != "Spine1"]


def vmd_bones(motion):
    """Keys of each frame of VMD_BONES: rotations from a stance whose arms hang by 35 degrees."""
    stance = dict.fromkeys(VMD_PARENTS, Rotation.identity()) | {None: Rotation.identity()}
    for side, angle in (("Left", -35), ("Right", 35)):
        stance |= {side + part: Rotation.from_euler("Z", angle, degrees=True) for part in ("Arm", "ForeArm", "Hand")}
    bones = {}
    for name in VMD_BONES:
        local = Rotation.from_quat(motion.quats[:, INDEX[name]], scalar_first=True)
        quats = (stance[VMD_PARENTS[name]] * local * stance[name].inv()).as_quat() * [-1, -1, 1, 1]
        bones[VMD_NAMES[name]] = [(frame, (0, 0, 0), quat) for frame, quat in enumerate(quats)]
    places = vmd_place(motion.root_m - motion.root_m[0])
    return bones | {"センター": [(frame, place, (0, 0, 0, 1)) for frame, place in enumerate(places)]}


def test_a_vmd_motion_is_danced_by_the_mean_adult(tmp_path):
    at, bones = on_the_mean_adult(DANCE, [VMD_PARENTS[name] for name in VMD_BONES], VMD_BONES), vmd_bones(DANCE)
    read = read_performance(write_vmd(tmp_path / "a.vmd", bones))
    assert_joints_lie_at(read, at)
    np.testing.assert_allclose(read.times_s, TIMES_S)
    # The same feet, moved by IK; then switched off, where the keys of the legs hold.
    moved = {name: keys for name, keys in bones.items() if name[1:] not in ("足", "ひざ", "足首")}
    for side, sign in (("Left", "左"), ("Right", "右")):
        rest_m = MEAN_ADULT_M[f"{side}Foot"] + DANCE.root_m[0]
        ankle, toe = at[f"{side}Foot"], at[f"{side}ToeBase"]
        turned = toe - ankle - (MEAN_ADULT_M[f"{side}ToeBase"] - MEAN_ADULT_M[f"{side}Foot"])
        moved[f"{sign}足ＩＫ"] = [(frame, place, (0, 0, 0, 1)) for frame, place in enumerate(vmd_place(ankle - rest_m))]
        moved[f"{sign}つま先ＩＫ"] = [(frame, place, (0, 0, 0, 1)) for frame, place in enumerate(vmd_place(turned))]
    followed = read_performance(write_vmd(tmp_path / "b.vmd", moved))
    feet = [Joint.LEFT_FOOT, Joint.RIGHT_FOOT, Joint.LEFT_HAND, Joint.LEFT_HIP]
    for one in feet:
        apart = [np.linalg.norm(found.joints_m[:, feet] - found.joints_m[:, [one]], axis=-1) for found in (followed, read)]
        np.testing.assert_allclose(*apart, atol=1e-3)
    off, on = ([(frame, f"{sign}足ＩＫ", bool(frame)) for sign in "左右"] for frame in (0, 1))
    again = read_performance(write_vmd(tmp_path / "d.vmd", moved, switches=off + on))
    steps_m = [one.joints_m[1:, Joint.LEFT_FOOT] - one.joints_m[1:, Joint.RIGHT_FOOT] for one in (again, followed)]
    np.testing.assert_allclose(*np.linalg.norm(steps_m, axis=-1), atol=1e-3)
    still = {f"{sign}足ＩＫ": [(0, (9, 9, 9), (0, 0, 0, 1))] for sign in "左右"}
    assert_joints_lie_at(read_performance(write_vmd(tmp_path / "c.vmd", bones | still, switches=off)), at)


def test_the_waist_bends_the_back_and_turns_no_leg(tmp_path):
    bent_forward = (0, 0, 0), Rotation.from_euler("x", -30, degrees=True).as_quat()
    keys = {name: [(0, *REST)] for name in ("左腕", "右腕", "左足", "右足")} | {"腰": [(0, *bent_forward)]}
    (joints_m,) = read_performance(write_vmd(tmp_path / "a.vmd", keys)).joints_m
    np.testing.assert_allclose(joints_m[Joint.LEFT_KNEE] - joints_m[Joint.LEFT_HIP], [0, 0.381, 0], atol=2e-3)
    assert abs(joints_m[Joint.NECK, 2] - joints_m[Joint.LEFT_HIP, 2]) > 0.15


def test_knees_bend_forwards_where_the_hips_sink_above_planted_feet(tmp_path):
    sinks = [(0, *REST), (60, (0, 9, 0), (0, 0, 0, 1)), (60, (0, -4, 0), (0, 0, 0, 1))]  # of two keys the last one counts
    keys = {"左腕": [(0, *REST)], "右腕": [(0, *REST)], "センター": sinks}
    curve = (0, 100, 30, 127)  # fast at first
    read = read_performance(write_vmd(tmp_path / "a.vmd", keys, curve))
    t = np.linspace(0, 1, 100_001)
    x1, y1, x2, y2 = np.array(curve) / 127
    x, y = (3 * t * (1 - t) ** 2 * one + 3 * t**2 * (1 - t) * two + t**3 for one, two in ((x1, x2), (y1, y2)))
    thigh, shin, sunk = 0.381, 0.437, 4 * UNIT_M * np.interp(np.arange(61) / 60, x, y)
    hip, knee = read.joints_m[:, Joint.LEFT_HIP], read.joints_m[:, Joint.LEFT_KNEE]
    np.testing.assert_allclose(hip[:, 1] - hip[0, 1], sunk, atol=1e-3)
    far = thigh + shin - sunk
    cos = (thigh**2 + far**2 - shin**2) / (2 * thigh * far)
    np.testing.assert_allclose(knee[:, 1] - hip[:, 1], thigh * cos, atol=1e-3)
    np.testing.assert_allclose(hip[1:, 2] - knee[1:, 2], thigh * np.sqrt(1 - cos**2)[1:], atol=1e-3)  # the camera is in front
    np.testing.assert_allclose(read.joints_m[:, Joint.LEFT_FOOT], read.joints_m[[0] * 61, Joint.LEFT_FOOT], atol=1e-3)


def gltf(change):
    return "a.glb", partial(write_gltf, motion=DANCE, change=change)


def amass(**arrays):
    return "a.npz", partial(write_amass, motion=DANCE, width=156, **arrays)


def vmd(right_arm, **options):
    return "a.vmd", partial(write_vmd, bones={"左腕": [(0, *REST)], "右腕": [right_arm]} if right_arm else {}, **options)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (gltf(lambda content: content.pop("animations")), r"an animation of a skeleton, found none \(a \.vrm file is a body"),
        (gltf(lambda content: content["nodes"][23].update(children=[1])), "node 1: expected one parent"),
        (gltf(lambda content: content["accessors"][0].update(sparse={})), "an animation that is neither sparse nor compressed"),
        (gltf(lambda content: content["accessors"][0].update(count=10**9)), "not a readable glTF 2.0 file"),
        (gltf(lambda content: content["buffers"][0].update(uri="%2e%2e/secret.bin")), "buffers in the file's own folder"),
        (amass(poses=np.zeros((60, 100))), "poses of 66, 72, 156, 165 numbers, found 100"),
        (amass(trans=np.zeros((3, 3))), r"trans: shape \(3, 3\), expected \(frames = 60, 3\)"),
        (vmd((), cameras=3), "no keys of the bones 左腕, 右腕; it moves no bones"),
        (vmd((2**32 - 1, *REST)), "GB of memory"),
        (vmd((0, (0, 0, 0), (0, 0, 0, 0))), r"not a readable \.vmd file"),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path, file, message):
    (tmp_path / "secret.bin").write_bytes(bytes(10**6))
    (tmp_path / "in").mkdir()
    name, write = file
    with pytest.raises(InputError, match=rf"{name}.*{message}") as error:
        read_performance(write(tmp_path / "in" / name))
    assert "\n" not in str(error.value)


def test_the_parent_of_a_shoulder_moves_the_arm_without_turning_it(tmp_path):
    still, turned = [(0, *REST)], [(0, (0, 0, 0), (0.1, -0.2, 0.3, 0.927)), (9, (0, 0, 0), (0, 0, 0.6, 0.8))]
    bent = {name: [(0, (0, 0, 0), (0.5, 0.1, 0.1, 0.854))] for name in ("左腕", "右腕")}
    shrugged = read_performance(write_vmd(tmp_path / "a.vmd", bent | {"左肩P": turned, "右肩P": still}))
    at_rest = read_performance(write_vmd(tmp_path / "b.vmd", bent | {"左肩": still, "右肩": still}))
    arm = [Joint.LEFT_SHOULDER, Joint.LEFT_ELBOW, Joint.LEFT_HAND]
    moved = shrugged.joints_m[:, arm] - at_rest.joints_m[:1, arm]
    assert np.linalg.norm(moved[-1, 0]) > 0.05
    np.testing.assert_allclose(moved, np.repeat(moved[:, :1], 3, axis=1), atol=1e-5)
    own = read_performance(write_vmd(tmp_path / "c.vmd", bent | {"左肩": turned}))  # which turns the arm, too
    far_m = np.linalg.norm(own.joints_m[:, arm] - shrugged.joints_m[:, arm], axis=-1)
    assert far_m[:, 0].max() < 1e-5 and far_m[-1, 1:].min() > 0.1


def test_feet_follow_the_parent_of_their_ik_bone_too(tmp_path):
    still, lifted, turned = [(0, *REST)], [(0, *REST), (60, (1, 4, -2), (0, 0, 0, 1))], [(0, (0, 0, 0), (0, 0.6, 0, 0.8))]
    keys = dict.fromkeys(("左腕", "右腕", "左足ＩＫ", "右足ＩＫ"), still)
    own = read_performance(write_vmd(tmp_path / "a.vmd", keys | {"左足ＩＫ": lifted}))
    of_parent = read_performance(write_vmd(tmp_path / "b.vmd", keys | {"左足IK親": lifted}))
    np.testing.assert_allclose(of_parent.joints_m, own.joints_m, atol=1e-5)
    assert np.ptp(of_parent.joints_m[:, Joint.LEFT_KNEE, 1]) > 0.1
    # Below the ankle it turns the toes alone, as the IK bone does.
    own, of_parent = (
        read_performance(write_vmd(tmp_path / "c.vmd", keys | {name: turned})) for name in ("左足ＩＫ", "左足IK親")
    )
    np.testing.assert_allclose(of_parent.joints_m, own.joints_m, atol=1e-5)
