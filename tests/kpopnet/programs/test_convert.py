"""The command that makes dance sets from recorded motion."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from bvh_files import write_bvh
from recorded_points import FRAMES, coco, imperial
from scipy.spatial.transform import Rotation

from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.errors import InputError
from kpopnet.programs.convert import read_imperial, write_dance
from kpopnet.skeleton import Joint
from synth.motion.skeleton import INDEX, LEG_M, NUM_JOINTS, Motion


def write_arm(path: Path, frames: int, left_arm_deg: float) -> None:
    """A person in T-pose whose left arm sinks by an angle in degrees; all other rotations are zero."""
    quats = np.tile([1.0, 0, 0, 0], (frames, NUM_JOINTS, 1))
    sunk_deg = -left_arm_deg * np.linspace(0, 1, frames)
    quats[:, INDEX["LeftArm"]] = Rotation.from_euler("z", sunk_deg[:, None], degrees=True).as_quat(scalar_first=True)
    write_bvh(path, Motion(quats, np.tile([0.0, 1, 0], (frames, 1)), 30.0, path.stem, LEG_M))


def test_bvh_files_become_a_dance(tmp_path, program):
    for name, degrees in (("teacher", 80.0), ("ann", 80.0), ("bob", 20.0)):
        write_arm(tmp_path / f"{name}.bvh", 20, degrees)
    files = ("--teacher", tmp_path / "teacher.bvh", "--learners", tmp_path / "ann.bvh", tmp_path / "bob.bvh")
    program("convert", "recordings", tmp_path / "out", "--dance", "t", *files)
    dance = KpopSet(tmp_path / "out").dance("t")
    teacher, (ann, bob) = dance.teacher(), (learner.joints() for learner in dance.learners)
    assert teacher.times_s[-1] == pytest.approx(18 / 30, abs=1e-3)  # the T-pose before the recording is left out
    np.testing.assert_allclose(ann.joints_m, teacher.joints_m)
    assert teacher.joints_m[0, Joint.LEFT_HAND, 0] > 0.5  # the T-pose, left hand on the right of the image
    sunk_m = [one.joints_m[-1, Joint.LEFT_HAND, 1] - one.joints_m[0, Joint.LEFT_HAND, 1] for one in (ann, bob)]
    assert sunk_m[0] > 2 * sunk_m[1] > 0.1
    np.testing.assert_allclose(bob.joints_m[:, Joint.RIGHT_HAND], ann.joints_m[:, Joint.RIGHT_HAND], atol=1e-3)


def test_keypoints_become_a_dance(tmp_path, program):
    for name in ("teacher", "best", "worst"):
        np.savez(tmp_path / f"{name}.npz", keypoints3d=coco(unit_m=0.01), fps=60)
    files = ("--teacher", tmp_path / "teacher.npz", "--learners", tmp_path / "best.npz", tmp_path / "worst.npz")
    assert "best first: best, worst" in program("convert", "recordings", tmp_path / "out", "--dance", "gBR", *files)
    dance = KpopSet(tmp_path / "out").dance("gBR")
    assert [learner.name for learner in dance.learners] == ["best", "worst"]
    assert dance.teacher().times_s[-1] == pytest.approx((FRAMES - 1) / 60)
    np.testing.assert_allclose(dance.learners[1].joints().joints_m, dance.teacher().joints_m, atol=1e-6)
    for day, name in enumerate(("teacher", "best", "worst")):
        times_s = 1.7e9 + 86_400 * day + np.arange(FRAMES) / 60  # since 1970
        np.savez(tmp_path / f"{name}.npz", keypoints3d=coco(), times_s=times_s)
    program("convert", "recordings", tmp_path / "days", "--dance", "gBR", *files)
    dance = KpopSet(tmp_path / "days").dance("gBR")
    assert [one.times_s[0] for one in (dance.teacher(), *(learner.joints() for learner in dance.learners))] == [0, 0, 0]
    again = partial(program, "convert", "recordings", tmp_path / "out", *files[:-1], fails=True)
    for learners in ((), (tmp_path / "worst.npz", tmp_path / "worst.npz"), (tmp_path / "worst.npz", tmp_path / "Worst.npz")):
        assert "at least two files of different names" in again(*learners, "--dance", "x")
    np.savez(tmp_path / "other.npz", keypoints3d=coco(unit_m=0.01), fps=60)
    for name, told in (("gBR", "gBR: holds worst of an earlier conversion"), ("a/b", "--dance 'a/b': expected a name")):
        assert told in again(tmp_path / "other.npz", "--dance", name)


def test_guessed_joints_become_missing_and_a_name_that_cannot_be_writes_nothing(tmp_path, program):
    confidence = np.ones((FRAMES, 17))
    confidence[5, 15:] = 0.02  # COCO's ankles
    for name in ("teacher", "best", "good (1)", "good"):
        np.savez(tmp_path / f"{name}.npz", keypoints3d=coco(), fps=60, confidence=confidence)
    convert = partial(program, "convert", "recordings", tmp_path / "out", "--dance", "t", "--teacher", tmp_path / "teacher.npz")
    told = convert("--learners", tmp_path / "best.npz", tmp_path / "good (1).npz", fails=True)
    assert "learner 'good (1)': expected a name" in told
    told = convert("--learners", tmp_path / "best.npz", tmp_path / "teacher.npz", fails=True)
    assert "learner 'teacher': expected a name" in told and "other than teacher" in told
    assert not (tmp_path / "out").exists()
    convert("--learners", tmp_path / "best.npz", tmp_path / "good.npz")
    dance = KpopSet(tmp_path / "out").dance("t")
    for performance in (dance.teacher(), dance.learners[0].joints()):
        feet = performance.joints_m[:, [Joint.RIGHT_FOOT, Joint.LEFT_FOOT]]
        assert np.isnan(feet[5]).all() and np.isfinite(np.delete(feet, 5, axis=0)).all()


def test_a_conversion_that_fails_leaves_no_mixed_dance(tmp_path, monkeypatch):
    near, nearer, far = (Performance(np.full((3, 15, 3), depth_m), np.arange(3) / 30) for depth_m in (3.0, 2.0, 2000.0))
    write_dance(tmp_path, "t", near, {"ann": near, "bob": near})
    before = {path.name: path.read_bytes() for path in (tmp_path / "t").iterdir()}
    with pytest.raises(InputError, match="bob: expected joints in metres, at most 1000 m"):
        write_dance(tmp_path, "t", nearer, {"ann": nearer, "bob": far})
    assert {path.name: path.read_bytes() for path in (tmp_path / "t").iterdir()} == before
    monkeypatch.setattr("kpopnet.programs.convert.write_learner", lambda *given: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_dance(tmp_path, "t", nearer, {"ann": nearer, "bob": near})
    assert {path.name for path in (tmp_path / "t").iterdir()} == before.keys() - {"labels.csv"}  # which is incomplete


def test_imperial_dance_becomes_one_dance_per_choreography(tmp_path, program):
    source = tmp_path / "imperial"
    source.mkdir()
    takes = np.stack([imperial(unit_m=0.001), imperial(unit_m=0.001, heading_rad=1.0)]).transpose(0, 3, 1, 2)
    for level in "eib":
        np.save(source / f"dance_level_{level}_k_ch0.npy", takes)
    np.save(source / "dance_level_e_b_ch1.npy", takes)
    assert read_imperial(source / "dance_level_e_k_ch0.npy").shape == (2, FRAMES, 21, 3)
    program("convert", "imperial", source, tmp_path / "out")
    dances = KpopSet(tmp_path / "out")
    assert dances.names == ["k_ch0"]  # the other choreography has no intermediate dancer and no beginner
    dance = dances.dance("k_ch0")
    assert [learner.name for learner in dance.learners] == ["expert", "intermediate", "beginner"]
    np.testing.assert_allclose(dance.learners[0].joints().joints_m, dance.teacher().joints_m, atol=1e-4)
    for wrong, told in ((takes[0], "expected (takes, 3, frames, 21)"), (takes[:1], "two experts are needed")):
        np.save(source / "dance_level_e_k_ch0.npy", wrong)
        assert told in program("convert", "imperial", source, tmp_path / "other", fails=True)
