"""ITOP's files, written here in the published layout, what the reader makes of good and bad ones, and three real frames."""

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from itop_files import write_itop
from real_data import ITOP_FRAMES

from kpopnet.benchmarks.itop import CAMERA, LONGEST, ItopBenchmark, ItopConfig, sequences_of
from kpopnet.benchmarks.registry import BENCHMARKS
from kpopnet.benchmarks.sequences import Origin
from kpopnet.errors import InputError
from kpopnet.extraction import extract_person
from kpopnet.skeleton import Joint

IDS = ["00_00007", "00_00008", "00_00009", "01_00000", "01_00001"]


def scene(frame: int) -> np.ndarray:
    """(240, 320) metres that float16 holds exactly: a wall with a hole that moves."""
    depth = np.full((240, 320), 3.0, np.float32)
    depth[50:60, 10 * frame : 10 * frame + 30] = 0
    depth[100 + frame, 200] = 2.5
    return depth


def pose(frame: int) -> np.ndarray:
    """(15, 3) in the set's axes, y up, exact in float16: facing the camera, the right at x < 0."""
    joints = np.stack([np.linspace(-0.5, 0.5, 15), np.linspace(0.75, -0.75, 15), np.full(15, 2.5)], axis=1)
    joints[[Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP], 0] = -0.25
    joints[[Joint.LEFT_SHOULDER, Joint.LEFT_HIP], 0] = 0.25
    return (np.round(joints * 64) / 64 + [frame / 64, 0, 0]).astype(np.float32)


def write(folder, ids=IDS, **changes) -> None:
    frames = range(len(ids))
    given = {"depth_m": np.stack([scene(f) for f in frames]), "joints_m": np.stack([pose(f) for f in frames])}
    write_itop(folder, ids, **given | changes)


def benchmark(folder, **settings) -> ItopBenchmark:
    return ItopBenchmark(ItopConfig(path=str(folder), **settings))


def test_sequences_are_people_with_depth_camera_and_joints_y_down(tmp_path):
    write(tmp_path)
    itop = benchmark(tmp_path)
    assert itop.sequence_names() == ["00_00007", "01_00000"] and itop.origin is Origin.REAL
    first, second = (itop.read(name) for name in itop.sequence_names())
    assert (first.identity, second.identity, first.alone) == ("00", "01", False)
    np.testing.assert_array_equal(first.depth_m, np.stack([scene(frame) for frame in range(3)]))
    np.testing.assert_array_equal(second.depth_m, np.stack([scene(frame) for frame in (3, 4)]))
    np.testing.assert_array_equal(second.joints_camera_m[1], pose(4) * [1, -1, 1])
    assert first.visible.all() and "5 of 5 frames" in itop.about
    # By the set's own formula.
    u, v, z = 37, 201, 3.0
    np.testing.assert_allclose(CAMERA.back_project(np.array([u, v, z])), [(u - 160) * z * 0.0035, (v - 120) * z * 0.0035, z])
    np.testing.assert_allclose(first.yaw_rad, np.arctan2(np.arange(3) / 64, 2.5), atol=1e-2)


def test_what_nobody_checked_is_no_truth_and_what_is_hidden_is_not_visible(tmp_path):
    visible = np.ones((5, 15))
    visible[0, Joint.LEFT_HAND] = 0
    joints = np.stack([pose(frame) for frame in range(5)])
    joints[2, Joint.HEAD] = np.nan
    write(tmp_path, valid=np.array([1, 0, 1, 1, 1]), visible=visible, joints_m=joints)
    itop = benchmark(tmp_path)
    sequence = itop.read("00_00007")
    labelled = np.isfinite(sequence.joints_camera_m).all(axis=-1)
    assert not labelled[1].any() and labelled[0].all() and not labelled[2, Joint.HEAD] and labelled.sum() == 29
    assert not sequence.visible[0, Joint.LEFT_HAND] and sequence.visible.sum() == 28
    assert sequence.depth_m[1].any() and "4 of 5 frames" in itop.about


