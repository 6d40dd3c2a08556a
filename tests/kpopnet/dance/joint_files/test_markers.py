"""Recordings of named or numbered points are the same performance as in JSON; what names no joints is refused."""

import json

import numpy as np
import pytest
from marker_files import write_c3d, write_trc
from recorded_points import FRAMES, person

from kpopnet.dance.joint_files.reader import read_performance, read_strangers_performance
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

CENTRES = {"HEAD": "ann:Head", "NECK": "ann:Neck"} | {
    f"{side}_{ours}": f"ann:{side[0]}{theirs}"
    for side in ("LEFT", "RIGHT")
    for ours, theirs in (
        ("SHOULDER", "SJC"), ("ELBOW", "EJC"), ("HAND", "WJC"), ("HIP", "HJC"), ("KNEE", "KJC"), ("FOOT", "AJC"),
    )
}  # fmt: skip
NAMES, POINTS_MM = [CENTRES[name] for name in person()], np.stack(list(person(unit_m=0.001, z_up=True).values()), axis=1)


@pytest.fixture
def expected(tmp_path):
    frames = [{"joints": {name: points[k].tolist() for name, points in person().items()}} for k in range(FRAMES)]
    (tmp_path / "a.json").write_text(json.dumps({"fps": 100, "frames": frames}))
    return read_performance(tmp_path / "a.json")


@pytest.mark.parametrize("name", ["a.c3d", "integers.c3d", "a.trc"])
def test_joint_centres_become_joints(tmp_path, expected, name):
    points_mm = POINTS_MM.copy()
    points_mm[5, NAMES.index("ann:LEJC")] = np.nan
    if name == "a.trc":
        write_trc(tmp_path / name, points_mm, NAMES)
    else:
        write_c3d(tmp_path / name, points_mm, NAMES, integers=name == "integers.c3d")
    read = read_performance(tmp_path / name)
    seen = np.isfinite(read.joints_m)
    assert np.argwhere(~seen[..., 0]).tolist() == [[5, Joint.LEFT_ELBOW]]
    np.testing.assert_allclose(read.joints_m[seen], expected.joints_m[seen], atol=2e-4)
    np.testing.assert_allclose(read.times_s, expected.times_s, atol=1e-4)


@pytest.mark.parametrize("first", [1, 60000, 65535 - FRAMES, 65536 - FRAMES, 65500, 65535, 65536, 70000, 200000])
def test_a_cut_of_a_long_capture_is_read_whatever_the_numbers_of_its_frames(tmp_path, expected, first):
    read = read_performance(write_c3d(tmp_path / "a.c3d", POINTS_MM, NAMES, first=first))
    np.testing.assert_allclose(read.joints_m, expected.joints_m, atol=2e-4)


def test_a_joint_map_says_which_points_are_which_joints(tmp_path, expected):
    left = list(person()).index("LEFT_HAND")
    apart_mm = np.array([0.0, 0.0, 40.0])
    points_mm = np.insert(POINTS_MM, left, POINTS_MM[:, left] + apart_mm, axis=1)
    points_mm[:, left + 1] -= apart_mm
    labels = [f"M{number:02d}" for number in range(points_mm.shape[1])]
    places = {name: number + (number > left) for number, name in enumerate(person())}
    by_label = {name.lower(): labels[place] for name, place in places.items()} | {"left_hand": labels[left : left + 2]}
    by_number = {name.lower(): place for name, place in places.items()} | {"left_hand": [left, left + 1]}
    (tmp_path / "labels.json").write_text(json.dumps(by_label))
    (tmp_path / "numbers.json").write_text(json.dumps(by_number))
    header = [f"{label}_{axis}" for label in labels for axis in "xyz"]
    rows = [",".join(map(str, frame.ravel())) for frame in points_mm]
    (tmp_path / "a.csv").write_text("\n".join([",".join(header), *rows]))
    np.save(tmp_path / "a.npy", points_mm)
    np.savez(tmp_path / "a.npz", points=points_mm, names=labels, fps=100.0)
    write_c3d(tmp_path / "a.c3d", points_mm, labels)
    write_trc(tmp_path / "a.trc", points_mm, labels)
    for name in ("a.csv", "a.npy", "a.npz", "a.c3d", "a.trc"):
        joint_map = tmp_path / ("numbers.json" if name == "a.npy" else "labels.json")
        read = (read_strangers_performance if name == "a.npy" else read_performance)(tmp_path / name, 100.0, joint_map)
        np.testing.assert_allclose(read.joints_m, expected.joints_m, atol=1e-3, err_msg=name)
        if name != "a.npy":
            with pytest.raises(InputError, match=rf"{name}: no point for .*; it names M00.* or --joint-map"):
                read_performance(tmp_path / name, 100.0)
    # A file of known names is read by these.
    assert read_performance(tmp_path / "a.json", None, tmp_path / "labels.json").joints_m.shape == expected.joints_m.shape
    with pytest.raises(InputError, match=r"a\.npy: expected --joint-map FILE"):
        read_performance(tmp_path / "a.npy")


