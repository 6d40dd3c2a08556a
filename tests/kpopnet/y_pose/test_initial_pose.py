"""The initial model: people with known joints in the Y pose, other poses, and images without a person."""

import cv2
import numpy as np
import pytest
from cone_people import error_m
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from real_data import UTD_MHAD
from y_people import draw_y, family, simulated, y_angles, y_joints

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from kpopnet.geometry.cones import torso_frame
from kpopnet.skeleton import JOINT_GROUPS, Joint
from kpopnet.y_pose.initial_pose import NotYPose, find_initial_pose, initial_pose
from synth.motion.poses import FAMILIES

CAMERA = CAMERAS["kinect_v1"]
PLACE_M = (0.0, 0.15, 3.3)
ARMS = [*JOINT_GROUPS["elbows"], *JOINT_GROUPS["hands"]]


# --- a person of spheres ------------------------------------------------------------------------------------------


OF_OTHER_PIXELS = {"high": Camera(285.6, 571.2, 159.5, 239.5, 320, 480), "wide": Camera(285.6, 142.8, 159.5, 59.5, 320, 120)}
"""Cameras whose pixels are half as high as wide, and twice."""


@pytest.mark.parametrize(
    ("name", "place_m"),
    [
        ("kinect_v1", (0.6, 0.1, 3.9)),
        ("kinect_2", (0.0, 0.1, 2.4)),
        *((name, (0.0, 0.1, 3.3)) for name in ("smmc10", *OF_OTHER_PIXELS)),
    ],
)
def test_known_joints_are_found_with_any_camera(name: str, place_m: tuple) -> None:
    joints, camera = y_joints(place_m=place_m), (CAMERAS | OF_OTHER_PIXELS)[name]
    pose = initial_pose(draw_y(joints, camera), camera)
    error = error_m(pose, joints)
    # Arms and knees lie on the axes of round limbs. Feet and head differ: the feet are ankles and the head excludes the neck.
    assert error[ARMS].max() < 0.05
    assert error[JOINT_GROUPS["knees"],].max() < 0.05
    assert error.max() < 0.11


@pytest.mark.parametrize(("elevation_deg", "abduction_deg", "yaw_deg"), [(25, 8, 0), (45, 20, -18), (65, 12, 18)])
def test_variants_of_the_y_pose_are_accepted(elevation_deg: float, abduction_deg: float, yaw_deg: float) -> None:
    joints = y_joints(elevation_deg, abduction_deg, yaw_deg=yaw_deg, place_m=PLACE_M)
    pose = initial_pose(draw_y(joints, CAMERA), CAMERA)
    assert error_m(pose, joints).max() < 0.11
    assert torso_frame(joints)[2] @ torso_frame(pose)[2] > np.cos(np.radians(8))


def test_bent_elbows_are_at_the_intersection_of_the_lines() -> None:
    joints = y_joints(elevation_deg=40, elbow_deg=30, place_m=(0, 0.15, 3.2))
    # At a fixed share of the arm they would be 2.4 cm off.
    assert error_m(initial_pose(draw_y(joints, CAMERA), CAMERA), joints)[ARMS].max() < 0.02


# --- refusals -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"elevation_deg": 0}, "arm above level"),
        ({"elevation_deg": -60}, "limb|arm|outside the skeleton"),
        ({"elevation_deg": 30, "elbow_deg": 90}, "bend of|arm"),
        ({"abduction_deg": 0.0}, "crotch|legs"),
        ({"yaw_deg": 38}, "heading"),
    ],
)
def test_other_poses_are_refused_with_the_reason(wrong: dict, reason: str) -> None:
    depth = draw_y(y_joints(place_m=PLACE_M, **wrong), CAMERA)
    with pytest.raises(NotYPose, match=reason):
        initial_pose(depth, CAMERA)
    assert find_initial_pose(depth, CAMERA) is None


def test_a_back_hands_at_the_edge_and_a_missing_hand_are_refused() -> None:
    with pytest.raises(NotYPose, match="back"):
        initial_pose(draw_y(y_joints(place_m=PLACE_M), CAMERA, back=True), CAMERA)
    with pytest.raises(NotYPose, match="edge"):
        initial_pose(draw_y(y_joints(place_m=(0, 0.15, 2.45)), CAMERA), CAMERA)
    joints = y_joints(place_m=PLACE_M)
    depth = draw_y(joints, CAMERA)
    depth[np.linalg.norm(CAMERA.points(depth) - joints[Joint.LEFT_HAND], axis=-1) < 0.2] = 0
    with pytest.raises(NotYPose, match=r"arm|limb"):
        initial_pose(depth, CAMERA)


