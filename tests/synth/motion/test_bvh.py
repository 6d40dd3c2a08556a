import logging
import re
from dataclasses import replace

import numpy as np
import pytest
from bvh_files import write_bvh
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from synth.motion.choreography.composer import dance
from synth.motion.recorded import bvh_motion, open_clips
from synth.motion.skeleton import INDEX, JOINT_NAMES, LEG_M, REST_OFFSETS_M, forward_kinematics
from synth.motion.splice import cut

DANCE = dance(2, seconds=2.0)
MIXAMO = {"LowerBack": "Spine", "Spine": "Spine1", "Spine1": "Spine2"}


def assert_same_motion(read, written, atol=2e-5):
    points, turned = forward_kinematics(read.quats, read.root_m)
    expected, expected_turned = forward_kinematics(written.quats, written.root_m)
    np.testing.assert_allclose(np.abs((turned * expected_turned).sum(axis=-1)), 1, atol=atol)
    np.testing.assert_allclose(points, expected, atol=1e-3)


@pytest.mark.parametrize(("order", "unit"), [("ZYX", 0.01), ("XYZ", 0.0254), ("YXZ", 0.0254 / 0.45)])
def test_a_dance_survives_the_round_trip_in_any_channel_order_and_unit_above_any_floor(tmp_path, order, unit, caplog):
    high = replace(DANCE, root_m=DANCE.root_m + np.float32([0, 0.7, 0]))
    with caplog.at_level(logging.INFO):
        read = bvh_motion(write_bvh(tmp_path / "dance.bvh", high, order=order, unit=unit))
    assert "dance.bvh: a leg of" in caplog.text
    assert_same_motion(read, DANCE)
    assert read.fps == pytest.approx(30, abs=0.01)
    assert read.leg_m == pytest.approx(LEG_M, abs=1e-4)
    assert read.name == "bvh:dance"


def test_who_is_in_the_air_most_of_the_time_comes_down_on_the_floor(tmp_path):
    leaps_m = np.where(np.arange(len(DANCE)) % 5 == 0, 0.0, 0.4)[:, None] * np.float32([0, 1, 0])
    leaping = replace(DANCE, root_m=(DANCE.root_m + leaps_m).astype(np.float32))
    assert_same_motion(bvh_motion(write_bvh(tmp_path / "leaping.bvh", leaping)), leaping)


