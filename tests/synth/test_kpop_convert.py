"""Converters: recordings of others become dances with the joints where they were."""

import json
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest

from kpopnet.benchmarks.kpop import KpopSet
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from synth import kpop_convert
from synth.kpop_convert import COCO, IMPERIAL, IMPERIAL_POINTS, aist_joints_m, imperial_joints_m, read_aist, read_imperial
from synth.motion.skeleton import NUM_JOINTS, PARENTS, POINT_NAMES, REST_OFFSETS_M

FRAMES = 50


def person(heading_rad: float = 0.0, unit_m: float = 1.0, z_up: bool = False) -> dict[str, np.ndarray]:
    """(T, 3) of every limb by its joint's name, y up, whose right hand rises; facing +z when heading_rad is 0."""
    at = {
        "HEAD": (0, 1.6, 0), "NECK": (0, 1.45, 0), "SHOULDER": (0.18, 1.4, 0), "ELBOW": (0.25, 1.15, 0),
        "HAND": (0.3, 0.9, 0.05), "HIP": (0.1, 0.95, 0), "KNEE": (0.12, 0.5, 0.05), "FOOT": (0.12, 0.1, 0),
    }  # fmt: skip
    found = {}
    for name, (x, y, z) in at.items():
        for side, sign in (("RIGHT_", -1), ("LEFT_", 1)) if name not in ("HEAD", "NECK") else (("", 1),):
            found[side + name] = np.tile([sign * x, y, z], (FRAMES, 1)).astype(float)
    found["RIGHT_HAND"][:, 1] += np.linspace(0, 0.8, FRAMES)
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    for name, points in found.items():
        x, y, z = points.T
        points = np.stack([cos * x + sin * z + 3, y, cos * z - sin * x - 1], axis=1)
        found[name] = (points[:, [0, 2, 1]] * [1, -1, 1] if z_up else points) / unit_m
    return found


def coco(**options) -> np.ndarray:
    found = person(**options)
    points = np.zeros((FRAMES, 17, 3))
    points[:, :5] = found["HEAD"][:, None]
    for name, number in COCO.items():
        points[:, number] = found[name]
    return points


def imperial(**options) -> np.ndarray:
    found = person(**options)
    points = np.zeros((FRAMES, len(IMPERIAL_POINTS), 3))
    points[:, IMPERIAL_POINTS.index("Head")], points[:, IMPERIAL_POINTS.index("Neck")] = found["HEAD"], found["NECK"]
    for name, number in IMPERIAL.items():
        points[:, number] = found[name]
    return points


def test_names_of_points_are_the_published_ones():
    assert (COCO["LEFT_SHOULDER"], COCO["RIGHT_SHOULDER"], COCO["LEFT_HAND"], COCO["RIGHT_FOOT"]) == (5, 6, 9, 16)
    assert IMPERIAL["RIGHT_SHOULDER"] == 17 and IMPERIAL["LEFT_ELBOW"] == 8 and IMPERIAL["RIGHT_KNEE"] == 0
    assert len(set(COCO.values())) == len(set(IMPERIAL.values())) == 12


