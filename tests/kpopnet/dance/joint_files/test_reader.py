"""One recording in every format becomes the same performance; what is missing or damaged is named."""

import csv
import json
import math
import pickle
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from recorded_points import FRAMES, coco, imperial, person

from kpopnet.camera import Camera
from kpopnet.dance.joint_files.mediapipe import CAMERA
from kpopnet.dance.joint_files.points import (
    COCO_NAMES,
    IMPERIAL_NAMES,
    MEDIAPIPE_NAMES,
)
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.errors import InputError
from kpopnet.networks.lifting import HIPS, READ, Lifting
from kpopnet.skeleton import Joint

TIMES_S = np.arange(FRAMES) / 25.0

TO_KINECT = {"HEAD": "Head", "NECK": "SpineShoulder"} | {
    f"{side.upper()}_{ours}": f"{theirs}{side}"
    for side in ("Left", "Right")
    for ours, theirs in (
        ("SHOULDER", "Shoulder"), ("ELBOW", "Elbow"), ("HAND", "Hand"), ("HIP", "Hip"), ("KNEE", "Knee"), ("FOOT", "Ankle"),
    )
}  # fmt: skip


def write_csv(path: Path, positions: dict[str, np.ndarray], extra: dict[str, object] | None = None) -> Path:
    columns = {f"{name}_{axis}": points[:, k] for name, points in positions.items() for k, axis in enumerate("xyz")}
    columns |= {"time_s": TIMES_S, "state": ["Tracked"] * FRAMES} | (extra or {})
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path


def write_json(path: Path, positions: dict[str, np.ndarray]) -> Path:
    frames = [{"joints": {name: points[k].tolist() for name, points in positions.items()}} for k in range(FRAMES)]
    path.write_text(json.dumps({"fps": 25, "frames": frames}))
    return path


def kinect(**options) -> dict[str, np.ndarray]:
    return {TO_KINECT[name]: points for name, points in person(**options).items()}


def azure(path: Path, camera_down: dict[str, np.ndarray]) -> Path:
    """Millimetres, y down, with a second body in some frames."""
    points = np.stack(list(camera_down.values()), axis=1) * [1000, -1000, -1000]
    frames = [
        {"timestamp_usec": 9_000_000 + 40_000 * k, "bodies": [{"body_id": 3, "joint_positions": points[k].tolist()}]}
        for k in range(FRAMES)
    ]
    for frame in frames[:20]:
        frame["bodies"].insert(0, {"body_id": 1, "joint_positions": np.ones((len(camera_down), 3)).tolist()})
    path.write_text(json.dumps({"joint_names": list(camera_down), "frames": frames, "bone_list": []}))
    return path


def test_one_dance_in_every_format_is_the_same_performance(tmp_path):
    np.savez(tmp_path / "coco.npz", keypoints3d=coco(), fps=25)
    np.savez(tmp_path / "points.npz", points=coco(unit_m=0.01), names=np.array(COCO_NAMES), times_s=TIMES_S)
    (tmp_path / "coco.json").write_text(json.dumps({"keypoints3d": coco(heading_rad=1.0).tolist(), "fps": 25.0}))
    write_csv(tmp_path / "kinect.csv", kinect(z_up=True))
    write_json(tmp_path / "kinect.json", kinect(unit_m=0.001))
    azure(tmp_path / "azure.json", kinect())
    ours = read_performance(tmp_path / "kinect.csv")
    np.savez(tmp_path / "ours.npz", joints_m=ours.joints_m, times_s=TIMES_S)
    head, shoulders = [Joint.HEAD, Joint.NECK], [Joint.LEFT_SHOULDER, Joint.RIGHT_SHOULDER]
    for path in sorted(tmp_path.iterdir()):
        read = read_performance(path)
        np.testing.assert_allclose(read.times_s, TIMES_S, atol=1e-9, err_msg=path.name)
        limbs = np.delete(read.joints_m, head, axis=1) - np.delete(ours.joints_m, head, axis=1)
        np.testing.assert_allclose(limbs, 0, atol=1e-3, err_msg=path.name)
        if path.name.startswith("coco"):  # which has no neck
            middle = read.joints_m[:, shoulders].mean(axis=1)
            np.testing.assert_allclose(read.joints_m[:, Joint.NECK], middle + 0.37 * (read.joints_m[:, Joint.HEAD] - middle))