def test_what_is_no_image_of_the_camera_is_refused() -> None:
    depth = draw_y(y_joints(place_m=PLACE_M), CAMERA)
    for wrong in ((depth * 1000).astype(np.uint16), depth[None], depth[:, :200], depth.tolist()):
        with pytest.raises(InputError, match="Y pose: "):
            initial_pose(wrong, CAMERA)
    with pytest.raises(InputError, match="camera: expected a"):
        find_initial_pose(depth, None)


ODD = st.one_of(st.sampled_from([0.0, 0.0, 1.5, 2.0, 2.0, 2.02, np.nan, np.inf, -1.0]), st.floats(width=32))


@given(arrays(np.float32, st.tuples(st.integers(1, 40), st.integers(1, 40)), elements=ODD))
@settings(deadline=None, max_examples=25)
def test_garbage_is_refused(depth: np.ndarray) -> None:
    camera = Camera.centred(40.0, depth.shape[1], depth.shape[0])
    assert find_initial_pose(depth, camera) is None


@pytest.mark.parametrize("fy", [0.02, 19.0, 21.0, 23.8, 1e4])
def test_few_rows_of_pixels_that_are_not_square_are_refused_in_short_time(fy: float) -> None:
    for height in (1, 18, 20):
        camera = Camera(20.0, fy, 15.0, height / 2, 30, height)
        assert find_initial_pose(np.full((height, 30), 2, np.float32), camera) is None


# --- simulated people ---------------------------------------------------------------------------------------------


def test_simulated_people_in_the_y_pose() -> None:
    people = [
        (find_initial_pose(depth, camera), joints) for depth, camera, joints in simulated(family(y_angles), 50, "test", seed=3)
    ]
    found = [(pose, error_m(pose, joints)) for pose, joints in people if pose is not None]
    assert len(people) >= 10 and len(found) >= 0.6 * len(people)
    assert np.mean([error for _, error in found]) < 0.055 and np.max([error for _, error in found]) < 0.25


def other_poses(generator: np.random.Generator) -> dict[str, float]:
    """Y poses with one error, and people who sit, kneel, bend, squat, lie or stand on their hands, from `synth`."""
    pose = y_angles(generator)
    kind = int(generator.random() * 8)
    if kind < 3:
        wrong = ({"elevation_deg": (-12, 5)}, {"elevation_deg": (-80, -20)}, {"elbow_deg": (60, 130)})[kind]
        return y_angles(generator, **wrong)
    if kind < 5:
        return pose | ({"left_raise": 12.0, "left_elbow": 10.0}, {"hips_yaw": 180.0})[kind - 3]
    name = ("sit", "kneel", "squat", "bend_forward", "lie", "handstand")[int(generator.random() * 6)]
    other = FAMILIES[name][1](generator)
    arms = ("raise", "plane", "elbow", "pronate")
    return other | ({channel: pose[channel] for channel in pose if channel.endswith(arms)} if kind < 7 else {})


def test_no_tracker_starts_with_a_wrong_pose() -> None:
    """A pose at the limit may be accepted, a wrong skeleton must not."""
    seen = simulated(family(other_poses), 80, "test", seed=4)
    people = [(find_initial_pose(depth, camera), joints) for depth, camera, joints in seen]
    accepted = [error_m(pose, joints).max() for pose, joints in people if pose is not None]
    assert len(people) > 15 and len(accepted) <= 3 and max(accepted, default=0) < 0.25


@pytest.mark.skipif(not UTD_MHAD.is_dir(), reason="the UTD-MHAD data set is not installed")
def test_real_people_in_other_poses_are_refused() -> None:
    from kpopnet.datasets.utd_mhad import UtdMhadBenchmark, UtdMhadConfig

    benchmark = UtdMhadBenchmark(UtdMhadConfig(path=str(UTD_MHAD), lag=0))
    for name in benchmark.sequence_names()[::24]:
        sequence = benchmark.read(name)
        assert all(find_initial_pose(depth, sequence.camera) is None for depth in sequence.depth_m[::8])


def test_the_last_bit_of_opencvs_distances_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = CAMERAS["kinect_v1"]
    depth_m = draw_y(y_joints(), camera)
    before, transform = find_initial_pose(depth_m, camera), cv2.distanceTransform
    monkeypatch.setattr(cv2, "distanceTransform", lambda *given: np.nextafter(transform(*given), np.float32(1e9)))
    assert np.array_equal(before, find_initial_pose(depth_m, camera))
