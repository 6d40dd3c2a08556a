"""The teacher's body after fifteen joints, and as BVH."""

import numpy as np
import pytest

from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.dance.scoring import score_dance
from kpopnet.skeleton import BONES, Joint
from kpopnet.teacher.adding import add_dance, at_rate
from kpopnet.teacher.bvh import as_bvh
from kpopnet.teacher.library import Library
from kpopnet.teacher.posing import forward, level_joints_m, posed
from synth.dances.live import CAMERA
from synth.dances.taught import teacher_person
from synth.simulated.film import Studio


@pytest.fixture(scope="module")
def studio():
    return Studio(CAMERA, "cpu")


def directions(joints_m):
    bones = np.stack([joints_m[:, child] - joints_m[:, parent] for parent, child in BONES], axis=1)
    return bones / np.linalg.norm(bones, axis=-1, keepdims=True)


def test_the_limbs_point_where_the_dancers_do(library, studio):
    dance = library.dance("dance_001")
    quats, hips_m = posed(dance.joints_m, library.body())
    joints_m = studio.joints_world_m(teacher_person(), quats.astype(float), hips_m.astype(float))
    angle_deg = np.degrees(
        np.arccos(np.clip((directions(level_joints_m(joints_m)) * directions(dance.joints_m)).sum(-1), -1, 1))
    )
    assert np.median(angle_deg) < 5 and np.percentile(angle_deg, 99) < 20


def test_missing_joints_are_bridged(library):
    joints_m = library.dance("dance_001").joints_m[:90].copy()
    whole, _ = posed(joints_m, library.body())
    joints_m[40:43, Joint.LEFT_HAND] = np.nan
    joints_m[:, Joint.HEAD] = np.nan
    quats, hips_m = posed(joints_m, library.body())
    assert np.isfinite(quats).all() and np.isfinite(hips_m).all()
    bone = library.body().bone("LeftForeArm")
    assert np.abs((quats[:, bone] * whole[:, bone]).sum(axis=1)).min() > 0.95


def test_the_t_pose_is_the_t_pose(library):
    body = library.body()
    heads_m = forward(np.tile(np.eye(3), (1, len(body.bone_names), 1, 1)), body)[0]
    hand, shoulder, knee, hip = (heads_m[body.bone(f"Left{name}")] for name in ("Hand", "Arm", "Leg", "UpLeg"))
    assert abs(hand - shoulder)[1:].max() < 1e-3 and hand[0] > shoulder[0] + 0.4
    assert abs(knee - hip)[:2].max() < 1e-3 and knee[2] < hip[2] - 0.3


def test_bvh_is_read_back_as_the_same_dance(library, tmp_path):
    dance, path = library.dance("dance_001"), tmp_path / "dance.bvh"
    path.write_text(as_bvh(library.body(), dance.quats, dance.hips_m, dance.fps))
    again = read_performance(path)
    assert len(again) == len(dance.joints_m)
    assert score_dance(dance.performance, again).similarity > 85  # its joints lie a little elsewhere in the body


def test_a_bvh_file_becomes_a_dance_of_its_own(library, tmp_path):
    dance, path, mine = library.dance("dance_001"), tmp_path / "dance.bvh", Library(tmp_path / "mine")
    path.write_text(as_bvh(library.body(), dance.quats, dance.hips_m, dance.fps))
    mine.write_body(library.body())
    assert [add_dance(mine, path, "Mine", 90.0) for _ in range(2)] == ["own_001", "own_002"]
    added = mine.dance("own_001")
    assert added.about.own and added.about.bpm == 90.0
    assert score_dance(dance.performance, added.performance).similarity > 85


def test_nearest_frames_are_taken_at_a_constant_rate(library):
    performance = library.dance("dance_001").performance
    assert len(at_rate(performance, 30.0)) == len(performance) - 1
    assert np.array_equal(at_rate(performance, 15.0), performance.joints_m[:-1:2].astype(np.float32))