def test_a_foot_is_the_middle_of_ankle_and_foot_and_a_hand_is_preferred_to_a_wrist(tmp_path):
    positions = kinect()
    positions |= {"FootLeft": positions["AnkleLeft"] + [0, 0, 0.2], "WristLeft": positions["HandLeft"] + [0, 0.5, 0]}
    joints_m = read_performance(write_json(tmp_path / "a.json", positions)).joints_m[0]
    assert joints_m[Joint.RIGHT_FOOT, 2] - joints_m[Joint.LEFT_FOOT, 2] == pytest.approx(0.1, abs=0.01)
    assert joints_m[Joint.RIGHT_HAND, 1] == pytest.approx(joints_m[Joint.LEFT_HAND, 1], abs=0.01)


@pytest.mark.parametrize(("separator", "point"), [(";", ","), ("\t", ","), ("\t", ".")])
def test_a_table_of_a_spreadsheet_is_read_as_one_with_commas_and_points(separator, point, tmp_path):
    path = write_csv(tmp_path / "a.csv", kinect(), {"time_s": np.arange(FRAMES) / 30})
    (tmp_path / "b.csv").write_text(path.read_text().replace(",", separator).replace(".", point))
    one, other = read_performance(path), read_performance(tmp_path / "b.csv")
    np.testing.assert_array_equal(one.joints_m, other.joints_m)
    np.testing.assert_array_equal(one.times_s, other.times_s)


def test_a_missing_file_is_named_once(tmp_path):
    for name in ("a.npz", "a.csv"):
        with pytest.raises(InputError, match=r"a\.\w+: [^'/]*\(No such file or directory\)$"):
            read_performance(tmp_path / name)


@pytest.mark.parametrize("name", ["torso", "SpineMid", "SPINE_NAVEL", "SPINE_NAVAL"])
def test_a_torso_that_is_named_is_the_joint_and_else_it_is_derived(tmp_path, name):
    positions, derived = kinect(), read_performance(write_json(tmp_path / "a.json", kinect()))
    trunk = np.mean([positions[one] for one in ("ShoulderLeft", "ShoulderRight", "HipLeft", "HipRight")], axis=0)
    own = read_performance(write_json(tmp_path / "b.json", positions | {name: trunk + np.array([0.05, 0.1, 0])}))
    assert derived.torso_is_derived and not own.torso_is_derived
    moved_m = own.joints_m - derived.joints_m
    np.testing.assert_allclose(np.linalg.norm(moved_m[:, Joint.TORSO], axis=1), np.hypot(0.05, 0.1), atol=1e-5)
    np.testing.assert_allclose(np.delete(moved_m, Joint.TORSO, axis=1), 0, atol=1e-5)
    never = read_performance(write_csv(tmp_path / "c.csv", positions | {name: np.full((FRAMES, 3), np.nan)}))
    assert never.torso_is_derived


def test_missing_points_are_missing_joints_and_confidence_is_the_least_of_the_points(tmp_path):
    positions = kinect() | {"FootLeft": kinect()["AnkleLeft"]}
    frames = [{"joints": {name: [*points[k], 0.9] for name, points in positions.items()}} for k in range(FRAMES)]
    frames[6]["joints"]["FootLeft"][3] = 0.4
    frames[3]["joints"]["HandLeft"] = None
    frames[4]["joints"]["HipLeft"][3] = 0.25
    del frames[5]["joints"]["HipLeft"]
    (tmp_path / "a.json").write_text(json.dumps({"fps": 25, "frames": frames}))
    read = read_performance(tmp_path / "a.json")
    assert np.flatnonzero(np.isnan(read.joints_m[:, Joint.LEFT_HAND, 0])).tolist() == [3]
    assert read.confidence[4, Joint.TORSO] == read.confidence[4, Joint.LEFT_HIP] == 0.25
    assert read.confidence[5, Joint.TORSO] == 0 and read.confidence[7].min() == 0.9
    assert read.confidence[6, Joint.LEFT_FOOT] == 0.4  # its ankle is surer
    scores = {"HandLeft_x": ["", *kinect()["HandLeft"][1:, 0]], "HandLeft_confidence": np.full(FRAMES, 0.5)}
    read = read_performance(write_csv(tmp_path / "a.csv", kinect(), scores))
    assert np.isnan(read.joints_m[0, Joint.LEFT_HAND]).all() and read.confidence[3, Joint.LEFT_HAND] == 0.5


