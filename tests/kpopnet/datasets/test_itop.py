"""The reader of ITOP on valid and invalid files in the published layout, and on three real frames."""

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from real_data import ITOP_FRAMES

from kpopnet.datasets.itop import CAMERA, MAX_SEQUENCE_FRAMES, ItopBenchmark, ItopConfig, split_into_sequences
from kpopnet.datasets.protocol import Origin
from kpopnet.errors import InputError
from kpopnet.pose.extraction import extract_person
from kpopnet.skeleton import Joint

IDS = ["00_00007", "00_00008", "00_00009", "01_00000", "01_00001"]


def scene(frame: int) -> np.ndarray:
    """(240, 320) metres, exact in float16: a wall with a hole that moves."""
    depth = np.full((240, 320), 3.0, np.float32)
    depth[50:60, 10 * frame : 10 * frame + 30] = 0
    depth[100 + frame, 200] = 2.5
    return depth


def pose(frame: int) -> np.ndarray:
    """(15, 3) metres in ITOP's axes, y up, exact in float16: a person who faces the camera, with the right at x < 0."""
    joints = np.stack([np.linspace(-0.5, 0.5, 15), np.linspace(0.75, -0.75, 15), np.full(15, 2.5)], axis=1)
    joints[[Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP], 0] = -0.25
    joints[[Joint.LEFT_SHOULDER, Joint.LEFT_HIP], 0] = 0.25
    return (np.round(joints * 64) / 64 + [frame / 64, 0, 0]).astype(np.float32)


def write(folder, ids=IDS, part="side_test", depth_m=None, joints_m=None, valid=1, visible=1) -> None:
    """Writes the files of one view and split; scenes and poses by default, whose labels were checked and joints are visible."""
    depth_m = np.stack([scene(frame) for frame in range(len(ids))]) if depth_m is None else depth_m
    joints_m = np.stack([pose(frame) for frame in range(len(ids))]) if joints_m is None else joints_m
    names = np.array([name.encode() for name in ids], dtype="S8")
    with h5py.File(folder / f"ITOP_{part}_depth_map.h5", "w") as file:
        file["id"] = names
        file.create_dataset("data", data=depth_m.astype(np.float16), chunks=(1, 240, 320), compression="gzip")
    with h5py.File(folder / f"ITOP_{part}_labels.h5", "w") as file:
        file["id"], file["is_valid"] = names, np.broadcast_to(valid, len(ids)).astype(np.uint8)
        file["visible_joints"] = np.broadcast_to(visible, (len(ids), 15)).astype(np.int16)
        file["real_world_coordinates"] = joints_m.astype(np.float16)


def benchmark(folder, **settings) -> ItopBenchmark:
    return ItopBenchmark(ItopConfig(path=str(folder), **settings))


def test_sequences_are_people_with_depth_camera_and_joints_y_down(tmp_path):
    write(tmp_path)
    itop = benchmark(tmp_path)
    assert itop.sequence_names() == ["00_00007", "01_00000"] and itop.origin is Origin.REAL
    first, second = (itop.read(name) for name in itop.sequence_names())
    assert (first.identity, second.identity, first.is_segmented) == ("00", "01", False)
    np.testing.assert_array_equal(first.depth_m, np.stack([scene(frame) for frame in range(3)]))
    np.testing.assert_array_equal(second.depth_m, np.stack([scene(frame) for frame in (3, 4)]))
    np.testing.assert_array_equal(second.joints_camera_m[1], pose(4) * [1, -1, 1])
    assert first.visible.all() and "5 of 5 frames" in itop.about
    # From the formula published with the set.
    u, v, z = 37, 201, 3.0
    np.testing.assert_allclose(CAMERA.back_project(np.array([u, v, z])), [(u - 160) * z * 0.0035, (v - 120) * z * 0.0035, z])
    np.testing.assert_allclose(first.yaw_rad, np.arctan2(np.arange(3) / 64, 2.5), atol=1e-2)


