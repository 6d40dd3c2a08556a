"""The developers' comparison of generated with real depth: its statistics on drawn silhouettes, and the program."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from factories import write_shard as write_frozen
from programs import ROOT

from kpopnet.camera import Camera
from kpopnet.skeleton import Joint

sys.path.insert(0, str(ROOT / "tools"))
import realism
from realism import OF_UPRIGHT, Frame, hole_share, temporal_noise

CAMERA = Camera.centred(285.0, 320, 240)
Z_M = 2.85  # one pixel is one centimetre


def standing() -> np.ndarray:
    """(15, 3) metres: a person of 1.7 m who faces the camera, hands down, feet 20 cm apart."""
    joints = np.zeros((15, 3))
    for name, x, height in (
        ("HEAD", 0, 1.6), ("NECK", 0, 1.4), ("TORSO", 0, 1.15), ("SHOULDER", 0.2, 1.4), ("ELBOW", 0.25, 1.1),
        ("HAND", 0.28, 0.8), ("HIP", 0.1, 0.9), ("KNEE", 0.1, 0.5), ("FOOT", 0.1, 0.05),
    ):  # fmt: skip
        for full, sign in ((name, 1), (f"LEFT_{name}", 1), (f"RIGHT_{name}", -1)):
            if full in Joint.__members__:
                joints[Joint[full]] = sign * x, -height, Z_M
    return joints


def frame(depth_m: np.ndarray) -> Frame:
    return Frame("drawn", depth_m.astype(np.float32), CAMERA, standing())


def blocks(*boxes: tuple[int, int, int, int]) -> Frame:
    """A frame in which boxes of rows y0 to y1 and columns x0 to x1 lie Z_M away."""
    depth_m = np.zeros((240, 320))
    for y0, y1, x0, x1 in boxes:
        depth_m[y0:y1, x0:x1] = Z_M
    return frame(depth_m)


# 160 pixels high: a trunk 40 wide, two legs of 16, a block of feet of 44.
PERSON = blocks((40, 120, 140, 180), (120, 192, 142, 158), (120, 192, 162, 178), (192, 200, 138, 182))


def test_a_person_of_blocks_has_the_drawn_measures_and_specks_beside_change_none() -> None:
    expected = {
        "area / height^2": (80 * 40 + 2 * 72 * 16 + 8 * 44) / 160**2,
        "width of both shins / height": 32 / 160,
        "width of both thighs / height": 32 / 160,
        "width of both feet, cm": 44,
    }
    speckled = PERSON.depth_m.copy()
    speckled[230, 20] = speckled[5, 300] = Z_M
    for one in (PERSON, frame(speckled)):
        assert {name: OF_UPRIGHT[name](one) for name in expected} == pytest.approx(expected, rel=1e-6)
    assert math.isnan(OF_UPRIGHT["width of both shins / height"](blocks((40, 120, 140, 180), (120, 200, 144, 176))))


def test_holes_count_and_the_loop_of_an_arm_does_not() -> None:
    block = blocks((40, 200, 100, 220)).depth_m.copy()
    block[60:64, 120:125] = 0  # 20 cm^2
    block[120:140, 110:130] = 0  # 400 cm^2
    assert hole_share(frame(block)) == pytest.approx(20 / (160 * 120 - 400))


def test_roughness_is_the_noise_of_the_disparity_on_a_slope_and_ignores_outlines() -> None:
    slope = np.broadcast_to(120 + 0.2 * np.arange(320) + np.where(np.arange(320) > 160, 30, 0), (240, 320))
    assert realism.roughness_steps(frame(345 / slope)) < 1e-3
    noisy = slope + 0.3 * np.random.default_rng(0).normal(size=slope.shape)
    assert realism.roughness_steps(frame(345 / noisy)) == pytest.approx(0.3, rel=0.03)


def sequence(noise_steps: np.ndarray) -> np.ndarray:
    return (345 / (125 + noise_steps)).astype(np.float32)  # at 2.76 m


def test_noise_in_time_is_measured_where_nothing_moves() -> None:
    noise = 0.15 * np.random.default_rng(0).normal(size=(42, 60, 81))
    assert temporal_noise(sequence(noise)) == pytest.approx((2 * 0.15**2, 0), rel=0.03, abs=0.03)
    assert temporal_noise(sequence((noise[..., 1:] + noise[..., :-1]) / 2)) == pytest.approx((0.15**2, 0.5), rel=0.05)
    for number, image in enumerate(moving := noise.copy()):
        image[10:40, number : number + 20] += 20  # a person who walks through the image
    assert temporal_noise(sequence(moving))[0] == pytest.approx(2 * 0.15**2, rel=0.1)
    for none in (noise + 3.0 * np.arange(81), noise - 60, noise[:9]):  # steep, far away, too short
        assert temporal_noise(sequence(none)) is None


def test_the_program_compares_with_what_it_is_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    write_frozen(tmp_path / "set" / "train", 0, 4)
    np.savez(tmp_path / "itop.npz", side_m=np.random.default_rng(0).normal(size=(20, 15, 3)).astype(np.float32))
    arguments = ["--real", tmp_path / "itop.npz", "--synthetic", tmp_path / "set", "--out", tmp_path / "out", "--frames", 3]
    monkeypatch.setattr(sys, "argv", ["realism", *map(str, arguments)])
    realism.main()
    lines = {line["statistic"]: line for line in json.loads((tmp_path / "out" / "realism.json").read_text())["lines"]}
    distance = lines["distance of the person, m"]
    assert distance["real"] == [] and distance["synthetic"][3] == 3 and (tmp_path / "out" / "realism.png").exists()
    assert "generated medians inside" in capsys.readouterr().out
    monkeypatch.setattr(sys, "argv", ["realism", "--synthetic", str(tmp_path / "nowhere")])
    with pytest.raises(SystemExit):
        realism.main()
    assert capsys.readouterr().err.count("\n") == 1