def mediapipe() -> np.ndarray:
    """(T, 33, 3) MediaPipe's world landmarks of the person of `coco`, y down, about the middle of the hips.

    Fingers lie at the wrist and toes at the ankle; others that COCO lacks at the nose.
    """
    points, ends = coco() * [1, -1, -1], {"pinky": "wrist", "index": "wrist", "foot_index": "ankle"}
    found = []
    for name in MEDIAPIPE_NAMES:
        side, _, part = name.partition("_")
        known = f"{side}_{ends.get(part, part)}"
        found.append(points[:, COCO_NAMES.index(known) if known in COCO_NAMES else 0])
    return np.stack(found, axis=1) - points[:, None, 11:13].mean(axis=2)


def write_landmarks(path: Path, missing: int | None = None, **landmarks: np.ndarray) -> Path:
    """MediaPipe's landmarks, (T, 33, 2 or 3) each, of frames 0.04 s apart, of which one may show no person."""
    frames: list[dict] = [{"timestamp_ms": 40 * number} for number in range(FRAMES)]
    for name, points in landmarks.items():
        for number, frame in enumerate(frames):
            of_frame = [] if number == missing else points[number].tolist()
            frame[name] = [{"x": x, "y": y, "z": z[0] if z else y, "visibility": 0.8} for x, y, *z in of_frame]
    path.write_text(json.dumps({"frames": frames}))
    return path


@pytest.fixture
def changing_nothing(monkeypatch):
    """A network that lifts nothing."""
    layers = {"0.weight": np.zeros((60, READ)), "0.bias": np.zeros(60)}
    monkeypatch.setattr(Lifting, "load", lambda _: Lifting(layers))


def test_mediapipes_landmarks_as_json_and_as_a_line_for_each_point(tmp_path, changing_nothing):
    np.savez(tmp_path / "coco.npz", keypoints3d=coco(), fps=25)
    expected = read_performance(tmp_path / "coco.npz").joints_m
    expected -= expected[:, HIPS].mean(axis=1, keepdims=True)

    def lines(points):
        rows = (f"{40 * k},{index},{x},{y},{z},0.8" for k, frame in enumerate(points) for index, (x, y, z) in enumerate(frame))
        return "\n".join(["timestamp_ms,landmark,x,y,z,visibility", *rows, ""])

    write_landmarks(tmp_path / "a.json", 3, pose_world_landmarks=mediapipe())
    (tmp_path / "b.csv").write_text(lines(mediapipe()))
    for name in ("a.json", "b.csv"):
        read = read_performance(tmp_path / name)
        seen = np.isfinite(read.joints_m).all(axis=(1, 2))
        assert np.flatnonzero(~seen).tolist() == ([3] if name == "a.json" else [])
        np.testing.assert_allclose(read.joints_m[seen], expected[seen], atol=0.02)
        assert read.times_s[2] == pytest.approx(0.08) and read.confidence[2, Joint.LEFT_KNEE] == pytest.approx(0.5)
        assert read.estimator == "webcam"
    (tmp_path / "picture.csv").write_text(lines(mediapipe() * 0.4 + [0.5, 0.5, 0.0]))
    with pytest.raises(InputError, match=r"picture\.csv: points in shares .* needs MediaPipe's pose_world_landmarks"):
        read_performance(tmp_path / "picture.csv")
    write_landmarks(tmp_path / "picture.json", pose_landmarks=mediapipe()[..., :2] + 0.5)
    with pytest.raises(InputError, match=r"picture\.json: points in shares .* needs MediaPipe's pose_world_landmarks"):
        read_performance(tmp_path / "picture.json")
    both = lines(mediapipe()).replace("x,y,z", "world_x,world_y,world_z,x,y,z").replace(",0.8\n", ",320,240,0,0.8\n")
    (tmp_path / "both.csv").write_text(both)  # where they are in a picture of unknown size, too
    np.testing.assert_array_equal(read_performance(tmp_path / "both.csv").joints_m, read.joints_m)