@pytest.mark.parametrize("made", [lambda **o: aist_joints_m(coco(**o), "x"), lambda **o: imperial_joints_m(imperial(**o), "x")])
def test_joints_face_the_camera_in_metres_whatever_the_axes(made):
    plain = made()
    assert plain.shape == (FRAMES, 15, 3) and plain.dtype == np.float32
    assert plain[0, Joint.LEFT_HAND, 0] > plain[0, Joint.RIGHT_HAND, 0] + 0.5
    assert plain[0, Joint.HEAD, 1] < plain[0, Joint.TORSO, 1] < plain[0, Joint.LEFT_KNEE, 1]
    np.testing.assert_allclose(plain[0, Joint.TORSO, [0, 2]], [0, 2.5], atol=0.05)
    # Knees and hands are a little nearer to the camera than the hips: the dancer's front.
    assert plain[0, Joint.LEFT_KNEE, 2] < plain[0, Joint.LEFT_HIP, 2] - 0.03
    rise = np.diff(plain[:, Joint.RIGHT_HAND, 1])
    assert (rise < 0).all() and np.abs(np.diff(plain[:, Joint.LEFT_HAND], axis=0)).max() < 1e-6
    corners = plain[:, [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=1)
    np.testing.assert_allclose(plain[:, Joint.TORSO], corners, atol=1e-6)
    for options in (
        {"heading_rad": 2.0},
        {"unit_m": 0.01},
        {"unit_m": 0.001, "z_up": True},
        {"heading_rad": -1.0, "z_up": True},
    ):
        np.testing.assert_allclose(made(**options), plain, atol=1e-4)


def test_nobodys_points_are_refused():
    points = coco()
    with pytest.raises(InputError, match="in no usual unit"):
        aist_joints_m(points * 7, "x")
    with pytest.raises(InputError, match="neither y nor z points up"):
        aist_joints_m(points[..., [1, 0, 2]], "x")
    with pytest.raises(InputError, match="no frame has both shoulders"):
        aist_joints_m(np.full_like(points, np.nan), "x")


def test_keypoints_are_read_without_running_anything(tmp_path):
    points = coco(unit_m=0.01)
    (tmp_path / "a.json").write_text(json.dumps({"keypoints3d": points.tolist()}))
    np.savez(tmp_path / "a.npz", keypoints3d=points * 2, keypoints3d_optim=points)
    np.testing.assert_allclose(read_aist(tmp_path / "a.json"), points)
    np.testing.assert_allclose(read_aist(tmp_path / "a.npz"), points)

    (tmp_path / "ran").unlink(missing_ok=True)

    class Hostile:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "ran",))

    (tmp_path / "a.pkl").write_bytes(pickle.dumps(Hostile()))
    with pytest.raises(InputError, match="a pickle can run code"):
        read_aist(tmp_path / "a.pkl")
    np.savez(tmp_path / "b.npz", keypoints3d=np.array([Hostile()], object))
    (tmp_path / "c.npz").write_bytes(pickle.dumps(Hostile()))
    for name in ("b.npz", "c.npz", "missing.json"):
        with pytest.raises(InputError, match="no keypoints3d to be read"):
            read_aist(tmp_path / name)
    assert not (tmp_path / "ran").exists()
    (tmp_path / "d.json").write_text(json.dumps({"keypoints3d": [[1, 2]]}))
    with pytest.raises(InputError, match=r"expected \(frames, 17, 3\)"):
        read_aist(tmp_path / "d.json")


