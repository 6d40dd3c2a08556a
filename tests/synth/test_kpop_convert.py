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