def test_of_two_people_before_mediapipe_a_file_each_is_asked_for(tmp_path, changing_nothing):
    path = write_landmarks(tmp_path / "a.json", pose_world_landmarks=mediapipe())
    frames = json.loads(path.read_text())["frames"]
    for people in (1, 2):
        listed = [{**one, "pose_world_landmarks": people * [one["pose_world_landmarks"]]} for one in frames]
        path.write_text(json.dumps({"frames": listed}))
        if people == 1:
            assert read_performance(path).is_observed
            continue
        with pytest.raises(InputError, match=r"a\.json: pose_world_landmarks: expected one person, found 2; give each"):
            read_performance(path)


@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (720, 1280), (640, 480)])
def test_mediapipes_landmarks_in_the_picture_tell_where_a_person_stands_and_the_pictures_shape(
    tmp_path, changing_nothing, width, height
):
    camera = Camera.centred(CAMERA.fx * math.hypot(width, height) / math.hypot(CAMERA.width, CAMERA.height), width, height)
    place_m = np.array([0.2, 0.1, 3.4])
    shares = (camera.project(mediapipe() + place_m)[..., :2] + 0.5) / [width, height]
    read = read_performance(write_landmarks(tmp_path / "a.json", 3, pose_world_landmarks=mediapipe(), pose_landmarks=shares))
    assert np.isnan(read.joints_m[3]).all() and np.isfinite(read.joints_m[4]).all()
    np.testing.assert_allclose(np.nanmedian(read.joints_m[:, HIPS].mean(axis=1), axis=0), place_m, atol=0.1)


@pytest.mark.parametrize("kind", ["long", "wide"])
def test_mediapipes_landmarks_in_the_picture_are_read_from_csv_too(tmp_path, changing_nothing, kind):
    shares = (CAMERA.project(mediapipe() + np.array([0.2, 0.1, 3.4]))[..., :2] + 0.5) / [CAMERA.width, CAMERA.height]
    write_landmarks(tmp_path / "a.json", pose_world_landmarks=mediapipe(), pose_landmarks=shares)
    values = np.concatenate([mediapipe(), shares, np.full((*shares.shape[:2], 2), [0.0, 0.8])], axis=2)  # z, visibility
    columns = "world_x", "world_y", "world_z", "x", "y", "z", "visibility"
    if kind == "long":
        header = "timestamp_ms", "landmark", *columns
        rows = [
            (40 * k, name, *one) for k, frame in enumerate(values) for name, one in zip(MEDIAPIPE_NAMES, frame, strict=True)
        ]
    else:
        header = "timestamp_ms", *(f"{name}_{column}" for name in MEDIAPIPE_NAMES for column in columns)
        rows = [(40 * k, *frame.ravel()) for k, frame in enumerate(values)]
    (tmp_path / "a.csv").write_text("\n".join(",".join(map(str, row)) for row in [header, *rows]))
    expected = read_performance(tmp_path / "a.json")
    np.testing.assert_array_equal(read_performance(tmp_path / "a.csv").joints_m, expected.joints_m)


