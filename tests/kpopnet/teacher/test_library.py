"""The dances and the teacher's body: files, dances of one's own, and poses after fifteen joints."""

import zipfile
from dataclasses import replace

import numpy as np
import pytest

from kpopnet.dance.joint_files.bones import world_rotations
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from kpopnet.errors import InputError
from kpopnet.skeleton import BONES, MIRROR, Joint
from kpopnet.teacher.adding import add_group, holds_depth, kpop_teachers, part_of
from kpopnet.teacher.library import DANCES, TRIES, Library, difficulty, moves_cm, preview_cm
from kpopnet.teacher.posing import TO_WORLD, as_bvh, at_rate, learners_movement, posed
from synth.body.teacher import teacher_person
from synth.dances.live import CAMERA
from synth.simulated.film import Studio


def test_a_dance_survives_writing_and_reading(library, tmp_path):
    dance, other = library.dance("dance_001"), Library(tmp_path, library.body)
    other.write("copy", dance)
    again = other.dance("copy")
    assert again.about == dance.about and other.about("copy") == dance.about
    assert np.abs(again.quats - dance.quats).max() < 1e-4 and np.array_equal(again.joints_m, dance.joints_m)
    other.write("copy", replace(dance, about=replace(dance.about, name="Other")))
    assert other.about("copy").name == "Other"
    content = (tmp_path / DANCES / "copy.npz").read_bytes()
    (tmp_path / DANCES / "cut.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError, match=r"cut\.npz"):
        other.dance("cut")
    for no_name in ("../dances/copy", "", "Dance", "x" * 65, "copy\0", "dance_999"):
        with pytest.raises(InputError, match="there is no dance"):
            other.dance(no_name)
    (tmp_path / TRIES / "own_001").mkdir(parents=True)  # of a dance that was removed, which keeps its tries
    assert other.add(dance) == "own_002"


def test_the_preview_is_centred_and_upright_and_fast_dances_are_difficult(library):
    dance = library.dance("dance_001")
    frames = np.array(preview_cm(dance)).reshape(-1, 15, 2)
    assert len(frames) == 40 and np.abs(frames.mean(axis=(0, 1))).max() < 2
    assert (frames[:, Joint.HEAD, 1] > frames[:, Joint.LEFT_FOOT, 1]).all()
    way_cm = 100 * dance.joints_m[:120:3, Joint.TORSO, 0]  # which the dancer travels in the picture, too
    np.testing.assert_allclose(frames[:, Joint.TORSO, 0] - frames[0, Joint.TORSO, 0], way_cm - way_cm[0], atol=1.1)
    assert np.ptp(way_cm) > 5
    levels = [difficulty(dance.joints_m, fps) for fps in (5.0, 30.0, 90.0)]
    assert levels[0] == 1 and levels[2] == 5 and levels == sorted(levels)
    assert difficulty(np.full((9, 15, 3), np.nan), 30.0) == 1


def test_depth_and_joints_are_told_apart(tmp_path):
    for name, is_depth in (("depth_mm", True), ("joints_m", False), ("keypoints3d_optim", False)):
        np.savez(tmp_path / f"{name}.npz", **{name: np.zeros((1, 2, 2), np.uint16)})
        assert holds_depth(tmp_path / f"{name}.npz") == is_depth
    assert holds_depth(tmp_path) and holds_depth(tmp_path / "dance.bag") and not holds_depth(tmp_path / "dance.BVH")
    whole = (tmp_path / "joints_m.npz").read_bytes()
    directory = whole.rindex(b"PK\x01\x02")
    (tmp_path / "damaged.npz").write_bytes(whole[:directory] + b"XXXX" + whole[directory + 4 :])
    assert zipfile.is_zipfile(tmp_path / "damaged.npz") and not holds_depth(tmp_path / "damaged.npz")  # its reader says why
    (tmp_path / "dance").mkdir()
    assert kpop_teachers(tmp_path) == {} and kpop_teachers(tmp_path / "file.bvh") == {}


def test_a_part_is_cut_by_seconds_from_the_begin_on():
    times_s = 7 + np.arange(50) / 10
    whole = Performance(np.random.default_rng(0).normal(size=(50, 15, 3)), times_s, np.ones((50, 15)))
    part = part_of(whole, 1.0, 2.05, 7.0, "dance")
    np.testing.assert_allclose(part.times_s, 1 + np.arange(11) / 10, atol=1e-9)
    np.testing.assert_array_equal(part.joints_m, whole.joints_m[10:21])
    for from_s, to_s in ((9.0, None), (2.0, 1.0), (float("nan"), None)):
        with pytest.raises(InputError, match=r"dance: lasts 4.9 s; nothing is left from"):
            part_of(whole, from_s, to_s, 7.0, "dance")


def test_nearest_frames_are_taken_at_a_constant_rate_of_at_most_15_minutes(library):
    performance = library.dance("dance_001").performance
    assert len(at_rate(performance, 30.0)) == len(performance) - 1
    assert np.array_equal(at_rate(performance, 15.0), performance.joints_m[:-1:2].astype(np.float32))
    with pytest.raises(InputError, match="at most 900 s"):  # the file of a try may hold any time when it has been edited
        at_rate(Performance(np.zeros((2, 15, 3)), np.array([0.0, 7000.0])), 30.0)
    assert len(at_rate(Performance(np.zeros((1, 15, 3)), np.array([3.0])), 30.0)) == 1


def test_where_no_image_came_for_long_joints_are_missing_and_the_body_moves_on(library):
    performance = library.dance("dance_001").performance
    seen = (performance.times_s < 2.0) | (performance.times_s > 3.5)
    cut = Performance(performance.joints_m[seen], performance.times_s[seen])
    joints_m = at_rate(cut, 30.0)
    missing = np.isnan(joints_m).all(axis=(1, 2))
    times_s = performance.times_s[0] + np.arange(len(joints_m)) / 30
    assert np.isnan(joints_m[missing]).all() and not np.isnan(joints_m[~missing]).any()
    assert missing[(times_s > 2.05) & (times_s < 3.45)].all() and not missing[(times_s < 1.95) | (times_s > 3.55)].any()
    quats, hips_m = posed(joints_m, library.body)
    assert np.isfinite(quats).all() and np.isfinite(hips_m).all() and (np.ptp(quats[missing], axis=0) > 0.01).any()
    at_ten = Performance(performance.joints_m[::3], performance.times_s[::3])
    assert np.isfinite(at_rate(at_ten, 30.0)).all()


def test_the_longest_and_the_shortest_dance_can_be_added_and_its_try_be_shown(library, tmp_path, monkeypatch):
    for module in ("adding", "posing"):
        monkeypatch.setattr(f"kpopnet.teacher.{module}.MAX_S", 90.0)
    mine = Library(tmp_path, library.body)
    whole_m = np.resize(library.dance("dance_001").joints_m, (903, 15, 3)).astype(np.float64)
    for frames in (901, 50):  # 90 s, and 4.9 s as of a cut of 5 s
        performance = Performance(whole_m[:frames], np.arange(frames) / 10)
        identity = add_group(mine, [performance], "dance", "Long")
        lesson = Performance(whole_m[: frames + 1], np.arange(frames + 1) / 10 + 0.08)  # up to the image after the end
        assert len(learners_movement(lesson, mine.dance(identity).fps, mine.body).quats) == 3 * frames
    for frames in (902, 49):
        with pytest.raises(InputError, match="a dance lasts 5 to 90 s"):
            add_group(mine, [Performance(whole_m[:frames], np.arange(frames) / 10)], "dance", "Long")


SHOWN = {
    "きみと\u3000ダンス": "きみと ダンス",
    "Zoe\u0301": "Zo\u00e9",
    "\U0001f469\u200d\U0001f3a4": "\U0001f469\u200d\U0001f3a4",
}


def test_titles_of_any_script_are_shown_and_what_cannot_be_printed_is_refused(library):
    for title, shown in SHOWN.items():
        assert replace(library.about("dance_001"), name=title).name == shown
    for title in ("a\tb", "a\nb", "\u202egnirts", "\u2028"):
        with pytest.raises(InputError, match="letters that can be printed"):
            replace(library.about("dance_001"), name=title)


def test_joints_of_limbs_that_were_guessed_are_shown_but_not_taught(library, tmp_path):
    performance, feet = library.dance("dance_001").performance, [Joint.LEFT_FOOT, Joint.RIGHT_FOOT]
    confidence = np.ones((len(performance), 15))
    confidence[:, [*feet, Joint.TORSO]] = 0.1
    confidence[60:90, Joint.LEFT_HAND] = 0.1
    own = Library(tmp_path, library.body)
    guessed = Performance(performance.joints_m, performance.times_s, confidence)
    dance = own.dance(add_group(own, [guessed], "webcam", "before a webcam"))
    missing = np.isnan(dance.joints_m[..., 0])
    assert missing[:, feet].all() and missing[60:90, Joint.LEFT_HAND].all()
    assert missing.sum() == 2 * len(missing) + 30  # the torso stays
    sure = own.dance(add_group(own, [performance], "sure", "sure"))
    np.testing.assert_array_equal(dance.quats, sure.quats)


def directions(joints_m):
    bones = np.stack([joints_m[:, child] - joints_m[:, parent] for parent, child in BONES], axis=1)
    return bones / np.linalg.norm(bones, axis=-1, keepdims=True)


def test_the_limbs_point_where_the_dancers_do(library):
    dance, studio = library.dance("dance_001"), Studio(CAMERA, "cpu")
    quats, hips_m = posed(dance.joints_m, library.body)
    joints_m = studio.joints_world_m(teacher_person(), quats.astype(float), hips_m.astype(float))
    angle_deg = np.degrees(np.arccos(np.clip((directions(joints_m @ TO_WORLD.T) * directions(dance.joints_m)).sum(-1), -1, 1)))
    assert np.median(angle_deg) < 5 and np.percentile(angle_deg, 99) < 20


def test_bones_turn_as_those_of_who_danced_it(library):
    """Of the dances of the library all rotations are known: fifteen joints show nearly all but wrists and fingers."""
    parents = library.body.bone_parents.tolist()
    for name in ("dance_001", "dance_002"):
        dance = library.dance(name)
        found, true = (world_rotations(one, parents) for one in (posed(dance.joints_m, library.body)[0], dance.quats))
        apart_deg = np.degrees(2 * np.arccos(np.clip(np.abs((found * true).sum(axis=2)), 0, 1))).mean(axis=0)
        most_deg = {"Hips": 2, "Spine1": 4, "Shoulder": 5, "Arm": 4, "ForeArm": 8, "UpLeg": 4, "Leg": 4, "Foot": 12}
        for bone, most in most_deg.items():
            for side in ("",) if bone in ("Hips", "Spine1") else ("Left", "Right"):
                assert apart_deg[library.body.bone(side + bone)] < most, (name, side + bone)


def test_mirrored_joints_pose_a_mirrored_body(library):
    dance, sides = library.dance("dance_001"), np.array([1, 1, -1, -1])
    mirrored_m = dance.joints_m[:60, MIRROR] * np.array([-1, 1, 1])
    quats, mirrored = (posed(one, library.body)[0] for one in (dance.joints_m[:60], mirrored_m))
    for bone in ("Shoulder", "Arm", "ForeArm", "UpLeg", "Leg", "Foot"):
        right, left = mirrored[:, library.body.bone(f"Right{bone}")], quats[:, library.body.bone(f"Left{bone}")] * sides
        assert np.abs((right * left).sum(axis=1)).min() > 0.999, bone


def test_missing_joints_are_bridged(library):
    joints_m = library.dance("dance_001").joints_m[:90].copy()
    whole, _ = posed(joints_m, library.body)
    joints_m[40:43, Joint.LEFT_HAND] = np.nan
    joints_m[:, Joint.HEAD] = np.nan
    quats, hips_m = posed(joints_m, library.body)
    assert np.isfinite(quats).all() and np.isfinite(hips_m).all()
    bone = library.body.bone("LeftForeArm")
    assert np.abs((quats[:, bone] * whole[:, bone]).sum(axis=1)).min() > 0.95


def test_the_body_jumps_where_the_dancer_does_and_starts_above_the_origin(library):
    joints_m = np.repeat(library.dance("dance_001").joints_m[:1], 60, axis=0)
    joints_m[20:30, :, 1] -= 0.3
    joints_m[40:50] += np.float32([0.5, -0.04, 0])  # a step aside, and what may be an estimator's error
    _, hips_m = posed(joints_m, library.body)
    moved_m = hips_m - hips_m[0]
    np.testing.assert_allclose(moved_m[25], [0, 0, 0.3], atol=0.05)  # in the air its feet hang
    np.testing.assert_allclose(moved_m[45], [0.5, 0, 0], atol=0.01)
    np.testing.assert_allclose(hips_m[0, :2], 0, atol=1e-6)


def test_frames_without_joints_are_neither_moves_nor_thumbnails(library):
    dance = library.dance("dance_001")
    gaps_m = dance.joints_m.copy()
    gaps_m[[round(second * dance.fps) for second in (3, 7)]] = np.nan
    gaps_m[round(5 * dance.fps) :][:2, [Joint.LEFT_ELBOW, Joint.LEFT_HAND]] = np.nan
    seen = replace(dance, joints_m=gaps_m)
    assert [one["at_s"] for one in moves_cm(seen)] == [one["at_s"] for one in moves_cm(dance)]
    np.testing.assert_allclose(preview_cm(seen), preview_cm(dance), atol=5)
    gaps_m[:, Joint.HEAD] = np.nan  # which was never seen
    head, torso = (np.array(preview_cm(seen)).reshape(-1, 15, 2)[:, joint] for joint in (Joint.HEAD, Joint.TORSO))
    np.testing.assert_array_equal(head, torso)


def test_bvh_is_read_back_and_becomes_a_dance_of_ones_own(library, tmp_path):
    dance, path, mine = library.dance("dance_001"), tmp_path / "dance.bvh", Library(tmp_path / "mine", library.body)
    path.write_text(as_bvh(library.body, dance.quats, dance.hips_m, dance.fps))
    again = read_performance(path)
    assert len(again) == len(dance.joints_m)
    assert score_dance(dance.performance, again).similarity > 95  # its hands and head lie a little elsewhere in the body
    torsos_m = [one[:, Joint.TORSO] - one[:, Joint.LEFT_HIP] for one in (dance.joints_m, again.joints_m)]
    np.testing.assert_allclose(*torsos_m, atol=1e-3)
    assert [add_group(mine, [again], "dance.bvh", "Mine", 90.0) for _ in range(2)] == ["own_001", "own_002"]
    added = mine.dance("own_001")
    assert added.about.own and added.about.bpm == 90.0
    assert score_dance(dance.performance, added.performance).similarity > 95


def test_a_dance_whose_last_move_ends_within_half_a_frame_of_it_has_no_empty_move(library):
    whole = library.dance("dance_001")
    step = 4 * 60 / 129 * whole.fps
    short = replace(whole, joints_m=whole.joints_m[: round(2 * step)], about=replace(whole.about, bpm=129.0))
    assert 2 * step < len(short.joints_m) and [one["at_s"] < step / whole.fps for one in moves_cm(short)] == [True, False]
