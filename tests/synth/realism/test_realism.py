"""The table, the sheet and the program."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from factories import write_shard as write_frozen
from real_data import ITOP_SKELETONS, UTD_MHAD

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from synth.realism.__main__ import main
from synth.realism.shapes import Frame
from synth.realism.sheet import SIDE_M, SIDE_PX, tile
from synth.realism.sources import Source, read_real
from synth.realism.statistics import STATISTICS, measure
from synth.realism.table import as_text, compare, summary, verdict

AREA = "upright: area / height^2"
CUT = "silhouettes cut by the border"


def values(**known: np.ndarray) -> dict[str, np.ndarray]:
    return {one.name: known.get(one.name, np.empty(0)) for one in STATISTICS}


def test_a_summary_is_median_and_quartiles_or_a_share_with_its_interval() -> None:
    one = summary(np.arange(101.0), is_share=False)
    assert (one.middle, one.low, one.high, one.count) == (50, 25, 75, 101)
    share = summary(np.array([1.0] * 10 + [0.0] * 90), is_share=True)
    assert share.middle == pytest.approx(0.1)
    assert (share.low, share.high) == pytest.approx((0.0552, 0.1744), abs=1e-4)  # Wilson's interval of 10 in 100
    assert summary(np.empty(0), is_share=False) is None


@pytest.mark.parametrize(("ours", "inside", "gap"), [(0.24, True, 0.4), (0.16, True, -0.4), (0.3, False, 1.0)])
def test_a_line_says_whether_the_generated_median_is_inside_and_how_far_away(ours: float, inside: bool, gap: float) -> None:
    real = values(**{AREA: np.linspace(0.1, 0.3, 101)})
    (line,) = compare({"set": real}, values(**{AREA: np.full(5, ours)}))
    assert (line.statistic, line.real_set, line.inside) == (AREA, "set", inside)
    assert line.gap == pytest.approx(gap)
    assert verdict([line]) == {"compared": 1, "inside": int(inside), "median_gap": pytest.approx(abs(gap))}


def test_each_real_set_has_a_line_and_what_lacks_is_left_out() -> None:
    real = values(**{AREA: np.arange(3.0)})
    lines = compare({"a": real, "b": real, "c": values()}, values(**{CUT: np.zeros(4)}))
    assert [(line.statistic, line.real_set, line.real is None, line.synthetic is None) for line in lines] == [
        (CUT, "", True, False),
        (AREA, "a", False, True),
        (AREA, "b", False, True),
    ]
    text = as_text(lines, ["a note"])
    assert "0 of 0 medians" in text and text.endswith("a note")


def test_a_source_without_frames_has_no_values() -> None:
    assert not any(len(one) for one in measure(Source("nothing")).values())


@pytest.mark.parametrize("z_m", [1.5, 3.0])
def test_tiles_show_people_of_one_size_at_any_distance(z_m: float) -> None:
    camera = Camera.centred(285.0, 320, 240)
    depth_m = np.zeros((240, 320), np.float32)
    half_px = round(0.4 * camera.fx / z_m)
    depth_m[120 - half_px : 120 + half_px, 100 - half_px : 100 + half_px] = z_m
    image = tile(Frame("square", depth_m, camera, np.full((15, 3), np.nan)))[:SIDE_PX]
    rows = np.flatnonzero((image > 60).all(axis=2).any(axis=1))
    assert len(rows) == pytest.approx(0.8 / SIDE_M * SIDE_PX, abs=3)
    assert (rows[0] + rows[-1]) / 2 == pytest.approx((SIDE_PX - 1) / 2, abs=2)


def test_the_program_compares_with_what_it_is_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    write_frozen(tmp_path / "set" / "train", 0, 4)
    joints = np.random.default_rng(0).normal(size=(20, 15, 3)).astype(np.float32)
    np.savez(tmp_path / "itop.npz", side_m=joints)
    arguments = ["--real", tmp_path / "itop.npz", "--synthetic", tmp_path / "set", "--out", tmp_path / "out", "--frames", 3]
    monkeypatch.setattr(sys, "argv", ["realism", *map(str, arguments)])
    main()
    printed = capsys.readouterr().out
    assert "no real depth" in printed and "no film" in printed and "overlap with furniture is left out" in printed
    document = json.loads((tmp_path / "out" / "realism.json").read_text())
    assert document["settings"]["split"] == "test" and len(document["notes"]) == 3
    distance = next(line for line in document["lines"] if line["statistic"] == "distance of the person")
    assert distance["real"] is None and distance["synthetic"]["count"] == 3
    assert cv2.imread(str(tmp_path / "out" / "realism.png")).ndim == 3
    first = (tmp_path / "out" / "realism.txt").read_text()
    main()
    assert (tmp_path / "out" / "realism.txt").read_text() == first


@pytest.mark.parametrize(
    "arguments", [["--synthetic", "nowhere"], ["--synthetic", ".", "--frames", "0"], ["--synthetic", ".", "--seed", "-1"]]
)
def test_faulty_arguments_end_the_program_with_one_line(arguments, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["realism", *arguments])
    with pytest.raises(SystemExit):
        main()
    assert capsys.readouterr().err.count("\n") == 1


def test_a_folder_that_is_no_real_set_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a folder of UTD-MHAD"):
        read_real(tmp_path, 3, 0)


@pytest.mark.skipif(not (UTD_MHAD / "Depth").is_dir(), reason="the real depth data is not available")
def test_real_people_have_the_known_proportions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("synth.realism.sources.MOST_SEQUENCES", 4)
    found = measure(read_real(UTD_MHAD, 8, 0))
    # synth.sensor.model measured white noise of 0.35 steps on these people
    assert np.median(found["roughness of surfaces"]) == pytest.approx(0.35, abs=0.03)
    assert 0.15 < np.median(found[AREA]) < 0.25
    assert np.median(found["distance of the person"]) == pytest.approx(2.8, abs=0.3)
    assert (found["frame difference of still pixels: variance"] < 0.3).all()


@pytest.mark.skipif(not ITOP_SKELETONS.is_file(), reason="the real poses are not available")
def test_half_of_the_standing_people_of_itop_have_their_feet_together() -> None:
    assert np.mean(measure(read_real(ITOP_SKELETONS, 1, 0))["standing: feet closer than 20 cm"]) == pytest.approx(0.5, abs=0.05)