def test_torn_files_are_named(tmp_path):
    np.savez(tmp_path / "whole.npz", keypoints3d=coco())
    np.savez_compressed(tmp_path / "packed.npz", keypoints3d=np.random.default_rng(0).normal(size=(FRAMES, 17, 3)))
    np.save(tmp_path / "whole.npy", np.zeros((2, 3, FRAMES, 21)))
    whole, packed = ((tmp_path / name).read_bytes() for name in ("whole.npz", "packed.npz"))
    middle = len(packed) // 2
    for torn in (whole[: len(whole) // 2], b"", packed[:middle] + bytes(100) + packed[middle + 100 :]):
        (tmp_path / "torn.npz").write_bytes(torn)
        with pytest.raises(InputError, match=r"torn\.npz: no keypoints3d to be read"):
            read_aist(tmp_path / "torn.npz")
    for torn in ((tmp_path / "whole.npy").read_bytes()[:1000], b"", whole[: len(whole) // 2]):
        (tmp_path / "torn.npy").write_bytes(torn)
        with pytest.raises(InputError, match=r"torn\.npy: not a plain numpy array"):
            read_imperial(tmp_path / "torn.npy")


def write_bvh(path: Path, frames: int, left_arm_deg: float) -> None:
    """Somebody in a T-pose whose left arm sinks by so much; zero offsets and rotations but for that."""
    lines, order = ["HIERARCHY"], []

    def block(point: int, indent: str) -> None:
        name, children = POINT_NAMES[point], np.flatnonzero(point == PARENTS)
        offset = " ".join(f"{100 * value:.3f}" for value in REST_OFFSETS_M[point])
        if point >= NUM_JOINTS:
            lines.extend([f"{indent}End Site", f"{indent}{{", f"{indent}  OFFSET {offset}", f"{indent}}}"])
            return
        order.append(point)
        channels = "6 Xposition Yposition Zposition" if point == 0 else "3"
        lines.extend([f"{indent}{'ROOT' if point == 0 else 'JOINT'} {name}", f"{indent}{{", f"{indent}  OFFSET {offset}"])
        lines.append(f"{indent}  CHANNELS {channels} Zrotation Yrotation Xrotation")
        for child in children:
            block(int(child), indent + "  ")
        lines.append(f"{indent}}}")

    block(0, "")
    lines += ["MOTION", f"Frames: {frames}", f"Frame Time: {1 / 30:.6f}"]
    for frame in range(frames):
        values = ["0 100 0"]
        for point in order:
            sunk = -left_arm_deg * frame / (frames - 1) if POINT_NAMES[point] == "LeftArm" else 0
            values.append(f"{sunk:.4f} 0 0")
        lines.append(" ".join(values))
    path.write_text("\n".join(lines) + "\n")


def test_bvh_files_are_danced_by_a_mean_adult(tmp_path, monkeypatch):
    for name, degrees in (("teacher", 80.0), ("ann", 80.0), ("bob", 20.0)):
        write_bvh(tmp_path / f"{name}.bvh", 20, degrees)
    files = ("--teacher", tmp_path / "teacher.bvh", "--learners", tmp_path / "ann.bvh", tmp_path / "bob.bvh")
    convert(monkeypatch, "bvh", tmp_path / "out", "--dance", "t", *files)
    dance = KpopSet(tmp_path / "out").dance("t")
    teacher, (ann, bob) = dance.teacher(), (learner.joints() for learner in dance.learners)
    assert teacher.times_s[-1] == pytest.approx(18 / 30, abs=1e-3)  # the T-pose before the recording is left out
    np.testing.assert_allclose(ann.joints_m, teacher.joints_m)
    assert teacher.joints_m[0, Joint.LEFT_HAND, 0] > 0.5  # the T-pose, left hand to the right of the picture
    sunk_m = [one.joints_m[-1, Joint.LEFT_HAND, 1] - one.joints_m[0, Joint.LEFT_HAND, 1] for one in (ann, bob)]
    assert sunk_m[0] > 2 * sunk_m[1] > 0.1
    np.testing.assert_allclose(bob.joints_m[:, Joint.RIGHT_HAND], ann.joints_m[:, Joint.RIGHT_HAND], atol=1e-3)


def convert(monkeypatch, *arguments: object) -> None:
    monkeypatch.setattr(sys, "argv", ["kpop_convert", *map(str, arguments)])
    kpop_convert.main()


def test_keypoints_become_a_dance(tmp_path, monkeypatch, capsys):
    for name in ("teacher", "best", "worst"):
        np.savez(tmp_path / f"{name}.npz", keypoints3d=coco(unit_m=0.01))
    files = ("--teacher", tmp_path / "teacher.npz", "--learners", tmp_path / "best.npz", tmp_path / "worst.npz")
    convert(monkeypatch, "aist", tmp_path / "out", "--dance", "gBR", *files)
    assert "best first: best, worst" in capsys.readouterr().out
    dance = KpopSet(tmp_path / "out").dance("gBR")
    assert [learner.name for learner in dance.learners] == ["best", "worst"]
    assert dance.teacher().times_s[-1] == pytest.approx((FRAMES - 1) / 60)
    np.testing.assert_allclose(dance.learners[1].joints().joints_m, dance.teacher().joints_m, atol=1e-6)
    with pytest.raises(SystemExit):
        convert(monkeypatch, "aist", tmp_path / "out", "--dance", "x", *files[:-1])
    assert "at least two files" in capsys.readouterr().err


def test_imperial_dance_becomes_a_dance_a_choreography(tmp_path, monkeypatch, capsys):
    source = tmp_path / "imperial"
    source.mkdir()
    takes = np.stack([imperial(unit_m=0.001), imperial(unit_m=0.001, heading_rad=1.0)]).transpose(0, 3, 1, 2)
    for level in "eib":
        np.save(source / f"dance_level_{level}_k_ch0.npy", takes)
    np.save(source / "dance_level_e_b_ch1.npy", takes)
    assert read_imperial(source / "dance_level_e_k_ch0.npy").shape == (2, FRAMES, 21, 3)
    convert(monkeypatch, "imperial", source, tmp_path / "out")
    dances = KpopSet(tmp_path / "out")
    assert dances.names == ["k_ch0"]  # the other has no beginners
    dance = dances.dance("k_ch0")
    assert [learner.name for learner in dance.learners] == ["expert", "intermediate", "beginner"]
    np.testing.assert_allclose(dance.learners[0].joints().joints_m, dance.teacher().joints_m, atol=1e-4)
    np.save(source / "dance_level_e_k_ch0.npy", takes[0])
    with pytest.raises(SystemExit):
        convert(monkeypatch, "imperial", source, tmp_path / "other")
    assert "expected (takes, 3, frames, 21)" in capsys.readouterr().err