@settings(max_examples=30, deadline=None)
@given(lengths=st.lists(st.integers(1, 3 * LONGEST), min_size=1, max_size=5))
def test_long_recordings_are_cut_evenly_and_nothing_is_lost(lengths):
    ids = [f"{person:02d}_{frame:05d}" for person, length in enumerate(lengths) for frame in range(length)]
    rows = sequences_of(ids)
    covered = [index for part in rows.values() for index in range(part.start, part.stop)]
    assert covered == list(range(len(ids)))
    for name, part in rows.items():
        own = {one[:2] for one in ids[part]}
        assert name == ids[part.start] and own == {name[:2]}
        length = lengths[int(name[:2])]
        assert part.stop - part.start <= LONGEST and abs((part.stop - part.start) - length / -(-length // LONGEST)) <= 1


def test_the_view_and_split_are_chosen_by_name(tmp_path):
    write(tmp_path, part="top_train")
    top = benchmark(tmp_path, view="top", split="train")
    assert "from above" in top.about
    with pytest.raises(InputError, match=r"ITOP_side_test_labels\.h5: no such file"):
        benchmark(tmp_path)
    for wrong in ({"view": "front"}, {"split": "validation"}):
        with pytest.raises(InputError, match="choose one of"):
            ItopConfig(**wrong)
    with pytest.raises(InputError, match=r"needs benchmark\.path"):
        ItopBenchmark(ItopConfig())
    assert BENCHMARKS["itop"] == (ItopConfig, ItopBenchmark)


def test_from_above_nobody_faces_anywhere(tmp_path):
    write(tmp_path)
    write(tmp_path, part="top_test")
    side, top = benchmark(tmp_path), benchmark(tmp_path, view="top")
    assert np.isfinite(side.read("00_00007").yaw_rad).all() and top.read("00_00007").yaw_rad is None
    assert "as an upright camera sees them" in top.about and "upright" not in side.about


def test_still_packed_files_are_told_how_to_be_unpacked(tmp_path):
    write(tmp_path)
    labels = tmp_path / "ITOP_side_test_labels.h5"
    labels.rename(f"{labels}.gz")
    with pytest.raises(InputError, match=r"no such file; unpack ITOP_side_test_labels\.h5\.gz: gunzip"):
        benchmark(tmp_path)


@pytest.mark.parametrize("name", ["depth_map", "labels"])
def test_odd_files_are_named(tmp_path, name):
    write(tmp_path)
    path = tmp_path / f"ITOP_side_test_{name}.h5"
    whole = path.read_bytes()
    for content in (b"", b"not HDF5", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(InputError, match=rf"ITOP_side_test_{name}\.h5: not a whole HDF5 file.*fetch it again"):
            benchmark(tmp_path)


@pytest.mark.parametrize(
    ("file", "name", "value", "said"),
    [
        ("labels", "is_valid", None, r"expected a data set is_valid, found id, image_coordinates"),
        ("labels", "is_valid", np.ones(4), r"is_valid of shape \(5,\), found \(4,\)"),
        ("labels", "real_world_coordinates", np.ones((5, 15, 2)), r"\(5, 15, 3\), found \(5, 15, 2\)"),
        ("labels", "visible_joints", np.full((5, 15), b"x"), r"expected numbers in visible_joints"),
        ("labels", "id", np.array([], "S8"), r"at least one frame"),
        ("labels", "id", np.array(["00_1", "00_2", "frame", "01_0", "01_1"], "S8"), r"row 2 is called 'frame'"),
        ("depth_map", "data", np.ones((5, 120, 160)), r"data of shape \(5, 240, 320\), found \(5, 120, 160\)"),
        ("depth_map", "id", np.array(IDS[:4], "S8"), r"do not belong together: 4 and 5 frames"),
        ("depth_map", "id", np.array([*IDS[:4], "01_00009"], "S8"), r"do not belong together: 01_00009 and 01_00001 in row 4"),
    ],
)  # fmt: skip
def test_odd_contents_are_named(tmp_path, file, name, value, said):
    write(tmp_path)
    with h5py.File(tmp_path / f"ITOP_side_test_{file}.h5", "a") as opened:
        del opened[name]
        if value is not None:
            opened[name] = value
    with pytest.raises(InputError, match=said):
        benchmark(tmp_path)


def test_torn_depth_is_named_with_its_rows(tmp_path):
    rng = np.random.default_rng(0)
    write(tmp_path, depth_m=rng.uniform(1, 4, (5, 240, 320)))
    itop = benchmark(tmp_path)
    path = tmp_path / "ITOP_side_test_depth_map.h5"
    with h5py.File(path) as file:
        chunk = file["data"].id.get_chunk_info(4)
    whole = bytearray(path.read_bytes())
    whole[chunk.byte_offset : chunk.byte_offset + 200] = bytes(200)
    path.write_bytes(whole)
    assert itop.read("00_00007").depth_m.any()
    with pytest.raises(InputError, match=r"depth_map\.h5: rows 3 to 5 cannot be read"):
        itop.read("01_00000")


def test_ids_may_be_texts_and_depth_may_be_odd(tmp_path):
    depth = np.stack([scene(frame) for frame in range(5)])
    depth[0, 0, :4] = np.nan, np.inf, -1, 0
    write(tmp_path, depth_m=depth)
    for name in ("depth_map", "labels"):
        with h5py.File(tmp_path / f"ITOP_side_test_{name}.h5", "a") as file:
            del file["id"]
            file["id"] = IDS  # of variable length
    itop = benchmark(tmp_path)
    assert itop.sequence_names() == ["00_00007", "01_00000"]
    assert not itop.read("00_00007").depth_m[0, 0, :4].any()


def test_a_person_who_comes_back_is_still_the_same(tmp_path):
    ids = ["00_00000", "01_00000", "00_00001"]
    write(tmp_path, ids)
    itop = benchmark(tmp_path)
    assert [(name, itop.read(name).identity) for name in itop.sequence_names()] == [(name, name[:2]) for name in ids]
    with pytest.raises(InputError, match="00_00000 is there twice"):
        sequences_of(["00_00000", "01_00000", "00_00000"])


@pytest.mark.skipif(not ITOP_FRAMES.exists(), reason="needs three real frames of ITOP")
def test_real_frames_lie_under_their_joints_and_their_people_are_found(tmp_path):
    real = np.load(ITOP_FRAMES)
    people = [f"{number:02d}_{row:05d}" for number, row in enumerate(real["raw_row"])]
    write_itop(tmp_path, people, real["depth_mm"] / 1000, real["joints_m"])
    itop = benchmark(tmp_path)
    assert itop.sequence_names() == people
    for name in people:
        sequence = itop.read(name)
        uvz = sequence.camera.project(sequence.joints_camera_m[0])
        # Who faces the camera has the right shoulder on the image's left, and up is towards row 0.
        assert uvz[Joint.HEAD, 1] < uvz[Joint.TORSO, 1] < uvz[[Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 1].min()
        column, row = np.round(uvz[[Joint.TORSO, Joint.NECK], :2]).astype(int).T
        surface_m = sequence.depth_m[0, row, column]
        assert (np.abs(surface_m - uvz[[Joint.TORSO, Joint.NECK], 2]) < 0.25).all()
        person_m = extract_person(sequence.depth_m, sequence.camera)[0]
        joints = sequence.joints_camera_m[0]
        points = sequence.camera.points(person_m)[person_m > 0]
        low, high = joints.min(axis=0) - 0.3, joints.max(axis=0) + 0.3
        assert len(points) > 4000 and ((points > low) & (points < high)).all(axis=1).mean() > 0.99
        # And all of them: the surface before every joint that the picture shows.
        found = [person_m[int(v) - 4 : int(v) + 5, int(u) - 4 : int(u) + 5].any() for u, v, _ in uvz]
        assert all(found), [joint.name for joint in Joint if not found[joint]]
