"""The folder format of K-Pop sets: written files are read again, and invalid files are rejected."""

import json
import unicodedata
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


def test_mistaken_arguments_of_the_writer_are_one_line(tmp_path):
    write_teacher(str(tmp_path / "a"), Performance(RNG_JOINTS, TIMES_S))
    masked = np.ma.masked_less(RNG_JOINTS, 0)
    for mistaken, message in (
        (lambda: write_teacher(tmp_path, RNG_JOINTS), "the teacher to write: expected a Performance"),
        (lambda: write_teacher(None, Performance(RNG_JOINTS, TIMES_S)), "expected the path of a file or folder, got None"),
        (lambda: write_learner(tmp_path, "jin", ["now"] * FRAMES, RNG_JOINTS), r"jin\.h5: times: expected an array of numbers"),
        (lambda: write_learner(tmp_path, "jin", TIMES_S, masked), r"jin\.h5: joints: a masked array"),
        (lambda: write_learner(tmp_path, None, TIMES_S, RNG_JOINTS), "learner None: expected a name of letters"),
        (lambda: write_learner(tmp_path, "jin", TIMES_S, depth=whole_frames()), "learner jin: depth: expected a PackedDepth"),
        (
            lambda: write_learner(tmp_path, "jin", TIMES_S, RNG_JOINTS, about={"level": np.nan}),
            r"jin\.h5: about: cannot be sto",
        ),
        (
            lambda: write_learner(tmp_path, "jin", TIMES_S, RNG_JOINTS, about={"file": tmp_path}),
            "about: cannot be stored as JSON",
        ),
        (lambda: write_teacher(tmp_path, Performance(RNG_JOINTS, TIMES_S), ["mine"]), "about: expected notes by name"),
        (lambda: write_labels(tmp_path, "jin"), r"labels\.csv: expected a list of names, the best first, got 'jin'"),
        (lambda: write_labels(tmp_path, None), r"labels\.csv: expected a list of names"),
        (lambda: write_labels(tmp_path, ["jin", 2]), "learner 2: expected a name of letters"),
        (lambda: PackedDepth("kinect_2"), r"camera: expected a kpopnet\.camera\.Camera"),
        (
            lambda: PackedDepth(CAMERA).add(whole_frames()[0][:9, :9], 1.5),
            r"depth of frame 0: at \(1\.5, 0\); expected the column",
        ),
        (lambda: KpopSet(None), "expected the path of a file or folder, got None"),
    ):
        with pytest.raises(InputError, match=message):
            mistaken()


def first_learner(folder: Path) -> tuple:
    learner = KpopSet(folder).dance("mama").learners[0]
    return learner.joints(), learner.depth()


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


def test_labels_have_any_order_of_lines(folder):
    path = folder / "mama" / "labels.csv"
    path.write_text("learner, rank\njin, 2\n\nann , 1\n")
    assert read_labels(path) == ["ann", "jin"]


@pytest.mark.parametrize(("of_file", "of_label"), [("NFD", "NFC"), ("NFC", "NFD")])
def test_a_learner_is_found_whether_letters_are_whole_or_in_parts(folder, of_file, of_label):
    """As of files from a Mac, beside labels that were written elsewhere: both look the same."""
    file, label = (unicodedata.normalize(form, "지민") for form in (of_file, of_label))
    dance = folder / "mama"
    (dance / "ann.h5").rename(dance / f"{file}.h5")
    write_labels(dance, ["jin", label])
    assert [one.path.name for one in KpopSet(folder).dance("mama").learners] == ["jin.h5", f"{file}.h5"]


def test_a_manifest_describes_the_set(folder):
    path = folder / "manifest.json"
    path.write_text(json.dumps({"simulated": True, "name": "x", "about": "made", "dances": 5, "hash": "ab"}))
    manifest = KpopSet(folder).manifest
    assert manifest.origin is Origin.SIMULATED and manifest.dances == 5 and manifest.about == "made"


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("manifest.json", '{"dances": "many"}', r"manifest\.json.*not a manifest"),
        ("mama/labels.csv", "name,place\njin,1\n", r"labels\.csv.*a first line learner,rank"),
        ("mama/labels.csv", "learner,rank\n../jin,1\nann,2\n", r"labels\.csv.*row 2"),
        ("mama/labels.csv", "learner,rank\njin,1\nbo,2\n", r"bo\.h5: missing, though labels\.csv ranks bo; there are ann, jin"),
        ("mama/jin.h5", {"boxes": np.array([[0, 0, 81, 64]] * FRAMES)}, r"jin\.h5.* is not within 80x64"),
        ("mama/jin.h5", {"boxes": np.zeros((FRAMES, 4), int), "depth_mm": np.zeros(0, np.uint16)}, "a person in one of its 6"),
        ("mama/jin.h5", {"times_s": np.zeros(FRAMES)}, r"jin\.h5.*times that increase"),
        ("mama/jin.h5", {"joints_m": np.full((FRAMES, 15, 3), 1800.0, np.float32)}, r"jin\.h5.*at most 1000 m"),
    ],
)
def test_what_is_invalid_is_named(folder, file, content, message):
    if isinstance(content, str):
        (folder / file).write_text(content)
    else:
        with h5py.File(folder / file, "a") as stored:
            for name, data in content.items():
                del stored[name]
                stored[name] = data
    with pytest.raises(InputError, match=message):
        first_learner(folder)


def test_what_is_not_there_is_named(folder):
    with pytest.raises(InputError, match="dance=papa: not among the 1"):
        KpopSet(folder).dance("papa")
    with pytest.raises(InputError, match="dance=None: not among the 1"):
        KpopSet(folder).dance(None)
    with pytest.raises(InputError, match=r"benchmark=kpop needs benchmark\.path"):
        open_set(KpopConfig())
    with pytest.raises(InputError, match="expected the path of a file or folder, got 3"):
        open_set(KpopConfig(path=3))