def test_unchecked_labels_are_unknown_and_hidden_joints_not_visible(tmp_path):
    visible = np.ones((5, 15))
    visible[0, Joint.LEFT_HAND] = 0
    joints = np.stack([pose(frame) for frame in range(5)])
    joints[2, Joint.HEAD], joints[3, Joint.NECK, 0] = np.nan, np.inf
    write(tmp_path, valid=np.array([1, 0, 1, 1, 1]), visible=visible, joints_m=joints)
    itop = benchmark(tmp_path)
    sequence = itop.read("00_00007")
    labelled = np.isfinite(sequence.joints_camera_m).all(axis=-1)
    assert not labelled[1].any() and labelled[0].all() and not labelled[2, Joint.HEAD] and labelled.sum() == 29
    assert not sequence.visible[0, Joint.LEFT_HAND] and sequence.visible.sum() == 28
    assert sequence.depth_m[1].any() and "4 of 5 frames" in itop.about
    assert np.isnan(itop.read("01_00000").joints_camera_m[0, Joint.NECK]).all()


@settings(max_examples=30, deadline=None)
@given(lengths=st.lists(st.integers(1, 3 * MAX_SEQUENCE_FRAMES), min_size=1, max_size=5))
def test_long_recordings_are_split_evenly_and_completely(lengths):
    ids = [f"{person:02d}_{frame:05d}" for person, length in enumerate(lengths) for frame in range(length)]
    rows = split_into_sequences(ids)
    covered = [index for part in rows.values() for index in range(part.start, part.stop)]
    assert covered == list(range(len(ids)))
    for name, part in rows.items():
        own = {one[:2] for one in ids[part]}
        assert name == ids[part.start] and own == {name[:2]}
        length = lengths[int(name[:2])]
        frames = part.stop - part.start
        assert frames <= MAX_SEQUENCE_FRAMES and abs(frames - length / -(-length // MAX_SEQUENCE_FRAMES)) <= 1


def test_view_and_split_are_selected_by_name(tmp_path):
    write(tmp_path, part="top_train")
    top = benchmark(tmp_path, view="top", split="train")
    assert "from above" in top.about and "upright camera" in top.about
    assert top.read("00_00007").yaw_rad is None
    with pytest.raises(InputError, match=r"ITOP_side_test_labels\.h5: no such file"):
        benchmark(tmp_path)
    with pytest.raises(InputError, match="expected one of"):
        ItopConfig(view="front")


def test_damaged_and_compressed_files_are_named(tmp_path):
    write(tmp_path)
    labels, depth = (tmp_path / f"ITOP_side_test_{name}.h5" for name in ("labels", "depth_map"))
    whole = depth.read_bytes()
    depth.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=rf"{depth.name}: .*cannot be read.*download it again"):
        benchmark(tmp_path)
    labels.rename(f"{labels}.gz")
    with pytest.raises(InputError, match=r"no such file; decompress ITOP_side_test_labels\.h5\.gz: gunzip"):
        benchmark(tmp_path)


@pytest.mark.skipif(not ITOP_FRAMES.exists(), reason="needs three real frames of ITOP")
def test_joints_of_real_frames_lie_on_the_depth_and_people_are_extracted(tmp_path):
    real = np.load(ITOP_FRAMES)
    people = [f"{number:02d}_{row:05d}" for number, row in enumerate(real["raw_row"])]
    write(tmp_path, people, depth_m=real["depth_mm"] / 1000, joints_m=real["joints_m"])
    itop = benchmark(tmp_path)
    assert itop.sequence_names() == people
    for name in people:
        sequence = itop.read(name)
        uvz = sequence.camera.project(sequence.joints_camera_m[0])
        # The head is above the torso, and the torso above the feet: up is towards row 0.
        assert uvz[Joint.HEAD, 1] < uvz[Joint.TORSO, 1] < uvz[[Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 1].min()
        column, row = np.round(uvz[[Joint.TORSO, Joint.NECK], :2]).astype(int).T
        surface_m = sequence.depth_m[0, row, column]
        assert (np.abs(surface_m - uvz[[Joint.TORSO, Joint.NECK], 2]) < 0.25).all()
        person_m = extract_person(sequence.depth_m, sequence.camera)[0]
        joints = sequence.joints_camera_m[0]
        points = sequence.camera.points(person_m)[person_m > 0]
        low, high = joints.min(axis=0) - 0.3, joints.max(axis=0) + 0.3
        assert len(points) > 4000 and ((points > low) & (points < high)).all(axis=1).mean() > 0.99
        # The extracted person covers every joint in the image.
        found = [person_m[int(v) - 4 : int(v) + 5, int(u) - 4 : int(u) + 5].any() for u, v, _ in uvz]
        assert all(found), [joint.name for joint in Joint if not found[joint]]