def test_the_joints_of_a_recorded_skeleton_with_z_up_are_those_of_its_kinematics(tmp_path):
    rest = {f"Left{part}": Rotation.from_euler("Z", -50, degrees=True) for part in ("Arm", "ForeArm", "Hand")}
    z_up = Rotation.from_matrix([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    read = read_performance(write_bvh(tmp_path / "dance.bvh", DANCE, axes=z_up, unit=0.0254, rest=rest))
    expected, _ = forward_kinematics(DANCE.quats, DANCE.root_m)
    for joint, name in ((Joint.LEFT_HAND, "LeftHand"), (Joint.RIGHT_KNEE, "RightLeg"), (Joint.LEFT_SHOULDER, "LeftArm")):
        # A turn about the vertical and a shift of the origin keep heights and distances.
        assert np.ptp(read.joints_m[:, joint, 1] + expected[:, INDEX[name], 1]) < 1e-3
        apart_m = np.linalg.norm(read.joints_m[:, joint] - read.joints_m[:, Joint.RIGHT_SHOULDER], axis=1)
        known_m = np.linalg.norm(expected[:, INDEX[name]] - expected[:, INDEX["RightArm"]], axis=1)
        np.testing.assert_allclose(apart_m, known_m, atol=1e-3)
    assert read.joints_m[:5, Joint.LEFT_HIP, 0].mean() > read.joints_m[:5, Joint.RIGHT_HIP, 0].mean() + 0.1


def test_the_path_is_found_wherever_a_rig_keeps_it(tmp_path):
    plain = write_bvh(tmp_path / "plain.bvh", DANCE)
    lines = plain.read_text().splitlines()
    begin = lines.index("MOTION")
    channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation"
    rig = ["HIERARCHY", "ROOT rig", "{", "OFFSET 0 0 0", channels, lines[1].replace("ROOT", "JOINT"), *lines[2:begin], "}"]
    moved = [f"0 0 0 0 0 0 {line}" for line in lines[begin + 3 :]]
    (tmp_path / "rig.bvh").write_text("\n".join([*rig, *lines[begin : begin + 3], *moved]) + "\n")
    expected, read = (read_performance(tmp_path / name).joints_m for name in ("plain.bvh", "rig.bvh"))
    np.testing.assert_allclose(read, expected, atol=1e-5)
    assert_same_motion(bvh_motion(tmp_path / "rig.bvh"), bvh_motion(plain))
    (tmp_path / "capitals").mkdir()
    plain.rename(tmp_path / "capitals" / "A.BVH")
    assert len(open_clips(tmp_path / "capitals", "train")) == 1


def test_a_rest_pose_with_the_arms_down_and_the_legs_apart_is_rotated_to_the_t_pose(tmp_path):
    degrees = {"Arm": -50, "ForeArm": -50, "Hand": -50, "UpLeg": 20, "Leg": 20}
    rest = {
        f"{side}{part}": Rotation.from_euler("Z", sign * angle, degrees=True)
        for side, sign in (("Left", 1), ("Right", -1))
        for part, angle in degrees.items()
    }
    assert_same_motion(bvh_motion(write_bvh(tmp_path / "a.bvh", DANCE, rest=rest)), DANCE)


LIMBS = ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase")
JOINTS = dict(zip(LIMBS, ("Collar", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "Toe"), strict=True))
UNREAL = dict(zip(LIMBS, ("clavicle", "upperarm", "lowerarm", "hand", "thigh", "calf", "foot", "ball"), strict=True))
VROID = dict(zip(LIMBS, ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "ToeBase"), strict=True))
MMD = dict(zip(LIMBS, ("肩", "腕", "ひじ", "手首", "足", "ひざ", "足首", "つま先"), strict=True))
SIDES = ("Left", "Right")


@pytest.mark.parametrize(
    "names",
    [
        {f"{side}{limb}": f"{side}{joint}" for side in SIDES for limb, joint in JOINTS.items()}
        | {"LowerBack": "chest", "Spine": "chest2", "Spine1": "chest3"},
        {f"{side}{limb}": f"{bone}_{side[0].lower()}" for side in SIDES for limb, bone in UNREAL.items()} | {"Hips": "pelvis"},
        {name: f"J_Bip_C_{name}" for name in ("Hips", "Head", "Neck")}
        | {f"{side}{limb}": f"J_Bip_{side[0]}_{bone}" for side in SIDES for limb, bone in VROID.items()},
        {"Hips": "センター", "Head": "頭", "Neck": "首", "Spine": "上半身"}
        | {f"{side}{limb}": f"{'左右'[side == 'Right']}{bone}" for side in SIDES for limb, bone in MMD.items()},
        {name: f"mixamorig:{MIXAMO.get(name, name)}" for name in JOINT_NAMES},
        {name: name.replace("Left", "left_").replace("Right", "right_").upper() for name in JOINT_NAMES},
    ],
    ids=["joints", "unreal", "vroid", "mikumikudance", "mixamo", "separators"],
)
def test_other_naming_conventions_are_recognised(tmp_path, names):
    assert_same_motion(bvh_motion(write_bvh(tmp_path / "a.bvh", DANCE, rename=lambda name: names.get(name, name))), DANCE)


def with_a_lost_forearm(text: str) -> str:
    """Makes the hands finger bases of zero length below a "hand" that is the end of the forearm, as in cgspeed's files."""
    lines = text.splitlines()
    start = lines.index("MOTION")
    joints = [line.split()[1] for line in lines[:start] if line.split()[0] in ("ROOT", "JOINT")]
    rows = [line.split() for line in lines[start + 3 :]]
    for side in ("Right", "Left"):  # the later columns first
        i = next(i for i, line in enumerate(lines) if line.split() == ["JOINT", f"{side}Hand"])
        block = lines[i + 4 : i + 9]  # its end site and closing brace
        base = [f"JOINT {side}FingerBase", "{", "OFFSET 0 0 0", lines[i + 3], *block]
        lines[i + 4 : i + 9] = [*base, "}"]
        column = 3 + 3 * joints.index(f"{side}Hand")
        rows = [[*row[:column], "0", "0", "0", *row[column:]] for row in rows]
    start = lines.index("MOTION")
    return "\n".join([*lines[: start + 3], *(" ".join(row) for row in rows)])


def test_the_bones_that_cgspeed_lost_do_not_change_the_motion(tmp_path):
    wave = np.array(DANCE.quats)
    for side in ("Left", "Right"):
        wave[:, INDEX[f"{side}Hand"]] = Rotation.from_euler("XZ", [30, 40], degrees=True).as_quat(scalar_first=True)
    waving = replace(DANCE, quats=wave)
    text = with_a_lost_forearm(write_bvh(tmp_path / "05_01.bvh", waving).read_text())
    thorax = " ".join(f"{x:.6f}" for x in REST_OFFSETS_M[INDEX["Neck"]] / 0.01)
    text = text.replace(f"OFFSET {thorax}", "OFFSET 0 0 0")
    assert text.count("OFFSET 0 0 0\n") == 5
    (tmp_path / "05_01.bvh").write_text(text)
    assert_same_motion(bvh_motion(tmp_path / "05_01.bvh"), waving)


def test_a_t_pose_before_the_recording_defines_the_rest_of_feet_and_neck_and_is_dropped(tmp_path):
    # CMU's rest pose: legs and feet are slanted, the neck is bent.
    rest = {"Neck": Rotation.from_euler("X", 16, degrees=True), "Neck1": Rotation.from_euler("X", -5, degrees=True)}
    for side, sign in (("Left", 1), ("Right", -1)):
        slant = Rotation.from_euler("Z", 20 * sign, degrees=True)
        rest |= {f"{side}{part}": slant for part in ("UpLeg", "Leg", "Foot", "ToeBase")}
    quats, root_m = DANCE.quats[19:].copy(), DANCE.root_m[19:].copy()
    quats[0], root_m[0] = (1, 0, 0, 0), root_m[1]
    read = bvh_motion(write_bvh(tmp_path / "05_01.bvh", replace(DANCE, quats=quats, root_m=root_m), rest=rest))
    assert_same_motion(read, cut(DANCE, 20, len(DANCE)))


def test_the_wrong_rate_of_cmus_subjects_60_and_61_is_corrected_and_that_of_no_other_file(tmp_path):
    cmu, cm = 0.0254 / 0.45, 0.01
    wrong, right = [("60_03", cmu), ("61_12", cmu)], [("60_03", cm), ("60_fps", cmu), ("05_01", cmu), ("160_3", cmu)]
    for name, unit in wrong + right:
        path = write_bvh(tmp_path / f"{name}.bvh", DANCE, fps=120, unit=unit)
        assert bvh_motion(path).fps == pytest.approx(60 if (name, unit) in wrong else 120, rel=1e-4)
        assert bvh_motion(path, fps=90.0).fps == 90.0


def test_a_missing_joint_is_reported_with_the_file_and_the_joints_found(tmp_path):
    path = write_bvh(tmp_path / "a.bvh", DANCE, rename=lambda name: "Bone07" if name == "RightForeArm" else name)
    with pytest.raises(InputError, match=r"a\.bvh: no joint for RightForeArm\..*LeftForeArm = LeftForeArm.*Bone07"):
        bvh_motion(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("CHANNELS 3", "CHANNELS 4", r"line \d+: expected .CHANNELS"),
        ("Frames: 60", "Frames: 999999999", "frame 61 of 999999999 was expected; the file is truncated"),
        ("Frame Time: 0.0333", "Frame Time: -0.0333", r"line \d+: expected a frame time above zero"),
        ("Frame Time: 0.0333", "Frame Time: 2", "states 0.5 frames a second"),
    ],
)
def test_malformed_and_hostile_files_are_refused_with_the_line(tmp_path, old, new, message):
    path = write_bvh(tmp_path / "bad.bvh", DANCE)
    text = re.sub(r"Frame Time: .*", "Frame Time: 0.0333", path.read_text())
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=r"bad\.bvh.*" + message):
        bvh_motion(path)