def test_names_of_mediapipes_points_may_be_spelt_otherwise_and_a_joint_map_of_another_file_changes_nothing(tmp_path):
    names = [name.upper() for name in MEDIAPIPE_NAMES]
    path = write_csv(tmp_path / "a.csv", dict(zip(names, np.moveaxis(mediapipe(), 1, 0), strict=True)))
    (tmp_path / "map.json").write_text(json.dumps({"left_hand": "LWRA"}))
    read, mapped = read_performance(path), read_performance(path, joint_map=tmp_path / "map.json")
    assert read.estimator == mapped.estimator == "webcam"
    np.testing.assert_array_equal(read.joints_m, mapped.joints_m)


def test_mediapipes_points_outside_the_picture_are_not_seen(tmp_path):
    shares = 0.5 + [0.2, 0.3] * mediapipe()[..., :2]
    feet = [number for number, name in enumerate(MEDIAPIPE_NAMES) if name.endswith(("ankle", "foot_index", "heel"))]
    shares[1:, feet, 1] = 1.05
    read = read_performance(write_landmarks(tmp_path / "a.json", pose_world_landmarks=mediapipe(), pose_landmarks=shares))
    assert not read.confidence[1:, Joint.LEFT_FOOT].any() and read.confidence[0, Joint.LEFT_FOOT] > 0
    assert (read.confidence[1:, Joint.RIGHT_SHOULDER] > 0).all()


@pytest.mark.parametrize("far", [math.nan, -50.0, 1e5])
def test_a_point_of_mediapipes_that_is_no_part_of_the_person_is_not_seen(tmp_path, far):
    points = mediapipe()
    points[2, [MEDIAPIPE_NAMES.index(name) for name in ("left_wrist", "left_thumb")], 2] = far
    read = read_performance(write_landmarks(tmp_path / "a.json", pose_world_landmarks=points))
    assert np.isfinite(read.joints_m[[1, 3]]).all() and np.isnan(read.joints_m[2, Joint.LEFT_HAND]).all()
    assert np.isfinite(read.joints_m[2, Joint.RIGHT_HAND]).all() and not read.confidence[2, Joint.LEFT_HAND]


def write_counted(path: Path, extra: dict[str, object]) -> Path:
    """A table without times."""
    write_csv(path, person(), extra).write_text(path.read_text().replace("time_s", "clock", 1))
    return path