def test_a_joint_map_may_say_what_names_leave_open_and_other_maps_are_refused(tmp_path, expected):
    own = ["PALM" if name == "LEFT_HAND" else name for name in person()]
    write_trc(tmp_path / "a.trc", POINTS_MM, own)
    (tmp_path / "map.json").write_text(json.dumps({"left_hand": "PALM"}))
    read = read_performance(tmp_path / "a.trc", 100.0, tmp_path / "map.json")
    np.testing.assert_allclose(read.joints_m, expected.joints_m, atol=1e-3)
    for content, message in (
        ({"left_hand": "PALM", "left_foot": "Q"}, r"a\.trc: expected the points Q of .*\.json; it names HEAD"),
        ({"left_paw": "PALM"}, r"map\.json: expected an object of head, neck"),
        ({"left_hand": []}, r"map\.json: expected a point, or more, for left_hand"),
    ):
        (tmp_path / "map.json").write_text(json.dumps(content))
        with pytest.raises(InputError, match=message):
            read_performance(tmp_path / "a.trc", None, tmp_path / "map.json")


def test_damaged_recordings_are_refused_in_one_line(tmp_path):
    whole = write_c3d(tmp_path / "a.c3d", POINTS_MM, NAMES).read_bytes()
    (tmp_path / "a.c3d").write_bytes(whole[:-4096])
    with pytest.raises(InputError, match=r"a\.c3d: expected \d+ frames, found \d+; the file is truncated"):
        read_performance(tmp_path / "a.c3d")
    with pytest.raises(InputError, match="a label for each of 14 points, found 0"):
        read_performance(write_c3d(tmp_path / "a.c3d", POINTS_MM, NAMES, labels=[]))
    text = write_trc(tmp_path / "a.trc", POINTS_MM, NAMES).read_text().splitlines()
    for lines, message in (
        (text[:6], "a line of numbers"),
        ([*text[:6], "1\t0.0\tx"], "line 7: expected numbers"),
        ([*text[:6], text[6] + "\t7"], "line 7: expected frame, time and 14 points"),
    ):
        (tmp_path / "a.trc").write_text("\n".join(lines))
        with pytest.raises(InputError, match=message):
            read_performance(tmp_path / "a.trc")


def test_two_subjects_in_one_file_are_refused_instead_of_mixed(tmp_path):
    names = [*NAMES, *(name.replace("ann:", "bea:") for name in NAMES)]
    names.remove("ann:LWJC")  # which the other's could stand for
    write_trc(tmp_path / "two.trc", np.concatenate([POINTS_MM, POINTS_MM], axis=1)[:, : len(names)], names)
    with pytest.raises(InputError, match=r"two\.trc: points of ann, bea; expected one person"):
        read_performance(tmp_path / "two.trc")
