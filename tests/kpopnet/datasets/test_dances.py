"""The folder format of K-Pop sets: written files are read again, and invalid files are rejected."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from kpopnet.camera import Camera
from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.dance_set import MARGIN_PX, KpopConfig, KpopSet, open_set, read_labels
from kpopnet.datasets.dances.writer import PackedDepth, write_labels, write_learner, write_teacher
from kpopnet.datasets.protocol import Origin
from kpopnet.errors import InputError

CAMERA = Camera.centred(60.0, 80, 64)
FRAMES = 6
TIMES_S = np.arange(FRAMES) / 30
RNG_JOINTS = np.random.default_rng(0).normal(size=(FRAMES, 15, 3)).astype(np.float32)


def whole_frames() -> np.ndarray:
    """(T, H, W) metres in whole millimetres: a moving blob that touches the border; no person in frame 3."""
    depth_m = np.zeros((FRAMES, CAMERA.height, CAMERA.width), np.float32)
    for frame in range(FRAMES):
        if frame != 3:
            depth_m[frame, 10 + frame : 30, 8 * frame : 8 * frame + 12] = 2.0 + 0.001 * frame
            depth_m[frame, 15, 8 * frame + 3] = 0  # a hole
    return depth_m


def packed(depth_m: np.ndarray) -> PackedDepth:
    recording = PackedDepth(CAMERA)
    for image in depth_m:
        recording.add(image)
    return recording


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A set with one dance."""
    dance = tmp_path / "set" / "mama"
    write_teacher(dance, Performance(RNG_JOINTS, TIMES_S))
    write_learner(dance, "jin", TIMES_S, RNG_JOINTS, packed(whole_frames()), {"level": "best"})
    write_learner(dance, "ann", TIMES_S, RNG_JOINTS)
    write_labels(dance, ["jin", "ann"])
    return tmp_path / "set"


def test_written_files_are_read_again(folder):
    dances = KpopSet(folder)
    assert dances.names == ["mama"] and dances.manifest.origin is Origin.REAL and dances.manifest.dances is None
    dance = dances.dance("mama")
    assert [learner.name for learner in dance.learners] == ["jin", "ann"]
    np.testing.assert_array_equal(dance.teacher().joints_m, RNG_JOINTS.astype(np.float64))
    jin, ann = dance.learners
    np.testing.assert_array_equal(jin.joints().times_s, TIMES_S)
    assert jin.about == {"level": "best"} and ann.about == {} and ann.depth_key is None
    clip = jin.depth()
    # Pasted into the whole image, the depth equals the input.
    x0, y0 = round(CAMERA.cx - clip.camera.cx), round(CAMERA.cy - clip.camera.cy)
    restored_m = np.zeros((FRAMES, CAMERA.height, CAMERA.width), np.float32)
    restored_m[:, y0 : y0 + clip.camera.height, x0 : x0 + clip.camera.width] = clip.depth_m
    np.testing.assert_allclose(restored_m, whole_frames(), atol=1e-6)
    assert (x0, y0) == (0, 10 - MARGIN_PX) and clip.camera.width == 52 + MARGIN_PX
    with pytest.raises(InputError, match=r"ann\.h5: expected a recording depth_mm"):
        ann.depth()


def test_a_depth_key_distinguishes_recordings_and_need_not_be_stored(folder):
    learner = KpopSet(folder).dance("mama").learners[0]
    key = learner.depth_key
    for invalid in ("", "/../../../../evil", key[:15], 7):  # it becomes part of a file name
        with h5py.File(learner.path, "a") as file:
            file.attrs["depth_key"] = invalid
        assert KpopSet(folder).dance("mama").learners[0].depth_key == key
    other = whole_frames()
    other[0, 12, 2] += 0.001
    write_learner(folder / "mama", "jin", TIMES_S, RNG_JOINTS, packed(other))
    assert KpopSet(folder).dance("mama").learners[0].depth_key != key


def test_labels_have_any_order_of_lines_and_their_names_are_no_paths(folder):
    path = folder / "mama" / "labels.csv"
    path.write_text("learner, rank\njin, 2\n\nann , 1\n")
    assert read_labels(path) == ["ann", "jin"]
    for text, message in (("name,place\njin,1\n", "a first line learner,rank"), ("learner,rank\n../jin,1\nann,2\n", "row 2")):
        path.write_text(text)
        with pytest.raises(InputError, match=rf"labels\.csv.*{message}"):
            KpopSet(folder).dance("mama")


def test_missing_files_are_named(folder, tmp_path):
    (folder / "mama" / "ann.h5").unlink()
    with pytest.raises(InputError, match=r"ann\.h5: missing, though labels\.csv ranks ann; there are jin"):
        KpopSet(folder).dance("mama")
    with pytest.raises(InputError, match="dance=papa: not among the 1"):
        KpopSet(folder).dance("papa")
    with pytest.raises(InputError, match=r"benchmark=kpop needs benchmark\.path"):
        open_set(KpopConfig())


def test_a_manifest_describes_the_set(folder):
    path = folder / "manifest.json"
    path.write_text(json.dumps({"simulated": True, "name": "x", "about": "made", "dances": 5, "hash": "ab"}))
    manifest = KpopSet(folder).manifest
    assert manifest.origin is Origin.SIMULATED and manifest.dances == 5 and manifest.about == "made"
    path.write_text('{"dances": "many"}')
    with pytest.raises(InputError, match="not a manifest"):
        KpopSet(folder)


@pytest.mark.parametrize(
    ("learner", "name", "data", "message"),
    [
        (0, "boxes", np.array([[0, 0, 81, 64]] * FRAMES), "is not within 80x64"),
        (0, "times_s", np.zeros(FRAMES), "times that increase"),
        (1, "joints_m", np.full((FRAMES, 15, 3), 1800.0, np.float32), "at most 1000 m"),
    ],
)
def test_invalid_arrays_are_named(folder, learner, name, data, message):
    found = KpopSet(folder).dance("mama").learners[learner]
    with h5py.File(found.path, "a") as file:
        del file[name]
        file[name] = data
    with pytest.raises(InputError) as caught:
        found.joints() if learner else found.depth()
    assert message in str(caught.value) and found.path.name in str(caught.value)


def test_a_recording_without_a_person_is_rejected(folder):
    write_learner(folder / "mama", "jin", TIMES_S, None, packed(np.zeros_like(whole_frames())))
    with pytest.raises(InputError, match="a person in one of its 6 frames"):
        KpopSet(folder).dance("mama").learners[0].depth()