def test_two_people_in_one_table_are_refused(tmp_path):
    path = write_counted(tmp_path / "wide.csv", {"frame_index": np.repeat(np.arange(FRAMES), 2)[:FRAMES]})
    with pytest.raises(InputError, match=r"wide\.csv, line 3: expected one line for \w+ in a frame"):
        read_performance(path, 10)
    lines = ["frame,who,name,x,y,z", *(f"{k},{who},{name},0,1,2" for k in range(3) for who in "ab" for name in person())]
    (tmp_path / "two.csv").write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"two\.csv, line \d+: expected one line for \w+ in a frame"):
        read_performance(tmp_path / "two.csv", 25)
    live = {"Identity": 1 + np.arange(FRAMES) % 2, "time_s": np.arange(FRAMES) // 2 / 30}  # as `kpopnet live` writes it
    path = write_csv(tmp_path / "live.csv", person(), live)
    told = r"live\.csv, line 3, column Identity: expected one person, found 1(\.0)? and 2(\.0)?; give each"
    with pytest.raises(InputError, match=told):
        read_performance(path)


def test_a_person_may_get_another_number_and_columns_of_other_meaning_change_nothing(tmp_path):
    path = tmp_path / "a.csv"
    for extra in ({"identity": 1 + np.arange(FRAMES) // 5}, {"Time": ["12:00"] * FRAMES}, {"Time": 1.7e9 + np.arange(FRAMES)}):
        np.testing.assert_allclose(read_performance(write_csv(path, person(), extra)).times_s, TIMES_S)
    assert len(read_performance(write_counted(path, {"frame": np.arange(FRAMES), "time": ["12:00"] * FRAMES}), 25.0)) == FRAMES


@pytest.mark.parametrize("name", ["Time_S", "Time"])
def test_times_of_a_table_are_known_in_any_case_and_before_numbers(tmp_path, name):
    path = write_csv(tmp_path / "a.csv", person(), {"frame": np.arange(FRAMES) * 2})
    path.write_text(path.read_text().replace("time_s", name, 1))
    np.testing.assert_allclose(read_performance(path).times_s, TIMES_S)


def test_numbers_of_frames_may_be_written_as_fractions(tmp_path):
    numbers = np.delete(np.arange(FRAMES + 2), [3, 4])
    whole, fractions = (
        read_performance(write_counted(tmp_path / f"{name}.csv", {"frame": one}), 25.0)
        for name, one in (("whole", numbers), ("fractions", numbers.astype(float)))
    )
    np.testing.assert_array_equal(fractions.times_s, whole.times_s)
    assert len(whole) == FRAMES + 2


@pytest.mark.parametrize("number", ["frame", "time_s"])
@pytest.mark.parametrize("first", [0, 1, 2, 30])
def test_a_motion_begins_at_one_time_in_wide_and_in_long_tables(tmp_path, number, first):
    clock, points = first + np.delete(np.arange(FRAMES + 1), 7), person()
    clock = clock / 10 if number == "time_s" else clock
    write = write_counted if number == "frame" else partial(write_csv, positions=points)
    write(tmp_path / "wide.csv", extra={number: clock})
    rows = (f"{at},{name},{x},{y},{z}" for k, at in enumerate(clock) for name, one in points.items() for x, y, z in one[[k]])
    (tmp_path / "long.csv").write_text("\n".join([f"{number},name,x,y,z", *rows]))
    one, other = (read_performance(tmp_path / name, 10 if number == "frame" else None) for name in ("wide.csv", "long.csv"))
    np.testing.assert_array_equal(one.times_s, other.times_s)
    np.testing.assert_allclose(one.joints_m, other.joints_m, atol=1e-6)
    begins_s = one.times_s[np.isfinite(one.joints_m).all(axis=(1, 2)).argmax()]
    assert begins_s == pytest.approx((first if number == "time_s" else max(first - 1, 0)) / 10)


def test_a_given_frame_rate_overrides_the_files(tmp_path):
    clock_s = 3 + np.delete(np.arange(FRAMES + 2), [3, 4]) / 25  # which is stretched, from its begin on, with its gaps
    path = write_csv(tmp_path / "a.csv", kinect(), {"time_s": clock_s})
    np.testing.assert_allclose(read_performance(path, 50.0).times_s, 3 + (clock_s - 3) / 2)
    path = write_csv(tmp_path / "a.csv", kinect(), {"time_s": np.full(FRAMES, 2.0)})
    np.testing.assert_allclose(read_performance(path, 50.0).times_s, np.arange(FRAMES) / 50)
    np.savez(tmp_path / "b.npz", keypoints3d=coco())
    with pytest.raises(InputError, match=r"b\.npz: states neither .* \(--teacher-fps or --learner-fps of"):
        read_performance(tmp_path / "b.npz")
    for fps, message in ((0.0, "0 frames a second; expected 1 to 1000"), (3.0, r"frames are 0\.333 s apart, in the median")):
        with pytest.raises(InputError, match=rf"b\.npz: {message}"):
            read_performance(tmp_path / "b.npz", fps)


def test_what_is_missing_is_named(tmp_path):
    positions = kinect()
    del positions["KneeLeft"], positions["HandRight"]
    with pytest.raises(InputError, match=r"a\.json: no point for right_hand, left_knee; it names Head, SpineShoulder"):
        read_performance(write_json(tmp_path / "a.json", positions))
    unseen = kinect() | {"KneeLeft": np.full((FRAMES, 3), np.nan)}
    with pytest.raises(InputError, match=r"a\.csv: left_knee missing in every frame"):
        read_performance(write_csv(tmp_path / "a.csv", unseen))
    joints_m = read_performance(azure(tmp_path / "b.json", kinect())).joints_m
    arrays = {"joints_m": 1000 * joints_m}, {"keypoints3d": 7 * coco()}, {"keypoints3d": coco()[..., [1, 0, 2]]}
    messages = "joints_m is in units of 0.001 m", "not a person's trunk in metres", "neither y nor z points up or down"
    for array, message in zip(arrays, messages, strict=True):
        np.savez(tmp_path / "a.npz", fps=30, **array)
        with pytest.raises(InputError, match=rf"a\.npz: .*{message}"):
            read_performance(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.fbx", "Kaydara FBX Binary", "FBX is a closed format; .*export BVH"),
        ("a.txt", "", r"expected a file that ends with \.npz, \.bvh, \.csv, \.json"),
        ("a.csv", "p_x,p_y,p_z\n1,2,three\n", "line 2: expected a number, found 'three'"),
        ("a.json", '{"frames": [{"joints": {"hip": [1, 2]}}]}', "frame 0, hip: expected 3 numbers"),
        ("a.json", '{"frames": [{"joints": {}, "time_s": 1}, {"joints": {}}]}', "time_s in all frames or in none"),
        ("a.json", '[{"image_id": 1, "keypoints": [1, 2, 2], "score": 0.9}]', "2D keypoints, as of OpenPose or COCO"),
        ("a.json", '{"frames": [{"world_landmarks": [{"x": 1, "y": 1, "z": 1}]}]}', "world_landmarks: expected 33 landmarks"),
        ("a.json", '{"frames": [{"world_landmarks": {"landmark": []}}]}', "world_landmarks is .*expected list"),
    ],
)
def test_other_contents_are_refused(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read_performance(tmp_path / name)


def test_nothing_in_a_file_is_run(tmp_path):
    class Hostile:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "ran",))

    (tmp_path / "a.pkl").write_bytes(pickle.dumps(Hostile()))
    with pytest.raises(InputError, match="a pickle can run code"):
        read_performance(tmp_path / "a.pkl")
    np.savez(tmp_path / "b.npz", keypoints3d=np.array([Hostile()], object))
    (tmp_path / "c.npz").write_bytes(pickle.dumps(Hostile()))
    for name in ("b.npz", "c.npz", "missing.json"):
        with pytest.raises(InputError):
            read_performance(tmp_path / name)
    assert not (tmp_path / "ran").exists()


def test_indices_of_points_are_the_published_ones():
    published = {5: "left_shoulder", 6: "right_shoulder", 9: "left_wrist", 16: "right_ankle"}
    assert {number: COCO_NAMES[number] for number in published} == published and len(COCO_NAMES) == 17
    published = {17: "right_shoulder", 8: "left_elbow", 0: "right_knee", 4: "left_foot", 11: "neck"}
    assert {number: IMPERIAL_NAMES[number] for number in published} == published and len(set(IMPERIAL_NAMES)) == 21


@pytest.mark.parametrize("made", [coco, imperial])
def test_joints_face_the_camera_in_metres_for_any_unit_and_axes(tmp_path, made):
    def joints_m(points):
        names = COCO_NAMES if made is coco else IMPERIAL_NAMES
        np.savez(tmp_path / "a.npz", points=points, names=names, fps=60.0)
        return read_performance(tmp_path / "a.npz").joints_m

    plain = joints_m(made())
    assert plain[0, Joint.LEFT_HAND, 0] > plain[0, Joint.RIGHT_HAND, 0] + 0.5
    assert plain[0, Joint.HEAD, 1] < plain[0, Joint.TORSO, 1] < plain[0, Joint.LEFT_KNEE, 1]
    np.testing.assert_allclose(plain[0, Joint.TORSO, [0, 2]], [0, 2.5], atol=0.05)
    # Knees and hands are a little nearer to the camera than the hips: the dancer's front.
    assert plain[0, Joint.LEFT_KNEE, 2] < plain[0, Joint.LEFT_HIP, 2] - 0.03
    others = made(heading_rad=2.0), made(unit_m=0.01), made(unit_m=0.001, z_up=True), made(heading_rad=-1.0, z_up=True)
    down = made() * [1, -1, -1], made()[..., [0, 2, 1]] * [1, 1, -1]  # y down, z down, both right-handed
    for points in (*others, *down):
        np.testing.assert_allclose(joints_m(points), plain, atol=1e-4)
